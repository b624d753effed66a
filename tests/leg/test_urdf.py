"""A leg out of a URDF against Pinocchio's own reading of the whole robot, and files that nobody should send."""

import os
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest

import hopopt as ho
from hopopt import load, solve
from hopopt.control.closed_loop import make_plant
from hopopt.design import Design
from hopopt.errors import ProblemFileError, UsageError
from hopopt.leg.dynamics import LegDynamics
from hopopt.leg.files.export import to_urdf
from hopopt.leg.files.urdf import read_leg
from hopopt.leg.files.urdf_xml import UrdfError
from hopopt.leg.kinematics import joint_positions
from hopopt.leg.robot import BASE, build_robot
from hopopt.problem.load import changed
from hopopt.sim.machine import Machine

PUBLIC = ("solo12_leg", "a1_leg", "go1_leg", "go2_leg", "b1_leg", "hyq_leg")
PROBLEMS = Path(__file__).parents[2] / "problems"
SIMPLE = (PROBLEMS / "three_joint.urdf").read_text()
JOINTS = ("hip", "knee", "ankle")


def read(text: str, joints: tuple[str, ...] = JOINTS, foot: str = "toe", **locked: float) -> object:
    return read_leg(text.encode(), joints, foot, locked)


def urdf_of(name: str) -> Path:
    """The public URDF a built-in problem names."""
    robots = Path(str(distribution("example-robot-data").locate_file("cmeel.prefix/share/example-robot-data/robots")))
    line = next(x for x in (PROBLEMS / f"{name}.toml").read_text().splitlines() if x.startswith("urdf"))
    return robots / line.split('"')[1].removeprefix("example-robot-data/")


# ---- against Pinocchio's own reading ------------------------------------------------------------------------


@pytest.fixture(scope="module", params=PUBLIC)
def robot(request: pytest.FixtureRequest) -> tuple[Design, pin.Model]:
    """A built-in leg, and the robot's whole model on a free base."""
    try:
        path = urdf_of(request.param)
    except PackageNotFoundError:  # pragma: no cover
        pytest.skip("example-robot-data is not installed")
    return load(request.param), pin.buildModelFromXML(path.read_text(), pin.JointModelFreeFlyer())


def whole(model: pin.Model, design: Design, q_j: np.ndarray, *rates: np.ndarray) -> list[np.ndarray]:
    """Configuration of the whole robot with the leg's joints at q_j, and its rates; (x, z, joints) in, all joints out."""
    q = pin.neutral(model)
    vectors = [np.zeros(model.nv) for _ in rates]
    for k, name in enumerate(design.leg.joints):
        joint = model.joints[model.getJointId(name)]
        q[joint.idx_q] = q_j[k]
        for full, rate in zip(vectors, rates, strict=True):
            full[joint.idx_v] = rate[BASE + k]
    for full, rate in zip(vectors, rates, strict=True):
        full[[0, 2]] = rate[:BASE]
    return [q, *vectors]


def test_foot_is_where_the_whole_robot_has_it(robot: tuple[Design, pin.Model]) -> None:
    design, model = robot
    data, foot = model.createData(), model.getFrameId(_foot(design))
    for q_j in np.random.default_rng(0).uniform(-2, 2, (5, len(design.leg.joints))):
        pin.framesForwardKinematics(model, data, whole(model, design, q_j)[0])
        hip = data.oMi[model.getJointId(design.leg.joints[0])].translation
        np.testing.assert_allclose(joint_positions(design.leg, q_j)[-1], data.oMf[foot].translation - hip, atol=2e-9)


def test_joint_torques_are_those_of_the_whole_robot(robot: tuple[Design, pin.Model]) -> None:
    """The other limbs at rest weigh on the body alone, so the joints' torques do not know them."""
    design, model = robot
    own = build_robot(design.leg, {path: 0.0 for path in _rotors(design)})
    rng = np.random.default_rng(1)
    for _ in range(5):
        n = len(design.leg.joints)
        q_j, v, a = rng.uniform(-2, 2, n), rng.uniform(-5, 5, BASE + n), rng.uniform(-50, 50, BASE + n)
        needed = pin.rnea(model, model.createData(), *whole(model, design, q_j, v, a))
        at = [model.joints[model.getJointId(name)].idx_v for name in design.leg.joints]
        mine = pin.rnea(own.model, own.model.createData(), np.concatenate([np.zeros(BASE), q_j]), v, a)
        np.testing.assert_allclose(mine[BASE:], needed[at], rtol=1e-8, atol=1e-8)


