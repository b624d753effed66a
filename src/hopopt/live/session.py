"""One exploration: what is asked, what is known of it, the designs tried, a map; for a page, or for a test.

One process solves (bench.py), another looks closely at what rests (desk.py), so that what is dragged is answered at once.
"""

import asyncio
import secrets
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from itertools import count, product
from pathlib import Path
from typing import Any

import numpy as np

from hopopt.design import Design
from hopopt.errors import UsageError
from hopopt.live.bench import NO_HOP, PRELIMINARY, Bench, Found
from hopopt.live.desk import Desk, Verified
from hopopt.live.sliders import Slider
from hopopt.live.worker import Failed, Stopped, Worker
from hopopt.ocp.objectives.registry import find
from hopopt.problem.catalogue import catalogue, with_part
from hopopt.problem.catalogue_facts import KINDS

REST = 1.0  # s without a change after which a design is verified
MOST_DESIGNS, MOST_UNDONE = 40, 100
CURVE, MAP = 25, 9  # values of an entry in a map of one, and of each in a map of two
OWN = ""  # choice of the part that the problem has


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
    """A design that rested: its number, what it was, and what is known of it."""

    id: int
    asked: Asked
    found: Found
    verified: Verified | None = None
    searched: bool = False
    pd: float | None = None
    reached: Mapping[str, float | None] | None = None


