"""The softest landing: the energy of a plastic impact in closed form, and what a hop that lands must be."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from hopopt.design import Leg
from hopopt.errors import UsageError
from hopopt.leg.dynamics import LegDynamics
from hopopt.leg.robot import BASE, Robot, build_robot
from hopopt.ocp.transitions import impact as plastic
from hopopt.planner.solution import Solution
from hopopt.planner.solve import solve
from hopopt.plots.hop import FIGURES
from hopopt.problem.load import load
from hopopt.sim.machine import Machine
from hopopt.storage.seal.recheck import recheck
from hopopt.storage.solution import read, save
from hopopt.verify.check import failed
from hopopt.verify.measures import impact
from hopopt.verify.plan import verify_plan
from hopopt.verify.table import DESCENT, FLIGHT, STANCE, Table
from once import solved_once

CLEARANCE = 0.3  # m
G = 9.81


def tilted() -> Leg:
    """The paper's leg, its knee turned out of the plane."""
    data = load("paper").leg.model_dump(exclude_none=True)
    return Leg.model_validate({**data, "knee": {**data["knee"], "axis": (0.3, 0.8, 0.2)}})


LEGS = {
    "two joints": lambda: load("paper").leg,
    "three joints": lambda: load("three_joint").leg,
    "slider": lambda: load("paper", {"leg.guides": ("z",)}).leg,
    "out of the plane": tilted,
}


@cache
def softest(**more: float) -> Solution:
    """The softest landing from one start."""
    return solved_once({"hop.clearance": CLEARANCE, **more}, "impact")


@cache
def quickest() -> Solution:
    """The hop of the same clearance that takes the least time; it is not asked to land."""
    return solved_once({"hop.clearance": CLEARANCE}, "time")


def lost(robot: Robot, q: np.ndarray, v: np.ndarray) -> float:
    """The planner's expression [J]."""
    symbols = [ca.SX.sym(name, len(q)) for name in "qv"]
    value = plastic(LegDynamics(robot, robot.parameters), *symbols)[2]
    return float(ca.Function("lost", symbols, [value])(q, v))


@pytest.mark.parametrize("name", LEGS)
def test_speeds_after_an_impact_are_pinocchios(name: str) -> None:
    robot, rng = build_robot(LEGS[name]()), np.random.default_rng(3)
    q, v = rng.uniform(-1, 1, (2, BASE + len(robot.joints)))
    machine = Machine(robot)
    v[machine.held] = 0.0
    symbols = [ca.SX.sym(s, len(q)) for s in "qv"]
    after = ca.Function("after", symbols, [plastic(LegDynamics(robot, robot.parameters), *symbols)[0]])(q, v)
    np.testing.assert_allclose(np.array(after).ravel(), machine.touch_down(q, v), rtol=1e-9, atol=1e-11)


def kinetic_difference(robot: Robot, q: np.ndarray, v: np.ndarray) -> float:
    """Pinocchio's energy before the impact less that after it [J]."""
    machine = Machine(robot)
    return machine.energy(q, v) - machine.energy(q, machine.touch_down(q, v))


@pytest.mark.parametrize("name", LEGS)
def test_energy_lost_is_what_the_impact_takes(name: str) -> None:
    """1/2 u' (J M^-1 J')^-1 u against the kinetic energy before and after, at random states; never negative."""
    robot, rng = build_robot(LEGS[name]()), np.random.default_rng(1)
    for _ in range(10):
        q, v = rng.uniform(-1, 1, (2, BASE + len(robot.joints)))
        v[Machine(robot).held] = 0.0
        assert lost(robot, q, 5 * v) == pytest.approx(kinetic_difference(robot, q, 5 * v), rel=1e-9, abs=1e-12)
        assert lost(robot, q, v) > 0


@pytest.mark.parametrize("name", LEGS)
def test_foot_stops_and_guides_hold(name: str) -> None:
    robot = build_robot(LEGS[name]())
    machine, rng = Machine(robot), np.random.default_rng(2)
    q, v = rng.uniform(-1, 1, (2, BASE + len(robot.joints)))
    v[machine.held] = 0.0
    after = machine.touch_down(q, v)
    assert machine.foot_jacobian(q) @ after == pytest.approx(0, abs=1e-10)  # across the plane too, where it leaves it
    assert after[machine.held] == pytest.approx(0, abs=1e-12)
    assert lost(robot, q, after) == pytest.approx(0, abs=1e-12)


def test_a_stretched_leg_that_drops_loses_everything() -> None:
    """No joint gives way along a vertical leg: it is one mass, m v^2 / 2."""
    robot = build_robot(load("paper").leg)
    drop = np.array([0, -1.7, 0, 0])
    assert lost(robot, np.zeros(4), drop) == pytest.approx(0.5 * Machine(robot).mass * 1.7**2, rel=1e-12)


def test_a_folded_leg_without_mass_loses_nothing() -> None:
    """Links and rotors of no mass carry nothing of the body's energy into the ground: lost in proportion to them."""
    light = {"leg.thigh.mass": 1e-6, "leg.shank.mass": 1e-6, "leg.motor.rotor_inertia": 0.0}
    robot = build_robot(load("paper").leg, light)
    assert lost(robot, np.array([0, 0, 0.6, -1.2]), np.array([0, -1.7, 0, 0])) < 1e-5


