"""Collocation schemes as data: everything follows from the abscissae in [0, 1].

On an interval of length h the state's derivative is the polynomial through its values f_j at the abscissae c.
So x(s) = x(0) + h sum_j B_j(s) f_j, with B_j(s) the integral of the j-th Lagrange polynomial. Collocation makes
this exact at every c_k. These are the implicit Runge-Kutta methods Radau IIA (flipped Legendre-Gauss-Radau)
and Lobatto IIIA (trapezoidal, Hermite-Simpson); Hairer and Wanner, Solving ODEs II, IV.5. All of them
collocate the right end of the interval, so path constraints hold where a phase is decided. The controls are
polynomials of their own, through their values at control_c.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
from numpy.polynomial import legendre

from hopopt.extensions import Registry


@dataclass(frozen=True)
class Scheme:
    """A collocation scheme: its name, its abscissae c, those of its controls, its order at the mesh points."""

    name: str
    c: tuple[float, ...]
    control_c: tuple[float, ...]
    order: int

    @property
    def starts_at_node(self) -> bool:
        """Whether the left end of an interval is collocated too (Lobatto)."""
        return self.c[0] == 0.0

    @property
    def steps(self) -> int:
        """State nodes an interval adds."""
        return len(self.c) - self.starts_at_node

    @cached_property
    def _integrals(self) -> np.ndarray:
        """Coefficients (in powers 1..n of s) of the integrated Lagrange polynomials, shape (n, n + 1)."""
        n = len(self.c)
        return np.hstack([np.zeros((n, 1)), _lagrange_powers(self.c).T / np.arange(1, n + 1)])

    def state_weights(self, s: np.ndarray | float) -> np.ndarray:
        """B_j(s): integrals of the Lagrange polynomials from 0 to s, shape (len(s), n)."""
        powers = np.vander(np.atleast_1d(np.asarray(s, dtype=float)), len(self.c) + 1, increasing=True)
        return powers @ self._integrals.T

    def control_weights(self, s: np.ndarray | float) -> np.ndarray:
        """Lagrange polynomials through the abscissae at s, shape (len(s), n)."""
        return lagrange(self.c, s)

    @cached_property
    def A(self) -> np.ndarray:
        """Integration matrix (steps, n): x_k = x_0 + h sum_j A_kj f_j at every new state node."""
        return self.state_weights(np.array(self.c[len(self.c) - self.steps :]))

    @cached_property
    def b(self) -> np.ndarray:
        """Quadrature weights over the interval, shape (n,)."""
        return self.state_weights(1.0)[0]


def lagrange(nodes: Sequence[float], s: np.ndarray | float) -> np.ndarray:
    """Lagrange polynomials through ``nodes`` at s, shape (len(s), len(nodes))."""
    return np.vander(np.atleast_1d(np.asarray(s, dtype=float)), len(nodes), increasing=True) @ _lagrange_powers(nodes)


def _lagrange_powers(nodes: Sequence[float]) -> np.ndarray:
    """Coefficients of the Lagrange polynomials, one in each column, from the power 0 on. SciPy's interpolators give values
    alone, and the integrals need the powers; the nodes are few, so that the inverse is exact to rounding."""
    return np.linalg.inv(np.vander(nodes, len(nodes), increasing=True))


@cache
def radau(degree: int) -> Scheme:
    """Flipped Legendre-Gauss-Radau (Radau IIA) with ``degree`` points, order 2 degree - 1."""
    series = np.zeros(degree + 1)
    series[[degree - 1, degree]] = 1.0  # P_{d-1} + P_d vanishes at -1 and at the other Radau points
    roots = legendre.legroots(series).real  # they are real, and complex numbers from numpy 2.5 on
    roots = np.sort(-roots)  # flip: the right end is a node
    roots[-1] = 1.0
    c = tuple(float(x) for x in (roots + 1) / 2)
    return Scheme(f"radau-{degree}", c, c, 2 * degree - 1)


TRAPEZOIDAL = Scheme("trapezoidal", (0.0, 1.0), (0.0, 1.0), 2)
HERMITE_SIMPSON = Scheme("hermite-simpson", (0.0, 0.5, 1.0), (0.0, 0.5, 1.0), 4)


SCHEMES = Registry("scheme", {s.name: s for s in (TRAPEZOIDAL, HERMITE_SIMPSON)})  # and radau of every degree
HIGHEST_DEGREE = 12  # degree of a stored radau scheme


def scheme(name: str, degree: int = 4) -> Scheme:
    """The scheme called ``radau``, ``hermite-simpson`` or ``trapezoidal`` (or as ``Scheme.name`` spells it), or an added one;
    UsageError if there is none."""
    if name == "radau":
        return radau(degree)
    if name in SCHEMES:
        return SCHEMES[name]
    return next((r for k in range(1, HIGHEST_DEGREE + 1) if (r := radau(k)).name == name), None) or SCHEMES[name]
