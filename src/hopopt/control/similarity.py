"""The paper's gains and lengths on another leg, by dynamic similarity.

A leg has two lengths: its reach, and its travel from the start to the stretched leg. On legs of the paper's shape both
grow alike; a leg that starts higher has less travel, and its spring is as much shorter and stiffer. Every factor is
relative to the built-in problem ``paper`` and exactly 1 there.
"""

from dataclasses import dataclass, fields
from functools import cache
from typing import TypeVar

import numpy as np

from hopopt.design import Design
from hopopt.leg.kinematics import foot_offset, reach, start_angles
from hopopt.leg.robot import BASE, build_robot
from hopopt.problem.load import load
from hopopt.sim.machine import Machine

Gains = TypeVar("Gains")


@dataclass(frozen=True)
class Size:
    """What a leg's gains scale with: its reach [m], the height of its start [m], the mass of all [kg], the mean inertia
    [kg m^2] at its joints at the start, rotors reflected, and gravity [m/s^2]."""

    reach: float
    start: float
    mass: float
    inertia: float
    gravity: float

    @property
    def travel(self) -> float:
        """From the start to the stretched leg [m]."""
        return self.reach - self.start

    @classmethod
    def of(cls, design: Design) -> "Size":
        """The size of a problem's leg."""
        robot, start = build_robot(design.leg), start_angles(design)
        at_joints = np.diag(Machine(robot).mass_matrix(np.concatenate([np.zeros(BASE), start])))[BASE:]
        mass = float(sum(i.mass for i in robot.model.inertias))
        height, gravity = float(-foot_offset(design.leg, start)[1]), float(np.linalg.norm(design.leg.fall))
        return cls(reach(design.leg), height, mass, float(at_joints.mean()), gravity)


@cache
def papers() -> Size:
    """The size of the paper's leg."""
    return Size.of(load("paper"))


def factors(size: Size) -> dict[str, float]:
    """By gain, its factor from the paper's leg to another: k_p by m g l, k_d by sqrt(k_p inertia), C_amp by the
    travel, k_s by m g over the travel, plumb_k and plumb_d by times of sqrt(l / g)."""
    of = papers()
    length, mass, travel = size.reach / of.reach, size.mass / of.mass, size.travel / of.travel
    gravity = size.gravity / of.gravity
    k_p = mass * gravity * length
    return {
        "k_p": k_p,
        "k_d": float(np.sqrt(k_p * (size.inertia / of.inertia))),
        "k_s": mass * gravity / travel,
        "C_amp": travel,
        "plumb_k": gravity / length,
        "plumb_d": 1 / float(np.sqrt(length / gravity)),
    }


def similar_height(design: Design, height: float) -> float:
    """The height [m] of a leg's body that is as far along its travel as ``height`` [m] on the paper's leg."""
    size, of = Size.of(design), papers()
    travel = size.travel / of.travel
    return height * travel + (size.start - of.start * travel)


def scaled(gains: Gains, design: Design) -> Gains:
    """Gains (a dataclass) of the paper's leg for another: by their factors, and y_neu by the travel from the start."""
    known = {f.name: getattr(gains, f.name) for f in fields(gains)}  # type: ignore[arg-type]
    changes = {name: known[name] * factor for name, factor in factors(Size.of(design)).items()}
    return type(gains)(**{**known, **changes, "y_neu": similar_height(design, known["y_neu"])})
