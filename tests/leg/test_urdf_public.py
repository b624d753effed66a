"""Legs of public robots that come with no problem of their own, against Pinocchio's reading of the whole robot."""

from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from hopopt import load
from hopopt.leg.kinematics import joint_positions
from hopopt.leg.robot import BASE, build_robot

ROBOTS = "example-robot-data"
LIMITS = "{lower = -2.0, upper = 2.0}"
LEGS = {  # URDF; joints from the body to the foot; link of the foot; point of it [m]; lines of [leg]
    "anymal_c": (
        "anymal_c_simple_description/urdf/anymal.urdf", ("LF_HFE", "LF_KFE"), "LF_FOOT", (0.0, 0.0, 0.0),
        f"LF_HFE = {LIMITS}\nLF_KFE = {LIMITS}",
    ),
    "romeo": (
        "romeo_description/urdf/romeo.urdf", ("LHipPitch", "LKneePitch", "LAnklePitch"), "l_sole", (0.1, 0.0, 0.0), "",
    ),
    "talos": (
        "talos_data/robots/talos_reduced.urdf", ("leg_left_3_joint", "leg_left_4_joint", "leg_left_5_joint"),
        "left_sole_link", (0.1, 0.0, 0.0), "",
    ),
    "g1": (
        "g1_description/urdf/g1_29dof_rev_1_0.urdf",
        ("left_hip_pitch_joint", "left_knee_joint", "left_ankle_pitch_joint"),
        "left_ankle_roll_link", (0.12, 0.0, -0.03), "motor.rotor_inertia = 0.0",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", LEGS)
def test_foot_and_torques_are_those_of_the_whole_robot(name: str, tmp_path: Path) -> None:
    """Other joints stand at zero, or at their limit nearest to it; the other limbs weigh on the body alone."""
    path, joints, foot, point, lines = LEGS[name]
    try:
        robots = Path(str(distribution(ROBOTS).locate_file("cmeel.prefix/share/example-robot-data/robots")))
    except PackageNotFoundError:  # pragma: no cover
        pytest.skip("example-robot-data is not installed")
    (tmp_path / "m.toml").write_text(
        f'name = "m"\n[leg]\nurdf = "{ROBOTS}/{path}"\njoints = {list(joints)}\nfoot_frame = "{foot}"\n'
        f"foot_point = {list(point)}\n{lines}\n[start]\njoint_angles = {[-0.5, 1.0, -0.5][: len(joints)]}\n"
    )
    leg = load(tmp_path / "m.toml").leg
    model = pin.buildModelFromXML((robots / path).read_text(), pin.JointModelFreeFlyer())
    own, data = build_robot(leg), model.createData()
    places = [model.joints[model.getJointId(joint)] for joint in joints]
    rest, rng = pin.neutral(model), np.random.default_rng(4)
    low, high = model.lowerPositionLimit[7:], model.upperPositionLimit[7:]
    rest[7:] = np.where(low < high, np.clip(rest[7:], low, high), rest[7:])
    at = [joint.idx_v for joint in places]
    for _ in range(5):
        q_j, q, v, a = rng.uniform(-2, 2, len(joints)), rest.copy(), np.zeros(model.nv), np.zeros(model.nv)
        rates = rng.uniform(-5, 5, BASE + len(joints)), rng.uniform(-50, 50, BASE + len(joints))
        q[[joint.idx_q for joint in places]] = q_j
        v[[0, 2, *at]], a[[0, 2, *at]] = rates
        pin.framesForwardKinematics(model, data, q)
        hip, sole = data.oMi[model.getJointId(joints[0])], data.oMf[model.getFrameId(foot, pin.FrameType.BODY)]
        np.testing.assert_allclose(
            joint_positions(leg, q_j)[-1], sole.act(np.array(point)) - hip.translation, atol=2e-9
        )
        mine = pin.rnea(own.model, own.model.createData(), np.concatenate([np.zeros(BASE), q_j]), *rates)
        np.testing.assert_allclose(mine[BASE:], pin.rnea(model, data, q, v, a)[at], rtol=1e-8, atol=1e-8)


def test_the_first_problem_of_the_page_is_one_whole(tmp_path: Path) -> None:
    """A leg that four share, with its robot's mass and the solids of its file."""
    try:
        robots = Path(str(distribution(ROBOTS).locate_file("cmeel.prefix/share/example-robot-data/robots")))
    except PackageNotFoundError:  # pragma: no cover
        pytest.skip("example-robot-data is not installed")
    page = (Path(__file__).parents[2] / "docs" / "own_leg.md").read_text(encoding="utf-8")
    (tmp_path / "m.toml").write_text(page.split("```toml\n")[1].split("```")[0])
    leg = load(tmp_path / "m.toml").leg
    whole = pin.buildModelFromXML((robots / "a1_description/urdf/a1.urdf").read_text(), pin.JointModelFreeFlyer())
    own = leg.body.mass + sum(link.mass for link in leg.link.values())
    assert 4 * own == pytest.approx(pin.computeTotalMass(whole), rel=1e-12)
    assert leg.body.shapes
