"""Maps as a user asks for them: the first mesh's own values, marked as preliminary, families followed, nothing lost."""

import json
from pathlib import Path

import numpy as np
import pytest

import hopopt as ho
from hopopt.errors import ResultError, UsageError
from hopopt.nlp.solver.ipopt import NlpSolver
from hopopt.ocp.guesses.initial_guess import make_guess, starts_of
from hopopt.ocp.hop import Hop
from hopopt.planner.search.multistart import first_transcription
from hopopt.studies.maps.doubt import doubtful
from hopopt.studies.maps.found import Map, Verified
from hopopt.studies.maps.pieces import pieces, way
from hopopt.studies.maps.run import run_map
from hopopt.studies.maps.warm import Carried, MapPoint
from hopopt.studies.sweep.definition import Definition, define
from hopopt.studies.sweep.point_file import IMPOSSIBLE, NOT_SOLVED, PRELIMINARY, VERIFIED, Point

COARSE = ["solver.stance_intervals=8", "solver.flight_intervals=4", "hop.stance_duration=[0.03, 0.2]"]
GRID = {"leg.gear.ratio": [120, 110, 130], "leg.shank.length": [0.2, 0.355, 0.361]}


def asked(vary: dict[str, list[float]], **more: object) -> Definition:
    return define(ho.load("paper", COARSE), vary, starts=1, preliminary=True, **more)  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Map:
    """Nine designs on a coarse first mesh, three with a shank too short to stand on; none is verified."""
    return run_map(asked(GRID), processes=1, checked=0, results=tmp_path_factory.mktemp("results"))


def test_values_are_those_of_the_first_mesh_solved_alone(small: Map) -> None:
    """Each from the leg's own start with its own program and the tightest tolerance."""
    for k in (1, 8):
        hop = Hop(small.definition.design_at(k))
        alone = NlpSolver(first_transcription(hop), {"ipopt.max_iter": 600})(make_guess(hop, starts_of(hop, 1)[0]))
        assert alone.success
        assert small.preliminary[k].objective_value == pytest.approx(alone.value, rel=3e-4)


def test_nothing_is_called_verified_and_no_failure_has_a_value(small: Map) -> None:
    assert [p.outcome for p in small.points].count(IMPOSSIBLE) == 3
    for p in small.points:
        assert p.outcome in (PRELIMINARY, IMPOSSIBLE)
        assert p.clearance_m is None
        assert (p.objective_value is None) is (p.outcome == IMPOSSIBLE)
    assert all("below the ground" in p.sentence for p in small.failures)
    assert small.best is None
    assert small.exit_code == 0
    assert small.as_dict()["preliminary"] is True
    table = (small.folder / "table.csv").read_text()
    assert table.count(PRELIMINARY) == 6


def test_the_figure_says_that_it_is_preliminary(small: Map) -> None:
    from hopopt.plots.studies.sweep import figures

    (figure,) = figures(small).values()
    assert "preliminary" in figure.get_suptitle()
    assert {"preliminary, family 1", IMPOSSIBLE} <= {text.get_text() for text in figure.legends[0].get_texts()}


def test_what_is_finished_is_kept_and_the_rest_comes_out_the_same(small: Map, tmp_path: Path) -> None:
    folder = tmp_path / "study"
    folder.mkdir()
    for path in small.folder.rglob("*"):
        if path.is_file():
            (folder / path.relative_to(small.folder)).parent.mkdir(exist_ok=True)
            (folder / path.relative_to(small.folder)).write_bytes(path.read_bytes())
    (folder / "pieces" / "piece-0001.json").unlink()
    again = run_map(small.definition, processes=1, checked=0, resume=folder)
    assert 0 < again.solved_now < len(small.points)
    for a, b in zip(again.preliminary, small.preliminary, strict=True):
        assert (a.outcome, a.objective_value, a.family) == (b.outcome, b.objective_value, b.family)
    path = folder / "pieces" / "piece-0000.json"
    path.write_text(path.read_text().replace(PRELIMINARY, VERIFIED, 1))
    with pytest.raises(ResultError, match="changed after it was written"):
        run_map(small.definition, processes=1, checked=0, resume=folder)


def test_a_map_and_a_study_are_not_each_other(small: Map) -> None:
    plain = define(ho.load("paper", COARSE), GRID, starts=1)
    assert "preliminary" not in plain.as_dict()
    with pytest.raises(ResultError, match="another study"):
        ho.sweep(plain.design, GRID, starts=1, resume=small.folder)
    with pytest.raises(UsageError, match="--verify-best goes with --preliminary"):
        ho.sweep("paper", GRID, verify_best=3)


