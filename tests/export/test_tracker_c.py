"""The tracker in C: compiled, it asks for the torques that Python asks for, and the leg hops as high with it."""

from collections.abc import Callable, Iterator
from copy import copy
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from hopopt.comparison.hops.trials import Hops, apex_of
from hopopt.comparison.robust.robustness import Reached, drawn, reached
from hopopt.control.closed_loop import simulate
from hopopt.control.reference import PhaseReference
from hopopt.control.strategies import BUILT_IN
from hopopt.control.tracking.track import Track
from hopopt.errors import UsageError
from hopopt.export.plan import tracker_of
from hopopt.export.tracker_c import MOST_BYTES, constants_bytes, fitting, header, to_c
from hopopt.planner.reserve import TrackedPlan
from hopopt.planner.solution import Solution
from hopopt.problem.load import changed, load
from hopopt.sim.controller import Controller, Measurement
from hopopt.verify.table import NORMALISED_TIMES
from once import plan_with_reserve, solved_once
from tracker_in_c import Doubles, InC, compiled

CHEAP = {  # an unrefined plan that keeps the foot pressed, so that it can be tracked
    "solver.refine": False, "solver.stance_intervals": 40, "solver.flight_intervals": 20, "contact.least_force": 60.0,
    "hop.least_height": 0.005, "hop.stance_duration": [0.03, 0.2],
}  # fmt: skip


ROUGH = {"contact.friction": 0.6}


@dataclass
class Both:
    """A controller that asks two, obeys the first and notes by how much they differ [N m]."""

    first: Controller
    second: Controller
    differences: list[float] = field(default_factory=list)
    asked: list[tuple[bool, int]] = field(default_factory=list)

    def torque(self, now: Measurement) -> np.ndarray:
        one, other = self.first.torque(now), self.second.torque(now)
        self.differences.append(float(np.abs(one - other).max()))
        self.asked.append((now.contact, now.landings))
        return one


@pytest.fixture(scope="module")
def solution() -> Solution:
    """A plan to track; that its mesh is too coarse to be true does not matter here."""
    return solved_once(CHEAP)


@pytest.fixture(scope="module")
def tracker(solution: Solution) -> Track:
    """In Python: to be copied before it is used. Gains differ by rounding when they are computed anew."""
    return tracker_of(TrackedPlan.of(solution))


@pytest.fixture(scope="module")
def in_c(tracker: Track, tmp_path_factory: pytest.TempPathFactory) -> Callable[[], InC]:
    """With doubles and the gains of every control period."""
    text = header(tracker, "paper", ("hip", "knee"), tolerance=0.0)
    return compiled(tmp_path_factory.mktemp("tracker"), text, "-DHOPOPT_REAL=double")


@pytest.fixture(scope="module")
def in_floats(tracker: Track, tmp_path_factory: pytest.TempPathFactory) -> Callable[[], InC]:
    """As it is exported: in single precision, with what a compiler for a microcontroller warns of."""
    text = header(tracker, "paper", ("hip", "knee"))
    return compiled(tmp_path_factory.mktemp("floats"), text, "-Wdouble-promotion")


@pytest.mark.slow
def test_in_single_precision_the_leg_hops_as_high_and_the_tables_fit_a_microcontroller(
    solution: Solution, tracker: Track, in_floats: Callable[[], InC]
) -> None:
    """128 kB at 4 kHz; torques of a whole hop are Python's within 0.1 % of what the drives give at standstill."""
    both, design = Both(copy(tracker), in_floats()), solution.design
    run = simulate(design, BUILT_IN["track"], controller=both, past_apex=True)
    assert max(both.differences) < 1e-3 * tracker.stall.max()
    alone = simulate(design, BUILT_IN["track"], controller=in_floats(), past_apex=True)
    assert alone.figures.clearance == pytest.approx(run.figures.clearance, abs=1e-3)
    assert constants_bytes(header(tracker, "paper", ("hip", "knee"))) <= 128_000


@pytest.mark.slow
def test_c_asks_for_what_python_asks_for_over_a_whole_hop(
    solution: Solution, tracker: Track, in_c: Callable[[], InC]
) -> None:
    """From rest through stance, flight, the landing and the stand after it, and C alone reaches the same height."""
    design, track = solution.design, BUILT_IN["track"]
    both = Both(copy(tracker), in_c())
    run = simulate(design, track, controller=both, hops=2)
    assert {(True, 0), (False, 0), (True, 1)} <= set(both.asked)
    assert max(both.differences) < 1e-9
    alone = simulate(design, track, controller=in_c(), past_apex=True)
    assert alone.figures.clearance == pytest.approx(run.figures.clearance, abs=1e-6)
    assert alone.figures.clearance > 0.97 * solution.clearance


