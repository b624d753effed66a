"""Slips a user makes, planted one at a time: each is named with its entry, its value, and what to try.

Most are refused when the file is read. Values that a leg may have are not: they get a hint, and where no hop is found
the limits that cannot hold together are named.
"""

import re
from collections.abc import Callable
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

import hopopt as ho
from hopopt.cli.main import run
from hopopt.errors import NotSolvedError, ProblemFileError
from hopopt.leg.dynamics import LegDynamics
from hopopt.leg.kinematics import start_angles
from hopopt.leg.robot import build_robot
from hopopt.ocp.guesses.feasibility import (
    drives_too_weak,
    holding_torques,
    joints_without_inertia,
    strength,
)
from hopopt.problem.checking.doubts import doubts
from hopopt.problem.checking.hints import hints
from hopopt.problem.load import builtin_names, load, template

pytestmark = pytest.mark.filterwarnings("error")
Planted = Callable[..., Path]


@pytest.fixture
def planted(tmp_path: Path) -> Planted:
    """Writes the paper's problem with faults planted: (text of a line's beginning, what it is to be)."""

    def planted(*edits: tuple[str, str]) -> Path:
        text = template("mine")
        for old, new in edits:
            assert text.count(old) == 1, old
            text = text.replace(old, new)
        path = tmp_path / "mine.toml"
        path.write_text(text, encoding="utf-8")
        return path

    return planted


# ---- refused when the file is read: entry, value, what is needed, what to try ------------------------------------