@pytest.mark.parametrize(
    "vary", [{"leg.gear.ratio": np.linspace(60, 160, 7), "leg.body.mass": np.linspace(4, 8, 6)}, None]
)
def test_every_point_is_in_one_piece_after_the_one_it_begins_from(vary: dict[str, list[float]] | None) -> None:
    more = {} if vary else {"sample": "lhs:40"}
    definition = asked(vary or {"leg.gear.ratio": [60, 160], "leg.body.mass": [4, 8]}, **more)
    found, finished = pieces(definition, 11), set[int]()
    assert len(found) > 1
    for piece in found:
        for k in piece.points:
            begin = piece.begins.get(k)
            assert begin is None or begin in finished
            if k == piece.points[0] and begin is not None:
                assert any(begin in other.exits for other in found[: piece.number])
            finished.add(k)
    assert finished == set(range(len(definition.points)))
    assert found[0].points[0] == 11
    assert found[0].entrance is None


def test_a_grid_is_crossed_step_by_step_and_form_by_form() -> None:
    """A limit's value is form: its program is built once for all points that follow each other."""
    definition = asked({"leg.gear.ratio": [60, 80, 100, 120], "hop.stance_duration[1]": [0.1, 0.2, 0.3]})
    _, parents = way(definition, 0)
    for k, begin in parents.items():
        step = np.abs(definition.spaced[k] - definition.spaced[begin])
        assert step.sum() == 1
        if step[1]:  # another form only from where the ratio is the first point's
            assert definition.spaced[k][0] == definition.spaced[0][0]


def test_a_family_is_followed_again_once_it_may_have_caught_up() -> None:
    far = Carried(np.zeros(1), np.zeros(1), np.zeros(1), 0.1, np.array([0.2, 0.5]))
    assert not far.may_be_best(np.array([0.4, 0.6]))
    assert far.may_be_best(np.array([0.5, 0.8]))
    failed = far.left(np.array([0.5, 0.8]))  # it was tried there, and led to no hop
    assert not failed.may_be_best(np.array([0.6, 0.9]))
    assert failed.may_be_best(np.array([0.8, 1.0]))
    assert far.left(np.array([0.4, 0.6])) is far  # it was not tried there


def test_who_is_next_to_a_family_that_was_never_followed_there_is_doubted() -> None:
    definition = asked({"leg.gear.ratio": [60, 70, 80, 90]})
    points = {
        k: MapPoint(k, definition.values(k), PRELIMINARY, objective_value=1 - 0.1 * k, family=f, seen=seen)
        for k, (f, seen) in enumerate([(2, (1, 2)), (1, (1,)), (1, (1,)), (1, (1, 2))])
    }
    assert doubtful(definition, points, False) == {1: [0]}
    points[3] = MapPoint(3, definition.values(3), NOT_SOLVED)
    assert doubtful(definition, points, True)[3][0] == 2


def test_the_difference_is_that_of_verified_points_alone(small: Map) -> None:
    solved = next(p for p in small.preliminary if p.solved)
    value = solved.objective_value or 0.0
    good = Point(solved.index, solved.values, VERIFIED, objective_value=value / 1.01, clearance_m=value / 1.01)
    better = Point(solved.index, solved.values, VERIFIED, objective_value=1.1 * value, clearance_m=1.1 * value)
    bad = Point(solved.index, solved.values, NOT_SOLVED, "no start led to a hop")
    pairs = tuple(Verified(solved, found) for found in (good, better, bad))
    found = Map(small.definition, small.points, small.folder, 1.0, small.preliminary, sampled=pairs)
    assert found.differences == pytest.approx([0.01, 1 / 1.1 - 1])
    assert found.missed == 1
    assert json.loads(json.dumps(found.as_dict()["difference_of_sample"]))["most"] == pytest.approx(0.01)


@pytest.mark.rarely
def test_the_first_mesh_is_near_what_is_verified(tmp_path: Path) -> None:
    """On the paper's leg: five designs drawn, and the best, beside full solves of their own."""
    found = ho.sweep(
        "paper",
        {"leg.gear.ratio": "90:130:5", "leg.body.mass": "5:6:3"},
        preliminary=True,
        verify_best=1,
        results=tmp_path,
    )
    assert isinstance(found, ho.Map)
    assert len(found.differences) == 5
    assert max(map(abs, found.differences)) < 3e-3
    (best,) = found.best_verified
    assert best.found.verified
    assert best.preliminary.index == found.best_preliminary.index  # type: ignore[union-attr]
    assert sum(p.verified for p in found.points) in (5, 6)
