"""Legs that differ in size alone: what they are asked for differs by what its estimate says, and no more."""

import casadi as ca
import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from hopopt.ocp.guesses.initial_guess import NAMED_STARTS, make_guess
from hopopt.ocp.hop import Hop
from hopopt.planner.search.multistart import first_transcription
from hopopt.planner.solution import Solution
from hopopt.problem.load import load
from once import solved_once
from similar_legs import POWERS, similar

SIZES = (0.25, 3.0)  # times the paper's leg
CLEARANCE = 0.4  # m, of the paper's leg
OTHERS = ("apex", "time", "saturation", "peak_torque", "electrical_energy", "impact", "energy", "absolute_work")
AT_EACH_CHANGE = (("clearance", 3.0), ("clearance", 0.25), ("peak_force", 3.0))
ASKED = [  # what the rest finds beyond these and the quick tests of programs: what depends on size in how one objective is refined
    pytest.param(name, size, marks=[pytest.mark.rarely] * ((name, size) not in AT_EACH_CHANGE))
    for name in ("clearance", "peak_force", *OTHERS) for size in SIZES
]  # fmt: skip


def entries(size: float) -> dict[str, object]:
    """The paper's leg so many times as large, with what objectives ask for."""
    return {
        **similar(size),
        "leg.motor.winding_resistance": 0.5,
        "leg.motor.torque_constant": 0.05 * size**2.25,  # heat, resistance x (torque / constant)^2, is a power
        "hop.clearance": CLEARANCE * size,
        "hop.stance_duration": [0.03 * size**0.5, 0.2 * size**0.5],  # short: few intervals
    }


def best(objective: str, size: float) -> Solution:
    """The optimum from one start."""
    return solved_once(entries(size), objective)


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("objective", ["energy", "absolute_work", "impact"])
def test_a_tie_break_that_counts_is_a_share_of_the_legs_own_work(objective: str, size: float) -> None:
    """Its weight is a power: an energy over a time."""
    here, there = (Hop(load("paper", entries(k)), objective).tie_break for k in (1.0, size))
    assert there == pytest.approx(here * size**3.5, rel=1e-12)


def program(kind: str, objective: str, size: float) -> dict[str, np.ndarray]:
    """The program of the first mesh in its own units: bounds, a start, and objective and constraints there."""
    more = {"hop.kind": kind, "hop.landing_duration": [0.03 * size**0.5, size**0.5], "hop.obstacle.width": 0.2 * size}
    hop = Hop(load("paper", {**entries(size), **more}), objective)
    t, guess = first_transcription(hop), make_guess(hop, NAMED_STARTS[0])
    z, (low, high) = t.pack(guess), t.bounds(guess)
    f, g = ca.Function("program", [t.nlp["x"], t.nlp["p"]], [t.nlp["f"], t.nlp["g"]])(z, t.parameter_values())
    at = {"z": z, "f": np.array(f) / t.problem.objective.scale, "g": np.array(g)}
    return at | {"low": low, "high": high, "lbg": t.lbg, "ubg": t.ubg}


PROGRAMS = (
    ("single", "clearance"), ("single", "electrical_energy"), ("single", "impact"), ("periodic", "time"),
    ("landing", "obstacle"), *(("single", name) for name in ("apex", "energy", "saturation", "peak_torque", "peak_force")),
)  # fmt: skip


@pytest.mark.parametrize(("kind", "objective"), PROGRAMS)
@given(st.floats(0.1, 4.0))
@settings(max_examples=1, deadline=None, phases=[Phase.generate])
def test_the_program_of_a_similar_leg_is_the_same(kind: str, objective: str, size: float) -> None:
    """In its own units no number of it tells how large the leg is: so it is solved by the same iterations."""
    here = program(kind, objective, 1.0)
    for name, there in program(kind, objective, size).items():
        np.testing.assert_allclose(there, here[name], rtol=1e-6, atol=1e-6, err_msg=name)


@pytest.mark.slow
@pytest.mark.parametrize(("objective", "size"), ASKED)
def test_values_scale_within_the_stated_estimate(objective: str, size: float) -> None:
    here, there = (best(objective, k).summary for k in (1.0, size))
    assert not (*here.failed_checks, *there.failed_checks)
    unit = size ** POWERS[here.objective_unit]
    of_each = (s.objective_error.too_high_by + s.tie_break_weighs + 1e-4 * abs(s.reached) for s in (here, there))
    assert there.reached / unit == pytest.approx(here.reached, abs=next(of_each) + next(of_each) / unit)
