"""Legs whose joints slide: pogo legs against closed forms, a telescope against Pinocchio and MuJoCo, and what is refused."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest

from hopopt.api.solution import Solution
from hopopt.cli.main import run
from hopopt.cli.screen.motion import spring_lines
from hopopt.control.setting import Setting
from hopopt.control.strategies import Force
from hopopt.design import Design
from hopopt.drivetrain.motor import rated
from hopopt.errors import ProblemFileError, UsageError
from hopopt.leg.derived import derived
from hopopt.leg.dynamics import LegDynamics
from hopopt.leg.files.export import to_mjcf, to_urdf
from hopopt.leg.geometry.above import height_rows
from hopopt.leg.kinematics import foot_jacobian, joint_positions
from hopopt.leg.robot import BASE, build_robot
from hopopt.ocp.hops.shared_control import with_torque_constants
from hopopt.planner.reserve import reserved
from hopopt.planner.solve import solve
from hopopt.problem.checking.doubts import doubts
from hopopt.problem.load import load, rows
from hopopt.problem.render import unit_at
from hopopt.sim import mujoco
from hopopt.sim.machine import Machine
from hopopt.studies.choose.run import choose
from hopopt.studies.consistency import direction
from hopopt.studies.sensitivity import drive_entries, sensitivity
from hopopt.verify.springs.energy import SpringEnergy

FORCE, STROKE, BODY, G = 200.0, 0.3, 5.0, 9.81
POGO = f"""
name = "pogo"
[leg]
joints = ["slide"]
links = ["rod"]
body.mass = {BODY}
rod = {{length = 0.3, mass = 0.5, com = 0.0}}
[leg.slide]
type = "prismatic"
lower = 0.0
upper = {STROKE}
motor = {{max_force = {FORCE}, max_velocity = 90.0, force_cap = {FORCE}, laws = []}}
gear.speed_cap = 50.0
[start]
joint_angles = [0.0]
[solver]
starts = 1
"""
TELESCOPE = """
name = "telescope"
[leg]
joints = ["hip", "slide"]
links = ["tube", "rod"]
body.mass = 4.0
motor = {max_torque = 1.0, max_speed = 400.0, rotor_inertia = 2e-5}
gear.ratio = 20.0
hip = {lower = -1.2, upper = 1.2}
tube = {length = 0.05, mass = 1.0, com = 0.05, inertia = 0.0024}
rod = {length = 0.35, mass = 0.4}
[leg.slide]
type = "prismatic"
lower = 0.0
upper = 0.2
motor = {max_force = 200.0, max_velocity = 4.0, rotor_mass = 0.1}
[start]
joint_angles = [0.0, 0.03]
[solver]
starts = 1
"""


@pytest.fixture
def read(tmp_path: Path) -> Any:
    """Reads a problem, with overrides."""

    def read(text: str, *overrides: str) -> Design:
        (tmp_path / "leg.toml").write_text(text)
        return load(tmp_path / "leg.toml", overrides)

    return read


@pytest.mark.slow
def test_a_pogo_leg_rises_as_a_constant_force_over_its_stroke_lifts_it(read: Any) -> None:
    """It leaves the ground at travel q so that its drive, pulling as hard, just stops the foot's mass at the end of the stroke:
    with v^2 = 2 q (F / m - g) and reduced mass mu, q + mu v^2 / (2 F) = s; the momentum m v lifts both."""
    foot = 0.5
    mu = BODY * foot / (BODY + foot)
    q = STROKE / (1 + mu * (1 / BODY - G / FORCE))
    v = np.sqrt(2 * q * (FORCE / BODY - G)) * BODY / (BODY + foot)
    top = 0.3 + q * BODY / (BODY + foot) + v**2 / (2 * G)
    found = solve(read(POGO), objective="apex")
    assert found.verified
    assert found.sample([found.duration]).points["com"][0, 1] == pytest.approx(top, abs=1e-6)


def test_a_massless_pogo_leg_is_bounded_by_the_work_of_its_stroke(read: Any) -> None:
    """(F - m g) s / (m g) of rise, from the closed form above with no foot's mass; by speed nothing sees it."""
    design = read(POGO, "leg.rod.mass=1e-4", "leg.rod.inertia=1e-8")
    robot = build_robot(design.leg)
    M = Machine(robot)
    still = M.acceleration(np.array([0.0, 0.0, 0.0]), np.zeros(3), np.array([FORCE]), True)
    assert still[1] == pytest.approx(FORCE / BODY - G, rel=1e-4)
    np.testing.assert_allclose(M.points(np.array([0.0, 1.0, 0.1]))["body"], [0, 1], atol=1e-15)
    np.testing.assert_allclose(M.points(np.array([0.0, 1.0, 0.1]))["foot"], [0, 0.6], atol=1e-15)


