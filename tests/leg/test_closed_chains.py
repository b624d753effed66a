"""Five-bars whose crank and rod weigh: against belts and four-bars, Pinocchio's closing constraint, and plain geometry."""

from typing import Any

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest
from tests.once import solved_once

from hopopt.control.closed_loop import make_plant
from hopopt.drivetrain.linkages.five_bar import side_links
from hopopt.errors import ProblemFileError, UsageError
from hopopt.leg.dynamics import LegDynamics
from hopopt.leg.files.export import to_mjcf
from hopopt.leg.robot import BASE, Robot, build_robot
from hopopt.ocp.transitions import impact
from hopopt.problem.load import load
from hopopt.sim.machine import Machine
from hopopt.sim.plant import Plant

FIVE_BAR, FOUR_BAR = "leg.knee.transmission.five_bar", "leg.knee.transmission.four_bar"
THIGH = 0.38  # m
PARALLEL = {"crank": 0.06, "rod": THIGH, "arm": 0.06, "ahead": False}
BEHIND = {"crank": 0.08, "rod": 0.38, "arm": 0.06, "turned": -0.4, "pivot_x": -0.03, "pivot_z": -0.02, "ahead": False}
ACROSS = {"crank": 0.08, "rod": 0.38, "arm": 0.06, "turned": 2.7, "pivot_x": 0.03, "pivot_z": -0.02, "ahead": True}
HEAVY = {"crank_mass": 0.3, "rod_mass": 0.5, "rod_com": 0.1, "crank_inertia": 2e-3}
MASSES = {"crank_mass": 0.1, "rod_mass": 0.2}
KNEE = {"crank": 0.05, "rod": 0.3, "arm": 0.05, "turned": -0.3, "ahead": False} | MASSES
ANKLE = {"crank": 0.05, "rod": 0.28, "arm": 0.05, "turned": 0.6, "pivot_x": 0.002, "pivot_z": 0.001} | MASSES
ROOM = {
    "leg.knee.lower": -2.0, "leg.knee.upper": -0.6, "leg.hip.lower": -0.2, "leg.hip.upper": 1.1, "start.hip_height": 0.45,
}  # fmt: skip
Q, V, A = np.array([0.1, 0.6, 0.5, -1.3]), np.array([0.4, -0.7, -2.0, 4.0]), np.array([3.0, 5.0, 10.0, -30.0])


def robot_with(five_bar: dict[str, Any], **more: Any) -> Robot:
    return build_robot(load("paper", {FIVE_BAR: five_bar, **ROOM, **more}).leg)


