"""One exploration: what is asked, what is known of it, the designs tried, a map; for a page, or for a test.

One process solves (bench.py), another looks closely at what rests (desk.py), so that what is dragged is answered at once.
"""

import asyncio
import secrets
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from math import isnan, nan
from pathlib import Path
from typing import Any, cast

from hopopt.design import Design
from hopopt.errors import UsageError
from hopopt.live.bench import NO_HOP, Bench, Found
from hopopt.live.desk import Desk
from hopopt.live.map import Cell, LiveMap
from hopopt.live.orders import Orders
from hopopt.live.processes.worker import Failed, Left, Stopped, Worker
from hopopt.live.sliders import BODY, Slider, added_mass, named, places_of_parts
from hopopt.live.tried import Asked, Designs, told
from hopopt.ocp.objectives.registry import find
from hopopt.problem.catalogue import catalogue, with_part
from hopopt.studies.maps.warm import Carried

REST = 1.0  # s without a change after which a design is verified
FAIR = 0.3  # s that an answer is given before the next change ends it; or, so that a hand that drags on sees some:
USUAL = 2.0  # times what the last one took
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
        self.orders = Orders(self, partial(Desk, design, objective, folder, starts))
        self.sliders: list[Slider] = []
        self.asked, self._number, self._solved = Asked({}, {}), 0, -1
        self.found: Found | None = None  # of what was solved last
        self.picture: Mapping[str, Any] | None = None  # of the last hop
        self.designs, self.map = Designs(), cast("LiveMap | None", None)
        self.busy, self.said, self.fault, self._lasts = "starting", "", "", False
        self._changed = asyncio.Event()
        self._rest: asyncio.TimerHandle | None = None
        self._patience: asyncio.TimerHandle | None = None
        self._began, self._took = nan, 0.0  # s: when the answer that is looked for was asked for; by the last answer
        self._bench: Worker | None = None
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
        if BODY in own:
            own[BODY] += added_mass(self._design, choices) - added_mass(self._design, self.asked.choices)
        self._ask(Asked(own, choices))  # its numbers are the part's

    def undo(self) -> None:
        """Back to the design that rested before."""
        if (before := self.designs.before(self.asked)) is None:
            self.say("there is nothing to undo")
        else:
            self._ask(before)

    def back_to(self, id: int) -> None:
        """A design of the list."""
        self._ask(self.designs.known(id).asked)

    def show_beside(self, id: int | None) -> None:
        """Lay a design of the list over the one that is shown; None: none."""
        self.designs.beside = None if id is None else self.designs.known(id).id
        self.tell()

    def fill_map(self, entries: Sequence[str]) -> None:
        """The objective over one slider's entry or two, filled in while nothing else is asked; none: no map."""
        self.map = LiveMap(self.sliders, entries) if entries else None
        self._changed.set()
        self.tell()

    async def learn(self, asked: Asked, kinds: Mapping[int, Carried], words: Sequence[str]) -> None:
        """Follow the kinds of hop that a search found of a design from now on; show the best, if it is better than what is."""
        if self._bench is None:
            return
        learnt = await self._bench.ask("learn", asked.values, kinds, words)
        if learnt.new and self.map is not None:
            self.map.refresh()
        if learnt.better and asked == self.asked:
            if self.designs.shown is not None:
                self.designs.drop(self.designs.shown)
            self._number += 1
            self.say("a better kind of hop was found for these numbers")
        self._changed.set()

    # ---- what is done ---------------------------------------------------------------------------------------------

    async def run(self) -> None:
        """Answer what is asked until cancelled; Failed if the problem has no hop to begin with."""
        self._bench = bench = Worker(self._make_bench, self.progress)
        try:
            try:
                self.sliders, found = await bench.ask("begin", self._processes)
            except Failed as error:
                raise Failed(self.kept(error)) from None
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
        """Stop all that is done beside."""
        self._leave_desk()
        self.orders.stop()

    def _leave_desk(self) -> None:
        """Stop looking at the design that was shown."""
        for timer in filter(None, (self._rest, self._patience)):
            timer.cancel()
        self.orders.desk.stop()

    async def _solve(self, bench: Worker) -> None:
        number, asked, clock = self._number, self.asked, asyncio.get_running_loop().time
        self._began = clock()
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
            self._took = clock() - self._began
        except Left:
            return
        except Failed as error:
            found = Found(NO_HOP, self.kept(error))
        finally:
            self._began = nan
            if self._patience is not None:
                self._patience.cancel()
        if number == self._number:
            self._take(found)

    async def _fill(self, bench: Worker, filling: LiveMap, cell: Cell) -> None:
        value = None
        try:
            value = await bench.ask("value_at", {**self.asked.values, **filling.at(cell)})
        except Left:
            return
        except Failed as error:
            self.kept(error)
        filling.fill(cell, value)
        if self.map is filling and (filling.left % TOLD_CELLS == 0 or self._missing is None):
            self.tell()

    @property
    def _missing(self) -> Cell | None:
        """The cell of the map to be filled next."""
        return None if self.map is None else self.map.missing(self.asked.values)

    def _ask(self, asked: Asked) -> None:
        if asked == self.asked:
            self.tell()  # a page that asked waits for it
            return
        moved = {e for e in self.asked.values if asked.values.get(e) != self.asked.values[e]}
        if self.map is not None and (asked.choices != self.asked.choices or not moved <= set(self.map.entries)):
            self.map = None  # it was of other values
        self.asked, self._number, self.said = asked, self._number + 1, self.said if self._lasts else ""
        self.designs.shown, self.busy = None, "solving"
        self._leave_desk()
        if self._bench is not None:
            self._bench.leave("value_at")
            if not isnan(self._began):
                until = self._began + max(FAIR, USUAL * self._took)
                self._patience = asyncio.get_running_loop().call_at(until, self._bench.leave, "at")
        self._changed.set()
        self.tell()

    def _take(self, found: Found) -> None:
        """What was asked last is solved."""
        self.found, self._solved, self.busy = found, self._number, ""
        self.picture = found.picture or self.picture
        self._rest = asyncio.get_running_loop().call_later(REST, self._rested)
        self._changed.set()
        self.tell()

    def _rested(self) -> None:
        """The hands rest: the design enters the list, and is verified."""
        assert self.found is not None
        self.designs.rested(self.asked, self.found)
        self.tell()
        self.orders.desk.later(self.orders.look_closer)

    def kept(self, error: Failed) -> str:
        """The sentence of an error; of a fault of hopopt the traceback is kept in the folder."""
        if error.fault is not None:
            with suppress(OSError):  # of a disk that is full
                error.fault.keep(self._folder, f"explore-{secrets.token_hex(4)}")
        return str(error)

    def progress(self, text: str) -> None:
        """A line of progress."""
        self._tell({"busy": text})

    def say(self, words: str, lasts: bool = False) -> None:
        """A sentence for the page, that lasts until another is said, or is of the numbers that stand there now."""
        self.said, self._lasts = words, lasts
        self.tell()

    def note(self, id: int, **known: Any) -> None:
        """What became known of a design of the list."""
        self.designs.note(id, **known)
        if (verified := known.get("verified")) is not None and id == self.designs.shown:
            self.picture = verified.picture
        self.tell()

    def tell(self) -> None:
        """Tell the page all that it shows."""
        self._tell(self.state)

    # ---- what is known --------------------------------------------------------------------------------------------

    @property
    def objective(self) -> str:
        """Its name."""
        return self._goal.name

    @property
    def stale(self) -> bool:
        """Whether what was asked last is still being solved."""
        return self._solved != self._number

    @property
    def parts(self) -> dict[str, list[str]]:
        """Names of the catalogue that each part of the leg can have, by its place in the problem."""
        places = places_of_parts(self._design.leg)
        return {path: sorted(with_part(path.rpartition(".")[2], catalogue())) for path in places}

    @property
    def state(self) -> dict[str, Any]:
        """All that a page shows, in plain data."""
        designs, found = self.designs, self.found
        tried, beside = designs[designs.shown], designs[designs.beside]
        return {
            "problem": self._design.name, "title": self._design.title or self._design.name,
            "objective": self._goal.name, "unit": self._goal.unit,
            "stale": self.stale, "busy": self.busy or self.orders.doing, "said": self.said, "fault": self.fault,
            "sliders": [s.as_dict() for s in self.sliders], "values": dict(self.asked.values),
            "parts": self.parts, "chosen": {path: self.asked.choices.get(path, OWN) for path in self.parts},
            "now": None if found is None else tried.told if tried else told(found),
            "picture": self.picture, "beside": beside and {"id": beside.id, "picture": beside.picture},
            "designs": [t.row for t in designs.tried], "current": designs.shown,
            "undo": any(asked != self.asked for asked in designs.undone), "map": self.map and self.map.as_dict(),
            "lines": None if tried is None else {"pd": tried.pd, "reached": tried.reached},
        }  # fmt: skip
