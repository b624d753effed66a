"""Work in another process beside what is dragged."""

import asyncio
from collections.abc import Callable, Coroutine
from typing import Any

from hopopt.live.processes.worker import Failed, Stopped, Worker

Work = Callable[[], Coroutine[Any, Any, Any]]


class Beside:
    """Work in another process beside what is dragged: the process begins when it is asked for, and ends with ``stop``.

    make: as of ``Worker``; say: is called with each line of progress
    changed: is called when work begins or ends; doing: words for what is done
    failed: is called with why it could not be done
    """

    def __init__(
        self, make: Callable[[Callable[[str], None]], Any], say: Callable[[str], None], changed: Callable[[], None],
        failed: Callable[[Failed], None],
    ):  # fmt: skip
        self._make, self._say, self._changed, self._failed = make, say, changed, failed
        self.doing = list[str]()
        self._worker: Worker | None = None
        self._tasks = set[asyncio.Task[Any]]()

    def later(self, work: Work) -> None:
        """Do this beside what is dragged, until ``stop``; what fails is told."""
        task = asyncio.get_running_loop().create_task(self._done(work))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _done(self, work: Work) -> None:
        try:
            await work()
        except Failed as error:
            self._failed(error)
        except Stopped:
            pass  # by us

    async def ask(self, words: str, method: str, *given: Any) -> Any:
        """What the other process says; Failed if it cannot, Stopped if it was stopped."""
        self._worker = self._worker or Worker(self._make, self._say)
        self.doing.append(words)
        self._changed()
        try:
            return await self._worker.ask(method, *given)
        except Stopped:
            if self._worker is None:
                raise
            self._worker = None  # nobody stopped it
            raise Failed("the process that verifies has ended by itself; the next design begins it anew") from None
        finally:
            self.doing.remove(words)
            self._changed()

    def stop(self) -> None:
        """End what it is at."""
        for task in self._tasks:
            task.cancel()
        if self._worker is not None:
            self._worker.stop()
            self._worker = None
