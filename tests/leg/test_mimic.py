"""Joints that follow others, and transmissions, as robots' files state them: against Pinocchio's model in which every joint moves."""

from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest
from tests.leg.test_urdf_robots import HEAD, LIMIT, PARTS, START, inertial, joint, link, refusal, robot

from hopopt import load
from hopopt.design import Design
from hopopt.design.leg import physical_parameters
from hopopt.drivetrain.transmission import drive_angles
from hopopt.leg.dynamics import LegDynamics
from hopopt.leg.files.export import to_urdf
from hopopt.leg.kinematics import foot_jacobian, joint_positions
from hopopt.leg.robot import BASE, build_robot
from hopopt.planner.solve import solve
from hopopt.sim.machine import Machine

RATIO, OFFSET = -0.5, 0.2
TOE = link("toe", inertial("0 0 -0.05", 0.2, 4e-4, 4e-4, 1e-4))
TIP = 'leg.foot_frame="tip"'


@pytest.fixture
def read(tmp_path: Path) -> Any:
    """Reads the leg of a URDF, with overrides."""

    def read(urdf: str, *overrides: str) -> Design:
        (tmp_path / "leg.urdf").write_text(urdf)
        (tmp_path / "m.toml").write_text(f"{HEAD}\n{START}")
        return load(tmp_path / "m.toml", overrides)

    return read


def with_toe(mimic: str = f'<mimic joint="knee" multiplier="{RATIO}" offset="{OFFSET}"/>', more: str = "") -> str:
    """The leg with a toe below its shank, whose joint has this inside."""
    at = joint("ankle", "shank", "toe", "0 0 -0.25", inside=LIMIT.replace('"2"', '"0.9"') + mimic)
    return robot(TOE + at + link("tip") + joint("end", "toe", "tip", "0 0 -0.12", "fixed", "") + more)


def test_a_joint_that_follows_moves_the_leg_as_one_whose_angle_is_tied(read: Any) -> None:
    """q_b = m q_a + c in Pinocchio's model of three free joints: forces by S' and motions by S, S the matrix of that line."""
    design = read(with_toe(), TIP)
    free = pin.buildModelFromXML(with_toe(mimic=""))
    mine, machine = build_robot(design.leg), Machine(build_robot(design.leg))
    S, c = np.array([[1, 0], [0, 1], [0, RATIO]]), np.array([0, 0, OFFSET])
    q, v, a = np.random.default_rng(1).normal(size=(3, 2))
    data = free.createData()
    expected = S.T @ pin.rnea(free, data, S @ q + c, S @ v, S @ a)
    Q, V, A = (np.concatenate([np.zeros(BASE), x]) for x in (q, v, a))
    np.testing.assert_allclose(machine.inverse_dynamics(Q, V, A)[BASE:], expected, atol=1e-12)
    names = [ca.SX.sym(x, BASE + 2) for x in "qva"]
    planned = ca.Function("f", names, [LegDynamics(mine, mine.parameters).inverse_dynamics(*names)])
    np.testing.assert_allclose(planned(Q, V, A).full()[BASE:, 0], expected, atol=1e-12)
    pin.framesForwardKinematics(free, data, S @ q + c)
    tip = data.oMf[free.getFrameId("tip")].translation
    np.testing.assert_allclose(joint_positions(design.leg, q)[-1], tip, atol=1e-12)
    J = pin.computeFrameJacobian(free, data, S @ q + c, free.getFrameId("tip"), pin.LOCAL_WORLD_ALIGNED)[:3] @ S
    np.testing.assert_allclose(foot_jacobian(design.leg, q), J, atol=1e-12)
    # forward dynamics undoes it, with the foot free and pinned, and power is the rate of energy
    tau = np.array([1.0, -2.0])
    moved = machine.acceleration(Q, V, tau, False)
    np.testing.assert_allclose(machine.inverse_dynamics(Q, V, moved), [0, 0, *tau], atol=1e-10)
    pinned = machine.acceleration(Q, V, tau, True)
    np.testing.assert_allclose(machine.foot_acceleration(Q, V, pinned), 0, atol=1e-10)
    later, before = (machine.energy(Q + h * V, V + h * moved) for h in (1e-6, -1e-6))
    assert (later - before) / 2e-6 == pytest.approx(tau @ v, rel=1e-6)


def test_limits_of_what_follows_hold_and_the_export_reads_back(read: Any) -> None:
    """The toe's lower limit -2 lets the knee reach 4.4 rad, its upper 0.9 no less than -1.4."""
    design = read(with_toe(), TIP, "start.joint_angles=[0.3,-0.6]")
    assert (design.leg.joint["knee"].lower, design.leg.joint["knee"].upper) == pytest.approx((-1.4, 2.0), abs=1e-12)
    again = read(to_urdf(build_robot(design.leg)), "start.joint_angles=[0.3,-0.6]").leg
    assert again.link["toe"].follows == design.leg.link["toe"].follows
    assert again.joint["knee"].lower == pytest.approx(design.leg.joint["knee"].lower, abs=1e-12)


@pytest.mark.parametrize(
    ("toe", "words"),
    [
        ('<mimic joint="ankle"/>', 'joint "ankle" mimics in a loop (ankle, ankle)'),
        ('<mimic joint="wrist"/>', 'joint "ankle" mimics "wrist", which the file does not have'),
        ('<mimic joint="knee" multiplier="0"/>', "multiplier 0, which moves nothing"),
        ('<mimic joint="knee" offset="10"/>', 'joint "ankle" follows "knee" (1 times its angle plus 10 rad) and never lies within its own limits'),
        ('<mimic joint="knee" multiplier="two"/>', 'has <mimic multiplier="two">: a number such as 0.25 or 1e-3 is needed'),
    ],
)  # fmt: skip
def test_a_mimic_that_cannot_be_is_refused_in_a_sentence(toe: str, words: str, read: Any) -> None:
    assert words in refusal(read, with_toe(toe), TIP)


