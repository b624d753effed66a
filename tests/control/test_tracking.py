"""Following a planned hop: the plant reproduces the plan, and feedback keeps to it with real sensors."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from hopopt.control.closed_loop import Run, make_plant, simulate
from hopopt.control.reference import PhaseReference, PlanReference
from hopopt.control.setting import Setting
from hopopt.control.strategies import BUILT_IN
from hopopt.control.tracking.linearisation import Linearisation
from hopopt.control.tracking.regulator import Noise, kalman, linearised
from hopopt.control.tracking.track import Track
from hopopt.design import Design
from hopopt.drivetrain.drives import Drive
from hopopt.drivetrain.operating_region.half_planes import HalfPlane, OperatingRegion
from hopopt.errors import UsageError
from hopopt.leg.robot import BASE
from hopopt.planner.solution import Solution
from hopopt.problem.load import load
from hopopt.sim.controller import Measurement
from hopopt.sim.encoder import Encoder
from hopopt.sim.plant import Plant
from hopopt.sim.state import State, Timing
from hopopt.verify.table import FLIGHT, NORMALISED_TIMES, STANCE
from once import solved_once

CHEAP = {  # an unrefined plan that keeps the foot pressed: its torques may pass their limits between the nodes
    "solver.refine": False, "solver.stance_intervals": 60, "solver.flight_intervals": 30, "contact.least_force": 60.0,
    "hop.least_height": 0.005, "hop.stance_duration": [0.03, 0.2],
}  # fmt: skip
PERIOD, FINE = 1 / 4000, 1 / 16000


@pytest.fixture(scope="module")
def solution() -> Solution:
    return solved_once(CHEAP)


@pytest.fixture(scope="module")
def plan(solution: Solution) -> PlanReference:
    return PlanReference.from_tables(NORMALISED_TIMES, solution.tables, solution.clearance)


@pytest.fixture(scope="module")
def free(solution: Solution) -> Plant:
    """The leg with drives that give whatever is asked."""
    region = OperatingRegion((HalfPlane("+", 1e-9, 0.0), HalfPlane("-", -1e-9, 0.0)))
    return Plant(solution.robot, Drive([region] * 2))


@pytest.fixture(scope="module")
def tracked(solution: Solution, plan: PlanReference) -> dict[str, Run]:
    """The plan on the machine of the problem file: 4 kHz, 14-bit encoders."""
    return {name: simulate(solution.design, BUILT_IN[name], plan=plan) for name in ("track", "track_pd")}


# ---- the plant and the plan ----------------------------------------------------------------------------------


@pytest.mark.parametrize("phase", [STANCE, FLIGHT])
def test_plant_reproduces_the_plan_interval_by_interval(
    solution: Solution, plan: PlanReference, free: Plant, phase: str
) -> None:
    """From the planned state at each interval's beginning, its torques lead to the planned state at its end."""
    table, reference = solution.tables[phase], getattr(plan, phase)
    for k, times in enumerate(reference.t):
        s, end = State(table.q[k, 0], table.v[k, 0], phase == STANCE, 0.0, t=times[0]), float(times[-1])
        steps = int(np.ceil((end - s.t) / FINE))

        def torque(t: float, q: np.ndarray, v: np.ndarray, end: float = end) -> np.ndarray:
            return reference.at(min(t, end - 1e-8))[2]  # at the edge it may jump

        h = (end - s.t) / steps
        for _ in range(steps):
            s = free.step(s, torque, h)
        np.testing.assert_allclose(s.q, table.q[k, -1], rtol=0, atol=1e-6)
        np.testing.assert_allclose(s.v, table.v[k, -1], rtol=0, atol=1e-6)
        if phase == STANCE:
            np.testing.assert_allclose(free.force(s, torque(end, s.q, s.v)), table.f[k, -1], rtol=0, atol=0.01)


