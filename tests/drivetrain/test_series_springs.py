"""A spring between a drive and its joint: its resonance in closed form, its limit, and its hop integrated by other code."""

import re
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import BarycentricInterpolator

from command_line import said
from hopopt.drivetrain.dynamics import added_states
from hopopt.errors import ProblemFileError, UsageError
from hopopt.leg.files.export import to_mjcf, to_urdf
from hopopt.leg.robot import BASE, build_robot
from hopopt.ocp.guesses.motion import MovingLeg
from hopopt.ocp.phases import flight, stance
from hopopt.ocp.problem import Instant, stack, symbols
from hopopt.planner.motion import PlanEvaluator
from hopopt.planner.solution import Solution
from hopopt.planner.solve import solve
from hopopt.problem.load import load
from hopopt.sim.machine import Machine
from hopopt.storage.seal.recheck import recheck
from hopopt.storage.solution import save
from hopopt.studies.sensitivity import sensitivity
from hopopt.verify.measures import positive_work
from hopopt.verify.table import NORMALISED_TIMES
from once import solved_once

SPRING = "leg.knee.series_spring"
SOFT = (f"{SPRING}.stiffness=300", f"{SPRING}.damping=5")  # N m/rad, N m s/rad


def leg_of_one_joint(tmp_path: Path, stiffness: float) -> Any:
    """A link of 0.4 m and 2 kg under a body of 3 kg, with a rotor of 0.1 kg m^2 behind a spring."""
    text = f"""
name = "one"
[leg]
joints = ["hip"]
links = ["thigh"]
body.mass = 3.0
thigh = {{length = 0.4, mass = 2.0}}
hip = {{lower = -1.5, upper = 1.5, series_spring = {{stiffness = {stiffness}}}}}
motor = {{max_torque = 2.0, max_speed = 1000.0, rotor_inertia = 1e-5}}
gear.ratio = 100
[start]
joint_angles = [0.3]
"""
    (tmp_path / "one.toml").write_text(text)
    return load(tmp_path / "one.toml")


def test_a_joint_and_its_drive_swing_against_each_other_as_two_masses_on_a_spring(tmp_path: Path) -> None:
    """In flight, no torque asked: omega^2 = k (1 / A + 1 / I), I of the link beside a body that gives way. By the eigenvalues of
    the planner's equations, and by Pinocchio's and the drive's rates integrated over one period."""
    design, k, rotor = leg_of_one_joint(tmp_path, 80.0), 80.0, 0.1
    seen = 2.0 * 0.4**2 / 12 + 3.0 * 2.0 / 5.0 * 0.2**2  # about its centre, and of the reduced mass at its lever
    omega = np.sqrt(k * (1 / rotor + 1 / seen))

    leg = MovingLeg(design)
    phase = flight(leg).phase
    x, u = symbols(phase.states), symbols(phase.controls)
    rates = stack(phase.dynamics(Instant(**x, **u, t=0.0, p=leg.robot.parameters)), phase.states)
    states, controls = stack(x, phase.states), stack(u, phase.controls)
    jacobian = ca.Function("A", [states, controls], [ca.jacobian(rates, states)])(0.0, 0.0).full()
    assert np.abs(np.linalg.eigvals(jacobian).imag).max() == pytest.approx(omega, rel=1e-6)

    robot = build_robot(design.leg)
    machine, drive = Machine(robot), added_states(design.leg, robot.parameters)

    def pinocchio(t: float, y: np.ndarray) -> np.ndarray:
        q, v, own = np.split(y, [3, 6])
        tau = np.array(drive.torques(own, [0.0], v[BASE:]))
        return np.concatenate([v, machine.acceleration(q, v, tau, False), drive.rates(own, [0.0], v[BASE:])])

    small = 1e-5  # rad: so small that the link's turning changes nothing
    start = np.r_[np.zeros(6), small, 0.0]
    end = solve_ivp(pinocchio, (0.0, 2 * np.pi / omega), start, "DOP853", rtol=1e-12, atol=1e-18).y[:, -1]
    assert end[-2:] / small == pytest.approx([1.0, 0.0], abs=1e-6)


