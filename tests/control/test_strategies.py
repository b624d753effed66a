"""The paper's strategies on the simulated leg: what every run must keep to, and that they hop on and on."""

import sys
from collections.abc import Mapping
from importlib.metadata import EntryPoint
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from hopopt.control import strategies
from hopopt.control.closed_loop import Run, make_plant, simulate
from hopopt.control.paper_pd import Force, Position
from hopopt.control.setting import Setting
from hopopt.control.strategies import BUILT_IN, Strategy, find
from hopopt.design import Design
from hopopt.drivetrain.motor import rated
from hopopt.drivetrain.operating_region.region import operating_region
from hopopt.errors import UsageError
from hopopt.leg.robot import BASE
from hopopt.problem.load import load
from hopopt.sim.controller import Measurement
from hopopt.sim.plant import Plant
from hopopt.sim.state import State
from hopopt.sim.trace import Trace

PAPERS = ("force", "force_tuck", "position", "position_tuck")
PERFECT = {"simulation.encoder_bits": 0}


@pytest.fixture(scope="module")
def paper() -> Design:
    return load("paper")


@pytest.fixture(scope="module")
def runs(paper: Design) -> dict[str, Run]:
    """Two hops of every strategy of the paper, as the problem file describes the machine."""
    return {name: simulate(paper, BUILT_IN[name], hops=2) for name in PAPERS}


def rise_if_free(plant: Plant, trace: Trace, k: int) -> float:
    """Vertical acceleration [m/s^2] of the foot if the ground let it go."""
    m, q, v = plant.machine, trace.q[k], trace.v[k]
    tau = trace.tau[k] + plant.stops.torque(q[BASE:], v[BASE:])
    a = pin.aba(m.model, m.data, q, v, np.concatenate([np.zeros(BASE), tau]))
    return float(m.foot_acceleration(q, v, a)[1])


# ---- what every run keeps to --------------------------------------------------------------------------------


@pytest.mark.parametrize("name", PAPERS)
def test_energy_balance_closes(runs: dict[str, Run], name: str) -> None:
    assert runs[name].trace.energy_error < 1e-6


@pytest.mark.parametrize("name", PAPERS)
def test_foot_stays_above_ground_and_the_ground_never_pulls_a_foot_that_would_rise(
    runs: dict[str, Run], paper: Design, name: str
) -> None:
    trace, plant = runs[name].trace, make_plant(paper)
    foot = trace.points["foot"]
    assert foot[:, 1].min() > -1e-9
    np.testing.assert_allclose(foot[trace.contact, 1], 0, atol=1e-9)
    for k in np.flatnonzero(trace.contact & (trace.f[:, 1] < -1e-6)):
        assert rise_if_free(plant, trace, int(k)) < 1e-6
    assert trace.f[runs[name].figures.stance, 1].min() >= -1e-6  # never in the hop that is compared
    assert not trace.f[~trace.contact].any()
    for begin, end in stances(trace):
        assert np.ptp(foot[begin:end, 0]) < 1e-9  # it does not slip either


def stances(trace: Trace) -> list[tuple[int, int]]:
    edges = np.flatnonzero(np.diff(np.concatenate([[0], trace.contact, [0]])))
    return [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]


@pytest.mark.parametrize("name", PAPERS)
def test_torques_stay_in_the_operating_regions(runs: dict[str, Run], paper: Design, name: str) -> None:
    trace = runs[name].trace
    for k, joint in enumerate(trace.robot.joints):
        low, high = operating_region(paper.leg, joint, trace.robot.parameters).torque_bounds(trace.v[:, BASE + k])
        assert np.all((trace.motor[:, k] <= high + 1e-9) & (trace.motor[:, k] >= low - 1e-9))


@pytest.mark.parametrize("name", PAPERS)
def test_parts_and_budget_sum_to_the_clearance(runs: dict[str, Run], name: str) -> None:
    """To rounding; and the parts are what they are called, read off the trace."""
    f = runs[name].figures
    assert f.clearance > 0.3
    assert sum(f.parts.values()) == pytest.approx(f.clearance, abs=1e-14)
    assert sum(f.budget.values()) == pytest.approx(f.clearance, abs=1e-14)
    trace, k = f.trace, int(np.searchsorted(f.trace.t, f.trace.times_of("lift-off")[0]))
    com, speed = trace.points["com"][k, 1], trace.com_v[k, 1]
    assert f.parts["com_height_at_lift_off_m"] == pytest.approx(com, abs=1e-12)
    assert f.budget["push_m"] == pytest.approx(com + speed**2 / (2 * 9.81), abs=1e-12)
    assert f.budget["timing_m"] <= 1e-9  # no flight goes above its own apex


