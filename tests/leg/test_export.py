"""URDF and MJCF read back by Pinocchio's and MuJoCo's own readers: the same leg, on random legs and states."""

import importlib
import json
import re
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import assume, given

from drawn_legs import legs_in_motion, mass_matrix, quick
from hopopt.cli import main as cli
from hopopt.design import Leg
from hopopt.leg.files.export import to_mjcf, to_urdf
from hopopt.leg.robot import BASE, Robot, build_robot
from hopopt.problem.load import load

mujoco: Any = importlib.import_module("mujoco")  # compiled, without type information
Case = tuple[Leg, np.ndarray, np.ndarray, np.ndarray]
SNAP = 1e-6  # m: MuJoCo takes a centre of mass this close to its joint to be there
READERS = {"urdf": to_urdf, "mjcf": to_mjcf}


def renamed(joints: tuple[str, ...], links: tuple[str, ...]) -> Robot:
    """The paper's leg under other names."""
    leg = load("paper").leg.model_dump()
    body = {k: leg[k] for k in ("body", "motor", "gear")}
    parts = [leg[name] for name in ("hip", "knee", "thigh", "shank")]
    tables = dict(zip((*joints, *links), parts, strict=True))
    return build_robot(Leg.model_validate({"joints": joints, "links": links, **body, **tables}))


# ---- URDF in Pinocchio ------------------------------------------------------------------------------------


@quick
@given(legs_in_motion(plane=True))
def test_urdf_is_the_same_leg_to_pinocchio(case: Case) -> None:
    """Mass matrix, bias forces, every point; rotor inertias, which URDF has not, set as its comment says."""
    leg, q, v, _ = case
    robot = build_robot(leg)
    text = to_urdf(robot)
    model = pin.buildModelFromXML(text)
    assert list(model.names)[1:] == ["x", "z", *leg.joints]
    model.armature = np.array([0.0] * BASE + [rotor_in_comment(text, name) for name in leg.joints])
    read, M = Robot(leg, model, robot.points, robot.parameters), mass_matrix(robot, q)
    np.testing.assert_allclose(mass_matrix(read, q), M, rtol=0, atol=1e-10 * np.abs(M).max())
    bias, bias_read = (pin.nonLinearEffects(m, m.createData(), q, v) for m in (robot.model, model))
    np.testing.assert_allclose(bias_read, bias, rtol=0, atol=1e-10 * np.abs(bias).max())
    place, place_read = (places(r.model, q) for r in (robot, read))
    for name in (*leg.joints, "foot"):
        np.testing.assert_allclose(place_read[name], place[f"point_{name}"], rtol=0, atol=1e-10)


def test_urdf_has_gears_as_transmissions_and_their_rotors_as_comments() -> None:
    leg = load("paper", ["leg.knee.gear.ratio=80", "leg.gear.inertia=1e-6"]).leg
    parser = ET.XMLParser(target=ET.TreeBuilder(insert_comments=True))
    root = ET.fromstring(to_urdf(build_robot(leg)), parser)
    gears = {t.find("joint").get("name"): t.find("actuator") for t in root.iter("transmission")}  # type: ignore[union-attr]
    for joint, ratio in (("hip", 100), ("knee", 80)):
        actuator = gears[joint]
        assert actuator is not None
        assert float(actuator.findtext("mechanicalReduction") or 0) == ratio
        (said,) = [str(c.text) for c in actuator if c.tag is ET.Comment]
        assert float(re.findall(r": (\S+) kg", said)[0]) == pytest.approx(1.19e-5 + 1e-6)