class Session:
    """An exploration of a problem.

    starts: of the search for other kinds of hop (None: the problem's)
    tell: is called with the state whenever it has changed, and with {"busy": text} on the way
    folder: where results and files are written
    """

    def __init__(
        self, design: Design, objective: str, asked: Sequence[str], folder: Path, starts: int | None = None,
        processes: int | None = None, tell: Callable[[dict[str, Any]], None] = lambda state: None,
    ):  # fmt: skip
        self._design, self._goal, self._tell, self._folder = design, find(objective), tell, folder
        self._processes = processes
        self._make_bench = partial(_bench, design, objective, tuple(asked))
        self._make_desk = partial(_desk, design, objective, folder, starts)
        self.sliders: list[Slider] = []
        self.asked, self._number, self._solved = Asked({}, {}), 0, -1
        self.found: Found | None = None  # of what was solved last
        self.picture: Mapping[str, Any] | None = None  # of the last hop
        self.designs: list[Tried] = []
        self.current: int | None = None  # id of the tried design that is shown
        self.beside: int | None = None
        self.map: dict[str, Any] | None = None
        self.busy, self.said, self.fault = "starting", "", ""
        self._undo, self._ids = list[Asked](), count(1)
        self._changed, self._tasks = asyncio.Event(), set[asyncio.Task[Any]]()
        self._rest: asyncio.TimerHandle | None = None
        self._bench: Worker | None = None
        self._closer: Worker | None = None
        self._verifying = asyncio.Lock()
        self._searched: Asked | None = None
        self._chosen: Mapping[str, str] = {}  # what the bench has

    # ---- what the page asks ---------------------------------------------------------------------------------------

    def set(self, values: Mapping[str, Any]) -> None:
        """Other values of sliders' entries; UsageError for what is none."""
        sliders = {s.entry: s for s in self.sliders}
        for entry in values:
            if entry not in sliders:
                raise UsageError(f"{entry:.80} has no slider")
        new = {entry: sliders[entry].checked(x) for entry, x in values.items()}
        self._ask(replace(self.asked, values={**self.asked.values, **new}))

    def choose(self, path: str, name: str) -> None:
        """Another motor or gear of the catalogue, or the problem's own ("")."""
        if name != OWN and name not in self.parts.get(path, ()):
            raise UsageError(f"{path:.80}: {name:.80} is not in the catalogue")
        choices = {p: n for p, n in {**self.asked.choices, path: name}.items() if n != OWN}
        own = {entry: x for entry, x in self.asked.values.items() if not entry.startswith(f"{path}.")}
        self._ask(Asked(own, choices))  # its numbers are the part's

    def undo(self) -> None:
        """Back to the design that rested before."""
        while self._undo and self._undo[-1] == self.asked:
            self._undo.pop()
        if self._undo:
            self._ask(self._undo[-1])
        else:
            self._undo = [self.asked]
            self._say("there is nothing to undo")

    def back_to(self, id: int) -> None:
        """A design of the list."""
        self._ask(self._tried(id).asked)

    def show_beside(self, id: int | None) -> None:
        """Lay a design of the list over the one that is shown; None: none."""
        self.beside = None if id is None else self._tried(id).id
        self._tell(self.state)

    def fill_map(self, entries: Sequence[str]) -> None:
        """The objective over one slider's entry or two, filled in while nothing else is asked; none: no map."""
        sliders = {s.entry: s for s in self.sliders}
        if len(set(entries)) != len(entries) or len(entries) > 2 or not set(entries) <= sliders.keys():
            raise UsageError("a map is over one slider's entry, or over two")
        axes = [_places(sliders[entry], CURVE if len(entries) == 1 else MAP) for entry in entries]
        cells = dict.fromkeys(product(*(range(len(axis)) for axis in axes)))
        self.map = {"entries": list(entries), "axes": axes, "cells": cells, "done": set()} if entries else None
        self._changed.set()
        self._tell(self.state)

    async def verify(self) -> None:
        """Verify the design that is shown; the word changes when that is done or has failed."""
        async with self._verifying:
            tried = self._current
            if tried is None or tried.verified is not None or tried.found.outcome != PRELIMINARY:
                return
            found = await self._closely("verifying", "verify", tried.asked.entries, tried.found)
            if isinstance(found, Verified):
                self._note(tried.id, verified=found)

    async def look_closer(self) -> None:
        """Verify the design that is shown, then search it for other kinds of hop, as a single solve does."""
        await self.verify()
        tried = self._current
        if tried is None or tried.searched or self._bench is None or tried.asked == self._searched:
            return
        found = await self._closely("looking for other kinds of hop", "search", tried.asked.entries)
        if found is None:
            return
        self._searched = tried.asked  # once, even if what it finds leads to no better hop here
        self._note(tried.id, searched=True)
        if found[0] and await self._bench.ask("learn", tried.asked.values, *found) and tried.asked == self.asked:
            self.designs = [t for t in self.designs if t.id != tried.id]
            self.current, self._number = None, self._number + 1
            self._changed.set()
            self._say("a better kind of hop was found for these numbers")

    async def controllers(self, share: bool) -> None:
        """What PD control reaches of the design that is shown; or what 95 % of robots reach, which takes a minute."""
        await self.verify()
        tried = self._current
        if tried is None or tried.verified is None or not tried.verified.verified:
            self._say("the design that is shown is not verified, so controllers are not set beside it")
            return
        words = "simulating legs that differ from this one" if share else "simulating the paper's force control"
        found = await self._closely(words, "reached" if share else "pd", tried.verified.folder)
        if found is not None:
            self._note(tried.id, **({"reached": found} if share else {"pd": found}))

    async def write(self) -> None:
        """Write the design that is shown as a problem file."""
        if (file := await self._closely("writing", "write", self.asked.entries)) is not None:
            self._say(f"{file} written: hopopt solve {file}")

    async def report(self) -> None:
        """Write the page of the design that is shown, once it is verified."""
        await self.verify()
        tried = self._current
        if tried is None or tried.verified is None:
            self._say("there is no verified design to report")
        elif (file := await self._closely("writing the report", "report", tried.verified.folder)) is not None:
            self._say(f"{file} written: open it in a browser")

    # ---- what is done ---------------------------------------------------------------------------------------------

    async def run(self) -> None:
        """Answer what is asked until cancelled; Failed if the problem has no hop to begin with."""
        self._bench = bench = Worker(self._make_bench, self._progress)
        try:
            try:
                self.sliders, found = await bench.ask("begin", self._processes)
            except Failed as error:
                raise Failed(self._kept(error)) from None
            self.asked = Asked({s.entry: s.value for s in self.sliders}, {})
            self._take(found)
            while True:
                await self._changed.wait()
                self._changed.clear()
                while self._solved != self._number or self._missing is not None:
                    await (self._solve(bench) if self._solved != self._number else self._fill(bench))
        except Stopped:
            raise Failed("the process that solves has ended: start hopopt explore again") from None
        finally:
            bench.stop()
            self.close()

    def close(self) -> None:
        """Stop what is being looked at."""
        if self._rest is not None:
            self._rest.cancel()
        for task in self._tasks:
            task.cancel()
        if self._closer is not None:
            self._closer.stop()
            self._closer = None

    async def _solve(self, bench: Worker) -> None:
        number, asked = self._number, self.asked
        try:
            if asked.choices != self._chosen:
                self.sliders = await bench.ask("choose", asked.choices)
                self._chosen = asked.choices
                if self.map is not None and not set(self.map["entries"]) <= {s.entry for s in self.sliders}:
                    self.map = None
            asked = replace(asked, values={s.entry: asked.values.get(s.entry, s.value) for s in self.sliders})
            if number == self._number:
                self.asked = asked
            found = await bench.ask("at", asked.values)
        except Failed as error:
            found = Found(NO_HOP, self._kept(error))
        if number == self._number:
            self._take(found)

    async def _fill(self, bench: Worker) -> None:
        assert self.map is not None
        assert self._missing is not None
        at, filling = self._missing, self.map
        values = {e: axis[k] for e, axis, k in zip(filling["entries"], filling["axes"], at, strict=True)}
        with suppress(Failed):
            filling["cells"][at] = await bench.ask("value_at", {**self.asked.values, **values})
        filling["done"].add(at)
        if self.map is filling and (len(filling["done"]) % 3 == 0 or self._missing is None):
            self._tell(self.state)

    @property
    def _missing(self) -> tuple[int, ...] | None:
        """The cell of the map to be filled next, those near the design that is shown first."""
        if self.map is None:
            return None
        open_ = [at for at in self.map["cells"] if at not in self.map["done"]]
        here = [
            int(np.argmin(np.abs(np.array(axis) - self.asked.values[e])))
            for e, axis in zip(self.map["entries"], self.map["axes"], strict=True)
        ]
        return min(open_, key=lambda at: sum(abs(a - b) for a, b in zip(at, here, strict=True)), default=None)

    def _ask(self, asked: Asked) -> None:
        if asked == self.asked:
            self._tell(self.state)  # a page that asked waits for it
            return
        moved = {e for e in self.asked.values if asked.values.get(e) != self.asked.values[e]}
        if self.map is not None and (asked.choices != self.asked.choices or not moved <= set(self.map["entries"])):
            self.map = None  # it was of other values
        self.asked, self._number, self.said = asked, self._number + 1, ""
        self.current, self.busy = None, "solving"
        self.close()
        self._changed.set()
        self._tell(self.state)

    def _take(self, found: Found) -> None:
        """What was asked last is solved."""
        self.found, self._solved, self.busy = found, self._number, ""
        self.picture = found.picture or self.picture
        self._rest = asyncio.get_running_loop().call_later(REST, self._rested)
        self._changed.set()
        self._tell(self.state)

    def _rested(self) -> None:
        """The hands rest: the design enters the list, and is verified."""
        assert self.found is not None
        known = next((t for t in self.designs if t.asked == self.asked), None)
        if not self._undo or self._undo[-1] != self.asked:
            self._undo = [*self._undo[1 - MOST_UNDONE :], self.asked]
        if known is None and self.found.outcome == PRELIMINARY:
            known = Tried(next(self._ids), self.asked, self.found)
            kept = [t for t in self.designs if t.id == self.beside]
            self.designs = [*kept, *[t for t in self.designs if t not in kept][1 - MOST_DESIGNS :], known]
        self.current = known.id if known else None
        self._tell(self.state)
        self.later(self.look_closer())

    def later(self, work: Any) -> None:
        """Do this beside what is dragged; stopped by the next change."""
        task = asyncio.get_running_loop().create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _closely(self, words: str, method: str, *given: Any) -> Any:
        """What the desk says, None if it was stopped or failed, which is told."""
        self._closer = self._closer or Worker(self._make_desk, self._progress)
        self.busy = words
        self._tell(self.state)
        try:
            return await self._closer.ask(method, *given)
        except Stopped:
            if self._closer is not None:  # nobody stopped it
                self._closer = None
                self._say("the process that verifies has ended by itself; the next design begins it anew")
            return None
        except Failed as error:
            self._say(self._kept(error))
        finally:
            self.busy = "" if self.busy == words else self.busy
            self._tell(self.state)
        return None

    def _kept(self, error: Failed) -> str:
        """The sentence of an error; of a fault of hopopt the traceback is kept in the folder."""
        if error.fault is not None:
            with suppress(OSError):  # of a disk that is full
                error.fault.keep(self._folder, f"explore-{secrets.token_hex(4)}")
        return str(error)

    def _progress(self, text: str) -> None:
        self._tell({"busy": text})

    def _say(self, words: str) -> None:
        self.said = words
        self._tell(self.state)

    def _note(self, id: int, **known: Any) -> None:
        self.designs = [replace(t, **known) if t.id == id else t for t in self.designs]
        if (verified := known.get("verified")) is not None and id == self.current:
            self.picture = verified.picture
        self._tell(self.state)

    # ---- what is known --------------------------------------------------------------------------------------------

    def _tried(self, id: int) -> Tried:
        found = next((t for t in self.designs if t.id == id), None)
        if found is None:
            raise UsageError(f"there is no design {id!r:.20} in the list")
        return found

    @property
    def _current(self) -> Tried | None:
        return next((t for t in self.designs if t.id == self.current), None)

    @property
    def parts(self) -> dict[str, list[str]]:
        """Names of the catalogue that each part of the leg can have, by its place in the problem."""
        return {f"leg.{part}": sorted(with_part(part, catalogue())) for part in KINDS}

    @property
    def state(self) -> dict[str, Any]:
        """All that a page shows, in plain data."""
        tried, found = self._current, self.found
        beside = next((t for t in self.designs if t.id == self.beside), None)
        return {
            "problem": self._design.name, "title": self._design.title or self._design.name,
            "objective": self._goal.name, "unit": self._goal.unit, "number": self._number,
            "stale": self._solved != self._number, "busy": self.busy, "said": self.said, "fault": self.fault,
            "sliders": [s.as_dict() for s in self.sliders], "values": dict(self.asked.values),
            "parts": self.parts, "chosen": {path: self.asked.choices.get(path, OWN) for path in self.parts},
            "now": None if found is None else {**_told(found), **_words(found, tried)},
            "picture": self.picture, "beside": beside and {"id": beside.id, "picture": _picture_of(beside)},
            "designs": [_row(t) for t in self.designs], "current": self.current,
            "undo": any(asked != self.asked for asked in self._undo), "map": self._map,
            "lines": None if tried is None else {"pd": tried.pd, "reached": tried.reached},
        }  # fmt: skip

    @property
    def _map(self) -> dict[str, Any] | None:
        if self.map is None:
            return None
        cells = [{"at": list(at), "value": x} for at, x in self.map["cells"].items() if at in self.map["done"]]
        return {"entries": self.map["entries"], "axes": self.map["axes"], "cells": cells, "of": len(self.map["cells"])}