@pytest.mark.parametrize("name", PAPERS)
def test_clearance_is_the_highest_of_the_lowest_points(runs: dict[str, Run], paper: Design, name: str) -> None:
    """By hand, over the first flight, the foot within its window."""
    trace, f = runs[name].trace, runs[name].figures
    lift_off, touchdown = trace.times_of("lift-off")[0], trace.times_of("touchdown")[0]
    points = trace.points
    ok = (trace.t > lift_off) & (trace.t < touchdown)
    ok &= np.abs(points["foot"][:, 0] - points["hip"][:, 0]) <= paper.hop.foot_window
    by_hand = np.min([points[p][:, 1] for p in ("hip", "knee", "foot")], axis=0)[ok].max()
    assert f.clearance == pytest.approx(by_hand, abs=1e-12)
    assert f.lift_off["time_s"] == lift_off


def test_losses_and_weak_motors_cost_push_and_the_balance_still_closes(paper: Design, runs: dict[str, Run]) -> None:
    lossy = load("paper", {"simulation.gear_efficiency": 0.8, "simulation.gear_friction": 2.0})
    weak = np.array([0.7, 0.7])  # 0.9 would cost 13 mm: the motors are short of speed rather than of torque
    for run in (simulate(lossy, BUILT_IN["force"]), simulate(paper, BUILT_IN["force"], torque_gain=weak)):
        assert run.trace.energy_error < 1e-6
        assert run.figures.budget["push_m"] < runs["force"].figures.budget["push_m"] - 0.02
        lost = np.diff(run.trace.work[:, 1])
        assert np.all(lost >= 0) if run.design is lossy else not lost.any()
    span, (torque, speed), ratio = run.figures.stance, rated(paper.leg, "knee"), paper.leg.gear.ratio
    motor, w = run.trace.motor[span, 1], run.trace.v[span, -1]
    driving = (motor > 1.0) & (w > 0.1)
    full = 0.7 * (1 - 0.7 * w[driving] * ratio / speed) * torque * ratio  # of the true motor, whose back-EMF is less
    np.testing.assert_allclose(run.figures.saturation(1)[driving], np.minimum(motor[driving] / full, 1.0), rtol=1e-9)
    assert driving.sum() > 50


# ---- hopping on and on ----------------------------------------------------------------------------------------


def hops_on(run: Run, hops: int) -> None:
    """Phases alternate, the leg stays upright, and after the first hops every period is alike."""
    trace = run.trace
    assert trace.outcome == f"landing {hops}"
    assert trace.energy_error < 1e-6
    assert trace.points["foot"][:, 1].min() > -1e-9
    assert [e.kind for e in trace.events] == ["lift-off", "touchdown"] * (len(trace.events) // 2) + (
        ["lift-off"] if len(trace.events) % 2 else []
    )
    times = [e.t for e in trace.events]
    assert times == sorted(times)
    off, down = (np.array(trace.times_of(kind)) for kind in ("lift-off", "touchdown"))
    off = off[: len(down)]
    flown = down - off > 0.02  # the others are bounces, at most one control period after a landing
    assert flown.sum() == hops
    assert np.all((off[1:] - down[:-1])[~flown[1:]] < 1e-3)
    periods = np.diff(off[flown])
    assert np.ptp(periods[2:]) < 0.1 * periods.mean()
    apex = [
        trace.points["hip"][(trace.t > a) & (trace.t < b), 1].max()
        for a, b in zip(off[flown], down[flown], strict=True)
    ]
    assert min(apex) > 0.95 * max(apex)
    lean = trace.points["hip"][:, 0] - trace.points["foot"][:, 0]
    assert np.abs(lean[trace.contact]).max() < 0.1


@pytest.mark.rarely
def test_force_control_hops_twenty_times(paper: Design) -> None:
    """With 14-bit encoders at 4 kHz."""
    assert (paper.simulation.encoder_bits, paper.simulation.control_rate) == (14, 4000)
    hops_on(simulate(paper, BUILT_IN["force"], hops=20), 20)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["force_tuck", "position", "position_tuck"])
def test_the_others_hop_on_too(paper: Design, name: str) -> None:
    hops_on(simulate(paper, BUILT_IN[name], hops=5), 5)


