"""Legs out of MuJoCo's files, against MuJoCo itself and against the same legs out of URDFs."""

import importlib
import tracemalloc
import xml.etree.ElementTree as ET
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from hopopt import load
from hopopt.design import Leg
from hopopt.errors import ProblemFileError
from hopopt.leg.files.export import to_mjcf, to_urdf
from hopopt.leg.files.mjcf_xml import Defaults
from hopopt.leg.files.urdf import read_leg
from hopopt.leg.files.urdf_xml import UrdfError
from hopopt.leg.kinematics import joint_positions
from hopopt.leg.robot import BASE, build_robot

mujoco: Any = importlib.import_module("mujoco")  # compiled, without type information
ROBOT = """
<mujoco model="robot">
  <compiler angle="degree" eulerseq="xyz"/>
  <default>
    <joint armature="0.01" damping="0.4"/>
    <motor ctrlrange="-4 4"/>
    <default class="leg">
      <joint axis="0 1 0" frictionloss="0.3" range="-120 120"/>
      <default class="knee"><joint armature="0.02" range="-150 -10" actuatorfrcrange="-30 25"/></default>
      <default class="light"><geom mass="0"/></default>
    </default>
  </default>
  <worldbody>
    <geom type="plane" size="1 1 1"/>
    <body name="ball" pos="1 0 0"><freejoint/><inertial pos="0 0 0" mass="3" diaginertia="1 1 1"/></body>
    <frame euler="0 7 20">
    <body name="trunk" pos="0 0 0.5" childclass="leg">
      <freejoint name="base"/>
      <inertial pos="0 0 0.02" mass="4" diaginertia="0.04 0.05 0.06"/>
      <frame pos="0.1 0.05 0" euler="10 0 0">
        <body name="hip" pos="0.02 0 0">
          <joint name="haa" axis="1 0 0"/>
          <inertial pos="0 0.02 0" mass="0.5" diaginertia="0.001 0.001 0.001"/>
          <body name="thigh" pos="0 0.05 0" euler="-10 0 0">
            <joint name="hfe" pos="0.01 0 0.02"/>
            <inertial pos="0.01 0.02 -0.1" quat="0.9 0.1 0.3 0.2" mass="1" diaginertia="0.004 0.005 0.002"/>
            <geom class="light" type="sphere" size="0.02"/>
            <body name="shank" pos="0 0.01 -0.2" axisangle="0 0 1 20">
              <joint name="kfe" class="knee"/>
              <inertial pos="0 0 -0.1" mass="0.4" fullinertia="0.002 0.003 0.0015 0.0001 0.0002 -0.0001"/>
              <site name="toe" pos="0.03 0 -0.24"/>
              <body name="cuff" pos="0 0 -0.05" xyaxes="0 1 0 -1 0 0">
                <inertial pos="0.02 0 0" mass="0.1" diaginertia="0.0001 0.0002 0.0002"/>
              </body>
            </body>
          </body>
        </body>
      </frame>
    </body>
    </frame>
  </worldbody>
  <actuator>
    <motor name="m_haa" joint="haa"/>
    <motor name="m_hfe" joint="hfe" gear="9 0 0 0 0 0"/>
    <motor name="m_kfe" joint="kfe" gear="9" forcerange="-3.5 3.5"/>
  </actuator>
</mujoco>
"""
PROBLEM = """
name = "m"
[leg]
mjcf = "leg.xml"
joints = ["hfe", "kfe"]
foot_frame = "toe"
motor.max_speed = 20.0
{}
[start]
joint_angles = [0.5, -1.0]
"""


@pytest.fixture
def read(tmp_path: Path) -> Callable[..., Leg]:
    """Reads the leg of an MJCF, with lines of [leg]."""

    def read(mjcf: str = ROBOT, lines: str = "") -> Leg:
        (tmp_path / "leg.xml").write_text(mjcf)
        (tmp_path / "m.toml").write_text(PROBLEM.format(lines))
        return load(tmp_path / "m.toml").leg

    return read


