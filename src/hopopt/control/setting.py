"""What a strategy is made from.

A strategy is a class that is made from a ``Setting`` and has ``torque(now: Measurement) -> (n,) [N m]``.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np

from hopopt.control.reference import PlanReference
from hopopt.design import Design, physical_parameters
from hopopt.drivetrain.drives import Drive
from hopopt.drivetrain.gear import Gear, gears_of, states
from hopopt.drivetrain.operating_region.half_planes import OperatingRegion
from hopopt.drivetrain.operating_region.region import operating_region
from hopopt.drivetrain.transmission import largest_ratios
from hopopt.errors import UsageError
from hopopt.leg.kinematics import start_angles
from hopopt.leg.robot import Robot, build_robot
from hopopt.leg.scales import Scale
from hopopt.sim.machine import Machine

LIGHTEST = 1e-3  # [kg m^2] least inertia that gear friction is taken to stop, on the paper's leg


def one_of(*choices: str) -> Any:
    """A field of options that takes one of these words, the first by default."""
    return field(default=choices[0], metadata={"choices": choices})


def chosen(kind: type, given: Mapping[str, Any]) -> dict[str, Any]:
    """Settings by name as a dataclass of numbers and words takes them; UsageError for a name or value it does not have."""
    known = {f.name: f for f in fields(kind)}
    for name, value in given.items():
        if name not in known:
            raise UsageError(f"there is no option {name!r}: choose one of {', '.join(known)}")
        choices = known[name].metadata.get("choices", ())
        if choices and value not in choices:
            raise UsageError(f"{name} = {value!r}: choose one of {', '.join(choices)}")
        if not choices and (isinstance(value, bool) or not isinstance(value, int | float) or not np.isfinite(value)):
            raise UsageError(f"{name} = {value!r}: a number is needed")
    return dict(given)


def gear_of(design: Design) -> Gear:
    """The gears of all joints as the machine has them: as the problem plans with them, else as [simulation] says."""
    s, leg = design.simulation, design.leg

    def open_to(name: str) -> np.ndarray:
        return np.array([not states(leg, joint, name) for joint in leg.joints])

    planned = gears_of(leg, physical_parameters(leg))
    return replace(
        planned,
        efficiency=np.where(open_to("efficiency"), s.gear_efficiency, planned.efficiency),
        friction=planned.friction + open_to("friction") * s.gear_friction,  # a motor's own is there already
        damping=planned.damping + open_to("damping") * s.gear_damping,
        lightest=LIGHTEST * Scale.of(leg).inertia,
    )


@dataclass(frozen=True)
class Setting:
    """What a strategy may know.

    design: the problem, with the leg that it believes in
    period: time between two calls [s]
    plan: the hop that it follows; None without ``needs_plan``
    options: settings of its own by name
    """

    design: Design
    period: float
    plan: PlanReference | None = None
    options: Mapping[str, Any] = field(default_factory=dict)

    @property
    def robot(self) -> Robot:
        """The believed leg's Pinocchio model."""
        return build_robot(self.design.leg)

    def machine(self) -> Machine:
        """The believed leg in Pinocchio, with data of its own."""
        return Machine(self.robot)

    def regions(self) -> list[OperatingRegion]:
        """The believed operating region of every joint."""
        robot = self.robot
        return [operating_region(self.design.leg, joint, robot.parameters) for joint in robot.joints]

    def drive(self) -> Drive:
        """The believed drives."""
        robot = self.robot
        return Drive.of(robot.leg, robot.parameters, robot.rotors, gear_of(self.design), turning=robot.turning)

    @property
    def no_load_speed(self) -> np.ndarray:
        """Joint speed [rad/s] at which each drive has no torque left in the direction of motion, (n,); where its ratio changes with
        the angle, at the highest."""
        speeds = [[1 / h.b for h in region.planes if h.b > 0] for region in self.regions()]
        highest = largest_ratios(self.design.leg, physical_parameters(self.design.leg))
        return np.array([min(of_joint, default=np.inf) for of_joint in speeds]) / highest

    @property
    def angle_noise(self) -> float:
        """Standard error [rad] of an encoder's reading; perfect encoders are taken as very good ones."""
        bits = self.design.simulation.encoder_bits or 24
        return 2 * np.pi / 2**bits / np.sqrt(12)

    @property
    def start(self) -> np.ndarray:
        """Joint angles [rad] at the start."""
        return start_angles(self.design)