REFUSED = {
    "a length in millimetres": (
        ("length = 0.38 ", "length = 380 "),
        "leg.thigh.length = 380 m is too large: a number from 0.01 to 3 m is needed; 380 looks like millimetres: write 0.38.",
    ),
    "an angle in degrees": (
        ("lower = -2.4 ", "lower = -137.5 "),
        "leg.knee.lower = -137.5 rad is too small: a number from -7 to 7 rad is needed; -137.5 looks like degrees: "
        "write -2.39983.",
    ),
    "a mass in grams": (
        ("mass = 1.87", "mass = 1870"),
        "leg.thigh.mass = 1870 kg is too large: a number from 0.0001 to 200 kg is needed; 1870 looks like grams: write 1.87.",
    ),
    "a motor's speed in rpm": (
        ("max_speed = 1256.637", "max_speed = 12000"),
        "leg.motor.max_speed = 12000 rad/s is too large: a number from 1 to 6000 rad/s is needed; 12000 looks like rpm: "
        "write 1256.64.",
    ),
    "a gear's ratio the other way round": (
        ("ratio = 100 ", "ratio = 0.01 "),
        "leg.gear.ratio = 0.01 is too small: a number from 1 to 1000 is needed; 0.01 looks like 1/100: write 100.",
    ),
    "joint limits exchanged": (
        ("lower = -0.6 ", "lower = 1.4 "),
        "leg.hip.lower = 1.4 rad is not below leg.hip.upper = 1.3 rad: exchange or widen them.",
    ),
    "a start outside of the joint limits": (
        ("hip_height = 0.28 ", "joint_angles = [1.12, 0.5] "),
        "start.joint_angles[1] = 0.5 rad is outside the limits of knee: a number from leg.knee.lower = -2.4 to "
        "leg.knee.upper = -0.15 rad is needed.",
    ),
    "a hip height out of reach": (
        ("hip_height = 0.28 ", "hip_height = 0.8 "),
        "start.hip_height = 0.8 m with start.foot_x = 0.0 m is not possible: the leg reaches from 0.019 to 0.741 m; with this "
        "foot_x choose it from 0.270 to 0.738 m.",
    ),
    "an inertia in g cm^2": (
        ("rotor_inertia = 1.19e-5", "rotor_inertia = 119"),
        "leg.motor.rotor_inertia = 119 kg m^2 is too large: a number from 0 to 0.05 kg m^2 is needed; 119 looks like g cm^2: "
        "write 1.19e-05, or like kg cm^2: write 0.0119.",
    ),
    "an efficiency in per cent": (
        ("# efficiency = 0.7 ", "efficiency = 70 "),
        "leg.gear.efficiency = 70 is too large: a number from 0.05 to 1 is needed; 70 looks like per cent: write 0.7.",
    ),
    "a friction coefficient in per cent": (
        ("# friction = 0.8 ", "friction = 80 "),
        "contact.friction = 80 is too large: a number from 0 to 10 is needed; 80 looks like per cent: write 0.8.",
    ),
    "a shortest stance above the longest": (
        ("stance_duration = [0.03, 0.4]", "stance_duration = [0.4, 0.03]"),
        "hop.stance_duration = [0.4, 0.03] s begins above its end: write [shortest, longest].",
    ),
    "a stance in milliseconds": (
        ("stance_duration = [0.03, 0.4]", "stance_duration = [0.03, 400]"),
        "hop.stance_duration[1] = 400 s is too large: a list of two numbers, each from 0.001 to 10 s, is needed; 400 looks "
        "like milliseconds: write 0.4.",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_refused(name: str, planted: Planted, capsys: pytest.CaptureFixture[str]) -> None:
    edit, sentence = REFUSED[name]
    path = planted(edit)
    with pytest.raises(ProblemFileError) as raised:
        load(path)
    assert raised.value.problems == [f"{path}: {sentence}"]
    assert run(["solve", str(path)]) == 2  # wrong usage, in a sentence, no traceback
    assert capsys.readouterr().err == f"hopopt: {path}: {sentence}\n"


# ---- possible, and probably not meant: a hint ------------------------------------------------------------------

HINTED = {
    "a small motor's speed in rpm": (
        ("max_speed = 1256.637", "max_speed = 4000"),
        "hint: leg.motor.max_speed = 4000 rad/s is 38197 rpm; if rpm were meant, write 418.9",
    ),
    "the joint's speed for the motor's": (
        ("max_speed = 1256.637", "max_speed = 12.57"),
        "hint: leg.motor.max_speed = 12.57 rad/s behind a gear of 100 turns the hip at 0.13 rad/s at most: the motor's own "
        "speed is needed, in rad/s",
    ),
    "a small angle in degrees": (
        ("upper = 1.3 ", "upper = 5 "),
        "hint: leg.hip.upper = 5 rad is 286 degrees; if degrees were meant, write 0.08727",
    ),
    "a small mass in grams": (
        ("mass = 0.8 ", "mass = 80 "),
        "hint: leg.shank.mass = 80 kg is 14.3 times leg.body.mass = 5.6 kg; if grams were meant, write 0.08",
    ),
    "a rotor's inertia in kg cm^2": (
        ("rotor_inertia = 1.19e-5", "rotor_inertia = 0.0119"),
        "hint: leg.motor.rotor_inertia = 0.0119 kg m^2 is 119 kg m^2 at the hip behind its gear of 100, more than the whole "
        "machine on the end of the leg has (4.54 kg m^2): 1 g cm^2 is 1e-7 kg m^2",
    ),
    "a link's inertia in kg cm^2": (
        ("# inertia = 0.0225 ", "inertia = 22.5 "),
        "hint: leg.thigh.inertia = 22.5 kg m^2 is more than all its mass has at the length of the link (0.27 kg m^2); if kg cm^2 "
        "were meant, write 0.00225",
    ),
    "a friction of zero for none": (
        ("# friction = 0.8 ", "friction = 0 "),
        "hint: contact.friction = 0 is slipperier than ice (0.05): leave the line out for a foot that never slips, or give 0.5 "
        "to 1 for rubber on a floor",
    ),
    "a stance far too short": (
        ("stance_duration = [0.03, 0.4]", "stance_duration = [0.001, 0.0012]"),
        "hint: hop.stance_duration allows 0.0012 s at most: a push-off takes 0.05 to 0.5 s",
    ),
}

SMALL = {  # 2.55 kg
    "leg.body.mass": 1.8, "leg.thigh.length": 0.18, "leg.thigh.mass": 0.6, "leg.shank.length": 0.17,
    "leg.shank.mass": 0.15, "leg.motor.rotor_inertia": 2.4e-5, "leg.gear.ratio": 6, "start.hip_height": 0.22,
    "leg.hip.lower": -1, "leg.hip.upper": 1.5, "leg.knee.upper": -0.2,
}  # fmt: skip


def test_a_datasheets_values_behind_the_gear_are_doubted() -> None:
    """9 N m and 44 rad/s at the output of a gear of 6; in front of it they are 1.5 N m and 264 rad/s."""
    in_front = {"leg.motor.max_torque": 1.5, "leg.motor.max_speed": 264.0}
    assert hints(load("paper", SMALL | in_front)) == []
    (said,) = hints(load("paper", SMALL | {"leg.motor.max_torque": 9.0, "leg.motor.max_speed": 44.0}))
    assert said == (
        "hint: far outside what legs have: the hip has 54 N m at standstill, 6.2 times weight times leg length (legs have less "
        "than 5): look at leg.motor.max_torque = 9 N m and leg.gear.ratio = 6; the hip turns at 7.33 rad/s without load, 1.4 sqrt(gravity / "
        "leg length) (legs have 2 to 25): look at leg.motor.max_speed = 44 rad/s and leg.gear.ratio = 6; torque and speed are "
        "needed in front of the gear, and a datasheet may state them behind it"
    )


@pytest.mark.parametrize(
    ("entry", "value", "words"),
    [
        ("leg.motor.max_torque", 0.2, "the drives hold 0.72 weights on the foot, less than the leg's own"),
        ("leg.motor.max_speed", 6000, "the hip turns at 100 rad/s without load"),
        ("leg.motor.rotor_inertia", 4e-5, "the rotor of the knee has 11.5 times the inertia of its links"),
    ],
)
def test_a_number_far_outside_what_legs_have_is_doubted(entry: str, value: float, words: str) -> None:
    said = doubts(load("paper", {"leg.gear.ratio": 60} | {entry: value} if "speed" in entry else {entry: value}))[0]
    assert words in said
    assert f"look at {entry} = {value:g}" in said


@pytest.mark.parametrize("name", HINTED)
def test_hinted(name: str, planted: Planted) -> None:
    edit, sentence = HINTED[name]
    assert hints(load(planted(edit))) == [sentence]


@pytest.mark.parametrize("name", builtin_names())
def test_no_hint_where_nothing_is_wrong(name: str) -> None:
    assert hints(load(name)) == []


def test_a_hint_is_said_before_the_solve_and_kept_with_the_answer(planted: Planted, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:  # fmt: skip
    edit, sentence = HINTED["a small motor's speed in rpm"]
    path = str(planted(edit, ("refine = true", "refine = false")))
    run(["solve", path, "--starts", "1", "--no-figures", "--results", str(tmp_path / "results")])
    shown = capsys.readouterr()
    assert shown.err == f"hopopt: {sentence}\n"
    assert sentence in shown.out


# ---- no hop to be found: the diagnosis names the culprit ---------------------------------------------------------


def diagnosis(*edits: str, objective: str = "clearance") -> list[str]:
    """What is reported of the paper's leg with entries changed, where no hop is found."""
    design = load("paper", list(edits))
    with pytest.raises(NotSolvedError) as raised:
        ho.solve(design, objective, starts=1, processes=1)
    return raised.value.diagnosis


def test_a_torque_too_small_to_carry_the_leg() -> None:
    """Statics: the whole weight acts on the foot and the shank's on its middle, at the knee's distance from the plumb line
    through hip and foot, and half of it."""
    sentence, *more = diagnosis("leg.motor.max_torque=0.2")
    assert any(words.startswith("These cannot hold together: the knee's drive in stance") for words in more)
    thigh, shank, height, g = 0.38, 0.361, 0.28, 9.81
    along = (thigh**2 - shank**2 + height**2) / (2 * height)  # law of cosines
    lever = np.sqrt(thigh**2 - along**2)
    needed = g * ((5.6 + 1.87 + 0.8) * lever - 0.8 * lever / 2)
    assert f"the knee needs {needed:.1f} N m to hold the start pose in stance at 0 s" in sentence
    assert "its drive gives 20.0 N m (leg.motor.max_torque = 0.2 and leg.gear.ratio = 100, for 81 N)" in sentence
    assert "a stronger motor, a higher gear ratio, a lighter leg.body.mass or a higher start" in sentence


@pytest.mark.parametrize("entries", [{}, {"environment.slope": 0.2}])
def test_torques_that_hold_the_start_pose(entries: dict[str, float]) -> None:
    """Pinocchio's gravity carried by the foot is what the planner's equations of motion give at rest."""
    design = load("paper", entries)
    robot, symbols = build_robot(design.leg), [ca.SX.sym(name, 2) for name in "qva"]
    tau = LegDynamics(robot, robot.parameters).stance(*symbols).tau
    planned = np.array(ca.Function("hold", symbols, [tau])(start_angles(design), 0, 0)).ravel()
    hold = holding_torques(design, robot)
    assert hold == pytest.approx(planned, rel=1e-12)
    assert strength(design, robot) == pytest.approx(200.0 / abs(hold).max())  # 2 N m by a gear of 100


@pytest.mark.slow
def test_a_leg_that_cannot_stand_may_hop() -> None:
    """Its foot is on the ground, its body free to move along: it leaves the pose that it cannot hold."""
    design = load("paper", ["leg.motor.max_torque=0.25"])
    assert drives_too_weak(design, build_robot(design.leg))
    assert ho.solve(design, starts=1, processes=1).verified


def test_a_rod_that_turns_about_itself() -> None:
    """A thin rod has no inertia about itself; its rotor's, if it has one, is all that resists."""
    twisted = ("leg.knee.axis=[0, 0, 1]", "leg.knee.lower=-1", "leg.knee.upper=1", "start.joint_angles=[0.3, 0]")
    for rotor in (0.0, 1e-6):
        design = load("paper", [*twisted, f"leg.motor.rotor_inertia={rotor}"])
        found = joints_without_inertia(design, build_robot(design.leg))
        assert bool(found) == (rotor == 0)
    with pytest.raises(NotSolvedError) as raised:
        ho.solve(load("paper", [*twisted, "leg.motor.rotor_inertia=0"]), starts=1, processes=1)
    (sentence,) = raised.value.diagnosis
    assert sentence.startswith("nothing resists the knee in the start pose at 0 s")
    assert "leg.motor.rotor_inertia = 0 kg m^2" in sentence


def test_small_and_light_is_not_without_inertia() -> None:
    """A leg of grams below a body of a tonne, without rotors."""
    light = ("leg.motor.rotor_inertia=0", "leg.body.mass=1000", "leg.shank.mass=1e-4", "leg.shank.length=0.01")
    pose = ("leg.thigh.mass=1e-4", "start.hip_height=0.385", "leg.knee.upper=0", "leg.knee.lower=-3")
    design = load("paper", [*light, *pose])
    assert not any("nothing resists" in fault for fault in joints_without_inertia(design, build_robot(design.leg)))


def test_all_joints_without_inertia_are_named() -> None:
    twisted = [
        f"leg.{joint}.{entry}" for joint in ("hip", "knee") for entry in ("axis=[0, 0, 1]", "lower=-1", "upper=1")
    ]
    design = load("paper", [*twisted, "start.joint_angles=[0, 0]", "leg.motor.rotor_inertia=0"])
    (sentence,) = joints_without_inertia(design, build_robot(design.leg))
    assert sentence.startswith("nothing resists the hip and the knee in")


@pytest.mark.parametrize(
    ("entries", "said"),
    [
        (
            ["leg.gear.torque_cap=15"],
            "15.0 N m (leg.gear.torque_cap = 15, for 81 N): a higher leg.gear.torque_cap, a lighter",
        ),
        (
            ["leg.motor.torque_cap=0.15"],
            "15.0 N m (leg.motor.torque_cap = 0.15 and leg.gear.ratio = 100, for 81 N): a higher leg.motor.torque_cap, "
            "a higher gear ratio, a lighter",
        ),
        (
            ["leg.gear.torque_cap=25", "leg.motor.max_torque=0.2"],
            "20.0 N m (leg.motor.max_torque = 0.2 and leg.gear.ratio",
        ),
        (["leg.gear.torque_cap=50", "leg.knee.gear.torque_cap=15"], "15.0 N m (leg.knee.gear.torque_cap = 15, for"),
    ],
)
def test_the_limit_that_binds_is_named(entries: list[str], said: str) -> None:
    design = load("paper", entries)
    (sentence,) = drives_too_weak(design, build_robot(design.leg))
    assert f"its drive gives {said}" in sentence


def test_a_body_in_grams() -> None:
    first, second, *_ = diagnosis("leg.body.mass=560")
    assert "its drive gives 200.0 N m" in first
    assert second.startswith("hint: leg.body.mass = 560 kg on a leg that reaches 0.741 m: is it in kg")


@pytest.mark.slow
def test_a_stance_too_short_for_the_clearance_asked_for() -> None:
    """The loosest way out is the clearance that the same stance reaches at most, which is solved for on its own."""
    short = ["hop.stance_duration=[0.01, 0.02]", "solver.refine=false"]
    said = diagnosis(*short, "hop.clearance=0.4", "solver.max_iterations=60", objective="energy")
    assert said[0].startswith("These cannot hold together: the clearance asked for (hop.clearance = 0.4); ")
    assert "longest stance (hop.stance_duration = [0.01, 0.02])" in said[0]
    (amount,) = re.findall(r"^Loosest way out: the clearance asked for, loosened by ([0-9.]+) m\.$", said[1])
    highest = ho.solve(load("paper", short), starts=1, processes=1).summary.objective_value
    assert 0.4 - float(amount) == pytest.approx(highest, abs=1e-3)
    assert said[2].startswith("What would help most: less hop.clearance, more leg.motor.max_torque")


def test_a_foot_window_out_of_reach() -> None:
    """The leg starts with its foot far ahead of the hip and its joints never bring it back: at the limits of hip and
    knee the foot is 0.38 sin 0.8 - 0.361 sin 0.4 ahead, 0.02 is allowed."""
    said = diagnosis(
        "hop.foot_window=0.02", "leg.hip.lower=0.8", "leg.knee.lower=-1.2", "start.joint_angles=[1.2, -1.0]"
    )
    assert said[0].startswith(
        "These cannot hold together: the foot within its window at the apex (hop.foot_window = 0.02)"
    )
    assert "lower limit of the hip in flight (leg.hip.lower = 0.8)" in said[0]
    assert "lower limit of the knee in flight (leg.knee.lower = -1.2)" in said[0]
    assert said[1] == "Loosest way out: the foot within its window at the apex, loosened by 0.112 m."


@pytest.mark.slow
def test_a_motor_too_slow_to_lift_off() -> None:
    said = diagnosis("leg.motor.max_speed=12")
    assert said[0].startswith("hint: leg.motor.max_speed = 12 rad/s behind a gear of 100")
    assert "shortest flight (hop.flight_duration = [0.03, 1])" in said[1]
    assert "more leg.motor.max_speed" in said[3]
    assert "less leg.gear.ratio" in said[3]


@pytest.mark.slow
def test_a_rotor_that_cannot_be_turned() -> None:
    said = diagnosis("leg.motor.rotor_inertia=0.0119")
    assert "leg.motor.rotor_inertia = 0.0119 kg m^2" in said[0]
    assert "less leg.motor.rotor_inertia" in said[3]


def test_a_ground_force_that_no_drive_can_give() -> None:
    said = diagnosis("contact.least_force=5000")
    assert "the least vertical ground force in stance (contact.least_force = 5000)" in said[0]
    assert "the knee's drive in stance" in said[0]
    assert "the knee's drive in stance stronger by" in said[1]
