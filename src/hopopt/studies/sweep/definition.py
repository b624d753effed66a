"""A design study: which entries of a problem are varied, and the points that follow from it."""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np

from hopopt.amounts import check
from hopopt.design import Design
from hopopt.errors import ProblemFileError, UsageError
from hopopt.ocp.objectives.registry import find
from hopopt.problem.catalogue import Entry, catalogue
from hopopt.problem.load import changed
from hopopt.problem.render import design_hash, place, shown, shown_path, value_at, values_of

MOST_POINTS = 100_000  # points of a study
LARGEST_VALUE = 1e15  # of a value; no entry of a problem comes near
COUNT = re.compile(r"0*[1-9]\d*", re.ASCII)
SAMPLINGS = "lhs:40 (Latin hypercube) or sobol:64"
HOW_TO_VARY = "write lower:upper:count, such as leg.gear.ratio=60:160:11, or a list such as leg.gear.ratio=60,80,100 or leg.motor=unitree-go2,mini-cheetah"
DRIVE = re.compile(r"leg\.([^.]+\.)?(motor|gear)", re.ASCII)  # an entry that takes names of the catalogue
FORMAT = 3  # of the study's folder


@dataclass(frozen=True)
class Axis:
    """An entry that is varied: over ``values``, or between ``lower`` and ``upper`` if points are to be sampled.

    names: motors or gears of the catalogue, which ``values`` number from 0
    """

    entry: str
    values: tuple[float, ...] = ()
    lower: float = 0.0
    upper: float = 0.0
    names: tuple[str, ...] = ()

    @property
    def range(self) -> tuple[float, float]:
        """Smallest and largest value."""
        return (min(self.values), max(self.values)) if self.values else (self.lower, self.upper)


@dataclass(frozen=True)
class Definition:
    """Everything that decides a study's results; the points follow from it.

    own: motors and gears that an axis names and the built-in catalogue has not
    """

    design: Design
    objective: str
    axes: tuple[Axis, ...]
    sample: str | None = None
    seed: int = 0
    starts: int | None = None
    preliminary: bool = False  # solved on the first mesh alone (studies/maps)
    listed: tuple[tuple[float, ...], ...] = ()  # the points, where they are neither a grid nor a sample
    wish: float = 0.0  # value that is asked for of a list: what ends far below it is not searched for long
    own: Mapping[str, Entry] = field(default_factory=dict)
    full: tuple[Mapping[str, float], ...] = ()  # of a list: entries of each point that count only where it is verified

    @cached_property
    def points(self) -> np.ndarray:
        """The values of the varied entries at every point, (points, axes), in the entries' units."""
        if self.listed:
            return np.array(self.listed, dtype=float)
        if self.sample is None:
            return np.array(list(product(*(axis.values for axis in self.axes))), dtype=float)
        from scipy.stats import qmc  # takes a third of a second

        kind, count = sampling(self.sample)
        engine = (qmc.LatinHypercube if kind == "lhs" else qmc.Sobol)(len(self.axes), rng=self.seed)
        low, high = np.array([axis.range for axis in self.axes]).T
        points = low + (high - low) * engine.random(count)
        whole = [whole_number(self.design, axis.entry) for axis in self.axes]
        return np.where(whole, np.round(points), points)

    @property
    def shape(self) -> tuple[int, ...] | None:
        """Counts along the axes of a grid; None for a sample or a list."""
        return None if self.sample or self.listed else tuple(len(axis.values) for axis in self.axes)

    def values(self, k: int) -> dict[str, float]:
        """The varied entries at point k."""
        return {axis.entry: float(x) for axis, x in zip(self.axes, self.points[k], strict=True)}

    def stated(self, values: Mapping[str, float]) -> dict[str, float | str]:
        """Values of entries as a problem states them: of a motor or a gear its name."""
        names = {a.entry: a.names for a in self.axes if a.names}
        return {entry: names[entry][round(x)] if entry in names else x for entry, x in values.items()}

    def words(self, values: Mapping[str, float]) -> str:
        """Values of entries in words: "leg.motor = mini-cheetah, leg.gear.ratio = 60"."""
        return ", ".join(f"{e} = {x if isinstance(x, str) else f'{x:g}'}" for e, x in self.stated(values).items())

    def design_at(self, k: int) -> Design:
        """The problem of point k; ProblemFileError, with a sentence for each fault, if there is no such problem."""
        return self.design_with(self.values(k))

    def full_design_at(self, k: int) -> Design:
        """The problem that point k is verified as."""
        return changed(self.design_at(k), self.full[k]) if self.full else self.design_at(k)

    def design_with(self, values: Mapping[str, float]) -> Design:
        """The problem with other values of some entries; ProblemFileError if there is none."""
        entries = {
            entry: round(x) if not isinstance(x, str) and whole_number(self.design, entry) else x
            for entry, x in self.stated(values).items()
        }
        return changed(self.design, entries, self.own)

    @cached_property
    def normalized(self) -> np.ndarray:
        """The points with every axis from 0 to 1, (points, axes): what counts as near."""
        points, ends = self.points, np.array([axis.range for axis in self.axes]).T
        if self.listed:  # its numbers may be of any size
            above = ends[0] > 0
            points, ends = (np.log(x, out=x.copy(), where=np.broadcast_to(above, x.shape)) for x in (points, ends))
        low, high = ends
        return (points - low) / np.where(high > low, high - low, 1.0)

    @cached_property
    def spaced(self) -> np.ndarray:
        """The points with a step of one from each value of a grid to the next, (points, axes): who is next to whom."""
        if self.shape is None:
            return self.normalized
        return np.column_stack([np.unique(column, return_inverse=True)[1] for column in self.points.T]).astype(float)

    def as_dict(self) -> dict[str, Any]:
        """For JSON, and to tell two studies apart."""
        axes = [
            {"entry": a.entry, "names": list(a.names)}
            if a.names
            else {"entry": a.entry, "values": list(a.values)}
            if a.values
            else {"entry": a.entry, "range": list(a.range)}
            for a in self.axes
        ]
        return {
            "format": FORMAT, "problem": self.design.name, "problem_hash": design_hash(self.design),
            "objective": self.objective, "axes": axes, "sample": self.sample, "seed": self.seed,
            "starts": self.starts, "points": len(self.points), **({"preliminary": True} if self.preliminary else {}),
            **({"listed": [list(row) for row in self.listed], "wish": self.wish} if self.listed else {}),
            **({"full": [dict(entries) for entries in self.full]} if self.full else {}),
            **({"own_catalogue": {name: dict(e.stated) for name, e in self.own.items()}} if self.own else {}),
        }  # fmt: skip


