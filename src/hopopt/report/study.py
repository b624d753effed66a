"""The page of a design study: its best point in words, a curve or map by limit, and every point with its verdict."""

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hopopt.ocp.objectives.registry import find
from hopopt.problem.render import place
from hopopt.report.chart import Chart, round_numbers, span
from hopopt.report.html import render
from hopopt.storage.seal.digests import changed, manifest_of
from hopopt.studies.sweep.point_file import ENDED, IMPOSSIBLE, NO_LIMIT, NOT_SOLVED, NOT_VERIFIED, Point
from hopopt.studies.sweep.run import Study, study_in
from hopopt.studies.sweep.shown import axis_label, cell_edges, colors, entry_unit, value
from hopopt.studies.sweep.store import FILES

MARKS = {NOT_VERIFIED: "×", NOT_SOLVED: "✕", IMPOSSIBLE: "+", ENDED: "!"}  # of points without a verified hop
LISTED, DRAWN, TITLED = 500, 5000, 1000  # points in the table, marks in figures, marks with words: pages stay small
MOST_WRITTEN_CELLS = 60  # cells of a map that have room for their values
WIDTH, HEIGHT = 640, 400  # pixels of a figure with one chart
NARROW = 420  # pixels of one of several charts
STRIP = 0.2  # of the range of heights, below them: where marks of points without one stand


@dataclass(frozen=True)
class Mark:
    """A point in a chart.

    point: the point
    x, y: its place [pixels]
    color: by its limit; empty without a verified hop
    text: what it is, in words; empty where there are very many
    value: its height or objective, rounded; empty where there is no room
    cell: x, y, width and height of its cell of a map [pixels]; empty for a dot
    """

    point: Point
    x: float
    y: float
    color: str
    text: str
    value: str = ""
    cell: tuple[float, ...] = ()


def study_page(folder: Path) -> str:
    """The HTML file of a study's folder; ResultError if it cannot be read."""
    study = study_in(folder)
    goal, ranked, by_limit = find(study.definition.objective), _best_first(study), colors(study)
    entries = [axis.entry for axis in study.definition.axes]
    other, listed = goal.figure != "clearance_m", ranked[:LISTED]
    return render(
        "study.html", study.definition.design, of="study", kind=_kind(study), answer=answer(study),
        provenance=_provenance(study), varied=_varied(study), charts=_charts(study, by_limit), colors=by_limit,
        outcomes=Counter(p.outcome for p in study.points if not p.verified), marks=MARKS, best=study.best,
        points=listed, reasons=[p for p in listed if not p.verified], left_out=len(ranked) - len(listed),
        goal=goal if other else None, not_drawn=len(ranked) - len(_drawn(study)),
        by_name=study.definition.stated, entries=entries,
        units={e: entry_unit(study.definition.design, e) for e in entries}, no_limit=NO_LIMIT,
    )  # fmt: skip


def answer(study: Study) -> list[str]:
    """The best point, what holds it back, and how many points have a verified hop, in plain words."""
    best, total = study.best, len(study.definition.points)
    verified = sum(p.verified for p in study.points)
    counted = f"{verified} of {total} points have a verified hop."
    if len(study.points) < total:
        counted += f" Not finished: {total - len(study.points)} (hopopt sweep --resume goes on)."
    if best is None:
        return ["No best point is stated: no point has a verified hop.", counted]
    goal = find(study.definition.objective)
    design = study.definition.design
    shown = ((e, x if isinstance(x, str) else f"{x:g}") for e, x in study.definition.stated(best.values).items())
    where = ", ".join(f"{entry} = {x} {entry_unit(design, entry)}".rstrip() for entry, x in shown)
    words = [f"Best is {where}: the leg lifts its lowest point {best.clearance_m:.4f} m above the ground."]
    if goal.figure != "clearance_m":
        most, unit = "most" if goal.maximize else "least", "" if goal.unit == "1" else f" {goal.unit}"
        words = [f"Best is {where}, with the {most} {goal.name.replace('_', ' ')}: {best.objective_value:.5g}{unit}."]
        words[0] += f" It lifts the leg's lowest point {best.clearance_m:.4f} m above the ground."
    if best.limit:
        words.append(f"What holds it back most: {best.limit}.")
    if study.at_the_edge:
        words.append(f"It has {study.at_the_edge}.")
    return [*words, counted]