def test_foot_and_torques_are_those_that_mujoco_computes(read: Callable[..., Leg]) -> None:
    """Classes, frames, five kinds of turns, a joint beside its body's origin; the joint above the leg stands at zero."""
    quiet = ROBOT.replace('frictionloss="0.3"', "").replace('damping="0.4"', "")
    leg = read(quiet)
    model = mujoco.MjModel.from_xml_string(quiet)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT  # stops of joints, and the floor
    own, data, rng = build_robot(leg), mujoco.MjData(model), np.random.default_rng(2)
    at = [model.joint(name).dofadr[0] for name in leg.joints]
    base = model.joint("base").dofadr[0]
    for _ in range(5):
        q_j, v_j, a_j = rng.uniform(-2, 2, (3, 2))
        push = rng.uniform(-5, 5, 2)
        data.qpos[:], data.qvel[:], data.qacc[:] = model.qpos0, 0.0, 0.0
        data.qpos[[model.joint(name).qposadr[0] for name in leg.joints]] = q_j
        data.qvel[at], data.qacc[at], data.qacc[[base, base + 2]] = v_j, a_j, push
        mujoco.mj_inverse(model, data)
        expected = data.site("toe").xpos - data.joint("hfe").xanchor
        np.testing.assert_allclose(joint_positions(leg, q_j)[-1], expected, atol=1e-14)
        speeds, rates = np.array([0, 0, *v_j]), np.array([*push, *a_j])
        mine = pin.rnea(own.model, own.model.createData(), np.array([0, 0, *q_j]), speeds, rates)
        np.testing.assert_allclose(mine[BASE:], data.qfrc_inverse[at], atol=1e-12)
    assert leg.body.mass == pytest.approx(4.5, abs=1e-12)  # the ball beside the robot is no part of it


def drives(leg: Leg) -> list[tuple[Any, ...]]:
    """(torque, rotor inertia, friction, damping, ratio) of each joint."""
    entries: Mapping[str, Any] = {
        "max_torque": "motor",
        "rotor_inertia": "motor",
        "friction": "gear",
        "damping": "gear",
    }
    return [(*(leg.drive(j, part, name)[1] for name, part in entries.items()), leg.joint[j].lower) for j in leg.joints]


def test_drives_are_those_of_joints_and_actuators(read: Callable[..., Leg]) -> None:
    """9 (4) = 36 N m by the control's range; of 9 (3.5) and the joint's 25 N m the least; behind a gear as in front of it."""
    limits = [pytest.approx(np.radians(x), rel=1e-15) for x in (-120, -150)]
    expected = [(36, 0.01, 0.3, 0.4, limits[0]), (25, 0.02, 0.3, 0.4, limits[1])]
    assert drives(read()) == expected
    geared = [(t / 5, pytest.approx(r / 25, rel=1e-15), *rest) for t, r, *rest in expected]
    assert drives(read(ROBOT, "gear.ratio = 5")) == geared
    own = read(ROBOT, "motor.rotor_inertia = 1e-5\ngear.friction = 0.1\nkfe.gear.damping = 0.2")
    assert [x[1:4] for x in drives(own)] == [(1e-5, 0.1, 0.4), (1e-5, 0.1, 0.2)]
    bare = ROBOT.replace("frictionloss", "margin").replace(' damping="0.4"', "").replace(' armature="0.01"', "")
    assert drives(read(bare))[0][1:4] == (0, None, None)


def test_a_file_that_mujoco_has_saved_says_the_same(read: Callable[..., Leg], tmp_path: Path) -> None:
    """It writes motors as <general>; and names of the outermost class, ranges of nothing and orders of turns are read as it does."""
    model = mujoco.MjModel.from_xml_string(ROBOT)
    mujoco.mj_saveLastXML(str(tmp_path / "saved.xml"), model)
    saved = (tmp_path / "saved.xml").read_text()
    assert "<general" in saved
    assert [x[0] for x in drives(read(saved))] == [36, 25]
    assert drives(read(ROBOT.replace("<default>", '<default class="robot">'))) == drives(read())
    free = read(ROBOT.replace('name="kfe" class="knee"', 'name="kfe" class="knee" actuatorfrcrange="0 0"'))
    assert drives(free)[1][0] == pytest.approx(9 * 3.5)
    with pytest.raises(ProblemFileError, match="all small or all large"):
        read(ROBOT.replace('eulerseq="xyz"', 'eulerseq="xYz"'))


@pytest.mark.parametrize("name", ["paper", "three_joint"])
def test_a_leg_is_the_same_from_both_files(name: str) -> None:
    """As exported; in MuJoCo's with the rotors that the URDF has in comments."""
    robot = build_robot(load(name).leg)
    urdf, mjcf = (
        read_leg(write(robot).encode(), robot.joints, "foot", {}, kind=kind)
        for kind, write in (("urdf", to_urdf), ("mjcf", to_mjcf))
    )
    assert urdf.body_mass == mjcf.body_mass
    for one, other in zip(urdf.links, mjcf.links, strict=True):
        assert (one.joint, one.axis, one.lower, one.upper) == (other.joint, other.axis, other.lower, other.upper)
        for a, b in ((one.vector, other.vector), (one.com, other.com), (one.inertia, other.inertia)):
            np.testing.assert_allclose(a, b, atol=1e-15)
        assert one.effort == other.effort
    np.testing.assert_allclose([link.drive.armature for link in mjcf.links], robot.model.armature[BASE:], rtol=1e-15)


