"""What limits are called, and the entries behind them."""

import tomllib
from collections.abc import Iterator

import numpy as np
import pytest

from hopopt.design import Design
from hopopt.leg.limit_id import Kind, LimitId
from hopopt.ocp.hop import Hop
from hopopt.ocp.problem import Component, components
from hopopt.ocp.rules import LEAST_HEIGHT, NO_DESCENT
from hopopt.optimality.directions.infeasibility import Conflict, ConflictPart
from hopopt.optimality.limits import Limit
from hopopt.planner.answer.limit_names import conflict_words, path_value, words_of
from hopopt.problem.load import load

pytestmark = pytest.mark.filterwarnings("error")
SET = {
    "leg.gear.torque_cap": 250.0,
    "leg.gear.speed_cap": 1500.0,
    "leg.knee.motor.torque_cap": 1.5,
    "leg.motor.torque_cap": 1.75,
    "contact.friction": 0.6,
    "contact.least_force": 3.0,
    "hop.counter_movement": False,
    "hop.clearance": 0.25,
    "hop.above_ground": ["foot", "knee"],
}


def limit(kind: str, name: Component, phase: str = "", *, upper: bool = True) -> Limit:
    return Limit(kind, phase, name, upper, np.zeros(1, dtype=int), np.array([np.nan]), 1.0, 1.0, "", name.of)


def limits_of(design: Design) -> Iterator[Limit]:
    """Both sides of everything that the program of a soft landing limits."""
    for constraint in Hop(design, "impact").problem.boundary:
        yield limit("boundary", Component(constraint.name))
    for phase in Hop(design, "impact").problem.phases:
        for upper in (False, True):
            yield limit("duration", Component("duration"), phase.name, upper=upper)
            for state in phase.states:
                yield from (limit("state", name, phase.name, upper=upper) for name in state.components())
        for constraint in phase.path:
            names = components(constraint.name, max(1, len(constraint.labels)), constraint.labels)
            yield from (limit("path", name, phase.name) for name in names)


def entries(stated: str) -> dict[str, object]:
    """Paths and values of what stands behind a limit, read as a problem file is."""
    found = {}
    for part in stated.split(", ") if stated.startswith("leg.") else [stated] if stated else []:
        path, _, value = part.partition(" = ")
        found[path] = tomllib.loads(f"value = {value}")["value"]
    return found


def test_every_entry_has_its_value_as_a_file_writes_it() -> None:
    design, named = load("paper", SET), set[str]()
    for each in limits_of(design):
        for path, value in entries(words_of(design, each)[1]).items():
            named.add(path)
            own = path_value(design, path)
            if isinstance(own, float):
                assert value == pytest.approx(own, rel=1e-5)
            else:
                assert value == (list(own) if isinstance(own, tuple) else own)
                assert type(value) is type(own) or isinstance(own, tuple)
    assert named >= set(SET) | {"hop.least_height", "hop.foot_window", "hop.stance_duration", "hop.flight_duration"}
    assert named >= {"leg.motor.max_torque", "leg.gear.ratio", "leg.hip.lower", "leg.knee.upper"}


def test_the_entry_behind_each_half_plane() -> None:
    """A cap hides no motor: each part of an operating region names what draws it."""
    design = load("paper", SET)
    for label, paths in {
        "gear torque cap": ["leg.gear.torque_cap"],
        "gear speed cap": ["leg.gear.speed_cap", "leg.gear.ratio"],
        "drive torque cap": ["leg.knee.motor.torque_cap", "leg.gear.ratio"],
        "braking line": ["leg.motor.max_torque", "leg.motor.max_speed", "leg.gear.ratio"],
    }.items():
        words, stated = words_of(design, limit("path", Component(LimitId(Kind.REGION, "knee"), label), "stance"))
        assert list(entries(stated)) == paths
        assert words == f"the knee's {'drive' if label == 'braking line' else label} in stance"


def test_a_list_of_names_and_a_switch_in_a_conflict() -> None:
    parts = (
        ConflictPart(limit("path", Component(LEAST_HEIGHT, "foot"), "flight"), 0.1, 1.0, (0.1, 0.2)),
        ConflictPart(limit("path", Component(NO_DESCENT), "stance"), 0.0, 1.0, (0.1, 0.2)),
    )
    said = " ".join(conflict_words(load("paper", SET), Conflict(parts, {}, np.zeros(0))))
    assert 'hop.above_ground = ["foot", "knee"]' in said
    assert "hop.counter_movement = false" in said


def test_a_function_of_ones_own_is_no_limit_of_the_hop() -> None:
    for name in ("clearance", "foot window", "q[hip]"):
        own = Component(LimitId(Kind.USER, name))
        assert words_of(load("paper", SET), limit("path", own, "flight")) == (f"{name} in flight", "")