def _kind(study: Study) -> str:
    d = study.definition
    how = f"sample {d.sample}" if d.sample else f"grid of {' × '.join(map(str, d.shape or ()))}"
    return f"Study of the problem {d.design.name}, objective {d.objective}, {how}"


def _best_first(study: Study) -> list[Point]:
    """Verified points from the best to the last, then those without a hop in the study's order."""
    goal = find(study.definition.objective)
    return sorted(
        study.points, key=lambda p: (not p.verified, -goal.signed_value(p.objective_value or 0.0) * p.verified)
    )


def _varied(study: Study) -> dict[str, str]:
    """By varied entry, what was tried; of a list by the place in it."""
    found = dict[str, str]()
    for a in study.definition.axes:
        path, index = place(a.entry)
        values = ", ".join(a.names or (f"{x:g}" for x in a.values)) or f"{a.lower:g} to {a.upper:g}"
        before = f"{found[path]}; " if path in found else ""
        found[path] = f"{before}varied{'' if index is None else f' [{index}]'}: {values}"
    return found


def _provenance(study: Study) -> Mapping[str, str]:
    data = json.loads((study.folder / "sweep.json").read_text(encoding="utf-8"))
    found = {"folder": str(study.folder), "version of hopopt": str(data.get("hopopt")), "seed": str(data["seed"])}
    found |= {"problem hash": data["problem_hash"], "starts": str(data["starts"] or "those of the problem")}
    found |= {"points finished": f"{len(study.points)} of {len(study.definition.points)}"}
    found |= {"time of all points": f"{study.seconds:.1f} s"}
    manifest = manifest_of(study.folder)
    if manifest:
        found |= {f"changed file {k + 1}": words for k, words in enumerate(changed(study.folder, FILES))}
    return found | {f"SHA-256 of {name}": str(x) for name, x in manifest.get("sha256", {}).items()}


# ---- what is drawn ----------------------------------------------------------------------------------------------


def _charts(study: Study, by_limit: Mapping[str, str]) -> list[dict[str, Any]]:
    """A curve over one entry, a map over two, a chart for each of more."""
    axes = study.definition.axes
    if len(axes) == 2:
        return [_map(study, by_limit)]
    return [_over(study, k, WIDTH if len(axes) == 1 else NARROW, by_limit) for k in range(len(axes))]


