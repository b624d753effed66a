"""The stance in closed form against Pinocchio, on random legs and states."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from hopopt import load
from hopopt.compiled.kernel import packed
from hopopt.design import Design
from hopopt.drivetrain.operating_region.region import operating_region
from hopopt.global_search.constants import room_at, stance_constants, to_joint_angles, to_link_angles
from hopopt.global_search.equations.accelerations import VERTICES, polygon
from hopopt.global_search.equations.dynamics import MARGINS, apex_height, stance_terms, state_margins, way_is_free
from hopopt.global_search.equations.flight import FLIGHT_STEPS, LATER, _accelerations, _turned, flight_of, fold_loss
from hopopt.global_search.equations.four_states import fastest_joints
from hopopt.global_search.motions import keeps_limits, workspace
from hopopt.global_search.posture import best_tuck, tuck_height
from hopopt.leg.geometry.distance import distances_of
from hopopt.leg.geometry.smooth import clearances, margin_of
from hopopt.leg.kinematics import joint_positions, start_angles
from hopopt.leg.robot import BASE, build_robot
from hopopt.ocp.guesses.posture import Posture
from hopopt.ocp.hop import Hop
from hopopt.sim.machine import Machine


def random_leg(rng: np.random.Generator) -> Design:
    """The paper's leg with other masses, lengths, directions, axes, drives and ground."""
    lean = rng.uniform(-0.5, 0.5, 2)
    return load(
        "paper",
        [
            f"leg.body.mass={rng.uniform(2, 10)}",
            f"leg.thigh.length={rng.uniform(0.3, 0.5)}",
            f"leg.shank.com_position=[{rng.uniform(-0.1, 0.1)},0.01,{rng.uniform(-0.3, -0.1)}]",
            f"leg.thigh.direction=[{lean[0]},0,-1]",
            f"leg.shank.direction=[{lean[1]},0,-1]",
            f"leg.knee.axis=[0,{rng.choice([-1, 1])},0]",
            f"leg.gear.ratio={rng.uniform(40, 120)}",
            f"contact.friction={rng.uniform(0.4, 1.2)}",
            "start.hip_height=0.4",
            "leg.knee.lower=-2.8",
            "leg.knee.upper=2.8",
            "leg.hip.lower=-2",
            "leg.hip.upper=2",
            "leg.gear.torque_cap=100",
            f"leg.spring.knee.stiffness={rng.uniform(0, 40)}",
            f"leg.spring.knee.rest_angle={rng.uniform(-1, 1)}",
            "leg.spring.knee.acts='below'",
            "leg.spring.both={stiffness = 5, rest_angle = 0.2, joints = ['hip', 'knee'], coefficients = [1, -0.5]}",
        ],
    )


@pytest.fixture(params=range(6))
def rng(request: pytest.FixtureRequest) -> np.random.Generator:
    return np.random.default_rng(request.param)


def test_equations_of_motion(rng: np.random.Generator) -> None:
    """Torques, ground force, centre of mass: the same to 1e-10."""
    design = random_leg(rng)
    c, robot = stance_constants(design), build_robot(design.leg)
    machine = Machine(robot)
    for _ in range(10):
        q, v, a = rng.uniform(-1.5, 1.5, 2), rng.uniform(-8, 8, 2), rng.uniform(-300, 300, 2)
        terms = machine.stance_terms(q, v)
        phi, rate, alpha = (to_link_angles(c, x) for x in (q, v, a))
        m12, h1, h2, x1, z1, x2, z2, fx, fz = stance_terms(packed(c), *phi, *rate)
        Q1, Q2 = c.m11 * alpha[0] + m12 * alpha[1] + h1, m12 * alpha[0] + c.m22 * alpha[1] + h2
        tau = np.array([c.turn1 * (Q1 + Q2), c.turn2 * Q2])
        np.testing.assert_allclose(tau, terms.mass_matrix @ a + terms.joint_bias, rtol=1e-10, atol=1e-9)
        force = fx - z1 * alpha[0] - z2 * alpha[1], fz + x1 * alpha[0] + x2 * alpha[1]
        np.testing.assert_allclose(force, terms.force(a), rtol=1e-10, atol=1e-9)
        com, speed = machine.points(terms.q)["com"][1], machine.com_velocity(terms.q, terms.v)[1]
        assert apex_height(packed(c), *phi, *rate) == pytest.approx(com + max(speed, 0) ** 2 / 2 / c.gravity, 1e-10)
        np.testing.assert_allclose(to_joint_angles(c, phi), q, atol=1e-14)