def planned(robot: Robot, contact: bool, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> list[np.ndarray]:
    """q, v, a of the whole leg, joint torques, contact force, places of all points and of the centre of mass, by the planner."""
    symbols, still = [ca.SX.sym(name, len(q)) for name in "qva"], ca.SX.zeros(BASE)
    dynamics = LegDynamics(robot, robot.parameters)
    m = dynamics.stance(*symbols) if contact else dynamics.flight(still, still, *symbols)
    points = dynamics.points(m.q)
    places = ca.horzcat(*(points[name] for name in (*robot.point_names, "com")))
    function = ca.Function("planned", symbols, [m.q, m.v, m.a, m.tau, m.f, places])
    return [x.full().squeeze() for x in function(q, v, a)]


@pytest.mark.parametrize(
    ("five_bar", "other"),
    [
        (PARALLEL, {}),
        (
            {"crank": 0.08, "rod": 0.36, "arm": 0.06, "turned": -0.4, "ahead": False},
            {FOUR_BAR: {"ground": THIGH, "crank": 0.08, "rod": 0.36, "arm": 0.06, "stretched": 0.4, "ahead": False}},
        ),
    ],
)
def test_without_masses_it_is_a_belt_or_a_four_bar_whose_motor_sits_on_the_body(
    five_bar: dict[str, Any], other: dict[str, Any]
) -> None:
    robot = robot_with(five_bar)
    plain = build_robot(load("paper", {"leg.knee.transmission.coupling": {"hip": {"ratio": 1.0}}, **other, **ROOM}).leg)
    for of in (lambda r: Machine(r).inverse_dynamics(Q, V, A), lambda r: planned(r, True, Q[2:], V[2:], A[2:])[3]):
        assert of(robot) == pytest.approx(of(plain), rel=1e-8, abs=1e-8)
    assert robot.drive_speeds(Q, V) == pytest.approx(plain.drive_speeds(Q, V), rel=1e-10)


@pytest.mark.parametrize("legs", ["behind", "across", "knee and ankle"])
@pytest.mark.parametrize("contact", [True, False])
def test_planner_and_pinocchio_agree(legs: str, contact: bool) -> None:
    if legs == "knee and ankle":  # whose crank sits on the thigh
        robot = build_robot(load("three_joint", {FIVE_BAR: KNEE, "leg.ankle.transmission.five_bar": ANKLE}).leg)
        joints = np.r_[Q[2:], 0.9], np.r_[V[2:], 1.0], np.r_[A[2:], 20.0]
    else:
        robot = robot_with((BEHIND if legs == "behind" else ACROSS) | HEAVY)
        joints = Q[2:], V[2:], A[2:]
    machine = Machine(robot)
    q, v, a, tau, f, places = planned(robot, contact, *joints)
    asked = np.r_[0.0, 0.0, tau] + machine.foot_jacobian(q).T @ f
    assert machine.inverse_dynamics(q, v, a) == pytest.approx(asked, rel=1e-9, abs=1e-9)
    assert machine.acceleration(q, v, tau, contact) == pytest.approx(a, rel=1e-9, abs=1e-9)
    found = machine.points(q)
    where = np.array([found[name] for name in (*robot.point_names, "com")]).T
    assert where == pytest.approx(places, abs=1e-12)
    power = tau @ v[BASE:]  # all that the leg is given, where nothing is lost
    step = 1e-6
    late, early = (machine.energy(q + s * v + s**2 / 2 * a, v + s * a) for s in (step, -step))
    assert (late - early) / (2 * step) == pytest.approx(power, rel=1e-5)


def test_a_touchdown_leaves_the_same_speeds_by_planner_and_pinocchio() -> None:
    robot = robot_with(ACROSS | HEAVY)
    q, v = ca.SX.sym("q", 4), ca.SX.sym("v", 4)
    after = ca.Function("after", [q, v], [impact(LegDynamics(robot, robot.parameters), q, v)[0]])
    assert after(Q, V).full()[:, 0] == pytest.approx(Machine(robot).touch_down(Q, V), rel=1e-9)


def with_crank_and_rod(robot: Robot, b: dict[str, Any]) -> tuple[pin.Model, pin.RigidConstraintModel]:
    """The leg without its five-bar, a crank on the body with its drive's rotor, a rod on it; and what closes the loop."""
    model = build_robot(load("paper", ROOM).leg).model.copy()
    model.armature = np.zeros(model.nv)
    turn, body, knee = (
        pin.JointModelRevoluteUnaligned(np.array([0.0, -1.0, 0.0])),
        *(model.getJointId(j) for j in ("z", "knee")),
    )

    def spun(inertia: float) -> pin.Inertia:
        return pin.Inertia(0.0, np.zeros(3), np.diag([0.0, inertia, 0.0]))

    def link(parent: int, place: list[float], mass: float, com: float, inertia: float) -> int:
        index = model.addJoint(parent, turn, pin.SE3(np.eye(3), np.array(place)), f"side {model.njoints}")
        about = np.diag([0.0, inertia, 0.0])
        model.appendBodyToJoint(index, pin.Inertia(mass, np.array([com, 0.0, 0.0]), about), pin.SE3.Identity())
        return index

    crank = link(body, [b["pivot_x"], 0.0, b["pivot_z"]], b["crank_mass"], b["crank"] / 2, b["crank_inertia"])
    rod = link(crank, [b["crank"], 0.0, 0.0], b["rod_mass"], b["rod_com"], b["rod_mass"] * b["rod"] ** 2 / 12)
    for joint, inertia in (
        (model.getJointId("hip"), robot.rotors[0]),
        (crank, robot.rotors[1]),
    ):  # the body does not turn
        model.appendBodyToJoint(joint, spun(inertia), pin.SE3.Identity())
    arm = b["arm"] * np.array([np.sin(b["turned"]), 0.0, -np.cos(b["turned"])])
    ends = (rod, pin.SE3(np.eye(3), np.array([b["rod"], 0.0, 0.0]))), (knee, pin.SE3(np.eye(3), arm))
    return model, pin.RigidConstraintModel(
        pin.ContactType.CONTACT_3D, model, *ends[0], *ends[1], pin.ReferenceFrame.LOCAL
    )


@pytest.mark.parametrize("five_bar", [BEHIND, ACROSS])
def test_torques_of_both_motors_move_it_as_pinocchios_closed_loop(five_bar: dict[str, Any]) -> None:
    """Motors pull at hip and crank of a tree whose loop Pinocchio's constraint closes, in flight."""
    b = five_bar | HEAVY
    robot = robot_with(b)
    model, loop = with_crank_and_rod(robot, b)
    machine, links = Machine(robot), side_links(robot.leg, "knee", robot.parameters, Q[2:])
    (x0, z0), (x1, z1) = links.crank_end, links.arm_end
    crank, rod = float(links.angle), float(np.arctan2(float(z1 - z0), float(x1 - x0)))
    q, data = np.r_[Q, crank, rod - crank], model.createData()
    pin.computeJointJacobians(model, data, q)
    pin.framesForwardKinematics(model, data, q)
    ends = [
        data.oMi[i] * place
        for i, place in ((loop.joint1_id, loop.joint1_placement), (loop.joint2_id, loop.joint2_placement))
    ]
    assert ends[0].translation == pytest.approx(ends[1].translation, abs=1e-12)  # it closes

    def moved(index: int, at: np.ndarray) -> np.ndarray:
        J = pin.getJointJacobian(model, data, index, pin.LOCAL_WORLD_ALIGNED)
        return (J[:3] - pin.skew(at - data.oMi[index].translation) @ J[3:])[[0, 2]]

    at = ends[0].translation
    rows = moved(loop.joint1_id, at) - moved(loop.joint2_id, at)
    v, given = np.r_[V, -np.linalg.solve(rows[:, 4:], rows[:, :4] @ V)], np.array([25.0, -40.0])
    assert robot.drive_speeds(Q, V) == pytest.approx([V[2], v[4]], rel=1e-9)
    loops, tau = pin.StdVec_RigidConstraintModel(), np.array([0.0, 0.0, given[0], 0.0, given[1], 0.0])
    loops.append(loop)
    datas = pin.StdVec_RigidConstraintData()
    datas.append(loop.createData())
    pin.initConstraintDynamics(model, data, loops, datas)
    settings = pin.ProximalSettings(1e-12, 1e-9, 50)  # the loop holds nothing across the plane
    expected = pin.constraintDynamics(model, data, q, v, tau, loops, datas, settings)[:4]
    assert machine.acceleration(Q, V, robot.joint_torques(Q, given), False) == pytest.approx(
        expected, rel=1e-6, abs=1e-5
    )


@pytest.mark.parametrize("five_bar", [BEHIND, ACROSS])
def test_what_crank_and_rod_add_to_the_mass_matrix_is_that_of_plain_geometry(five_bar: dict[str, Any]) -> None:
    """Circles that meet, in the complex plane x + i z, and central differences: sum of m r' r' + I phi' phi'."""
    b = five_bar | HEAVY

    def places(q: np.ndarray) -> np.ndarray:
        """Centres of mass of crank and rod, x and z, then both angles."""
        body, thigh = complex(q[0], q[1]), -1j * THIGH * np.exp(1j * q[2])
        arm = body + thigh - 1j * b["arm"] * np.exp(1j * (q[2] + q[3] + b["turned"]))
        pivot = body + complex(b["pivot_x"], b["pivot_z"])
        apart = abs(arm - pivot)
        along = (apart**2 + b["crank"] ** 2 - b["rod"] ** 2) / (2 * apart)  # of the line, to where both circles meet
        aside = np.sqrt(b["crank"] ** 2 - along**2) * (1j if b["ahead"] else -1j)
        end = pivot + (along + aside) * (arm - pivot) / apart
        crank, rod = pivot + (end - pivot) / 2, end + (arm - end) * b["rod_com"] / b["rod"]
        return np.array([crank.real, crank.imag, rod.real, rod.imag, np.angle(end - pivot), np.angle(arm - end)])

    step = 1e-6
    S = np.array([(places(Q + e) - places(Q - e)) / (2 * step) for e in step * np.eye(4)]).T
    weights = np.diag(
        [b["crank_mass"]] * 2 + [b["rod_mass"]] * 2 + [b["crank_inertia"], b["rod_mass"] * b["rod"] ** 2 / 12]
    )
    added = robot_with(b).mass_matrix(Q) - robot_with(five_bar).mass_matrix(Q)
    assert added == pytest.approx(S.T @ weights @ S, rel=1e-7, abs=1e-9)


@pytest.mark.parametrize(
    ("entries", "words"),
    [
        (
            {FIVE_BAR: PARALLEL | {"rod": 0.3}},
            "cannot close in places with the knee between -1.* and -0.1 rad and the hip",
        ),
        ({FIVE_BAR: PARALLEL | {"turned": 1.0}}, "five_bar (cannot close|has a dead point)"),
        ({"leg.hip.transmission.five_bar": PARALLEL}, "needs a link before the hip, which is the first"),
        ({FIVE_BAR: PARALLEL, "leg.knee.transmission.coupling": {"hip": {"ratio": 1.0}}}, "turns with the hip already"),
        ({FIVE_BAR: PARALLEL, "leg.knee.transmission.linear": {"slope": 0.1}}, "linear and five_bar: one law"),
    ],
)
def test_five_bars_that_cannot_be_are_refused_in_a_sentence(entries: dict[str, Any], words: str) -> None:
    with pytest.raises(ProblemFileError, match=words):
        load("paper", entries)


def test_what_knows_no_closed_chain_says_so_and_simulations_go_by_pinocchio() -> None:
    design = load("paper", {FIVE_BAR: PARALLEL | HEAVY, "contact.friction": 0.8})
    with pytest.raises(UsageError, match=r"knows no closed chains: leave out leg\.knee\.transmission\.five_bar"):
        to_mjcf(build_robot(design.leg))
    assert type(make_plant(design)) is Plant
    with pytest.raises(UsageError, match=r"leg\.knee\.transmission\.five_bar cannot close where the leg has moved to"):
        build_robot(design.leg, {f"{FIVE_BAR}.rod": 0.2}).mass_matrix(Q)


@pytest.mark.rarely
def test_rods_that_weigh_cost_height() -> None:
    """The same machine without masses is a belt on the body, 1.1157 m by other equations (docs/transmissions.md)."""
    s = solved_once({FIVE_BAR: PARALLEL | {"crank_mass": 0.08, "rod_mass": 0.25}})
    assert s.verified
    assert 1.05 < s.clearance < 1.1157
