"""What the URDFs of real robots have beside a leg: names used twice, joints that mimic, limits that are not there."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hopopt import load
from hopopt.design import Design
from hopopt.design.leg import physical_parameters
from hopopt.drivetrain.motor import rated
from hopopt.errors import ProblemFileError
from hopopt.leg.inertia import PAIRS
from hopopt.problem.checking.hints import hints

HEAD = 'name = "m"\n[leg]\nurdf = "leg.urdf"\njoints = ["hip", "knee"]\nfoot_frame = "foot"\n'
START = "[start]\njoint_angles = [0.5, -1.0]\n"
INERTIAL = '<inertial><origin xyz="{}"/><mass value="{}"/><inertia ixx="{}" iyy="{}" izz="{}" ixy="0" ixz="0" iyz="0"/></inertial>'
LIMIT = '<limit lower="-2" upper="2" effort="40" velocity="20"/>'


def inertial(at: str, mass: float, *moments: float) -> str:
    return INERTIAL.format(at, mass, *moments)


def link(name: str, inside: str = "") -> str:
    return f'<link name="{name}">{inside}</link>'


def joint(name: str, parent: str, child: str, at: str = "0 0 0", kind: str = "revolute", inside: str = LIMIT) -> str:
    axis = "" if kind == "fixed" or "<axis" in inside else '<axis xyz="0 -1 0"/>'
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/><origin xyz="{at}"/>'
        f"{axis}{inside}</joint>"
    )


PARTS: Mapping[str, str] = {
    "body": link("body", inertial("0 0 0", 4, 0.04, 0.04, 0.04)),
    "thigh": link("thigh", inertial("0 0 -0.1", 1, 0.004, 0.004, 0.001)),
    "shank": link("shank", inertial("0 0 -0.1", 0.5, 0.002, 0.002, 0.0005)),
    "foot": link("foot"),
    "hip": joint("hip", "body", "thigh"),
    "knee": joint("knee", "thigh", "shank", "0 0 -0.2", inside=LIMIT.replace("40", "60")),
    "sole": joint("sole", "shank", "foot", "0 0 -0.25", "fixed", ""),
}  # a leg of thigh 0.2 m and shank 0.25 m


def robot(more: str = "", **parts: str) -> str:
    """A URDF of the leg, parts of it replaced, and more."""
    return f'<robot name="r">{"".join((dict(PARTS) | parts).values())}{more}</robot>'


@pytest.fixture
def read(tmp_path: Path) -> Any:
    """Reads the leg of a URDF, with lines of [leg] and overrides."""

    def read(urdf: str, lines: str = "", *overrides: str) -> Design:
        (tmp_path / "leg.urdf").write_text(urdf)
        (tmp_path / "m.toml").write_text(HEAD + lines + "\n" + START)
        return load(tmp_path / "m.toml", overrides)

    return read


def refusal(read: Any, *given: str) -> str:
    """The one sentence that refuses a file."""
    with pytest.raises(ProblemFileError) as raised:
        read(*given)
    assert len(raised.value.problems) == 1, raised.value.problems
    return raised.value.problems[0]


def renamed(urdf: str, names: Mapping[str, str]) -> str:
    """The URDF with links of other names."""
    for old, new in names.items():
        for word in ("link name", "parent link", "child link"):
            urdf = urdf.replace(f'{word}="{old}"', f'{word}="{new}"')
    return urdf


def test_a_link_may_have_the_name_of_a_joint(read: Any) -> None:
    """The thigh is called as its joint, the foot as the knee: the same leg."""
    plain = read(robot())
    twice = read(renamed(robot(), {"thigh": "hip", "shank": "sole", "foot": "knee"}), "", 'leg.foot_frame="knee"')
    assert list(twice.leg.link.values()) == list(plain.leg.link.values())
    assert twice.leg.joint == plain.leg.joint
    assert plain.leg.link["shank"].length == pytest.approx(0.25, abs=1e-15)


MIMIC = '<mimic joint="{}"/>'
FINGER = link("finger", inertial("0 0 0", 0.2, 1e-4, 1e-4, 1e-4))


def test_a_finger_that_mimics_another_one_is_locked_like_any_other(read: Any) -> None:
    tip = link("tip", inertial("0 0 0", 0.1, 1e-4, 1e-4, 1e-4))
    hand = FINGER + joint("curl", "body", "finger") + tip
    leg = read(robot(hand + joint("tip_curl", "finger", "tip", inside=LIMIT + MIMIC.format("curl")))).leg
    assert leg.body.mass == pytest.approx(4.3, abs=1e-12)


def test_a_joint_that_mimics_is_left_out_of_the_joints_of_a_leg_and_follows_none_from_beside_it(read: Any) -> None:
    knee = joint("knee", "thigh", "shank", "0 0 -0.2", inside=LIMIT + MIMIC.format("hip"))
    assert 'joint "knee" mimics "hip": leave it out of leg.joints' in refusal(read, robot(knee=knee))
    rod = FINGER + joint("rod", "thigh", "finger", inside=LIMIT + MIMIC.format("knee"))
    assert 'joint "rod" mimics "knee" of the leg' in refusal(read, robot(rod))


def drives(leg: Any) -> list[tuple[float, float]]:
    """(torque at standstill, speed at no torque) of each motor."""
    return [(leg.drive(j, "motor", "max_torque")[1], leg.drive(j, "motor", "max_speed")[1]) for j in leg.joints]


@pytest.mark.parametrize(
    ("lines", "expected"),
    [
        ("motor.rotor_inertia = 1e-5", [(40, 20), (60, 20)]),
        ('motor.laws = ["four-quadrant"]', [(40, 20), (60, 20)]),
        ("gear.efficiency = 0.9", [(40, 20), (60, 20)]),
        ("gear.ratio = 10\nmotor.rotor_inertia = 1e-5", [(4, 200), (6, 200)]),
        ("motor.max_torque = 50", [(50, 20), (50, 20)]),
        ("motor.max_speed = 15", [(40, 15), (60, 15)]),
        ("motor.max_speed = 15\nknee.motor.max_speed = 12", [(40, 15), (60, 12)]),
        ("hip.motor.max_speed = 12\nhip.gear.ratio = 2", [(20, 12), (60, 20)]),
    ],
)
def test_what_a_file_does_not_state_of_its_drives_comes_from_the_urdf(
    lines: str, expected: list[tuple[float, float]], read: Any
) -> None:
    assert drives(read(robot(), lines).leg) == expected


def test_a_rotor_alone_changes_nothing_else(read: Any) -> None:
    with_rotor, without = (read(robot(), lines).leg for lines in ("motor.rotor_inertia = 1e-5", ""))
    assert with_rotor.drive("knee", "motor", "rotor_inertia")[1] == 1e-5
    assert with_rotor.model_copy(update={"motor": without.motor}) == without


@pytest.mark.parametrize(
    ("limit", "lines", "words"),
    [
        ('velocity="20"', "motor.rotor_inertia = 1e-5", "leg.knee.motor.max_speed is missing, and leg.urdf states no usable velocity"),
        ('effort="40"', "motor.max_speed = 9.0", "leg.knee.motor.max_torque is missing, and leg.urdf states no usable effort of knee"),
    ],
)  # fmt: skip
def test_a_drive_that_neither_states_is_asked_for(limit: str, lines: str, words: str, read: Any) -> None:
    knee = joint("knee", "thigh", "shank", "0 0 -0.2", inside=LIMIT.replace(limit, ""))
    assert words in refusal(read, robot(knee=knee), lines)
    entry = words.split()[0]
    assert drives(read(robot(knee=knee), lines, f"{entry}=30.0").leg)[1][entry.endswith("max_speed")] == 30


def test_drives_of_which_the_urdf_knows_nothing(read: Any) -> None:
    limit = '<limit lower="-2" upper="2"/>'
    bare = robot(hip=joint("hip", "body", "thigh", inside=limit), knee=joint("knee", "thigh", "shank", "0 0 -0.2", inside=limit))  # fmt: skip
    own = [f"{j}.motor = {{max_torque = {t}, max_speed = 9.0}}" for j, t in (("hip", 30.0), ("knee", 20.0))]
    assert "leg.knee.motor is missing, and leg.urdf states no usable effort and velocity" in refusal(read, bare, own[0])
    assert drives(read(bare, "\n".join(own)).leg) == [(30, 9), (20, 9)]
    assert drives(read(bare, "motor.max_torque = 2.0\nmotor.max_speed = 100.0").leg) == [(2, 100), (2, 100)]


def test_a_continuous_joint_takes_its_limits_from_the_problem(read: Any) -> None:
    turning = robot(knee=joint("knee", "thigh", "shank", "0 0 -0.2", "continuous", LIMIT.replace("40", "60")))
    said = refusal(read, turning)
    assert "leg.knee is of type continuous in leg.urdf" in said
    assert said.endswith("give leg.knee.lower and leg.knee.upper [rad].")
    assert "give leg.knee.upper [rad]." in refusal(read, turning, "knee.lower = -2.0")
    assert read(turning, "knee = {lower = -2.0, upper = 2.0}") == read(robot())


def test_a_foot_point_lies_in_the_frame_of_the_foot(read: Any) -> None:
    """The foot link turned by 90 degrees about y: its x is down, its z is forward."""
    sole = PARTS["sole"].replace('"0 0 -0.25"', '"0 0 -0.25" rpy="0 1.5707963267948966 0"')
    at = read(robot(sole=sole), "foot_point = [0.04, 0.0, 0.12]").leg.link["shank"]
    np.testing.assert_allclose(np.array(at.direction) * at.length, [0.12, 0, -0.29], atol=1e-15)
    plain = read(robot()).leg.link["shank"]
    assert (at.mass, at.com_position, at.inertia_tensor) == (plain.mass, plain.com_position, plain.inertia_tensor)


@pytest.mark.parametrize("value", ["[0.1, 0.0]", "0.1", "[0.1, 0.0, nan]", '["a", 0.0, 0.0]', "[120.0, 0.0, 0.0]"])
def test_what_is_no_foot_point_is_refused(value: str, read: Any) -> None:
    said = refusal(read, robot(), f"foot_point = {value}")
    assert "leg.foot_point = " in said
    assert "three numbers from -3 to 3 m are needed, in the frame of foot, such as [0.12, 0.0, -0.04]" in said


def test_a_foot_point_needs_a_urdf() -> None:
    with pytest.raises(ProblemFileError, match=r"leg\.foot_point has a meaning only beside leg\.urdf"):
        load("paper", ["leg.foot_point=[0.0, 0.0, 0.0]"])


def test_a_foot_that_lies_at_its_joint_needs_a_point(read: Any) -> None:
    said = refusal(read, robot(), "", 'leg.foot_frame="shank"')
    assert said.endswith("leg.foot_frame lies 0 m from joint knee, and a link needs 0.01 m: give leg.foot_point, in the frame of that link [m].")  # fmt: skip
    assert read(robot(), "foot_point = [0.0, 0.0, -0.25]", 'leg.foot_frame="shank"') == read(robot())


def test_joints_that_meet_in_a_point_are_named(read: Any) -> None:
    said = refusal(read, robot(knee=joint("knee", "thigh", "shank")))
    assert said.endswith(
        "leg.joints has hip and knee 0 m apart, and a link needs 0.01 m: leave one out, which locks it."
    )


SOLE = link("foot", inertial("0.05 0 -0.03", 0.2, 1e-4, 2e-4, 2e-4))
ANKLE = PARTS["sole"].replace('"fixed"', '"revolute"').replace("</joint>", f'<axis xyz="0 -1 0"/>{LIMIT}</joint>')


def test_a_short_sole_may_have_its_mass_beside_its_line(read: Any) -> None:
    """The ankle 15 mm above the ground, the foot's centre of mass 58 mm ahead of it: a humanoid's foot, and no hint."""
    design = read(robot(sole=ANKLE, foot=SOLE), "foot_point = [0.0, 0.0, -0.015]", 'leg.joints=["hip", "knee", "sole"]', "start.joint_angles=[0.5, -1.0, 0.5]")  # fmt: skip
    assert design.leg.link["foot"].com_position == (0.05, 0.0, -0.03)
    assert not [words for words in hints(design) if "com_position" in words]


def test_a_mass_far_from_a_short_link_is_doubted_and_one_beyond_the_leg_refused(read: Any) -> None:
    def with_mass_at(x: str) -> Any:
        given = robot(sole=ANKLE, foot=SOLE.replace("0.05 0 -0.03", f"{x} 0 -0.03"))
        return given, "foot_point = [0.0, 0.0, -0.015]", 'leg.joints=["hip", "knee", "sole"]', "start.joint_angles=[0.5, -1.0, 0.5]"  # fmt: skip

    assert any(
        "leg.foot.com_position is 0.301 m from the joint, 20.1 times" in x for x in hints(read(*with_mass_at("0.3")))
    )
    said = refusal(read, *with_mass_at("0.5"))
    assert "leg.foot.com_position = [0.5, 0.0, -0.03] m is further from the joint than the whole leg is long" in said


def test_what_is_fixed_to_a_link_is_part_of_it(read: Any) -> None:
    """A motor fixed to the thigh, turned: mass, centre of mass and tensor by the parallel axis theorem."""
    at, moments = np.array([0.03, 0.01, -0.15]), np.array([1e-3, 2e-3, 3e-3])
    motor = link("motor", inertial("0 0 0", 0.6, *moments))
    fixed = joint("bolts", "thigh", "motor", " ".join(map(str, at)), "fixed", "")
    turned = fixed.replace("/></joint>", ' rpy="1.5707963267948966 0 0"/></joint>')
    thigh = read(robot(motor + turned)).leg.link["thigh"]
    com = (np.array([0, 0, -0.1]) + 0.6 * at) / 1.6
    own, other = np.diag([0.004, 0.004, 0.001]), np.diag(moments[[0, 2, 1]])
    tensor = np.sum(
        [
            inertia + mass * (r @ r * np.eye(3) - np.outer(r, r))
            for mass, r, inertia in ((1.0, [0, 0, -0.1] - com, own), (0.6, at - com, other))
        ],
        axis=0,
    )
    assert thigh.mass == pytest.approx(1.6, abs=1e-14)
    np.testing.assert_allclose(thigh.com_position, com, atol=1e-14)
    np.testing.assert_allclose(thigh.inertia_tensor, [tensor[i] for i in PAIRS], atol=1e-14)


def test_an_axis_counts_as_it_lies_in_the_robot(read: Any) -> None:
    """A knee whose frame is turned, so that its axis is the robot's -y all the same; and one that is really tilted."""
    quarter = 'origin xyz="0 0 -0.2" rpy="1.5707963267948966 0 0"/><axis xyz="0 0 1"'
    knee = PARTS["knee"].replace('origin xyz="0 0 -0.2"/><axis xyz="0 -1 0"', quarter)
    back = PARTS["sole"].replace('xyz="0 0 -0.25"', 'xyz="0 -0.25 0" rpy="-1.5707963267948966 0 0"')
    shank = link("shank", inertial("0 -0.1 0", 0.5, 0.002, 0.0005, 0.002))
    assert knee != PARTS["knee"]
    turned, plain = read(robot(knee=knee, sole=back, shank=shank)).leg, read(robot()).leg
    np.testing.assert_allclose(turned.joint["knee"].axis, plain.joint["knee"].axis, atol=1e-12)
    for one, other in zip(turned.link.values(), plain.link.values(), strict=True):
        np.testing.assert_allclose(one.direction, other.direction, atol=1e-12)
        np.testing.assert_allclose(one.com_position, other.com_position, atol=1e-12)
        np.testing.assert_allclose(one.inertia_tensor, other.inertia_tensor, atol=1e-12)
    tilted = read(robot(knee=PARTS["knee"].replace('axis xyz="0 -1 0"', 'axis xyz="3 -4 0"'))).leg
    np.testing.assert_allclose(tilted.joint["knee"].axis, [0.6, -0.8, 0], atol=1e-15)


