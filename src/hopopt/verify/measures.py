"""What a plan's table says of the figures a hop may be asked for: by NumPy, without the planner.

Each measure takes the leg in numbers, the plan's tables by phase, and what the hop is asked to be. It returns what the
objective of the same figure claims. Positive parts have kinks and peaks lie between the table's instants, so values are
interpolated first.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from hopopt.design import HopSettings
from hopopt.drivetrain.dynamics import added_states
from hopopt.drivetrain.operating_region.region import operating_region
from hopopt.drivetrain.supply import voltage_share
from hopopt.leg.robot import BASE, Robot
from hopopt.record import Strict, if_any
from hopopt.sim.machine import Machine
from hopopt.verify.hops.obstacle import highest_box
from hopopt.verify.springs.at_drives import at_drives
from hopopt.verify.table import Table, dense, quadrature

SAMPLES_OF_INTERVAL = np.linspace(
    0.0, 1.0, 201
)  # normalised times of an interval; trapezoids are good to about 1e-5 of it
Tables = Mapping[str, Table]


@dataclass(frozen=True)
class Measures(Strict):
    """Figures that a hop can be made for; those that nobody asked for are None."""

    apex_m: float | None = if_any("height of the body when flight ends [m]")
    energy_J: float | None = if_any("positive mechanical work of the joints [J]")
    absolute_work_J: float | None = if_any("absolute mechanical work of the joints [J]")
    electrical_energy_J: float | None = if_any("electrical energy of the motors [J]")
    time_s: float | None = if_any("duration of the hop [s]")
    saturation: float | None = if_any("largest share of a drive's operating region that is used")
    peak_torque_Nm: float | None = if_any("largest torque of any joint [N m]")
    peak_force_N: float | None = if_any("largest ground force [N]")
    impact_J: float | None = if_any("kinetic energy lost at touchdown [J]")
    obstacle_m: float | None = if_any("height of the highest obstacle that the leg clears [m]")
    user_objective: float | None = if_any("a user-defined objective [its unit]")


def normalised_times_of(table: Table) -> np.ndarray:
    """Where in its intervals the table's rows lie, (K,)."""
    longest = int(np.argmax(np.ptp(table.t, axis=1)))
    t = table.t[longest]
    return (t - t[0]) / (t[-1] - t[0])


def finely(table: Table, values: np.ndarray) -> np.ndarray:
    """Values (N, K, ...) of a table interpolated at SAMPLES_OF_INTERVAL, (N, 201, ...)."""
    return dense(normalised_times_of(table), values, SAMPLES_OF_INTERVAL)


def integral(table: Table, values: np.ndarray) -> float:
    """Integral over time of values (N, 201) at FINE."""
    h = table.t[:, -1] - table.t[:, 0]
    return float(h @ np.trapezoid(values, SAMPLES_OF_INTERVAL, axis=1))


def _over_phases(
    tables: Tables,
    rate: Callable[[np.ndarray, np.ndarray], np.ndarray],
    torques: Callable[[Table], np.ndarray],
    speeds: Callable[[Table], np.ndarray],
) -> float:
    """Integral over all phases of rate(tau, w), both (N, 201, n), summed over the joints; torques, speeds: of a table, (N, K, n)."""
    total = 0.0
    for table in tables.values():
        tau, w = (finely(table, x) for x in (torques(table), speeds(table)))
        total += integral(table, rate(tau, w).sum(axis=-1))
    return total


def positive_work(robot: Robot, tables: Tables, hop: HopSettings) -> float:
    """Positive mechanical work of the joints [J], and of the drives behind series springs."""
    return _of_joints(robot, tables, lambda tau, w: np.maximum(tau * w, 0.0))


def absolute_work(robot: Robot, tables: Tables, hop: HopSettings) -> float:
    """The same, braking counted like driving [J]."""
    return _of_joints(robot, tables, lambda tau, w: np.abs(tau * w))


