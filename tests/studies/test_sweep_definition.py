"""Which points a study has, and what is reported of one that makes no sense."""

import json
from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest

import hopopt as ho
from hopopt.errors import ProblemFileError, ResultError, UsageError
from hopopt.problem.load import catalogue_of
from hopopt.storage.seal.digests import seal
from hopopt.studies.sweep.definition import Axis, Definition, define, parse
from hopopt.studies.sweep.first_program import kinds, with_others
from hopopt.studies.sweep.order import doubtful, sources, to_search, tree
from hopopt.studies.sweep.point_file import IMPOSSIBLE, NOT_SOLVED, VERIFIED, Point
from hopopt.studies.sweep.store import (
    check_same,
    dataset,
    load_begin,
    load_points,
    open_folder,
    read_definition,
    save_point,
    table,
)
from refusals import refusal

PAPER = ho.load("paper")
RATIO, SHANK = "leg.gear.ratio", "leg.shank.length"


def test_grid_has_every_combination_the_last_entry_fastest() -> None:
    study = define(PAPER, {RATIO: "60:160:11", SHANK: "0.30:0.42:7"})
    assert study.shape == (11, 7)
    expected = list(product(np.linspace(60, 160, 11), np.linspace(0.30, 0.42, 7)))
    np.testing.assert_allclose(study.points, expected)
    design = study.design_at(7 * 4 + 2)
    assert design.leg.gear.ratio == pytest.approx(100)
    assert design.leg.link["shank"].length == pytest.approx(0.34)
    assert design.leg.link["thigh"] == PAPER.leg.link["thigh"]


def test_lists_ranges_and_numbers_mean_the_same() -> None:
    for given in ("60,80,100", "60:100:3", [60, 80, 100], np.array([60.0, 80.0, 100.0])):
        assert define(PAPER, {RATIO: given}).axes == (Axis(RATIO, (60.0, 80.0, 100.0)),)


def test_a_value_of_a_list() -> None:
    study = define(PAPER, {"hop.stance_duration[1]": [0.2, 0.3]})
    assert study.design_at(0).hop.stance_duration == (0.03, 0.2)
    assert study.design_at(1).hop.stance_duration == (0.03, 0.3)


def test_a_value_of_a_list_that_has_to_be_whole() -> None:
    """A ratio of a table, which holds numbers alone."""
    table = {"angle": [-2.4, -1.3, -0.15], "ratio": [1.2, 1.0, 0.8]}
    design = ho.load("paper", {"leg.knee.transmission.table": table})
    study = define(design, {"leg.knee.transmission.table.ratio[1]": "0.9,1.0"})
    tables = [study.design_at(k).leg.joint["knee"].transmission for k in range(2)]
    assert [between.table.ratio for between in tables if between and between.table] == [
        (1.2, 0.9, 0.8),
        (1.2, 1.0, 0.8),
    ]


def test_an_entry_that_is_not_set() -> None:
    study = define(PAPER, {"contact.friction": [0.5, 0.8]})
    assert [study.design_at(k).contact.friction for k in range(2)] == [0.5, 0.8]


def test_whole_numbers_stay_whole() -> None:
    assert define(PAPER, {"solver.stance_intervals": "20:40:3"}).design_at(1).solver.stance_intervals == 30
    sampled = define(PAPER, {"solver.stance_intervals": "20:40"}, sample="lhs:5")
    assert np.all(sampled.points == np.round(sampled.points))


@pytest.mark.parametrize("count", [1, 7, 40])
def test_latin_hypercube_has_one_point_in_every_slice(count: int) -> None:
    study = define(PAPER, {RATIO: (60, 160), SHANK: "0.30:0.42"}, sample=f"lhs:{count}", seed=3)
    assert study.shape is None
    for column, (low, high) in zip(study.points.T, [(60, 160), (0.30, 0.42)], strict=True):
        slices = np.floor((column - low) / (high - low) * count)
        assert sorted(slices) == list(range(count))


def test_sobol_fills_every_dyadic_box() -> None:
    """A (0, m, 2)-net in base 2: of 64 points, one in each of 8 x 8 boxes, and of 2 x 32."""
    study = define(PAPER, {RATIO: (60, 160), SHANK: (0.30, 0.42)}, sample="sobol:64", seed=1)
    for boxes in ((8, 8), (2, 32), (32, 2)):
        cells = np.floor(study.normalized * boxes).astype(int)
        assert len({tuple(cell) for cell in cells}) == 64


