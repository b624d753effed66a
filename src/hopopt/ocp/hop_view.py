"""The hop as its constraints, objectives and free parameters see it: the leg, and what holds at an instant."""

from typing import Any, Protocol

import casadi as ca

from hopopt.design import Design, Leg
from hopopt.leg.dynamics import LegDynamics
from hopopt.leg.robot import Robot
from hopopt.ocp.problem import Ends, Instant, Phase


class HopView(Protocol):
    """What ``ocp.hop.Hop`` offers to the parts that it is made of; each is described there."""

    design: Design
    leg: Leg
    robot: Robot
    n: int
    force_range: float
    weight: float
    reach: float
    contact_axes: int
    falling: list[int]
    limits: Any  # (lower, upper), each (n,) [rad]

    @property
    def point_names(self) -> tuple[str, ...]: ...

    def dynamics(self, s: Instant) -> LegDynamics: ...

    def com_and_speed(self, s: Instant) -> tuple[ca.SX, Any]: ...

    def points_at_end(self, e: Ends) -> dict[str, ca.SX]: ...

    def flight(self) -> Phase: ...
