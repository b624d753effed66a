"""How joints turn drives: laws against closed forms, rotors against bodies of their own, and what the paper's leg makes of it."""

from typing import Any

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest
from scipy.interpolate import CubicHermiteSpline, PchipInterpolator
from tests.once import solved_once

from hopopt.compiled.kernel import packed
from hopopt.control.closed_loop import make_plant
from hopopt.control.setting import Setting
from hopopt.design import Leg, physical_parameters
from hopopt.drivetrain.gear import gears_of, joint_torque
from hopopt.drivetrain.kernels import own_ratio
from hopopt.drivetrain.transmission import drive_angle, drive_angles, numbers, ratios, spline_slopes
from hopopt.errors import ProblemFileError
from hopopt.export.plan import columns, samples_at_control_rate
from hopopt.leg.dynamics import LegDynamics
from hopopt.leg.files.export import to_mjcf
from hopopt.leg.robot import BASE, Robot, build_robot
from hopopt.leg.scales import stall_torques
from hopopt.planner.reserve import TrackedPlan
from hopopt.problem.load import load
from hopopt.sim import mujoco
from hopopt.sim.ground.rough_ground import RoughGround
from hopopt.sim.machine import Machine
from hopopt.sim.plant import Plant
from hopopt.sim.state import State

KNEE = "leg.knee.transmission"
FOUR_BAR = {"ground": 0.3, "crank": 0.06, "rod": 0.31, "arm": 0.05, "stretched": -2.9}
FALLING = {f"{KNEE}.linear": {"slope": -0.2, "at": -1.3}}
BELTS = {f"{KNEE}.coupling": {"hip": {"ratio": 0.7}}, "leg.hip.transmission.coupling": {"knee": {"ratio": -0.2}}}
MIXED = FALLING | BELTS


def leg_with(**law: Any) -> Leg:
    return load("paper", {f"{KNEE}.{name}": entries for name, entries in law.items()}).leg


def angle(leg: Leg, q: float) -> float:
    x = ca.SX.sym("q")
    return float(ca.Function("angle", [x], [drive_angle(leg, "knee", physical_parameters(leg), x)])(q))


@pytest.mark.parametrize("q", [-2.2, -1.4, -0.5])
def test_a_four_bar_closes_and_its_ratio_is_that_of_its_velocities(q: float) -> None:
    leg, b = leg_with(four_bar=FOUR_BAR), FOUR_BAR
    theta, phi = angle(leg, q), q - b["stretched"]
    end = np.array([b["ground"] + b["arm"] * np.cos(phi), b["arm"] * np.sin(phi)])
    apart = end - b["crank"] * np.array([np.cos(theta), np.sin(theta)])
    assert np.hypot(*apart) == pytest.approx(b["rod"], rel=1e-12)
    # the rod keeps its length: apart . (end' - crank') = 0
    turned = b["crank"] * np.array([-np.sin(theta), np.cos(theta)])
    moved = b["arm"] * np.array([-np.sin(phi), np.cos(phi)])
    found = ratios(leg, "knee", physical_parameters(leg), np.array([q]))[0]
    assert found == pytest.approx((apart @ moved) / (apart @ turned), rel=1e-9)


def test_a_parallelogram_turns_as_its_joint_does() -> None:
    leg = leg_with(four_bar={"ground": 0.38, "crank": 0.05, "rod": 0.38, "arm": 0.05, "stretched": -2.8})
    assert ratios(leg, "knee", physical_parameters(leg), np.linspace(-2.4, -0.15, 7)) == pytest.approx(np.ones(7))


def test_a_rod_between_two_pivots_has_the_lever_of_its_triangle() -> None:
    base, arm, folded, travel = 0.2, 0.05, -3.0, 1e-3
    leg = leg_with(rod={"base": base, "arm": arm, "folded": folded, "travel": travel})
    q = np.linspace(-2.4, -0.15, 5)
    length = np.sqrt(base**2 + arm**2 - 2 * base * arm * np.cos(q - folded))
    lever = base * arm * np.sin(q - folded) / length
    assert ratios(leg, "knee", physical_parameters(leg), q) == pytest.approx(lever / travel, rel=1e-9)


