"""What is stated of a touchdown from which the leg goes on, into the next cycle or to rest, and of what it hopped over."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from hopopt.planner.motion import Motion
from hopopt.record import Strict, stated
from hopopt.sim.machine import Machine
from hopopt.verify.hops.obstacle import highest_box
from hopopt.verify.hops.periodic import period, touchdown_of
from hopopt.verify.measures import joint_work
from hopopt.verify.table import DESCENT, LANDING


@dataclass(frozen=True)
class Impact(Strict):
    """The touchdown of a hop that goes on."""

    closure: float = stated("difference of the state after the impact from that in which stance begins [rad, rad/s]")
    step_m: float = stated("how far ahead of where it stood the foot lands [m]")
    work_J: float = stated("net work of the joints over the hop, for the impact and on a slope the climb [J]")
    impulse_Ns: float = stated("of the ground on the foot at touchdown [N s]")
    impact_loss_J: float = stated("kinetic energy that the impact takes [J]")
    foot_speed_m_s: float = stated("of the foot just before touchdown [m/s]")
    gear_impulse_Nms: float = stated("largest that a gear passes on to its rotor, joint side [N m s]")
    gear_impact_torque_Nm: float = stated(
        "the same over hop.touchdown_time: the gear's mean torque in the impact [N m]"
    )


@dataclass(frozen=True)
class Orbit(Impact):
    """A cycle of a periodic hop, and the impact that ends it."""

    period_s: float = stated("duration of a cycle [s]")


@dataclass(frozen=True)
class Landing(Impact):
    """A touchdown, and the way to rest."""

    touchdown_s: float = stated("time of touchdown since stance began [s]")
    rest_s: float = stated("time of rest since stance began [s]")
    peak_ground_force_N: float = stated("largest ground force while the leg comes to rest [N]")
    deepest_m: float = stated("lowest height of the body on the way to rest [m]")


@dataclass(frozen=True)
class ClearedBox(Strict):
    """The box that the leg clears, as the plan's table has it."""

    width_m: float = stated("of the box, along x [m]")
    height_m: float = stated("of the box [m]")
    begins_m: float = stated("its near side, ahead of where the foot stands [m]")


def orbit(plan: Motion) -> Orbit | None:
    """The cycle of a periodic hop and its impact, from the plan's tables; None for any other hop."""
    return Orbit(**_impact(plan), period_s=period(plan.tables)) if plan.design.hop.periodic else None


def landing(plan: Motion) -> Landing | None:
    """The touchdown of a hop that is landed, and how it comes to rest; None for any other hop."""
    if LANDING not in plan.tables:
        return None
    table = plan.tables[LANDING]
    return Landing(
        **_impact(plan),
        touchdown_s=float(plan.tables[DESCENT].t[-1, -1]),
        rest_s=float(table.t[-1, -1]),
        peak_ground_force_N=float(np.linalg.norm(table.f, axis=-1).max()),
        deepest_m=float(table.q[..., 1].min()),
    )


def obstacle(plan: Motion) -> ClearedBox | None:
    """The highest box that the plan's leg clears, from its tables; None if it was not made to."""
    if plan.objective != "obstacle":
        return None
    height, begins = highest_box(Machine(plan.robot), plan.design.hop, plan.tables)
    return ClearedBox(float(plan.design.hop.obstacle.width or 0.0), height, begins)


def _impact(plan: Motion) -> dict[str, Any]:
    """Figures of the impact, by name."""
    found, hop = touchdown_of(Machine(plan.robot), plan.tables), plan.design.hop
    gear = float(np.abs(found.gear).max())
    return {
        "closure": found.closure,
        "step_m": float(found.place[0]),
        "work_J": sum(joint_work(table)[0] for table in plan.tables.values()),
        "impulse_Ns": float(np.linalg.norm(found.impulse)),
        "impact_loss_J": found.loss,
        "foot_speed_m_s": float(np.linalg.norm(found.speed)),
        "gear_impulse_Nms": gear,
        "gear_impact_torque_Nm": gear / hop.touchdown_time,
    }