def test_a_robot_with_another_axis_up_is_told_to_be_turned(read: Any) -> None:
    """Every joint turns about z, as in a file with y up, until a fixed joint above the body turns the whole robot."""
    up = {name: PARTS[name].replace('axis xyz="0 -1 0"', 'axis xyz="0 0 1"') for name in ("hip", "knee")}
    said = refusal(read, robot(**up))
    assert "leg.joints turn about the vertical of leg.urdf, and so lift nothing: a robot stands with z up" in said
    turned = joint("turn", "world", "body", kind="fixed", inside="").replace(
        'xyz="0 0 0"', 'xyz="0 0 0" rpy="1.5707963 0 0"'
    )
    leg = read(robot(link("world") + turned, **up)).leg
    np.testing.assert_allclose(leg.joint["hip"].axis, [0, -1, 0], atol=1e-7)


@pytest.mark.parametrize("kind", ["fixed", "floating"])
@pytest.mark.parametrize("name", ["root_joint", "base"])
def test_a_body_may_hang_on_the_world(kind: str, name: str, read: Any) -> None:
    hung = link("world") + joint(name, "world", "body", "1 2 3", kind, "")
    one, other = read(robot(hung)).leg, read(robot()).leg
    assert physical_parameters(one) == pytest.approx(physical_parameters(other), rel=1e-12)
    assert one.joint == other.joint


