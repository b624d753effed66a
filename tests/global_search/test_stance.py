"""The stance in closed form against Pinocchio, on random legs and states."""

import numpy as np
import pinocchio as pin
import pytest

from hopopt import load
from hopopt.compiled.kernel import packed
from hopopt.design import Design
from hopopt.drivetrain.operating_region.region import operating_region
from hopopt.global_search.constants import stance_constants, to_joint_angles, to_link_angles
from hopopt.global_search.equations.accelerations import VERTICES, polygon
from hopopt.global_search.equations.dynamics import apex_height, stance_terms
from hopopt.global_search.equations.flight import _accelerations, flight_of, fold_loss
from hopopt.global_search.posture import tuck_height
from hopopt.leg.kinematics import joint_positions, start_angles
from hopopt.leg.robot import BASE, build_robot
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