def _foot(design: Design) -> str:
    text = (PROBLEMS / f"{design.name}.toml").read_text()
    return next(x.split('"')[1] for x in text.splitlines() if x.startswith("foot_frame ="))


def _rotors(design: Design) -> list[str]:
    return [p for p in build_robot(design.leg).parameters if p.endswith(("rotor_inertia", "gear.inertia"))]


def test_body_carries_everything_that_is_locked() -> None:
    """Without a mass of its own in the problem, the body has the whole robot's less the moving links'."""
    design = load("a1_leg", {"leg.body.mass": None})
    model = pin.buildModelFromXML(urdf_of("a1_leg").read_text(), pin.JointModelFreeFlyer())
    assert Machine(build_robot(design.leg)).mass == pytest.approx(sum(i.mass for i in model.inertias), abs=1e-9)


def test_leg_written_as_urdf_comes_back(tmp_path: Path) -> None:
    """The paper's leg: same torques for the same motion, drives and limits as far as a URDF knows them."""
    paper = load("paper")
    (tmp_path / "paper.urdf").write_text(to_urdf(build_robot(paper.leg)))
    (tmp_path / "mine.toml").write_text(
        'name = "mine"\n[leg]\nurdf = "paper.urdf"\njoints = ["hip", "knee"]\nfoot_frame = "foot"\n'
        "[leg.motor]\nmax_torque = 2.0\nmax_speed = 1256.637\nrotor_inertia = 1.19e-5\n[leg.gear]\nratio = 100\n"
        "[start]\nhip_height = 0.28\n"
    )
    mine = load(tmp_path / "mine.toml")
    models = [build_robot(design.leg).model for design in (paper, mine)]
    rng = np.random.default_rng(2)
    for _ in range(5):
        state = rng.uniform(-2, 2, 4), rng.uniform(-9, 9, 4), rng.uniform(-99, 99, 4)
        forces = [pin.rnea(m, m.createData(), *state) for m in models]
        np.testing.assert_allclose(*forces, rtol=1e-12, atol=1e-10)
    for joint in ("hip", "knee"):
        assert (mine.leg.joint[joint].lower, mine.leg.joint[joint].upper) == (
            paper.leg.joint[joint].lower,
            paper.leg.joint[joint].upper,
        )


def test_drives_come_with_the_urdf_and_give_way_to_the_files(tmp_path: Path) -> None:
    base = 'name = "m"\n[leg]\nurdf = "leg.urdf"\njoints = ["hip", "knee", "ankle"]\nfoot_frame = "toe"\n'
    start = "[start]\njoint_angles = [1.0, -2.0, 1.2]\n"
    (tmp_path / "leg.urdf").write_text(SIMPLE)
    (tmp_path / "m.toml").write_text(base + start)
    leg = load(tmp_path / "m.toml").leg
    assert [leg.drive(j, "motor", "max_torque")[1] for j in leg.joints] == [100.0, 150.0, 60.0]
    assert [leg.drive(j, "motor", "max_speed")[1] for j in leg.joints] == [13.0, 13.0, 16.0]
    (tmp_path / "m.toml").write_text(base + "[leg.gear]\nratio = 10\n" + start)
    leg = load(tmp_path / "m.toml").leg
    assert leg.drive("knee", "motor", "max_torque")[1] == 15.0  # on the motor's side
    assert leg.drive("knee", "motor", "max_speed")[1] == 130.0
    (tmp_path / "m.toml").write_text(base + "[leg.motor]\nmax_torque = 2.0\nmax_speed = 1000.0\n" + start)
    leg = load(tmp_path / "m.toml").leg
    assert [leg.drive(j, "motor", "max_torque")[1] for j in leg.joints] == [2.0, 2.0, 2.0]


