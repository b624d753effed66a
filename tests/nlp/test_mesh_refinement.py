"""Refinement and back-off against closed forms, and their bookkeeping."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from hopopt.nlp.mesh import PhaseMesh, mesh_of_arcs, uniform
from hopopt.nlp.refinement import mesh_refinement as refine
from hopopt.nlp.refinement import solving
from hopopt.nlp.refinement.continuous_limits import enforcing
from hopopt.nlp.refinement.interval_errors import IntervalErrors, interval_errors, stage_values
from hopopt.nlp.refinement.mesh_refinement import (
    BEHIND,
    MET,
    NO_NEARER,
    NOT_ASKED,
    TOO_FINE,
    UNSOLVED,
    USED_UP,
    WORSE,
    Refinement,
)
from hopopt.nlp.refinement.mesh_step import STUCK, change_of
from hopopt.nlp.refinement.next_mesh import Aims, Measured, cut, equal, fitting, outdone, pieces_of
from hopopt.nlp.refinement.tightening import limit_nodes, passed, tightened, tightened_by_excess
from hopopt.nlp.refinement.tightening_cost import tightening_cost
from hopopt.nlp.schemes import Scheme, radau
from hopopt.nlp.solver.ipopt import WARM, Bounds, NlpSolution, NlpSolver
from hopopt.nlp.solver.warm_start import carried
from hopopt.nlp.transcription import Transcription
from hopopt.ocp.problem import Control, Objective, PathConstraint, Phase, Problem, State
from known_problems import SCHEMES, Known, brachistochrone, bryson_denham, moved, solve

each_scheme = pytest.mark.parametrize("method", SCHEMES, ids=lambda s: s.name)
ALLOWED, TIGHTENING_COST = 1e-4, 1e-5


def bang_bang() -> Known:
    """From rest to rest in the shortest time with |u| <= 1.3: T = 2 sqrt(d / 1.3), one switch half-way."""
    phase = moved((-1.3, 1.3), 0.7, (0.1, 10.0))
    problem = Problem("time", (phase,), Objective("time", lambda e: e.duration["move"]))
    return Known(problem, 2 * np.sqrt(0.7 / 1.3), {"move": (1.0, ([0, 0], [0.7, 0], 0.0))})


@each_scheme
@pytest.mark.parametrize("intervals", [7, 10])
def test_bang_bang_is_neither_beaten_nor_missed(method: Scheme, intervals: int) -> None:
    """The double integrator has no error: what keeps the limits cannot be faster, and gives away the tightening cost at most."""
    known = bang_bang()
    begin, aims = solve(known, method, uniform(intervals)), Aims(1e-6, 1e-4, ALLOWED, TIGHTENING_COST, 20, 300)
    refinement = Refinement(begin, aims, between=True).run()
    end = refinement.history[-1]
    assert end.excess <= ALLOWED
    assert known.optimum * (1 - ALLOWED) <= end.objective <= known.optimum * (1 + 2 * TIGHTENING_COST)
    assert tightening_cost(refinement.solution) <= TIGHTENING_COST


def test_unrefined_bang_bang_is_too_fast() -> None:
    """What back-off is for: held at the nodes only, the control overshoots and gains by it."""
    known = bang_bang()
    assert solve(known, radau(3), mesh_of_arcs([0, 0.6, 1], [1, 1])).objective < known.optimum * (1 - 1e-4)


@pytest.mark.parametrize("method", [radau(2), radau(3)], ids=lambda s: s.name)
def test_tightening_cost_covers_its_loss(method: Scheme) -> None:
    """No less than what drawing in loses against the closed form."""
    known = bryson_denham(path=True)
    before = solve(known, method, uniform(10))
    errors = {"move": interval_errors(before, "move")}
    assert errors["move"].excess.max() > ALLOWED
    after = NlpSolver(before.transcription, WARM).again(before, tightened_by_excess(before, errors, ALLOWED))
    assert after.success
    assert interval_errors(after, "move").excess.max() < errors["move"].excess.max()
    assert tightening_cost(before) == 0.0
    assert before.objective < after.objective <= known.optimum * (1 + tightening_cost(after))


@each_scheme
def test_nodes_of_a_limit_hold_its_values(method: Scheme) -> None:
    """The indices by which a limit is tightened lead to the values whose excess was measured, in their order."""
    s = solve(bryson_denham(path=True), method, mesh_of_arcs([0, 0.4, 1], [3, 4]))
    stacked = np.concatenate([s.z, s.g])
    limits = tuple(str(x) for x in interval_errors(s, "move").limits)
    assert limits == ("height", "x", "v", "u")
    at_controls = stage_values(s, "move", np.array(method.control_c))
    u = s.phases["move"].everywhere(np.array(method.control_c))[2]
    nodes = np.array([0.0, *method.c][method.starts_at_node :])
    x = s.phases["move"].everywhere(nodes)[1]
    expected = [at_controls[2][..., 0] / 0.25, x[..., 0] / 0.5, x[..., 1], u[..., 0]]
    for index, value in zip(limit_nodes(s.transcription, "move"), expected, strict=True):
        np.testing.assert_allclose(stacked[index], value, atol=1e-9)


def test_given_values_stay() -> None:
    """Bounds that would cross, such as those of a given start, are left as they are."""
    s = solve(bryson_denham(), radau(3), uniform(6))
    errors = interval_errors(s, "move")
    everywhere = replace(errors, below=np.full_like(errors.below, 0.1), above=np.full_like(errors.above, 0.1))
    drawn = tightened_by_excess(s, {"move": everywhere}, ALLOWED)
    assert np.all(drawn.low_z <= drawn.high_z)
    assert np.all(drawn.low_g <= drawn.high_g)
    given = s.bounds.low_z == s.bounds.high_z
    assert given.sum() == 5  # both states at both ends, and the duration
    np.testing.assert_array_equal(drawn.low_z[given], s.bounds.low_z[given])
    finite = np.isfinite(s.bounds.high_z) & ~given
    np.testing.assert_allclose(drawn.high_z[finite], s.bounds.high_z[finite] - 0.1)


def test_cutting_keeps_the_edges_there_are() -> None:
    s = solve(bryson_denham(), radau(3), mesh_of_arcs([0, 0.4, 1], [2, 2]))
    edges, parts = s.phases["move"].edges, np.array([1, 3, 1, 2])
    mesh = cut(s, "move", equal(parts))
    assert mesh.intervals == parts.sum()
    np.testing.assert_allclose(np.array(mesh.edges)[np.concatenate([[0], np.cumsum(parts)])], edges, atol=1e-12)
    np.testing.assert_allclose(np.array(mesh.edges)[list(mesh.free)], edges[2:3])


@each_scheme
def test_carried_multipliers_are_nearly_those_of_the_finer_mesh(method: Scheme) -> None:
    """Costates and densities do not depend on the mesh, and Ipopt hardly moves from them."""
    known = brachistochrone()
    coarse = solve(known, method, uniform(12))
    mesh = {"slide": cut(coarse, "slide", equal(np.where(np.arange(12) % 2, 2, 1)))}
    t = Transcription(known.problem, method, mesh)
    guess, multipliers = t.guess_from(coarse.phases), carried(coarse, t)
    cold, warm = NlpSolver(t)(guess), NlpSolver(t, WARM)(guess, None, multipliers)
    assert cold.success
    assert warm.success
    assert warm.objective == pytest.approx(cold.objective, rel=1e-7)
    assert warm.iterations <= cold.iterations
    defects = slice(0, t.rows[0].stop)
    largest = np.abs(cold.lam_g[defects]).max()
    assert np.abs(multipliers[0][defects] - cold.lam_g[defects]).max() < 0.1 * largest


@each_scheme
def test_multipliers_carried_to_the_same_mesh_are_the_same(method: Scheme) -> None:
    s = solve(bryson_denham(), method, mesh_of_arcs([0, 0.4, 1], [3, 4]))
    lam_g, lam_x = carried(s, s.transcription)
    np.testing.assert_allclose(lam_g, s.lam_g, atol=1e-6)
    np.testing.assert_allclose(lam_x, s.lam_x, atol=1e-9)


@each_scheme
def test_multipliers_are_carried_from_where_free_edges_have_come_to(method: Scheme) -> None:
    """On a mesh with its edges there, none of them free, they are the same but for what is due to the mesh's error."""
    s = solve(bryson_denham(), method, mesh_of_arcs([0, 0.4, 1], [3, 4]))
    (name, phase), old = next(iter(s.phases.items())), s.transcription
    edges = phase.edges / phase.duration
    assert np.abs(edges - old.mesh[name].edges).max() > 1e-3
    t = Transcription(old.problem, method, {name: PhaseMesh(tuple(edges))})
    lam_g, _ = carried(s, t)
    defects = next(r for r in t.rows if r.kind == "defect"), next(r for r in old.rows if r.kind == "defect")
    now, before = (lam[r.start : r.stop] for lam, r in zip((lam_g, s.lam_g), defects, strict=True))
    np.testing.assert_allclose(now, before, atol=1e-6)