def test_a_joint_of_the_leg_does_not_mimic_one_outside_of_it(read: Any) -> None:
    finger = link("finger", inertial("0 0 0", 0.2, 1e-4, 1e-4, 1e-4)) + joint("curl", "body", "finger")
    knee = joint("knee", "thigh", "shank", "0 0 -0.2", inside=LIMIT + '<mimic joint="curl"/>')
    assert 'joint "knee" mimics "curl", which leg.joints does not have' in refusal(read, robot(finger, knee=knee))


TRANSMISSION = '<transmission name="t"><type>transmission_interface/{}</type>{}</transmission>'
REDUCES = "<mechanicalReduction>{}</mechanicalReduction>"


def ends(*reductions: float) -> str:
    """Actuators and joints of a transmission with their reductions, actuators first."""
    tags = ("actuator", "actuator", "joint", "joint") if len(reductions) == 4 else ("actuator", "joint")
    names = ("m1", "m2", "hip", "knee") if len(reductions) == 4 else ("m", "knee")
    each = zip(tags, names, reductions, strict=True)
    return "".join(f'<{tag} name="{name}">{REDUCES.format(x)}</{tag}>' for tag, name, x in each)


@pytest.mark.parametrize(
    ("kind", "reductions", "turns"),
    [
        ("SimpleTransmission", (-9.0, 2.0), [[1, 0], [0, 18]]),
        ("DifferentialTransmission", (9.0, 8.0, 2.0, 3.0), [[18, 27], [-16, 24]]),
        ("FourBarLinkageTransmission", (9.0, 8.0, 2.0, 3.0), [[18, 0], [8, 24]]),
    ],
)
def test_an_actuator_turns_as_its_transmission_says(
    kind: str, reductions: tuple[float, ...], turns: Any, read: Any
) -> None:
    """Turns of actuators by those of the joints; the second of a differential counts the other way round."""
    leg = read(robot(TRANSMISSION.format(kind, ends(*reductions)))).leg
    q = np.array([0.3, -0.8])
    behind = ca.DM(drive_angles(leg, physical_parameters(leg), ca.SX(q))).full()[:, 0]
    gears = np.array([leg.drive(j, "gear", "ratio")[1] for j in leg.joints])
    np.testing.assert_allclose(gears * behind, np.array(turns) @ q, atol=1e-12)
    # what the file limits at a joint stays there, and some joint has all of it
    torque, speed = ([leg.drive(j, "motor", f"max_{each}")[1] for j in leg.joints] for each in ("torque", "speed"))
    assert max(np.abs(turns).T @ torque / [40, 60]) == pytest.approx(1, rel=1e-12)
    assert max(np.abs(np.linalg.inv(turns)) @ speed / 20) == pytest.approx(1, rel=1e-12)


def test_the_motors_of_a_differential_are_alike(read: Any) -> None:
    """Of n_a = 10, n_j = 2 and 1, efforts 40 and 60 N m, speeds 20 rad/s: 2 x 10 (1 + 1) N m are the hip's effort; 200 rad/s turn
    the knee by 20 rad/s alone."""
    leg = read(robot(TRANSMISSION.format("DifferentialTransmission", ends(10.0, 10.0, 2.0, 1.0)))).leg
    for j in leg.joints:
        found = leg.drive(j, "motor", "max_torque")[1], leg.drive(j, "motor", "max_speed")[1]
        assert found == pytest.approx((1.0, 200.0), rel=1e-12)


def test_a_gear_of_the_problem_counts_over_that_of_the_file(read: Any) -> None:
    leg = read(robot(TRANSMISSION.format("SimpleTransmission", ends(9.0, 1.0))), "leg.gear.ratio=5.0").leg
    assert leg.drive("knee", "gear", "ratio")[1] == 5


@pytest.mark.parametrize(
    ("transmission", "words"),
    [
        (TRANSMISSION.format("HalfDifferentialTransmission", ends(1.0, 1.0)), 'of type "HalfDifferentialTransmission"'),
        (TRANSMISSION.format("SimpleTransmission", ends(0.0, 1.0)), "mechanicalReduction 0"),
        (TRANSMISSION.format("SimpleTransmission", ends(0.5, 1.0)), "leg.knee.gear.ratio = 0.5 is too small"),
        (2 * TRANSMISSION.format("SimpleTransmission", ends(2.0, 1.0)), 'another one of joint "knee"'),
    ],
)
def test_a_transmission_that_cannot_be_read_is_refused_in_a_sentence(transmission: str, words: str, read: Any) -> None:
    assert words in refusal(read, robot(transmission))


@pytest.mark.slow
def test_a_leg_whose_toe_follows_its_knee_hops_and_is_verified(read: Any) -> None:
    best = solve(
        read(robot_with_bent_knee(), TIP, "leg.body.mass=3.0", "start.joint_angles=[0.5,-1.0]", "solver.starts=1")
    )
    assert best.verified
    q = best.sample(np.linspace(0, best.duration, 20)).q[:, BASE:]
    low, high = best.design.leg.joint["knee"].lower, best.design.leg.joint["knee"].upper
    assert np.all((q[:, 1] >= low - 1e-3) & (q[:, 1] <= high + 1e-3))


def robot_with_bent_knee() -> str:
    """The leg with a toe, its knee kept from stretching."""
    knee = joint("knee", "thigh", "shank", "0 0 -0.2", inside=LIMIT.replace('upper="2"', 'upper="-0.1"'))
    return with_toe().replace(PARTS["knee"], knee)