def test_a_joint_called_as_the_world_of_pinocchio_is_refused(read: Any) -> None:
    """Its links would otherwise be lumped into the world, and their mass be lost."""
    hung = link("world") + joint("universe", "world", "body", kind="fixed", inside="")
    assert 'joint "universe" has the name that Pinocchio gives the world' in refusal(read, robot(hung))


def test_a_robot_in_two_pieces_is_refused(read: Any) -> None:
    assert "has 2 links without a parent (body, finger): a robot is one tree" in refusal(read, robot(FINGER))


DATASHEET = "{voltage = 24.0, torque_constant = 0.5, winding_resistance = 0.4}"


def test_a_datasheet_counts_over_the_urdf(read: Any) -> None:
    """Stall torque 0.5 * 24 / 0.4 = 30 N m, no-load speed 24 / 0.5 = 48 rad/s; the knee without one keeps its own."""
    for_all = read(robot(), f"motor = {DATASHEET}").leg
    assert [rated(for_all, name) for name in for_all.joints] == [pytest.approx((30, 48), rel=1e-15)] * 2
    hip = read(robot(), f"hip.motor = {DATASHEET}").leg
    assert [rated(hip, name) for name in hip.joints] == [pytest.approx((30, 48), rel=1e-15), (60, 20)]
    fed = read(robot(), f"supply.voltage = 24.0\nknee.motor = {DATASHEET.replace('voltage = 24.0, ', '')}").leg
    assert [rated(fed, name) for name in fed.joints] == [(40, 20), pytest.approx((30, 48), rel=1e-15)]


