"""The live page of a leg, beside the cells of a notebook."""

import asyncio
from collections.abc import Sequence
from concurrent.futures import Future
from contextlib import suppress
from pathlib import Path
from threading import Thread

from hopopt.api.asked import Problem
from hopopt.live.server import Server
from hopopt.live.session import Session
from hopopt.problem.load import as_design
from hopopt.storage.folder import prepare

HEIGHT = 900  # pixels of the frame below a cell


class LivePage:
    """A page that runs until ``close``.

    address: to open in a browser on this computer
    """

    def __init__(self, address: str, loop: asyncio.AbstractEventLoop, task: "asyncio.Task[None]"):
        self.address, self._loop, self._task = address, loop, task

    def close(self) -> None:
        """End it."""
        with suppress(RuntimeError):  # it has ended already
            self._loop.call_soon_threadsafe(self._task.cancel)

    def __repr__(self) -> str:
        return f"<LivePage at {self.address}>"

    def _repr_html_(self) -> str:
        return f'<iframe src="{self.address}" width="100%" height="{HEIGHT}" title="hopopt explore"></iframe>'


def explore(
    problem: Problem,
    *,
    entries: Sequence[str] = (),
    objective: str = "clearance",
    starts: int | None = None,
    processes: int | None = None,
    port: int = 0,
    results: str | Path = "results",
) -> LivePage:
    """A page on this computer on which the numbers of a leg are dragged, and the leg hops; in a notebook, below the cell.

    problem: a problem, its name or file
    entries: those with a slider, each "leg.gear.ratio" or with its range, "leg.gear.ratio=60:160" (none: the ten that
        change the objective most)
    objective: the name of one
    starts: how many starting points the search for other kinds of hop has (None: the problem's solver.starts)
    processes: how many are solved side by side (None: the cores)
    port: the page's, on this computer alone (0: any that is free)
    results: the folder for verified hops, reports and problem files

    The page is closed by ``close()``, and when the kernel ends. Raises MissingExtraError without the extra ``explore``,
    UsageError for what is no problem or entry.
    """
    design = as_design(problem)
    ready: Future[LivePage] = Future()

    async def main() -> None:
        server = Server(lambda tell: Session(design, objective, entries, Path(results), starts, processes, tell), port)
        prepare(Path(results))
        task = asyncio.ensure_future(server.run())
        ready.set_result(LivePage(server.address, asyncio.get_running_loop(), task))
        await task

    def run() -> None:
        try:
            asyncio.run(main())
        except (Exception, asyncio.CancelledError) as error:  # a page that is open has been told
            if not ready.done():
                ready.set_exception(error)

    Thread(target=run, daemon=True).start()
    return ready.result()
