"""What an objective of a hop consists of, and the clearance that an economical hop must reach."""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

import casadi as ca

from hopopt.design import Design
from hopopt.leg.limit_id import Kind, LimitId
from hopopt.ocp.guesses.motion import MotionAt, MovingLeg
from hopopt.ocp.hops.sequence import Sequence, from_rest
from hopopt.ocp.objectives.direction import Directed
from hopopt.ocp.phases import FLIGHT, LegPhase, length, points_at_apex
from hopopt.ocp.problem import INF, BoundaryConstraint, Control, Ends, Instant, Parameter, PathConstraint

HEIGHT_FIGURES = ("clearance_m", "apex_m")  # figures that are read off the plan's last instant
LOWEST, HIGHEST = -5.0, 20.0  # [m] on the paper's leg, of what the program may choose as a height
REQUIRED = "hop.clearance"  # the parameter (and the problem's entry) that an economical hop must reach [m]

CLEARANCE = LimitId(Kind.CLEARANCE, key=REQUIRED, unit="m")
FOOT_WINDOW = LimitId(Kind.WINDOW, key="hop.foot_window", unit="m")


def tie_break_of(hop: MovingLeg) -> float:
    """Times the problem's own: a value over a time, so that legs in other sizes are as little biased."""
    return 1 / hop.scale.time


@dataclass(frozen=True)
class HopObjective(Directed):
    """What a hop is asked for; functions of ``hop`` get the leg at an instant (ocp/guesses/motion.py).

    value(hop, ends): made as large as possible, or as small without ``maximize`` [unit].
    figure: what the value is called among the printed figures.
    ends: whether the foot must end within its window, must reach hop.clearance too, or is free.
    scale(hop): magnitude of the value [unit].
    parameters, boundary, controls, path (by phase), integrands: the objective's additions to the problem.
    sequence: the phases that it is asked of, and their transitions.
    kind: which hop.kind it is asked of where the problem says "single".
    fault(design): in a sentence, what the problem lacks for it.
    custom: the user's function that it is made of (ocp/custom.py).
    tie_break(hop): times the problem's own, which is stated for the paper's leg; more where optima are flat.
    calm_first: whether it is solved with a larger tie-break first (planner/search/calm_first.py).
    """

    name: str
    meaning: str
    unit: str
    value: Callable[[MovingLeg, Ends], ca.SX]
    figure: str
    ends: Literal["window", "required clearance", "free"] = "window"
    maximize: bool = True
    scale: Callable[[MovingLeg], float] = lambda hop: 1.0
    parameters: Callable[[MovingLeg], tuple[Parameter, ...]] = lambda hop: ()
    boundary: Callable[[MovingLeg], tuple[BoundaryConstraint, ...]] = lambda hop: ()
    controls: Callable[[MovingLeg], tuple[Control, ...]] = lambda hop: ()
    path: Callable[[MovingLeg, LegPhase], tuple[PathConstraint, ...]] = lambda hop, phase: ()
    integrands: Callable[[MovingLeg, MotionAt], Mapping[str, Callable[[Instant], ca.SX]]] = lambda hop, motion: {}
    sequence: Sequence = from_rest
    kind: str | None = None
    fault: Callable[[Design], str | None] = lambda design: None
    custom: Any = None
    tie_break: Callable[[MovingLeg], float] = tie_break_of
    calm_first: bool = False

    @property
    def short(self) -> str:
        """Its name in a sentence or a folder's name; of a function without its module."""
        return re.sub(r"[^A-Za-z0-9_-]+", "_", self.name.rpartition(":")[2]).strip("_")

    @property
    def words(self) -> str:
        """Its name in a figure or a title: a function's as it is, without its module."""
        return self.short if self.is_function else self.name.replace("_", " ")

    @property
    def label(self) -> str:
        """What an axis or a column of its values is called, with its unit if it has one."""
        return self.words if self.unit in ("", "1") else f"{self.words} [{self.unit}]"

    @property
    def is_function(self) -> bool:
        """Whether it is a function of the user's that has no name in the registry."""
        return self.custom is not None and ":" in self.name


def lowest_point(hop: MovingLeg, name: str) -> tuple[BoundaryConstraint, ...]:
    """When flight ends every point of the leg is at least as high as the parameter ``name`` [m], the foot within
    its window."""

    def foot_offset(e: Ends) -> ca.SX:
        points = points_at_apex(hop, e)
        return points["foot"][0] - points[hop.leg.joints[0]][0]

    window = hop.design.hop.foot_window
    return (
        cleared(hop, FLIGHT, lambda e: e.p[name]),
        BoundaryConstraint(FOOT_WINDOW, foot_offset, -window, window, length(hop), "m"),
    )


def cleared(hop: MovingLeg, flight: str, least: Callable[[Ends], Any]) -> BoundaryConstraint:
    """Every point of the leg is at least so high [m] when a flight ends."""

    def heights(e: Ends) -> ca.SX:
        points = hop.flight_points(e.final[flight])
        return ca.vertcat(*[points[name][1] - least(e) for name in hop.point_names])

    return BoundaryConstraint(CLEARANCE, heights, 0.0, INF, length(hop), "m", hop.point_names)


def height(hop: MovingLeg, name: str, value: float = 0.0) -> Parameter:
    """A height that the program chooses [m]; ``value``: where it begins."""
    size = length(hop)
    return Parameter(name, lower=LOWEST * size, upper=HIGHEST * size, scale=size, unit="m", value=value, free=True)


def required_clearance(hop: MovingLeg) -> Parameter:
    """The clearance that the problem asks for, a number of the program: it changes without building it again."""
    return Parameter(REQUIRED, value=hop.design.hop.clearance or 0.0, unit="m")


def no_required_clearance(design: Design) -> str | None:
    """What to say if the problem does not say how high the hop must be."""
    if design.hop.clearance is None:
        return "it needs a clearance to reach: give hop.clearance [m], such as --set hop.clearance=0.4"
    return None


AT_CLEARANCE: dict[str, Any] = {  # fields of an objective that is asked of a hop which reaches hop.clearance
    "ends": "required clearance",
    "parameters": lambda hop: (required_clearance(hop),),
    "boundary": lambda hop: lowest_point(hop, REQUIRED),
    "fault": no_required_clearance,
}
