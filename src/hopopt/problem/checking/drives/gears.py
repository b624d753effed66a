"""Rules between the entries of what gears lose."""

import numpy as np

from hopopt.design import EfficiencyTable, Leg, Simulation
from hopopt.drivetrain.gear import TABLE, efficiency_table, factor_curve
from hopopt.drivetrain.transmission import SAMPLES
from hopopt.problem.checking.faults import Report


def loss_rules(leg: Leg, simulation: Simulation, report: Report) -> None:
    """Report an efficiency that would hold for no gear, as each has its own."""
    _table_rules(leg, report)
    tabled = {joint for joint in leg.joints if efficiency_table(leg, joint) is not None}
    own = [leg.drive(joint, "gear", TABLE if joint in tabled else "efficiency") for joint in leg.joints]
    if simulation.gear_efficiency != 1 and all(value is not None for _, value in own):
        paths = ", ".join(dict.fromkeys(path for path, _ in own))
        words = f"holds for no gear, as each has its own: change {paths}, or set simulation.gear_efficiency to 1"
        report.add("simulation.gear_efficiency", f"= {simulation.gear_efficiency:g} {words}")


def _table_rules(leg: Leg, report: Report) -> None:
    """Report tables of efficiency that are no function of the speed, turn back, or stand beside one number."""
    for path, gear in (("leg.gear", leg.gear), *((f"leg.{joint}.gear", leg.joint[joint].gear) for joint in leg.joints)):
        table = None if gear is None else gear.efficiency_table
        if gear is not None and table is not None and gear.efficiency is not None:
            report.add(f"{path}.{TABLE}", "stands beside efficiency: each says what the gear passes on, remove one")
        elif table is not None and (words := table.fault() or _factor_fault(table)):
            report.add(f"{path}.{TABLE}", words)


def _factor_fault(table: EfficiencyTable) -> str:
    """Where a larger torque at the joint would go with a smaller one at the teeth; empty if nowhere."""
    if (curve := factor_curve(table)) is None:
        return ""
    at = np.linspace(float(curve.x[0]), float(curve.x[-1]), SAMPLES)
    for steeper, words in ((curve(at) - at * curve(at, 1), "rise"), (curve(at) + at * curve(at, 1), "fall")):
        if (wrong := steeper <= 0).any():
            less = f"at {at[wrong][0]:.3g} N m, so that more at the joint would go with less at the motor"
            return f"has factors that {words} too fast {less}: set the torques further apart, or the factors nearer together"
    return ""
