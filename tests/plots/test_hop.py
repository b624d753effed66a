"""Figures: what they show is the plan, and nothing on them lies on top of anything else."""

import re
from collections.abc import Callable
from dataclasses import replace
from itertools import combinations, pairwise
from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from matplotlib.transforms import Bbox

import hopopt as ho
from hopopt.errors import ResultError
from hopopt.ocp.phases import FLIGHT, STANCE
from hopopt.planner.solution import Solution
from hopopt.plots.hop import FIGURES, save_all
from hopopt.plots.style import NORMALISED_TIMES, jumping_curve, legend, new_figure
from hopopt.problem.load import changed
from once import solved_once

COARSE = {"solver.refine": False, "solver.stance_intervals": 16, "solver.flight_intervals": 8}
THREE = {
    "leg.joints": ["hip", "knee", "ankle"], "leg.links": ["thigh", "shank", "toe"],
    "leg.ankle": {"lower": -1.0, "upper": 1.2}, "leg.toe": {"length": 0.12, "mass": 0.2},
    "start.joint_angles": [0.9, -1.9, 1.0],
}  # fmt: skip
CAPS = {"leg.motor.laws": [], "leg.gear.torque_cap": 107.0, "leg.gear.speed_cap": 680.0}
CASES = {
    "paper": ({}, "clearance"),
    "apex": ({}, "apex"),
    "three joints": (THREE, "clearance"),
    "friction": ({"contact.friction": 0.6, "name": "a_very_long_name_" + 46 * "x"}, "clearance"),
    "caps": ({**CAPS, "hop.counter_movement": False, "hop.foot_window": 1.0}, "clearance"),
    "four quadrants": ({"leg.motor.laws": ["four-quadrant"]}, "clearance"),
}


@pytest.fixture(scope="module")
def solved() -> Callable[[str], Solution]:
    """The coarse solution of a case, solved once."""
    kept: dict[str, Solution] = {}

    def get(case: str) -> Solution:
        if case not in kept:
            overrides, objective = CASES[case]
            kept[case] = solved_once({**COARSE, **overrides}, objective)
        return kept[case]

    return get


def boxes(ax: Axes, axis: str) -> list[Bbox]:
    """Boxes [pixels] of the visible tick labels of an axis."""
    low, high = ax.get_xlim() if axis == "x" else ax.get_ylim()
    ticks = (ax.xaxis if axis == "x" else ax.yaxis).get_major_ticks()
    return [
        tick.label1.get_window_extent()
        for tick in ticks
        if low <= tick.get_loc() <= high and tick.label1.get_visible() and tick.label1.get_text()
    ]


QUICK = ("three joints", "friction")


@pytest.mark.parametrize("case", [pytest.param(c, marks=() if c in QUICK else pytest.mark.slow) for c in CASES])
@pytest.mark.parametrize("name", FIGURES)
def test_every_figure_can_be_read(solved: Callable[[str], Solution], case: str, name: str) -> None:
    """Axes have units, labels do not touch, one legend names everything and covers nothing."""
    figure = FIGURES[name](solved(case))
    figure.draw_without_rendering()
    assert isinstance(figure, Figure)
    page = figure.bbox
    for ax in figure.axes:
        assert re.search(r"\S \[.+\]$", ax.get_ylabel())
        assert re.search(r"\S \[.+\]$", ax.get_xlabel()) or not ax.xaxis.get_tick_params()["labelbottom"]
        for axis in "xy":
            assert not any(a.overlaps(b) for a, b in pairwise(boxes(ax, axis)))
        for text in ax.texts:
            box = text.get_window_extent()
            assert page.x0 <= box.x0
            assert box.x1 <= page.x1
    (shown,) = figure.legends
    labels = [text.get_text() for text in shown.get_texts()]
    assert len(labels) == len(set(labels))
    assert set(labels) == {label for ax in figure.axes for label in ax.get_legend_handles_labels()[1]}
    box = Bbox.union([text.get_window_extent() for text in shown.get_texts()])  # its frame is not drawn
    assert page.x0 <= box.x0
    assert box.x1 <= page.x1
    parts = [tight for ax in figure.axes if (tight := ax.get_tightbbox())]
    assert not any(box.overlaps(part) for part in parts)
    assert not any(a.overlaps(b) for a, b in combinations(parts, 2))


def title(figure: Figure) -> str:
    return figure.get_suptitle().replace("\n", " ")


@pytest.mark.parametrize("name", FIGURES)
def test_title_says_whether_the_plan_is_verified(solved: Callable[[str], Solution], name: str) -> None:
    plan = solved("paper")
    assert title(FIGURES[name](plan)).startswith("The paper's leg: ")
    assert "NOT verified" in title(FIGURES[name](plan))
    true = replace(plan, summary=replace(plan.summary, verified=True))
    assert "verified" not in title(FIGURES[name](true))


def texts(figure: Figure) -> str:
    return "\n".join(text.get_text() for ax in figure.axes for text in ax.texts)


@pytest.mark.parametrize("name", ["heights", "stick"])
@pytest.mark.parametrize("case", ["paper", "apex"])
def test_height_is_the_objectives(solved: Callable[[str], Solution], name: str, case: str) -> None:
    plan = solved(case)
    height, other = (plan.sample(plan.duration).q[0, 1], "clearance") if case == "apex" else (plan.clearance, "apex")
    shown = texts(FIGURES[name](plan))
    assert f"{height:.3f} m" in shown
    assert other not in shown