@pytest.mark.parametrize(
    ("said", "instead", "sentence"),
    [
        ("<worldbody>", '<include file="x.xml"/><worldbody>', "has <include>, which leads elsewhere: hopopt reads what MuJoCo writes"),
        ('<joint name="hfe" ', '<joint name="hfe" ref="10" ', 'joint "hfe" has ref = 10: hopopt counts angles from the pose'),
        ('class="knee"/>', 'class="knee" stiffness="5"/>', 'joint "kfe" has a spring (stiffness = 5), which a leg of hopopt has not'),
        ('class="knee"/>', 'class="elbow"/>', 'has no default class "elbow", which a <joint> names'),
        ('class="light" ', "", 'body "thigh" has geoms that weigh something and no <inertial>'),
        ('mass="0.4"', 'mass="4e9"', 'body "shank" has mass="4e9": 1e+06 at most is allowed'),
        ('euler="-10 0 0"', 'euler="-10 0"', 'body "thigh" has euler="-10 0": 3 numbers with blanks between is needed'),
        ("<actuator>", '<equality><connect body1="cuff" body2="trunk" anchor="0 0 0"/></equality><actuator>', 'closes a loop in the leg by <connect> of "cuff" and "trunk"'),
        ("<actuator>", '<equality><joint joint1="kfe" joint2="hfe"/></equality><actuator>', 'joint "kfe" mimics "hfe": leave it out of leg.joints'),
        ("<actuator>", '<equality><joint joint1="haa" joint2="hfe" polycoef="0.3 0 0 0 0"/></equality><actuator>', 'joint "haa" follows "hfe" by polycoef="0.3 0 0 0 0", which holds it still: take its equality out'),
        ("<actuator>", '<equality><joint joint1="haa" joint2="hfe" polycoef=""/></equality><actuator>', 'has polycoef="": a number such as 0.25'),
        ("<actuator>", '<equality><joint joint1="haa" joint2="hfe"/><joint joint1="haa" joint2="kfe"/></equality><actuator>', 'joint "haa" follows "kfe", and another equality says how it moves too'),
        ("<mujoco", '<!DOCTYPE x [<!ENTITY a "b">]><mujoco', "declares a document type or entities, which no MJCF needs"),
        ('name="toe"', 'name="tip"', 'has no "toe" for leg.foot_frame'),
    ],
)  # fmt: skip
def test_what_cannot_be_read_is_said_in_one_sentence(
    said: str, instead: str, sentence: str, read: Callable[..., Leg]
) -> None:
    assert said in ROBOT
    given = ROBOT.replace(said, instead)
    if "no <inertial>" in sentence:
        given = given.replace(
            '<inertial pos="0.01 0.02 -0.1" quat="0.9 0.1 0.3 0.2" mass="1" diaginertia="0.004 0.005 0.002"/>', ""
        )
    with pytest.raises(ProblemFileError) as raised:
        read(given)
    assert len(raised.value.problems) == 1
    assert sentence in raised.value.problems[0]


def test_a_file_of_the_other_kind_and_both_files_are_told_apart(read: Callable[..., Leg]) -> None:
    with pytest.raises(
        ProblemFileError, match=r"leg\.xml is XML, but begins with <robot> instead of <mujoco>: this is a URDF"
    ):
        read('<robot name="r"/>')
    with pytest.raises(ProblemFileError, match=r"leg\.mjcf stands beside leg\.urdf: a leg is read from one of them"):
        read(ROBOT, 'urdf = "leg.xml"')


def nested(count: int) -> ET.Element:
    """So many default classes, each inside the one before it and with an attribute of its own."""
    opened = "".join(f'<default class="c{k}"><geom a{k}="{k}"/>' for k in range(count))
    return ET.fromstring(f"<mujoco><default>{opened}{'</default>' * count}</default></mujoco>")


def test_classes_inside_classes_take_little_memory() -> None:
    """Every attribute is kept once, found from the innermost class, and too many classes are refused."""
    root = nested(900)
    tracemalloc.start()
    found = Defaults.of(root)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 3e6
    assert found.attributes(ET.Element("geom", a7="own"), "c899") == {f"a{k}": str(k) for k in range(900)} | {
        "a7": "own"
    }
    with pytest.raises(UrdfError, match="has more than 1000 default classes"):
        Defaults.of(nested(1001))


def test_a_damaged_file_is_refused_and_nothing_else() -> None:
    """A thousandth of the text is replaced by what XML is made of."""
    rng, signs = np.random.default_rng(7), list('<>"/= -e9.a&')
    for _ in range(150):
        text = list(ROBOT)
        for k in rng.integers(0, len(text), 3):
            text[k] = str(rng.choice(signs))
        try:
            read_leg("".join(text).encode(), ("hfe", "kfe"), "toe", {}, kind="mjcf")
        except UrdfError as error:
            assert str(error)