def test_the_seed_decides_the_sample() -> None:
    def points(seed: int) -> np.ndarray:
        return define(PAPER, {RATIO: (60, 160)}, sample="sobol:8", seed=seed).points

    np.testing.assert_array_equal(points(5), points(5))
    assert not np.array_equal(points(5), points(6))


@pytest.mark.parametrize(
    ("vary", "more", "words"),
    [
        ({"leg.gear.ration": "1:2:3"}, {}, "did you mean ratio"),
        ({"leg.gear.ratio": "100:60:3"}, {}, "lower < upper"),
        ({"leg.gear.ratio": "60:100"}, {}, "how many values? write lower:upper:count, such as 60:100:9"),
        ({"leg.gear.ratio": "60:100:1"}, {}, "a count from 2 to 100000"),
        ({"leg.gear.ratio": "60:160:1000000000"}, {}, "a count from 2 to 100000"),
        ({"leg.gear.ratio": "60:160"}, {"sample": "lhs:100000000000"}, "100000 points at most"),
        ({"leg.gear.ratio": "60:100"}, {}, "lower:upper:count"),
        ({"leg.gear.ratio": "60,eighty"}, {}, "is not a number"),
        ({"leg.gear.ratio": "60,nan"}, {}, "is not a number"),
        ({"leg.gear.ratio": "60,60"}, {}, "each value once"),
        ({"leg.gear.ratio": ""}, {}, "is not a number"),
        ({"name": "1,2"}, {}, "is not a number"),
        ({"leg.motor": "mini-cheetah,nobodys"}, {}, 'leg.motor = "nobodys" is not in the catalogue'),
        ({"leg.knee.gear": "mini-cheetah,mini-cheetah"}, {}, "each name once"),
        ({"hop.counter_movement": "0,1"}, {}, "is not a number"),
        ({"hop.stance_duration": "0.1,0.2"}, {}, "is not a number"),
        ({"hop.stance_duration[2]": "0.1,0.2"}, {}, "no such value"),
        ({"hop.stance_duration[x]": "0.1,0.2"}, {}, "hop.stance_duration[1]"),
        ({"solver.degree": "1:2:3"}, {}, "whole numbers"),
        ({"leg.gear.ratio": "60:100:3"}, {"sample": "lhs:4"}, "lower:upper"),
        ({"leg.gear.ratio": "60:100"}, {"sample": "sobol:6"}, "power of two"),
        ({"leg.gear.ratio": "60:100"}, {"sample": "random:6"}, "lhs:40"),
        ({"leg.gear.ratio": "60:100:1000", "leg.shank.length": "0.3:0.4:1000"}, {}, "at most"),
        ({"leg.gear.ratio": "60:100:3"}, {"objective": "speed"}, "choose one of clearance"),
        ({}, {}, "nothing is varied"),
    ],
)
def test_wrong_use_is_one_sentence(vary: dict, more: dict, words: str) -> None:
    with pytest.raises(UsageError) as caught:
        define(PAPER, vary, **more)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("text", ["leg.gear.ratio", "=1,2", "leg.gear.ratio="])
def test_vary_without_a_value(text: str) -> None:
    with pytest.raises(UsageError, match="write lower:upper:count"):
        parse([text])


def test_vary_twice() -> None:
    with pytest.raises(UsageError, match="twice"):
        parse(["leg.gear.ratio=1,2", "leg.gear.ratio=3,4"])


def test_a_point_that_is_no_problem() -> None:
    with pytest.raises(ProblemFileError, match="below the ground"):
        define(PAPER, {SHANK: [0.2, 0.36]}).design_at(0)


# ---- order ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(4))
def test_every_point_begins_from_the_nearest_before_it(seed: int) -> None:
    x = np.random.default_rng(seed).random((60, 2))
    chosen = [k for k in range(60) if k % 7]
    order, parents = tree(x, chosen)
    assert sorted(order) == chosen
    assert 0 < len(chosen) - len(parents) <= 4  # seeds
    for k, p in parents.items():
        before = order[: order.index(k)]
        assert p in before
        assert np.linalg.norm(x[k] - x[p]) <= np.linalg.norm(x[k] - x[before], axis=1).min() + 1e-9


