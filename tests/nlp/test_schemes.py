"""The collocation schemes against tables of Runge-Kutta methods and against exact integrals of polynomials."""

import numpy as np
import pytest

from hopopt.errors import UsageError
from hopopt.nlp.schemes import HERMITE_SIMPSON, TRAPEZOIDAL, Scheme, lagrange, radau, scheme

ALL = [radau(d) for d in (1, 2, 3, 4, 5, 7)] + [HERMITE_SIMPSON, TRAPEZOIDAL]
each_scheme = pytest.mark.parametrize("method", ALL, ids=lambda s: s.name)


@pytest.mark.parametrize(
    ("degree", "nodes"),
    [
        (1, [1.0]),
        (2, [1 / 3, 1.0]),
        (3, [(4 - np.sqrt(6)) / 10, (4 + np.sqrt(6)) / 10, 1.0]),
    ],
)
def test_radau_nodes_are_those_of_the_tables(degree: int, nodes: list[float]) -> None:
    """Hairer and Wanner, Solving ODEs II, tables IV.5.5 and IV.5.6."""
    np.testing.assert_allclose(radau(degree).c, nodes, rtol=0, atol=1e-14)


def test_radau_nodes_are_real_where_numpy_gives_roots_as_complex_numbers(monkeypatch: pytest.MonkeyPatch) -> None:
    """As numpy does from 2.5 on; a warning that an imaginary part is lost would be an error here."""
    real = np.polynomial.legendre.legroots
    monkeypatch.setattr(np.polynomial.legendre, "legroots", lambda series: real(series).astype(complex))
    assert radau.__wrapped__(5).c == radau(5).c


def test_integration_matrices_are_those_of_the_tables() -> None:
    """Radau IIA of order 3, and Lobatto IIIA of orders 2 and 4 without their zero first row."""
    np.testing.assert_allclose(radau(2).A, [[5 / 12, -1 / 12], [3 / 4, 1 / 4]], atol=1e-14)
    np.testing.assert_allclose(TRAPEZOIDAL.A, [[1 / 2, 1 / 2]], atol=1e-14)
    np.testing.assert_allclose(HERMITE_SIMPSON.A, [[5 / 24, 1 / 3, -1 / 24], [1 / 6, 2 / 3, 1 / 6]], atol=1e-14)


@each_scheme
def test_quadrature_is_exact_to_one_degree_less_than_the_order(method: Scheme) -> None:
    """Order p means exact integrals of polynomials of degree p - 1, and no more."""
    c = np.array(method.c)
    error = [method.b @ c**k - 1 / (k + 1) for k in range(method.order + 1)]
    np.testing.assert_allclose(error[:-1], 0.0, atol=1e-12)
    assert abs(error[-1]) > 1e-9


@each_scheme
def test_integration_matrix_integrates_polynomials_to_every_node(method: Scheme) -> None:
    c = np.array(method.c)
    nodes = c[-method.steps :]
    for k in range(len(c)):
        np.testing.assert_allclose(method.A @ c**k, nodes ** (k + 1) / (k + 1), atol=1e-12)


@each_scheme
def test_last_node_is_the_end_of_the_interval(method: Scheme) -> None:
    """Stiffly accurate: the last row of A is b, so path constraints hold at the end of every interval."""
    assert method.c[-1] == 1.0
    np.testing.assert_allclose(method.A[-1], method.b, atol=1e-13)
    assert method.steps == len(method.c) - (method.c[0] == 0.0)


@pytest.mark.parametrize("degree", [1, 2, 3, 4, 5, 7])
def test_radau_is_stiffly_stable(degree: int) -> None:
    """L-stability: R(inf) = 1 - b' A^-1 1 = 0, and |R| <= 1 on the imaginary axis."""
    method, one = radau(degree), np.ones(degree)
    assert abs(1 - method.b @ np.linalg.solve(method.A, one)) < 1e-10
    for y in (0.1, 1.0, 10.0, 1000.0):
        growth = 1 + 1j * y * method.b @ np.linalg.solve(np.eye(degree) - 1j * y * method.A, one)
        assert abs(growth) <= 1 + 1e-12


@each_scheme
def test_interpolants_reproduce_polynomials(method: Scheme) -> None:
    """A state of degree n from its derivative at the n abscissae, anything of degree n - 1 from its values."""
    c, s = np.array(method.c), np.linspace(0, 1, 11)
    state = np.polynomial.Polynomial(np.arange(1.0, len(c) + 2))
    np.testing.assert_allclose(state(0) + method.state_weights(s) @ state.deriv()(c), state(s), atol=1e-10)
    np.testing.assert_allclose(lagrange(method.c, s) @ state.deriv()(c), state.deriv()(s), atol=1e-10)
    np.testing.assert_allclose(method.control_weights(c), np.eye(len(c)), atol=1e-10)


def test_schemes_are_found_by_name() -> None:
    assert scheme("radau-3").c == radau(3).c
    assert scheme("radau", 5).order == 9
    assert scheme("hermite-simpson") is HERMITE_SIMPSON
    assert all(scheme(s.name).c == s.c for s in ALL)
    with pytest.raises(UsageError, match="there is no scheme 'euler'"):
        scheme("euler")