def test_bounds_are_drawn_in_by_what_is_given_interval_by_interval() -> None:
    known = bang_bang()
    s = solve(known, radau(3), uniform(6))
    t = s.transcription
    amounts = np.zeros_like(passed(interval_errors(s, "move"), 0.0))
    amounts[1, 2, -1] = 0.25  # the upper limit of the control in the third interval
    own = Bounds(*t.bounds(t.guess_from(s.phases)), t.lbg, t.ubg)
    drawn = tightened(own, t, {"move": amounts})
    moved = np.flatnonzero(drawn.high_z != own.high_z)
    controls = t.variables["move"].u.start + t.layouts["move"].controls_of[2]
    np.testing.assert_array_equal(moved, controls)
    np.testing.assert_allclose(own.high_z[moved] - drawn.high_z[moved], 0.25)
    np.testing.assert_array_equal(drawn.low_z, own.low_z)
    held = NlpSolver(t).again(s, drawn)
    assert held.success
    assert held.objective > s.objective  # slower where less is allowed


@pytest.mark.parametrize(
    "known", [brachistochrone(), bryson_denham(path=True)], ids=["brachistochrone", "bryson-denham"]
)
def test_aims_are_met_or_it_says_so(known: Known) -> None:
    refinement = Refinement(
        solve(known, radau(3), uniform(8)), Aims(1e-7, 1e-5, ALLOWED, TIGHTENING_COST, 20, 300)
    ).run()
    errors = [interval_errors(refinement.solution, name) for name in refinement.solution.phases]
    assert max(e.local.max() for e in errors) <= 1e-7
    assert max(e.excess.max() for e in errors) <= ALLOWED
    assert refinement.history[-1].objective == pytest.approx(known.optimum, rel=1e-4)
    assert refinement.ended == MET


