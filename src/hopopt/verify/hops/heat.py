"""How hot do motors get, hop after hop? What a plan's torques make of windings and housings, integrated by SciPy."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

from hopopt.design import Design
from hopopt.drivetrain.heat import LIMIT, Cycle, TwoBodies
from hopopt.drivetrain.supply import winding_heat
from hopopt.leg.robot import Robot
from hopopt.record import Real, Strict, if_any, stated
from hopopt.verify.check import LIMIT as KEPT
from hopopt.verify.check import Check
from hopopt.verify.table import NORMALISED_TIMES, POWERS, TO_POWERS, Table, over_time


@dataclass(frozen=True)
class JointHeat(Strict):
    """How hot a joint's motor gets, and what it gives in the mean over the hop and the pause after it."""

    peak_torque_N_m: float = stated("the motor's largest torque, in front of its gear [N m]")
    rms_torque_N_m: float = stated("root of the mean square of the motor's torque [N m]")
    share_of_continuous: float | None = if_any("rms_torque_N_m over motor.continuous_torque")
    rms_current_A: float | None = if_any("root of the mean square of the motor's current [A]")
    winding_temperature_C: Real | None = if_any(
        "highest in the hop: from cold, or with hop.pause when hopping has gone on for ever [degC]"
    )
    housing_temperature_C: Real | None = if_any("at the end of that hop [degC]")
    hops_from_cold: int | None = if_any("hops from cold, hop.pause between them, that end within winding_limit")


def heat_figures(design: Design, robot: Robot, tables: Mapping[str, Table]) -> dict[str, JointHeat] | None:
    """How hot each joint's motor gets; None where the problem has neither thermal entries nor continuous torques."""
    leg, found = design.leg, dict[str, JointHeat]()
    for k, joint in enumerate(robot.joints):
        own = {name: leg.drive(joint, "motor", name)[1] for name in ("continuous_torque", "torque_constant", LIMIT)}
        hot, ratio = motor_heat(design, robot, tables, joint), leg.drive(joint, "gear", "ratio")[1]
        if hot is None and own["continuous_torque"] is None:
            continue
        lasts = sum(float(table.t[-1, -1] - table.t[0, 0]) for table in tables.values()) + (design.hop.between or 0.0)
        square = sum(over_time(table, (table.asked[..., k] / ratio) ** 2) for table in tables.values()) / lasts
        rms, k_t, most = float(np.sqrt(square)), own["torque_constant"], own[LIMIT]
        found[joint] = JointHeat(
            max(float(np.abs(table.asked[..., k]).max()) for table in tables.values()) / ratio,
            rms,
            share_of_continuous=None if own["continuous_torque"] is None else rms / own["continuous_torque"],
            rms_current_A=None if k_t is None else rms / k_t,
            winding_temperature_C=None if hot is None else design.ambient + hot.highest,
            housing_temperature_C=None if hot is None else design.ambient + float(hot.end[1]),
            hops_from_cold=None if hot is None or most is None else hot.cycle.hops_within(most - design.ambient),
        )
    return found or None


@dataclass(frozen=True)
class MotorHeat:
    """A motor over a hop. cycle: the hop and the pause after it. highest: rise of the winding [K]; end (2): rises of winding and
    housing [K] at the end. Infinite where hopping on makes them grow without end."""

    cycle: Cycle
    highest: float
    end: np.ndarray


def motor_heat(design: Design, robot: Robot, tables: Mapping[str, Table], joint: str) -> MotorHeat | None:
    """What the torques of a plan make of a joint's motor, integrated by SciPy; None without thermal entries."""
    bodies = TwoBodies.of(design.leg, joint, robot.parameters, design.ambient)
    if bodies is None:
        return None
    k, heat = robot.joints.index(joint), float(winding_heat(design.leg, joint, robot.parameters))
    rises = [np.hstack([np.eye(2), np.zeros((2, 1))])]  # from a winding or a housing 1 K above ambient, and from cold
    for table in tables.values():
        for t, torque in zip(table.t, table.asked[..., k], strict=True):
            rises += _warmed(bodies, heat, t[-1] - t[0], TO_POWERS @ torque, rises[-1])
    at = np.array(rises)
    pause, at[..., :2] = design.hop.between, at[..., :2] - at[..., 2:]
    cycle = Cycle(at[-1, :, :2], at[-1, :, 2], bodies.cooling(pause or 0.0))
    if pause is None:
        return MotorHeat(cycle, float(at[:, 0, 2].max()), cycle.gained)
    if (steady := cycle.steady) is None:
        return MotorHeat(cycle, np.inf, np.full(2, np.inf))
    return MotorHeat(cycle, float((at[:, 0] @ np.append(cycle.cooled @ steady, 1.0)).max()), steady)


def _warmed(bodies: TwoBodies, heat: float, duration: float, torque: np.ndarray, begin: np.ndarray) -> list[np.ndarray]:
    """Rises (2, m) [K] at the later instants of an interval, from m beginnings; torque: coefficients of its powers."""

    def rates(place: float, x: np.ndarray) -> np.ndarray:
        lost = heat * ((2 * place - 1) ** POWERS @ torque) ** 2
        winding, housing = x.reshape(2, -1)
        return duration * np.concatenate(bodies.rates(winding, housing, lost))

    run = solve_ivp(rates, (0.0, 1.0), begin.ravel(), "DOP853", NORMALISED_TIMES[1:], rtol=1e-10, atol=1e-10)
    return list(run.y.T.reshape(-1, *begin.shape))


def heat_checks(design: Design, robot: Robot, tables: Mapping[str, Table]) -> Iterator[Check]:
    """That no winding gets hotter than its limit, as a share of its range above ambient."""
    for joint in robot.joints:
        most = design.leg.drive(joint, "motor", LIMIT)[1]
        if most is not None and (hot := motor_heat(design, robot, tables, joint)) is not None:
            over = hot.highest / (most - design.ambient) - 1.0
            yield Check(f"{joint} winding temperature", max(over, 0.0), KEPT, "of its range")