def test_torques_alone_lead_through_the_whole_hop(solution: Solution, plan: PlanReference, free: Plant) -> None:
    """No feedback, no hold, steps that end where torques may jump: lift-off on time, and the planned apex."""
    controller = Track(Setting(solution.design, PERIOD, plan, {"feedback": "none"}))
    lift_off = plan.stance.duration
    breaks = [*plan.stance.edges, *(lift_off + plan.flight.edges)]
    trace = free.run(
        plan.stance.q[0, 0], controller, solution.duration, timing=Timing(PERIOD, hold=False), breaks=breaks
    )
    assert [e.kind for e in trace.events] == ["lift-off"]
    assert trace.events[0].t == pytest.approx(lift_off, abs=1e-8)
    assert solution.tables[STANCE].f[..., 1].min() > 10.0  # or the foot would come off in between
    for name, offset in ((STANCE, 0.0), (FLIGHT, lift_off)):
        table, reference = solution.tables[name], getattr(plan, name)
        edges = [int(np.argmin(np.abs(trace.t - offset - t))) for t in reference.edges[1:-1]]
        np.testing.assert_allclose(trace.t[edges], offset + reference.edges[1:-1], rtol=0, atol=1e-8)
        np.testing.assert_allclose(trace.q[edges], table.q[1:, 0], rtol=0, atol=2e-6)
        np.testing.assert_allclose(trace.v[edges], table.v[1:, 0], rtol=0, atol=1e-5)
    assert trace.energy_error < 1e-8


# ---- feedback --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["track", "track_pd"])
def test_tracking_keeps_the_planned_clearance(tracked: dict[str, Run], plan: PlanReference, name: str) -> None:
    run = tracked[name]
    assert run.figures.clearance > 0.97 * plan.clearance
    assert run.trace.energy_error < 1e-6
    assert run.trace.points["foot"][:, 1].min() > -1e-9
    assert run.trace.f[run.figures.stance, 1].min() >= -1e-6
    parts, budget = run.figures.parts, run.figures.budget
    assert sum(parts.values()) == pytest.approx(run.figures.clearance, abs=1e-14)
    assert sum(budget.values()) == pytest.approx(run.figures.clearance, abs=1e-14)


@pytest.mark.parametrize("offset", [(0.01, -0.01), pytest.param((0.01, 0.01), marks=pytest.mark.slow)])
def test_feedback_brings_the_leg_back_to_the_plan(
    solution: Solution, plan: PlanReference, offset: tuple[float, float]
) -> None:
    """Started a hundredth of a radian off, with motors that leave room: left alone half of it stays, LQG ends it."""
    strong = load("paper", {**CHEAP, "leg.motor.max_torque": 8.0, "leg.motor.max_speed": 6000.0})
    weights = {
        "effort": 30.0,
        "disturbance": 5.0,
        "k_p": 1000.0,
        "k_d": 20.0,
    }  # of the paper's motors: shares of stall torque
    errors = {}
    for feedback in ("none", "pd", "lqr"):
        controller = Track(Setting(strong, PERIOD, plan, {"feedback": feedback, **weights}))
        start = plan.stance.q[0, 0] + np.array(offset)
        trace = make_plant(strong).run(start, controller, 0.19, encoder=Encoder(14, 8, PERIOD))
        assert not trace.events
        errors[feedback] = np.abs(trace.q[-1] - solution.sample([0.19]).q[0])[BASE:].max()
    assert errors["none"] > 0.004
    assert errors["pd"] < 0.75 * errors["none"]
    assert errors["lqr"] < 0.001


@pytest.mark.parametrize("mass", [5.9, pytest.param(5.0, marks=pytest.mark.slow)])
def test_a_leg_of_another_mass_still_flies(solution: Solution, plan: PlanReference, mass: float) -> None:
    run = simulate(solution.design, BUILT_IN["track"], plan=plan, plant=load("paper", {"leg.body.mass": mass}))
    assert run.figures.clearance > 0.85 * plan.clearance
    assert run.trace.energy_error < 1e-6


