"""Springs beside the drives: their law, the leg's motion with them by ways that do not know each other, and what a user sees."""

import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

from command_line import said
from drawn_legs import evaluate, legs_in_motion, quick, symbols
from hopopt.design import Leg, Spring, SpringTable, physical_parameters
from hopopt.drivetrain.drives import Drive
from hopopt.drivetrain.operating_region.half_planes import OperatingRegion
from hopopt.drivetrain.springs import SpringLaw
from hopopt.errors import NotSolvedError, ProblemFileError
from hopopt.leg.dynamics import LegDynamics
from hopopt.leg.files.export import to_mjcf
from hopopt.leg.robot import BASE, build_robot
from hopopt.nlp.mesh import uniform
from hopopt.nlp.schemes import radau
from hopopt.nlp.solver.ipopt import NlpSolver
from hopopt.nlp.transcription import Guess, Transcription
from hopopt.ocp.problem import Control, Objective, Phase, Problem, State
from hopopt.planner.solve import solve
from hopopt.problem.load import load
from hopopt.robot_data.leg_momenta import LegMomenta
from hopopt.sim.ground import contact, loads, planar
from hopopt.sim.ground.stops import Stops
from hopopt.sim.machine import Machine
from hopopt.storage.seal.recheck import recheck
from hopopt.storage.solution import save
from once import solved_once

KNEE = ("leg.spring.knee.stiffness=20", "leg.spring.knee.rest_angle=-1.0")
TABLE = SpringTable(angle=(-2.0, -1.0, -0.2, 0.5), torque=(30.0, 5.0, 1.0, -20.0))
KINDS = {
    "linear": Spring(stiffness=20.0, rest_angle=-1.0),
    "above": Spring(stiffness=20.0, rest_angle=-1.0, acts="above"),
    "below": Spring(stiffness=20.0, rest_angle=-1.0, acts="below"),
    "table": Spring(table=TABLE),
}


def law_of(spring: Spring) -> SpringLaw:
    leg = load("paper").leg.model_copy(update={"spring": {"knee": spring}})
    return SpringLaw.of(leg, "knee", physical_parameters(leg))


def unrounded(kind: str, s: float) -> float:
    """The torque without rounded corners [N m]."""
    x = s + 1.0
    straight = {"linear": -20 * x, "above": -20 * max(x, 0.0), "below": -20 * min(x, 0.0)}
    return straight[kind] if kind in straight else float(np.interp(s, TABLE.angle, TABLE.torque))


@pytest.mark.parametrize("kind", KINDS)
def test_the_torque_is_what_the_energy_loses(kind: str) -> None:
    """Energy by quadrature of the torque; the broken line itself at a tenth of the joint's range from its corners."""
    law, ends = law_of(KINDS[kind]), (-1.9, 0.4)
    work, _ = quad(law.torque, *ends, epsabs=1e-12, points=[-1.0, -0.2], limit=200)
    assert law.energy(ends[0]) - law.energy(ends[1]) == pytest.approx(work, abs=1e-9)
    for s in (-1.5, -0.6, 0.3):
        assert law.torque(s) == pytest.approx(unrounded(kind, s), abs=0.03)
    assert law.energy(-1.0 if kind != "table" else -0.2) == pytest.approx(0, abs=1e-12)


def test_a_table_that_falls_gives_a_torque_that_falls() -> None:
    angles = np.linspace(-3, 2, 2001)
    assert np.all(np.diff(law_of(KINDS["table"]).torque(angles)) < 0)


@pytest.mark.parametrize("kind", KINDS)
def test_no_spring_gives_more_than_the_bound_counts(kind: str) -> None:
    """Wherever the joint limits let the leg go; and hardly less, from a grid of the knee's angles."""
    leg = load("paper").leg.model_copy(update={"spring": {"knee": KINDS[kind]}})
    springs, start, knee = build_robot(leg).springs, [0.5, -2.3], leg.joint["knee"]
    ends = [float(springs.energy([0.5, angle])) for angle in np.linspace(knee.lower, knee.upper, 997)]
    assert -1e-12 <= springs.most_given(start, leg) - (springs.energy(start) - min(ends)) < 0.05


# ---- the leg's motion ---------------------------------------------------------------------------------------


@st.composite
def sprung(draw: st.DrawFn, n: int) -> dict[str, Spring]:
    """Springs of a leg of n joints j0, j1, ...: one at a joint, one between joints, one with a corner, one with a table."""

    def number(low: float, high: float) -> float:
        return draw(st.floats(low, high))

    joints = tuple(f"j{k}" for k in range(n))
    between = {"joints": joints, "coefficients": tuple(number(0.2, 2) for _ in joints)}
    corner: Any = draw(st.sampled_from(("above", "below")))
    return {
        "j0": Spring(stiffness=number(0, 300), rest_angle=number(-2, 2)),
        "between": Spring(stiffness=number(0, 300), rest_angle=number(-2, 2), **between),
        "corner": Spring(stiffness=number(0, 300), rest_angle=number(-2, 2), acts=corner, joints=joints[-1:]),
        f"j{n - 1}" if n > 1 else "table": Spring(table=TABLE, joints=joints[-1:]),
    }