def lines(figure: Figure, label: str) -> list[np.ndarray]:
    """(x, y) of the curves with a label, without gaps, (k, 2) each."""
    found = [np.array(line.get_xydata()) for ax in figure.axes for line in ax.lines if line.get_label() == label]
    return [xy[~np.isnan(xy).any(axis=1)] for xy in found]


def test_curves_are_the_plan(solved: Callable[[str], Solution]) -> None:
    plan = solved("paper")
    (foot,) = lines(FIGURES["heights"](plan), "foot")
    np.testing.assert_allclose(foot[:, 1], plan.sample(foot[:, 0]).points["foot"][:, 1], atol=1e-9)
    (force,) = lines(FIGURES["ground_force"](plan), "vertical")
    inside = plan.everywhere(STANCE, NORMALISED_TIMES)
    np.testing.assert_array_equal(force, np.column_stack([inside.t, inside.f[:, 1]]))
    for k, curve in enumerate(lines(FIGURES["operating_region"](plan), FLIGHT)):
        samples = plan.everywhere(FLIGHT, NORMALISED_TIMES)
        np.testing.assert_array_equal(curve, np.column_stack([samples.v[:, 2 + k], samples.tau[:, k]]))


def labels(figure: Figure) -> str:
    return " ".join(text.get_text() for text in figure.legends[0].get_texts())


@pytest.mark.slow
def test_a_trunk_is_drawn_whole_and_named() -> None:
    """Wider and higher than the leg: every corner lies within the axes, poses beside each other do not overlap, and the legend
    and the heights know it."""
    shapes = {"trunk": {"box": [0.9, 0.2, 0.7], "at": [0.1, 0.0, 0.3]}}
    shaped = replace(solved_once(), design=changed(solved_once().design, {"leg.body.shapes": shapes}))
    figure = FIGURES["stick"](shaped)
    for ax in figure.axes:
        low, high = np.transpose([ax.get_xlim(), ax.get_ylim()])
        drawn = [p.get_xy() for p in ax.patches if isinstance(p, Polygon)]
        for corners in drawn:
            assert np.all(corners >= low)
            assert np.all(corners <= high)
        for one, other in pairwise(sorted(drawn, key=lambda corners: corners[:, 0].min())):
            assert one[:, 0].max() < other[:, 0].min()
    assert "shapes of body and links" in [text.get_text() for text in figure.legends[0].get_texts()]
    assert "lowest of the trunk" in FIGURES["heights"](shaped).axes[0].get_legend_handles_labels()[1]


def test_only_limits_that_hold_are_drawn(solved: Callable[[str], Solution]) -> None:
    """The friction cone where there is friction, the foot window where the objective has one."""
    for case in ("paper", "friction", "apex"):
        assert ("friction" in labels(FIGURES["ground_force"](solved(case)))) == (case == "friction")
        assert ("foot window" in labels(FIGURES["stick"](solved(case)))) == (case != "apex")


def test_a_jump_is_thin_and_a_steep_slope_is_not() -> None:
    t = np.array([0.0, 0.5, 0.5 + 1e-6, 0.8, 0.9, 1.0])
    y = np.array([0.0, 0.1, 1.0, 1.0, 0.0, 0.0])
    ax = new_figure("jump").subplots()
    jumping_curve(ax, t, t, y, color="k", lw=2, label="curve")
    thin, thick = ax.lines
    assert thin.get_linewidth() < 1 < thick.get_linewidth()
    drawn = np.array(thick.get_ydata(), float)
    assert np.flatnonzero(np.isnan(drawn)).tolist() == [2]
    np.testing.assert_array_equal(drawn[~np.isnan(drawn)], y)
    np.testing.assert_array_equal(thin.get_ydata(), y)


def test_legend_reads_line_by_line() -> None:
    figure = new_figure("legend")
    ax = figure.subplots()
    names = [f"a rather long label, number {k}" for k in range(7)]
    for name in names:
        ax.plot([0, 1], label=name)
    legend(figure)
    figure.draw_without_rendering()
    places = {t.get_text(): t.get_window_extent() for t in figure.legends[0].get_texts()}
    assert sorted(names, key=lambda n: (-round(places[n].y0), places[n].x0)) == names


def test_all_figures_are_saved(solved: Callable[[str], Solution], tmp_path: Path) -> None:
    paths = save_all(solved("paper"), tmp_path / "new")
    assert {p.name for p in paths} == {f"{name}.{suffix}" for name in FIGURES for suffix in ("png", "svg")}
    assert all(p.parent == tmp_path / "new" for p in paths)
    for path in paths:
        start = path.read_bytes()[:200]
        assert start.startswith(b"\x89PNG") if path.suffix == ".png" else b"<?xml" in start


def test_a_figure_that_fails_does_not_stop_the_others(
    solved: Callable[[str], Solution], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(_: Solution) -> Figure:
        raise ZeroDivisionError("no width")

    monkeypatch.setitem(FIGURES, "heights", broken)
    with pytest.raises(ResultError, match=r"^heights: ZeroDivisionError: no width$"):
        save_all(solved("paper"), tmp_path, ("png",))
    assert {p.stem for p in tmp_path.iterdir()} == FIGURES.keys() - {"heights"}


def test_a_notebook_shows_a_figure(solved: Callable[[str], Solution]) -> None:
    figure = ho.Solution.with_methods(solved("paper")).plot("heights")
    assert figure._repr_png_().startswith(b"\x89PNG")  # type: ignore[union-attr]
