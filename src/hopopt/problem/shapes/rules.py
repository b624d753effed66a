"""Shapes of a leg that no solid has."""

import re
from collections.abc import Iterator

from hopopt.design import Leg
from hopopt.design.geometry.shape import Shape
from hopopt.problem.checking.faults import Report

NAME = re.compile(r"[A-Za-z0-9_-]{1,64}")


def shape_rules(leg: Leg, report: Report) -> None:
    """Report shapes that are stated twice, or not at all."""
    for path, name, shape in _shapes(leg):
        if not NAME.fullmatch(name):
            report.add(path, "is no name of a shape: 1 to 64 letters, digits, _ or - are needed")
        elif words := shape.fault():
            report.add(path, words)


def _shapes(leg: Leg) -> Iterator[tuple[str, str, Shape]]:
    """Every shape of a leg: its path in the problem file, its name, and itself."""
    for owner, table in (("body", leg.body), *leg.link.items()):
        for name, shape in (table.shapes or {}).items():
            yield f"leg.{owner}.shapes.{name}", name, shape
