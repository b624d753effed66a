"""Families of hops: the different local optima that a search found, what found them, and what such hops do."""

from collections.abc import Mapping, Sequence

import numpy as np

from hopopt.leg.kinematics import reach
from hopopt.leg.scales import Scale
from hopopt.ocp.hop import Hop
from hopopt.ocp.phases import STANCE
from hopopt.planner.answer.extras import HopFamily
from hopopt.planner.motion import Motion
from hopopt.planner.search.multistart import SAME_OPTIMUM, StartOutcome, first_transcription, grouped, solution_of
from hopopt.planner.solution import Solution

LEANING, DIPPING, SWINGING = 0.05, 0.03, 0.1  # share of the reach from which a lean, a dip or a swing is worth a word
DOWN = 0.02  # share of the reach below which a joint is on the ground
FAST = 0.3  # [m/s] on the paper's leg, along the ground, from which a hop drifts
PRECISE = 1e-6  # relative: to which the program of a mesh is solved, and more


def families(hop: Hop, outcomes: Sequence[StartOutcome], finished: Sequence[Solution] = ()) -> tuple[HopFamily, ...]:
    """The different local optima, best first, by the figures of those that are ``finished``, else of the first mesh."""
    refined = {s.summary.starts.chosen: s for s in finished if s.verified}
    groups = grouped(sorted(outcomes, key=lambda o: -o.signed_value), told_apart(hop, outcomes, finished))
    found = [_family(hop, group, next((refined[o.name] for o in group if o.name in refined), None)) for group in groups]
    return tuple(sorted(found, key=lambda f: -hop.objective.signed_value(f.objective_value)))


def told_apart(hop: Hop, outcomes: Sequence[StartOutcome], finished: Sequence[Solution]) -> float:
    """The distance [the objective's unit] below which two objectives of the first mesh count as one hop: what refinement
    has changed where it is known, for that is their error, between PRECISE and SAME_OPTIMUM of the objective."""
    first = {o.name: o.value for o in outcomes}
    pairs = [(first[s.summary.starts.chosen], s.summary.objective_value) for s in finished if s.verified]
    size = max((abs(o.objective) for o in outcomes if o.success), default=0.0)
    error = max((abs(a - b) for a, b in pairs), default=np.inf)
    return float(np.clip(error, PRECISE * size, SAME_OPTIMUM * size))


def _family(hop: Hop, group: Sequence[StartOutcome], known: Solution | None) -> HopFamily:
    plan = known or Motion(hop.design, hop.objective.name, solution_of(group[0], first_transcription(hop)).phases)
    ended = tuple(o.name for o in group if o.near is None)
    return HopFamily(
        clearance_m=known.clearance if known else float(plan.claims()["clearance_m"]),
        objective_value=known.summary.objective_value if known else group[0].value,
        refined=known is not None, found_by=ended, count=len(ended), words=words(motion(hop, plan)),
        stopped=tuple(o.name for o in group if o.near is not None),
    )  # fmt: skip


def motion(hop: Hop, plan: Motion) -> dict[str, float]:
    """What the body does in stance, lengths as shares of the reach.

    stance: duration [s]
    sway, lean: the body's place over the foot when it is lowest, and at lift-off
    dip: how far it goes down
    swing: how far it is from where it began at most, with its sign
    knee: the least height of a joint below it
    drift: its speed along at lift-off [m/s on the paper's leg]
    """
    stance, size = plan.everywhere(STANCE, np.linspace(0, 1, 5)), reach(hop.leg)
    x, z = stance.q[:, 0], stance.q[:, 1]
    lowest, farthest = int(np.argmin(z)), int(np.argmax(np.abs(x - x[0])))
    below = [stance.points[joint][:, 1].min() for joint in hop.leg.joints[1:]]
    return {
        "stance": plan.lift_off, "sway": float(x[lowest] / size), "lean": float(x[-1] / size),
        "dip": float((z[0] - z[lowest]) / size), "swing": float((x[farthest] - x[0]) / size),
        "drift": float(stance.com_v[-1, 0] / Scale.of(hop.leg).speed), "knee": float(min(below, default=size) / size),
    }  # fmt: skip


def words(m: Mapping[str, float]) -> str:
    """What a hop does: where the body dips and swings, where it leans at lift-off, where it drifts; from the figures of
    ``motion``."""
    moves = [f"dips by {m['dip']:.0%} of the leg" if m["dip"] > DIPPING else "pushes without a dip"]
    if m["dip"] > DIPPING and abs(m["sway"]) > LEANING:
        moves[0] += f" {_side(m['sway'])}"
    if abs(m["swing"]) > SWINGING and abs(m["swing"]) > 2 * abs(m["lean"]):
        moves.append(f"swings {_way(m['swing'])} by {abs(m['swing']):.0%} of the leg and back")
    if m["knee"] < DOWN:
        moves.append("lowers the knee to the ground")
    moves.append(f"leaves {_side(m['lean'])}" if abs(m["lean"]) > LEANING else "leaves upright")
    if abs(m["drift"]) > FAST:
        moves[-1] += f", drifting {_way(m['drift'])}"
    return f"{'; '.join(moves)}; stance {m['stance']:.2f} s"


def _way(x: float) -> str:
    return "forward" if x > 0 else "backward"


def _side(place: float) -> str:
    return "in front of the foot" if place > 0 else "behind the foot"