@quick
@given(legs_in_motion(st.just(2), plane=True), st.data())
def test_planner_plant_and_compiled_plant_know_springs(case: Any, data: Any) -> None:
    """M a + h is Pinocchio's less the gradient of the springs' energy; both plants accelerate as by Pinocchio with that torque."""
    leg, q, v, tau = case
    leg, tau, q_j = leg.model_copy(update={"spring": data.draw(sprung(2))}), tau[BASE:], q[BASE:]
    robot, bare = build_robot(leg), build_robot(leg.model_copy(update={"spring": None}))
    given_torques = np.array(robot.springs.torques(list(q_j)))
    lost = [robot.springs.energy(list(q_j - e)) - robot.springs.energy(list(q_j + e)) for e in 1e-4 * np.eye(2)]
    size = sum(law.steepest for law in robot.springs.laws.values())
    np.testing.assert_allclose(given_torques, np.array(lost) / 2e-4, atol=1e-5 * (size + np.abs(given_torques).max()))

    still = np.zeros_like(q)
    inputs = symbols(robot.model.nv)
    (forces,) = evaluate([LegDynamics(robot, robot.parameters).inverse_dynamics(*inputs)], inputs, [q, v, still])
    expected = pin.rnea(bare.model, bare.model.createData(), q, v, still) - np.concatenate(
        [np.zeros(BASE), given_torques]
    )
    np.testing.assert_allclose(forces, expected, atol=1e-9 * (1 + np.abs(expected).max()))

    c = planar.planar_leg(robot, Drive([OperatingRegion(())] * 2), Stops.of(leg), set(), np.inf)
    c["stiffness"][:] = 0.0
    M = Machine(bare).mass_matrix(q)
    for mode in (contact.FLIGHT, contact.STICK):
        a = Machine(bare).acceleration(q, v, tau + given_torques, contact=mode == contact.STICK)
        for mine in (
            Machine(robot).acceleration(q, v, tau, mode == contact.STICK),
            loads.rates(c, mode, q, v, tau)[0],
        ):
            np.testing.assert_allclose(M @ (mine - a), 0, atol=1e-7 * (np.abs(M) @ np.abs(a) + np.abs(expected)).max())


def test_a_mass_on_a_spring_with_limited_force() -> None:
    """A wheel of inertia I on a spring k, torque at most F: full torque gives the highest speed after half a radian, and

    w = W sin(W t) (e - s_0), cos(W t) = (e - s_1) / (e - s_0), with W = sqrt(k / I) and its rest under full torque e = F / k.
    """
    k, F, start, end = 40.0, 30.0, -0.2, 0.3
    spring = {"wheel": {"stiffness": k, "rest_angle": 0.0}}
    tables: dict[str, Any] = {"wheel": {"lower": -3.0, "upper": 3.0}, "rim": {"length": 0.4, "mass": 2.0, "com": 0.4}}
    motor = {"max_torque": 2.0, "max_speed": 100.0, "rotor_inertia": 0.0}
    whole = {"joints": ("wheel",), "links": ("rim",), "body": {"mass": 1.0}, "motor": motor, "gear": {"ratio": 1.0}}
    robot = build_robot(Leg.model_validate(whole | tables | {"spring": spring}).falling((0.0, 0.0, -1e-12)))
    inertia = 2.0 * 0.4**2 / 12 + 1.0 * 0.4**2  # about the foot: the rim's own, the body's
    q, w, a = (ca.SX.sym(name) for name in "qwa")
    torque = ca.Function("torque", [q, w, a], [LegDynamics(robot, robot.parameters).stance(q, w, a).tau])
    solved = ca.substitute(torque(q, w, a), a, 0)
    by_a = ca.jacobian(torque(q, w, a), a)
    rate = ca.Function("rate", [q, w, F_ := ca.SX.sym("F")], [(F_ - solved) / by_a])
    states = (State("q", initial=start, final=end), State("w", lower=0.0, scale=10.0, initial=0.0))
    phase = Phase(
        "swing",
        states,
        (Control("F", lower=-F, upper=F, scale=F),),
        lambda s: {"q": s.w, "w": rate(s.q, s.w, s.F)},
        (1e-2, 1.0),
    )
    goal = Objective("speed", lambda e: e.final["swing"].w - 0.1 * e.duration["swing"], maximize=True)
    guess = Guess(0.1, np.array([0.0, 1.0]), np.array([[start, 0.0], [end, 5.0]]), np.full((2, 1), F / 2))
    program = Transcription(Problem("swing", (phase,), goal), radau(4), {"swing": uniform(20)})
    solution = NlpSolver(program)({"swing": guess})
    assert solution.success
    W, rest = np.sqrt(k / inertia), F / k
    T = float(np.arccos((rest - end) / (rest - start)) / W)
    trajectory = solution.phases["swing"]
    assert trajectory.duration == pytest.approx(T, rel=1e-6)
    assert trajectory.x_end[1] == pytest.approx(W * np.sin(W * T) * (rest - start), rel=1e-6)


