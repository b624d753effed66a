"""The leg in CasADi against Pinocchio's C++, for legs and states chosen at random, and its kinematics."""

from typing import Any

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drawn_legs import evaluate, legs, legs_in_motion, mass_matrix, quick, symbols
from hopopt.design import Leg, physical_parameters
from hopopt.leg.dynamics import LegDynamics
from hopopt.leg.kinematics import TwoJoints, foot_offset, joint_positions, start_angles, within_limits
from hopopt.leg.robot import BASE, Robot, build_robot
from hopopt.problem.load import load

EXACT = 1e-10  # relative to the largest term that enters


def size_of_forces(robot: Robot, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> float:
    """The largest term of M a + h [N, N m], what a rounding error is relative to."""
    bias = pin.nonLinearEffects(robot.model, robot.model.createData(), q, v)
    return float((np.abs(mass_matrix(robot, q)) @ np.abs(a) + np.abs(bias)).max())


def foot_motion(robot: Robot, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> tuple[np.ndarray, ...]:
    """Pinocchio's place, velocity, acceleration (x, z) of the foot and its Jacobian (2, 2 + n)."""
    model, data, foot = robot.model, robot.model.createData(), robot.model.getFrameId("point_foot")
    world = pin.LOCAL_WORLD_ALIGNED
    pin.forwardKinematics(model, data, q, v, a)
    pin.updateFramePlacements(model, data)
    velocity = pin.getFrameVelocity(model, data, foot, world).linear
    acceleration = pin.getFrameClassicalAcceleration(model, data, foot, world).linear
    jacobian = pin.computeFrameJacobian(model, data, q, foot, world)
    return data.oMf[foot].translation[[0, 2]], velocity[[0, 2]], acceleration[[0, 2]], jacobian[[0, 2]]


# ---- inverse dynamics -------------------------------------------------------------------------------------


@quick
@given(legs_in_motion())
def test_inverse_dynamics_is_pinocchios(case: tuple[Leg, np.ndarray, np.ndarray, np.ndarray]) -> None:
    """Forces by rnea; mass matrix (its Jacobian in a) by crba; bias (a = 0) by nle; parameters also as symbols."""
    leg, *state = case
    robot = build_robot(leg)
    model, data, (q, v, a) = robot.model, robot.model.createData(), symbols(robot.model.nv)
    names = list(robot.parameters)
    p = ca.SX.sym("p", len(names))
    forces = LegDynamics(robot, robot.parameters).inverse_dynamics(q, v, a)
    with_symbols = LegDynamics(robot, {name: p[k] for k, name in enumerate(names)}).inverse_dynamics(q, v, a)
    bias = ca.substitute(forces, a, ca.SX.zeros(a.numel()))
    values = [*state, list(robot.parameters.values())]
    tau, tau_p, M, h = evaluate([forces, with_symbols, ca.jacobian(forces, a), bias], [q, v, a, p], values)
    allowed = EXACT * size_of_forces(robot, *state)
    np.testing.assert_allclose(tau, pin.rnea(model, data, *state), rtol=0, atol=allowed)
    np.testing.assert_allclose(tau_p, tau, rtol=0, atol=allowed)
    np.testing.assert_allclose(h, pin.nonLinearEffects(model, data, *state[:2]), rtol=0, atol=allowed)
    expected = mass_matrix(robot, state[0])
    np.testing.assert_allclose(M, expected, rtol=0, atol=EXACT * np.abs(expected).max())
    np.testing.assert_allclose(M, M.T, rtol=0, atol=EXACT * np.abs(expected).max())
    least, size = np.linalg.eigvalsh(M).min(), np.abs(expected).max()
    assert least >= -EXACT * size
    if model.armature[BASE:].min() > EXACT * size:  # without a rotor a thin rod may turn about itself
        assert least > 0


@quick
@given(legs_in_motion())
def test_rotors_add_their_reflected_inertia_and_nothing_else(case: tuple[Leg, np.ndarray, np.ndarray, Any]) -> None:
    """R^2 J on the diagonal of the joints, by the joint's own gear and rotor where it has them."""
    leg, at, speed, _ = case
    robot = build_robot(leg)
    q, v, a = symbols(robot.model.nv)
    still = {name: 0.0 if name.endswith("rotor_inertia") else x for name, x in robot.parameters.items()}
    both = [LegDynamics(robot, p).inverse_dynamics(q, v, a) for p in (robot.parameters, still)]
    with_rotors, without = evaluate([ca.jacobian(f, a) for f in both], [q, v, a], [at, speed, 0])
    reflected = np.zeros(robot.model.nv)
    for k, name in enumerate(leg.joints):
        own: Any = leg.joint[name]
        ratio = own.gear.ratio if own.gear.ratio is not None else leg.gear.ratio
        rotor = own.motor.rotor_inertia if own.motor.rotor_inertia is not None else leg.motor.rotor_inertia
        reflected[BASE + k] = ratio**2 * rotor
    scale = max(1e-3, np.abs(with_rotors).max())
    np.testing.assert_allclose(with_rotors - without, np.diag(reflected), rtol=0, atol=EXACT * scale)
    np.testing.assert_allclose(robot.model.armature, reflected, rtol=1e-14)


# ---- places -----------------------------------------------------------------------------------------------


@quick
@given(legs_in_motion())
def test_points_and_centre_of_mass_are_pinocchios(case: tuple[Leg, np.ndarray, np.ndarray, np.ndarray]) -> None:
    leg, at, *_ = case
    robot = build_robot(leg)
    q = ca.SX.sym("q", robot.model.nv)
    points = LegDynamics(robot, robot.parameters).points(q)
    values = dict(zip(points, evaluate(points.values(), [q], [at]), strict=True))
    model, data = robot.model, robot.model.createData()
    pin.framesForwardKinematics(model, data, at)
    assert set(points) == {*leg.joints, "foot", "com"}
    for name in (*leg.joints, "foot"):
        place = data.oMf[model.getFrameId(f"point_{name}")].translation
        np.testing.assert_allclose(values[name], place[[0, 2]], atol=1e-12)
        own = joint_positions(leg, at[BASE:])[[*leg.joints, "foot"].index(name)]
        np.testing.assert_allclose(own + np.array([at[0], 0.0, at[1]]), place, atol=1e-12)
    np.testing.assert_allclose(values["com"], pin.centerOfMass(model, data, at)[[0, 2]], atol=1e-12)
    np.testing.assert_allclose(at[:BASE] + foot_offset(leg, at[BASE:]), values["foot"], atol=1e-12)


def test_positive_angles_swing_the_leg_forward_from_straight_down() -> None:
    leg = load("paper").leg
    np.testing.assert_allclose(foot_offset(leg, [0.0, 0.0]), [0.0, -0.741], atol=1e-15)
    np.testing.assert_allclose(foot_offset(leg, [np.pi / 2, 0.0]), [0.741, 0.0], atol=1e-15)
    np.testing.assert_allclose(foot_offset(leg, [np.pi / 2, -np.pi / 2]), [0.38, -0.361], atol=1e-15)


# ---- stance and flight ------------------------------------------------------------------------------------


@quick
@given(legs_in_motion(plane=True))
def test_stance_keeps_the_foot_in_place_and_its_forces_balance(
    case: tuple[Leg, np.ndarray, np.ndarray, np.ndarray],
) -> None:
    """Foot at the origin, without velocity and acceleration; M a + h = S' tau + J' f."""
    leg, *state = case
    robot, n = build_robot(leg), len(leg.joints)
    inputs, joints = symbols(n), [x[BASE:] for x in state]
    dynamics = LegDynamics(robot, robot.parameters)
    m, (*_, jacobian) = dynamics.stance(*inputs), dynamics.stance_pose(*inputs[:2])
    q, v, a, tau, f, J = evaluate([m.q, m.v, m.a, m.tau, m.f, jacobian], inputs, joints)
    for own, given_ in zip((q, v, a), joints, strict=True):
        np.testing.assert_array_equal(own[BASE:], given_)
    place, velocity, acceleration, foot_jacobian = foot_motion(robot, q, v, a)
    reach = sum(link.length for link in leg.link.values())
    fastest = np.abs(joints[1]).sum()
    np.testing.assert_allclose(place, 0, atol=1e-12 * max(1.0, reach))
    np.testing.assert_allclose(velocity, 0, atol=EXACT * (1 + reach * fastest))
    np.testing.assert_allclose(acceleration, 0, atol=EXACT * (1 + reach * (np.abs(joints[2]).sum() + fastest**2)))
    np.testing.assert_allclose(J.reshape(BASE, n), foot_jacobian[:, BASE:], atol=1e-12 * max(1.0, reach))
    needed = pin.rnea(robot.model, robot.model.createData(), q, v, a)
    applied = np.concatenate([np.zeros(BASE), tau]) + foot_jacobian.T @ f
    np.testing.assert_allclose(applied, needed, rtol=0, atol=EXACT * size_of_forces(robot, q, v, a) * max(1.0, reach))


@quick
@given(legs_in_motion())
def test_flight_falls_freely_and_the_guides_carry_nothing(case: tuple[Leg, np.ndarray, np.ndarray, np.ndarray]) -> None:
    leg, *state = case
    robot, n = build_robot(leg), len(leg.joints)
    com, com_v = ca.SX.sym("com", BASE), ca.SX.sym("com_v", BASE)
    inputs, joints = symbols(n), [x[BASE:] for x in state]
    m = LegDynamics(robot, robot.parameters).flight(com, com_v, *inputs)
    place, speed = state[0][:BASE], state[1][:BASE]
    values = evaluate([m.q, m.v, m.a, m.tau, m.f], [com, com_v, *inputs], [place, speed, *joints])
    q, v, a, tau, f = values
    model, data = robot.model, robot.model.createData()
    pin.centerOfMass(model, data, q, v, a)
    reach = sum(link.length for link in leg.link.values())
    size = 1 + reach * (np.abs(joints[2]).sum() + np.abs(joints[1]).sum() ** 2)
    np.testing.assert_allclose(data.com[0][[0, 2]], place, atol=1e-12 * size)
    np.testing.assert_allclose(data.vcom[0][[0, 2]], speed, atol=1e-12 * size)
    np.testing.assert_allclose(data.acom[0][[0, 2]], [0, -9.81], atol=EXACT * size)
    needed, allowed = pin.rnea(model, data, q, v, a), EXACT * size_of_forces(robot, q, v, a)
    np.testing.assert_allclose(needed[:BASE], 0, atol=allowed)
    np.testing.assert_allclose(needed[BASE:], tau, rtol=0, atol=allowed)
    np.testing.assert_array_equal(f, 0)


# ---- inverse kinematics -----------------------------------------------------------------------------------


@quick
@given(legs(joints=st.just(2), plane=True), st.floats(-3, 3), st.floats(0.1, 3.0), st.sampled_from((-1, 1)))
def test_two_joint_angles_invert_foot_offset(leg: Leg, hip: float, knee: float, side: int) -> None:
    """Both solutions reach the foot, their knees bend opposite ways, and one is the pose it came from."""
    geometry = TwoJoints.of(leg)
    pose = np.array([hip, geometry.signs[1] * (side * knee - geometry.bend_at_zero)])
    foot = foot_offset(leg, pose)
    solutions = geometry.angles(foot)
    assert geometry.bend(pose[1]) == pytest.approx(side * knee)
    assert len(solutions) == 2
    for q in solutions:
        np.testing.assert_allclose(foot_offset(leg, q), foot, atol=1e-9)
    assert [np.sign(geometry.bend(q[1])) for q in solutions] == [-1, 1]
    gaps = [np.abs((q - pose + np.pi) % (2 * np.pi) - np.pi).max() for q in solutions]
    assert min(gaps) < 1e-6


@quick
@given(legs(joints=st.just(2), plane=True), st.floats(-np.pi, np.pi), st.floats(1e-6, 3.0))
def test_a_foot_out_of_reach_has_no_angles(leg: Leg, direction: float, beyond: float) -> None:
    l1, l2 = (link.length for link in leg.link.values())
    toward = np.array([np.sin(direction), -np.cos(direction)])
    assert TwoJoints.of(leg).angles((l1 + l2) * (1 + beyond) * toward) == []
    if abs(l1 - l2) > 1e-3:
        assert TwoJoints.of(leg).angles(abs(l1 - l2) * toward / (1 + beyond)) == []


@pytest.mark.parametrize(("height", "foot_x"), [(0.28, 0.0), (0.4, 0.1), (0.6, -0.05)])
def test_start_pose_is_where_the_file_puts_it(height: float, foot_x: float) -> None:
    design = load("paper", {"start.hip_height": height, "start.foot_x": foot_x})
    q = start_angles(design)
    robot = build_robot(design.leg)
    place, *_ = foot_motion(robot, np.concatenate([[-foot_x, height], q]), np.zeros(4), np.zeros(4))
    np.testing.assert_allclose(place, 0, atol=1e-12)
    assert within_limits(design.leg, q)


def test_parameters_of_the_leg_are_what_the_file_gives() -> None:
    leg = load("paper", ["leg.knee.gear.ratio=80"]).leg
    p = physical_parameters(leg)
    assert p["leg.gear.ratio"] == 100
    assert p["leg.knee.gear.ratio"] == 80
    assert p["leg.thigh.length"] == 0.38
    assert "leg.thigh.com" not in p
    assert build_robot(leg, {"leg.body.mass": 9.0}).model.inertias[2].mass == 9.0
