"""Edges at zeros of a state, on a mass that sharp friction brakes, against its closed form."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from hopopt.nlp.mesh import PhaseMesh, uniform
from hopopt.nlp.refinement import mesh_refinement
from hopopt.nlp.refinement.mesh_refinement import MET, Refinement
from hopopt.nlp.refinement.next_mesh import Aims, any_cut, cut, equal
from hopopt.nlp.refinement.sharp.zeros import (
    cut_at_zeros,
    free_at_zeros,
    keeping_signs,
    keeps_zeros,
    sharp_states,
    without_signs,
    zeros,
)
from hopopt.nlp.schemes import radau
from hopopt.nlp.solver.ipopt import NEAR_OPTIONS, Bounds, NlpSolution, NlpSolver
from hopopt.nlp.solver.warm_start import carried
from hopopt.nlp.transcription import Transcription
from hopopt.ocp.guesses.guess import Guess
from hopopt.ocp.problem import Control, Ends, Instant, Objective, PathConstraint, Phase, Problem, State

SHARP, RUB = 0.01, 0.5
AIMS = Aims(1e-6, 1e-5, 1e-5, 1e-4, 8, 500)


def there_and_back(sharp: float = SHARP) -> Problem:
    """From speed 1 to the highest speed backwards within 1 s: a motor of force at most 2 against dry friction of 0.5.

    The motor brakes with 2 and friction helps, 2.5 until the mass stands at 0.4 s; then 1.5 are left, up to speed -0.9.
    """

    def friction(v: ca.SX) -> ca.SX:
        return RUB * v / (v**4 + SHARP**4) ** 0.25

    def force(s: Instant) -> ca.SX:
        return s.a + friction(s.v)

    phase = Phase(
        "way", (State("v", initial=1.0, sharp=sharp),), (Control("a", scale=2.0),), lambda s: {"v": s.a}, (1.0, 1.0),
        (PathConstraint("force", force, -2.0, 2.0, 2.0),),
    )  # fmt: skip

    def speed(e: Ends) -> ca.SX:
        return e.final["way"].v

    return Problem("there and back", (phase,), Objective("speed", speed))


def solved(problem: Problem, mesh: PhaseMesh) -> NlpSolution:
    t = Transcription(problem, radau(3), {"way": mesh})
    guess = Guess(1.0, np.array([0.0, 1.0]), np.array([[1.0], [-1.0]]), np.full((2, 1), -2.0))
    found = NlpSolver(t)({"way": guess})
    assert found.success
    return found


def test_edges_stand_where_the_speed_is_zero_and_move_with_it() -> None:
    problem = there_and_back()
    coarse = solved(problem, uniform(7))
    (zero,) = zeros(coarse, "way")
    assert zero.place == pytest.approx(0.4, abs=0.03)
    assert zero.width == pytest.approx(SHARP / 2.0, rel=0.3)
    cuts = cut_at_zeros(coarse.phases["way"], equal(np.ones(7, dtype=int)), [zero])
    mesh = free_at_zeros(cut(coarse, "way", cuts), [zero])
    (edge,) = mesh.free
    assert mesh.edges[edge] == pytest.approx(zero.place, abs=1e-9)
    lengths = np.diff(mesh.edges)
    assert max(lengths[edge - 1 : edge + 1]) < 1.6 * zero.width
    fine = solved(problem, mesh)
    p = fine.phases["way"]
    assert p.x_start[edge, 0] == pytest.approx(0.0, abs=1e-9)
    assert p.edges[edge] == pytest.approx(0.4, abs=1e-3)
    (again,) = zeros(fine, "way")
    assert not any_cut({"way": cut_at_zeros(p, equal(np.ones(mesh.intervals, dtype=int)), [again])})
    assert free_at_zeros(cut(fine, "way", equal(np.ones(mesh.intervals, dtype=int))), [again]).free == mesh.free


def test_a_refinement_ends_on_an_ordinary_mesh_at_the_closed_form() -> None:
    """-0.9 but for what the smooth law differs by, of the order of friction times the time within its range."""
    found = Refinement(solved(there_and_back(), uniform(7)), AIMS).run()
    assert found.ended == MET
    assert all(not mesh.free and not mesh.zeros for mesh in found.solution.transcription.mesh.values())
    assert found.solution.objective == pytest.approx(-0.9, abs=RUB * SHARP)
    assert max(e.excess.max() for e in found.errors.values()) <= AIMS.excess


def test_an_edge_at_a_zero_does_not_go_to_another_far_from_it() -> None:
    """A hop begins at rest, where its speeds are zero too: there arcs would vanish, and the rest be left without intervals."""
    mesh = PhaseMesh((0.0, 0.4, 0.7, 1.0), (1, 2), (0, 0))
    t = Transcription(there_and_back(), radau(3), {"way": mesh})
    guess = Guess(1.0, np.array([0.0, 1.0]), np.array([[1.0], [-1.0]]), np.full((2, 1), -2.0))
    shortest, _ = t.bounds({"way": guess})
    assert (shortest[t.variables["way"].durations] * t.scale[t.variables["way"].durations] >= 0.5 * mesh.spans).all()


def test_without_sharp_states_nothing_is_set() -> None:
    problem = there_and_back(0.0)
    assert not sharp_states(problem)
    assert zeros(solved(problem, uniform(7)), "way") == []


def test_a_state_that_touches_zero_at_an_edge_and_goes_back_does_not_pass_it() -> None:
    """Driven to the highest speed forwards, the mass would come to rest at the edge for nothing."""
    problem, mesh = there_and_back(), PhaseMesh((0.0, 0.2, 0.4, 0.7, 1.0), (2,), (0,))
    assert keeps_zeros(solved(problem, mesh))
    forwards = replace(problem, objective=Objective("speed", lambda e: -e.final["way"].v))
    assert not keeps_zeros(solved(forwards, mesh))
    assert keeps_zeros(solved(forwards, uniform(4)))


def towards(speeds: list[float]) -> Guess:
    """Within 1 s through these speeds at equal times."""
    return Guess(1.0, np.linspace(0.0, 1.0, len(speeds)), np.array(speeds)[:, None], np.full((len(speeds), 1), -2.0))


def signed(t: Transcription, guess: Guess, same: PhaseMesh | None = None) -> tuple[Bounds, Bounds]:
    """The program's own bounds, and those within which the speed keeps the guess's sign."""
    own = Bounds(*t.bounds({"way": guess}), t.lbg, t.ubg)
    return own, keeping_signs(t, {"way": guess}, own, None if same is None else {"way": same})


def test_between_its_zeros_a_state_keeps_its_sign() -> None:
    """And is not held by that where the guess has the optimum's signs."""
    t = Transcription(there_and_back(), radau(3), {"way": PhaseMesh((0.0, 0.2, 0.4, 0.7, 1.0), (2,), (0,))})
    guess = towards([1.0, 0.5, 0.0, -0.3, -0.6, -0.9])
    own, kept = signed(t, guess)
    nodes, edge = t.variables["way"].x, 2 * t.scheme.steps
    assert (kept.low_z[nodes][1:edge] == 0).all()
    assert (kept.high_z[nodes][edge + 1 :] == 0).all()
    assert not np.isfinite(kept.high_z[nodes][1:edge]).any()
    assert kept.low_z[nodes][edge] == kept.high_z[nodes][edge] == 0
    free, within = (NlpSolver(t)({"way": guess}, bounds=bounds) for bounds in (own, kept))
    assert free.success
    assert within.success
    assert within.objective == pytest.approx(free.objective, abs=1e-7)
    assert not without_signs(within, own)[1]