def _bench(design: Design, objective: str, asked: Sequence[str], say: Callable[[str], None]) -> Bench:
    return Bench(design, objective, asked, say=say)


def _desk(design: Design, objective: str, folder: Path, starts: int | None, say: Callable[[str], None]) -> Desk:
    return Desk(design, objective, folder, starts, say)


def _told(found: Found) -> dict[str, Any]:
    return {
        "outcome": found.outcome, "sentence": found.sentence, "value": found.value, "error": found.error,
        "family": found.family, "words": found.words, "switched": found.switched, "seconds": found.seconds,
        "limits": [{"entry": entry, "percent": x} for entry, x in found.limits], "figures": dict(found.figures),
    }  # fmt: skip


def _words(found: Found, tried: Tried | None) -> dict[str, Any]:
    """The word that stands behind the figure, and the figure where it is verified."""
    if tried is None or tried.verified is None:
        return {"word": found.outcome}
    if tried.verified.verified:
        return {"word": "verified", "value": tried.verified.value, "folder": tried.verified.folder}
    return {"word": "not verified", "sentence": f"failed checks: {', '.join(tried.verified.failed)}"}


def _row(t: Tried) -> dict[str, Any]:
    known = {**_told(t.found), **_words(t.found, t)}
    return {
        "id": t.id, "value": known["value"], "word": known["word"], "values": dict(t.asked.values),
        "choices": dict(t.asked.choices), "figures": known["figures"], "limits": known["limits"],
    }  # fmt: skip


def _picture_of(t: Tried) -> Mapping[str, Any] | None:
    return t.verified.picture if t.verified and t.verified.verified else t.found.picture


def _places(s: Slider, wanted: int) -> list[float]:
    found: Iterable[float] = np.linspace(s.low, s.high, wanted).tolist()
    return sorted({float(round(x)) for x in found}) if s.whole else list(found)


def checked(design: Design, asked: Sequence[str], objective: str) -> None:
    """UsageError for entries that can have no slider, before a page is opened."""
    Bench(design, objective, asked)
