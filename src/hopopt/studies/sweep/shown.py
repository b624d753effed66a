"""What figures and pages of a study have in common: the value of a point, the colour of a limit, the label of an entry."""

from collections import Counter

import numpy as np

from hopopt.design import Design
from hopopt.problem.render import unit_at
from hopopt.studies.sweep.definition import Axis
from hopopt.studies.sweep.point_file import Point
from hopopt.studies.sweep.run import Study

LIMIT_COLORS = ("#56B4E9", "#E69F00", "#009E73", "#CC79A7", "#F0E442", "#0072B2", "#D55E00", "#999999")  # in turn


def value(study: Study, point: Point) -> float:
    """Clearance [m], or another objective's value; not-a-number where it is neither verified nor preliminary."""
    height = study.definition.objective == "clearance" and point.verified
    found = point.clearance_m if height else point.objective_value
    return float(found) if point.has_value and found is not None else float("nan")


def colors(study: Study) -> dict[str, str]:
    """By limit that holds a hop back, or family of a preliminary one, its colour; the most frequent one first."""
    counted = Counter(p.kind for p in study.points if p.has_value)
    return {kind: LIMIT_COLORS[k % len(LIMIT_COLORS)] for k, (kind, _) in enumerate(counted.most_common())}


def kind_label(point: Point) -> str:
    """What its colour stands for, in a legend."""
    return f"limit: {point.kind}" if point.verified else point.kind


def entry_unit(design: Design, entry: str) -> str:
    """The unit of an entry of a problem; empty for a number without one."""
    unit = unit_at(design, entry)
    return "" if unit == "1" else unit


def axis_label(design: Design, axis: Axis) -> str:
    """An entry with its unit, or with the names that its values number."""
    names = ", ".join(f"{x:g} {name}" for x, name in zip(axis.values, axis.names, strict=False))
    return f"{axis.entry}: {names}" if names else entry_label(design, axis.entry)


def entry_label(design: Design, entry: str) -> str:
    """An entry of a problem with its unit."""
    unit = entry_unit(design, entry)
    return f"{entry} [{unit}]" if unit else entry


def cell_edges(values: np.ndarray) -> np.ndarray:
    """Edges (n + 1,) of the cells around values (n,), sorted."""
    v = np.unique(values)
    if len(v) == 1:
        return np.array([v[0] - 0.5, v[0] + 0.5])
    middle = 0.5 * (v[1:] + v[:-1])
    return np.concatenate([[2 * v[0] - middle[0]], middle, [2 * v[-1] - middle[-1]]])
