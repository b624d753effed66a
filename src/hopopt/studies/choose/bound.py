"""The most that drives could lift a leg by: the bound of docs/bound.md, and what a supply lets through."""

from hopopt.design import Design
from hopopt.drivetrain.supply import power_limits
from hopopt.leg.derived import derived
from hopopt.leg.robot import build_robot
from hopopt.verify.upper_bound import upper_bound


def highest(design: Design) -> float:
    """Clearance [m] that no hop from rest of the problem exceeds. Losses only take away from it."""
    found, stance = upper_bound(design), design.hop.stance_duration
    assert stance is not None
    limits = power_limits(design.leg, build_robot(design.leg).parameters).values()
    lacking = max(0.0, *(found.power_W - float(most) for most in limits)) if limits else 0.0
    by_energy = found.by_energy_m - stance[1] * lacking / derived(design).weight
    return found.clearance_m + min(by_energy, found.by_speed_m) - min(found.by_energy_m, found.by_speed_m)