@pytest.mark.parametrize(
    ("given", "sample"), [({RATIO: "60:160:6", SHANK: "0.30:0.42:4"}, None), ({RATIO: "60:160"}, "lhs:20")]
)
def test_a_point_is_begun_from_all_that_are_beside_and_before_it(given: dict, sample: str | None) -> None:
    study = define(PAPER, given, sample=sample)
    chosen = list(range(len(study.points)))
    order, before = sources(study, chosen)
    parents = tree(study.normalized, chosen)[1]
    assert {k: found[0] for k, found in before.items()} == parents
    for k, found in before.items():
        assert len(set(found)) == len(found)
        assert all(order.index(g) < order.index(k) for g in found)
        if sample is None:
            beside = np.abs(study.spaced - study.spaced[k]).sum(axis=1) == 1
            assert {g for g in np.flatnonzero(beside).tolist() if order.index(g) < order.index(k)} <= set(found)


def test_one_point_and_equal_points() -> None:
    assert tree(np.zeros((1, 1)), [0]) == ([0], {})
    order, parents = tree(np.zeros((5, 2)), range(5))
    assert sorted(order) == list(range(5))
    assert len(parents) == 4


def finished(definition: Definition, values: np.ndarray) -> dict[int, Point]:
    return {
        k: Point(
            k, definition.values(k), VERIFIED, objective_value=float(v), clearance_m=float(v), parts={"sum": float(v)}
        )
        for k, v in enumerate(values)
    }


def test_only_the_point_that_falls_out_of_the_trend_is_doubted() -> None:
    study = define(PAPER, {RATIO: "60:160:9", SHANK: "0.30:0.42:5"})
    x, y = study.normalized.T
    values = 0.7 + 0.2 * x - 0.1 * x**2 + 0.3 * y
    alike = dict.fromkeys(range(45), np.zeros(3))
    assert doubtful(study, finished(study, values), alike) == {}
    values[17] -= 0.05
    jobs = doubtful(study, finished(study, values), alike)
    assert 17 in jobs
    distance = np.linalg.norm(study.normalized - study.normalized[17], axis=1)
    assert max(distance[jobs[17]]) <= np.sort(distance)[4]  # its neighbours


def test_where_less_is_better_the_high_point_is_doubted() -> None:
    study = define(PAPER, {RATIO: "60:160:9", SHANK: "0.30:0.42:5"})
    x, y = study.normalized.T
    values = 0.7 + 0.2 * x - 0.1 * x**2 + 0.3 * y
    values[17] += 0.05
    alike = dict.fromkeys(range(45), np.zeros(3))
    assert 17 in doubtful(study, finished(study, values), alike, -1.0)