def test_a_zero_that_was_free_stays_where_its_place_was_best() -> None:
    """Its edge no longer free, the program is solved where it was, at once; let go, it moves by the mesh's error alone."""
    problem, mesh = there_and_back(), PhaseMesh((0.0, 0.2, 0.4, 0.7, 1.0), (2,), (0,))
    last = solved(problem, mesh)
    edges = last.phases["way"].edges / last.phases["way"].duration
    t = Transcription(problem, radau(3), {"way": PhaseMesh(tuple(edges))})
    own = Bounds(*t.bounds(last.phases), t.lbg, t.ubg)
    kept = keeping_signs(t, last.phases, own, last.transcription.mesh)
    at = t.variables["way"].x.start + 2 * t.scheme.steps
    assert kept.low_z[at] == kept.high_z[at] == 0
    found = NlpSolver(t, NEAR_OPTIONS)(last.phases, multipliers=carried(last, t), bounds=kept)
    assert found.success
    assert found.iterations <= 5
    assert found.objective == pytest.approx(last.objective, abs=1e-9)
    let_go = NlpSolver(t, NEAR_OPTIONS).again(without_signs(found, own)[0], own)
    assert let_go.success
    assert let_go.objective == pytest.approx(last.objective, abs=1e-5)


def test_meshes_beyond_the_last_have_free_edges_at_zeros_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """And end without, as those before them."""
    origin = Refinement(solved(there_and_back(), uniform(5)), AIMS).run()
    assert origin.ended == MET
    passed = []
    monkeypatch.setattr(mesh_refinement, "free_at_zeros", lambda m, z: passed.append(len(z)) or free_at_zeros(m, z))
    finer = origin.on_pieces({"way": np.full(origin.solution.transcription.mesh["way"].intervals, 2)})
    assert finer is not None
    assert finer.ended == MET
    assert passed[0] == 1
    assert not finer.solution.transcription.mesh["way"].zeros


def test_a_sign_that_holds_a_state_from_something_better_is_found() -> None:
    """Driven to the highest speed forwards, the mass would be kept from it by the signs of a guess that goes back."""
    forwards = replace(there_and_back(), objective=Objective("speed", lambda e: -e.final["way"].v))
    t = Transcription(forwards, radau(3), {"way": uniform(4)})
    own, kept = signed(t, towards([1.0, -1.0]), uniform(4))
    found = NlpSolver(t)({"way": towards([1.0, -1.0])}, bounds=kept)
    assert found.success
    released, held = without_signs(found, own)
    assert held
    assert released.bounds is own
    assert found.objective > -0.1 > NlpSolver(t).again(released, own).objective
