"""One solve of a refinement, as it is told and stored, and by how much the objective changed with the last mesh."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from hopopt.record import Real, Strict, stated

STUCK, NEARER = 5, 0.5  # so many meshes, none of which is nearer to the aims than by this factor
NEARBY_AIM = 4.0  # times its aim: an error within that is not called stuck, for wandering it will meet it


@dataclass(frozen=True)
class MeshStep(Strict):
    """One solve of the refinement."""

    intervals: Mapping[str, int] = stated("by phase")
    held: int = stated("intervals in which limits are enforced between the nodes")
    objective: Real = stated("[its unit]")
    local_error: Real = stated("largest of any interval, scaled")
    excess: Real = stated("largest share of its range by which a limit is passed between the nodes")
    iterations: int = stated("of Ipopt")
    build_seconds: float = stated("to build the program [s]")
    solve_seconds: float = stated("to solve it [s]")
    seconds: float = stated("in all [s]")
    drawn_in: int = stated("how often limits were tightened on this mesh before")


Report = Callable[[MeshStep], None]


def stuck(steps: Sequence[MeshStep], local_error: float, excess: float) -> bool:
    """Whether errors and excess are far from these aims and no longer fall, as where an optimum is an impulse."""
    far = [max(step.local_error / local_error, step.excess / excess) for step in steps]
    return len(far) > STUCK and min(far[-STUCK:]) > max(NEARBY_AIM, NEARER * min(far[:-STUCK]))


def change_of(steps: Sequence[tuple[Mapping[str, int], float, int]], least: float) -> float:
    """Relative change of the objective with the last mesh, from (intervals by phase, objective, how often limits were
    tightened) of every solve: of those with none tightened; infinite after one mesh."""
    plain = [(sizes, objective) for sizes, objective, tightened in steps if not tightened]
    before = [objective for sizes, objective in plain if sizes != plain[-1][0]]
    return relative(plain[-1][1], before[-1], least) if before else float("inf")


def relative(a: float, b: float, least: float = 1e-9) -> float:
    """|a - b| relative to |a|, or to what that is at least."""
    return abs(a - b) / max(abs(a), least)