@pytest.mark.slow
@pytest.mark.parametrize(
    "changes",
    [
        {"simulation.gear_efficiency": 0.8, "simulation.gear_friction": 2.0},
        {"simulation.torque_delay": 0.0005},
        {"simulation.encoder_bits": 12},
        {"simulation.control_rate": 1000.0},
        {"leg.motor.laws": ["four-quadrant"]},
        {"leg.motor.max_torque": 1.5},
        {"leg.body.mass": 4.0},
        {"start.hip_height": 0.32},
    ],
    ids=str,
)
def test_force_control_hops_on_with_other_machines(changes: dict[str, Any]) -> None:
    """Nothing in it is tuned to one leg: losses, delay, coarse encoders, another motor, mass or crouch."""
    hops_on(simulate(load("paper", changes), BUILT_IN["force"], hops=5), 5)


def test_phase_logic_counts_hops_and_not_bounces(paper: Design) -> None:
    """What the controller is told: landings go up by one after each flight, since is the time in the phase."""
    heard: list[Measurement] = []

    class Listening(Force):
        def torque(self, now: Measurement) -> np.ndarray:
            heard.append(now)
            return super().torque(now)

    run = simulate(paper, Strategy("listening", "force, and notes", Listening), hops=3)
    off, down = run.trace.times_of("lift-off"), run.trace.times_of("touchdown")
    flights = [(a, b) for a, b in zip(off, down, strict=False) if b - a > 0.02]
    for now in heard:
        assert now.landings == sum(b <= now.t for _, b in flights)
        flying = any(a < now.t < b for a, b in zip(off, down, strict=False))
        assert now.contact != flying or min(abs(now.t - t) for t in (*off, *down)) < 1e-9
        last = max([0.0, *(t for pair in flights for t in pair if t <= now.t)])
        if (
            min((abs(now.t - t) for t in off), default=1) > 0.02
            and min((abs(now.t - t) for t in down), default=1) > 0.02
        ):
            assert now.since == pytest.approx(now.t - last, abs=1e-9)
    np.testing.assert_allclose(np.diff([now.t for now in heard]), 1 / 4000, atol=1e-12)


# ---- force control ------------------------------------------------------------------------------------------------


def test_force_control_with_a_step_saturates_the_knee_and_stays_on_the_plumb_line() -> None:
    """Perfect sensors: the knee on its bound through the whole push, the body above the foot to a millimetre."""
    run = simulate(load("paper", PERFECT), BUILT_IN["force"], options={"stance": "step"})
    f, trace = run.figures, run.trace
    assert f.saturation_mean["knee"] > 0.95
    assert f.saturation_mean["hip"] < 0.5
    foot = trace.points["foot"][f.stance, 0]
    assert np.abs(trace.q[f.stance, 0] - foot).max() < 1e-3


def test_force_control_is_the_papers_clamped_law(paper: Design) -> None:
    """The knee's command in the first stance is the paper's eqs. 10 and 14 at every control instant."""
    asked: list[tuple[Measurement, np.ndarray]] = []

    class Noting(Force):
        def torque(self, now: Measurement) -> np.ndarray:
            tau = super().torque(now)
            asked.append((now, tau))
            return tau

    simulate(paper, Strategy("noting", "force, and notes", Noting))
    servo = Force(Setting(paper, 1 / 4000))
    region = operating_region(paper.leg, "knee", make_plant(paper).robot.parameters)
    stance = [(now, tau) for now, tau in asked if now.contact and not now.landings]
    assert len(stance) > 300
    for now, tau in stance:
        y, _ = servo.two_mass.stance_reference(servo.begin + now.since)
        wanted = -5424.0 * (now.q - servo.angles(float(y))) - 9.0 * now.v
        assert tau[1] == pytest.approx(float(region.clamp(now.v[1], wanted[1])), rel=1e-9, abs=1e-9)


def test_braking_in_landing_is_even_and_ends_at_the_height_of_the_start(runs: dict[str, Run], paper: Design) -> None:
    """z'' = v^2 / (2 distance) all the way is constant deceleration: the lowest point of each stance is the start's."""
    trace = runs["force"].trace
    lowest = [float(trace.points["hip"][a:b, 1].min()) for a, b in stances(trace) if b - a > 100]
    assert lowest[0] == pytest.approx(0.28, abs=1e-4)
    np.testing.assert_allclose(lowest[1:], 0.28, atol=0.02)


# ---- position control ----------------------------------------------------------------------------------------------