def test_a_table_of_ratios_is_followed_by_a_monotone_spline_level_outside() -> None:
    points, values = (-2.0, -1.4, -0.6), (1.4, 1.1, 0.7)
    leg = leg_with(table={"angle": list(points), "ratio": list(values)})
    q = np.linspace(-2.4, -0.15, 60)
    found = ratios(leg, "knee", physical_parameters(leg), q)
    assert ratios(leg, "knee", physical_parameters(leg), np.array(points)) == pytest.approx(values, rel=1e-12)
    assert (np.diff(found) <= 1e-12).all()  # as its points do
    middle = PchipInterpolator(points, values).derivative()(points[1])  # Fritsch and Carlson's slope there
    expected = CubicHermiteSpline(points, values, [0.0, middle, 0.0])(np.clip(q, points[0], points[-1]))
    assert found == pytest.approx(expected, rel=1e-9)


def test_the_slopes_of_a_level_table_have_the_derivatives_of_straight_ones() -> None:
    """By differences; where one rise alone is zero the slope stays Pchip's, and all second derivatives are numbers."""
    knots, x = [-2.4, -1.3, -0.15], ca.SX.sym("x", 3)
    slope = ca.vertcat(*spline_slopes(knots, ca.vertsplit(x)))[1]
    middle = ca.Function("middle", [x], [slope])
    hessian, gradient = ca.hessian(slope, x)
    derivatives = ca.Function("derivatives", [x], [ca.densify(gradient), ca.densify(hessian)])
    level, h = np.full(3, 0.4), 1e-6
    found, bend = (each.full() for each in derivatives(level))
    for way in (np.array(knots), np.ones(3)):
        difference = float(middle(level + h * way) - middle(level - h * way)) / (2 * h)
        assert found[:, 0] @ way == pytest.approx(difference, abs=1e-8)
    nearly = derivatives(level + h * np.array(knots))[0].full()
    assert found == pytest.approx(nearly, rel=1e-6)
    assert np.isfinite(bend).all()
    for values in ([0.4, 0.4, 0.3], [0.4, 0.3, 0.3], [0.4, 0.4, 0.4], [0.4, 0.39, 0.1], [0.4, 0.5, 0.3]):
        assert float(middle(values)) == pytest.approx(
            PchipInterpolator(knots, values).derivative()(knots[1]), abs=1e-14
        )


def test_a_differential_shares_torques_between_its_motors() -> None:
    """Two motors that turn by the sum and the difference of two angles: each gives half the sum, half the difference."""
    turned = {"leg.hip.transmission.coupling": {"knee": {"ratio": 1.0}}, f"{KNEE}.coupling": {"hip": {"ratio": -1.0}}}
    robot = build_robot(load("paper", turned).leg)
    q, tau = np.array([0.0, 0.0, 0.4, -1.2]), np.array([30.0, 8.0])
    assert robot.drive_torques(q, tau) == pytest.approx([(30 + 8) / 2, (8 - 30) / 2], rel=1e-12)
    assert robot.drive_speeds(q, np.array([0.0, 0.0, 3.0, 2.0])) == pytest.approx([5.0, -1.0], rel=1e-12)


def with_rotor_bodies(robot: Robot) -> pin.Model:
    """The leg's links and guides alone, and on the body a rotor for each motor that turns with the drive behind its gear."""
    model = robot.model.copy()
    model.armature = np.zeros(model.nv)
    body = model.getJointId("z")
    for joint, inertia in zip(robot.joints, robot.rotors, strict=True):
        index = model.addJoint(body, pin.JointModelRY(), pin.SE3.Identity(), f"{joint} rotor")
        model.appendBodyToJoint(index, pin.Inertia(0.0, np.zeros(3), np.diag([0.0, inertia, 0.0])), pin.SE3.Identity())
    return model


