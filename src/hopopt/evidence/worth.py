"""What an optimum leans on that no robot has, and what each is worth: the problem solved again without it."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from hopopt.errors import NotSolvedError, ProblemFileError
from hopopt.leg.geometry.above import above_ground
from hopopt.leg.kinematics import start_angles
from hopopt.leg.robot import BASE, build_robot
from hopopt.leg.scales import Scale, weight
from hopopt.ocp.objectives.objective import HEIGHT_FIGURES
from hopopt.ocp.objectives.registry import find
from hopopt.ocp.phases import STANCE
from hopopt.planner.answer.motion_figures import SAMPLES_OF_INTERVAL
from hopopt.planner.solution import Solution
from hopopt.planner.solve import solve
from hopopt.problem.load import changed

MOST_FRICTION = 1.0  # coefficient of friction above which hardly any ground grips
UNLOADED = 0.2  # share of stance without load that is named
LOAD = 0.1  # of the weight: the least ground force that is asked for instead
# [m] on the paper's leg, above the ground: a joint that comes so near; the height that is asked for instead
SKIMS, CLEAR = 0.01, 0.05
AT_STOP, AT_SPEED = 0.01, 2.0  # [rad, and rad/s on the paper's leg]: a joint this near its end stop, and this fast
STOP_DISTANCE = 0.1  # [rad] by which it is kept off its end stop instead
HALF_STANCE = 0.5  # of the longest stance
VARIANT_STARTS = 2


@dataclass(frozen=True)
class Worth:
    """One thing that a hop leans on.

    what: in words. without: entries of the problem that take it away. value: the objective then [its unit], None where
    no hop was found. worth: by how much that is worse. error: what both values together may be off by. verified: whether the
    hop without it is.
    """

    what: str
    without: Mapping[str, Any]
    value: float | None
    worth: float | None
    error: float
    verified: bool

    @property
    def leans(self) -> bool:
        """Whether the hop loses anything without it that its numbers can tell; numbers that are not verified tell nothing."""
        return self.worth is None or not self.verified or self.worth > self.error

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {**vars(self), "without": dict(self.without), "leans": self.leans}

    def words(self, unit: str) -> str:
        """In a sentence."""
        entries = ", ".join(f"{name} = {_shown(value)}" for name, value in self.without.items())
        if self.value is None or self.worth is None:
            return f"leans on {self.what}: with {entries} no hop was found"
        best = f"with {entries} the best is {self.value:.4f} {unit}{'' if self.verified else ', not verified'}"
        if not self.leans:
            return f"has {self.what}, and would lose nothing without: {best}"
        return f"leans on {self.what}, worth {100 * self.worth:.2g} c{unit}: {best}"


def _shown(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def worths(solution: Solution, say: Callable[[str], None] = lambda text: None) -> list[Worth]:
    """Everything that an optimal height leans on, each solved again without it; nothing for other objectives."""
    if solution.own != (None, ()) or find(solution.objective).figure not in HEIGHT_FIGURES:
        return []
    return [_without(solution, what, entries, say) for what, entries in leanings(solution)]


def leanings(solution: Solution) -> Iterator[tuple[str, dict[str, Any]]]:
    """What the hop leans on, in words, and the entries that take it away."""
    design, found = solution.design, solution.summary.leans_on
    friction, (shortest, longest) = design.contact.friction, design.hop.stance_duration
    if found.friction_needed > MOST_FRICTION and (friction is None or friction > MOST_FRICTION):
        yield "a friction above 1", {"contact.friction": MOST_FRICTION}
    least = LOAD * weight(build_robot(design.leg).model)
    if found.load_free_share > UNLOADED and design.contact.least_force < least:
        yield f"a foot without load for {found.load_free_share:.0%} of stance", {"contact.least_force": least}
    if found.stance_at_its_limit == "longest" and HALF_STANCE * longest > shortest:
        yield "a stance as long as it may last", {"hop.stance_duration": [shortest, HALF_STANCE * longest]}
    stance = solution.everywhere(STANCE, SAMPLES_OF_INTERVAL)
    heights = {name: stance.lowest_of(points) for name, points in above_ground(design).items() if name != "foot"}
    near, clear = (height * Scale.of(design.leg).length for height in (SKIMS, CLEAR))
    skimming = [name for name, z in heights.items() if z.min() < near and z[0] > clear]
    if skimming and design.hop.least_height < clear:
        yield f"the {skimming[0]}, which comes down to the ground", {"hop.least_height": clear}
    yield from _end_stops(solution)


def _end_stops(solution: Solution) -> Iterator[tuple[str, dict[str, Any]]]:
    """Joints that reach an end stop at speed."""
    for k, (name, start) in enumerate(zip(solution.robot.joints, start_angles(solution.design), strict=True)):
        joint = solution.design.leg.joint[name]
        for side, stop, way in (("lower", joint.lower, 1.0), ("upper", joint.upper, -1.0)):
            for samples in (solution.everywhere(phase, SAMPLES_OF_INTERVAL) for phase in solution.phases):
                q, v = samples.q[:, BASE + k], samples.v[:, BASE + k]
                fastest = float(np.max(-way * v, initial=0.0, where=way * (q - stop) < AT_STOP))
                if fastest > AT_SPEED / Scale.of(solution.design.leg).time and way * (start - stop) > STOP_DISTANCE:
                    yield (
                        f"the {name}, which meets its end stop at {fastest:.1f} rad/s",
                        {f"leg.{name}.{side}": stop + way * STOP_DISTANCE},
                    )
                    break


def _without(solution: Solution, what: str, entries: dict[str, Any], say: Callable[[str], None]) -> Worth:
    say(f"solving again without {what}")
    objective, before = solution.objective, solution.summary.objective_value
    try:
        again = solve(changed(solution.design, entries), objective, starts=VARIANT_STARTS)
    except (NotSolvedError, ProblemFileError):  # such a hop there is none of, or no such problem
        return Worth(what, entries, None, None, 0.0, False)
    value, goal = again.summary.objective_value, find(objective)
    error = sum(s.summary.objective_error.either_way for s in (solution, again))
    return Worth(what, entries, value, goal.signed_value(before) - goal.signed_value(value), error, again.verified)
