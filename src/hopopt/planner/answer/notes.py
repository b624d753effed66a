"""What an answer does not say by itself."""

import numpy as np

from hopopt.design import Design
from hopopt.errors import SolverError
from hopopt.leg.geometry.outlines import outlines
from hopopt.leg.geometry.solids import has_shape
from hopopt.nlp.solver.ipopt import NlpSolution
from hopopt.ocp.hop import Hop
from hopopt.optimality.directions.flat_directions import Flat, NotInvertible, flat
from hopopt.optimality.second_order import Curvature, curvature
from hopopt.planner.attempts import AT_MOST, CALMER, LARGEST_TIE_BREAK
from hopopt.planner.solution import Solution, without_tie_break
from hopopt.problem.checking.hints import hints
from hopopt.verify.whole_hop import SHARPER, Simulated

SHORTER = (
    2 / 3
)  # of the range of the stance's duration, which may be tried where the longest leaves refinement unfinished
LOUD = 0.01  # share of the answer that the tie-break, or the smooth law of gears, may weigh without a word


def notes_on(hop: Hop, asked: Design, structure: bool, best: Solution, better: Solution | None) -> list[str]:
    """What the answer does not say by itself: ``best`` of a ``hop`` whose solver may differ from what was ``asked``."""
    notes, goal = hints(hop.design), hop.objective
    notes += _tolerances(best.design, asked, structure)
    if hop.design.solver.tie_break != asked.solver.tie_break:
        notes.append(
            f"with solver.tie_break = {asked.solver.tie_break:g} torques that hardly matter may chatter, and the hop was not verified: "
            f"this is the hop with {hop.design.solver.tie_break:g}"
        )
    notes += _waiting(best)
    notes += sharper_note(best.summary.objective_error.simulated)
    if better is not None:
        value = f"{better.summary.objective_value:.4f} {goal.unit}, {'higher' if goal.sign > 0 else 'lower'}"
        notes.append(f"a start led to {value}, which failed verification: it may be the better hop")
    if goal.ends != "required clearance" and (asked_for := best.design.hop.clearance) is not None:
        notes.append(f"hop.clearance = {asked_for:g} plays no part: the objective {goal.name} asks for no height")
    if goal.figure == "obstacle_m" and has_shape(hop.design.leg) and not outlines(hop.design.leg):
        notes.append(
            'leg.lowest = "joints": the obstacle is cleared by the lines of the links, not by shapes, which may reach into it'
        )
    over = float(best.apex.points["foot"][0, 1] - best.apex.q[0, 1])
    if over > 0 and not has_shape(hop.design.leg):
        notes.append(
            f"the foot ends {over:.2f} m above the hip: the body is a point here, and no link is in its way (limits of the "
            "joints' angles can forbid it; leg.geometry or leg.body.shapes say what is, docs/body.md)"
        )
    weighs = best.summary.tie_break_weighs
    calmer = CALMER * best.design.solver.tie_break
    if goal.calm_first and not best.verified and 0 < calmer <= LARGEST_TIE_BREAK:
        notes.append(
            "not verified, as torques may chatter where work hardly depends on them: solver.tie_break = "
            f"{calmer:g} may settle sooner; what it weighs is stated"
        )
    elif (np.inf if best.summary.impact_J is None else best.summary.impact_J) < 1e-3 * weighs:
        notes.append("the foot can land at rest, as in many hops: of these, this is one with gentle torques")
    elif goal.sign < 0 and weighs > LOUD * abs(best.summary.reached):
        notes.append(
            f"gentle torques are preferred, which weighs {weighs:.2g} {goal.unit}: the least may be lower by a part of that "
            f"(a smaller solver.tie_break than {best.design.solver.tie_break:g} tells, and takes longer)"
        )
    return notes


def _waiting(best: Solution) -> list[str]:
    """What to try where a hop that is not verified stays on the ground for as long as it may."""
    shortest, longest = best.design.hop.stance_duration
    if best.verified or best.summary.leans_on.stance_at_its_limit != "longest" or shortest == longest:
        return []
    shorter = shortest + SHORTER * (longest - shortest)
    return [
        f"stance lasts the {longest:.3g} s that hop.stance_duration allows: where waiting gains little, many hops are equally good and "
        f"refinement may not end; try a shorter one, such as hop.stance_duration = [{shortest:g}, {shorter:.3g}]"
    ]


def sharper_note(simulated: Simulated) -> list[str]:
    """That a hop loses more than LOUD where its gears change sides more sharply than the program's."""
    clears, sharper = simulated.clearance_m, simulated.sharper_gears_m
    if clears is None or sharper is None or clears - sharper <= LOUD * clears:
        return []
    return [
        f"with gears that change sides {SHARPER:g} times as sharply this plan clears {sharper:.3f} m, {1 - sharper / clears:.1%} less: "
        "its drives, at their limits, do not make up for it (docs/drives.md)"
    ]


def _tolerances(used: Design, asked: Design, structure: bool) -> list[str]:
    """That the plan was made with tighter tolerances than the problem's, and why."""
    names = [name for name in AT_MOST if getattr(used.solver, name) != getattr(asked.solver, name)]
    if not names:
        return []
    stated = " and ".join(f"solver.{name} = {getattr(used.solver, name):g}" for name in names)
    why = "as --structure needs" if structure else "as the hop was not verified and certified with the problem's own"
    return [f"solved with {stated}, {why}"]


def second_order(solution: NlpSolution) -> Curvature | None:
    """The second-order test of a program's solution; None if it cannot be made."""
    try:
        return curvature(solution)
    except (np.linalg.LinAlgError, RuntimeError):  # no reason to lose the answer
        return None


def saddle_note(found: Curvature | None) -> tuple[str, ...]:
    """That the hop is no optimum, if the second-order test says so."""
    if found is None or not found.saddle:
        return ()
    ways = f"{found.saddle} direction{'s' if found.saddle > 1 else ''}"
    return (f"second order: {ways} would make it better: a saddle of the program, not its optimum: try more starts",)


def flat_directions(hop: Hop, best: Solution) -> list[Flat] | None:
    """What the objective does not depend on; None if that cannot be computed."""
    try:
        return flat(without_tie_break(best, hop))
    except (NotInvertible, SolverError, RuntimeError):  # of CasADi too: no reason to lose the answer
        return None