@pytest.mark.parametrize("overrides", [FALLING, MIXED, {f"{KNEE}.four_bar": FOUR_BAR}])
def test_rotors_weigh_on_the_joints_as_bodies_that_turn_with_the_drives(overrides: dict[str, Any]) -> None:
    """Pinocchio with the rotors as bodies, their motion the drives': by virtual work S' (M S a + M S' v + h)."""
    robot = build_robot(load("paper", overrides).leg)
    machine, model, turning = Machine(robot), with_rotor_bodies(robot), robot.turning
    assert turning is not None
    data, n, draw = model.createData(), len(robot.joints), np.random.default_rng(3)
    for _ in range(4):
        q = np.r_[draw.normal(size=2), draw.uniform(-0.5, 0.5), draw.uniform(-2.2, -0.4)]
        v, a = draw.normal(size=(2, BASE + n)) * 3
        step = 1e-6  # (dJ/dt) v by a difference of the laws' ratios, which the tests above check
        change = (turning.jacobian(q[BASE:] + step * v[BASE:]) - turning.jacobian(q[BASE:] - step * v[BASE:])) / (
            2 * step
        )
        S = np.vstack([np.eye(BASE + n), np.hstack([np.zeros((n, BASE)), turning.jacobian(q[BASE:])])])
        late = np.r_[np.zeros(BASE + n), change @ v[BASE:]]
        whole_q, whole_v = np.r_[q, np.zeros(n)], S @ v
        expected = S.T @ pin.rnea(model, data, whole_q, whole_v, S @ a + late)
        assert machine.inverse_dynamics(q, v, a) == pytest.approx(expected, rel=1e-7, abs=1e-6)
        M = pin.crba(model, data, whole_q)
        M[np.tril_indices(len(M), -1)] = M.T[np.tril_indices(len(M), -1)]
        assert machine.mass_matrix(q) == pytest.approx(S.T @ M @ S, rel=1e-12, abs=1e-12)
        assert 2 * machine.energy(q, v) == pytest.approx(
            v @ S.T @ M @ S @ v + 2 * pin.computePotentialEnergy(robot.model, robot.model.createData(), q), rel=1e-12
        )


RIDING = {
    "leg.hip.axis": [0, 1, 0],
    "leg.hip.lower": -1.3,
    "leg.hip.upper": 0.6,
    f"{KNEE}.motor_on": "thigh",
    f"{KNEE}.reversed": True,
}
ON_THIGH = {f"{KNEE}.motor_on": "thigh"}
ON_BOTH = MIXED | {f"{KNEE}.motor_on": "thigh", "leg.hip.transmission.motor_on": "shank"}


def geared(robot: Robot, q: ca.SX) -> ca.SX:
    """How far motors turn against their housings (n) [rad]."""
    between = [robot.leg.joint[joint].transmission for joint in robot.joints]
    ratios = [robot.parameters[robot.leg.drive(joint, "gear", "ratio")[0]] for joint in robot.joints]
    senses = [-1.0 if each and each.reversed else 1.0 for each in between]
    return ca.DM(senses) * ca.DM(ratios) * drive_angles(robot.leg, robot.parameters, q)


def with_riding_rotors(robot: Robot) -> pin.Model:
    """The leg's links and guides alone, and on its link, anywhere, a rotor for each motor, about the axis of the joint that it moves."""
    model = robot.model.copy()
    model.armature = np.zeros(model.nv)
    for joint, inertia in zip(robot.joints, robot.rotors, strict=True):
        between, ratio = (
            robot.leg.joint[joint].transmission,
            robot.parameters[robot.leg.drive(joint, "gear", "ratio")[0]],
        )
        on, axis = (between and between.motor_on) or "body", np.array(robot.leg.joint[joint].axis)
        carrier = model.getJointId("z" if on == "body" else robot.joints[robot.leg.links.index(on)])
        place = pin.SE3(np.eye(3), np.array([0.03, 0.01, -0.05]))
        index = model.addJoint(carrier, pin.JointModelRevoluteUnaligned(axis), place, f"{joint} rotor")
        own = pin.Inertia(0.0, np.zeros(3), np.outer(axis, axis) * inertia / ratio**2)
        model.appendBodyToJoint(index, own, pin.SE3.Identity())
    return model