@pytest.mark.parametrize(
    ("said", "instead", "sentence"),
    [
        (
            'effort="150"',
            'effort="0"',
            "m.toml: leg.knee.motor.max_torque is missing, and leg.urdf states no usable effort",
        ),
        ('velocity="16"', 'velocity="0"', "m.toml: leg.ankle.motor.max_speed is missing"),
        ('lower="-2.4"', 'lower="-1e9"', "leg.urdf: placeholders, which limit nothing: leg.knee.lower (-1e+09 rad)"),
        ('lower="-2.4"', 'lower="-10"', "leg.urdf: placeholders, which limit nothing: leg.knee.lower (-10 rad)"),
        (
            'effort="150"',
            'effort="1000"',
            "leg.urdf: placeholders, which limit nothing: leg.knee.motor.max_torque (1000 N m)",
        ),
        (
            'velocity="16"',
            'velocity="1000"',
            "leg.urdf: placeholders, which limit nothing: leg.ankle.motor.max_speed (1000 rad/s)",
        ),
        ('lower="0.2"', 'lower="1.8"', "leg.urdf: leg.ankle.lower = 1.8 rad is not below"),
    ],
)
def test_placeholders_of_a_urdf_are_named_where_they_stand(
    said: str, instead: str, sentence: str, tmp_path: Path
) -> None:
    """The file to blame, and what to write in the problem file in place of it."""
    (tmp_path / "leg.urdf").write_text(SIMPLE.replace(said, instead))
    (tmp_path / "m.toml").write_text(
        'name = "m"\n[leg]\nurdf = "leg.urdf"\njoints = ["hip", "knee", "ankle"]\nfoot_frame = "toe"\n'
        "[start]\njoint_angles = [1.0, -2.0, 1.2]\n"
    )
    with pytest.raises(ProblemFileError) as raised:
        load(tmp_path / "m.toml")
    assert len(str(raised.value).splitlines()) == 1
    assert sentence in str(raised.value)
    assert "degrees" not in str(raised.value)
    if sentence.startswith("leg.urdf"):
        assert "in the problem file" in str(raised.value)


def test_what_a_file_says_of_a_motor_leaves_the_rest_to_the_urdf(tmp_path: Path) -> None:
    """One joint's torque in the problem file: its speed stays its own in the URDF, not another joint's."""
    (tmp_path / "leg.urdf").write_text(SIMPLE.replace('effort="60"', 'effort="1e8"'))
    text = (
        'name = "m"\n[leg]\nurdf = "leg.urdf"\njoints = ["hip", "knee", "ankle"]\nfoot_frame = "toe"\n'
        "[start]\njoint_angles = [1.0, -2.0, 1.2]\n"
    )
    (tmp_path / "m.toml").write_text(text)
    with pytest.raises(
        ProblemFileError, match=r"leg\.urdf: placeholders.*: leg\.ankle\.motor\.max_torque \(1e\+08 N m\)"
    ):
        load(tmp_path / "m.toml")
    (tmp_path / "m.toml").write_text(text.replace("[start]", "[leg.ankle.motor]\nmax_torque = 50\n[start]"))
    leg = load(tmp_path / "m.toml").leg
    assert [leg.drive(j, "motor", "max_torque")[1] for j in leg.joints] == [100.0, 150.0, 50.0]
    assert [leg.drive(j, "motor", "max_speed")[1] for j in leg.joints] == [13.0, 13.0, 16.0]


def test_what_is_locked_stays_at_its_angle() -> None:
    """The thigh of A1 with its hip turned sideways: the leg leaves the plane by that angle."""
    raw = urdf_of("a1_leg").read_bytes()
    joints = ("FL_thigh_joint", "FL_calf_joint")
    straight, turned = (read_leg(raw, joints, "FL_foot", {"FL_hip_joint": x}) for x in (0.0, 0.3))
    turn = np.array([[1, 0, 0], [0, np.cos(0.3), -np.sin(0.3)], [0, np.sin(0.3), np.cos(0.3)]])
    for a, b in zip(straight.links, turned.links, strict=True):
        for what in ("axis", "vector", "com"):
            np.testing.assert_allclose(turn @ getattr(a, what), getattr(b, what), atol=1e-12)
        assert (a.mass, a.lower) == (b.mass, b.lower)


