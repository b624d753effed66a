"""What the URDFs of real robots have beside a leg: names used twice, joints that mimic, limits that are not there."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from hopopt import load
from hopopt.design import Design
from hopopt.errors import ProblemFileError

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


def test_a_joint_of_the_leg_mimics_none_and_is_mimicked_by_none(read: Any) -> None:
    knee = joint("knee", "thigh", "shank", "0 0 -0.2", inside=LIMIT + MIMIC.format("hip"))
    assert 'joint "knee" mimics another one' in refusal(read, robot(knee=knee))
    rod = FINGER + joint("rod", "thigh", "finger", inside=LIMIT + MIMIC.format("knee"))
    assert 'joint "rod" mimics "knee" of the leg' in refusal(read, robot(rod))
