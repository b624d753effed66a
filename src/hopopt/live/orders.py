"""What takes seconds of the design that is shown: its verification, the search for other kinds of hop, and what a page orders."""

import asyncio
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from shlex import quote
from typing import Any, Protocol

from hopopt.live.bench import IMPOSSIBLE, Found
from hopopt.live.desk import Desk
from hopopt.live.processes.beside import Beside
from hopopt.live.processes.worker import Failed
from hopopt.live.tried import MOST_DESIGNS, Asked, Designs, Tried
from hopopt.studies.maps.warm import Carried

USUAL_OBJECTIVE = "clearance"  # that hopopt solve has if none is named


class Shown(Protocol):
    """What a page shows (session.py), and how it is told what became known."""

    asked: Asked
    found: Found | None
    designs: Designs

    @property
    def stale(self) -> bool: ...
    @property
    def objective(self) -> str: ...
    def tell(self) -> None: ...
    def progress(self, text: str) -> None: ...
    def say(self, words: str, lasts: bool = False) -> None: ...
    def kept(self, error: Failed) -> str: ...
    def note(self, id: int, **known: Any) -> None: ...
    async def learn(self, asked: Asked, kinds: Mapping[int, Carried], words: Sequence[str]) -> None: ...


class Orders:
    """Two desks: one looks at the design that rests and is stopped by the next change; another does what a page orders, and is
    not.

    desk: the first
    """

    def __init__(self, session: Shown, make: Callable[[Callable[[str], None]], Desk]):
        def told(error: Failed) -> None:
            session.say(session.kept(error), lasts=True)

        self._session = session
        self.desk, self._counter = (Beside(make, session.progress, session.tell, told) for _ in range(2))
        self._verifying = asyncio.Lock()
        self._searched = list[Asked]()  # designs that other kinds of hop were looked for at

    @property
    def doing(self) -> str:
        """Words for what is done now."""
        return ", ".join(self.desk.doing + self._counter.doing)

    def stop(self) -> None:
        """Stop all of it."""
        self.desk.stop()
        self._counter.stop()

    async def look_closer(self) -> None:
        """Verify the design that is shown, then search it for other kinds of hop, as a single solve does; also where those that
        are known lead to none."""
        session, asked = self._session, self._session.asked
        await self._looked_at(session.designs[session.designs.shown], self.desk)
        if asked in self._searched or session.found is None or session.found.outcome == IMPOSSIBLE:
            return
        kinds, words = await self.desk.ask("looking for other kinds of hop", "search", asked.entries)
        self._searched = [*self._searched[1 - MOST_DESIGNS :], asked]
        if kinds:
            await session.learn(asked, kinds, words)

    def pd(self) -> None:
        """Simulate the paper's force control on the design that is shown."""
        self._counter.later(partial(self._controllers, "pd", "simulating the paper's force control"))

    def reached(self) -> None:
        """What 95 % of robots reach of the design that is shown, which takes minutes."""
        self._counter.later(partial(self._controllers, "reached", "simulating legs that differ from this one"))

    def write(self) -> None:
        """Write the design that is shown as a problem file."""
        self._counter.later(self._write)

    def report(self) -> None:
        """Write the page of the design that is shown, once it is verified."""
        self._counter.later(self._report)

    async def _controllers(self, method: str, words: str) -> None:
        if (tried := await self._ordered()) and tried.verified:
            found = await self._counter.ask(words, method, tried.verified.folder)
            self._session.note(tried.id, **{method: found})

    async def _write(self) -> None:
        file = await self._counter.ask("writing", "write", self._session.asked.entries)
        objective = self._session.objective
        named = "" if objective == USUAL_OBJECTIVE else f" --objective {objective}"
        self._session.say(f"{file} written: hopopt solve {quote(file)}{named}", lasts=True)

    async def _report(self) -> None:
        if (tried := await self._ordered()) and tried.verified:
            file = await self._counter.ask("writing the report", "report", tried.verified.folder)
            self._session.say(f"{file} written: open it in a browser", lasts=True)

    async def _ordered(self) -> Tried | None:
        """The design that is shown when something is ordered, verified; None, which is told, if it is not."""
        session = self._session
        if session.found is None or session.stale:
            session.say("these numbers are still being solved: ask again when their hop is shown")
            return None
        session.designs.rested(session.asked, session.found)
        tried = await self._looked_at(session.designs[session.designs.shown], self._counter)
        if tried is None or tried.verified is None or not tried.verified.verified:
            session.say(
                "the design that this was asked for is not verified, and it is for verified ones alone", lasts=True
            )
            return None
        return tried

    async def _looked_at(self, tried: Tried | None, beside: Beside) -> Tried | None:
        """A design of the list once its verification has ended, as its word then tells; None if it is no more there."""
        designs, note = self._session.designs, self._session.note
        async with self._verifying:
            tried = tried and designs[tried.id]
            if tried is None or tried.verified is not None:
                return tried
            try:
                found: Any = await beside.ask("verifying", "verify", tried.asked.entries, tried.found)
                note(tried.id, verified=found, failure="")
            except Failed as error:
                note(tried.id, failure=f"verification ended without an answer: {self._session.kept(error)}")
            return designs[tried.id]