@pytest.mark.parametrize("overrides", [ON_THIGH, RIDING, ON_BOTH, {f"{KNEE}.four_bar": FOUR_BAR} | ON_THIGH])
def test_rotors_on_links_weigh_as_bodies_that_spin_there(overrides: dict[str, Any]) -> None:
    """Pinocchio with the rotors as bodies of the links, in their own inertia and speed; by virtual work S' (M S a + M S' v + h)."""
    robot = build_robot(load("paper", overrides).leg)
    machine, model = Machine(robot), with_riding_rotors(robot)
    data, n, draw = model.createData(), len(robot.joints), np.random.default_rng(3)
    symbols = [ca.SX.sym(name, BASE + n) for name in "qva"]
    planner = ca.Function("planner", symbols, [LegDynamics(robot, robot.parameters).inverse_dynamics(*symbols)])
    spins, changes = turned_motors(robot)
    for _ in range(4):
        q = np.r_[draw.normal(size=2), draw.uniform(-0.5, 0.5), draw.uniform(-2.2, -0.4)]
        v, a = draw.normal(size=(2, BASE + n)) * 3
        S = np.vstack([np.eye(BASE + n), np.hstack([np.zeros((n, BASE)), spins(q[BASE:]).full()])])
        late = np.r_[np.zeros(BASE + n), changes(q[BASE:], v[BASE:]).full()[:, 0]]
        whole_q, whole_v = np.r_[q, np.zeros(n)], S @ v
        expected = S.T @ pin.rnea(model, data, whole_q, whole_v, S @ a + late)
        assert machine.inverse_dynamics(q, v, a) == pytest.approx(expected, rel=1e-9, abs=1e-9)
        assert planner(q, v, a).full()[:, 0] == pytest.approx(expected, rel=1e-9, abs=1e-9)
        still = np.zeros(model.nv)  # Pinocchio's crba wants bodies in the order of the tree
        columns = [pin.rnea(model, data, whole_q, still, row).copy() for row in np.eye(model.nv)]
        M = np.array(columns).T - pin.rnea(model, data, whole_q, still, still)[:, None]
        for mine in (machine.mass_matrix(q), robot.mass_matrix(q)):
            assert mine == pytest.approx(S.T @ M @ S, rel=1e-9, abs=1e-9)
        fall = 2 * pin.computePotentialEnergy(robot.model, robot.model.createData(), q)
        assert 2 * machine.energy(q, v) == pytest.approx(v @ S.T @ M @ S @ v + fall, rel=1e-9)


def turned_motors(robot: Robot) -> tuple[ca.Function, ca.Function]:
    """How fast motors turn against their housings by the joints' speeds (n, n), and what that rate is where no joint speeds up (n)."""
    q, v = ca.SX.sym("q", len(robot.joints)), ca.SX.sym("v", len(robot.joints))
    J = ca.jacobian(geared(robot, q), q)
    return ca.Function("J", [q], [ca.densify(J)]), ca.Function("late", [q, v], [ca.densify(ca.jtimes(J @ v, q, v))])