# ---- loops: a slider, a leg that leaves the plane -------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "overrides"),
    [
        ("paper", {"leg.guides": ["z"]}),
        ("three_joint", {"leg.guides": ["z"]}),
        ("three_joint", {"leg.hip.axis": [0.6, -0.8, 0.0]}),
        ("three_joint", {"leg.hip.axis": [1.0, 0.0, 0.0], "leg.guides": ["z"], "hop.above_ground": ["foot"]}),
    ],
)
def test_pinned_foot_on_a_closed_loop(name: str, overrides: dict) -> None:
    """Torques of the planner's stance, played into Pinocchio with foot and guides held, give its accelerations back."""
    design = load(name, overrides)
    robot = build_robot(design.leg)
    machine, dynamics, n = Machine(robot), LegDynamics(robot, robot.parameters), len(design.leg.joints)
    m, rng = len(dynamics.loops), np.random.default_rng(3)
    assert m == (name == "paper" or "leg.guides" in overrides) + ("leg.hip.axis" in overrides)
    q, v, free, force = (ca.SX.sym(s, k) for s, k in zip("qvuf", (n, n, n - m, m), strict=True))
    motion = dynamics.stance(q, v, dynamics.closed(q, v, free, range(m)), force)
    evaluate = ca.Function("f", [q, v, free, force], [motion.q, motion.v, motion.a, motion.tau, motion.f])
    for _ in range(5):
        q_j = np.array([0.4, -1.0, 0.5])[:n] + rng.uniform(-0.2, 0.2, n)
        jacobian = _loop_jacobian(machine, dynamics, q_j)
        v_j = (np.eye(n) - np.linalg.pinv(jacobian) @ jacobian) @ rng.uniform(-5, 5, n)  # the foot at rest
        given = q_j, v_j, rng.uniform(-50, 50, n - m), rng.uniform(-100, 100, m)
        at, speed, a, tau, f = (np.array(x).ravel() for x in evaluate(*given))
        replayed = machine.acceleration(at, speed, tau, contact=True)
        np.testing.assert_allclose(replayed, a, rtol=1e-7, atol=1e-6)
        np.testing.assert_allclose(replayed[machine.held], 0, atol=1e-7)
        missing = pin.rnea(machine.model, machine.data, at, speed, a) - machine.foot_jacobian(at).T @ f
        missing[BASE:] -= tau
        np.testing.assert_allclose(np.delete(missing, machine.held), 0, atol=1e-7)


def _loop_jacobian(machine: Machine, dynamics: LegDynamics, q_j: np.ndarray) -> np.ndarray:
    J = machine.foot_jacobian(np.concatenate([np.zeros(BASE), q_j]))
    return J[[machine.contact.index(axis) for axis in dynamics.loops]][:, BASE:]


def test_body_on_a_slider_stands_where_it_starts_in_both_phases() -> None:
    """Foot ahead of the hip: the program's flight and the plan's own begin where stance ends, x included."""
    design = load("paper", ['leg.guides=["z"]', "start.foot_x=0.05", "solver.refine=false", "solver.starts=1"])
    coarse = {"solver.stance_intervals": 10, "solver.flight_intervals": 5}
    solution = solve(changed(design, coarse), objective=_height_and_place, processes=1)
    end = solution.sample(solution.duration)
    assert end.q[0, 0] == pytest.approx(-0.05, abs=1e-9)
    assert solution.summary.objective_value == pytest.approx(end.q[0, 1] + 0.1 * end.q[0, 0], abs=1e-4)


@ho.objective(unit="m")
def _height_and_place(now: Any) -> Any:
    return now.q[1] + 0.1 * now.q[0]


def test_simulation_of_a_leg_that_leaves_the_plane_is_refused() -> None:
    with pytest.raises(UsageError, match="hopopt solves and verifies its hop, but simulates only"):
        make_plant(load("three_joint", ["leg.hip.axis=[0.6, -0.8, 0.0]"]))


