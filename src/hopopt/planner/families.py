"""Families of hops: the different local optima that a search found, what found them, and whether a better one is feared."""

from collections.abc import Mapping, Sequence

import numpy as np

from hopopt.global_search import GlobalSearch
from hopopt.leg.kinematics import reach
from hopopt.ocp.hop import Hop
from hopopt.ocp.phases import STANCE
from hopopt.planner.first_mesh import FirstMesh
from hopopt.planner.multistart import StartOutcome, first_transcription, grouped, solution_of
from hopopt.planner.solution import Motion, Solution
from hopopt.planner.summary_extras import GlobalMethod, HopFamily

LEANING, DIPPING, SWINGING = 0.05, 0.03, 0.1  # share of the reach from which a lean, a dip or a swing is worth a word
DOWN = 0.02  # share of the reach below which a joint is on the ground
FAST = 0.3  # m/s along the ground from which a hop drifts
ALARM = 0.01  # relative: by so much the global method's value may pass the answer


def search_figures(
    hop: Hop, searched: FirstMesh, finished: Sequence[Solution], best: Solution
) -> tuple[tuple[HopFamily, ...], GlobalMethod]:
    """``families`` and ``global`` of the summary."""
    return families(hop, searched.outcomes, finished), global_figures(searched, best)


def families(hop: Hop, outcomes: Sequence[StartOutcome], finished: Sequence[Solution] = ()) -> tuple[HopFamily, ...]:
    """The different local optima, best first, by the figures of those that are ``finished``, else of the first mesh."""
    refined = {s.summary.starts.chosen: s for s in finished if s.verified}
    groups = grouped(sorted(outcomes, key=lambda o: -o.merit))
    return tuple(
        _family(hop, group, next((refined[o.name] for o in group if o.name in refined), None)) for group in groups
    )


def _family(hop: Hop, group: Sequence[StartOutcome], known: Solution | None) -> HopFamily:
    plan = Motion(hop.design, hop.objective.name, solution_of(group[0], first_transcription(hop)).phases)
    return HopFamily(
        clearance_m=known.clearance if known else float(plan.claims()["clearance_m"]),
        objective_value=known.summary.objective_value if known else group[0].value,
        refined=known is not None, found_by=tuple(o.name for o in group), count=len(group),
        words=words(motion(hop, plan)),
    )  # fmt: skip


def global_figures(searched: FirstMesh, best: Solution) -> GlobalMethod:
    """What the global method says of the answer: what its grid promises from the start, and what the best motion followed
    from there reaches by its centre of mass at lift-off; an alarm: a better hop than the answer is likely."""
    found = searched.overall
    if found is None:
        return GlobalMethod(None, None, None, False, reason=searched.reason)
    motion = max((r.clearance for r in found.rollouts), default=None)
    grid = tuple(int(n) for n in found.grid)
    return GlobalMethod(
        found.method,
        grid,
        float(found.value),
        promises_more(found, best),
        steps=found.steps,
        motion_m=motion,
        seconds=found.seconds,
    )


def promises_more(found: GlobalSearch, best: Solution) -> bool:
    """Whether a global search promises over 1 % more than the answer: than its clearance, and than what its own lift-off
    would reach if flight limited nothing, as the search has it."""
    highest, parts = max([float(found.value), *(r.clearance for r in found.rollouts)]), best.summary.parts
    by_lift_off = parts.com_height_at_lift_off_m + parts.ballistic_rise_m - found.tuck
    return bool(best.objective == "clearance" and highest > (1 + ALARM) * max(best.clearance, by_lift_off))


def alarm_note(figures: GlobalMethod) -> list[str]:
    """A sentence beside the answer where the global method doubts that it is the best."""
    if not figures.alarm or figures.grid is None or figures.value_m is None:
        return []
    highest = max(figures.value_m, figures.motion_m or 0.0)
    return [
        f"not called the best: a global method on a grid of {figures.grid[0]} nodes an axis promises {highest:.3f} m, over "
        "1 % more, and no hop that high was solved from its motions; hopopt evidence --global looks closer"
    ]


def motion(hop: Hop, plan: Motion) -> dict[str, float]:
    """What the body does in stance, lengths as shares of the reach.

    stance: duration [s]
    sway, lean: the body's place over the foot when it is lowest, and at lift-off
    dip: how far it goes down
    swing: how far it is from where it began at most, with its sign
    knee: the least height of a joint below it
    drift: its speed along at lift-off [m/s]
    """
    stance, size = plan.everywhere(STANCE, np.linspace(0, 1, 5)), reach(hop.leg)
    x, z = stance.q[:, 0], stance.q[:, 1]
    lowest, farthest = int(np.argmin(z)), int(np.argmax(np.abs(x - x[0])))
    below = [stance.points[joint][:, 1].min() for joint in hop.leg.joints[1:]]
    return {
        "stance": plan.lift_off, "sway": float(x[lowest] / size), "lean": float(x[-1] / size),
        "dip": float((z[0] - z[lowest]) / size), "swing": float((x[farthest] - x[0]) / size),
        "drift": float(stance.com_v[-1, 0]), "knee": float(min(below, default=size) / size),
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