def test_a_log_is_identified_with_the_torque_of_springs() -> None:
    """d(T - V)/dq of the leg, on the ground and in flight, with and without them: the corner of one is rounded."""
    slack = {"stiffness": 30, "rest_angle": 0.2, "acts": "above"}
    with_, without = (
        load("paper", [*KNEE, *(f"leg.spring.hip.{name}={value}" for name, value in slack.items())]),
        load("paper"),
    )
    angles = np.array([[0.4, -1.7], [0.25, -0.6]])
    for contact_ in (True, False):
        s: Any = SimpleNamespace(t=np.zeros(2), q=angles, v=np.ones((2, 2)), contact=np.full(2, contact_))
        added = LegMomenta(with_).at(s, np.ones(5))[0] - LegMomenta(without).at(s, np.ones(5))[0]
        expected = [build_robot(with_.leg).springs.torques(list(q)) for q in angles]
        np.testing.assert_allclose(added, np.hstack([np.zeros((2, 2)), expected, np.zeros((2, 2))]), atol=1e-9)


def test_mujoco_has_the_springs_of_its_file() -> None:
    """Accelerations in flight away from corners, which MuJoCo leaves sharp; a rest angle of -1 rad, which it would take as its own."""
    mujoco = pytest.importorskip("mujoco")
    slack = {
        "stiffness": 15.0,
        "rest_angle": 0.4,
        "acts": "above",
        "joints": ["hip", "knee"],
        "coefficients": [1.0, -0.5],
    }
    robot = build_robot(
        load("paper", [*KNEE, *(f"leg.spring.calf.{name}={value}" for name, value in slack.items())]).leg
    )
    model = mujoco.MjModel.from_xml_string(to_mjcf(robot))
    data = mujoco.MjData(model)
    for q_j in ([0.5, -2.0], [1.2, -0.5], [-0.5, -1.5]):
        q, v = np.array([0.1, 0.9, *q_j]), np.array([0.1, 0.2, 3.0, -4.0])
        data.qpos[:], data.qvel[:] = q, v
        mujoco.mj_forward(model, data)
        expected = Machine(robot).acceleration(q, v, np.zeros(2), contact=False)
        wrong = Machine(robot).mass_matrix(q) @ (
            data.qacc - expected
        )  # N m: a rounded corner at a distance, k w^2 / (4 x)
        np.testing.assert_allclose(wrong, 0, atol=15 * 0.03**2 / 4 / 0.14)


# ---- what a user sees ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("entries", "words"),
    [
        (["leg.spring.knee.stiffness=-20", KNEE[1]], "leg.spring.knee.stiffness = -20 N m/rad is too small"),
        (
            ["leg.spring.kne.stiffness=20", "leg.spring.kne.rest_angle=0"],
            r"is named by no joint \(did you mean knee\?\)",
        ),
        (KNEE[:1], "needs stiffness and rest_angle, or a table"),
        ([*KNEE, "leg.spring.knee.joints=['ankle']"], 'leg.spring.knee.joints has "ankle": it takes hip, knee'),
        ([*KNEE, "leg.spring.knee.joints=['hip']", "leg.spring.knee.coefficients=[1, 2]"], "one coefficient for each"),
        (["leg.spring.knee.table={angle = [0, 1], torque = [3, 2, 1]}"], "has 2 angles and 3 torques"),
    ],
)
def test_a_spring_that_cannot_be_is_one_sentence(entries: list[str], words: str) -> None:
    with pytest.raises(ProblemFileError) as error:
        load("paper", entries)
    assert len(error.value.problems) == 1
    assert re.search(words, error.value.problems[0])


def test_a_spring_that_blocks_the_start_is_one_sentence() -> None:
    """It folds the leg harder than the drive can stretch it, so that the foot would leave the ground."""
    blocked = load("paper", ["leg.spring.knee.stiffness=700", "leg.spring.knee.rest_angle=-3"])
    with pytest.raises(NotSolvedError, match="springs pull the foot off the ground") as error:
        solve(blocked, starts=1, processes=1)
    assert str(error.value).count("springs") == 1


@pytest.mark.slow
def test_the_papers_leg_with_a_spring_at_its_knee(tmp_path: Path) -> None:
    """0.813 m by other code, of the stance alone; the energy that the spring gives is what it lost; stored and checked again."""
    s = solved_once(KNEE)
    assert s.summary.verified
    assert s.summary.certified
    assert s.summary.clearance_m == pytest.approx(0.813, abs=2e-3)
    assert s.summary.springs is not None
    energy, knee = s.summary.springs["knee"], s.sample(np.array([0.0, s.summary.lift_off.time_s])).q[:, -1]
    at_start, at_lift_off = 0.5 * 20 * (knee + 1) ** 2
    assert energy.at_start_J == pytest.approx(at_start, abs=1e-9)
    assert at_start + energy.taken_J - energy.given_J == pytest.approx(at_lift_off, abs=1e-6)
    stored = save(s, tmp_path)
    assert recheck(stored).verified
    shown = said("show", str(stored.result_dir), cwd=tmp_path)
    assert re.search(r"spring knee: [\d.]+ J stored at the start, [\d.]+ J taken up and [\d.]+ J given", shown.stdout)