@pytest.mark.slow
def test_vertical_slider_is_verified_and_no_better_than_guides() -> None:
    free, held = (load("a1_leg", [*extra, "solver.starts=1"]) for extra in ((), ('leg.guides=["z"]',)))
    with_guides, slider = solve(free), solve(held)
    assert with_guides.verified
    assert slider.verified
    assert slider.clearance < with_guides.clearance + 1e-4
    x = slider.tables["flight"].q[..., 0]
    np.testing.assert_allclose(x, x[0, 0], atol=1e-12)
    assert {c.name for c in slider.summary.verification} >= {"stance body on its slider", "stance foot at rest"}


ALIKE = ("go1_leg", "go2_leg", "b1_leg", "solo12_leg")  # as a1_leg: the same robot in other sizes


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=[pytest.mark.rarely] if name in ALIKE else []) for name in (*PUBLIC, "three_joint")],
)
def test_public_legs_solve_and_verify(name: str) -> None:
    solution = solve(load(name), starts=1)
    assert solution.verified, solution.summary.failed_checks
    assert solution.clearance > 0.2


# ---- files that nobody should send ----------------------------------------------------------------------------

BOMB = '<!DOCTYPE lolz [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;">]><robot name="&b;"/>'
OUTSIDE = '<!DOCTYPE r [<!ENTITY x SYSTEM "file:///etc/passwd">]><robot name="&x;"/>'
CHAIN = "".join(f'<link name="l{k}"/><joint name="j{k}" type="fixed"><parent link="l{k}"/><child link="l{k + 1}"/></joint>' for k in range(6000))  # fmt: skip
FAULTS = {
    "endless chain": (f'<robot name="x">{CHAIN}<link name="l6000"/></robot>', "hopopt reads up to 1000 in all"),
    "entity bomb": (BOMB, "declares a document type or entities"),
    "outside entity": (OUTSIDE, "declares a document type or entities"),
    "no XML": ("hello", "is not XML"),
    "no robot": ("<sdf/>", "begins with <sdf> instead of <robot>"),
    "empty": ("<robot name='x'/>", "has no links"),
    "cycle": (SIMPLE.replace('<parent link="body"/>', '<parent link="foot"/>'), "has a loop of links"),
    "two parents": (SIMPLE.replace('<child link="toe"/>', '<child link="foot"/>'), 'link "foot" hangs on two joints'),
    "two roots": (SIMPLE.replace("</robot>", '<link name="lost"/></robot>'), "has 2 links without a parent (body, lost)"),
    "no such link": (SIMPLE.replace('<parent link="shank"/>', '<parent link="shnk"/>'), 'the parent link "shnk"'),
    "two of a name": (SIMPLE.replace('<link name="toe"/>', '<link name="toe"/><link name="foot"/>'), 'two links called "foot"'),
    "no inertia": (SIMPLE.replace('<mass value="1.6"/>', '<mass value="0"/>'), 'link "thigh" has no <inertial>'),
    "no body has it": (SIMPLE.replace('ixx="0.0120" iyy="0.0120"', 'ixx="0.9" iyy="0.0120"'), "which no body has"),
    "negative mass": (SIMPLE.replace('value="0.8"', 'value="-0.8"'), 'link "shank" has an <inertial> with a negative mass'),
    "no number": (SIMPLE.replace('xyz="0 0 -0.30"', 'xyz="0 0 a"'), 'joint "knee" has <origin xyz="0 0 a">'),
    "infinite": (SIMPLE.replace('xyz="0 0 -0.30"', 'xyz="0 0 inf"'), 'joint "knee" has <origin xyz="0 0 inf">'),
    "underscore": (SIMPLE.replace('value="1.6"', 'value="1_6"'), 'link "thigh" has <mass value="1_6">: a number'),
    "other digits": (SIMPLE.replace('value="1.6"', 'value="\u0661.6"'), 'link "thigh" has <mass value="\u0661.6">'),
    "other blanks": (SIMPLE.replace('xyz="0 0 -0.30"', 'xyz="0 0\xa0-0.30"'), "3 numbers with blanks between is needed"),
    "huge": (SIMPLE.replace('xyz="0 0 -0.30"', 'xyz="0 0 -1e160"'), "1000 at most is allowed, in SI units"),
    "turned otherwise": (SIMPLE.replace('xyz="0 0 -0.30"', 'xyz="0 0 -0.30" quat_xyzw="0 0 1 0"'), "hopopt reads xyz and rpy"),
    "no axis": (SIMPLE.replace('<axis xyz="0 -1 0"/>', '<axis xyz="0 0 0"/>'), 'joint "hip" has no axis'),
    "strange type": (SIMPLE.replace('"revolute"', '"planar"', 1), 'joint "hip" is of type "planar"'),
}  # fmt: skip