def test_a_telescope_moves_as_pinocchio_reads_it_from_a_urdf(read: Any) -> None:
    robot = build_robot(read(TELESCOPE).leg)
    free = pin.buildModelFromXML(to_urdf(robot))
    q, v, a = np.random.default_rng(2).normal(size=(3, BASE + 2))
    data = free.createData()
    expected = pin.rnea(free, data, q, v, a)
    expected[BASE:] += robot.rotors * a[BASE:]
    assert robot.rotors[1] == pytest.approx(0.1, rel=1e-15)
    np.testing.assert_allclose(Machine(robot).inverse_dynamics(q, v, a), expected, atol=1e-9)
    names = [ca.SX.sym(x, BASE + 2) for x in "qva"]
    planned = ca.Function("f", names, [LegDynamics(robot, robot.parameters).inverse_dynamics(*names)])
    np.testing.assert_allclose(planned(q, v, a).full()[:, 0], expected, atol=1e-9)
    pin.framesForwardKinematics(free, data, q)
    foot = free.getFrameId("foot")
    np.testing.assert_allclose(joint_positions(robot.leg, q[BASE:])[-1, [0, 2]] + q[:BASE], data.oMf[foot].translation[[0, 2]], atol=1e-12)  # fmt: skip
    J = pin.computeFrameJacobian(free, data, q, foot, pin.LOCAL_WORLD_ALIGNED)[:3, BASE:]
    np.testing.assert_allclose(foot_jacobian(robot.leg, q[BASE:]), J, atol=1e-12)
    tau, machine = np.array([1.0, -2.0]), Machine(robot)
    moved = machine.acceleration(q, v, tau, False)
    later, before = (machine.energy(q + h * v, v + h * moved) for h in (1e-6, -1e-6))
    assert (later - before) / 2e-6 == pytest.approx(tau @ v[BASE:], rel=1e-6)  # with the rotor's mass


@pytest.mark.parametrize(("kind", "write"), [("urdf", to_urdf), ("mjcf", to_mjcf)])
def test_what_is_written_reads_back(kind: str, write: Any, read: Any, tmp_path: Path) -> None:
    """A URDF knows no rotor's mass and an MJCF no speed at no force."""
    leg = read(TELESCOPE).leg
    (tmp_path / "robot.xml").write_text(write(build_robot(leg)))
    speeds = "hip.motor.max_speed = 20.0\nslide.motor.max_velocity = 4.0\n" if kind == "mjcf" else ""
    again = read(
        f'name = "t"\n[leg]\n{kind} = "robot.xml"\njoints = ["hip", "slide"]\nfoot_frame = "foot"\n{speeds}'
        "body.mass = 4.0\n[start]\njoint_angles = [0.0, 0.03]\n"
    ).leg
    for entry, value in (("max_torque", 200.0), ("max_speed", 4.0), ("rotor_inertia", 0.1 if kind == "mjcf" else 0.0)):
        assert again.drive("slide", "motor", entry)[1] == pytest.approx(value, rel=1e-12)
    assert again.sliding == ("slide",)
    assert again.joint["slide"].axis == leg.joint["slide"].axis
    assert (again.joint["slide"].lower, again.joint["slide"].upper) == (0.0, 0.2)


def test_a_spindle_turns_its_motor(read: Any) -> None:
    """A motor that turns by 200 rad for a metre: its torque is a force, its rotor a mass, by the ratio and its square."""
    own = "gear.ratio = 200.0\nmotor = {max_torque = 1.0, max_speed = 800.0, rotor_inertia = 1e-5}"
    design = read(TELESCOPE.replace("motor = {max_force = 200.0, max_velocity = 4.0, rotor_mass = 0.1}", own))
    slide = derived(design).joints[1]
    assert (slide.stall_torque, slide.no_load_speed, slide.rotor_inertia) == pytest.approx((200.0, 4.0, 0.4))


