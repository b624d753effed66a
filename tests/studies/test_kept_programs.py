"""Programs that are kept are those of the problem, the objective and the solver settings that are asked for."""

from collections.abc import Callable
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from hopopt.evidence import family_optima, local_optima
from hopopt.nlp.deadline import NEVER
from hopopt.nlp.transcription import Transcription
from hopopt.ocp.guesses.initial_guess import NAMED_STARTS, make_guess
from hopopt.ocp.hop import Hop
from hopopt.planner.search.multistart import first_transcription
from hopopt.problem.load import load
from hopopt.studies.sweep import first_program as programs
from hopopt.studies.sweep.definition import Definition, define

SMALL = {"solver.stance_intervals": 6, "solver.flight_intervals": 3, "solver.refine": False}
OTHER = {"solver.stance_intervals": 5, "solver.flight_intervals": 2, "solver.degree": 2, "solver.scheme": "trapezoidal"}
SLIDER = {**SMALL, "leg.guides": ["z"], "leg.hip.upper": 2.5, "leg.knee.lower": -3.0, "leg.thigh.length": 0.3}


def objective(t: Transcription) -> float:
    """At some point."""
    value = ca.Function("f", [t.nlp["x"], t.nlp["p"]], [t.nlp["f"]])
    return float(value(np.full(len(t.scale), 0.3), t.parameter_values()))  # type: ignore[arg-type]


@pytest.mark.parametrize("entry", OTHER)
def test_a_hop_with_other_solver_settings_is_put_on_their_mesh(entry: str) -> None:
    hop, other = Hop(load("paper", SMALL)), load("paper", {**SMALL, entry: OTHER[entry]})
    first, direct = first_transcription(hop), first_transcription(Hop(other))
    again = first_transcription(hop.with_solver_of(other))
    assert (again.scheme.name, len(again.scale)) == (direct.scheme.name, len(direct.scale))
    assert again.scheme.name != first.scheme.name or len(again.scale) != len(first.scale)
    assert first_transcription(hop) is first


def test_a_hop_with_another_tie_break_has_it_in_its_program() -> None:
    hop, other = Hop(load("paper", SMALL)), load("paper", {**SMALL, "solver.tie_break": 1e-3})
    first, again = first_transcription(hop), first_transcription(hop.with_solver_of(other))
    direct = first_transcription(Hop(other))
    assert objective(again) == objective(direct)
    assert objective(again) != objective(first)


def test_a_hop_with_other_tolerances_alone_keeps_its_program() -> None:
    first = first_transcription(hop := Hop(load("paper", SMALL)))
    closer = hop.with_solver_of(load("paper", {**SMALL, "solver.tolerance": 1e-8}))
    assert closer.design.solver.tolerance == 1e-8
    assert first_transcription(closer) is first


def test_starts_of_a_folder_that_is_made_anew_are_those_of_its_problem(tmp_path: Path) -> None:
    """In one process, as in a notebook: with another objective, then with another mesh."""
    counts = []
    for name, changes in (("clearance", {}), ("time", {"hop.clearance": 0.1}), ("clearance", {"leg.gear.ratio": 80.0})):
        folder = local_optima.open_study(load("paper", {**SMALL, **changes}), name, tmp_path)
        folder = folder.rename(tmp_path / "study")
        (ended,) = local_optima.run_starts(folder, 1, 1, lambda text: None)
        counts.append(round(ended.objective, 6))
        folder.rename(tmp_path / f"study-{len(counts)}")
    assert len(set(counts)) == 3


@pytest.mark.parametrize("change", [{"leg.gear.ratio": 80.0}, {"contact.friction": 0.5}, {"solver.tie_break": 1e-4}])
def test_families_have_a_program_for_every_problem(change: dict[str, object]) -> None:
    one, other = load("paper", SMALL), load("paper", {**SMALL, **change})
    program: Callable[..., family_optima._Program] = family_optima._program
    assert program(one) is program(load("paper", SMALL))
    assert program(other) is not program(one)
    assert program(other).hop.design == other


def first_program(definition: Definition, k: int) -> Transcription:
    hop = Hop(definition.design_at(k), definition.objective)
    return programs.first_program(definition, hop, definition.values(k), NEVER)[0]


def test_no_points_program_depends_on_the_point_before_it() -> None:
    """Starts in which another joint closes the loop than in the study's own: each program is scaled for its own leg."""
    vary = {"start.hip_height": [0.1], "leg.body.mass": [5.0, 20.0]}
    definition = define(load("paper", {**SLIDER, "start.hip_height": 0.4}), vary)
    alone = first_program(definition, 1).scale
    programs._compiled.clear()
    first_program(definition, 0)
    np.testing.assert_array_equal(first_program(definition, 1).scale, alone)
    assert Hop(definition.design_at(1)).dependent != Hop(definition.design).dependent


@pytest.mark.parametrize("entry", ["leg.gear.efficiency", "leg.gear.friction", "leg.motor.power_cap"])
def test_a_varied_entry_that_the_problem_does_not_state_is_in_the_program_of_its_points(entry: str) -> None:
    definition = define(load("paper", SMALL), {entry: [0.5, 0.75]})
    for k, value in enumerate((0.5, 0.75)):
        hop = Hop(definition.design_at(k), "clearance")
        t, _ = programs.first_program(definition, hop, definition.values(k), NEVER)
        assert {p.name: p.value for p in t.fixed}[entry] == value


def test_a_point_without_losses_has_its_own_tie_break() -> None:
    """Where gears turn from driving to braking it weighs more: in the program as in what a point says of it."""
    definition = define(load("paper", {**SMALL, "leg.gear.efficiency": 0.9}), {"leg.gear.efficiency": [0.8, 1.0]})
    for k in range(2):
        hop = Hop(definition.design_at(k), "clearance")
        guess, costs, told = make_guess(hop, NAMED_STARTS[0]), list[float](), list[float]()
        for t in (first_program(definition, k), first_transcription(hop)):
            z, p = t.pack(guess), t.parameter_values()
            cost = ca.Function("cost", [t.nlp["x"], t.nlp["p"]], [t.nlp["f"]])
            costs.append(float(cost(z, p)))  # type: ignore[arg-type]
            told.append(t.tie_break(z, p))
        assert costs[0] == pytest.approx(costs[1], rel=1e-12)
        assert told[0] == pytest.approx(told[1], rel=1e-12)
