"""Designs that were asked for and what is known of each, as a page shows it: in plain data."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import count
from typing import Any

from hopopt.errors import UsageError
from hopopt.live.bench import PRELIMINARY, Found
from hopopt.live.desk import Verified

MOST_DESIGNS, MOST_UNDONE = 40, 100


@dataclass(frozen=True)
class Asked:
    """Values of the sliders' entries, and parts of the catalogue by their places in the problem."""

    values: Mapping[str, float]
    choices: Mapping[str, str]

    @property
    def entries(self) -> dict[str, Any]:
        """Of the problem, the parts first: sliders are laid over their numbers."""
        return {**self.choices, **self.values}


@dataclass(frozen=True)
class Tried:
    """A design that rested.

    id: its number in the list; asked: what it was; found: its hop on the first mesh
    verified: what verification said; failure: why it could not say anything
    pd: what PD control clears [m], null with why where it does not hop; reached: what a share of drawn legs reach [m]
    """

    id: int
    asked: Asked
    found: Found
    verified: Verified | None = None
    failure: str = ""
    pd: Mapping[str, Any] | None = None
    reached: Mapping[str, float | None] | None = None

    @property
    def told(self) -> dict[str, Any]:
        """What is known of its hop, with the word that stands behind the figure."""
        known, verified = told(self.found), self.verified
        if verified is None:
            return {**known, "word": "not verified", "sentence": self.failure} if self.failure else known
        if verified.verified:
            return {**known, "word": "verified", "value": verified.value, "folder": verified.folder}
        return {**known, "word": "not verified", "sentence": f"failed checks: {', '.join(verified.failed)}"}

    @property
    def row(self) -> dict[str, Any]:
        """Its row of the list."""
        known = {key: self.told[key] for key in ("value", "word", "figures", "limits")}
        return {"id": self.id, "values": dict(self.asked.values), "choices": dict(self.asked.choices), **known}

    @property
    def picture(self) -> Mapping[str, Any] | None:
        """Its hop as it is drawn: the verified one, if there is one."""
        return self.verified.picture if self.verified and self.verified.verified else self.found.picture


def told(found: Found) -> dict[str, Any]:
    """What is known of a hop on the first mesh."""
    return {
        "word": found.outcome, "outcome": found.outcome, "sentence": found.sentence, "value": found.value,
        "error": found.error, "words": found.words, "switched": found.switched, "figures": dict(found.figures),
        "limits": [{"entry": entry, "percent": x} for entry, x in found.limits],
    }  # fmt: skip


class Designs:
    """The designs that rested: a list, the one that is shown, the one that lies beside it, and the way back.

    MOST_DESIGNS are kept, and the way back of MOST_UNDONE.
    """

    def __init__(self) -> None:
        self.tried: list[Tried] = []
        self.shown: int | None = None  # id
        self.beside: int | None = None  # id
        self.undone = list[Asked]()
        self._ids = count(1)

    def __getitem__(self, id: int | None) -> Tried | None:
        return next((t for t in self.tried if t.id == id), None)

    def known(self, id: int) -> Tried:
        """A design of the list; UsageError if it is none."""
        if (found := self[id]) is None:
            raise UsageError(f"there is no design {id!r:.20} in the list")
        return found

    def rested(self, asked: Asked, found: Found) -> None:
        """A design is shown and enters the list, if it has a hop and is not there."""
        known = next((t for t in self.tried if t.asked == asked), None)
        if not self.undone or self.undone[-1] != asked:
            self.undone = [*self.undone[1 - MOST_UNDONE :], asked]
        if known is None and found.outcome == PRELIMINARY:
            known = Tried(next(self._ids), asked, found)
            kept = [t for t in self.tried if t.id == self.beside]
            self.tried = [*kept, *[t for t in self.tried if t not in kept][1 - MOST_DESIGNS :], known]
        self.shown = known.id if known else None

    def note(self, id: int, **known: Any) -> None:
        """What became known of a design."""
        self.tried = [replace(t, **known) if t.id == id else t for t in self.tried]

    def drop(self, id: int) -> None:
        """Take a design from the list."""
        self.tried = [t for t in self.tried if t.id != id]
        self.shown = None if self.shown == id else self.shown

    def before(self, asked: Asked) -> Asked | None:
        """The design that rested before this one; None if there is none."""
        while self.undone and self.undone[-1] == asked:
            self.undone.pop()
        if not self.undone:
            self.undone = [asked]
            return None
        return self.undone[-1]