def test_the_problem_beside_a_urdf_is_the_same_problem(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Equal in every entry, so that its answer is the same; the URDF alone has lost the rotors."""
    urdf, changes = tmp_path / "leg.urdf", ["leg.gear.ratio=80", "contact.friction=0.7"]
    arguments = ["export", "paper", "--urdf", str(urdf), *(w for c in changes for w in ("--set", c))]
    assert cli.run([*arguments, "--json"]) == 0
    beside = tmp_path / "leg.problem.toml"
    assert json.loads(capsys.readouterr().out)["written"] == [str(urdf), str(beside)]
    assert load(beside) == load("paper", changes)
    urdf.unlink()
    assert cli.run(arguments) == 2  # whole or not at all
    assert "leg.problem.toml exists already" in capsys.readouterr().err
    assert not urdf.exists()


def rotor_in_comment(text: str, joint: str) -> float:
    found = re.search(rf"\b{joint} ([0-9.e+-]+)[,.] ?", text.split("-->")[0])
    assert found
    return float(found[1].rstrip(".,"))


def places(model: Any, q: np.ndarray) -> dict[str, np.ndarray]:
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    return {frame.name: data.oMf[k].translation for k, frame in enumerate(model.frames)}


def test_urdf_limits_are_those_of_the_joint_and_its_drive() -> None:
    """Standstill torque and no-load speed at the joint; the caps where they are lower; a guide has no motor."""
    model = pin.buildModelFromXML(to_urdf(build_robot(load("paper").leg)))
    np.testing.assert_allclose(model.effortLimit, [0, 0, 200.0, 200.0])  # 100 * 2 N m
    np.testing.assert_allclose(model.velocityLimit[BASE:], 12.56637)  # 12 000 rpm / 100
    np.testing.assert_array_equal(model.lowerPositionLimit[BASE:], [-0.6, -2.4])
    np.testing.assert_array_equal(model.upperPositionLimit[BASE:], [1.3, -0.15])
    capped = load("paper", ["leg.gear.torque_cap=107", "leg.motor.torque_cap=1.5", "leg.gear.speed_cap=680"]).leg
    model = pin.buildModelFromXML(to_urdf(build_robot(capped)))
    np.testing.assert_allclose(model.effortLimit[BASE:], 107.0)
    np.testing.assert_allclose(model.velocityLimit[BASE:], 6.8)
    model = pin.buildModelFromXML(to_urdf(build_robot(load("paper_four_quadrant", ["leg.knee.gear.ratio=80"]).leg)))
    np.testing.assert_allclose(model.effortLimit[BASE:], [200.0, 160.0])
    np.testing.assert_allclose(model.velocityLimit[BASE:], [12.56637, 12.56637 / 0.8])


# ---- MJCF in MuJoCo ---------------------------------------------------------------------------------------


def at(robot: Robot, q: np.ndarray, v: np.ndarray, **control: float) -> Any:
    """MuJoCo's data of the leg at a state, all terms computed; ``control`` [N m] by motor."""
    model = mujoco.MjModel.from_xml_string(to_mjcf(robot))
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = q, v
    for name, torque in control.items():
        data.actuator(name).ctrl[0] = torque
    mujoco.mj_forward(model, data)
    return data


@quick
@given(legs_in_motion(plane=True))
def test_mjcf_is_the_same_leg_to_mujoco(case: Case) -> None:
    """Mass matrix, bias forces and foot by MuJoCo's own algorithms against Pinocchio's."""
    leg, q, v, _ = case
    assume(not any(link.com and link.com <= SNAP for link in leg.link.values()))
    robot = build_robot(leg)
    data = at(robot, q, v)
    model = data.model
    columns = [np.zeros(model.nv) for _ in range(model.nv)]
    for column, unit in zip(columns, np.eye(model.nv), strict=True):
        mujoco.mj_mulM(model, data, column, unit)
    M, bias = mass_matrix(robot, q), pin.nonLinearEffects(robot.model, robot.model.createData(), q, v)
    np.testing.assert_allclose(np.array(columns), M, rtol=0, atol=1e-9 * np.abs(M).max())
    np.testing.assert_allclose(data.qfrc_bias, bias, rtol=0, atol=1e-9 * np.abs(bias).max())
    np.testing.assert_allclose(data.site("foot").xpos, places(robot.model, q)["point_foot"], rtol=0, atol=1e-9)


def test_mujoco_moves_a_centre_of_mass_by_at_most_a_micrometre() -> None:
    """What the random legs above leave out: the file has it to the last digit, MuJoCo rounds it to zero."""
    robot = build_robot(load("paper", {"leg.shank.com": 0.9 * SNAP}).leg)
    assert "-9e-07" in to_mjcf(robot)
    q, v = np.array([0.0, 1.0, 0.3, -1.0]), np.array([0.0, 0.0, 5.0, -9.0])
    data = at(robot, q, v)
    bias = pin.nonLinearEffects(robot.model, robot.model.createData(), q, v)
    np.testing.assert_allclose(data.qfrc_bias, bias, rtol=0, atol=0.8 * SNAP * (9.81 + 5.0**2 + 9.0**2))


def test_mjcf_names_limits_and_motors_of_the_papers_leg() -> None:
    model = mujoco.MjModel.from_xml_string(to_mjcf(build_robot(load("paper").leg)))
    assert [model.joint(k).name for k in range(model.njnt)] == ["x", "z", "hip", "knee"]
    assert [model.body(k).name for k in range(model.nbody)] == ["world", "body", "thigh", "shank"]
    assert model.jnt_limited.tolist() == [0, 0, 1, 1]
    np.testing.assert_array_equal(model.jnt_range[BASE:], [[-0.6, 1.3], [-2.4, -0.15]])
    np.testing.assert_allclose(model.actuator_ctrlrange, [[-200.0, 200.0]] * 2)
    np.testing.assert_allclose(model.dof_armature, [0, 0, 0.119, 0.119])


def test_mjcf_motor_turns_its_joint_forward() -> None:
    """One newton metre at the knee accelerates the leg as it does in Pinocchio."""
    robot, q = build_robot(load("paper").leg), np.array([0.0, 2.0, 0.4, -1.0])
    data = at(robot, q, np.zeros(4), knee=1.0)
    forces = np.array([0.0, 0.0, 0.0, 1.0])
    expected = pin.aba(robot.model, robot.model.createData(), q, np.zeros(4), forces)
    np.testing.assert_allclose(data.qacc, expected, rtol=1e-9)
    assert data.qacc[3] > 0


# ---- the text ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", READERS)
def test_inertias_are_those_of_possible_bodies(kind: str) -> None:
    """Positive, and none above the sum of the other two, or readers refuse the file; about y the leg's own."""
    robot = build_robot(load("paper").leg)
    root = ET.fromstring(READERS[kind](robot))
    if kind == "urdf":
        moments = [[float(i.attrib[k]) for k in ("ixx", "iyy", "izz")] for i in root.iter("inertia")]
    else:
        moments = [[float(x) for x in i.attrib["diaginertia"].split()] for i in root.iter("inertial")]
    assert len(moments) == 3
    for three in np.array(moments):
        assert three.min() > 0
        assert 2 * three.max() <= three.sum()
    np.testing.assert_array_equal([m[1] for m in moments[1:]], [1.87 * 0.38**2 / 12, 0.8 * 0.361**2 / 12])


@pytest.mark.parametrize("kind", READERS)
@pytest.mark.parametrize(
    ("joints", "links"),
    [
        (("a--b", "c---"), ("world", "foot")),  # two hyphens end a comment; names of our own
        (("foot_joint", "guide_"), ("guide", "foot_")),
        (('<&">', "Gelenk-ä"), ("a & b", "'")),  # not allowed in a problem file, but in Python
    ],
)
def test_any_name_makes_a_file_that_can_be_read(kind: str, joints: Any, links: Any) -> None:
    text = READERS[kind](renamed(joints, links))
    ET.fromstring(text)
    if kind == "urdf":
        assert list(pin.buildModelFromXML(text).names)[1:] == ["x", "z", *joints]
    else:
        model = mujoco.MjModel.from_xml_string(text)
        assert [model.joint(k).name for k in range(model.njnt)] == ["x", "z", *joints]


def test_a_comment_says_that_gears_lose_nothing_in_mujoco_where_they_do_in_the_problem() -> None:
    table = {"speed": (100.0, 400.0), "efficiency": (0.8, 0.6)}
    said = [
        "no efficiency, and no table" in to_mjcf(build_robot(load("paper", entries).leg)).partition("-->")[0]
        for entries in ({}, {"leg.gear.efficiency": 0.8}, {"leg.gear.efficiency_table": table})
    ]
    assert said == [False, True, True]


@pytest.mark.parametrize("kind", READERS)
def test_a_comment_on_top_says_what_made_it_and_its_units(kind: str) -> None:
    lines = READERS[kind](build_robot(load("paper").leg)).splitlines()
    assert lines[1].startswith("<!-- Made by hopopt")
    assert "SI units" in lines[1]
    assert lines[3].startswith("  <")  # indented


@pytest.mark.parametrize("kind", [to_urdf, to_mjcf])
def test_a_leg_on_a_slider_cannot_move_along_x(kind: Any) -> None:
    text = kind(build_robot(load("paper", {"leg.guides": ["z"]}).leg))
    assert "its guide along x is fixed" in text
    root = ET.fromstring(text.split("\n", 2)[2])
    slides = [j.get("name") for j in root.iter("joint") if j.get("type") in ("prismatic", "slide")]
    assert slides == ["z"]


@pytest.mark.parametrize("kind", [to_urdf, to_mjcf])
def test_a_leg_that_leaves_the_plane_is_not_called_planar(kind: Any) -> None:
    assert "x-z plane only" in kind(build_robot(load("three_joint").leg))
    assert "x-z plane" not in kind(build_robot(load("three_joint", {"leg.hip.axis": [0.0, -0.98, 0.199]}).leg))