def test_massless_links_with_rotors_by_hand() -> None:
    """Body m and rotors I on massless links: the mass matrix is diag(m, m, I1, I2) and the foot's Jacobian that of two
    links, both written out here."""
    robot = build_robot(load("paper").leg, {"leg.thigh.mass": 0.0, "leg.shank.mass": 0.0})
    p, q, v = robot.parameters, np.array([0.2, 0.9, 0.6, -1.2]), np.array([0.3, -1.7, 0.4, 0.8])
    m, rotors = p["leg.body.mass"], robot.model.armature[BASE:]
    l1, l2, knee = p["leg.thigh.length"], p["leg.shank.length"], q[2] + q[3]
    c1, s1, c2, s2 = np.cos(q[2]), np.sin(q[2]), np.cos(knee), np.sin(knee)
    J = np.array([[1, 0, l1 * c1 + l2 * c2, l2 * c2], [0, 1, l1 * s1 + l2 * s2, l2 * s2]])
    u = J @ v
    inverse = J @ np.diag(1 / np.array([m, m, *rotors])) @ J.T
    assert lost(robot, q, v) == pytest.approx(0.5 * u @ np.linalg.solve(inverse, u), rel=1e-9)


def test_optimum_lands_at_rest_and_is_verified() -> None:
    """Flight played backwards ends with the foot at rest: the paper's leg can land at 0 J, and does."""
    s = softest()
    assert s.verified, s.summary.failed_checks
    assert s.summary.certified
    assert s.clearance == pytest.approx(CLEARANCE, abs=1e-6)
    q, v = s.tables[DESCENT].q[-1, -1], s.tables[DESCENT].v[-1, -1]
    assert s.summary.reached == pytest.approx(kinetic_difference(s.robot, q, v), abs=1e-9)
    assert 0 <= s.summary.reached < 1e-4
    assert "at rest" in " ".join(s.summary.notes)


def test_descent_is_a_fall_from_the_apex() -> None:
    """No speed of the centre of mass upwards at the apex, its drop G T^2 / 2, the foot at 0 within its window, the
    body no lower than it left."""
    s = softest()
    T, top, end = s.phases[DESCENT].duration, s.sample(s.duration), s.sample(s.end)
    assert top.com_v[0, 1] == pytest.approx(0, abs=1e-9)
    assert top.points["com"][0, 1] - end.points["com"][0, 1] == pytest.approx(G * T**2 / 2, rel=1e-4)
    assert end.points["foot"][0, 1] == pytest.approx(0, abs=1e-9)
    assert abs(end.points["foot"][0, 0] - end.q[0, 0]) <= s.design.hop.foot_window + 1e-6
    assert end.q[0, 1] >= s.sample(s.lift_off).q[0, 1] - 1e-9
    assert s.end == pytest.approx(s.duration + T, rel=1e-12)
    assert set(s.sample(np.linspace(0, s.end, 30)).phase) == {STANCE, FLIGHT, DESCENT}


@pytest.mark.rarely
def test_no_harder_than_a_fall_with_the_joints_held() -> None:
    """The quickest hop of the same clearance, its joints held from the apex on: it falls by the foot's height."""
    s = quickest()
    q, machine = s.tables[FLIGHT].q[-1, -1].copy(), Machine(s.robot)
    height = machine.points(q)["foot"][1]
    v = np.array([0, -np.sqrt(2 * G * height), 0, 0])
    assert softest().summary.reached <= kinetic_difference(s.robot, q, v)


def changed(s: Solution, phase: str, **more: np.ndarray) -> dict[str, Table]:
    return {**s.tables, phase: replace(s.tables[phase], **more)}


def names(s: Solution, tables: dict[str, Table], **claims: float) -> set[str]:
    return {c.name for c in failed(verify_plan(s.design, tables, {**s.claims(), **claims}))}


def test_false_landings_are_found() -> None:
    s = softest()
    descent = s.tables[DESCENT]
    assert names(s, s.tables, impact_J=s.summary.reached + 1e-5) == {"claimed impact_J"}
    lifted = descent.q + np.array([0, 1e-3, 0, 0])
    assert {"apex", "touchdown"} <= names(s, changed(s, DESCENT, q=lifted))
    faster = descent.v.copy()
    faster[-1, -1, 1] -= 0.5
    assert {"claimed impact_J", "descent replay"} <= names(s, changed(s, DESCENT, v=faster))
    rising = descent.v.copy()
    rising[-1, -1, 1] += 0.5
    assert "touchdown" in names(s, changed(s, DESCENT, v=rising))
    weak = descent.tau * 0.9
    assert {"descent replay", "descent inverse dynamics"} <= names(s, changed(s, DESCENT, tau=weak))


@pytest.mark.slow
def test_a_stored_landing_is_read_drawn_and_verified_again(tmp_path: Path) -> None:
    s = read(save(softest(), tmp_path).result_dir or "")
    assert recheck(s).verified
    assert impact(s.robot, s.tables, s.design.hop) == pytest.approx(softest().summary.reached, abs=1e-12)
    labels = [t.get_text() for ax in FIGURES["stick"](s).axes for t in ax.get_xticklabels()]
    assert sum("apex" in t for t in labels) == sum("touchdown" in t for t in labels) == 1
    for name in ("heights", "joints", "operating_region", "ground_force"):
        FIGURES[name](s).draw_without_rendering()


def test_a_clearance_is_needed() -> None:
    with pytest.raises(UsageError, match=r"--set hop\.clearance=0\.4") as caught:
        solve(load("paper"), "impact")
    assert "\n" not in str(caught.value)


@pytest.mark.rarely
def test_slow_motors_cannot_land_at_rest() -> None:
    """What a slower motor may do a faster one may too: it lands no softer; here well above 0 J, and verified."""
    slow = softest(**{"hop.clearance": 0.4, "leg.motor.max_speed": 650.0})
    fast = softest(**{"hop.clearance": 0.4})
    assert slow.verified, slow.summary.failed_checks
    assert slow.summary.reached > 0.01 > fast.summary.reached