@pytest.mark.parametrize(
    ("lines", "motor", "linear"),
    [
        ("", {"max_force": 200.0, "max_velocity": 4.0}, True),
        ("slide.gear.ratio = 100.0", {"max_torque": 2.0, "max_speed": 400.0}, False),
        ("slide.motor.max_force = 50.0\nslide.gear.ratio = 2.0", {"max_force": 50.0, "max_velocity": 8.0}, True),
        ("slide.motor = {rotor_mass = 0.1}\nslide.gear.ratio = 2.0", {"max_force": 100.0, "max_velocity": 8.0}, True),
        ("slide.motor = {max_torque = 1.0, max_speed = 800.0}\nslide.gear.ratio = 150.0", {"max_torque": 1.0}, False),
        ("slide.motor = {voltage = 24.0, torque_constant = 0.05, winding_resistance = 0.3}\nslide.gear.ratio = 100.0", {"voltage": 24.0}, False),
    ],
)  # fmt: skip
def test_a_slide_of_a_urdf_is_driven_as_its_own_motor_and_gear_say(
    lines: str, motor: dict[str, float], linear: bool, read: Any, tmp_path: Path
) -> None:
    """Effort and velocity are those of the joint: a gear of ratio n leaves the motor effort / n and velocity n."""
    (tmp_path / "robot.xml").write_text(to_urdf(build_robot(read(TELESCOPE).leg)))
    leg = read(
        f'name = "t"\n[leg]\nurdf = "robot.xml"\njoints = ["hip", "slide"]\nfoot_frame = "foot"\nbody.mass = 4.0\n{lines}\n'
        "[start]\njoint_angles = [0.0, 0.03]\n"
    ).leg
    assert leg.linear("slide") == linear
    for entry, value in motor.items():
        assert getattr(leg.joint["slide"].motor, entry) == pytest.approx(value, rel=1e-12)


@pytest.mark.parametrize(
    ("overrides", "words"),
    [
        (["leg.motor.max_force=3.0"], "leg.motor.max_force is of a linear motor"),
        (["leg.hip.motor={max_force=3.0, max_velocity=1.0}"], "leg.hip.motor.max_force is of a linear motor"),
        (["leg.slide.motor.max_torque=3.0"], "leg.slide.motor.max_torque is of a motor that turns"),
        (["leg.slide.transmission.linear.slope=0.1"], "leg.slide.transmission goes with joints that turn"),
        (["leg.hip.transmission.coupling.slide.ratio=1.0"], "leg.hip.transmission goes with joints that turn"),
        (["start.joint_angles=[0.0, 0.3]"], "= 0.3 m is outside the limits of slide"),
        (
            ["leg.slide.upper=20"],
            "a number from -7 to 7 m is needed; 20 looks like millimetres: write 0.02, or like centimetres",
        ),
        (["leg.slide.gear.friction=1e6"], "leg.slide.gear.friction = 1000000.0 N is too large"),
        (["leg.slide.lower=0.3"], "leg.slide.lower = 0.3 m is not below leg.slide.upper = 0.2 m"),
    ],
)
def test_what_does_not_go_with_a_prismatic_joint_is_refused_in_a_sentence(
    overrides: list[str], words: str, read: Any
) -> None:
    with pytest.raises(ProblemFileError) as raised:
        read(TELESCOPE, *overrides)
    assert words in raised.value.problems[0]


@pytest.mark.slow
def test_a_telescope_hops_in_pinocchio_and_in_mujoco(read: Any) -> None:
    pytest.importorskip("mujoco")
    found = solve(read(TELESCOPE))
    assert found.verified
    assert {i.name: i.unit for i in sensitivity(found)}["leg.slide.motor.max_force"] == "N"
    columns = Solution.with_methods(found).to_dataframe([0.0]).columns
    assert {"hip angle [rad]", "hip torque [N m]", "slide travel [m]", "slide speed [m/s]", "slide force [N]"} <= {
        *columns
    }
    trace = mujoco.replay(found.robot, found)
    assert trace.lowest[-1] == pytest.approx(found.sample([found.duration]).lowest[-1], abs=3e-4)


def test_what_is_held_back_varied_and_drawn_of_a_linear_motor_is_its_force_and_its_speed(read: Any) -> None:
    """Room in metres is a share of the leg's length; each figure of a drive stands in one place."""
    design = read(TELESCOPE, "reserve.torque=0.3", "reserve.speed=0.2", "reserve.angle=0.05")
    held = reserved(design).leg
    assert (held.motor.max_torque, held.motor.max_speed) == pytest.approx((0.7, 320.0))
    slide = held.joint["slide"]
    assert slide.motor is not None
    assert (slide.motor.max_force, slide.motor.max_velocity) == pytest.approx((140.0, 3.2))
    assert (held.joint["hip"].upper, slide.upper) == pytest.approx((1.15, 0.2 - 0.05 * design.leg.length))
    drawn = with_torque_constants(design, np.array([1.5, 1.5])).leg
    assert [rated(drawn, joint)[0] for joint in drawn.joints] == pytest.approx([1.5, 300.0])
    paths = [path for path, joint, *_ in drive_entries(design.leg) if joint == "slide"]
    assert len(paths) == len(set(paths))
    assert {"leg.slide.motor.max_force", "leg.slide.motor.max_velocity", "leg.slide.motor.rotor_mass"} <= set(paths)
    assert direction("leg.slide.motor.max_force") == 1