def test_position_control_follows_the_reference_as_stiffly_as_k_p_allows() -> None:
    """Strong motors, no rotors, from the reference's own motion: the error is the torque it takes, over k_p."""
    design = load("paper", {"leg.motor.max_torque": 100.0, "leg.motor.max_speed": 6000.0, **PERFECT})
    plant, servo = make_plant(design), Position(Setting(design, 1 / 4000, None, {"k_d": 90.0}))
    y, rate = (float(x) for x in servo.two_mass.stance_reference(servo.begin))
    angles, rates = servo.with_rates(y, rate)
    s = plant.machine.stance_terms(angles, rates)
    trace = plant.run(State(s.q, s.v, contact=True, foot=0.0), servo, 0.06)
    assert trace.contact.all()
    wanted = np.array(
        [servo.with_rates(*(float(x) for x in servo.two_mass.stance_reference(servo.begin + t)))[0] for t in trace.t]
    )
    error = np.abs(trace.q[:, BASE + 1] - wanted[:, 1])
    settled = trace.t > 0.03
    assert error[settled].max() < 1.5 * np.abs(trace.motor[:, 1]).max() / servo.options.k_p
    assert error[settled].max() < 0.05


def test_position_control_asks_for_no_more_than_its_law(paper: Design) -> None:
    """On the reference it asks for nothing; off it, k_p times the error at the knee."""
    servo = Position(Setting(paper, 1 / 4000))
    y, rate = (float(x) for x in servo.two_mass.stance_reference(servo.begin))
    angles, rates = servo.with_rates(y, rate)
    on = servo.torque(Measurement(0.0, angles, rates, True, 0.0, 0))
    np.testing.assert_allclose(on, 0, atol=0.05)  # of 200 N m: the reference's own derivative is a difference
    off = servo.torque(Measurement(0.0, angles + np.array([0.0, 0.01]), rates, True, 0.0, 0))
    assert off[1] == pytest.approx(-54.24, abs=0.05)


def test_reference_angles_put_the_foot_under_the_hip(paper: Design) -> None:
    servo = Force(Setting(paper, 1 / 4000))
    for y in (0.28, 0.4, 0.55, 0.7):
        q = servo.angles(y)
        x, z = plant_foot(paper, q)
        assert (x, z) == (pytest.approx(0, abs=1e-12), pytest.approx(-y, abs=1e-12))
    lower, upper = (
        np.array([getattr(paper.leg.joint[j], side) for j in paper.leg.joints]) for side in ("lower", "upper")
    )
    for y in (0.0, 0.1, 0.8, np.inf):
        assert np.all((servo.angles(y) >= lower) & (servo.angles(y) <= upper))


def plant_foot(design: Design, q: np.ndarray) -> np.ndarray:
    return make_plant(design).machine.foot_motion(np.concatenate([np.zeros(BASE), q]), np.zeros(BASE + len(q)))[0]


# ---- what a user asks for ------------------------------------------------------------------------------------------


class Standing:
    """A user-defined strategy, as a user would write it."""

    made: list["Standing"] = []  # noqa: RUF012

    def __init__(self, setting: Setting):
        self.at, self.calls = setting.start, 0
        Standing.made.append(self)

    def torque(self, now: Measurement) -> np.ndarray:
        self.calls += 1
        return 2000 * (self.at - now.q) - 50 * now.v


class Mute:
    def __init__(self, setting: Setting):
        pass


@pytest.fixture
def own_module(monkeypatch: pytest.MonkeyPatch) -> str:
    module = ModuleType("my_strategies")
    vars(module).update(Standing=Standing, Mute=Mute)
    monkeypatch.setitem(sys.modules, "my_strategies", module)
    Standing.made.clear()
    return "my_strategies"


@pytest.mark.slow
def test_a_class_of_ones_own_is_asked_at_every_control_instant(own_module: str, paper: Design) -> None:
    strategy = find(f"{own_module}:Standing")
    design = load("paper", {"simulation.control_rate": 500.0, "hop.stance_duration": [0.03, 0.1]})
    run = simulate(design, strategy)
    (made,) = Standing.made
    assert made.calls == 550  # 1.1 s, nothing lands
    assert run.figures.clearance == 0.0
    assert not run.trace.events


@pytest.mark.parametrize("asked", [[np.nan, 0.0], [1.0], 5.0])
def test_torques_that_make_no_sense_are_said_in_a_sentence(own_module: str, paper: Design, asked: Any) -> None:
    class Wrong(Mute):
        def torque(self, now: Measurement) -> Any:
            return np.array(asked)

    vars(sys.modules[own_module])["Wrong"] = Wrong
    with pytest.raises(UsageError, match="it takes 2 finite numbers"):
        simulate(paper, find(f"{own_module}:Wrong"))