@pytest.mark.parametrize("what", FAULTS)
def test_faulty_files_are_refused_in_a_sentence(what: str) -> None:
    text, words = FAULTS[what]
    with pytest.raises(UrdfError) as error:
        read(text)
    assert words in str(error.value)


def test_numbers_mean_what_the_parser_takes_them_for() -> None:
    """Signs, bare points and blanks of all kinds that XML has: the same leg as in plain digits."""
    odd = SIMPLE.replace('value="1.6"', 'value="&#10;+16.e-1&#9;"').replace('xyz="0 0 -0.30"', 'xyz=" 0 &#10; 0. -.30"')
    assert odd != SIMPLE
    assert read(odd) == read(SIMPLE)


@pytest.mark.parametrize(
    ("joints", "foot", "words"),
    [
        (("hip", "kne"), "toe", 'has no "kne" for leg.joints (did you mean knee?): there is hip, knee, ankle'),
        (("hip", "knee", "sole"), "toe", 'joint "sole" is not on the way from the body to the foot "toe"'),
        (("knee", "hip"), "toe", "has the joints in the order hip, knee"),
        (("hip", "hip"), "toe", "is asked for a joint twice"),
        (("hip", "knee", "ankle"), "shank", 'joint "ankle" is not on the way'),
        (
            ("hip",),
            "toes",
            'has no "toes" for leg.foot_frame (did you mean toe?): there is body, thigh, shank, foot, toe',
        ),
    ],
)
def test_wrong_names_are_answered_with_what_there_is(joints: tuple[str, ...], foot: str, words: str) -> None:
    with pytest.raises(UrdfError) as error:
        read(SIMPLE, joints, foot)
    assert words in str(error.value)


def test_wrong_locked_joint() -> None:
    with pytest.raises(UrdfError, match=r'has no "ankel" for leg.locked \(did you mean ankle\?\)'):
        read(SIMPLE, ("hip", "knee"), "toe", ankel=0.5)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("../leg.urdf", "leads out of the folder of the problem"),
        ("/etc/passwd", "leads out of the folder of the problem"),
        ("example-robot-data/../../x.urdf", "leads out of the folder of the problem"),
        ("lge.urdf", "for a path counts from the folder of the problem file; there is leg.urdf"),
    ],
)
def test_paths_stay_in_the_problems_folder(tmp_path: Path, name: str, words: str) -> None:
    (tmp_path / "leg.urdf").write_text(SIMPLE)
    (tmp_path / "m.toml").write_text(
        f'name = "m"\n[leg]\nurdf = "{name}"\njoints = ["hip"]\nfoot_frame = "toe"\n[start]\njoint_angles = [0.1]\n'
    )
    with pytest.raises(ProblemFileError) as error:
        load(tmp_path / "m.toml")
    assert len(error.value.problems) == 1
    assert words in error.value.problems[0]


