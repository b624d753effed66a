"""What keeping exactly to the paper's reference would ask of a leg's drives: inverse dynamics along y_des(t)."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from hopopt.control.paper_pd import Position
from hopopt.control.setting import Setting
from hopopt.design import Design
from hopopt.drivetrain.operating_region.region import operating_region

DIFFERENCE_STEP = 1e-5  # [s] of the differences of the joint angles
SAMPLES = 401  # instants in stance


def tracking_saturation(design: Design, options: Mapping[str, Any] | None = None) -> dict[str, float]:
    """Mean |tau| / tau_sat of every joint from the start to the reference's lift-off, y_des kept to without error.

    Above 1 the drives could not do it. The leg starts with the reference's speed, as if it had been hopping before.
    """
    setting = Setting(design, 1.0, None, options or {})
    servo, robot = Position(setting), setting.robot
    times = np.linspace(servo.begin, servo.two_mass.t_lo, SAMPLES)

    def angles(t: np.ndarray) -> np.ndarray:
        return np.array([servo.angles(float(y)) for y in servo.two_mass.stance_reference(t)[0]])

    before, q, after = (angles(times + h) for h in (-DIFFERENCE_STEP, 0.0, DIFFERENCE_STEP))
    v, a = (after - before) / (2 * DIFFERENCE_STEP), (after - 2 * q + before) / DIFFERENCE_STEP**2
    terms = [servo.machine.stance_terms(*state) for state in zip(q, v, strict=True)]
    tau = np.array([s.mass_matrix @ acceleration + s.joint_bias for s, acceleration in zip(terms, a, strict=True)])
    return {
        joint: float(np.mean(operating_region(design.leg, joint, robot.parameters).saturation(v[:, k], tau[:, k])))
        for k, joint in enumerate(robot.joints)
    }


def point_masses(design: Design) -> Design:
    """The same leg as the reference's two point masses: body and foot, no thigh to speak of, no rotors."""
    tables = design.model_dump(exclude_none=True)
    leg = tables["leg"]
    *others, last = leg["links"]
    for link in leg["links"]:
        leg[link] = {key: leg[link][key] for key in ("length", "mass", "direction")}
    for link in others:
        leg[link]["mass"] = 1e-4
    leg[last] |= {"com": leg[last]["length"], "inertia": 1e-8}
    for part, entry in (("motor", "rotor_inertia"), ("gear", "inertia")):
        for drive in (leg[part], *(leg[joint].get(part, {}) for joint in leg["joints"])):
            drive[entry] = 0.0
    return Design.model_validate(tables)
