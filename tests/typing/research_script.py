# pyright: strict
"""A researcher's program: own functions, a number and a law of one's own, rates, gravity, the program at hand, and reading.

pyright reads it in its strict mode; test_research_script.py builds its program.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

import hopopt as ho
from hopopt.control.setting import Setting
from hopopt.drivetrain.operating_region.half_planes import HalfPlane
from hopopt.drivetrain.operating_region.laws import LAWS
from hopopt.ocp.custom import Moment
from hopopt.ocp.rules import RULES
from hopopt.sim.controller import Measurement

__version__ = "1.0"
ENTRIES: Mapping[str, Any] = {
    "name": "research",
    "needs": ["research_script"],
    "leg.motor.laws": ["derated"],
    "leg.motor.torque_rate": 60.0,
    "environment.gravity": 3.7,
    "environment.slope": 0.05,
    "hop.constraints": ["soft_ground"],
    "hop.stance_duration": [0.03, 0.25],
    "parameters.most": {"value": 400.0, "lower": 100.0, "upper": 2000.0, "unit": "N"},
    "solver.ipopt.mu_strategy": "adaptive",
}


def derated(torque: Any, speed: Any) -> list[HalfPlane]:
    """Nine tenths of the torque at standstill, the same no-load speed."""
    return [
        HalfPlane("derated line", torque / 0.9, speed, "forward"),
        HalfPlane("derated line", -torque / 0.9, -speed, "backward"),
    ]


@ho.constraint(lower=0.0, unit="N", scale=400.0, phases=("stance",))
def soft_ground(now: Moment) -> Any:
    """The ground bears so much and no more."""
    return now.p["most"] - now.f[-1]


@ho.objective(unit="m", scale=0.5)
def body_rise(end: Moment) -> Any:
    """How far the body rises in flight."""
    assert end.lift_off is not None
    return end.q[1] - end.lift_off.q[1]


class Push:
    """Pushes with as much torque as its option says."""

    def __init__(self, setting: Setting):
        self.share = float(setting.options.get("share", 1.0))

    def torque(self, now: Measurement) -> np.ndarray:
        """Joint torques [N m]."""
        return self.share * 100.0 * np.ones_like(now.q)


LAWS["derated"] = derated
RULES["soft_ground"] = soft_ground


def find(results: str) -> ho.Solution:
    """From the program's own answer to a verified hop that is kept."""
    leg = ho.load("paper", ENTRIES)
    program = ho.program(leg, body_rise)
    begin = program.solve({"max_iter": 300})
    return ho.solve(leg, body_rise, guess=begin, starts=1, processes=1, time_limit=200.0, results=results)


def look(folder: str) -> dict[str, Any]:
    """What was kept, read and verified again."""
    found = ho.read(folder, ho.Solution)
    checked = ho.verify(found, objective=body_rise)
    rates = [name for verdict in checked.hops.values() for check in verdict.checks if "rate" in (name := check.name)]
    return {"clearance": found.clearance, "verified": checked.verified, "faults": list(checked.faults), "rates": rates}


def study(results: str) -> tuple[ho.Study, ho.Front, ho.Run, ho.Comparison]:
    """The same functions in studies and in simulation."""
    leg = ho.load("paper", ENTRIES)
    over: dict[str, list[float]] = {"parameters.most.value": [350.0, 400.0]}
    swept = ho.sweep(leg, over, objective=body_rise, starts=1, results=results, time_limit=300.0)
    front = ho.pareto(leg, "peak_force", points=3, starts=1, results=results, time_limit=300.0)
    run = ho.simulate(leg, Push, options={"share": 0.8}, results=results)
    compared = ho.solve("paper", starts=1).compare(Push, results=Path(results))
    best = swept.best
    heights: np.ndarray = swept.to_xarray().clearance_m.to_numpy()
    print(heights.max(), None if best is None else best.values["parameters.most.value"], front.verified_points)
    return swept, front, run, compared