@pytest.mark.parametrize(
    ("entry", "words"),
    [
        ("locked = {hip = 1e400}", "leg.locked takes names of joints with the angle"),
        ("gear = {ratio = -3.0}", "leg.gear.ratio = -3.0 is too small"),
        ('urdf = "a\\u0000b.urdf"', "is not the path of a file"),
    ],
)
def test_strange_numbers_and_names_end_in_a_sentence(tmp_path: Path, entry: str, words: str) -> None:
    (tmp_path / "leg.urdf").write_text(SIMPLE)
    urdf = "" if entry.startswith("urdf") else 'urdf = "leg.urdf"\n'
    head = f'name = "m"\n[leg]\n{urdf}{entry}\njoints = ["knee", "ankle"]\nfoot_frame = "toe"\n'
    (tmp_path / "m.toml").write_text(head + "[start]\njoint_angles = [-1.0, 1.0]\n")
    with pytest.raises(ProblemFileError) as error:
        load(tmp_path / "m.toml")
    assert any(words in sentence for sentence in error.value.problems)


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("leg.thigh.direction=[0, 0, 0]", "leg.thigh.direction = [0, 0, 0] has no direction"),
        ("leg.hip.axis=[0.0, 0.0, 0.0]", "has no direction"),
        ("leg.thigh.direction=[0, 1, 0]", "links or joints leave the x-z plane"),
        ("leg.thigh.inertia_tensor=[0.001, 0.001, 0.001, 0.5, 0.5, 0.5]", "which no body has"),
        ("leg.thigh.inertia_tensor=[0.1, 1e-4, 1e-4, 0, 0, 0]", "which no body has"),
        ("leg.thigh.com_position=[9, 9, 9]", "further from the joint than the whole leg is long (0.741 m)"),
    ],
)
def test_links_that_cannot_be_are_refused(override: str, words: str) -> None:
    with pytest.raises(ProblemFileError) as error:
        load("paper", [override])
    assert any(words in sentence for sentence in error.value.problems), error.value.problems


LEG = 'name = "m"\n[leg]\nurdf = "{}.toml"\njoints = ["hip"]\nfoot_frame = "toe"\n'


def test_what_is_no_file_is_not_waited_for(tmp_path: Path) -> None:
    """Pipes, circles of links, devices: as a URDF, a problem, or what a problem extends."""
    os.mkfifo(tmp_path / "pipe.toml")
    (tmp_path / "circle.toml").symlink_to(tmp_path / "circle.toml")
    (tmp_path / "device.toml").symlink_to("/dev/zero")
    for name, words in {"pipe": "not a file", "circle": "too many levels", "device": "not a file"}.items():
        (tmp_path / f"of_{name}.toml").write_text(f'extends = "{name}.toml"\nname = "m"\n')
        (tmp_path / f"urdf_{name}.toml").write_text(LEG.format(name))
        for kind in ("", "of_", "urdf_"):
            with pytest.raises(ProblemFileError) as error:
                load(tmp_path / f"{kind}{name}.toml")
            assert len(error.value.problems) == 1
            said = error.value.problems[0].lower()
            elsewhere = name != "pipe" and kind  # resolved, it is no file of this folder
            assert words in said or (elsewhere and ("no such" in said or "not the path" in said or "leads out" in said))


def test_absurd_mass_is_refused_with_its_entry(tmp_path: Path) -> None:
    (tmp_path / "leg.urdf").write_text(SIMPLE.replace('value="1.6"', 'value="1600"'))
    text = (PROBLEMS / "three_joint.toml").read_text().replace("three_joint.urdf", "leg.urdf")
    (tmp_path / "m.toml").write_text(text)
    with pytest.raises(ProblemFileError) as error:
        load(tmp_path / "m.toml")
    assert any("leg.thigh.mass = 1600.0 kg is too large" in sentence for sentence in error.value.problems)


@pytest.mark.parametrize("entry", ['foot_frame = "toe"', "locked = {hip = 0.1}"])
def test_entries_of_a_urdf_need_one(tmp_path: Path, entry: str) -> None:
    (tmp_path / "m.toml").write_text(f'extends = "paper"\nname = "m"\n[leg]\n{entry}\n')
    with pytest.raises(ProblemFileError, match="has a meaning only beside"):
        load(tmp_path / "m.toml")


def test_a_result_holds_the_leg_and_not_the_path() -> None:
    """What is stored runs again without the URDF."""
    from hopopt.problem.load import resolved_toml

    text = resolved_toml(load("three_joint"))
    assert "urdf" not in text
    assert "inertia_tensor = [0.012, 0.012, 0.0012, 0.0, 0.0, 0.0]" in text
