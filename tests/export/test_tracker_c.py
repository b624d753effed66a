"""The tracker in C: compiled, it asks for the torques that Python asks for, and the leg hops as high with it."""

import ctypes
import shutil
import subprocess
from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

from hopopt.control.closed_loop import simulate
from hopopt.control.reference import PhaseReference
from hopopt.control.strategies import BUILT_IN
from hopopt.control.tracking.track import Track
from hopopt.export.plan import tracker_of
from hopopt.export.tracker_c import constants_bytes, header
from hopopt.planner.reserve import TrackedPlan
from hopopt.planner.solution import Solution
from hopopt.sim.controller import Controller, Measurement
from hopopt.verify.table import NORMALISED_TIMES
from once import solved_once

CHEAP = {  # an unrefined plan that keeps the foot pressed, so that it can be tracked
    "solver.refine": False, "solver.stance_intervals": 40, "solver.flight_intervals": 20, "contact.least_force": 60.0,
    "hop.least_height": 0.005, "hop.stance_duration": [0.03, 0.2],
}  # fmt: skip
COMPILER = shutil.which("gcc") or shutil.which("cc")
STRICT = ("-std=c99", "-O2", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-ffp-contract=off")
HARNESS = """#include "tracker.h"
static hopopt_tracker state;
void reset(void) { hopopt_reset(&state); }
void torque(double t, const double *q, const double *v, int contact, double since, int landings, double *tau) {
    hopopt_real angles[HOPOPT_JOINTS], speeds[HOPOPT_JOINTS], torques[HOPOPT_JOINTS];
    for (int j = 0; j < HOPOPT_JOINTS; j++) angles[j] = (hopopt_real)q[j], speeds[j] = (hopopt_real)v[j];
    hopopt_torque(&state, (hopopt_real)t, angles, speeds, contact, (hopopt_real)since, landings, torques);
    for (int j = 0; j < HOPOPT_JOINTS; j++) tau[j] = (double)torques[j];
}
"""
Doubles = ctypes.POINTER(ctypes.c_double)


@dataclass
class InC:
    """A controller that asks the compiled tracker."""

    compiled: ctypes.CDLL

    def __post_init__(self) -> None:
        double, whole = ctypes.c_double, ctypes.c_int
        self.compiled.torque.argtypes = [double, Doubles, Doubles, whole, double, whole, Doubles]
        self.compiled.torque.restype = None
        self.compiled.reset()

    def torque(self, now: Measurement) -> np.ndarray:
        q, v, tau = np.ascontiguousarray(now.q), np.ascontiguousarray(now.v), np.zeros(len(now.q))
        arrays = [x.ctypes.data_as(Doubles) for x in (q, v, tau)]
        self.compiled.torque(now.t, *arrays[:2], int(now.contact), now.since, now.landings, arrays[2])
        return tau


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


def compiled(folder: Path, text: str, *words: str) -> Callable[[], InC]:
    """Makes fresh controllers of a header, compiled without a warning."""
    if COMPILER is None:
        pytest.skip("there is no C compiler (gcc or cc) on this machine")
    (folder / "tracker.h").write_text(text, encoding="utf-8")
    (folder / "harness.c").write_text(HARNESS, encoding="utf-8")
    command = [COMPILER, *STRICT, *words, "-shared", "-fPIC", "harness.c", "-o", "tracker.so", "-lm"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
    return lambda: InC(ctypes.CDLL(str(folder / "tracker.so")))


@pytest.fixture(scope="module")
def in_c(tracker: Track, tmp_path_factory: pytest.TempPathFactory) -> Callable[[], InC]:
    """With doubles and the gains of every control period."""
    text = header(tracker, "paper", ("hip", "knee"), tolerance=0.0)
    return compiled(tmp_path_factory.mktemp("tracker"), text, "-DHOPOPT_REAL=double")


@pytest.fixture(scope="module")
def in_floats(tracker: Track, tmp_path_factory: pytest.TempPathFactory) -> Callable[[], InC]:
    """As it is exported: in single precision, with what a compiler for a microcontroller warns of."""
    text = header(tracker, "paper", ("hip", "knee"))
    return compiled(tmp_path_factory.mktemp("floats"), text, "-Wdouble-promotion", "-Wshadow")


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
    random = np.random.default_rng(0)
    for t in np.arange(0.0, 1.2, 0.003):
        contact = bool(not bounced < t < bounced + 0.01 and t < 0.5)
        q, _, _ = tracker.plan.stance.at(t)
        noisy = Measurement(t, q + random.normal(0, 0.05, 2), random.normal(0, 1, 2), contact, max(t - 0.5, 0) or t, 0)
        both.torque(noisy)
    assert max(both.differences) < 1e-9


def test_weights_give_back_a_polynomial() -> None:
    """The barycentric formula with them is exact for one of a degree below the number of places."""
    steady = np.broadcast_to(NORMALISED_TIMES[:, None], (1, len(NORMALISED_TIMES), 1))
    weights, place = PhaseReference(NORMALISED_TIMES, steady[..., 0], *[steady] * 3).barycentric, 0.37
    basis = weights / (place - NORMALISED_TIMES)
    assert basis @ NORMALISED_TIMES**8 / basis.sum() == pytest.approx(place**8, abs=1e-14)