@pytest.mark.parametrize("sense", [1, -1])
def test_a_rotor_on_the_thigh_has_the_energy_of_its_own_speed(sense: int) -> None:
    """By Lagrange's equations, made here of the energies of two thin rods, a mass that moves freely and a rotor that turns with the thigh
    and by its gear besides."""
    design = load("paper", ON_THIGH | {f"{KNEE}.reversed": sense < 0})
    robot, p = build_robot(design.leg), build_robot(design.leg).parameters
    q, v, a = (ca.SX.sym(name, BASE + 2) for name in "qva")
    thigh, shank, body = (p[f"leg.{name}.mass"] for name in ("thigh", "shank", "body"))
    (l1, l2), way = (
        (p["leg.thigh.length"], p["leg.shank.length"]),
        lambda angle: ca.vertcat(ca.sin(angle), -ca.cos(angle)),
    )
    one, two = q[2], q[2] + q[3]
    turns = v[2], v[2] + v[3]
    centres = [
        q[:2],
        q[:2] + p.get("leg.thigh.com", l1 / 2) * way(one),
        q[:2] + l1 * way(one) + p.get("leg.shank.com", l2 / 2) * way(two),
    ]
    inertias = [
        p.get(f"leg.{name}.inertia", m * length**2 / 12)
        for name, m, length in (("thigh", thigh, l1), ("shank", shank, l2))
    ]
    speeds = [ca.jtimes(c, q, v) for c in centres]
    moving = sum(m * ca.sumsqr(s) for m, s in zip((body, thigh, shank), speeds, strict=True))
    turning = sum(i * w**2 for i, w in zip(inertias, turns, strict=True))
    ratios = [p[robot.leg.drive(joint, "gear", "ratio")[0]] for joint in robot.joints]
    rotors = [p[robot.leg.drive(joint, "motor", "rotor_inertia")[0]] for joint in robot.joints]
    rotors = [r + p.get("leg.gear.inertia", 0.0) for r in rotors]
    spun = rotors[0] * (ratios[0] * v[2]) ** 2 + rotors[1] * (v[2] + sense * ratios[1] * v[3]) ** 2
    kinetic = (moving + turning + spun) / 2
    potential = -robot.model.gravity.linear[2] * sum(
        m * c[1] for m, c in zip((body, thigh, shank), centres, strict=True)
    )
    momentum = ca.gradient(kinetic, v)
    forces = ca.jtimes(momentum, v, a) + ca.jtimes(momentum, q, v) - ca.gradient(kinetic - potential, q)
    lagrange = ca.Function("lagrange", [q, v, a], [forces])
    draw = np.random.default_rng(1)
    for _ in range(3):
        at = draw.normal(size=(3, BASE + 2))
        assert Machine(robot).inverse_dynamics(*at) == pytest.approx(lagrange(*at).full()[:, 0], rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("overrides", [MIXED, ON_BOTH])
@pytest.mark.parametrize("contact", [True, False])
def test_forward_dynamics_inverts_inverse_dynamics_and_the_planner_agrees(
    contact: bool, overrides: dict[str, Any]
) -> None:
    robot = build_robot(load("paper", overrides).leg)
    machine, n = Machine(robot), 2
    q_j, v_j, tau = np.array([0.3, -1.1]), np.array([-2.0, 4.0]), np.array([25.0, -60.0])
    symbols = [ca.SX.sym(name, n) for name in "qva"]
    dynamics = LegDynamics(robot, robot.parameters)
    still = ca.SX.zeros(BASE)
    m = dynamics.stance(*symbols) if contact else dynamics.flight(still, still, *symbols)
    planner = ca.Function("planner", symbols, [m.q, m.v, m.tau, m.drives.tau, m.drives.w, m.drives.rate])
    q, v = (x.full()[:, 0] for x in planner(q_j, v_j, np.zeros(n))[:2])
    a = machine.acceleration(q, v, tau, contact)
    *_, again, of_drives, w, rate = (x.full()[:, 0] for x in planner(q_j, v_j, a[BASE:]))
    assert again == pytest.approx(tau, rel=1e-9)
    assert of_drives == pytest.approx(robot.drive_torques(q, tau), rel=1e-9)
    assert w == pytest.approx(robot.drive_speeds(q, v), rel=1e-12)
    assert tau @ v[BASE:] == pytest.approx(of_drives @ w, rel=1e-9)  # no power is lost between joints and drives
    assert robot.turning is not None
    assert rate == pytest.approx(robot.turning.spin(q_j) @ a[BASE:] + robot.turning.drift(q_j, v_j), rel=1e-9)


@pytest.mark.parametrize("contact", [True, False])
def test_the_compiled_plant_moves_a_leg_with_lossy_gears_as_pinocchio_does(contact: bool) -> None:
    design = load("paper", MIXED | {"leg.gear.efficiency": 0.8, "leg.gear.friction": 1.0})
    compiled = make_plant(design)
    assert isinstance(compiled, RoughGround)
    plant, command = Plant(compiled.robot, compiled.drive), np.array([25.0, -60.0])
    terms = plant.machine.stance_terms(np.array([0.3, -1.1]), np.array([-2.0, 4.0]))
    s = State(terms.q, terms.v, contact=contact, foot=0.0)
    for mine, expected in zip(compiled.torques(s, command), plant.torques(s, command), strict=True):
        assert mine == pytest.approx(expected, rel=1e-7, abs=1e-6)
    a, b = (p.step(s, lambda t, q, v: command, 1e-4) for p in (compiled, plant))
    assert np.r_[a.q, a.v] == pytest.approx(np.r_[b.q, b.v], rel=1e-7, abs=1e-7)
    assert a.work == pytest.approx(b.work, rel=1e-6, abs=1e-8)


@pytest.mark.parametrize("overrides", [ON_THIGH, ON_BOTH])
def test_gears_take_their_share_of_what_a_rotor_on_a_link_leaves(overrides: dict[str, Any]) -> None:
    """By d'Alembert in flight: teeth have what the motor gives less A s', and the links what the teeth give less D' A s'."""
    design = load("paper", overrides | {"leg.gear.efficiency": 0.8, "leg.gear.friction": 1.0})
    robot = build_robot(design.leg)
    gears, rotors, turning = gears_of(design.leg, robot.parameters), robot.rotors, robot.turning
    assert turning is not None
    plant = make_plant(design)
    q, v = np.array([0.0, 0.9, 0.3, -1.1]), np.array([0.2, 0.5, -2.0, 4.0])
    J, ratios = (
        turning.jacobian(q[BASE:]),
        [robot.parameters[robot.leg.drive(j, "gear", "ratio")[0]] for j in robot.joints],
    )
    motor, tau, _ = plant.torques(State(q, v, contact=False, foot=0.0), J.T @ np.array([25.0, -60.0]))
    a = Machine(robot).acceleration(q, v, tau, False)
    turns = np.tril(np.ones((2, 2)))  # of a link by the joints, both about one axis
    on = {"body": np.zeros(2), "thigh": turns[0], "shank": turns[1]}
    places = [
        (between and between.motor_on) or "body" for between in (robot.leg.joint[j].transmission for j in robot.joints)
    ]
    D = np.array([on[place] / ratio for place, ratio in zip(places, ratios, strict=True)])
    spun = rotors * ((J + D) @ a[BASE:] + turning.drift(q[BASE:], v[BASE:]))
    given = joint_torque(gears, motor - spun, J @ v[BASE:], 0.0, 0.0)
    bare = robot.model.copy()
    bare.armature = np.zeros(bare.nv)
    needed = pin.rnea(bare, bare.createData(), q, v, a)
    assert needed == pytest.approx(np.r_[0.0, 0.0, J.T @ given - D.T @ spun], rel=1e-7, abs=1e-6)


@pytest.mark.parametrize(
    ("entries", "words"),
    [
        ({"linear": {"slope": 1.0, "at": -1.3}}, "dead point near -2"),
        ({"four_bar": FOUR_BAR | {"rod": 0.2}}, "cannot close at"),
        ({"linear": {"slope": 0.1}, "rod": {"base": 0.1, "arm": 0.05, "folded": -3.0, "travel": 0.01}}, "linear and rod: one law"),
        ({"table": {"angle": [-2.0, -1.0, 0.0], "ratio": [1.0, 1.2, 1.1]}}, "not monotone in the angle"),
        ({"reversed": True}, "is of a motor on a link, and this one is on the body: leave it out"),
        ({"motor_on": "tigh"}, "is no link .did you mean thigh.*: allowed are body, thigh, shank"),
        ({"coupling": {"ankle": {"ratio": 1.0}}}, "names no other joint of the leg: allowed are hip"),
    ],
)  # fmt: skip
def test_transmissions_that_cannot_be_are_refused_in_a_sentence(entries: dict[str, Any], words: str) -> None:
    with pytest.raises(ProblemFileError, match=words):
        load("paper", {f"{KNEE}.{name}": value for name, value in entries.items()})


def test_the_slope_of_a_table_is_right_at_its_own_points_and_in_compiled_plants() -> None:
    leg = leg_with(table={"angle": [-2.4, -1.275, -0.15], "ratio": [1.5, 1.2, 0.6]})
    robot = build_robot(leg)
    assert robot.turning is not None
    for q in (-2.4, -1.275, -0.7, -0.15):
        steps = robot.turning.jacobian(np.array([0.0, q + 1e-6])) - robot.turning.jacobian(np.array([0.0, q - 1e-6]))
        late = robot.turning.drift(np.array([0.0, q]), np.array([0.0, 3.0]))
        assert late[1] == pytest.approx(9.0 * steps[1, 1] / 2e-6, abs=1e-3)
    record = packed(numbers(leg, robot.parameters))
    for q in np.linspace(-2.4, -0.15, 40):
        exact = ratios(leg, "knee", robot.parameters, np.array([q]))[0]
        assert own_ratio(record, 1, float(q))[0] == pytest.approx(exact, abs=2e-6)


def test_two_ways_to_write_one_machine_have_one_stop_and_one_speed() -> None:
    """A gear of 50, and one of 100 with a ratio of a half behind it; and drives with states of their own are refused."""
    plain = load("paper", {"leg.knee.gear.ratio": 50.0})
    table = {f"{KNEE}.table": {"angle": [-2.4, -0.15], "ratio": [0.5, 0.5]}}
    other = load("paper", table)
    assert stall_torques(other.leg) == pytest.approx(stall_torques(plain.leg), rel=1e-12)
    assert Setting(other, 1e-3).no_load_speed == pytest.approx(Setting(plain, 1e-3).no_load_speed, rel=1e-12)
    with pytest.raises(ProblemFileError, match="torque_rate = 2000 does not go with the joints' transmissions"):
        load("paper", {**table, "leg.motor.torque_rate": 2000.0})


@pytest.mark.slow
def test_exports_have_torques_of_joints() -> None:
    s = solved_once(FALLING)
    found = columns(TrackedPlan.of(s))
    at = samples_at_control_rate(s)
    assert np.array(found["tau_knee"][1]) == pytest.approx(at.tau[:, 1], abs=1e-6)
    assert np.abs(at.command[:, 1] - at.tau[:, 1]).max() > 5.0


def test_drives_that_move_joints_alike_are_refused() -> None:
    both = {f"{KNEE}.coupling": {"hip": {"ratio": 1.0}}, "leg.hip.transmission.coupling": {"knee": {"ratio": 1.0}}}
    with pytest.raises(ProblemFileError, match="do not move its joints apart"):
        load("paper", both)


@pytest.mark.slow
def test_a_ratio_that_falls_as_the_leg_stretches_lifts_the_foot_as_other_code_says() -> None:
    """Other code, stance alone: at most 0.817 m."""
    s = solved_once(FALLING)
    assert s.verified
    assert s.clearance == pytest.approx(0.817, abs=2e-3)


@pytest.mark.slow
def test_mujoco_with_drives_as_tendons_repeats_the_plan() -> None:
    pytest.importorskip("mujoco")
    s = solved_once(FALLING)
    run = mujoco.replay(s.robot, s)
    assert run.lowest[-1] == pytest.approx(s.clearance, rel=1e-3)


@pytest.mark.parametrize("overrides", [BELTS, BELTS | {f"{KNEE}.motor_on": "thigh", f"{KNEE}.reversed": True}])
def test_mujoco_has_the_mass_matrix_of_a_leg_with_belts(overrides: dict[str, Any]) -> None:
    library = pytest.importorskip("mujoco")
    robot = build_robot(load("paper", overrides).leg)
    model = library.MjModel.from_xml_string(to_mjcf(robot))
    data, M, q = library.MjData(model), np.zeros((4, 4)), np.array([0.1, 0.6, 0.4, -1.2])
    data.qpos[:] = q
    library.mj_forward(model, data)
    library.mj_fullM(model, data, M)
    assert pytest.approx(M, rel=1e-9, abs=1e-9) == Machine(robot).mass_matrix(q)


@pytest.mark.slow
def test_a_transmission_that_changes_nothing_changes_no_answer() -> None:
    same = solved_once({f"{KNEE}.linear": {"slope": 0.0}})
    assert same.verified
    assert same.clearance == pytest.approx(solved_once().clearance, abs=1e-8)