@pytest.mark.parametrize(
    ("entries", "words"),
    [
        ([f"{SPRING}.stiffness=0"], f"{SPRING}.stiffness = 0 N m/rad is too small"),
        ([f"{SPRING}.damping=1"], f"{SPRING}.stiffness is missing"),
        ([*SOFT, "leg.motor.rotor_inertia=0"], f"{SPRING} needs a drive with inertia: give leg.motor.rotor_inertia"),
        ([*SOFT, "leg.motor.torque_rate=50"], f"{SPRING} does not go with leg.motor.torque_rate = 50"),
        ([*SOFT, "leg.hip.transmission.linear.slope=0.1"], f"{SPRING} does not go with leg.hip.transmission"),
    ],
)
def test_a_series_spring_that_cannot_be_is_one_sentence(entries: list[str], words: str) -> None:
    with pytest.raises(ProblemFileError) as error:
        load("paper", entries)
    assert len(error.value.problems) == 1
    assert words in error.value.problems[0]


def test_what_does_not_know_it_says_so_and_what_to_leave_out(tmp_path: Path) -> None:
    robot = build_robot(load("paper", SOFT).leg)
    for write in (to_urdf, to_mjcf):
        with pytest.raises(UsageError, match=f"does not know series springs: leave out {re.escape(SPRING)}"):
            write(robot)
    settings = [part for entry in SOFT for part in ("--set", entry)]
    said_so = said("simulate", "paper", *settings, cwd=tmp_path)
    assert said_so.returncode
    assert f"a simulation with a controller does not know series springs: leave out {SPRING}" in said_so.stderr


def by_its_torques(s: Solution, stiffness: float, damping: float) -> float:
    """Clearance [m] of a plan's torques, with the motor's own angle as a state, by Pinocchio and SciPy from the start pose on."""
    machine, first, rotor = Machine(s.robot), s.tables["stance"], 100.0**2 * s.design.leg.motor.rotor_inertia
    held = machine.stance_terms(first.q[0, 0, BASE:], np.zeros(2)).joint_bias[1]

    def rates(t: float, y: np.ndarray, torque: Any, contact: bool) -> np.ndarray:
        q, v, theta, turn = y[:4], y[4:8], y[8], y[9]
        hip, knee = torque(t)
        spring = stiffness * (theta - q[-1]) + damping * (turn - v[-1])
        return np.r_[v, machine.acceleration(q, v, np.array([hip, spring]), contact), turn, (knee - spring) / rotor]

    y = np.r_[first.q[0, 0], np.zeros(4), first.q[0, 0, -1] + held / stiffness, 0.0]
    for name, table in s.tables.items():
        for t, asked in zip(table.t, table.asked, strict=True):
            torque = BarycentricInterpolator(t[0] + (t[-1] - t[0]) * NORMALISED_TIMES, asked)
            more = {"args": (torque, name == "stance"), "rtol": 1e-9, "atol": 1e-9}
            y = solve_ivp(rates, t[[0, -1]], y, "DOP853", **more).y[:, -1]
    return min(z for name, (_, z) in machine.points(y[:4]).items() if name != "com")


def test_states_of_drives_are_found_beside_those_of_heat() -> None:
    thermal = {
        "winding_to_housing": 4.6,
        "housing_to_ambient": 1.8,
        "winding_time_constant": 30,
        "housing_time_constant": 1e3,
    }
    more = {**thermal, "winding_resistance": 0.9, "torque_constant": 0.04, "winding_limit": 100}
    design = load("paper", [*SOFT, *(f"leg.motor.{name}={value}" for name, value in more.items())])
    states = stance(MovingLeg(design)).phase.states
    assert [v.name for v in states] == ["q", "v", "drive", "rises"]
    assert PlanEvaluator(design, build_robot(design.leg)).of_drives["stance"].tolist() == [4, 5]


