"""How a plan is tracked: what it holds back from the limits, and the gains of the paper's strategies."""

from hopopt.design.fields import Section, quantity


class Reserve(Section):
    """What a plan that is to be tracked holds back from the limits, so that feedback has room.

    What is left out is as large a share of the leg's weight and length as on the paper's leg.
    """

    torque: float = quantity("share of the motors' torque", "1", 0, 0.9, 0.02)
    speed: float = quantity("share of the motors' speed", "1", 0, 0.9, 0.0)
    ground_force: float | None = quantity("vertical ground force (default: scaled)", "N", 0, 1e4, None)
    height: float | None = quantity("height of the joints above the ground (default: scaled)", "m", 0, 0.5, None)
    angle: float = quantity("distance from the joint limits", "rad", 0, 1, 0.02)


class ControlSettings(Section):
    """Gains of the paper's strategies; what is left out is scaled from the paper's leg."""

    k_p: float | None = quantity("stiffness of the joints' PD law (default: scaled)", "N m/rad", 1e-6, 1e7, None)
    k_d: float | None = quantity("damping of the joints' PD law in stance (default: scaled)", "N m s/rad", 0, 1e6, None)
    k_s: float | None = quantity("stiffness of the reference's spring (default: scaled)", "N/m", 0, 1e7, None)
    y_neu: float | None = quantity("rest length of the reference's spring (default: scaled)", "m", 0, 10, None)
    C_amp: float | None = quantity(
        "amplitude of the reference beyond its rest length (default: scaled)", "m", 0, 10, None
    )
    C_max: float | None = quantity("largest shortening of the reference (default 0.11)", "1", 0, 0.99, None)
    plumb_k: float | None = quantity(
        "how stiffly the body is kept on the plumb line (default: scaled)", "1/s^2", 0, 1e6, None
    )
    plumb_d: float | None = quantity("damping of that (default: scaled)", "1/s", 0, 1e5, None)