def _of_joints(robot: Robot, tables: Tables, rate: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> float:
    """Integral over all phases of rate(tau, w) of the joints, of the drive where a joint has a series spring."""
    sprung = list(added_states(robot.leg, robot.parameters).sprung)

    def at(column: int, of_joints: np.ndarray, table: Table) -> np.ndarray:
        if not sprung:
            return of_joints
        found, own = of_joints.copy(), at_drives(robot, table)[column]
        found[..., sprung] = own[..., sprung]
        return found

    return _over_phases(
        tables, rate, lambda table: at(2, table.tau, table), lambda table: at(0, table.v[..., BASE:], table)
    )


def electrical_energy(robot: Robot, tables: Tables, hop: HopSettings) -> float:
    """Electrical energy drawn by the motors [J], Joule heat with it, nothing fed back."""

    def of_drives(part: Literal["motor", "gear"], entry: str) -> np.ndarray:
        return np.array([robot.parameters[robot.leg.drive(joint, part, entry)[0]] for joint in robot.joints])

    def rate(tau: np.ndarray, w: np.ndarray) -> np.ndarray:
        current = tau / of_drives("gear", "ratio") / of_drives("motor", "torque_constant")
        return np.maximum(tau * w + of_drives("motor", "winding_resistance") * current**2, 0.0)

    return _over_phases(
        tables, rate, lambda table: table.asked, lambda table: robot.drive_speeds(table.q, table.v, table.drive)
    )


def joint_work(table: Table) -> tuple[float, float]:
    """Net and absolute mechanical work of the joints in one phase [J], by Clenshaw and Curtis in every interval."""
    power = np.sum(table.tau * table.v[..., BASE:], axis=-1)
    h = table.t[:, -1] - table.t[:, 0]
    return float(h @ (power @ quadrature())), float(h @ (np.abs(power) @ quadrature()))


def impact(robot: Robot, tables: Tables, hop: HopSettings) -> float:
    """Kinetic energy lost at the end of the descent, where the foot lands and stays [J]."""
    machine, descent = Machine(robot), tables["descent"]
    q, v = descent.q[-1, -1], descent.v[-1, -1]
    return machine.energy(q, v) - machine.energy(q, machine.touch_down(q, v))


def duration(robot: Robot, tables: Tables, hop: HopSettings) -> float:
    """From the start of the first phase to the end of the last [s]."""
    phases = list(tables.values())
    return float(phases[-1].t[-1, -1] - phases[0].t[0, 0])


def region_share(robot: Robot, tables: Tables, hop: HopSettings) -> float:
    """Largest share of its operating region that any joint uses."""
    worst = 0.0
    for table in tables.values():
        speeds = robot.drive_speeds(table.q, table.v, table.drive)
        tau, w, rate = (finely(table, each) for each in (table.asked, speeds, table.asked_rate))
        columns = [np.moveaxis(each, -1, 0) for each in (tau, w)]
        voltage = voltage_share(robot.leg, robot.parameters, *map(list, columns)) if robot.leg.supply else None
        for k, joint in enumerate(robot.joints):
            region = operating_region(robot.leg, joint, robot.parameters)
            used = region.use(w[..., k], tau[..., k], voltage, rate[..., k])
            worst = max(worst, float(np.max(used)))
    return worst


def peak_torque(robot: Robot, tables: Tables, hop: HopSettings) -> float:
    """Largest torque of any joint [N m]."""
    return max(float(np.abs(finely(table, table.tau)).max()) for table in tables.values())


def peak_force(robot: Robot, tables: Tables, hop: HopSettings) -> float:
    """Largest ground force [N]."""
    return max(float(np.linalg.norm(finely(table, table.f), axis=-1).max()) for table in tables.values())


def obstacle(robot: Robot, tables: Tables, hop: HopSettings) -> float:
    """Height of the highest box of the given width that the leg clears [m]."""
    return highest_box(Machine(robot), hop, tables)[0]


MEASURES: dict[str, Callable[[Robot, Tables, HopSettings], float]] = {
    "energy_J": positive_work,
    "absolute_work_J": absolute_work,
    "electrical_energy_J": electrical_energy,
    "time_s": duration,
    "saturation": region_share,
    "peak_torque_Nm": peak_torque,
    "peak_force_N": peak_force,
    "impact_J": impact,
    "obstacle_m": obstacle,
}
MAY_BE_MORE = ("obstacle_m",)  # the hop may clear more elsewhere
SMALLEST = {"impact_J": 0.01}  # [J] on the paper's leg: a figure that may be 0 is relative to this at least