def test_phase_follows_the_contact_and_not_the_clock(solution: Solution, plan: PlanReference) -> None:
    """Off the ground early, the flight begins then; on it late, the torques that lift it off go on."""
    track = Track(Setting(solution.design, PERIOD, plan, {"feedback": "none"}))
    lasts, still = plan.stance.duration, np.zeros(2)

    def asked(t: float, contact: bool, since: float) -> np.ndarray:
        return track.torque(Measurement(t, still, still, contact, since, 0))

    np.testing.assert_allclose(asked(0.05, True, 0.05), plan.stance.at(0.05)[2])
    early = 0.97 * lasts
    np.testing.assert_allclose(asked(early, False, 0.0), plan.flight.at(0.0)[2])
    np.testing.assert_allclose(asked(early + 0.01, False, 0.01), plan.flight.at(0.01)[2])
    late = Track(Setting(solution.design, PERIOD, plan, {"feedback": "none"}))
    now = Measurement(lasts + 0.02, still, still, True, lasts + 0.02, 0)
    np.testing.assert_allclose(late.torque(now), plan.flight.at(0.0)[2])
    np.testing.assert_allclose(
        late.torque(replace(now, t=now.t + 0.03, contact=False, since=0.0)), plan.flight.at(0.0)[2]
    )


def test_on_the_plan_feedback_asks_for_nothing(solution: Solution, plan: PlanReference) -> None:
    """Both kinds of feedback ask for the plan's mean torque over the period, and oppose an error of a knee."""
    t = 40 * PERIOD
    q, v, _ = plan.stance.at(t)
    mean = plan.stance.mean_torque(t, t + PERIOD)
    pd = Track(Setting(solution.design, PERIOD, plan, {"feedback": "pd"}))
    np.testing.assert_allclose(pd.torque(Measurement(t, q, v, True, t, 0)), mean, atol=1e-9)
    off = pd.torque(Measurement(t, q + np.array([0.0, 0.01]), v, True, t, 0)) - mean
    np.testing.assert_allclose(off, [0.0, -10.0], atol=1e-9)


def test_mean_torque_gives_the_plans_impulse(plan: PlanReference) -> None:
    """Periods add up to the whole phase, wherever the intervals' edges lie."""
    for phase in (plan.stance, plan.flight):
        cuts = np.append(np.arange(0, phase.duration, PERIOD), phase.duration)
        by_period = sum(phase.mean_torque(a, b) * (b - a) for a, b in pairwise(cuts))
        whole = phase.mean_torque(0.0, phase.duration) * phase.duration
        np.testing.assert_allclose(by_period, whole, rtol=1e-9, atol=1e-9)
        exact = sum(gauss(phase, a, b) for a, b in pairwise(phase.edges))
        np.testing.assert_allclose(whole, exact, rtol=0.01, atol=0.01)


def gauss(phase: PhaseReference, a: float, b: float) -> np.ndarray:
    """Integral of tau over one interval, exact for its polynomial."""
    places, weights = np.polynomial.legendre.leggauss(9)
    values = np.array([phase.at(a + (b - a) * (x + 1) / 2)[2] for x in places])
    return weights @ values * (b - a) / 2


# ---- what the regulator stands on ----------------------------------------------------------------------------------


@pytest.mark.parametrize("contact", [True, False])
def test_linearised_motion_is_the_plants_own(
    solution: Solution, plan: PlanReference, free: Plant, contact: bool
) -> None:
    """A, B of one control period against two runs of the plant a little apart."""
    phase, period, k = (plan.stance if contact else plan.flight), PERIOD, 201  # between two times of the grid
    A, B = (found[k] for found in linearised(free.machine, phase, period, contact))
    t = k * period
    q, v, tau = phase.at(t)

    def after(dx: np.ndarray, du: np.ndarray) -> np.ndarray:
        qj, vj = q + dx[:2], v + dx[2:]
        if contact:
            terms = free.machine.stance_terms(qj, vj)
            s = State(terms.q, terms.v, contact=True, foot=0.0)
        else:
            s = State(
                np.concatenate([np.zeros(BASE), qj]), np.concatenate([np.zeros(BASE), vj]), contact=False, foot=0.0
            )
        s = free.step(s, lambda t, q, v: tau + du, period)
        return np.concatenate([s.q[BASE:], s.v[BASE:]])

    size = 1e-4
    moved = np.array([(after(size * e, np.zeros(2)) - after(-size * e, np.zeros(2))) / (2 * size) for e in np.eye(4)]).T
    pushed = np.array([(after(np.zeros(4), e) - after(np.zeros(4), -e)) / 2 for e in np.eye(2)]).T
    np.testing.assert_allclose(A, moved, rtol=0, atol=0.02 * np.abs(moved - np.eye(4)).max())
    np.testing.assert_allclose(B, pushed, rtol=0, atol=0.02 * np.abs(pushed).max())


