"""The problem file's model: every entry with its unit, its meaning and the magnitudes it may have.

A problem is data. These classes say what a file may contain and nothing about how it is solved; SI units throughout.
"""

from hopopt.design.control import ControlSettings, Reserve
from hopopt.design.drives.gear import EfficiencyTable, Gear
from hopopt.design.drives.motor import Motor
from hopopt.design.fields import LEAST_EFFICIENCY, MOST_POINTS
from hopopt.design.geometry.parts import LEAST_INERTIA, MOST_SPRINGS, Body, Link, Spring, SpringTable
from hopopt.design.hop import GRAVITY, Contact, Environment, HopSettings, Obstacle, StartPose
from hopopt.design.leg import (
    PAPERS_LENGTH,
    Joint,
    Leg,
    physical_parameters,
    unit,
)
from hopopt.design.problem import Design, as_changed, refuse_landed
from hopopt.design.simulation import Simulation, Uncertainty
from hopopt.design.solver import Solver

__all__ = [
    "GRAVITY", "LEAST_EFFICIENCY", "LEAST_INERTIA", "MOST_POINTS", "MOST_SPRINGS", "PAPERS_LENGTH", "Body", "Contact", "ControlSettings", "Design", "EfficiencyTable", "Environment", "Gear", "HopSettings", "Joint", "Leg", "Link", "Motor", "Obstacle",
    "Reserve", "Simulation", "Solver", "Spring", "SpringTable", "StartPose", "Uncertainty", "as_changed", "physical_parameters", "refuse_landed", "unit",
]  # fmt: skip