def test_a_simulation_that_breaks_down_ends_and_says_so(own_module: str, paper: Design) -> None:
    class Pump(Mute):
        def torque(self, now: Measurement) -> np.ndarray:
            return 1e9 * np.where(now.v < 0, -1.0, 1.0)

    vars(sys.modules[own_module])["Pump"] = Pump
    run = simulate(paper, find(f"{own_module}:Pump"), torque_gain=np.full(2, 1e6))
    assert run.trace.outcome == "the motion ran away"
    assert np.isfinite(run.trace.v).all()


@pytest.mark.slow
def test_strategies_come_from_other_packages(own_module: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def installed(group: str) -> list[EntryPoint]:
        return [EntryPoint("theirs", f"{own_module}:Standing", group)] if group == "hopopt.strategies" else []

    monkeypatch.setattr(strategies, "entry_points", installed)
    made = len(Standing.made)
    simulate(load("paper", {"simulation.control_rate": 500.0}), find("theirs"))
    assert len(Standing.made) == made + 1
    with pytest.raises(UsageError, match=r"no strategy 'nobodys'.*force.*track.*theirs"):
        find("nobodys")


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("forse", r"^there is no strategy 'forse': choose one of force, force_braked, .* package\.module:Class$"),
        (
            "no_such_module:Mine",
            r"^strategy no_such_module:Mine cannot be imported: .*No module named .*current folder or on PYTHONPATH\?$",
        ),
        ("my_strategies:Nothing", r"^strategy my_strategies:Nothing cannot be imported: .*Nothing.*$"),
        ("my_strategies:Mute", r"^strategy my_strategies:Mute: Mute has no method torque\(now\).*$"),
        (":Mine", r"^strategy :Mine: write module:name$"),
    ],
)
def test_a_strategy_that_is_not_there_is_said_in_a_sentence(own_module: str, name: str, says: str) -> None:
    with pytest.raises(UsageError, match=says) as error:
        find(name)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"kp": 1.0}, "kp"),
        ({"retraction": "tucked"}, "retraction = 'tucked': choose one of reference, tuck"),
        ({"stance": "leap"}, "stance = 'leap': choose one of reference, step"),
        ({"k_s": 10.0}, "never lifts off"),
        ({"k_p": "stiff"}, "k_p = 'stiff': a number is needed"),
    ],
)
@pytest.mark.parametrize("name", ["force", "position"])
def test_wrong_options_are_said_in_a_sentence(paper: Design, name: str, options: Mapping[str, Any], says: str) -> None:
    with pytest.raises(UsageError) as error:
        simulate(paper, BUILT_IN[name], options=options)
    assert str(error.value).startswith(f"strategy {name}: ")
    assert says in str(error.value)
    assert "__init__" not in str(error.value)


def test_a_fault_in_a_strategy_of_ones_own_is_not_taken_for_a_wrong_option(paper: Design) -> None:
    """A TypeError inside its constructor is the user's to see, whole."""

    class Broken:
        def __init__(self, setting: Setting):
            len(0)  # type: ignore[arg-type]

    with pytest.raises(TypeError):
        simulate(paper, Strategy("broken", "fails", Broken))  # type: ignore[arg-type]


def test_the_papers_strategies_need_two_joints() -> None:
    design = load("paper")
    tables = design.model_dump(exclude_none=True)
    tables["leg"]["joints"], tables["leg"]["links"] = ("hip",), ("thigh",)
    tables["leg"] = {k: v for k, v in tables["leg"].items() if k not in ("knee", "shank")}
    tables["start"] = {"joint_angles": (0.2,)}
    with pytest.raises(UsageError, match="two joints, this one has 1"):
        Force(Setting(Design.model_validate(tables), 1 / 4000))


@pytest.mark.parametrize("k_p", [0.0, -5.0])
def test_a_gain_that_holds_nothing_is_refused(k_p: float) -> None:
    """Its critical damping would be no number in flight."""
    with pytest.raises(UsageError, match=f"strategy force: k_p = {k_p:g}: it must be greater than 0"):
        simulate(load("paper"), BUILT_IN["force"], options={"k_p": k_p})


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ("def torque(self, now): return now.q", "it cannot be made from a Setting (TypeError"),
        ("def __init__(self, s): pass\n    def torque(self, now): return 1 / 0", "stopped with ZeroDivisionError"),
        ("def __init__(self, s): pass\n    def torque(self): return 1", "torque(now) stopped with TypeError"),
    ],
)
def test_a_class_without_what_it_needs_is_answered_in_a_sentence(
    body: str, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "mine_in_a_test.py").write_text(f"class Mine:\n    {body}\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, "mine_in_a_test", raising=False)
    with pytest.raises(UsageError) as error:
        simulate(load("paper"), find("mine_in_a_test:Mine"))
    assert words in str(error.value)