def test_joint_acceleration_is_the_plants(plan: PlanReference, free: Plant) -> None:
    for contact, phase in ((True, plan.stance), (False, plan.flight)):
        q, v, tau = phase.at(0.08)
        found = Linearisation(free.machine).answers(np.concatenate([q, v, tau])[None], contact)[0]
        terms = free.machine.stance_terms(q, v)
        whole = free.machine.acceleration(terms.q, terms.v, tau, contact)
        np.testing.assert_allclose(found[:2], whole[BASE:], rtol=1e-8, atol=1e-8)
        force = terms.contact_force(tau) if contact else np.zeros(BASE)
        np.testing.assert_allclose(found[2:], force, rtol=1e-8, atol=1e-8)


def test_feedback_gains_make_the_stance_contract(solution: Solution, plan: PlanReference) -> None:
    """Errors of angle and speed carried through all periods by A - B K: without feedback they grow."""
    gains = Track(Setting(solution.design, PERIOD, plan)).gains[True]
    open_loop, closed = np.eye(4), np.eye(4)
    for A, B, K in zip(gains.A, gains.B, gains.K, strict=True):
        open_loop, closed = A @ open_loop, (A - B @ K) @ closed
    scale = np.diag([0.01, 0.01, 0.3, 0.3])  # what counts alike
    grown, shrunk = (np.linalg.norm(np.linalg.solve(scale, x @ scale), 2) for x in (open_loop, closed))
    assert grown > 3.0
    assert shrunk < 0.1


def test_the_filter_predicts_with_the_matrices_that_lead_to_the_next_step(
    solution: Solution, plan: PlanReference
) -> None:
    """Errors that move by matrices of their own in every period, measured without noise: the filter is right throughout."""
    track, rng = Track(Setting(solution.design, PERIOD, plan)), np.random.default_rng(0)
    track.step = 1e-15  # of encoders that round nothing
    usual = track.gains[True]
    A = usual.A + rng.normal(0, 0.05, usual.A.shape)
    B = usual.B * rng.uniform(0.5, 1.5, (len(usual.B), 1, 1))
    track.gains = {True: replace(usual, A=A, B=B, K=rng.normal(0, 10, usual.K.shape))}
    x = np.array([1e-3, -1e-3, 0.0, 0.0])  # the filter begins with the measured angles and the planned speeds
    for k in range(8):
        q, v, tau = track.planned(Measurement(k * PERIOD, x[:2], x[2:], True, k * PERIOD, 0))
        command = track.torque(Measurement(k * PERIOD, q + x[:2], v + x[2:], True, k * PERIOD, 0))
        assert track.state is not None
        np.testing.assert_allclose(track.state.error, x, rtol=1e-9, atol=1e-12)
        x = A[k] @ x + B[k] @ (command - tau)


@pytest.mark.parametrize("bits", [8, 14, 24, 32])
@pytest.mark.parametrize("period", [1e-3, PERIOD, 1.25e-4])
def test_the_filter_settles_without_ringing_for_every_encoder(bits: int, period: float) -> None:
    """A wheel turned by unknown torques: its errors die out, and none turns about from one reading to the next."""
    A, B = np.array([[1.0, period], [0.0, 1.0]]), np.array([[period**2 / 2], [period]]) / 0.01
    noise = Noise(2 * np.pi / 2**bits / 12**0.5, 5.0 * (PERIOD / period) ** 0.5, 0.0, 0.0)
    L = kalman(np.array([A] * 4000), np.array([B] * 4000), period, noise)[-1]
    settles = np.linalg.eigvals(A - A @ L @ np.array([[1.0, 0.0]]))
    assert np.abs(settles).max() < 1 - 5 * period
    assert settles.real.min() > -0.3