def test_legs_that_share_the_body_carry_equal_parts_of_it(read: Any) -> None:
    """A robot of two legs, 4 + 2 (1 + 0.5) kg: each has 2 kg of the body, and its supply feeds both."""
    other = "".join(
        link(f"{name}2", inertial("0 0 -0.1", mass, *[mass / 100] * 3))
        + joint(f"{above}_{name}", above, f"{name}2", "0 0 -0.2")
        for above, name, mass in (("body", "thigh", 1.0), ("thigh2", "shank", 0.5))
    )
    alone, shared = read(robot(other)).leg, read(robot(other), "body.legs = 2\nsupply.voltage = 24.0").leg
    assert (alone.body.mass, alone.body.legs, alone.supply) == (pytest.approx(5.5, abs=1e-12), 1, None)
    assert (shared.body.mass, shared.body.legs) == (pytest.approx(2.0, abs=1e-12), 2)
    assert shared.supply
    assert shared.supply.legs == 2
    fed = read(robot(other), "body.legs = 2\nsupply = {voltage = 24.0, legs = 1}").leg.supply
    assert fed
    assert fed.legs == 1
    assert read(robot(other), "body = {legs = 2, mass = 3.0}").leg.body.mass == 3
    for wrong, needed in (
        ("2.5", "a whole number of legs"),
        ("1" + "0" * 400, "a number from 1 to 100"),
        ("inf", "a number from 1 to 100"),
    ):
        with pytest.raises(ProblemFileError, match=rf"leg\.body\.legs = .*: {needed} is needed"):
            read(robot(other), f"body.legs = {wrong}")
    assert "leg.body.legs = 5 leaves no body: 5 legs of 1.5 kg weigh more than the robot of 7 kg" in refusal(read, robot(other), "body.legs = 5")  # fmt: skip
