"""What springs store and give back, from the plan's table."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from hopopt.drivetrain.dynamics import added_states
from hopopt.leg.robot import BASE, Robot
from hopopt.record import Strict, stated
from hopopt.verify.table import STANCE, Table, over_time


@dataclass(frozen=True)
class SpringEnergy(Strict):
    """What a spring beside the drives stores, and gives back: at lift-off it holds at_start + taken - given."""

    at_start_J: float = stated("stored when stance begins, above the empty spring [J]")
    taken_J: float = stated("that it takes up in stance [J]")
    given_J: float = stated("that it gives the leg in stance [J]")
    peak_torque_Nm: float = stated("largest torque of the hop, on a joint of coefficient 1 [N m]")


def spring_energies(robot: Robot, tables: Mapping[str, Table]) -> dict[str, SpringEnergy]:
    """What each spring stores and gives back [J], from the plan's joint angles."""
    found = dict[str, SpringEnergy]()
    for name, law in robot.springs.laws.items():
        angles = {phase: law.angle(list(np.moveaxis(t.q[..., BASE:], -1, 0))) for phase, t in tables.items()}
        stored = law.energy(angles[STANCE].ravel())
        steps = np.diff(stored)
        peak = max(float(np.abs(law.torque(s)).max()) for s in angles.values())
        gone = float(np.maximum(steps, 0).sum()), float(np.maximum(-steps, 0).sum())
        found[name] = SpringEnergy(float(stored[0]), *gone, peak)
    return found


@dataclass(frozen=True)
class SeriesSpringEnergy(SpringEnergy):
    """The same of a series spring, and how far it gives way."""

    peak_deflection_rad: float = stated("by which the drive is ahead of its joint, or behind it, at most [rad]")
    lost_J: float = stated("that its damping turns into heat over the hop [J]")


def series_spring_energies(robot: Robot, tables: Mapping[str, Table]) -> dict[str, SeriesSpringEnergy]:
    """What the series spring of each joint stores, gives back and turns into heat [J]; tables with states of the drives."""
    states, found = added_states(robot.leg, robot.parameters), dict[str, SeriesSpringEnergy]()
    for k, place in states.sprung.items():
        joint, deflections, lost = robot.joints[k], dict[str, np.ndarray](), 0.0
        k_s, d = (robot.parameters.get(f"leg.{joint}.series_spring.{name}", 0.0) for name in ("stiffness", "damping"))
        for phase, table in tables.items():
            assert table.drive is not None
            deflections[phase] = table.drive[..., place - 1]
            lost += over_time(table, d * (table.drive[..., place] - table.v[..., BASE + k]) ** 2)
        stored = k_s * deflections[STANCE].ravel() ** 2 / 2
        steps = np.diff(stored)
        gone = float(np.maximum(steps, 0).sum()), float(np.maximum(-steps, 0).sum())
        peak = max(float(np.abs(t.tau[..., k]).max()) for t in tables.values())
        most = max(float(np.abs(x).max()) for x in deflections.values())
        found[joint] = SeriesSpringEnergy(float(stored[0]), *gone, peak, most, lost)
    return found