def test_where_another_kind_of_optimum_begins_each_side_is_tried_from_the_other() -> None:
    """Of 7 x 3 points the left four columns hold one kind: only the two columns that touch are doubted."""
    study = define(PAPER, {RATIO: "60:120:7", SHANK: "0.30:0.36:3"})
    points = finished(study, np.full(21, 0.8))
    shapes = {k: np.array([0.0, 1.0 if k // 3 < 4 else -1.0]) for k in range(21)}
    jobs = doubtful(study, points, shapes)
    assert {k // 3 for k in jobs} == {3, 4}
    for k, begun in jobs.items():
        assert all(g // 3 == 7 - k // 3 for g in begun)
    points = {k: replace(p, tried=tuple((g, 0) for g in jobs.get(k, ()))) for k, p in points.items()}
    assert doubtful(study, points, shapes) == {}  # tried already
    points[9] = replace(points[9], solved_in=1)  # another solution there now
    assert {k for k, sources in doubtful(study, points, shapes).items() if 9 in sources} == {12}


def test_failed_points_are_solved_again_but_impossible_ones_are_not() -> None:
    study = define(PAPER, {RATIO: "60:160:5"})
    points = finished(study, np.linspace(0.9, 0.5, 5))
    points[1] = Point(1, study.values(1), NOT_SOLVED, "no start led to a hop")
    points[3] = Point(3, study.values(3), IMPOSSIBLE, "the leg is too short")
    alike = dict.fromkeys(range(5), np.zeros(3))
    assert doubtful(study, points, alike) == {1: [0, 2]}
    points[1] = Point(1, study.values(1), NOT_SOLVED, "no start led to a hop", tried=((0, 0), (2, 0)))
    assert doubtful(study, points, alike) == {}


# ---- files ----------------------------------------------------------------------------------------------------


def test_a_study_is_read_back_as_it_was(tmp_path: Path) -> None:
    for given, sample in (({RATIO: "60:100:3", SHANK: [0.34, 0.36]}, None), ({RATIO: "60:100"}, "lhs:5")):
        study = define(PAPER, given, sample=sample, seed=4)
        folder = open_folder(study, tmp_path)
        assert read_definition(folder) == study
        np.testing.assert_array_equal(read_definition(folder).points, study.points)
        assert open_folder(study, tmp_path) != folder  # nothing is overwritten


def test_another_study_is_not_resumed(tmp_path: Path) -> None:
    folder = open_folder(define(PAPER, {RATIO: [60, 80]}), tmp_path)
    check_same(folder, define(PAPER, {RATIO: [60, 80]}))
    for other in (
        define(PAPER, {RATIO: [60, 90]}),
        define(ho.load("paper", {"leg.body.mass": 5.0}), {RATIO: [60, 80]}),
        define(PAPER, {RATIO: [60, 80]}, objective="apex"),
    ):
        with pytest.raises(ResultError, match="another study"):
            check_same(folder, other)
    with pytest.raises(ResultError, match="no study to resume"):
        read_definition(tmp_path)


def test_points_are_read_back_and_strangers_refused(tmp_path: Path) -> None:
    study = define(PAPER, {RATIO: [60, 80, 100]})
    folder = open_folder(study, tmp_path)
    points = finished(study, np.array([0.9, 0.8, 0.7]))
    save_point(folder, points[1], {"x": np.arange(3.0)})
    again = replace(points[1], after_pass=1, tried=((0, 0),))
    save_point(folder, again, {})
    (folder / "points" / ".0002-0.json.99").write_text("{")  # killed while writing
    assert load_points(folder, study) == {0: {1: points[1]}, 1: {1: again}}
    np.testing.assert_array_equal(load_begin(folder, again)["x"], np.arange(3.0))  # it was not solved in that pass
    save_point(folder, Point(2, {RATIO: 55.0}, VERIFIED), {})
    with pytest.raises(ResultError, match="another study"):
        load_points(folder, study)


def test_table_and_dataset_say_the_same(tmp_path: Path) -> None:
    study = define(PAPER, {RATIO: [60, 80], SHANK: [0.34, 0.35, 0.36]})
    found = finished(study, np.linspace(0.5, 1.0, 6))
    found[4] = Point(4, study.values(4), NOT_SOLVED, 'a "sentence", with a comma')
    points = [found[k] for k in range(6)]
    data = dataset(study, points)
    assert dict(data.sizes) == {RATIO: 2, SHANK: 3}
    assert float(data["clearance_m"].sel({RATIO: 80, SHANK: 0.34})) == points[3].clearance_m
    assert np.isnan(data["clearance_m"].sel({RATIO: 80, SHANK: 0.35}))
    assert str(data["outcome"].values[1, 1]) == NOT_SOLVED
    lines = table(study, points).splitlines()
    assert len(lines) == 7
    assert lines[4].startswith("3,80.0,0.34,verified,0.8")
    assert lines[5].endswith('"a ""sentence"", with a comma"')


def test_motors_of_a_catalogue_of_ones_own_are_varied_by_their_names(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each point is the problem that names that motor, also of a study that goes on when the catalogue is gone or another."""
    monkeypatch.chdir(tmp_path)
    own = "[motor.mine]\nmax_torque = {}\nmax_speed = 400.0\nrotor_inertia = 2e-5\n"
    Path("my.toml").write_text(own.format(3.0))
    Path("leg.toml").write_text('extends = "paper"\ncatalogue = "my.toml"\n')
    vary = {"leg.motor": "mine,mini-cheetah", "leg.gear.ratio": [30, 60]}
    study = define(ho.load("leg.toml"), vary, entries=catalogue_of("leg.toml"))
    named = [ho.load("leg.toml", {"leg.motor": name, "leg.gear.ratio": 60.0}) for name in ("mine", "mini-cheetah")]
    assert [study.design_at(1), study.design_at(3)] == named
    folder = open_folder(study, tmp_path)
    Path("my.toml").write_text(own.format(4.0))
    again = read_definition(folder)
    assert [again.design_at(1), again.design_at(3)] == named
    other = define(ho.load("leg.toml"), vary, entries=catalogue_of("leg.toml"))
    with pytest.raises(ResultError, match="other own catalogue"):
        check_same(folder, other)
    with pytest.raises(UsageError, match=r'leg\.motor = "mine" is not in the catalogue'):
        ho.sweep(ho.load("leg.toml"), vary)  # a problem that is no file any more names built-in ones alone


def test_motors_and_gears_are_varied_by_their_names(tmp_path: Path) -> None:
    names = ["unitree-go2", "mini-cheetah"]
    study = define(PAPER, {"leg.motor": ",".join(names), "leg.gear": ["csf-25-50", "apex-af042-20"]})
    legs = [study.design_at(k).leg for k in range(4)]
    assert [leg.motor.catalogue for leg in legs] == [names[0]] * 2 + [names[1]] * 2
    assert [leg.gear.ratio for leg in legs] == [50, 20, 50, 20]
    assert study.words(study.values(3)) == "leg.motor = mini-cheetah, leg.gear = apex-af042-20"
    assert read_definition(open_folder(study, tmp_path)) == study
    points = list(finished(study, np.linspace(0.5, 0.8, 4)).values())
    found = dataset(study, points)["clearance_m"].sel({"leg.motor": "mini-cheetah", "leg.gear": "csf-25-50"})
    assert float(found) == points[2].clearance_m
    assert table(study, points).splitlines()[3].startswith("2,mini-cheetah,csf-25-50,verified,0.7")


@pytest.mark.parametrize("more", [["--objective", "energy"], ["--seed", "3"], ["--starts", "5"]])
def test_a_study_is_not_resumed_as_another(more: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = open_folder(define(PAPER, {RATIO: "80,90"}), tmp_path)
    assert f"leave {more[0]} out" in refusal(["sweep", "--resume", str(folder), *more], capsys)


def test_a_study_of_an_earlier_version_is_read_and_not_continued(tmp_path: Path) -> None:
    """Its list has no entry of what was asked for."""
    axis = Axis(RATIO, (), 80.0, 100.0)
    folder = open_folder(
        Definition(PAPER, "clearance", (axis,), listed=((80.0,), (100.0,)), preliminary=True), tmp_path
    )
    data = json.loads((folder / "sweep.json").read_text()) | {"hopopt": "0.0.1"}
    del data["wish"]
    (folder / "sweep.json").write_text(json.dumps(data))
    seal(folder, ("sweep.json",))
    found = read_definition(folder)
    assert (found.listed, found.wish) == (((80.0,), (100.0,)), 0.0)
    with pytest.raises(ResultError, match=r"it holds another study \(other hopopt\)"):
        check_same(folder, found)
    (folder / "sweep.json").write_text(json.dumps(data | {"seed": 7}))
    seal(folder, ("sweep.json",))
    with pytest.raises(ResultError, match="other seed"):
        read_definition(folder)


def verified(count: int, searched: Sequence[int], better: int | None = None) -> dict[int, Point]:
    """Verified points, some of them searched as a single solve is; at one of those that found a better hop in pass 1."""
    found = {k: Point(k, {}, VERIFIED, objective_value=0.7, begun_from=0, searched=k in searched) for k in range(count)}
    if better is not None:
        found[better] = replace(found[better], begun_from=None, found_by_search=True, solved_in=1)
    return found


def test_points_far_from_those_that_were_searched_are_checked_and_those_beside_one_that_was_wrong() -> None:
    study = define(PAPER, {RATIO: "60:160:9"})
    assert to_search(study, verified(9, [4]), 1) == [0, 8]
    assert to_search(study, verified(9, [0, 4, 8]), 2) == []
    assert to_search(study, verified(9, [0, 4, 8], better=8), 2) == [2, 6, 7]  # the nearest two, and another spot
    assert to_search(study, verified(9, [0, 2, 4, 6, 7, 8], better=8), 3) == []
    assert to_search(study, verified(9, [0, 4, 8], better=8), 2, last=True) == [1, 2, 3, 5, 6, 7]
    assert to_search(study, verified(9, range(9)), 1) == []  # as with a number of starts of its own


def test_a_point_hands_on_other_kinds_of_optima() -> None:
    best, other = ({"x": np.full(3, value), "shape": np.full(2, value)} for value in (1.0, 2.0))
    for given in ([], [other], [other, best]):
        found = kinds(with_others(best, given))
        assert [list(begin) for begin in found] == [["x", "shape"]] * (1 + len(given))
        assert [begin["x"][0] for begin in found] == [1.0, *(begin["x"][0] for begin in given)]