@pytest.mark.parametrize("bounced", [0.1, 0.39])
def test_c_follows_python_through_a_bounce_and_far_from_the_plan(
    tracker: Track, in_c: Callable[[], InC], bounced: float
) -> None:
    """Wrong angles, a foot that comes off early or late, and times beyond the plan's end; then the same after a reset."""
    both = Both(copy(tracker), in_c())
    for now in measured(tracker, np.arange(0.0, 1.2, 0.003), bounced):
        both.torque(now)
    assert max(both.differences) < 1e-9


def coupled(solution: Solution, entries: dict[str, object]) -> Track:
    """The tracker of the same plan on a leg with entries changed."""
    plan, design = TrackedPlan.of(solution), changed(solution.design, entries)
    return tracker_of(TrackedPlan(replace(plan.motion, design=design), plan.reference))


KNEE, BELTS = "leg.knee.transmission", {
    "leg.knee.transmission.coupling": {"hip": {"ratio": 0.6}},
    "leg.hip.transmission.coupling": {"knee": {"ratio": -0.3}},
    "leg.hip.transmission.motor_on": "shank",
}  # fmt: skip
FOUR_BAR = {"ground": 0.3, "crank": 0.06, "rod": 0.31, "arm": 0.05, "stretched": -2.9}
TABLE = {"angle": [-2.2, -1.3, -0.6], "ratio": [1.4, 1.1, 0.7]}


@pytest.mark.parametrize(
    "law",
    [
        {},
        pytest.param({f"{KNEE}.table": TABLE}, marks=pytest.mark.slow),
        pytest.param({f"{KNEE}.four_bar": FOUR_BAR}, marks=pytest.mark.slow),
    ],
)
def test_c_follows_python_where_lossy_drives_turn_by_belts_and_laws(
    solution: Solution, tmp_path: Path, law: dict[str, object]
) -> None:
    """In doubles; and the torques that it names of the drives are those of the transmission."""
    tracker = coupled(solution, {**BELTS, **law, "leg.gear.efficiency": 0.85, "leg.gear.friction": 1.0})
    make = compiled(tmp_path, header(tracker, "paper", ("hip", "knee"), tolerance=0.0), "-DHOPOPT_REAL=double")
    both, turning = Both(copy(tracker), make()), tracker.drive.turning
    assert turning is not None
    for now in measured(tracker, np.arange(0.0, 0.9, 0.003), 0.1):
        asked, drives = both.torque(now), np.zeros(2)
        arrays = [x.ctypes.data_as(Doubles) for x in (np.ascontiguousarray(now.q), asked, drives)]
        both.second.compiled.drives(*arrays)  # type: ignore[attr-defined]
        if -2.4 < now.q[1] < -0.15:
            assert turning.jacobian(now.q).T @ drives == pytest.approx(asked, rel=1e-8, abs=1e-8)
    assert max(both.differences) < (1e-6 if law else 1e-9)


def test_c_refuses_five_bars(solution: Solution) -> None:
    bar = {"crank": 0.1, "rod": 0.38, "arm": 0.1}
    with pytest.raises(UsageError, match="no five-bars"):
        header(coupled(solution, {f"{KNEE}.five_bar": bar}), "paper", ("hip", "knee"))


def measured(
    tracker: Track, times: np.ndarray, bounced: float, begins: float = 0.0, landings: int = 0
) -> Iterator[Measurement]:
    """Noise about the plan: stance ends at 0.5 s, with a bounce before, of a hop that begins at a time [s]."""
    random = np.random.default_rng(0)
    for t in times:
        contact = bool(not bounced < t < bounced + 0.01 and t < 0.5)
        q, _, _ = tracker.plan.stance.at(t)
        noisy = q + random.normal(0, 0.05, 2), random.normal(0, 1, 2)
        yield Measurement(begins + t, *noisy, contact, max(t - 0.5, 0) or t, landings)


def test_c_follows_python_from_hop_to_hop_where_the_plan_repeats(
    solution: Solution, tracker: Track, tmp_path: Path
) -> None:
    """From flight on through three hops, each with a bounce: Python's torques, of a plan that is taken to repeat."""
    repeats = copy(tracker)
    repeats.plan = replace(tracker.plan, repeats=True)
    make = compiled(tmp_path, header(repeats, "paper", ("hip", "knee"), tolerance=0.0), "-DHOPOPT_REAL=double")
    both = Both(repeats, make())
    for now in measured(tracker, np.arange(0.6, 0.9, 0.003), 0.1, begins=-0.6):
        both.torque(now)
    for k in range(3):
        for now in measured(tracker, np.arange(0.0, 0.9, 0.003), 0.2, begins=0.3 + 0.9 * k, landings=k + 1):
            both.torque(now)
    assert max(both.differences) < 1e-9
    assert {landings for _, landings in both.asked} == {0, 1, 2, 3}


