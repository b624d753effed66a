"""Figures of a study: the limit that holds a hop back is its colour, and a map's values can be read."""

from pathlib import Path

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from hopopt.plots.studies.sweep import figures
from hopopt.problem.load import load
from hopopt.studies.sweep.definition import define
from hopopt.studies.sweep.point_file import NOT_SOLVED, VERIFIED, Point
from hopopt.studies.sweep.run import Study

RATIOS, SHANKS = [90.0, 100.0, 110.0], [0.35, 0.36]
KNEE, STANCE = "knee operating region", "longest stance"


def drawn(axes: dict[str, list[float]], lost: int | None = None) -> tuple[Study, Figure]:
    """A study whose clearance grows along the grid, its first half held back by the knee, and its figure."""
    definition = define(load("paper"), axes)
    count = len(definition.points)
    points = [
        Point(
            k, definition.values(k), VERIFIED, objective_value=z, clearance_m=z, limit=KNEE if 2 * k < count else STANCE
        )
        for k, z in enumerate(0.7 + 0.01 * k for k in range(count))
    ]
    if lost is not None:
        points[lost] = Point(lost, definition.values(lost), NOT_SOLVED, "no start led to a hop")
    study = Study(definition, tuple(points), Path("nowhere"), 1.0)
    return study, figures(study)["study"]


@pytest.mark.parametrize("axes", [{"leg.gear.ratio": RATIOS}, {"leg.gear.ratio": RATIOS, "leg.shank.length": SHANKS}])
def test_points_have_the_colour_of_their_limit(axes: dict[str, list[float]]) -> None:
    study, figure = drawn(axes)
    assert figure.get_suptitle().startswith("The paper's leg: ")
    (legend,) = figure.legends
    named = [text.get_text() for text in legend.get_texts()]
    assert {f"limit: {KNEE}", f"limit: {STANCE}"} < set(named)
    ax = figure.axes[0]
    shown = {}
    for p in study.points:
        assert p.clearance_m is not None
        x, y = p.values["leg.gear.ratio"], p.values.get("leg.shank.length", p.clearance_m)
        dots = [
            to_rgb(line.get_color())
            for line in ax.lines
            if line.get_marker() == "o"
            and [x, y] in np.column_stack(line.get_data()).tolist()
            and line.get_markerfacecolor() != "none"
        ]
        cells = [
            to_rgb(patch.get_facecolor())
            for patch in ax.patches
            if patch.get_fill() and patch.get_path().contains_point((x, y))
        ]
        (color,) = dots + cells
        shown.setdefault(p.limit, set()).add(color)
    assert all(len(colors) == 1 for colors in shown.values())
    assert shown[KNEE] != shown[STANCE]


def test_a_maps_values_are_written_in_its_cells_and_nothing_covers_the_best() -> None:
    study, figure = drawn({"leg.gear.ratio": RATIOS, "leg.shank.length": SHANKS}, lost=0)
    ax = figure.axes[0]
    figure.draw_without_rendering()
    written = {text.get_text(): text for text in ax.texts}
    assert set(written) == {f"{p.clearance_m:.4f}" for p in study.points if p.verified}
    assert study.best is not None
    best = written[f"{study.best.clearance_m:.4f}"]
    at = study.best.values["leg.gear.ratio"], study.best.values["leg.shank.length"]
    assert best.get_position() == pytest.approx(at)
    frame = [patch for patch in ax.patches if not patch.get_fill()]
    assert [patch.get_path().contains_point(at) for patch in frame] == [True]
    assert not ax.lines  # no mark lies on a value
    boxes = [text.get_window_extent() for text in ax.texts]
    assert not any(a.overlaps(b) for k, a in enumerate(boxes) for b in boxes[:k])
