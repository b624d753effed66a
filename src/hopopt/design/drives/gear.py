"""A gear: its ratio, what limits it, and what it loses."""

from hopopt.design.fields import (
    CATALOGUE,
    CATALOGUE_NAME,
    LEAST_EFFICIENCY,
    MOST_POINTS,
    Section,
    Share,
    Speed,
    Torque,
    choice,
    points_fault,
    quantity,
)


class EfficiencyTable(Section):
    """Efficiency of a gear by the speed of its motor and the torque at its joint, straight between points and level beyond them."""

    speed: tuple[Speed, ...] = choice("of the motor, rising", unit="rad/s", min_length=2, max_length=MOST_POINTS)
    efficiency: tuple[Share, ...] = choice(
        "at these speeds, falling or rising throughout", unit="1", min_length=2, max_length=MOST_POINTS
    )

    torque: tuple[Torque, ...] | None = choice(
        "at the joint, rising: with ``factor``", None, unit="N m", min_length=2, max_length=MOST_POINTS
    )
    factor: tuple[Share, ...] | None = choice(
        "of the efficiency at these torques, at most 1 (default: the torque changes nothing)",
        None, unit="1", min_length=2, max_length=MOST_POINTS,
    )  # fmt: skip
    loss_scale: float = quantity("share of its losses that counts: 1 as printed, 0 none", "1", 0, 1, 1.0, physical=True)

    def fault(self) -> str:
        """What is wrong with the table, in words that follow its path; empty if nothing is."""
        words = "speeds", "efficiencies", "efficiency for each speed", "speed"
        return points_fault(self.speed, self.efficiency, *words) or self._factor_fault()

    def _factor_fault(self) -> str:
        if self.torque is None or self.factor is None:
            missing = "torque" if self.torque is None else "factor"
            return "" if self.torque == self.factor else f"has no {missing}: torque and factor go together"
        if words := points_fault(self.torque, self.factor, "torques", "factors", "factor for each torque"):
            return words
        if min(self.factor) * min(self.efficiency) < LEAST_EFFICIENCY:
            return f"has efficiencies times factors below {LEAST_EFFICIENCY:g}: give larger ones"
        return ""


class Gear(Section):
    ratio: float = quantity("R: motor turns for one turn of the joint", "1", 1.0, 1000, physical=True)
    torque_cap: float | None = quantity("repeated peak torque, joint side", "N m", 1e-4, 1e4, None, physical=True)
    speed_cap: float | None = quantity("input speed limit, motor side", "rad/s", 1.0, 6000, None, physical=True)
    inertia: float | None = quantity(
        "moment of inertia of what turns with the rotor, motor side (default: none)",
        "kg m^2", 0.0, 0.05, None, physical=True,
    )  # fmt: skip
    efficiency: float | None = quantity(
        "eta: share of the torque at its teeth that it passes on, driving or braking (default: none is lost)",
        "1", 0.05, 1, None, physical=True,
    )  # fmt: skip
    efficiency_table: EfficiencyTable | None = choice(
        "efficiency by the motor's speed and the joint's torque, in place of one number: {speed = [...], efficiency = [...]}",
        None,
    )
    friction: float | None = quantity(
        "Coulomb friction, joint side (default: none)", "N m", 0, 1e3, None, physical=True
    )
    damping: float | None = quantity(
        "viscous friction, joint side (default: none)", "N m s/rad", 0, 1e3, None, physical=True
    )
    catalogue: str | None = choice(CATALOGUE, None, pattern=CATALOGUE_NAME, allowed="the name of a catalogue entry")
