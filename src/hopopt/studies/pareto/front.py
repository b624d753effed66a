"""What is known of a Pareto front: its points, their solutions, and its folder."""

import csv
import io
import json
from bisect import bisect
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from hopopt.design import Design
from hopopt.errors import ResultError
from hopopt.extensions import known, missing
from hopopt.files import write_whole
from hopopt.ocp.custom import CUSTOM_FIGURE
from hopopt.ocp.objectives.objective import HopObjective
from hopopt.ocp.objectives.registry import find
from hopopt.planner.solution import Solution
from hopopt.problem.load import load
from hopopt.storage.folder import reason_of, write_json, writing
from hopopt.storage.solution import read
from hopopt.studies.faults import Fault


@dataclass(frozen=True)
class FrontPoint:
    """One hop of the front.

    kind: which one, in words
    asked_m: the clearance that was asked for [m]
    clearance_m: that was reached [m]; None where it is not verified
    value: the other figure [its unit]; None where it is not verified
    verified: whether it is
    sentence: why it is not
    result_dir: where its hop lies
    seconds: how long it took [s]
    least: whether the other figure was minimised, not what the highest hop happens to have
    """

    kind: str
    asked_m: float
    clearance_m: float | None
    value: float | None
    verified: bool
    sentence: str = ""
    result_dir: str | None = None
    seconds: float = 0.0
    least: bool = True


@dataclass
class Front:
    """What is known of a front so far; ``folder`` holds it, point by point.

    design: the problem
    against: the other objective
    folder: where it lies; None if it is not kept
    points: in the order of the clearances that were asked for
    solutions: of each point its hop; None where there is none
    complete: whether every point is finished
    """

    design: Design
    against: HopObjective
    folder: Path | None = None
    points: list[FrontPoint] = field(default_factory=list)
    solutions: list[Solution | None] = field(default_factory=list)
    complete: bool = False

    def __repr__(self) -> str:
        done = "" if self.complete else ", not complete"
        verified = f"{len(self.verified_points)} of {len(self.points)} verified{done}"
        return f"<Front of {self.design.name}, clearance against {self.against.name}: {verified}>"

    @property
    def verified_points(self) -> list[FrontPoint]:
        """Those that are verified, by clearance."""
        return sorted((p for p in self.points if p.verified), key=lambda p: p.clearance_m or 0.0)

    @property
    def verified(self) -> bool:
        """Whether every point is, and there is one."""
        return bool(self.points) and all(p.verified for p in self.points)

    @property
    def exit_code(self) -> int:
        """0 every point verified, 1 none, 3 some not."""
        return 0 if self.verified else 3 if self.verified_points else 1

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "problem": self.design.name, "against": self.against.name, "unit": self.against.unit,
            "meaning": self.against.meaning, "complete": self.complete, "exit_code": self.exit_code,
            "points": [asdict(p) for p in sorted(self.points, key=lambda p: p.asked_m)],
            "result_dir": str(self.folder) if self.folder else None,
        }  # fmt: skip

    def add(self, point: FrontPoint, solution: Solution | None) -> None:
        """Keep a finished point in the order of clearances, in the folder too."""
        place = bisect([p.asked_m for p in self.points], point.asked_m)
        self.points.insert(place, point)
        self.solutions.insert(place, solution)
        self.write()

    def note(self, fault: Fault, k: int) -> str:
        """Keep the traceback of a fault that ended point k; what is said of it."""
        if self.folder is not None:
            with writing(f"{self.folder}: a traceback", "the points of before are kept there"):
                fault.keep(self.folder / "points", f"{k:04d}")
        return fault.sentence

    def write(self) -> None:
        """front.json and table.csv as they are now."""
        if self.folder is None:
            return
        buffer = io.StringIO()
        table, ranked = csv.writer(buffer), sorted(self.points, key=lambda p: p.asked_m)
        table.writerow(["clearance_m", self.against.figure, "least", "verified", "point", "sentence", "result_dir"])
        table.writerows([p.clearance_m, p.value, p.least, p.verified, p.kind, p.sentence, p.result_dir] for p in ranked)
        with writing(f"{self.folder}: the front", "the points of before are kept there: make room and run again"):
            write_json(self.as_dict(), self.folder / "front.json")
            write_whole(self.folder / "table.csv", buffer.getvalue().encode())


def read_front(folder: Path) -> Front:
    """A front as its folder holds it, without the motions; the problem is that of its highest hop. ResultError if there
    is none."""
    try:
        data = json.loads((folder / "front.json").read_text(encoding="utf-8"))
        points = [FrontPoint(**point) for point in data["points"]]
        stored = [Path(p.result_dir).name for p in points if p.result_dir][-1]
        design = load(folder / "points" / stored / "problem.toml", without_modules=True)
        return Front(design, _against(data), folder, points, complete=bool(data["complete"]))
    except (OSError, ValueError, LookupError, TypeError) as error:
        raise ResultError(f"{folder}: the front cannot be read ({reason_of(error)}): trace it again") from error


def with_solutions(front: Front) -> Front:
    """A stored front with the hops of its points; ResultError if one cannot be read."""
    places = [
        front.folder / "points" / Path(p.result_dir).name if front.folder and p.result_dir else None
        for p in front.points
    ]
    return replace(front, solutions=[None if place is None else read(place) for place in places])


def _against(data: Mapping[str, Any]) -> HopObjective:
    """The other objective; of one whose module is not here what the folder says of it."""
    name = data["against"]
    if known("objective", name):
        return find(name)

    def absent(hop: Any, ends: Any) -> Any:
        raise missing("objective", name)

    return HopObjective(name, data["meaning"], data["unit"], absent, CUSTOM_FIGURE, maximize=False)