def define(
    design: Design,
    vary: Mapping[str, Any],
    *,
    objective: str = "clearance",
    sample: str | None = None,
    seed: int = 0,
    starts: int | None = None,
    preliminary: bool = False,
    entries: Mapping[str, Entry] | None = None,
) -> Definition:
    """The study of ``design`` with the entries of ``vary`` varied: a text (60:160:11 or 60,80,100), a list of
    values, or, with a sample, (lower, upper). ``entries``: motors and gears that may be named (None: the built-in ones).
    UsageError in a sentence if that makes no study."""
    find(objective)
    if not vary:
        raise UsageError(f"nothing is varied: {HOW_TO_VARY}")
    check("seed", seed, 0)
    check("starts", starts)
    count = sampling(sample)[1] if sample else 1
    axes = tuple(axis(entry, given, bool(sample)) for entry, given in vary.items())
    named, built_in = {name for a in axes for name in a.names}, catalogue()
    own = {name: e for name, e in (entries or {}).items() if name in named and name not in built_in}
    for a in axes:
        check_entry(design, a, own)
        count *= 1 if sample else len(a.values)
    if count > MOST_POINTS:
        raise UsageError(f"these are {count} points: a study has {MOST_POINTS} at most")
    return Definition(design, objective, axes, sample, seed, starts, preliminary, own=own)


def parse(texts: Sequence[str]) -> dict[str, str]:
    """{"leg.gear.ratio": "60:160:11"} from "leg.gear.ratio=60:160:11"."""
    vary: dict[str, str] = {}
    for text in texts:
        entry, equals, given = (part.strip() for part in text.partition("="))
        if not (entry and equals and given):
            raise UsageError(f"--vary {text}: {HOW_TO_VARY}")
        if entry in vary:
            raise UsageError(f"--vary {entry} is given twice: give all its values at once")
        vary[entry] = given
    return vary


