"""The parameters of a leg that logs may tell, by their keys, and what each changes in the equations and in the problem."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hopopt.design import Design
from hopopt.drivetrain.motor import rated
from hopopt.leg.inertia import scaled
from hopopt.leg.robot import build_robot
from hopopt.robot_data.identification_rows import places


@dataclass(frozen=True)
class Unknown:
    """A parameter: its key and unit, the problem's value, its kind, the joints it belongs to, and what one unit of it changes
    in the vector of unknown values (``places``)."""

    key: str
    unit: str
    believed: float
    kind: str
    joints: tuple[int, ...]
    column: np.ndarray


def unknowns_of(design: Design) -> list[Unknown]:
    """Every parameter that logs may tell; joints that share an entry of the problem share its parameter."""
    leg, n = design.leg, len(design.leg.joints)
    p, at = build_robot(leg).parameters, places(len(design.leg.joints))
    found: list[Unknown] = []

    def add(
        key: str, unit: str, believed: float, kind: str, joints: Sequence[int], weights: Mapping[int, float]
    ) -> None:
        column = np.zeros(at["end"])
        column[list(weights)] = list(weights.values())
        found.append(Unknown(key, unit, believed, kind, tuple(joints), column))

    for k, path in enumerate(["leg.body.mass", *(f"leg.{link}.mass" for link in leg.links)]):
        add(path, "kg", p[path], "mass", range(n), {k: 1 / p[path]})
    for path, joints in _shared(design, "motor", "rotor_inertia"):
        squares = {at["rotor"] + k: leg.drive(leg.joints[k], "gear", "ratio")[1] ** 2 for k in joints}
        add(path, "kg m^2", p.get(path, 0.0), "rotor", joints, squares)
    for path, joints in _shared(design, "motor", "max_torque"):
        given = leg.drive(leg.joints[joints[0]], "motor", "torque_constant")[1]
        key, unit = path.replace("max_torque", "torque_constant"), "1" if given is None else "N m/A"
        add(key, unit, given or 1.0, "gain", joints, {at["gain"] + k: 1 / (given or 1.0) for k in joints})
    for path, joints in _shared(design, "gear", "efficiency"):
        own, common = leg.drive(leg.joints[joints[0]], "gear", "efficiency")[1], design.simulation.gear_efficiency
        key = "simulation.gear_efficiency" if own is None else path
        add(key, "1", common if own is None else own, "efficiency", joints, {at["efficiency"] + k: 1.0 for k in joints})
    for kind, unit in (("friction", "N m"), ("damping", "N m s/rad")):
        value = getattr(design.simulation, f"gear_{kind}")
        add(f"simulation.gear_{kind}", unit, value, kind, range(n), {at[kind] + k: 1.0 for k in range(n)})
    for path, joints in _shared(design, "motor", "max_speed"):
        add(
            path, "rad/s", rated(leg, leg.joints[joints[0]])[1], "speed", joints, {at["speed"] + k: 1.0 for k in joints}
        )
    return found


def _shared(design: Design, part: Any, entry: str) -> Iterable[tuple[str, list[int]]]:
    """Paths of a drive's entry, and the joints that have it from there."""
    found: dict[str, list[int]] = {}
    for k, joint in enumerate(design.leg.joints):
        found.setdefault(design.leg.drive(joint, part, entry)[0], []).append(k)
    return found.items()


def changed_by(design: Design, u: Unknown, value: float) -> Iterator[tuple[str, Any]]:
    """Entries of the problem that a parameter's value changes: a link's own inertia goes with its mass, and a drive's torques
    with its torque constant, for its limits are currents."""
    leg, ratio = design.leg, value / u.believed if u.believed else 1.0
    if u.kind == "gain":
        for entry in ("max_torque", "torque_cap", "torque_constant"):
            for k in u.joints:
                path, old = leg.drive(leg.joints[k], "motor", entry)
                if path == f"leg.motor.{entry}" and len(u.joints) < len(leg.joints):
                    path = f"leg.{leg.joints[k]}.motor.{entry}"  # the other joints keep the leg's
                if old is not None:
                    yield path, old * ratio
        return
    if u.kind == "mass":
        part = u.key.split(".")[1]
        for entry, changed_to in {**scaled(leg.model_dump()[part], mass=ratio), "mass": value}.items():
            yield f"leg.{part}.{entry}", changed_to
        return
    yield u.key, value
