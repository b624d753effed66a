"""Every snippet of docs/extending.md, run as it stands and used."""

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest

from hopopt.control import strategies
from hopopt.control.closed_loop import simulate
from hopopt.drivetrain import dynamics
from hopopt.drivetrain.operating_region import half_planes
from hopopt.extensions import carried
from hopopt.leg.robot import BASE
from hopopt.nlp import schemes
from hopopt.nlp.deadline import NEVER
from hopopt.nlp.mesh import uniform
from hopopt.nlp.refinement.interval_errors import interval_errors
from hopopt.nlp.solver.ipopt import NlpSolver
from hopopt.nlp.transcription import Transcription
from hopopt.ocp import rules
from hopopt.ocp.guesses.initial_guess import NAMED_STARTS, make_guess
from hopopt.ocp.hop import Hop
from hopopt.ocp.problem import Instant
from hopopt.ocp.transitions import impact
from hopopt.planner.checks.program_limits import program_limits
from hopopt.planner.search import beside, multistart
from hopopt.planner.search.multistart import first_solver
from hopopt.planner.solution import Solution, stored_nlp
from hopopt.planner.solve import solve
from hopopt.problem.load import load
from known_problems import guesses, minimum_effort
from registries import clean_registries

PAGE = (Path(__file__).parents[2] / "docs" / "extending.md").read_text(encoding="utf-8")
SNIPPETS = dict(re.findall(r"^## ([^\n]+)\n.*?```python\n(.*?)```", PAGE, re.MULTILINE | re.DOTALL))
COARSE = {"solver.stance_intervals": 8, "solver.flight_intervals": 4, "solver.refine": False}


@pytest.fixture(autouse=True)
def _registries() -> Iterator[None]:
    """What a snippet registers is gone after its test."""
    added = list(dynamics.DYNAMICS)
    with clean_registries():
        yield
    dynamics.DYNAMICS[:] = added


def run(title: str) -> dict[str, Any]:
    """What a section's snippet defines."""
    found: dict[str, Any] = {"__name__": "snippet"}
    exec(SNIPPETS[title], found)
    return found


def test_the_page_is_one_page_with_a_snippet_in_every_section() -> None:
    assert len(SNIPPETS) == PAGE.count("\n## ") == 8
    assert len(PAGE.splitlines()) < 230


def test_an_objective() -> None:
    run("An objective")
    s = solve(load("paper", COARSE), "com_height", starts=1, processes=1)
    assert s.summary.objective_value == pytest.approx(s.apex.points["com"][0, 1], abs=1e-4)


@pytest.mark.parametrize("title", ["A module of your own", "A constraint"])
def test_a_constraint_holds_where_a_problem_names_it(title: str, hop: Solution) -> None:
    """The limit, 400 or 350 N, against a hop that was found without it."""
    run(title)
    (name,) = rules.RULES
    limited, program = Hop(load("paper", {"hop.constraints": [name]})), stored_nlp(hop)
    other = Transcription(limited.problem, program.transcription.scheme, program.transcription.mesh)
    passed = replace(program, transcription=other)
    errors = {name: interval_errors(passed, name) for name in passed.phases}
    (found,) = program_limits(passed, errors, ())
    assert not found.passed
    most, size = (400.0, 400.0) if name == "soft_ground" else (350.0, limited.force_range)
    assert found.residual == pytest.approx((hop.summary.peak_vertical_force_N - most) / size, rel=1e-3)


def test_a_process_that_does_not_know_what_was_added_solves_with_it() -> None:
    run("A constraint")
    hop = Hop(load("paper", {**COARSE, "hop.constraints": ["gentle_ground"]}))
    (first,) = multistart.run_chunk(hop, [0])
    sent = carried(beside._in_worker)
    rules.RULES.clear()
    recipe = hop.design.model_dump(exclude_none=True), hop.asked, hop.free_parameters, hop.constraints
    again = sent(-1, recipe, multistart._one_start, (0, False, None, NEVER))
    assert again is not None
    assert len(again.vectors["lam_g"]) == len(first.vectors["lam_g"])


def test_a_strategy() -> None:
    run("A strategy")
    r = simulate(load("paper"), strategies.find("full_push"))
    assert [event.kind for event in r.trace.events][:1] == ["lift-off"]
    assert r.trace.events[0].t == pytest.approx(0.10, abs=0.005)


@pytest.mark.slow
def test_a_drive_law() -> None:
    law = run("A drive law")["derated"]
    region = half_planes.OperatingRegion(tuple(law(1 / 200.0, 1 / 12.0)))
    assert region.torque_bounds(0.0) == (pytest.approx(-180.0), pytest.approx(180.0))
    s = solve(load("paper", ["leg.motor.laws=['derated']"]), starts=1, processes=1)
    assert s.verified
    t = np.linspace(0, s.lift_off, 99)
    found, w = s.sample(t).tau[:, 1], s.sample(t).v[:, 3]
    assert np.max(np.abs(found / 180 + w / (1256.637 / 100))) == pytest.approx(1, abs=1e-3)  # the knee is at its line


def test_a_drive_with_states_of_its_own() -> None:
    """Its hop on a coarse mesh: each torque is a state, and its rate is the lag's."""
    lag = run("A drive with states of its own")["LAG"]
    hop = Hop(load("paper", COARSE))
    assert [v.name for v in hop.problem.phase("stance").controls] == ["command"]
    solution = first_solver(hop)(make_guess(hop, NAMED_STARTS[1]))
    assert solution.success
    stance = solution.phases["stance"]
    _, x, u = stance.everywhere(np.array(stance.scheme.c))
    command, torque = u[..., :2], x[..., 4:6]
    np.testing.assert_allclose(stance.xdot[..., 4:6], (command - torque) / lag, rtol=1e-6, atol=1e-3)


def test_a_scheme() -> None:
    run("A collocation scheme")
    known, lobatto = minimum_effort(), schemes.scheme("lobatto-4")
    program = Transcription(known.problem, lobatto, {"move": uniform(known.intervals)})
    solution = NlpSolver(program)(guesses(known))
    assert solution.objective == pytest.approx(known.optimum, rel=1e-7)


def test_phases_and_transitions() -> None:
    """It closes: the state after the impact is that with which stance began."""
    run("Phases and transitions")
    hop = Hop(load("paper", COARSE), "hop after hop")
    solution = first_solver(hop)(make_guess(hop, NAMED_STARTS[1]))
    assert solution.success
    end, begin = (solution.phases[name] for name in ("descent", "stance"))
    q, v = (ca.SX.sym(name, BASE + hop.n) for name in "qv")
    com, com_v, joints, speeds = (ca.SX.sym(name, 2) for name in ("com", "com_v", "joints", "speeds"))
    leg = hop.dynamics(Instant(t=0.0, p=hop.robot.parameters))
    pose = leg.flight_pose(com, com_v, joints, speeds)[:2]
    after = ca.Function("after", [q, v], [impact(leg, q, v)[0]])
    at = ca.Function("at", [ca.vertcat(com, com_v, joints, speeds)], list(pose))(end.x_end)
    np.testing.assert_allclose(
        begin.x_start[0], np.concatenate([end.x_end[4:6], np.array(after(*at)).ravel()[2:]]), atol=1e-6
    )
    assert solution.objective > 0.5