def _drawn(study: Study) -> list[Point]:
    """The points that a chart has marks of, in the study's order: the best of a very large study."""
    charts = 1 if len(study.definition.axes) == 2 else len(study.definition.axes)
    return sorted(_best_first(study)[: DRAWN // charts], key=lambda p: p.index)


def _goal(study: Study) -> str:
    goal = find(study.definition.objective)
    return f"{goal.name.replace('_', ' ')} [{goal.unit}]"


def _words(study: Study, point: Point) -> str:
    """A point in words, for who points at it."""
    where = study.definition.words(point.values)
    if not point.verified:
        return f"{where}: {point.outcome}"
    return f"{where}: {value(study, point):.5g} {find(study.definition.objective).unit}, {point.limit or NO_LIMIT}"


def _over(study: Study, k: int, width: int, by_limit: Mapping[str, str]) -> dict[str, Any]:
    """The heights over the k-th entry, with a line through those that follow each other if there is no other entry."""
    points, entry = _drawn(study), study.definition.axes[k].entry
    x, y = np.array([p.values[entry] for p in points]), np.array([value(study, p) for p in points])
    known = y[np.isfinite(y)] if np.isfinite(y).any() else np.zeros(1)
    low, high = span(known, margin=0.1) if np.ptp(known) else (float(known[0]) - 0.05, float(known[0]) + 0.05)
    strip = STRIP * (high - low) if any(not p.verified for p in points) else 0.0
    values, ticks = study.definition.axes[k].values, tuple(round_numbers(low, high))  # of heights; the strip has none
    chart = Chart(
        _wide(x),
        (low - strip, high),
        width,
        HEIGHT,
        axis_label(study.definition.design, study.definition.axes[k]),
        _goal(study),
        values,
        ticks,
    )
    marks = [
        _mark(study, by_limit, p, chart, a, b if np.isfinite(b) else low - 0.35 * strip)
        for p, a, b in zip(points, x, y, strict=True)
    ]
    lines = [chart.line(a, b) for a, b in _runs(x, y)] if len(study.definition.axes) == 1 else []
    floor = chart.y_zero + chart.y_scale * low if strip else None
    return {"chart": chart, "marks": marks, "lines": lines, "entry": entry, "floor": floor}


def _mark(
    study: Study, by_limit: Mapping[str, str], point: Point, chart: Chart, x: float, y: float, text: str = "",
    cell: tuple[float, ...] = (),
) -> Mark:  # fmt: skip
    color = by_limit[point.kind] if point.verified else ""
    place = chart.x_zero + chart.x_scale * x, chart.y_zero + chart.y_scale * y
    words = _words(study, point) if len(study.points) * len(study.definition.axes) <= TITLED else ""
    return Mark(point, *place, color, words, text, cell)


def _wide(x: np.ndarray) -> tuple[float, float]:
    """The range of an axis; some, where all is at one value."""
    return span(x) if np.ptp(x) else (float(x[0]) - 0.5, float(x[0]) + 0.5)


def _runs(x: np.ndarray, y: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Heights in order of x, parted where a point has none."""
    order = np.argsort(x)
    x, y = x[order], y[order]
    gaps = np.flatnonzero(~np.isfinite(y))
    parts = zip(np.split(x, gaps), np.split(y, gaps), strict=True)
    return [(a[np.isfinite(b)], b[np.isfinite(b)]) for a, b in parts if np.isfinite(b).sum() > 1]


def _map(study: Study, by_limit: Mapping[str, str]) -> dict[str, Any]:
    """Cells of a grid, or dots of a sample, over two entries."""
    first, second = study.definition.axes
    points = _drawn(study)
    x, y = (np.array([p.values[axis.entry] for p in points]) for axis in (first, second))
    edges = [cell_edges(np.array(axis.values)) for axis in (first, second)] if study.definition.shape else []
    ranges = [(float(e[0]), float(e[-1])) for e in edges] or [_wide(x), _wide(y)]
    along, up = (axis_label(study.definition.design, axis) for axis in (first, second))
    chart = Chart(ranges[0], ranges[1], WIDTH, HEIGHT, along, up, first.values, second.values)
    written = len(points) <= MOST_WRITTEN_CELLS
    marks = []
    for p, a, b in zip(points, x, y, strict=True):
        text = f"{value(study, p):#.4g}" if p.verified and written else ""
        marks.append(_mark(study, by_limit, p, chart, a, b, text, _cell(chart, edges, a, b) if edges else ()))
    entry = f"{first.entry} and {second.entry}"
    return {"chart": chart, "marks": marks, "lines": [], "entry": entry, "floor": None}


def _cell(chart: Chart, edges: Sequence[np.ndarray], x: float, y: float) -> tuple[float, ...]:
    """The cell around a point: left, top, width, height [pixels]."""
    (a, b), (c, d) = (e[(k := int(np.searchsorted(e, at)) - 1) : k + 2] for e, at in zip(edges, (x, y), strict=True))
    left, top = chart.x_zero + chart.x_scale * a, chart.y_zero + chart.y_scale * d
    return float(left), float(top), float(chart.x_scale * (b - a)), float(-chart.y_scale * (d - c))
