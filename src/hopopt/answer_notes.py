"""What an answer does not say by itself."""

import numpy as np

from hopopt.nlp.flat import CannotBeTold, Flat, flat
from hopopt.ocp.hop import Hop
from hopopt.problem_hints import hints
from hopopt.solution import Solution


def notes_on(hop: Hop, asked: float, best: Solution, better: Solution | None) -> list[str]:
    """What the answer does not say by itself."""
    notes, goal, leg = hints(hop.design), hop.objective, hop.leg
    if hop.design.solver.tie_break != asked:
        notes.append(
            f"with solver.tie_break = {asked:g} torques that hardly matter may chatter, and the hop was not verified: "
            f"this is the hop with {hop.design.solver.tie_break:g}"
        )
    if better is not None:
        value = f"{better.summary['objective_value']:.4f} {goal.unit}, {'higher' if goal.maximize else 'lower'}"
        notes.append(f"a start led to {value}, which failed verification: it may be the better hop")
    if best.summary.get("impact_J", np.inf) < 1e-3 * best.summary["tie_break_weighs"]:
        notes.append("the foot can land at rest, as in many hops: of these, this is one with gentle torques")
    shares = {path: e for path, e in (leg.drive(j, "gear", "efficiency") for j in leg.joints) if e}
    if any(e < 1 for e in shares.values()):
        stated = ", ".join(f"{path} = {e:g}" for path, e in shares.items())
        notes.append(f"the gears of this plan lose nothing; {stated} counts in hopopt simulate and hopopt compare")
    return notes


def flat_directions(hop: Hop, best: Solution) -> list[Flat] | None:
    """What the objective does not feel; None if that cannot be told."""
    from hopopt.diagnosis import without_tie_break

    try:
        return flat(without_tie_break(best, hop))
    except CannotBeTold:  # no reason to lose the answer
        return None