def test_vertices_are_where_two_limits_meet(rng: np.random.Generator) -> None:
    """Each vertex keeps every drive's region, the ground's force and its friction, and uses two limits fully."""
    design = random_leg(rng)
    c, robot, machine = stance_constants(design), build_robot(design.leg), Machine(build_robot(design.leg))
    regions = [operating_region(design.leg, name, robot.parameters) for name in design.leg.joints]
    sets = [np.zeros(VERTICES, dtype=kind) for _ in range(2) for kind in (float, float, np.int64)]
    found = 0
    for _ in range(20):
        q, v = rng.uniform(-1, 1, 2), rng.uniform(-6, 6, 2)
        phi, rate = to_link_angles(c, q), to_link_angles(c, v)
        terms = machine.stance_terms(q, v)
        for i in range(polygon(packed(c), *phi, *rate, *sets)):
            a = to_joint_angles(c, np.array([sets[0][i], sets[1][i]]))
            tau, (fx, fz) = terms.mass_matrix @ a + terms.joint_bias, terms.force(a)
            room = [1 - max(r.use(w, t)) for r, w, t in zip(regions, v, tau, strict=True)]
            room += [fz / 100, (c.friction * fz - fx) / 100, (c.friction * fz + fx) / 100]
            assert min(room) > -1e-7
            assert sorted(np.abs(room))[1] < 1e-7
            found += 1
    assert found


def test_tuck_is_the_best_of_many_poses(rng: np.random.Generator) -> None:
    design = random_leg(rng)
    c, machine = stance_constants(design), Machine(build_robot(design.leg))
    tuck, window = tuck_height(c, design.hop.foot_window), design.hop.foot_window
    sides = [(design.leg.joint[name].lower, design.leg.joint[name].upper) for name in design.leg.joints]
    least = np.inf
    for q in np.transpose([rng.uniform(*side, 400) for side in sides]):
        places = joint_positions(design.leg, q)
        if abs(places[-1, 0]) <= window:
            com = machine.points(np.concatenate([[0, 0], q]))["com"][1]
            least = min(least, com - places[:, 2].min())
    assert tuck <= least + 1e-9
    assert tuck > least - 0.1
    assert np.isfinite(start_angles(design)).all()


