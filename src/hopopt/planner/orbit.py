"""What is stated of the cycle of a periodic hop."""

import numpy as np

from hopopt.planner.solution import Motion
from hopopt.planner.summary_parts import Orbit
from hopopt.sim.machine import Machine
from hopopt.verify.measures import joint_work
from hopopt.verify.periodic import period, touchdown_of


def orbit(plan: Motion) -> Orbit | None:
    """The cycle of a periodic hop and its impact, from the plan's tables; None for any other hop."""
    if not plan.design.hop.periodic:
        return None
    found, hop = touchdown_of(Machine(plan.robot), plan.tables), plan.design.hop
    gear = float(np.abs(found.gear).max())
    return Orbit(
        closure=found.closure,
        period_s=period(plan.tables),
        step_m=float(found.place[0]),
        work_J=sum(joint_work(table)[0] for table in plan.tables.values()),
        impulse_Ns=float(np.linalg.norm(found.impulse)),
        impact_loss_J=found.loss,
        foot_speed_m_s=float(np.linalg.norm(found.speed)),
        gear_impulse_Nms=gear,
        gear_impact_torque_Nm=gear / hop.touchdown_time,
    )