def axis(entry: str, given: Any, sampled: bool) -> Axis:
    """One varied entry from what was given for it."""
    if isinstance(given, Mapping):
        raise UsageError(f"--vary {shown_path(entry)}: {HOW_TO_VARY}")
    if DRIVE.fullmatch(entry) and not sampled:
        return _named(entry, given)
    ranged = isinstance(given, str) and ":" in given
    parts = (given.split(":") if ranged else given.split(",")) if isinstance(given, str) else np.ravel(given).tolist()
    numbers = [_number(entry, part) for part in parts]
    if sampled:
        if len(numbers) != 2 or not numbers[0] < numbers[1]:
            raise UsageError(f"--vary {shown_path(entry)}: with a sample write lower:upper, the lower first")
        return Axis(entry, (), numbers[0], numbers[1])
    if ranged:
        numbers = _spaced(entry, numbers)
    if len(set(numbers)) < len(numbers) or not numbers:
        raise UsageError(f"--vary {shown_path(entry)}: each value once, please; {HOW_TO_VARY}")
    return Axis(entry, tuple(numbers))


def _named(entry: str, given: Any) -> Axis:
    """Motors or gears by their names."""
    listed = given.split(",") if isinstance(given, str) else np.ravel(given).tolist()
    names = tuple(str(name).strip() for name in listed)
    if not names or len(set(names)) < len(names):
        raise UsageError(f"--vary {entry}: each name once, please; hopopt actuators lists them")
    return Axis(entry, tuple(map(float, range(len(names)))), names=names)


def _spaced(entry: str, numbers: list[float]) -> list[float]:
    if len(numbers) == 2:
        few = f"{numbers[0]:g}:{numbers[1]:g}"
        raise UsageError(f"--vary {shown_path(entry)}={few}: how many values? write lower:upper:count, such as {few}:9")
    if len(numbers) != 3 or not numbers[0] < numbers[1] or numbers[2] not in range(2, MOST_POINTS + 1):
        words = f"lower:upper:count needs lower < upper and a count from 2 to {MOST_POINTS}"
        raise UsageError(f"--vary {shown_path(entry)}: {words}")
    return [float(x) for x in np.linspace(numbers[0], numbers[1], int(numbers[2]))]


def _number(entry: str, part: Any) -> float:
    try:
        value = float(part)
    except (TypeError, ValueError):
        value = math.nan
    if isinstance(part, bool) or not abs(value) <= LARGEST_VALUE:
        words = f"{shown(part)} is not a number of at most {LARGEST_VALUE:g}; {HOW_TO_VARY}"
        raise UsageError(f"--vary {shown_path(entry)}: {words}")
    return value


def sampling(text: str) -> tuple[str, int]:
    """("lhs", 40) from "lhs:40"."""
    kind, _, count = text.partition(":")
    if kind not in ("lhs", "sobol") or not COUNT.fullmatch(count):
        raise UsageError(f"--sample {shown(text)}: write {SAMPLINGS}")
    count = count.lstrip("0")
    if len(count) > len(str(MOST_POINTS)) or int(count) > MOST_POINTS:
        raise UsageError(f"--sample {shown(text)}: a study has {MOST_POINTS} points at most")
    if kind == "sobol" and int(count) & (int(count) - 1):
        raise UsageError(f"--sample {text}: a Sobol sample has a power of two of points, such as 32, 64 or 128")
    return kind, int(count)


def whole_number(design: Design, entry: str) -> bool:
    """Whether an entry takes whole numbers only."""
    return type(values_of(design).get(entry)) is int


def check_entry(design: Design, a: Axis, own: Mapping[str, Entry] | None = None) -> None:
    """That there is such an entry, and that it is a number, or takes the names, with those of one's ``own``."""
    path, index = place(a.entry)
    if "[" in path:
        raise UsageError(f"--vary {shown_path(a.entry)}: write a value of a list as hop.stance_duration[1]")
    value = values_of(design).get(path)
    if index is not None and (not isinstance(value, (tuple, list)) or index >= len(value)):
        raise UsageError(f"--vary {shown_path(a.entry)}: there is no such value in {shown_path(path)}")
    value = value_at(design, a.entry)
    if isinstance(value, (bool, str, tuple, list)):
        raise UsageError(f"--vary {shown_path(a.entry)}: {shown(value)} is not a number, so it cannot be varied")
    if type(value) is int and any(x != round(x) for x in a.values):
        raise UsageError(f"--vary {a.entry}: it takes whole numbers only")
    try:
        for name in a.names:
            changed(design, {path: name}, own)
        if not a.names:
            changed(design, {a.entry: value if value is not None else a.range[0]})
    except ProblemFileError as error:
        raise UsageError(f"--vary: {error.problems[0].removeprefix('override ')}") from None