def test_motors_that_turn_are_not_chosen_for_a_joint_with_a_linear_one(read: Any) -> None:
    with pytest.raises(UsageError, match=r"slide slides by a linear motor.*name others, as --joints hip"):
        choose(read(TELESCOPE), 0.2, joints=["slide"])


def test_a_body_on_a_slide_stays_above_the_ground(read: Any) -> None:
    """It is a point of its own where the first joint slides on it."""
    design = read(POGO)
    assert ("body", "body") in [row[:2] for row in height_rows(design)]


def test_a_linear_motor_is_spoken_of_in_its_own_units(
    read: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Where one has no rotor's mass, nothing is advised; too much is in kg; what its force needs beside it is no voltage."""
    light = TELESCOPE.replace(", rotor_mass = 0.1", "")
    read(light)
    assert run(["show", str(tmp_path / "leg.toml")]) == 0
    assert "rotor inertia at" not in capsys.readouterr().out
    heavy = doubts(read(TELESCOPE, "leg.slide.motor.rotor_mass=100.0"))
    assert any("leg.slide.motor.rotor_mass = 100 kg and" in words for words in heavy)
    with pytest.raises(ProblemFileError) as raised:
        read(TELESCOPE.replace("max_velocity = 4.0, ", ""))
    assert [words.partition("leg.slide")[2] for words in raised.value.problems] == [
        ".motor.max_velocity is missing: give it."
    ]
    with pytest.raises(UsageError, match="two joints, not one whose joints slide or follow others"):
        Force(Setting(read(TELESCOPE), 1 / 4000))


def test_entries_of_what_slides_have_its_units(read: Any) -> None:
    design = read(
        TELESCOPE,
        "leg.slide.gear.friction=2",
        "leg.slide.gear.speed_cap=3",
        "leg.spring.slide={stiffness=9, rest_angle=0}",
    )
    units = {row.path: row.unit for row in rows(design)}
    assert [units[f"leg.slide.{entry}"] for entry in ("lower", "gear.friction", "gear.speed_cap")] == ["m", "N", "m/s"]
    assert [units[f"leg.spring.slide.{entry}"] for entry in ("stiffness", "rest_angle")] == ["N/m", "m"]
    assert [units[path] for path in ("leg.hip.lower", "leg.gear.ratio", "start.joint_angles")] == ["rad", "1", "rad, m"]
    assert [unit_at(design, f"start.joint_angles[{k}]") for k in (0, 1)] == ["rad", "m"]
    turned = TELESCOPE.replace("{max_force = 200.0, max_velocity = 4.0, rotor_mass = 0.1}", "{max_torque = 1.0}")
    spindle = {
        row.path: row.unit for row in rows(read(turned, "leg.slide.gear.ratio=200", "leg.slide.gear.speed_cap=900"))
    }
    assert [spindle[f"leg.slide.gear.{entry}"] for entry in ("ratio", "speed_cap")] == ["rad/m", "rad/s"]
    energy, named = (
        SpringEnergy(1.0, 2.0, 3.0, 177.0),
        "leg.spring.both={stiffness=9, rest_angle=0, joints=['hip', 'slide']}",
    )
    lines = spring_lines(SimpleNamespace(springs={"slide": energy, "both": energy}, series_springs={"slide": energy}), read(TELESCOPE, "leg.spring.slide={stiffness=9, rest_angle=0}", named).leg)  # type: ignore[arg-type]  # fmt: skip
    assert [line.partition("at most ")[2] for line in lines] == ["177 N", "177 N m", "177 N"]


def test_sensitivity_finds_the_entries_of_a_linear_motor(read: Any) -> None:
    """Each figure once, by the name that it has in the file."""
    found = [(joint, entry) for path, joint, part, entry in drive_entries(read(TELESCOPE).leg) if part == "motor"]
    named = [("hip", entry) for entry in ("max_torque", "max_speed", "rotor_inertia")]
    assert sorted(found) == sorted(named + [("slide", entry) for entry in ("max_force", "max_velocity", "rotor_mass")])