def test_feedback_and_filter_are_the_same_at_every_rate(solution: Solution, plan: PlanReference) -> None:
    """Twice the rate weighs as much per time: away from the phase's ends the gains differ by what a held torque delays."""
    slow, fast = (Track(Setting(solution.design, period, plan)).gains[True] for period in (PERIOD, PERIOD / 2))
    K, twice = slow.K[100:500:100], fast.K[200:1000:200]
    assert np.abs(K - twice).max() < 0.1 * np.abs(twice).max()


def test_a_reading_within_half_a_step_says_nothing_of_a_joint_at_rest(solution: Solution, plan: PlanReference) -> None:
    """What rounds alike is no news; beyond half a step only what is beyond it counts, and of a fast joint all."""
    track = Track(Setting(solution.design, PERIOD, plan))
    half, rest = np.pi / 2**14, np.zeros(2)
    np.testing.assert_array_equal(track.missed(np.array([0.9, -0.9]) * half, rest), 0.0)
    np.testing.assert_allclose(track.missed(np.array([3.0, -1.5]) * half, rest), np.array([2.0, -0.5]) * half)
    apart, fast = np.array([0.9, 3.0]) * half, np.full(2, 2 * half / PERIOD)
    np.testing.assert_allclose(track.missed(apart, fast), apart)


def test_the_tracker_makes_up_for_what_gears_take(plan: PlanReference) -> None:
    """On the plan it asks for as much more as the gears lose where they drive, as much less where they brake."""
    lossy = load(
        "paper",
        {**CHEAP, "simulation.gear_efficiency": 0.8, "simulation.gear_friction": 2.0, "leg.motor.max_torque": 8.0},
    )
    track = Track(Setting(lossy, PERIOD, plan))
    drive, w = track.drive, np.array([3.0, -3.0])
    for tau in (np.array([40.0, 40.0]), np.array([-40.0, 1.0])):
        np.testing.assert_allclose(drive.passed(w, drive.needed(w, tau)), tau, rtol=1e-12)
    driving, braking = drive.needed(w, np.array([40.0, 40.0]))
    assert driving == pytest.approx(40.0 / 0.8 + 2.0, rel=1e-4)
    assert braking == pytest.approx(40.0 * 0.8 - 2.0, rel=1e-4)
    t = 400 * PERIOD
    q, v, _ = plan.stance.at(t)
    asked = track.torque(Measurement(t, q, v, True, t, 0))
    a = (plan.stance.at(t + PERIOD)[1] - v) / PERIOD
    np.testing.assert_allclose(drive.passed(v, asked, a), plan.stance.mean_torque(t, t + PERIOD), rtol=0, atol=1e-6)


# ---- what a user asks for ------------------------------------------------------------------------------------------


def test_unusable_options_are_said_in_a_sentence(solution: Solution, plan: PlanReference) -> None:
    for options, says in (
        ({"feedback": "lqq"}, "strategy track: feedback = 'lqq': choose one of lqr, pd, none"),
        ({"anlge": 1.0}, "strategy track: there is no option 'anlge': choose one of feedback, angle, speed"),
        ({"effort": 0.0}, "strategy track: effort = 0: it must be greater than 0"),
        ({"effort": "much"}, "strategy track: effort = 'much': a number is needed"),
    ):
        with pytest.raises(UsageError) as error:
            simulate(solution.design, BUILT_IN["track"], plan=plan, options=options)
        assert str(error.value).startswith(says)


def test_tracking_without_a_plan_is_refused() -> None:
    design: Design = load("paper")
    with pytest.raises(UsageError, match="needs a planned hop to follow"):
        simulate(design, BUILT_IN["track"])
    assert make_plant(design).n == 2