def test_flight_is_that_of_a_free_leg(rng: np.random.Generator) -> None:
    """Joint accelerations with both drives at their most, and with one joint held, as Pinocchio's on free guides."""
    design = random_leg(rng)
    c, robot = stance_constants(design), build_robot(design.leg)
    packed_c, flight = packed(c), packed(flight_of(c, design.hop.foot_window, np.array([9.0, 9.0])))
    regions = [operating_region(design.leg, name, robot.parameters) for name in design.leg.joints]
    for way in ((1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (0.0, 1.0), (-1.0, 0.0)):
        q, v = rng.uniform(-1.5, 1.5, 2), rng.uniform(-3, 3, 2)
        found = np.array(_accelerations(packed_c, flight, *q, *v, *way))
        tau = [r.torque_bounds(w)[side > 0] for r, w, side in zip(regions, v, way, strict=True)]
        state, rate = np.concatenate([[0, 0], q]), np.concatenate([[0, 0], v])
        data = robot.model.createData()
        M = pin.crba(robot.model, data, state)
        M = np.triu(M) + np.triu(M, 1).T
        left = np.concatenate([[0, 0], tau]) - Machine(robot).inverse_dynamics(state, rate, np.zeros(4))
        free = [0, 1, *(BASE + k for k in range(2) if way[k])]  # a joint that is held takes what torque that needs
        expected = np.zeros(4)
        expected[free] = np.linalg.solve(M[np.ix_(free, free)], left[free])
        np.testing.assert_allclose(found, expected[BASE:], rtol=1e-9, atol=1e-8)


def test_quick_drives_lose_nothing_in_flight_and_slow_ones_do() -> None:
    """The same lift-off, straight and fast: the slower the drives, the less of its apex is cleared."""
    lost = []
    for speed in (1256.637, 500, 250, 120):
        c = stance_constants(load("paper", [f"leg.motor.max_speed={speed}"]))
        flight = packed(flight_of(c, 0.1, np.full(2, speed / 100)))
        lost.append(fold_loss(packed(c), flight, *to_link_angles(c, np.array([0.3, -0.6])), -12.0, 12.0))
    assert lost[0] == 0
    assert sorted(lost) == lost
    assert lost[-1] > 0.1


def shaped(tmp_path: Path, more: str) -> Design:
    """The paper's leg with shapes."""
    (tmp_path / "shaped.toml").write_text(f'extends = "paper"\nname = "shaped"\n{more}')
    return load(tmp_path / "shaped.toml")


BALL = "[leg.body.shapes.bar]\npoints = [[-0.15, 0.0, -0.15]]\nradius = 0.05\n[leg.shank]\nradius = 0.02\n"


def test_a_tuck_has_trunk_and_thigh_above_the_lowest_point_and_meets_nothing(tmp_path: Path) -> None:
    """The planner's posture, by other code; the least distance in it by coal, which neither asks there."""
    for deep in (0.1, 0.2):
        ball = f"[leg.body.shapes.ball]\npoints = [[0.1, 0.0, -0.15]]\nradius = 0.03\ncounts = false\n[leg.thigh]\nradius = {deep / 4}\n"
        lower = f"[leg.body.shapes.plate]\nbox = [0.02, 0.02, 0.02]\nat = [-0.3, 0.0, {0.01 - deep}]\n"
        design = shaped(tmp_path, ball + lower)
        tuck, pose = best_tuck(stance_constants(design), design.hop.foot_window)
        planned = Posture(Hop(design))
        assert tuck == pytest.approx(-float(planned.height(planned.best()[None])[0]), abs=1e-4)
        assert distances_of(design).all(pose[None]).min() > margin_of(design) - 1e-3


def test_what_links_pass_is_a_limit_of_states(tmp_path: Path) -> None:
    """The room of the compiled table against coal, and the hip as much higher as the body hangs lower."""
    design, rng = shaped(tmp_path, BALL), np.random.default_rng(4)
    c, out, solids = stance_constants(design), np.zeros(MARGINS), distances_of(design)
    assert c.hip_least == pytest.approx(0.2 + design.hop.least_height)
    planned, kept_apart = clearances(design), margin_of(design)
    assert planned is not None
    near = 0
    for q in rng.uniform([c.lower1, c.lower2], [c.upper1, c.upper2], (2000, 2)):
        state_margins(packed(c), *to_link_angles(c, q), 0.0, 0.0, out)
        distance = float(solids.all(q[None]).min())
        assert out[-1] == pytest.approx(float(room_at(c, q[None])[0]), abs=1e-9)
        if abs(distance - kept_apart) < 0.01:
            near += 1
            assert out[-1] == pytest.approx(distance - kept_apart - planned.error, abs=3e-3)
    assert near > 20


def barred(tmp_path: Path, x: float, z: float) -> Design:
    """The paper's leg, its shank 2 cm thick, with a thin bar across its plane."""
    bar = f"[leg.body.shapes.bar]\npoints = [[{x}, 0.0, {z}]]\nradius = 0.01\ncounts = false\n"
    return shaped(tmp_path, bar + "[leg.shank]\nradius = 0.01\n[hop]\ncollision_margin = 0.0\n")


RISING = np.array([0.5, -1.0]), np.array([-11.0, 21.0])  # rad, rad/s: a lift-off 0.33 s before its apex


@pytest.mark.parametrize(("x", "z", "met"), [(0.052, -0.718, True), (-0.001, -0.677, True), (0.4, -0.1, False)])
def test_a_fold_that_would_meet_the_body_is_held(tmp_path: Path, x: float, z: float, met: bool) -> None:
    """Joints move by up to 0.26 rad in a step. coal looks along each; heights are the leg's own points and Pinocchio's."""
    design, (q, w) = barred(tmp_path, x, z), RISING
    c, solids, machine = stance_constants(design), distances_of(design), Machine(build_robot(design.leg))
    flight = flight_of(c, design.hop.foot_window, fastest_joints(design))
    terms = machine.stance_terms(q, w)
    time = machine.com_velocity(terms.q, terms.v)[1] / c.gravity
    dt = LATER * time / FLIGHT_STEPS

    def low(q: np.ndarray) -> float:
        places = joint_positions(design.leg, q)
        com = machine.points(np.concatenate([[0, 0], q]))["com"][1]
        outside = max(abs(places[-1, 0] - places[0, 0]) - design.hop.foot_window, 0.0)
        return com - places[:, 2].min() - flight.tuck + outside

    now = machine.points(terms.q)["com"][1] + 0.5 * c.gravity * time**2 - flight.tuck
    expected, hit = now, False
    for k in range(FLIGHT_STEPS):
        way = np.sign([flight.target1 - q[0], flight.target2 - q[1]])
        a = _accelerations(packed(c), packed(flight), *q, *w, *way)
        first = _turned(q[0], w[0], a[0], dt, flight.fastest1, c.lower1, c.upper1, flight.target1, way[0])
        second = _turned(q[1], w[1], a[1], dt, flight.fastest2, c.lower2, c.upper2, flight.target2, way[1])
        then, w = np.array([first[0], second[0]]), np.array([first[1], second[1]])
        hit = bool(solids.all(np.linspace(q, then, 100)).min() < 0)
        if hit:
            expected = min(expected, low(q)) if k * dt < time else expected
            break
        q, past = then, (k + 1) * dt - time
        tucked = past <= 0 and q.tolist() == [flight.target1, flight.target2]  # and stays so up to the apex
        expected = min(expected, 0.0 if tucked else low(q) + 0.5 * c.gravity * past**2)
    assert hit == met
    lost = fold_loss(packed(c), packed(flight), *to_link_angles(c, RISING[0]), *to_link_angles(c, RISING[1]))
    assert lost == pytest.approx(expected, abs=1e-6)
    assert (lost > 0.3) == met


def test_a_way_may_touch_by_a_share_of_the_reach_and_no_more_with_every_step() -> None:
    """A room that falls by 0.4 mm over the fold, by less in each step than links may touch; and the leg ten times as large."""
    design, (q, w) = load("paper"), RISING
    c = stance_constants(design)
    flight = packed(flight_of(c, design.hop.foot_window, fastest_joints(design)))
    falling = np.tile(np.linspace(-4e-4, 0.0, 121) * (c.upper2 - c.lower2) / 1.4, (121, 1))
    there = (q[1] - c.lower2) / (c.upper2 - c.lower2) * 120
    falling -= np.interp(there, np.arange(121), falling[0])
    state = *to_link_angles(c, q), *to_link_angles(c, w)
    assert fold_loss(packed(c), flight, *state) == 0
    assert fold_loss(packed(c._replace(room=falling)), flight, *state) > 0.3
    ends = {name: 10 * getattr(c, name) for name in ("thigh_x", "thigh_z", "shank_x", "shank_z")}
    for room, of in ((falling, c), (10 * falling, c._replace(**ends))):
        free = [way_is_free(packed(of._replace(room=room)), *q, q[0], q[1] - far, 0.0) for far in (0.25, 0.31)]
        assert free == [True, False]


def test_a_motion_of_the_stance_leaps_through_nothing(tmp_path: Path) -> None:
    """Both ends are free by coal, and half the way is not."""
    design, far = barred(tmp_path, 0.052, -0.718), load("paper")
    solids, out = distances_of(design), workspace()
    poses = np.random.default_rng(1).uniform([-0.5, -1.5], [1.2, -0.4], (4000, 2))
    middle = min(poses, key=lambda q: float(solids.all(q[None]).min()))
    ends = middle + np.array([[0.0, -0.13], [0.0, 0.13]])
    assert solids.all(ends).min() > 0.005
    assert solids.all(middle[None]).min() < -0.01
    for of, kept in ((far, True), (design, False)):
        c = stance_constants(of)
        before, after = to_link_angles(c, ends)
        state_margins(packed(c), *before, 0.0, 0.0, out["here"])
        assert keeps_limits(packed(c), out, *before, *after, 0.0, 0.0) == kept
