"""What the packages that stand on CasADi's Opti have in common: symbols, and where Opti spends its time."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any

import casadi as ca
from posed import MOST_ITERATIONS, TOLERANCE, Formulas, Posed, Run

OPTIONS = {
    "print_time": False, "record_time": True, "ipopt.print_level": 0, "ipopt.sb": "yes", "ipopt.tol": TOLERANCE,
    "ipopt.max_iter": MOST_ITERATIONS, "ipopt.linear_solver": "mumps",
}  # fmt: skip


class Symbols:
    """MX symbols; formulas become one SX function, as a user of CasADi would write them."""

    sin, cos = staticmethod(ca.sin), staticmethod(ca.cos)

    @classmethod
    def apply(cls, formulas: Formulas, *columns: Any) -> list[list[Any]]:
        """The formulas' values, component by component."""
        given = [ca.SX.sym("x", len(c)) for c in columns]
        out = formulas([ca.vertsplit(g) for g in given], ca)
        function = ca.Function(formulas.name, given, [ca.vertcat(*o) for o in out])
        return [ca.vertsplit(o) for o in function.call([ca.vertcat(*c) for c in columns])]


def variants(run: Callable[..., Run]) -> list[Callable[[Posed], Run]]:
    """With the program expanded into scalar steps and without: the faster one counts."""
    return [partial(run, expand=expand) for expand in (True, False)]


@contextmanager
def watched() -> Iterator[dict[str, Any]]:
    """Statistics of the Opti that is solved within."""
    plain, found = ca.Opti.solve, {}

    def solve(opti: Any, *more: Any) -> Any:
        try:
            return plain(opti, *more)
        finally:
            found.update(opti.stats(), objective=float(opti.debug.value(opti.f)))

    ca.Opti.solve = solve
    try:
        yield found
    finally:
        ca.Opti.solve = plain


def timed(pose_and_solve: Callable[[dict[str, Any]], None], expand: bool) -> Run:
    """A run with the options given; what CasADi counts as its solver's own time is the solve, all else (derivatives included) is building."""
    began = time.perf_counter()
    with watched() as stats:
        pose_and_solve({**OPTIONS, "expand": expand})
    total, solve = time.perf_counter() - began, float(stats["t_wall_total"])
    return Run(total - solve, solve, int(stats["iter_count"]), stats["objective"], str(stats["return_status"]))
