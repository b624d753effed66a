"""CasADi's fatrop, a structured interior-point solver, on a problem of posed.py, beside Ipopt on the same program.

    python benchmarks/peers/in_fatrop.py [PROBLEM] [INTERVALS OF EACH PHASE]

An interval is a stage and its points are inputs. The last point is the next stage's state, and so are the durations, as
fatrop's form asks; between phases there is a stage without inputs. An effort of 1e-6 times the squared controls holds what
would else be free. Prints building, solving (processor time), iterations, objective and how each ended.
"""

import sys
import time
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import casadi as ca
import numpy as np
from posed import DEGREE, MOST_ITERATIONS, TOLERANCE, Pairs, Phase, Posed, posed

EFFORT = 1e-6
SYMBOLS = SimpleNamespace(sin=ca.sin, cos=ca.cos)
TAU = ca.collocation_points(DEGREE, "radau")
QUIET = {"ipopt.print_level": 0, "ipopt.sb": "yes", "ipopt.tol": TOLERANCE, "ipopt.max_iter": MOST_ITERATIONS}
FATROP = {"fatrop": {"print_level": 0, "tol": TOLERANCE, "max_iter": MOST_ITERATIONS}}


def interval(phase: Phase, phases: int, k: int) -> ca.Function:
    """(state and durations, points) -> (the next state and durations, defects, rows of the path, cost) in phase k."""
    n, m = len(phase.x), len(phase.u)
    x, z = ca.SX.sym("x", n + phases), ca.SX.sym("z", DEGREE * (n + m))
    slopes, _, weights = ca.collocation_coeff(TAU)
    points, h = ca.reshape(z, n + m, DEGREE), x[n + k] / phase.intervals
    at = [phase.at(ca.vertsplit(points[:n, j]), ca.vertsplit(points[n:, j]), SYMBOLS) for j in range(DEGREE)]
    rates = ca.horzcat(*(ca.vertcat(*map(ca.SX, rate)) for rate, _, _ in at))
    defects = ca.vec(ca.horzcat(x[:n], points[:n, :]) @ slopes - h * rates)
    path = ca.vertcat(*(ca.SX(row) for _, rows, _ in at for row in rows))
    running = ca.vertcat(*(ca.SX(cost) for _, _, cost in at)) + EFFORT * ca.sum1(points[n:, :] ** 2).T
    return ca.Function(
        "interval", [x, z], [ca.vertcat(points[:n, -1], x[n:]), defects, path, h * (weights.T @ running)]
    )


