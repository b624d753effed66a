"""Programs of lossy gears by way of gentler ones: the same program at 1, and the same optimum."""

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from typing import Any

import casadi as ca
import numpy as np
import pytest

from hopopt.nlp.deadline import NEVER
from hopopt.nlp.refinement import solving
from hopopt.nlp.refinement.continuous_limits import enforcing, nothing_enforced
from hopopt.nlp.refinement.mesh_refinement import UNSOLVED, Refinement
from hopopt.nlp.refinement.sharp.gentler import led_gently
from hopopt.nlp.solver.ipopt import Bounds, NlpSolution, NlpSolver, enough
from hopopt.nlp.solver.kkt_residuals import residuals
from hopopt.nlp.transcription import Transcription
from hopopt.ocp.hop import Hop
from hopopt.planner.refine_and_verify import aims_of
from hopopt.planner.search.multistart import first_transcription, run_chunk, solution_of
from hopopt.problem.load import load
from hopopt.verify.check import KKT

ROUGH = {"solver.stance_intervals": 16, "solver.flight_intervals": 6}


@cache
def lossy() -> Hop:
    return Hop(load("paper", {"leg.gear.efficiency": 0.8, **ROUGH}))


@cache
def solved() -> NlpSolution:
    """On the first mesh."""
    (found,) = run_chunk(lossy(), [0])
    assert found.success
    return solution_of(found, first_transcription(lossy()))


def test_at_one_it_is_the_same_program_and_else_another() -> None:
    s, gentler = solved(), lossy().problem.gentler
    assert gentler is not None
    t = Transcription(gentler.make(), s.transcription.scheme, s.transcription.mesh)

    function = ca.Function("rows", [t.nlp["x"], t.nlp["p"]], [t.nlp["g"]])

    def rows(number: float) -> np.ndarray:
        return np.array(function(s.z, t.parameter_values({gentler.number: number}))).ravel()

    np.testing.assert_allclose(rows(1.0), s.g, atol=1e-12)
    assert np.abs(rows(gentler.values[0]) - s.g).max() > 1e-3
    assert list(gentler.values) == sorted(gentler.values, reverse=True)


def test_it_leads_to_an_optimum_that_is_no_worse_than_where_it_began() -> None:
    """Of the program that was asked, whose rows it keeps."""
    s = solved()
    t = s.transcription

    def solver(program: Transcription, options: Mapping[str, Any], steps: int = 10) -> NlpSolver:
        return NlpSolver(program, {**options, **enough(program.problem.objective.scale, steps)})

    program = enforcing(t, nothing_enforced(t))
    guess, bounds = t.guess_from(s.phases), Bounds(*t.bounds({}), t.lbg, t.ubg)
    led = led_gently(program, solver, guess, t.free_from(s.parameters), (s.lam_g, s.lam_x), bounds)
    assert led is not None
    assert led.success
    assert led.transcription.problem is t.problem
    assert led.objective > s.objective - 1e-6
    left = residuals(led)
    assert max(left.stationarity, left.feasibility, left.complementarity) < KKT
    np.testing.assert_array_equal(led.p, s.p)


def test_without_losses_there_is_none() -> None:
    for losses in ({}, {"leg.gear.damping": 0.1}):
        assert Hop(load("paper", losses)).problem.gentler is None
    assert lossy().tied(0.0).gentler is None  # its objective is another


@pytest.mark.slow
def test_a_mesh_that_is_not_solved_at_once_is_led_to(monkeypatch: pytest.MonkeyPatch) -> None:
    """What would end unsolved goes on."""
    aims = replace(aims_of(lossy(), NEVER), meshes=2)
    monkeypatch.setattr(solving, "CARRIED_ITERATIONS", 0)
    asked: list[str] = []

    def noted(*given: object) -> NlpSolution | None:
        asked.append("led")
        monkeypatch.setattr(solving, "CARRIED_ITERATIONS", 60)
        return led_gently(*given)  # pyright: ignore[reportArgumentType]

    monkeypatch.setattr(solving, "led_gently", noted)
    refinement = Refinement(solved(), aims).run()
    assert asked
    assert refinement.ended != UNSOLVED
    assert len(refinement.history) > 2