def test_without_meshes_nothing_is_reached() -> None:
    refinement = Refinement(
        solve(bang_bang(), radau(3), uniform(7)), Aims(1e-6, 1e-4, ALLOWED, TIGHTENING_COST, 0, 300)
    ).run()
    assert len(refinement.history) == 1
    assert refinement.change == float("inf")
    assert refinement.ended == NOT_ASKED
    only = Refinement(
        solve(brachistochrone(), radau(3), uniform(8)), Aims(1e-9, 1e-9, ALLOWED, TIGHTENING_COST, 1, 300)
    ).run()
    assert only.ended == USED_UP


@each_scheme
def test_a_mesh_that_is_not_solved_at_once_waits_for_restarts(method: Scheme, monkeypatch: pytest.MonkeyPatch) -> None:
    """With too little patience for carried multipliers: restarts end where patience does; without them, or where they
    have used up their iterations, it is said."""
    begin = solve(brachistochrone(), method, uniform(8))
    known = Refinement(begin, Aims(1e-7, 1e-5, ALLOWED, TIGHTENING_COST, 20, 300)).run()
    monkeypatch.setattr(solving, "CARRIED_ITERATIONS", 1)
    monkeypatch.setattr(solving, "LONGER", 1)
    hasty = Refinement(begin, Aims(1e-7, 1e-5, ALLOWED, TIGHTENING_COST, 20, 300, restarts=0)).run()
    assert hasty.ended == UNSOLVED
    assert len(hasty.history) == 1
    patient = Refinement(begin, Aims(1e-7, 1e-5, ALLOWED, TIGHTENING_COST, 20, 300)).run()
    assert patient.ended == MET
    assert patient.solution.objective == pytest.approx(known.solution.objective, rel=1e-7)
    needed = patient.history[1].iterations
    for iterations, ended in ((needed - 1, UNSOLVED), (sum(step.iterations for step in patient.history), MET)):
        limited = Refinement(
            begin, Aims(1e-7, 1e-5, ALLOWED, TIGHTENING_COST, 20, 300, restarts=iterations / 300)
        ).run()
        assert limited.ended == ended


