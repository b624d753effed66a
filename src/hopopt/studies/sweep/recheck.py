"""A stored study verified again: every solved point refined from its optimum on the first mesh, and judged anew."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from hopopt.errors import HopoptError, one_line
from hopopt.storage.seal.digests import MANIFEST, changed
from hopopt.storage.stated_figures import difference
from hopopt.studies.sweep.definition import Definition
from hopopt.studies.sweep.point import again
from hopopt.studies.sweep.point_file import Point, point_files, read_point
from hopopt.studies.sweep.store import FILES, load_begin, read_definition

AGAIN, NO_ERROR = 0.1, 1e-8  # relative, of the error; what a smaller one is relative to [the objective's unit]
VALUES = ("clearance_m", "objective_value")  # of a point, that are compared
SAME_REFINED = 1e-5  # relative: what refining again may differ by


@dataclass(frozen=True)
class Rechecked:
    """A point verified again.

    path: its file
    stated: as the file has it
    found: as it was computed again
    doubt: why the file is not to be trusted; empty if it is
    fault: what is wrong with what is stated; empty if it is confirmed
    """

    path: Path
    stated: Point
    found: Point
    doubt: str
    fault: str

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        reported = {"index": self.stated.index, "verified": not self.fault, "fault": self.fault, "doubt": self.doubt}
        points = {"stated": self.stated, "found": self.found}
        return reported | {key: {name: getattr(p, name) for name in VALUES} for key, p in points.items()}


def recheck_study(folder: Path, say: Callable[[str], None] = lambda text: None) -> tuple[list[Rechecked], list[str]]:
    """Every verified point of a finished or interrupted study computed again, and a sentence for each other file that was
    changed. Nothing is written: hopopt sweep --resume computes points whose files are gone, and writes the tables."""
    definition, latest, found = read_definition(folder), dict[int, Point](), list[Rechecked]()
    read = [(path, *read_point(path, definition)) for path in point_files(folder)]
    for _, point, _ in sorted(read, key=lambda each: each[1].after_pass):
        latest[point.index] = point
    for path, point, doubt in read:
        if doubt or (point.verified and point == latest[point.index]):
            say(f"point {point.index + 1} of {len(definition.points)}")
            found.append(_rechecked(folder, definition, path, point, doubt))
    sealed = (folder / MANIFEST).exists() or (
        folder / "study.json"
    ).exists()  # unfinished ones of earlier versions are not
    return found, changed(folder, FILES) if sealed else []


def _rechecked(folder: Path, definition: Definition, path: Path, point: Point, doubt: str) -> Rechecked:
    if not point.verified:
        return Rechecked(path, point, point, doubt, "it states no verified hop: remove it and resume")
    try:
        found = again(definition, point, load_begin(folder, point))
    except (HopoptError, ArithmeticError, RuntimeError, ValueError) as error:
        kind = "" if isinstance(error, HopoptError) else f"{type(error).__name__}: "
        fault = f"it cannot be computed again: {kind}{one_line(error)}"
        return Rechecked(path, point, replace(point, clearance_m=None), doubt, fault)
    return Rechecked(path, point, found, doubt, _fault(point, found))


def _fault(stated: Point, found: Point) -> str:
    """How what is stated differs from what was found."""
    if not found.verified:
        return f"it is not verified ({found.sentence})"
    if stated.certified != found.certified:
        return f"it states certified = {stated.certified}, and {found.certified} was computed"
    if stated.error is None or found.error is None or difference(stated.error, found.error, NO_ERROR) > AGAIN:
        return f"it states error {stated.error}, and {found.error} was computed"
    pairs = {name: (getattr(stated, name), getattr(found, name)) for name in VALUES}
    pairs |= {name: ((stated.parts or {}).get(name), value) for name, value in (found.parts or {}).items()}
    for name, (reported, value) in pairs.items():
        if reported is None or not abs(reported - value) <= SAME_REFINED * max(abs(value), 1e-3):
            return f"it states {name} {reported}, and {value:.6g} was computed"
    return ""
