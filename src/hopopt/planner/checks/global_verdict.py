"""What a global method says of an answer: the clearances behind its verdict, and the verdict."""

from collections.abc import Sequence
from dataclasses import replace

from hopopt.global_search import left_out
from hopopt.planner.answer.extras import GlobalMethod, HopFamily
from hopopt.planner.search.first_mesh import GLOBAL, FirstMesh
from hopopt.planner.solution import Solution

NOTHING, MAY_EXIST = "nothing better", "a better hop may exist"
GRID_TOO_COARSE = "the grid is too coarse to say"
RELAXED = "no verdict, for it leaves out {}"
GLOBAL_MARGIN = 0.01  # relative: what the method finds may pass the answer by so much, for its motions are rough
LESS = 1e-3  # relative: by so much it may stay below and still have found the answer


def highest(*clearances: float | None) -> float | None:
    """The greatest of those that are stated [m]; None if none is."""
    return max((x for x in clearances if x is not None), default=None)


def followed(found: GlobalMethod) -> float | None:
    """The greatest clearance [m] that motions of the method reach, or hops that were solved from them; these alone where it
    leaves something out."""
    return found.solved_m if found.left_out else highest(found.motion_m, found.solved_m)


def verdict(
    promised: float | None, followed: float | None, clearance: float, left_out: str | None = None
) -> str | None:
    """What a promise of the grid and what was followed from the start say of an answer's clearance [m]; None without a promise.
    left_out: what the method leaves out, if anything: then a promise of more says nothing.

    Less than a hop that is known is no evidence: then the method has not found even that hop. Nor is a promise of more that
    no motion follows up: then the grid has errors that large.
    """
    if promised is None:
        return None
    most = clearance + GLOBAL_MARGIN * abs(clearance)
    if followed is not None and followed > most:
        return MAY_EXIST
    found = max(promised, promised if followed is None else followed)
    if left_out and found > most:
        return RELAXED.format(left_out)
    return NOTHING if clearance - LESS * abs(clearance) <= found <= most else GRID_TOO_COARSE


def global_figures(searched: FirstMesh, best: Solution, families: Sequence[HopFamily]) -> GlobalMethod:
    """``global`` of the summary: numbers and verdict, of clearances alone (other heights have no verdict)."""
    found = searched.overall
    if found is None:
        return GlobalMethod(None, None, None, False, reason=searched.reason)
    stated = GlobalMethod(
        found.method, tuple(int(n) for n in found.grid), float(found.value), False, steps=found.steps,
        motion_m=max((float(r.clearance) for r in found.rollouts), default=None), solved_m=led_to(families),
        seconds=found.seconds, left_out=left_out(best.design),
    )  # fmt: skip
    said = None
    if best.objective == "clearance":
        said = verdict(stated.value_m, followed(stated), best.clearance, stated.left_out)
    return replace(stated, verdict=said, alarm=said == MAY_EXIST)


def led_to(families: Sequence[HopFamily]) -> float | None:
    """Clearance [m] of the best hop that motions of the method ended at, or were stopped near; None if at none."""
    found = [f.clearance_m for f in families if any(name.startswith(GLOBAL) for name in (*f.found_by, *f.stopped))]
    return max(found, default=None)


def alarm_note(figures: GlobalMethod) -> list[str]:
    """A sentence beside the answer where the global method doubts that it is the best."""
    if not figures.alarm or figures.grid is None:
        return []
    return [
        f"not called the best: a global method on a grid of {figures.grid[0]} nodes an axis reaches {followed(figures):.3f} m, "
        "over 1 % more, and no verified hop that high was solved from its motions; hopopt evidence --global looks closer"
    ]