def test_a_plan_of_many_intervals_fits_a_microcontroller(tracker: Track) -> None:
    """Each interval cut in seven: 420 of them, more than the 390 of which all places alone take 128 kB; no torque moves by 1e-4 of
    standstill."""
    plan, fine = tracker.plan, copy(tracker)
    fine.plan = replace(plan, stance=cut(plan.stance, 7), flight=cut(plan.flight, 7))
    assert len(fine.plan.stance.t) + len(fine.plan.flight.t) == 420
    found = fitting(fine)
    assert found.torque_error < 1e-4
    assert constants_bytes(found.code) <= MOST_BYTES
    fewer, fastest = found.phases["stance"].plan, np.abs(plan.stance.v).max()
    for t in np.linspace(0.0, plan.stance.duration, 50):
        np.testing.assert_allclose(fewer.at(t)[:2], plan.stance.at(t)[:2], rtol=0, atol=1e-4 * fastest)


def cut(phase: PhaseReference, pieces: int) -> PhaseReference:
    """The same phase, every interval in so many pieces."""
    edges = phase.edges
    ends = np.concatenate([np.linspace(a, b, pieces, endpoint=False) for a, b in pairwise(edges)] + [edges[-1:]])
    t = ends[:-1, None] + np.diff(ends)[:, None] * phase.places
    inside = np.clip(t, ends[:-1, None] + 2e-9, ends[1:, None] - 2e-9)  # at an edge, of this interval
    q, v, tau = (np.array(x) for x in zip(*(phase.at(float(x)) for x in inside.ravel()), strict=True))
    return PhaseReference(phase.places, t, *(x.reshape(*t.shape, -1) for x in (q, v, tau)))


@pytest.mark.rarely
def test_sixty_drawn_legs_reach_in_c_what_is_promised_of_them(tmp_path: Path) -> None:
    """What 95 % of legs reach with the compiled tracker is within 2 % of what they reach with that of Python."""
    design, plan = load("paper", ROUGH), TrackedPlan.of(plan_with_reserve(ROUGH))
    tracked = TrackedPlan(replace(plan.motion, design=design), plan.reference)
    make, legs = compiled(tmp_path, to_c(tracked), "-Wdouble-promotion"), drawn(design, design.uncertainty, 60, 1)
    promise = reached(design, "track", plan.reference, legs, 1).promised(0.95, 0.95)
    heights = [
        simulate(
            design, BUILT_IN["track"], plant=leg.leg, torque_gain=leg.torque_gain, start=leg.start, controller=make(),
            past_apex=True,
        ).figures.clearance
        for leg in legs
    ]  # fmt: skip
    assert promise > 0.5
    assert Reached(np.array(heights), ()).promised(0.95, 0.95) == pytest.approx(promise, rel=0.02)


@pytest.mark.rarely
def test_a_periodic_plan_is_kept_up_in_c(tmp_path: Path) -> None:
    """Three hops from its apex on, each within 3 % of the plan, in single precision."""
    plan = plan_with_reserve({"hop.kind": "periodic", **ROUGH})
    design = load("paper", {"hop.kind": "periodic", **ROUGH})
    tracked = TrackedPlan(replace(plan, design=design), TrackedPlan.of(plan).reference)
    make = compiled(tmp_path, to_c(tracked), "-Wdouble-promotion")
    run = simulate(design, BUILT_IN["track"], controller=make(), hops=4, start=apex_of(plan))
    found = [hop.clearance for hop in Hops(run, 3).each]
    assert len(found) >= 3
    np.testing.assert_allclose(found, plan.clearance, rtol=0.03)


def test_weights_give_back_a_polynomial() -> None:
    """The barycentric formula with them is exact for one of a degree below the number of places."""
    steady = np.broadcast_to(NORMALISED_TIMES[:, None], (1, len(NORMALISED_TIMES), 1))
    weights, place = PhaseReference(NORMALISED_TIMES, steady[..., 0], *[steady] * 3).barycentric, 0.37
    basis = weights / (place - NORMALISED_TIMES)
    assert basis @ NORMALISED_TIMES**8 / basis.sum() == pytest.approx(place**8, abs=1e-14)
