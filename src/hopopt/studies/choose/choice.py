"""What came of every pair of motor and gear: whether it clears what is asked for, what it weighs and costs, what it lacks."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from hopopt.errors import UsageError
from hopopt.problem.checking.wording import did_you_mean
from hopopt.studies.choose.pairs import Drives, Tried

CLEARS, FAILS, DROPPED, UNWEIGHED = "clears", "does not clear", "cannot clear", "no mass is stated"
NOT_SOLVED, WEAK = "not solved", "cannot hold the start pose"
FILE = "choice.json"  # in the folder, all of it
CLOSE = 5e-3  # share of the clearance by which a preliminary value may be off: so near to it, verification decides
ORDERS: dict[str, Callable[["Candidate"], float | None]] = {  # by what candidates are sorted, the least first
    "mass": lambda c: c.mass,
    "price": lambda c: c.price,
    "energy": lambda c: c.energy,
    "peak-power": lambda c: c.peak_power,
}


@dataclass(frozen=True)
class Candidate:
    """A pair, and what came of it.

    outcome: CLEARS, FAILS, DROPPED, WEAK, UNWEIGHED or NOT_SOLVED
    mass: of all drives that it stands for, of all legs [kg]; price: of them [EUR]
    body_mass: of the body that carries them [kg]
    bound: clearance that no hop with it exceeds [m]
    preliminary: clearance on the first mesh or, where it may clear, on a finer one [m]
    verified: clearance that is verified [m]
    sentence: why it was not solved, or how its verification ended
    lacks: what is exhausted longest in the push, where it does not clear: torque, speed or supply; heat, where its winding gets
        too hot in the preliminary hop that clears
    energy: that its motors give in the push of that hop [J]; peak_power: the most that they give together [W]
    ratio: of its gear, if it is one
    """

    pair: Tried
    outcome: str
    mass: float | None = None
    price: float | None = None
    body_mass: float | None = None
    bound: float | None = None
    preliminary: float | None = None
    verified: float | None = None
    sentence: str = ""
    lacks: str = ""
    energy: float | None = None
    peak_power: float | None = None
    ratio: float | None = None

    @property
    def clearance(self) -> float | None:
        """The verified clearance, or else the preliminary one [m]."""
        return self.preliminary if self.verified is None else self.verified

    @property
    def state(self) -> str:
        """Whether its clearance is verified or preliminary."""
        return "verified" if self.verified is not None else "preliminary" if self.preliminary is not None else ""

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {**asdict(self), "name": self.pair.name, "clearance": self.clearance, "state": self.state}


@dataclass(frozen=True, repr=False)
class Choice:
    """All candidates, those that clear first and sorted.

    drives: which drives are chosen
    wish: the clearance that is asked for [m]
    by: what they are sorted by, one of ORDERS
    candidates: all of them
    folder: where the map of them is kept
    seconds: of this run
    """

    drives: Drives
    wish: float
    by: str
    candidates: tuple[Candidate, ...]
    folder: Path | None
    seconds: float

    def __repr__(self) -> str:
        words = f"{len(self.clearing)} clear {self.wish:g} m by {self.by}, of {len(self.candidates)} pairs"
        return f"<Choice for {self.drives.design.name}: {words}>"

    def find(self, name: str | None = None) -> Candidate:
        """The candidate with a pair's name, or the first that clears; UsageError if there is none."""
        if name is None and self.clearing:
            return self.clearing[0]
        found = {c.pair.name: c for c in self.candidates}
        if name is None:
            raise UsageError(f"no pair clears {self.wish:g} m, so there is none to take: ask for less, or name a pair")
        if name not in found:
            raise UsageError(f"there is no pair {name!r}{did_you_mean(name, found)}")
        return found[name]

    @property
    def clearing(self) -> list[Candidate]:
        """Those that clear, of each family of gears the ratio that clears most, the first the best."""
        return sorted(best_ratios(self.candidates), key=lambda c: order(c, self.by))

    @property
    def others(self) -> list[Candidate]:
        """Those that do not, the nearest to it first."""
        return sorted(
            (c for c in self.candidates if c.outcome != CLEARS), key=lambda c: -(c.clearance or c.bound or 0.0)
        )

    def front(self, by: str = "mass") -> list[Candidate]:
        """Of all that were solved, those that none with less of ``by``, one of ORDERS, clears more than; in its order."""
        found = list[Candidate]()
        solved = [c for c in self.candidates if c.clearance is not None and ORDERS[by](c) is not None]
        for c in sorted(solved, key=lambda c: order(c, by)):
            if not found or (c.clearance or 0.0) > (found[-1].clearance or 0.0):
                found.append(c)
        return found

    @property
    def exit_code(self) -> int:
        """0 one clears and is verified, 1 none clears, 3 those that clear are not verified."""
        if not self.clearing:
            return 1
        return 0 if any(c.verified is not None for c in self.clearing) else 3

    def as_dict(self) -> dict[str, Any]:
        """What ``--json`` prints."""
        d, chosen = self.drives, {c.pair.name for c in self.clearing}
        return {
            "problem": d.design.name, "clearance_m": self.wish, "by": self.by, "joints": list(d.joints), "legs": d.legs,
            "present_drives_kg": d.present, "present_drives_from": d.assumed,
            "candidates": [{**c.as_dict(), "best_ratio": c.pair.name in chosen} for c in (*self._sorted, *self.others)],
            "seconds": self.seconds, "exit_code": self.exit_code, "result_dir": None if self.folder is None else str(self.folder),
        }  # fmt: skip

    @property
    def _sorted(self) -> list[Candidate]:
        return sorted((c for c in self.candidates if c.outcome == CLEARS), key=lambda c: order(c, self.by))


def outcome_of(clearance: float, wish: float, verified: bool) -> str:
    """Whether a clearance is enough; a preliminary one that is CLOSE to it counts as enough until it is verified."""
    return CLEARS if clearance >= wish * (1 - (0 if verified else CLOSE)) else FAILS


def order(c: Candidate, by: str) -> tuple[bool, float, float]:
    """What candidates are sorted by: those of which it is not known come last."""
    value = ORDERS[by](c)
    return value is None, value or 0.0, -(c.clearance or 0.0)


def best_ratios(candidates: Iterable[Candidate]) -> list[Candidate]:
    """Those that clear, of each family of gears the ratio that clears most."""
    best = dict[tuple[str, ...], Candidate]()
    for c in (c for c in candidates if c.outcome == CLEARS):
        other = best.get(c.pair.family)
        if other is None or (c.clearance or 0.0) > (other.clearance or 0.0):
            best[c.pair.family] = c
    return list(best.values())


def first_to_verify(candidates: Mapping[int, Candidate], by: str, count: int) -> list[int]:
    """Numbers of the first so many of those that are listed."""
    number = {c.pair: k for k, c in candidates.items()}
    return [number[c.pair] for c in sorted(best_ratios(candidates.values()), key=lambda c: order(c, by))[:count]]
