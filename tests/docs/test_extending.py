"""Every snippet of docs/extending.md, run as it stands and used."""

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest

from hopopt.cli.main import run as command
from hopopt.control import strategies
from hopopt.control.closed_loop import simulate
from hopopt.drivetrain import dynamics
from hopopt.drivetrain.operating_region import half_planes, laws
from hopopt.leg.robot import BASE
from hopopt.nlp import schemes
from hopopt.nlp.deadline import NEVER
from hopopt.nlp.mesh import uniform
from hopopt.nlp.refinement.interval_errors import interval_errors
from hopopt.nlp.solver.ipopt import NlpSolution, NlpSolver
from hopopt.nlp.transcription import Transcription
from hopopt.ocp import rules
from hopopt.ocp.guesses.initial_guess import NAMED_STARTS, make_guess
from hopopt.ocp.hop import Hop
from hopopt.ocp.objectives import registry as objectives
from hopopt.ocp.problem import Instant
from hopopt.ocp.transitions import impact
from hopopt.planner.checks.program_limits import program_limits
from hopopt.planner.search import beside, multistart
from hopopt.planner.search.multistart import first_solver
from hopopt.planner.solution import Solution, stored_nlp
from hopopt.planner.solve import solve
from hopopt.problem.load import load
from hopopt.storage.solution import folder_name, save
from known_problems import guesses, minimum_effort

PAGE = (Path(__file__).parents[2] / "docs" / "extending.md").read_text(encoding="utf-8")
SNIPPETS = dict(re.findall(r"^## ([^\n]+)\n.*?```python\n(.*?)```", PAGE, re.MULTILINE | re.DOTALL))
COARSE = {"solver.stance_intervals": 8, "solver.flight_intervals": 4, "solver.refine": False}


REGISTRIES: tuple[dict[str, Any], ...] = (
    objectives.OBJECTIVES, strategies.BUILT_IN, laws.LAWS, schemes.SCHEMES,
)  # fmt: skip


@pytest.fixture(autouse=True)
def _registries() -> Iterator[None]:
    """What a snippet registers is gone after its test."""
    kept = [dict(registry) for registry in REGISTRIES]
    rows, added = list(rules.RULES), list(dynamics.DYNAMICS)
    yield
    for registry, before in zip(REGISTRIES, kept, strict=True):
        registry.clear()
        registry.update(before)
    rules.RULES[:], dynamics.DYNAMICS[:] = rows, added


def run(title: str) -> dict[str, Any]:
    """What a section's snippet defines."""
    found: dict[str, Any] = {"__name__": "snippet"}
    exec(SNIPPETS[title], found)
    return found


def test_the_page_is_one_page_with_a_snippet_in_every_section() -> None:
    assert len(SNIPPETS) == PAGE.count("\n## ") == 7
    assert len(PAGE.splitlines()) < 200


def test_an_objective() -> None:
    run("An objective")
    s = solve(load("paper", COARSE), "com_height", starts=1, processes=1)
    assert s.summary.objective_value == pytest.approx(s.apex.points["com"][0, 1], abs=1e-4)


@pytest.mark.slow
def test_a_constraint(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """It is held, checked by its value, named wherever the answer is, and verification knows what it needs."""
    before = folder_name(load("paper"), "clearance")
    rule = run("A constraint")["gentle_ground"]
    s = save(solve(load("paper"), starts=1, processes=1), tmp_path)
    assert s.verified
    assert s.summary.peak_vertical_force_N == pytest.approx(350, rel=1e-3)
    assert s.summary.clearance_m < 0.799  # of the leg without the limit
    assert s.summary.check("stance peak ground force").residual < 1e-4
    assert s.summary.functions.rules == ("snippet:gentle_ground",)
    assert any("peak ground force" in name for name in s.summary.gains)
    assert s.result_dir is not None
    assert s.result_dir.name != before
    assert command(["show", str(s.result_dir)]) == 0
    assert "limited by snippet:gentle_ground" in capsys.readouterr().out
    assert command(["verify", str(s.result_dir)]) == 0
    assert "stance peak ground force" in capsys.readouterr().out
    rules.RULES.remove(rule)
    assert command(["verify", str(s.result_dir)]) == 2
    said = capsys.readouterr().err
    assert "snippet:gentle_ground" in said
    assert "import snippet" in said
    assert len(said.splitlines()) == 1


def test_a_limit_that_is_passed_between_the_nodes_is_found(hop: Solution) -> None:
    """The rule's limit, 350 N, against a hop that was found without it."""
    run("A constraint")
    limited, program = Hop(load("paper")), stored_nlp_of(hop)
    mesh = program.transcription.mesh
    other = Transcription(limited.problem, program.transcription.scheme, mesh)
    passed = replace(program, transcription=other)
    errors = {name: interval_errors(passed, name) for name in passed.phases}
    (found,) = program_limits(passed, errors, ())
    assert found.name == "stance peak ground force"
    assert not found.passed
    peak = hop.summary.peak_vertical_force_N
    assert found.residual == pytest.approx((peak - 350.0) / limited.force_range, rel=1e-3)


def test_a_process_that_does_not_know_what_was_added_solves_with_it() -> None:
    run("A constraint")
    hop = Hop(load("paper", COARSE))
    (first,) = multistart.run_chunk(hop, [0])
    rules.RULES[:] = rules.BUILT_IN
    data = hop.design.model_dump(exclude_none=True)
    recipe = data, hop.asked, hop.free_parameters, hop.constraints
    again = beside._in_worker(-1, recipe, hop.rules, multistart._one_start, (0, False, None, NEVER))
    assert again is not None
    assert len(again.vectors["lam_g"]) == len(first.vectors["lam_g"])


def stored_nlp_of(hop: Solution) -> NlpSolution:
    """The program of a hop that was found without what a snippet adds."""
    added = [rule for rule in rules.RULES if rule not in rules.BUILT_IN]
    rules.RULES[:] = rules.BUILT_IN
    found = stored_nlp(hop)
    rules.RULES.extend(added)
    return found


def test_a_strategy() -> None:
    run("A strategy")
    r = simulate(load("paper"), strategies.find("full_push"))
    assert [event.kind for event in r.trace.events][:1] == ["lift-off"]
    assert r.trace.events[0].t == pytest.approx(0.10, abs=0.005)


def test_a_drive_law() -> None:
    law = run("A drive law")["derated"]
    region = half_planes.OperatingRegion(tuple(law(1 / 200.0, 1 / 12.0)))
    assert region.torque_bounds(0.0) == (pytest.approx(-180.0), pytest.approx(180.0))
    design = load("paper")
    motor = design.leg.motor.model_copy(update={"laws": ("derated",)})
    leg = design.leg.model_copy(update={"motor": motor})
    s = solve(design.model_copy(update={"leg": leg}), starts=1, processes=1)
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
