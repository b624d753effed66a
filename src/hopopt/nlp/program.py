"""The functions an NLP solver needs, f and g and their exact derivatives, from a program's terms."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca

from hopopt.nlp.terms import Matrix, Scattered, Term, assemble, to_dm


@dataclass(frozen=True)
class Program:
    """f = ends[0] and g = linear z + rows of the phases + ends[1:], over z and the fixed parameters p.

    The first ``rows[k]`` outputs of phase k scatter to g; the rest are integrands, whose rows come after those
    of g: ``count`` integrals, with which the extra inputs of ``ends`` begin.
    """

    linear: Matrix
    phases: tuple[Term, ...]
    rows: tuple[int, ...]
    ends: Term
    count: int

    def symbols(self) -> tuple[ca.MX, ca.MX]:
        """z and p."""
        return ca.MX.sym("x", self.linear.shape[1]), ca.MX.sym("p", self.ends.local.extra.numel() - self.count)

    @property
    def integrals(self) -> ca.SX:
        """The ends' symbols for the integrals."""
        return self.ends.local.extra[: self.count]

    @cached_property
    def row_terms(self) -> list[Term]:
        """The phases without their integrands."""
        g = slice(self.linear.shape[0])
        return [t.part(slice(n), g) for t, n in zip(self.phases, self.rows, strict=True)]

    @cached_property
    def integral_terms(self) -> list[Term]:
        """The integrands of the phases that have some."""
        after = slice(self.linear.shape[0], None)
        counted = zip(self.phases, self.rows, strict=True)
        return [t.part(slice(n, None), after) for t, n in counted if t.local.outputs.numel() > n]

    @cached_property
    def cost(self) -> Term:
        """f."""
        return self.ends.part(slice(1), slice(1))

    @cached_property
    def boundary(self) -> Term:
        """What the ends add to g."""
        return self.ends.part(slice(1, None), slice(1, None))

    @cached_property
    def linear_dm(self) -> ca.DM:
        """``linear`` for CasADi."""
        return to_dm(self.linear)

    def integral(self, z: ca.MX, p: ca.MX) -> ca.MX:
        """All integrals, (count, 1)."""
        return sum((t.values(z, p) for t in self.integral_terms), ca.MX.zeros(self.count, 1))

    def integral_slope(self, z: ca.MX, p: ca.MX) -> tuple[ca.MX, ca.MX]:
        """All integrals and their derivative by z, (count, n)."""
        value, slopes = sum_of([t.jacobian(z, p) for t in self.integral_terms])
        return self.no_integrals() + value, assemble((self.count, self.linear.shape[1]), slopes)

    def _of_rows(self, extra: ca.MX, p: ca.MX) -> list[tuple[Term, ca.MX]]:
        """The terms of g that have outputs, each with its further inputs."""
        terms = [(self.boundary, extra), *((term, p) for term in self.row_terms)]
        return [(term, more) for term, more in terms if term.local.outputs.numel()]

    def no_integrals(self) -> ca.MX:
        """Zeros for functions that do not depend on the integrals."""
        return ca.MX.zeros(self.count, 1)

    @cached_property
    def nlp(self) -> dict[str, ca.MX]:
        """x, p, f, g for nlpsol."""
        z, p = self.symbols()
        extra = ca.vertcat(self.integral(z, p), p)
        g = self.linear_dm @ z
        for term, more in self._of_rows(extra, p):
            g += term.values(z, more)
        return {"x": z, "p": p, "f": self.cost.values(z, extra), "g": g}

    def grad_f(self) -> ca.Function:
        """(x, p) -> f, gradient."""
        z, p = self.symbols()
        integral, slope = self.integral_slope(z, p)
        extra = ca.vertcat(integral, p)
        f, direct = self.cost.jacobian(z, extra)
        by_integral = self.cost.at_ends("slope", z, extra, ca.jacobian(self.cost.local.outputs, self.integrals))
        row = assemble((1, self.linear.shape[1]), [direct]) + by_integral @ slope
        return ca.Function("nlp_grad_f", [z, p], [f, ca.densify(row.T)], ["x", "p"], ["f", "grad"])

    def jac_g(self) -> ca.Function:
        """(x, p) -> g, jacobian."""
        z, p = self.symbols()
        local = ca.jacobian(self.boundary.local.outputs, self.integrals)
        integral, slope = self.integral_slope(z, p) if local.nnz() else (self.no_integrals(), None)
        extra = ca.vertcat(integral, p)
        g, parts = sum_of([term.jacobian(z, more) for term, more in self._of_rows(extra, p)])
        J = assemble(self.linear.shape, parts, self.linear)
        if slope is not None:
            J += self.boundary.scatter_dm @ (self.boundary.at_ends("slope", z, extra, local) @ slope)
        outputs = [self.linear_dm @ z + g, J]
        return ca.Function("nlp_jac_g", [z, p], outputs, ["x", "p"], ["g", "jac"])

    def hess_lag(self) -> ca.Function:
        """(x, p, lam_f, lam_g) -> upper triangle of the Hessian of lam_f f + lam_g' g."""
        (z, p), n = self.symbols(), self.linear.shape[1]
        lam_f, lam_g = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", self.linear.shape[0])
        lam = ca.vertcat(lam_f, lam_g)
        w = ca.SX.sym("w", self.ends.local.outputs.numel())
        by_integral = ca.jacobian(ca.dot(w, self.ends.local.outputs), self.integrals).T
        mixed, twice = ca.jacobian(by_integral, self.ends.local.y), ca.jacobian(by_integral, self.integrals)
        curved = mixed.nnz() + twice.nnz() > 0
        integral, slope = self.integral_slope(z, p) if curved else (self.no_integrals(), None)
        extra = ca.vertcat(integral, p)
        weights = (w, self.ends.scatter_dm.T @ lam)
        multipliers = ca.vertcat(lam_g, self.ends.at_ends("multipliers", z, extra, by_integral, weights))
        terms = [(self.ends, extra, lam), *((t, p, multipliers) for t in self.phases)]
        H = assemble((n, n), [term.hessian(z, *more) for term, *more in terms if term.local.curved])
        if slope is not None:
            half = self.ends.at_ends("mixed", z, extra, mixed, weights) @ self.ends.gather_dm
            half += self.ends.at_ends("twice", z, extra, twice, weights) @ slope / 2
            H += ca.triu(slope.T @ half + half.T @ slope)
        inputs, names = [z, p, lam_f, lam_g], ["x", "p", "lam_f", "lam_g"]
        return ca.Function("nlp_hess_l", inputs, [H], names, ["hess"])

    @cached_property
    def options(self) -> dict[str, Any]:
        """The derivatives as options of nlpsol, built once for all solvers of the program."""
        return {"expand": False, "grad_f": self.grad_f(), "jac_g": self.jac_g(), "hess_lag": self.hess_lag()}


def sum_of(pairs: list[tuple[ca.MX, Scattered]]) -> tuple[ca.MX, list[Scattered]]:
    """The sum of the values, and the list of the derivatives."""
    return sum((value for value, _ in pairs), ca.MX(0)), [slope for _, slope in pairs]
