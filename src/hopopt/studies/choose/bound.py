"""The most that drives could lift a leg by: the bound of docs/bound.md, and what a supply lets through."""

from hopopt.design import Design, physical_parameters
from hopopt.drivetrain.supply import power_limits
from hopopt.leg.derived import derived
from hopopt.verify.upper_bound import upper_bound


def highest(design: Design) -> float:
    """Clearance [m] that no hop from rest of the problem exceeds. Losses only take away from it."""
    found, stance = upper_bound(design), design.hop.stance_duration
    limits = power_limits(design.leg, physical_parameters(design.leg)).values()
    if not limits:
        return found.clearance_m
    assert stance is not None
    lacking = max(0.0, *(found.power_W - float(most) for most in limits))
    by_energy = found.by_energy_m - stance[1] * lacking / derived(design).weight
    return found.clearance_m + min(by_energy, found.by_speed_m) - min(found.by_energy_m, found.by_speed_m)
