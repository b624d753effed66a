"""The machine that carries a plan out, and how far it may be from the one that is planned for."""

from hopopt.design.fields import Section, choice, quantity


class Simulation(Section):
    """The machine that a controller meets, beyond the leg and its motors."""

    control_rate: float = quantity("calls of the controller, the torque held in between", "Hz", 10, 1e6, 4000.0)
    encoder_bits: int = choice(
        "resolution of the joint encoders, one turn in 2^bits steps; 0: perfect", 14, ge=0, le=32
    )
    speed_window: int = choice("control periods over which encoder angles are differenced for speed", 8, ge=1, le=1000)
    speed_error: float = quantity("by which every joint's speed is measured too high", "rad/s", -10, 10, 0.0)
    torque_delay: float = quantity("from a measurement to the torque it leads to", "s", 0, 0.1, 0.0)
    gear_efficiency: float = quantity(
        "of a gear where leg.gear.efficiency does not say; the planner does not know it", "1", 0.05, 1, 1.0
    )
    gear_friction: float = quantity(
        "Coulomb friction of a gear, at the joint, where leg.gear.friction does not say", "N m", 0, 1e3, 0.0
    )
    gear_damping: float = quantity(
        "viscous friction of a gear, at the joint, where leg.gear.damping does not say", "N m s/rad", 0, 1e3, 0.0
    )


class Uncertainty(Section):
    """How far a true leg may be from the one that is planned for: what ``hopopt robust`` draws, uniformly.

    The defaults of mass and torque constant are unverified; the others are taken as known until a spread is given.
    """

    mass: float = quantity("share of each mass, either way (default unverified)", "1", 0, 0.5, 0.05)
    torque_constant: float = quantity(
        "share of each motor's torque constant, either way (default unverified)", "1", 0, 0.5, 0.1
    )
    length: float = quantity("share of each link's length, either way", "1", 0, 0.2, 0.0)
    friction: float = quantity("share of contact.friction, either way", "1", 0, 0.9, 0.0)
    start_angle: float = quantity("of each joint at the start, either way", "rad", 0, 0.2, 0.0)
    speed_error: float = quantity("of every joint's measured speed, either way", "rad/s", 0, 10, 0.0)
    torque_delay: float = quantity("more delay than simulation.torque_delay, at most", "s", 0, 0.02, 0.0)
    gear_loss: float = quantity(
        "share of its torque that each gear loses beyond what is known, at most", "1", 0, 0.5, 0.0
    )

    @property
    def known(self) -> bool:
        """Whether nothing is uncertain."""
        return not any(getattr(self, name) for name in type(self).model_fields)
