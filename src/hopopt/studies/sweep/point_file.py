"""One point of a study and its file: JSON with a digest of itself, read back only if it is as it was written."""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from functools import cache
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from hopopt.errors import ResultError
from hopopt.files import write_whole
from hopopt.storage.folder import as_json, reason_of
from hopopt.storage.seal.digests import digest
from hopopt.studies.sweep.definition import Definition

SUM = 1e-9  # m: by which a clearance may differ from the sum of its parts
VERIFIED, NOT_VERIFIED, NOT_SOLVED, IMPOSSIBLE = "verified", "not verified", "not solved", "impossible problem"
ENDED = "ended by a fault"  # of hopopt itself: such a point is not finished, and --resume solves it
PRELIMINARY = "preliminary"  # of the first mesh alone: a point of a map (studies/maps)
NO_LIMIT = "no limit"
SEARCH = ("searched", "found_by_search")
OUTCOMES = (VERIFIED, NOT_VERIFIED, NOT_SOLVED, IMPOSSIBLE, ENDED)


@dataclass(frozen=True)
class Point:
    """How one point ended.

    index: its number in the study
    values: of the varied entries, by entry [its unit]
    outcome: one of OUTCOMES; VERIFIED means the checks of a single solve (planner/checks/judge.py)
    sentence: why it is not verified
    objective_value: [the objective's unit]
    clearance_m, parts: height of the lowest point and what it is the sum of [m], only if verified
    unverified_clearance_m: [m], only if it is solved and not verified
    error: by how much the objective may be better than the optimum, at most, by estimate [the objective's unit]
    limit: the limiting constraint, of whose range one per cent more gives most; empty if none does or it is not verified
    certified: whether the conditions of first-order optimality hold
    begun_from: the neighbour whose solution was the guess; None: the problem's starts
    tried: the neighbours that it was solved from, each with the pass that its solution is of
    corrected: whether a later pass helped
    searched: whether it was searched as a single solve with as many starts is, beside what its neighbours led to
    found_by_search: whether such a search in a later pass found a better hop than its neighbours had led to
    after_pass: how far the study was
    solved_in: the pass of its solution
    seconds: how long it took [s]
    traceback: of a fault of hopopt that ended its last solve; kept in a file of its own
    """

    index: int
    values: Mapping[str, float]
    outcome: str
    sentence: str = ""
    objective_value: float | None = None
    clearance_m: float | None = None
    unverified_clearance_m: float | None = None
    parts: Mapping[str, float] | None = None
    error: float | None = None
    limit: str = ""
    certified: bool = False
    begun_from: int | None = None
    tried: tuple[tuple[int, int], ...] = ()
    corrected: bool = False
    searched: bool = True
    found_by_search: bool = False
    after_pass: int = 0
    solved_in: int = 0
    seconds: float = 0.0
    traceback: str = field(default="", repr=False)

    @property
    def verified(self) -> bool:
        return self.outcome == VERIFIED

    @property
    def has_value(self) -> bool:
        """Whether its objective may be shown, as what it is: verified or preliminary."""
        return self.outcome in (VERIFIED, PRELIMINARY)

    @property
    def kind(self) -> str:
        """What it has the colour of: the limit that holds its hop back."""
        return self.limit or NO_LIMIT

    @property
    def solved(self) -> bool:
        """Whether its solution can be where a neighbour begins."""
        return self.outcome in (VERIFIED, NOT_VERIFIED)

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {name: value for name, value in asdict(self).items() if name != "traceback"}


def write_point(path: Path, point: Point, begin_digest: str | None) -> None:
    """A point's file; ``begin_digest``: of the file that its neighbours begin from, if there is one of this pass."""
    data = {**point.as_dict(), "begin_sha256": begin_digest}
    write_whole(path, (as_json({**data, "sha256": _digest(json.loads(as_json(data)))}) + "\n").encode())


def point_files(folder: Path) -> list[Path]:
    """The files of all points of a study, pass by pass."""
    return sorted((folder / "points").glob("[0-9]*.json"))


def read_point(path: Path, definition: Definition) -> tuple[Point, str]:
    """The point in a file, and why it is not to be trusted (empty: it is); ResultError if the file holds no point of
    this study."""
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
        if not isinstance(data, dict):
            raise TypeError("it is no JSON object")
        kept = {f.name: data[f.name] for f in fields(Point) if f.name not in ("traceback", *SEARCH)}
        kept |= {name: data[name] for name in SEARCH if name in data}  # earlier versions searched every point
        point = _points().validate_json(json.dumps(kept), strict=True)
        wrong = point.values != definition.values(point.index) or point.outcome not in OUTCOMES
    except (OSError, ValueError, TypeError, LookupError, RecursionError) as error:
        raise ResultError(f"{path}: it cannot be read ({_reason(error)}); remove it and resume") from error
    if wrong:
        raise ResultError(f"{path}: it belongs to another study; remove it and resume")
    return point, _doubt(path, data, point)


def _reason(error: Exception) -> str:
    """Why a file is no point's, in words."""
    if isinstance(error, ValidationError):
        first = error.errors()[0]
        return f"{'.'.join(map(str, first['loc']))}: {first['msg'].lower()}"
    return f"it has no entry {error.args[0]}" if isinstance(error, KeyError) else reason_of(error)


@cache
def _points() -> TypeAdapter[Point]:
    return TypeAdapter(Point)


def _doubt(path: Path, data: Mapping[str, Any], point: Point) -> str:
    """Why a point is not to be trusted; empty if it is."""
    if data.get("sha256") != _digest({k: v for k, v in data.items() if k != "sha256"}):
        return "it was changed after it was written (its digest differs)"
    begin = path.with_suffix(".npz")
    if begin.is_file() and digest(begin.read_bytes()) != data.get("begin_sha256"):
        return f"{begin.name} beside it was changed after it was written (its digest differs)"
    parts = sum((point.parts or {}).values())
    if point.verified and not abs((point.clearance_m or 0.0) - parts) <= SUM:
        return f"its clearance_m is {point.clearance_m} m, but the parts sum to {parts:.6g} m"
    return ""


def _digest(data: Mapping[str, Any]) -> str:
    return digest(json.dumps(data, sort_keys=True).encode())
