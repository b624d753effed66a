"""Cross-checks of an answer: another NLP solver on the answer's mesh, other transcription schemes on the same problem.

Uno's filter SQP (Vanaret and Leyffer, Math. Prog. Comp. 2024) is an active-set method with a trust region and a filter;
it shares the program with Ipopt and nothing of how it is solved: no multipliers, no barrier, CasADi's own derivatives. It
begins at the answer, moved away. The other schemes begin at the answer too, on meshes of their own that they refine.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np

from hopopt.errors import SolverError
from hopopt.nlp.deadline import NEVER, Deadline
from hopopt.nlp.mesh import uniform
from hopopt.nlp.refinement.mesh_refinement import OUT_OF_TIME, Refinement
from hopopt.nlp.schemes import HERMITE_SIMPSON, Scheme, radau
from hopopt.nlp.solver.casadi_solver import CasadiSolver
from hopopt.nlp.solver.ipopt import WARM, Bounds, NlpSolution, NlpSolver, time_given
from hopopt.nlp.transcription import Transcription
from hopopt.ocp.hop import Hop
from hopopt.planner.answer.extras import CrossCheck
from hopopt.planner.refine_and_verify import aims_of
from hopopt.planner.search.multistart import Progress, first_transcription
from hopopt.planner.solution import Solution, stored_nlp

SAME_PROGRAM, SAME_PROBLEM = 1e-6, 1e-4  # relative differences within which cross-checks agree
START_DEVIATION = 1e-3  # scaled: standard deviation by which every variable is moved away from the answer
AFFORDABLE = 6000  # variables of a program for Uno: a minute or some
FEASIBLE_VIOLATION = 1e-6  # scaled: what another solver may miss its constraints by
UNO = {"preset": "filtersqp", "TR_radius": 0.1, "logger": "SILENT", "print_solution": False}
OTHER_SCHEMES = (radau(5), HERMITE_SIMPSON, radau(4))  # the first two that are not the answer's own
LOOSE = 1e-4  # local error of schemes that collocate both ends: their controls oscillate, finer meshes take minutes


class Failed(Exception):
    """Why a cross-check could not be made."""


@dataclass(frozen=True)
class CrossCheckAnswer:
    """An objective, and what it falls short of, if anything."""

    objective: float
    short: str = ""


def cross_check_entries(
    hop: Hop, answer: Solution, notes: Sequence[str], say: Progress = lambda text: None, until: Deadline = NEVER
) -> dict[str, Any]:
    """Entries of the answer's summary that its cross-checks come to.

    notes: those of the answer. Exit code 3 and a note if a cross-check is better: such a hop is true, but not the best.
    """
    found = cross_checks(hop, answer, say, until)
    objections = [
        f"this is not the best hop: {o.name} found {o.objective:.5f} for {o.compared_with:.5f}; solve again with more "
        "starts (docs/certificate.md)"
        for o in found
        if o.contradicts
    ]
    better = {"exit_code": 3, "notes": (*notes, *objections)} if objections else {}
    return {"second_opinions": tuple(found), **better}


def cross_checks(
    hop: Hop, answer: Solution, say: Progress = lambda text: None, until: Deadline = NEVER
) -> list[CrossCheck]:
    """All cross-checks of an answer, as far as there is time; ``answer.kkt`` holds the program that it came from."""
    sign, own, stored = hop.objective.sign, answer.summary.scheme, stored_nlp(answer)
    nlp = affordable(hop, stored, until)
    which = "the same program" if nlp is stored else "the program with limits at the nodes alone"
    name = f"Uno, filter SQP, on {which} of {_sizes(nlp.transcription)} intervals"
    say(f"cross-check: {name}")
    found = [
        cross_checked(
            name, sign, SAME_PROGRAM, nlp.objective, lambda: by_uno(nlp, hop.design.solver.seed, until), stored.least
        )
    ]
    for other in [s for s in OTHER_SCHEMES if s.name != own][:2]:
        how = f"refined on its own to {_tolerance(hop, other):.0e}" if hop.design.solver.refine else "on one mesh"
        name = f"{other.name}, {how}"
        say(f"cross-check: {name}")
        found.append(
            cross_checked(
                name,
                sign,
                SAME_PROBLEM,
                stored.objective,
                lambda s=other: by_scheme(hop, s, stored, until),
                stored.least,
            )
        )
    return [_without_tie_break(o, stored.value - stored.objective) for o in found]


def _without_tie_break(o: CrossCheck, more: float) -> CrossCheck:
    """What was compared with the tie-break of the answer, without it on both sides: the value that the answer states."""
    found = None if o.objective is None else o.objective + more
    return replace(o, objective=found, compared_with=o.compared_with + more)


def affordable(hop: Hop, last: NlpSolution, until: Deadline = NEVER) -> NlpSolution:
    """Ipopt's solution on the answer's mesh or, where that is too large for Uno, on the first one; limits at the nodes
    alone: where they are enforced between them too, more of them act than there are controls, and active sets fail."""
    fits, most = len(last.z) <= AFFORDABLE, {"ipopt.max_iter": hop.design.solver.max_iterations}
    t = last.transcription if fits else first_transcription(hop)
    if fits and np.array_equal([t.lbg, t.ubg], [last.bounds.low_g, last.bounds.high_g]):
        return last
    guess, free = t.guess_from(last.phases), t.free_from(last.parameters)
    warm = NlpSolver(t, WARM | most, until=until)(guess, free, (last.lam_g, last.lam_x)) if fits else None
    return warm if warm and warm.success else NlpSolver(t, most, until=until)(guess, free)


def cross_checked(
    name: str, sign: float, allowed: float, value: float, ask: Callable[[], CrossCheckAnswer], least: float = 1e-9
) -> CrossCheck:
    """What ``ask`` says, against the answer's ``value``; ``sign`` as that of the objective in its signed value; differences are
    relative to the value, but to no less than ``least``."""
    began = time.perf_counter()
    try:
        reported = ask()
    except (
        Failed,
        SolverError,
        RuntimeError,
        ArithmeticError,
        ValueError,
    ) as error:  # CasADi raises RuntimeError, at length
        reason = " ".join(str(error).split())[:200] or type(error).__name__
        return CrossCheck(name, None, value, None, allowed, False, False, time.perf_counter() - began, reason)
    difference = sign * (reported.objective - value) / max(abs(value), least)
    agrees, contradicts = (
        abs(difference) <= allowed and not reported.short,
        difference > SAME_PROBLEM and not reported.short,
    )
    seconds = time.perf_counter() - began
    return CrossCheck(
        name, reported.objective, value, difference, allowed, agrees, contradicts, seconds, reported.short
    )


def by_uno(ours: NlpSolution, seed: int, until: Deadline = NEVER) -> CrossCheckAnswer:
    """Uno on the program and bounds of Ipopt's solution ``ours``, from there moved away.

    Values that are given (the start) are no variables of Uno's. Raises Failed if either solver did not converge, or not in time.
    """
    _begin(until)
    if not ours.success:
        raise Failed(f"Ipopt itself did not solve this program from the answer: {_words(ours.status)}")
    t, b, z = ours.transcription, ours.bounds, ours.z.copy()
    z = np.clip(z + START_DEVIATION * np.random.default_rng(seed).standard_normal(len(z)), b.low_z, b.high_z)
    free = np.flatnonzero(b.low_z < b.high_z)
    x, given = ca.MX.sym("x", len(free)), np.where(b.low_z < b.high_z, 0.0, z)
    program = ca.Function("program", [t.nlp["x"], t.nlp["p"]], [t.nlp["f"], t.nlp["g"]])
    f, g = program(ca.DM.eye(len(z))[:, free.tolist()] @ x + given, ours.p)
    settings = {
        "print_time": False,
        "error_on_fail": False,
        "expand": True,
        "uno": UNO | {"time_limit": time_given(until)},
    }
    solver = CasadiSolver("uno", {"x": x, "f": f, "g": g}, settings)
    result = solver(x0=z[free], lbx=b.low_z[free], ubx=b.high_z[free], lbg=b.low_g, ubg=b.high_g)
    z[free] = np.array(result["x"]).ravel()
    cost, rows = (np.array(value).ravel() for value in program(z, ours.p))
    stats, missed = solver.stats(), _missed(z, rows, b)
    if not stats["success"] or missed > FEASIBLE_VIOLATION:
        raise Failed(f"{_words(stats['return_status'])}, constraints missed by {missed:.0e}")
    return CrossCheckAnswer(t.problem.objective.cost(float(cost[0])))


def by_scheme(hop: Hop, scheme: Scheme, answer: NlpSolution, until: Deadline = NEVER) -> CrossCheckAnswer:
    """The problem by another scheme from an answer, refined on its own mesh.

    Schemes that collocate both ends of an interval begin on twice as many, and hold limits at the nodes only. Raises
    Failed if its first mesh cannot be solved.
    """
    _begin(until)
    both_ends = scheme.starts_at_node
    mesh = {n: uniform(m.intervals * (2 if both_ends else 1)) for n, m in first_transcription(hop).mesh.items()}
    t = Transcription(hop.problem, scheme, mesh)
    solver = NlpSolver(t, {"ipopt.max_iter": hop.design.solver.max_iterations}, until=until)
    first = solver(t.guess_from(answer.phases), t.free_from(answer.parameters))
    if not first.success:
        raise Failed(f"the first mesh was not solved: {_words(first.status)}")
    aims, tolerance = aims_of(hop, until), _tolerance(hop, scheme)
    aims = replace(aims, local_error=tolerance, excess=np.inf if both_ends else aims.excess)
    refinement = Refinement(first, aims).run()
    wrong = max(float(e.local.max()) for e in refinement.errors.values())
    return CrossCheckAnswer(
        refinement.solution.objective, f"its local error is {wrong:.0e}" if wrong > tolerance else ""
    )


def _begin(until: Deadline) -> None:
    """Failed if there is no time for another cross-check."""
    if until.passed:
        raise Failed(OUT_OF_TIME)


def _sizes(t: Transcription) -> str:
    return " + ".join(str(mesh.intervals) for mesh in t.mesh.values())


def _tolerance(hop: Hop, scheme: Scheme) -> float:
    """The local error to which a scheme is refined."""
    return max(hop.design.solver.tolerance, LOOSE if scheme.starts_at_node else 0.0)


def _missed(z: np.ndarray, g: np.ndarray, b: Bounds) -> float:
    """Largest violation of bounds and rows, scaled."""
    sides = (b.low_z - z, z - b.high_z, b.low_g - g, g - b.high_g)
    return max(0.0, *(float(side.max(initial=0.0)) for side in sides))


def _words(status: str) -> str:
    return status.replace("_", " ").lower()
