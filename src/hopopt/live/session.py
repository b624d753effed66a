"""One exploration: what is asked, what is known of it, the designs tried, a map; for a page, or for a test.

One process solves (bench.py), another looks closely at what rests (desk.py), so that what is dragged is answered at once.
"""

import asyncio
import secrets
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from hopopt.design import Design
from hopopt.errors import UsageError
from hopopt.live.bench import NO_HOP, PRELIMINARY, Bench, Found
from hopopt.live.desk import Desk, Verified
from hopopt.live.map import Cell, LiveMap
from hopopt.live.sliders import Slider, named
from hopopt.live.tried import MOST_DESIGNS, Asked, Designs, told
from hopopt.live.worker import Beside, Failed, Stopped, Worker
from hopopt.ocp.objectives.registry import find
from hopopt.problem.catalogue import catalogue, with_part
from hopopt.problem.catalogue_facts import KINDS

REST = 1.0  # s without a change after which a design is verified
TOLD_CELLS = 3  # of a map, after which the page is told
OWN = ""  # choice of the part that the problem has


class Session:
    """An exploration of a problem.

    starts: of the search for other kinds of hop (None: the problem's)
    tell: is called with the state whenever it has changed, and with {"busy": text} on the way
    folder: where results and files are written

    Raises UsageError for entries that can have no slider.
    """

    def __init__(
        self, design: Design, objective: str, asked: Sequence[str], folder: Path, starts: int | None = None,
        processes: int | None = None, tell: Callable[[dict[str, Any]], None] = lambda state: None,
    ):  # fmt: skip
        self._design, self._goal, self._tell, self._folder = design, find(objective), tell, folder
        self._processes = processes
        named(design, asked)  # before a page is opened
        self._make_bench = partial(Bench, design, objective, tuple(asked))
        make_desk = partial(Desk, design, objective, folder, starts)
        self._desk = Beside(make_desk, self._progress, self._at, lambda error: self._say(self._kept(error)))
        self.later = self._desk.later
        self.sliders: list[Slider] = []
        self.asked, self._number, self._solved = Asked({}, {}), 0, -1
        self.found: Found | None = None  # of what was solved last
        self.picture: Mapping[str, Any] | None = None  # of the last hop
        self.designs = Designs()
        self.map: LiveMap | None = None
        self.busy, self.said, self.fault = "starting", "", ""
        self._changed = asyncio.Event()
        self._rest: asyncio.TimerHandle | None = None
        self._bench: Worker | None = None
        self._verifying = asyncio.Lock()
        self._searched = list[Asked]()  # designs that other kinds of hop were looked for at
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
        if (before := self.designs.before(self.asked)) is None:
            self._say("there is nothing to undo")
        else:
            self._ask(before)

    def back_to(self, id: int) -> None:
        """A design of the list."""
        self._ask(self.designs.known(id).asked)

    def show_beside(self, id: int | None) -> None:
        """Lay a design of the list over the one that is shown; None: none."""
        self.designs.beside = None if id is None else self.designs.known(id).id
        self._tell(self.state)

    def fill_map(self, entries: Sequence[str]) -> None:
        """The objective over one slider's entry or two, filled in while nothing else is asked; none: no map."""
        self.map = LiveMap(self.sliders, entries) if entries else None
        self._changed.set()
        self._tell(self.state)

    async def verify(self) -> None:
        """Verify the design that is shown; the word changes when that is done or has failed."""
        async with self._verifying:
            tried = self.designs[self.designs.shown]
            if tried is None or tried.verified is not None or tried.found.outcome != PRELIMINARY:
                return
            found = await self._desk.ask("verifying", "verify", tried.asked.entries, tried.found)
            if isinstance(found, Verified):
                self._note(tried.id, verified=found)

    async def look_closer(self) -> None:
        """Verify the design that is shown, then search it for other kinds of hop, as a single solve does."""
        await self.verify()
        tried = self.designs[self.designs.shown]
        if tried is None or self._bench is None or tried.asked in self._searched:
            return
        found = await self._desk.ask("looking for other kinds of hop", "search", tried.asked.entries)
        if found is None:
            return
        self._searched = [*self._searched[1 - MOST_DESIGNS :], tried.asked]
        if found[0] and await self._bench.ask("learn", tried.asked.values, *found) and tried.asked == self.asked:
            self.designs.drop(tried.id)
            self._number += 1
            self._changed.set()
            self._say("a better kind of hop was found for these numbers")

    async def controllers(self, share: bool) -> None:
        """What PD control reaches of the design that is shown; or what 95 % of robots reach, which takes a minute."""
        await self.verify()
        tried = self.designs[self.designs.shown]
        if tried is None or tried.verified is None or not tried.verified.verified:
            self._say("the design that is shown is not verified, so controllers are not set beside it")
            return
        words = "simulating legs that differ from this one" if share else "simulating the paper's force control"
        found = await self._desk.ask(words, "reached" if share else "pd", tried.verified.folder)
        if found is not None:
            self._note(tried.id, **({"reached": found} if share else {"pd": found}))

    async def write(self) -> None:
        """Write the design that is shown as a problem file."""
        if (file := await self._desk.ask("writing", "write", self.asked.entries)) is not None:
            self._say(f"{file} written: hopopt solve {file}")

    async def report(self) -> None:
        """Write the page of the design that is shown, once it is verified."""
        await self.verify()
        tried = self.designs[self.designs.shown]
        if tried is None or tried.verified is None:
            self._say("there is no verified design to report")
        elif (file := await self._desk.ask("writing the report", "report", tried.verified.folder)) is not None:
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
                while True:
                    if self._solved != self._number:
                        await self._solve(bench)
                    elif self.map is not None and (cell := self._missing) is not None:
                        await self._fill(bench, self.map, cell)
                    else:
                        break
        except Stopped:
            raise Failed("the process that solves has ended: start hopopt explore again") from None
        finally:
            bench.stop()
            self.close()

    def close(self) -> None:
        """Stop what is being looked at."""
        if self._rest is not None:
            self._rest.cancel()
        self._desk.stop()

    async def _solve(self, bench: Worker) -> None:
        number, asked = self._number, self.asked
        try:
            if asked.choices != self._chosen:
                self.sliders = await bench.ask("choose", asked.choices)
                self._chosen = asked.choices
                if self.map is not None and not set(self.map.entries) <= {s.entry for s in self.sliders}:
                    self.map = None
            asked = replace(asked, values={s.entry: asked.values.get(s.entry, s.value) for s in self.sliders})
            if number == self._number:
                self.asked = asked
            found = await bench.ask("at", asked.values)
        except Failed as error:
            found = Found(NO_HOP, self._kept(error))
        if number == self._number:
            self._take(found)

    async def _fill(self, bench: Worker, filling: LiveMap, cell: Cell) -> None:
        value = None
        with suppress(Failed):
            value = await bench.ask("value_at", {**self.asked.values, **filling.at(cell)})
        filling.values[cell] = value
        if self.map is filling and (len(filling.values) % TOLD_CELLS == 0 or self._missing is None):
            self._tell(self.state)

    @property
    def _missing(self) -> Cell | None:
        """The cell of the map to be filled next."""
        return None if self.map is None else self.map.missing(self.asked.values)

    def _ask(self, asked: Asked) -> None:
        if asked == self.asked:
            self._tell(self.state)  # a page that asked waits for it
            return
        moved = {e for e in self.asked.values if asked.values.get(e) != self.asked.values[e]}
        if self.map is not None and (asked.choices != self.asked.choices or not moved <= set(self.map.entries)):
            self.map = None  # it was of other values
        self.asked, self._number, self.said = asked, self._number + 1, ""
        self.designs.shown, self.busy = None, "solving"
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
        self.designs.rested(self.asked, self.found)
        self._tell(self.state)
        self.later(self.look_closer())

    def _at(self, words: str, begins: bool) -> None:
        """What is done beside begins or ends."""
        self.busy = words if begins else "" if self.busy == words else self.busy
        self._tell(self.state)

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
        self.designs.note(id, **known)
        if (verified := known.get("verified")) is not None and id == self.designs.shown:
            self.picture = verified.picture
        self._tell(self.state)

    # ---- what is known --------------------------------------------------------------------------------------------

    @property
    def parts(self) -> dict[str, list[str]]:
        """Names of the catalogue that each part of the leg can have, by its place in the problem."""
        return {f"leg.{part}": sorted(with_part(part, catalogue())) for part in KINDS}

    @property
    def state(self) -> dict[str, Any]:
        """All that a page shows, in plain data."""
        designs, found = self.designs, self.found
        tried, beside = designs[designs.shown], designs[designs.beside]
        return {
            "problem": self._design.name, "title": self._design.title or self._design.name,
            "objective": self._goal.name, "unit": self._goal.unit,
            "stale": self._solved != self._number, "busy": self.busy, "said": self.said, "fault": self.fault,
            "sliders": [s.as_dict() for s in self.sliders], "values": dict(self.asked.values),
            "parts": self.parts, "chosen": {path: self.asked.choices.get(path, OWN) for path in self.parts},
            "now": None if found is None else tried.told if tried else told(found),
            "picture": self.picture, "beside": beside and {"id": beside.id, "picture": beside.picture},
            "designs": [t.row for t in designs.tried], "current": designs.shown,
            "undo": any(asked != self.asked for asked in designs.undone), "map": self.map and self.map.as_dict(),
            "lines": None if tried is None else {"pd": tried.pd, "reached": tried.reached},
        }  # fmt: skip