@dataclass
class Stages:
    """A program by stage, in the order of fatrop: state, inputs; then how the next state follows, and the stage's rows."""

    w: list[Any] = field(default_factory=list)
    g: list[Any] = field(default_factory=list)
    bounds: list[tuple[float, float]] = field(default_factory=list)
    limits: list[tuple[float, float]] = field(default_factory=list)
    guess: list[float] = field(default_factory=list)
    nx: list[int] = field(default_factory=list)
    nu: list[int] = field(default_factory=list)
    ng: list[int] = field(default_factory=list)

    def variables(self, pairs: Pairs, values: list[float]) -> ca.MX:
        """New variables within bounds, from a guess."""
        self.w.append(ca.MX.sym(f"w{len(self.w)}", len(pairs)))
        self.bounds += pairs
        self.guess += values
        return self.w[-1]

    def state(self, pairs: Pairs, values: list[float]) -> ca.MX:
        """The state of the next stage."""
        self.nx.append(len(pairs))
        return self.variables(pairs, values)

    def rows(self, expression: Any, pairs: Pairs) -> int:
        """Rows of a stage within limits; how many."""
        self.g.append(expression)
        self.limits += pairs
        return len(pairs)

    def end(self, inputs: int, follows: Any, rows: list[tuple[Any, Pairs]]) -> None:
        """End a stage whose next state, which is there already, follows so (None: it is the last)."""
        self.nu.append(inputs)
        if follows is not None:
            self.rows(self.w[-1] - follows, [(0.0, 0.0)] * self.nx[-1])
        self.ng.append(sum(self.rows(*row) for row in rows))

    def solve(self, solver: str, cost: Any, options: dict[str, Any]) -> str:
        """Solve it, and a row of the table."""
        nlp = {"x": ca.vertcat(*self.w), "g": ca.vertcat(*self.g), "f": cost}
        low, high = np.array(self.bounds).T
        least, most = np.array(self.limits).T
        times = [time.process_time()]
        call = ca.nlpsol("s", solver, nlp, {"print_time": False, "error_on_fail": False, "expand": True, **options})
        times.append(time.process_time())
        found = call(x0=self.guess, lbx=low, ubx=high, lbg=least, ubg=most)
        times.append(time.process_time())
        (build, spent), stats = np.diff(times), call.stats()
        n, ended = max(1, stats["iter_count"]), "solved" if stats["success"] else "not solved"
        told = f"{build:.3f} | {spent:.3f} | {n} | {spent / n * 1e3:.2f} | {float(found['f']):+.9f} | {ended}"
        return f"| {solver} | {told} |"

    @property
    def structure(self) -> dict[str, Any]:
        """What fatrop has to be told."""
        sizes = {"nx": self.nx, "nu": self.nu, "ng": self.ng, "N": len(self.nx) - 1}
        return {"structure_detection": "manual", "equality": [a == b for a, b in self.limits], **sizes}


def program(p: Posed) -> tuple[Stages, Any]:
    """Stages of a problem without free parameters, whose ends are next first states less what they follow from; its cost."""
    s, cost, count = Stages(), ca.MX(0.0), len(p.phases)
    durations, guessed = [ph.duration for ph in p.phases], [ph.guess[3] for ph in p.phases]
    zeros = [[ca.MX(0.0)] * len(ph.x) for ph in p.phases]
    last = list(zeros)
    lands, T, own = None, [], ca.MX(0.0)
    for k, phase in enumerate(p.phases):
        step = interval(phase, count, k)
        times, *tables = (np.array(table, dtype=float) for table in phase.guess[:3])

        def values(at: float, tables: Any, times: Any = times) -> list[float]:
            return [float(np.interp(at, times, column)) for table in tables for column in table.T]

        x = s.state([*phase.start, *durations], [*values(0.0, tables[:1]), *guessed])
        if k:
            s.end(0, lands, [])
        for i in range(phase.intervals):
            inside = [v for tau in TAU for v in values((i + tau) / phase.intervals, tables)]
            z = s.variables([*phase.x, *phase.u] * DEGREE, inside)
            follows, defects, path, running = step(x, z)
            cost += running
            ends = phase.end if i + 1 == phase.intervals else phase.x
            x = s.state([*ends, *durations], [*values((i + 1) / phase.intervals, tables[:1]), *guessed])
            s.end(z.numel(), follows, [(defects, [(0.0, 0.0)] * defects.numel()), (path, list(phase.path) * DEGREE)])
        last[k], T = ca.vertsplit(x[: len(phase.x)]), ca.vertsplit(x[len(phase.x) :])
        own, rows = p.ends(zeros, last, T, [], SYMBOLS)
        lands = ca.vertcat(*(-row for row in rows), *T)
    s.end(0, None, [])
    return s, cost + own


def main() -> None:
    """Solve by both, and print."""
    p = posed(sys.argv[1] if len(sys.argv) > 1 else "rail", Path())
    if len(sys.argv) > 2:
        p = replace(p, phases=tuple(replace(phase, intervals=int(sys.argv[2])) for phase in p.phases))
    stages, cost = program(p)
    print("| solver | build s | solve s | iterations | ms each | objective | |", "|---" * 7 + "|", sep="\n")
    print(stages.solve("ipopt", cost, QUIET), stages.solve("fatrop", cost, stages.structure | FATROP), sep="\n")


if __name__ == "__main__":
    main()