@pytest.mark.slow
def test_the_papers_leg_with_a_soft_drive_is_verified_and_other_code_reaches_its_height(tmp_path: Path) -> None:
    s = solved_once(SOFT)
    assert s.summary.verified, s.summary.failed_checks
    assert s.summary.certified
    assert s.summary.clearance_m > 1.2  # 0.7994 m where the drive is stiff
    assert by_its_torques(s, 300.0, 5.0) == pytest.approx(s.summary.clearance_m, abs=2e-4)
    assert s.summary.series_springs is not None
    energy, deflection = s.summary.series_springs["knee"], s.tables["stance"].drive
    assert deflection is not None
    assert energy.at_start_J == pytest.approx(300 * deflection[0, 0, 0] ** 2 / 2, rel=1e-9)
    at_lift_off = 300 * deflection[-1, -1, 0] ** 2 / 2
    assert energy.at_start_J + energy.taken_J - energy.given_J == pytest.approx(at_lift_off, abs=1e-6)
    stored = save(s, tmp_path)
    assert recheck(stored).verified
    shown = said("show", str(stored.result_dir), cwd=tmp_path)
    assert re.search(r"series spring of the knee: [\d.]+ J stored at the start", shown.stdout)


@pytest.mark.rarely
def test_where_the_springs_are_ever_stiffer_the_answer_becomes_that_of_the_stiff_leg() -> None:
    """On one mesh, unrefined; it falls as 1 / k, so that ten times the stiffness leaves a tenth."""
    mesh = (
        "solver.refine=false",
        "solver.stance_intervals=20",
        "solver.flight_intervals=5",
        "hop.stance_duration=[0.05, 0.2]",
    )

    def clearance(stiffness: float | None) -> float:
        own = {"stiffness": stiffness, "damping": 310 * ((stiffness or 0) / 1e6) ** 0.5}
        entries = [f"leg.{joint}.series_spring.{name}={x}" for joint in ("hip", "knee") for name, x in own.items()]
        return solve(load("paper", [*mesh, *(entries if stiffness else ())]), starts=1, processes=1).clearance

    stiff = clearance(None)
    more = [clearance(stiffness) - stiff for stiffness in (1e6, 1e7)]
    assert 0 < more[1] < 1e-4
    assert more[0] / more[1] == pytest.approx(10, rel=0.1)


@pytest.mark.rarely
def test_what_a_softer_spring_brings_is_told_before_it_is_tried() -> None:
    """By multipliers, and by a hop solved again with 1 % more."""
    s, path = solved_once(SOFT), f"{SPRING}.stiffness"
    told = {i.name: i.per_unit for i in sensitivity(s)}[path]
    again = solved_once((f"{path}=303", SOFT[1]))
    assert (again.clearance - s.clearance) / 3 == pytest.approx(told, rel=0.05)


@pytest.mark.rarely
def test_a_periodic_hop_takes_least_work_where_the_body_swings_once_on_its_spring() -> None:
    """A softer and a stiffer spring take more; at the best the motor stands still in the middle half of stance, whose time is that of
    half a swing of a body that rises straight, and what weight and hip add to it."""
    hop = ("hop.kind=periodic", "hop.touchdown_loss=1", "hop.clearance=0.3", "hop.stance_duration=[0.15, 0.1501]")
    mesh = ("solver.refine=false", "solver.stance_intervals=40", "solver.flight_intervals=12")
    pose = ("leg.knee.lower=-1.3", "start.joint_angles=[0.6, -1.2]", f"{SPRING}.damping=1")
    found = {k: solved_once([*hop, *mesh, *pose, f"{SPRING}.stiffness={k}"], "energy") for k in (150, 400, 800)}
    work = {k: positive_work(s.robot, s.tables, s.design.hop) for k, s in found.items()}
    assert 1.3 * work[400] < min(work[150], work[800])
    table, machine = found[400].tables["stance"], Machine(found[400].robot)
    assert table.drive is not None
    t, turn = table.t.ravel(), table.drive[..., 1].ravel()
    assert np.abs(turn[np.abs(t - 0.075) < 0.0375]).max() < 0.1  # rad/s; without load it turns at 12.6
    halves = []
    for q in table.q[..., BASE:].reshape(-1, 2):
        terms = machine.stance_terms(q, np.zeros(2))
        rising = np.array([-terms.jacobian[0, 1] / terms.jacobian[0, 0], 1.0])  # the hip keeps the body over the foot
        halves.append(np.pi * np.sqrt(rising @ terms.mass_matrix @ rising / 400))
    assert 0.7 < np.mean(halves) / 0.15 < 1.0