def jerked() -> Known:
    """A triple integrator from rest to rest with |u| <= 1.3 in the shortest time, never below its start: T = (32 d / 1.3)^(1/3), with
    switches at T / 4 and 3 T / 4; it comes off its start with the cube of time."""
    names = ("x", "v", "a")
    states = tuple(State(name, initial=0.0, final=0.7 if name == "x" else 0.0) for name in names)
    limits = (
        PathConstraint("u", lambda s: s.u, -1.3, 1.3),
        PathConstraint("x", lambda s: s.x, lower=0.0),
    )
    phase = Phase("move", states, (Control("u"),), lambda s: {"x": s.v, "v": s.a, "a": s.u}, (0.1, 10.0), limits)
    problem = Problem("time", (phase,), Objective("time", lambda e: e.duration["move"]))
    return Known(problem, (32 * 0.7 / 1.3) ** (1 / 3), {"move": (2.0, ([0, 0, 0], [0.7, 0, 0], 0.0))})


def test_a_limit_that_is_only_touched_is_not_enforced_where_its_hull_leaves_no_room(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """With its hull enforced the second mesh is slower by a seventh, which is not believed."""
    known = jerked()
    monkeypatch.setattr(solving, "AGREED", -1.0)
    begin = solve(known, radau(3), uniform(7))
    refinement = Refinement(begin, Aims(1e-6, 1e-4, ALLOWED, TIGHTENING_COST, 20, 300, restarts=0)).run()
    assert refinement.ended == MET
    assert refinement.history[-1].excess <= ALLOWED
    assert refinement.solution.objective == pytest.approx(known.optimum, rel=ALLOWED)


def test_a_first_mesh_that_claims_too_much_is_not_believed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Worse than the coarse mesh by more than an optimum may be: believed where another solve agrees, else refused."""
    known = bang_bang()
    coarse = solve(known, radau(3), mesh_of_arcs([0, 0.6, 1], [1, 1]))
    assert coarse.objective < known.optimum * (1 - 1e-4)
    monkeypatch.setattr(solving, "MOST_LOST", 1e-5)
    refinement = Refinement(coarse, Aims(1e-6, 1e-4, ALLOWED, TIGHTENING_COST, 20, 300)).run()
    assert refinement.ended == MET
    assert refinement.solution.objective == pytest.approx(known.optimum, rel=2 * ALLOWED)
    monkeypatch.setattr(solving, "AGREED", -1.0)
    doubting = Refinement(coarse, Aims(1e-6, 1e-4, ALLOWED, TIGHTENING_COST, 20, 300)).run()
    assert doubting.ended == WORSE


def test_too_fine_a_mesh_is_not_begun(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(refine, "FINEST", 9)
    refinement = Refinement(
        solve(brachistochrone(), radau(3), uniform(8)), Aims(1e-7, 1e-5, ALLOWED, TIGHTENING_COST, 20, 300)
    ).run()
    assert refinement.ended == TOO_FINE
    assert len(refinement.history) == 1


def test_where_not_all_cuts_fit_the_most_urgent_are_made() -> None:
    pieces, urgency = (
        {"a": np.array([8, 1, 2]), "b": np.array([4, 2])},
        {"a": np.array([1, 9, 5]), "b": np.array([3, 7])},
    )
    cuts = {name: equal(each) for name, each in pieces.items()}
    assert fitting(cuts, urgency, 17) == cuts  # all
    some = fitting(cuts, urgency, 8)  # the two most urgent: one more each
    assert some is not None
    assert [pieces_of(part).tolist() for part in some.values()] == [[1, 1, 2], [1, 2]]
    assert fitting(cuts, urgency, 5) is None


def test_a_mesh_that_would_be_too_fine_is_cut_where_it_matters_most(monkeypatch: pytest.MonkeyPatch) -> None:
    """To the same optimum, within fewer intervals."""
    known, aims = bang_bang(), Aims(1e-8, 1e-5, ALLOWED, TIGHTENING_COST, 20, 300)
    free = Refinement(solve(known, radau(3), uniform(8)), aims).run()
    most = sum(free.history[-1].intervals.values())
    monkeypatch.setattr(refine, "FINEST", most - 1)
    within = Refinement(solve(known, radau(3), uniform(8)), aims).run()
    assert within.ended == MET
    assert sum(within.history[-1].intervals.values()) < most
    assert within.solution.objective == pytest.approx(known.optimum, rel=2 * ALLOWED)


def test_a_mesh_on_which_only_limits_move_is_not_built_again(monkeypatch: pytest.MonkeyPatch) -> None:
    built = []
    monkeypatch.setattr(refine, "enforcing", lambda *a: built.append(a) or enforcing(*a))
    refinement = Refinement(solve(bryson_denham(), radau(3), uniform(5)), Aims(1e-6, 1e-4, 1e-6, 1e-5, 20, 300)).run()
    assert refinement.ended == MET
    solved = [(step.intervals, step.held) for step in refinement.history[1:]]
    assert len(built) == 1 + sum(a != b for a, b in itertools.pairwise(solved))
    assert len(built) < len(solved)


@pytest.mark.parametrize("between", [True, False])
def test_one_that_goes_further_leaves_its_origin_as_it_was(between: bool) -> None:
    """And so another that goes on from the same origin comes to the same."""
    begin = solve(bryson_denham(), radau(3), uniform(5))
    origin = Refinement(begin, Aims(1e-3, 1e-2, 1e-2, 1e-2, 20, 300), between=between).run()
    before = {name: dict(value) for name, value in vars(origin).items() if isinstance(value, dict)}
    length = len(origin.history)
    aims = Aims(1e-6, 1e-4, 1e-6, 1e-5, 20, 300)
    steps = [[(s.intervals, s.objective) for s in origin.further(aims).history] for _ in range(2)]
    assert steps[0] == steps[1]
    assert len(origin.history) == length < len(steps[0])
    for name, values in before.items():
        assert all(value is values[phase] for phase, value in vars(origin)[name].items()), name


@pytest.mark.parametrize("between", [True, False])
def test_meshes_that_bring_it_no_nearer_end_it(between: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """An error about the middle that no cut lessens, as that of an impulse."""

    def unresponsive(s: NlpSolution, name: str) -> IntervalErrors:
        found, ends = interval_errors(s, name), np.cumsum(s.phases[name].lengths)
        middle = int(np.searchsorted(ends, ends[-1] / 2))
        return replace(found, local=np.where(np.arange(len(ends)) == middle, 1e-3, 0.0))

    monkeypatch.setattr(refine, "interval_errors", unresponsive)
    begin, aims = solve(brachistochrone(), radau(3), uniform(8)), Aims(1e-7, 1e-5, ALLOWED, TIGHTENING_COST, 20, 300)
    refinement = Refinement(begin, aims, between=between).run()
    assert refinement.ended == NO_NEARER
    assert len(refinement.history) == STUCK + 1


@pytest.mark.parametrize("between", [True, False])
def test_what_cannot_become_better_than_a_known_optimum_is_left(between: bool) -> None:
    """And nothing else: one that is near it, or better, is refined as without it."""
    known = bryson_denham(path=True)
    begin, aims = solve(known, radau(3), uniform(10)), Aims(5e-6, 1e-4, ALLOWED, TIGHTENING_COST, 20, 300)

    def refined(better_by: float | None) -> Refinement:
        other = None if better_by is None else known.optimum * (1 - better_by)
        return Refinement(begin, replace(aims, known=other), between=between).run()

    free, behind = refined(None), refined(1e-2)
    assert (free.ended, behind.ended) == (MET, BEHIND)
    assert len(behind.history) == 1 < len(free.history)
    for other in (refined(1e-3), refined(-1e-2)):
        assert [step.objective for step in other.history] == [step.objective for step in free.history]


def test_one_that_is_as_good_as_a_known_optimum_is_left_once_it_has_settled() -> None:
    """Not before, and not one that is better."""
    known, aims = bryson_denham(path=True), Aims(5e-6, 1e-4, ALLOWED, TIGHTENING_COST, 20, 300)
    s = Refinement(solve(known, radau(3), uniform(10)), aims).run().solution
    m = Measured(s, {name: interval_errors(s, name) for name in s.phases})
    as_good, worse = (replace(aims, known=s.value * share) for share in (1 - 1e-6, 1 + 1e-6))
    assert outdone(m, as_good, 1e-6)
    assert not outdone(m, as_good, 1e-3)
    assert not outdone(m, worse, 1e-6)


def test_the_change_of_the_objective_is_that_before_limits_were_tightened() -> None:
    """As refinement states it and hopopt verify computes it again: of the last two meshes, no limit tightened."""
    coarse, fine = {"move": 4}, {"move": 8}
    steps = [(coarse, 1.0, 0), (fine, 2.0, 0), (fine, 3.0, 1), (fine, 4.0, 2)]
    assert change_of(steps, 1e-9) == 0.5
    assert change_of(steps[:1], 1e-9) == np.inf
