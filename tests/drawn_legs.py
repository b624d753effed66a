"""Legs and states drawn at random, and what tests compute with them."""

from typing import Any

import casadi as ca
import numpy as np
import pinocchio as pin
from hypothesis import settings
from hypothesis import strategies as st

from hopopt.design import Leg
from hopopt.leg.inertia import PAIRS
from hopopt.leg.robot import BASE, Robot

quick = settings(max_examples=25, deadline=None)
COUNTS = st.integers(1, 4)


@st.composite
def vectors(draw: st.DrawFn, plane: bool) -> tuple[float, float, float]:
    """A unit vector, in the x-z plane if so wanted."""
    angle, tilt = draw(st.floats(-np.pi, np.pi)), 0.0 if plane else draw(st.floats(-1.5, 1.5))
    return np.cos(tilt) * np.sin(angle), np.sin(tilt), -np.cos(tilt) * np.cos(angle)


@st.composite
def tensors(draw: st.DrawFn) -> tuple[float, ...]:
    """Moments and products of inertia of a few points about their centre."""
    points = np.array(draw(st.lists(st.tuples(*[st.floats(-0.3, 0.3)] * 3), min_size=4, max_size=6)))
    points = np.vstack([points, 0.1 * np.eye(3)])
    points -= points.mean(axis=0)
    xx, yy, zz = points.T @ points @ np.eye(3)
    second = np.array([xx, yy, zz])
    matrix = np.trace(second) * np.eye(3) - second
    return tuple(float(matrix[i, j]) for i, j in PAIRS)


@st.composite
def legs(draw: st.DrawFn, joints: st.SearchStrategy[int] = COUNTS, plane: bool = False) -> Leg:
    """A leg of 1 to 4 joints; centres of mass, inertias and drives of the joints given or left to the defaults; links
    straight down and joints about the y axis, or pointing and turning any way (within the x-z plane if so wanted)."""

    def number(low: float, high: float) -> float:
        return draw(st.floats(low, high))

    def maybe(low: float, high: float) -> float | None:
        return draw(st.none() | st.floats(low, high))

    n = draw(joints)
    names, links = tuple(f"j{k}" for k in range(n)), tuple(f"l{k}" for k in range(n))
    tables: dict[str, Any] = {}
    for name, link in zip(names, links, strict=True):
        motor, gear = {"rotor_inertia": maybe(0.0, 1e-4)}, {"ratio": maybe(1.0, 150.0)}
        tables[name] = {"lower": -3.0, "upper": 3.0, "motor": motor, "gear": gear}
        length = number(0.05, 1.5)
        share = maybe(0.0, 1.0)
        tables[link] = {
            "length": length, "mass": number(0.01, 20.0), "com": None if share is None else share * length,
            "inertia": maybe(1e-6, 2.0),
        }  # fmt: skip
        if draw(st.booleans()):
            tables[name]["axis"] = (0.0, draw(st.sampled_from((-1.0, 1.0))), 0.0) if plane else draw(vectors(False))
            tables[link]["direction"] = draw(vectors(plane))
        if draw(st.booleans()):
            tables[link] |= {"com": None, "com_position": tuple(number(-0.5, 0.5) for _ in range(3))}
            tables[link] |= {"inertia": None, "inertia_tensor": draw(tensors())}
    motor = {"max_torque": 2.0, "max_speed": 1000.0, "rotor_inertia": number(0.0, 1e-4)}
    data = {
        "joints": names, "links": links, "body": {"mass": number(0.1, 50.0)}, "motor": motor,
        "gear": {"ratio": number(1.0, 150.0)}, **tables,
    }  # fmt: skip
    return Leg.model_validate(data)


@st.composite
def legs_in_motion(
    draw: st.DrawFn, joints: st.SearchStrategy[int] = COUNTS, plane: bool = False
) -> tuple[Leg, np.ndarray, np.ndarray, np.ndarray]:
    """A leg with q, v, a of body and joints, (2 + n,) each."""
    leg = draw(legs(joints, plane=plane))
    m = BASE + len(leg.joints)
    state = [draw(st.lists(st.floats(-s, s), min_size=m, max_size=m)) for s in (3.0, 15.0, 300.0)]
    q, v, a = (np.array(x) for x in state)
    return leg, q, v, a


def evaluate(outputs: Any, inputs: list[ca.SX], values: list[Any]) -> list[np.ndarray]:
    """Numbers of several expressions, columns as vectors."""
    results = ca.Function("f", inputs, [ca.densify(ca.SX(o)) for o in outputs])(*values)
    arrays = [np.array(r) for r in (results if isinstance(results, tuple) else (results,))]
    return [x.ravel() if x.shape[1] == 1 else x for x in arrays]


def symbols(n: int, names: str = "qva") -> list[ca.SX]:
    return [ca.SX.sym(name, n) for name in names]


def mass_matrix(robot: Robot, q: np.ndarray) -> np.ndarray:
    """Pinocchio's, both triangles."""
    upper = np.triu(pin.crba(robot.model, robot.model.createData(), q))
    return upper + np.triu(upper, 1).T
