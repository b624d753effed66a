"""Another process that answers questions one after another, and can be stopped in the middle of one."""

import asyncio
import atexit
import signal
from collections.abc import Callable, Coroutine
from multiprocessing import get_context
from multiprocessing.connection import Connection
from threading import Lock, Thread
from typing import Any

from hopopt.errors import HopoptError, one_line
from hopopt.extensions import carried
from hopopt.studies.faults import Fault, guarded

SAID, DONE, FAILED = "said", "done", "failed"


class Stopped(Exception):
    """The process was stopped before it had answered."""


class Failed(HopoptError):
    """It could not answer, for this reason; ``fault``: where hopopt is at fault, with its traceback."""

    def __init__(self, sentence: str, fault: Fault | None = None):
        self.fault = fault
        super().__init__(sentence)


class Worker:
    """An object of another process; ``make``, a function of a module, returns it there from a function that tells progress.

    say: is called with each line of progress
    """

    def __init__(self, make: Callable[[Callable[[str], None]], Any], say: Callable[[str], None] = lambda text: None):
        here, there = get_context("spawn").Pipe()
        self._pipe, self._say = here, say
        self._pipe_free = Lock()  # of threads: one that was cancelled still waits for its answer
        self._process = get_context("spawn").Process(target=carried(_serve), args=(make, there))
        self._process.start()
        atexit.register(self._process.kill)  # it waits for questions, and would be waited for
        there.close()

    async def ask(self, method: str, *given: Any) -> Any:
        """What a method of the object returns; Failed with its sentence if it raises, Stopped if the process ends."""
        loop = asyncio.get_running_loop()
        answer = loop.create_future()
        Thread(target=self._answer, args=(method, given, loop, answer), daemon=True).start()
        kind, value = await answer
        if kind == DONE:
            return value
        if kind is None:
            raise Stopped
        raise Failed(value.sentence, value) if isinstance(value, Fault) else Failed(value)

    def _answer(
        self, method: str, given: tuple[Any, ...], loop: asyncio.AbstractEventLoop, answer: asyncio.Future[Any]
    ) -> None:
        """Send a question and wait for the answer, in a thread of its own."""
        found: tuple[str | None, Any] = None, None
        try:
            with self._pipe_free:
                self._pipe.send((method, given))
                while (found := self._pipe.recv())[0] == SAID:
                    loop.call_soon_threadsafe(self._say, found[1])
        except Exception:  # the process, or the loop that asked, is no more
            found = None, None
        if not loop.is_closed():
            loop.call_soon_threadsafe(lambda: answer.done() or answer.set_result(found))

    def stop(self) -> None:
        """End the process, whatever it is at."""
        atexit.unregister(self._process.kill)
        self._process.kill()
        self._process.join()
        self._pipe.close()


class Beside:
    """Work in another process beside what is dragged: the process begins when it is asked for, and ends with ``stop``.

    make: as of ``Worker``; say: is called with each line of progress
    at: is called with words for what is done and True when it begins, False when it ends
    failed: is called with why it could not be done
    """

    def __init__(
        self, make: Callable[[Callable[[str], None]], Any], say: Callable[[str], None], at: Callable[[str, bool], None],
        failed: Callable[[Failed], None],
    ):  # fmt: skip
        self._make, self._say, self._at, self._failed = make, say, at, failed
        self._worker: Worker | None = None
        self._tasks = set[asyncio.Task[Any]]()

    def later(self, work: Coroutine[Any, Any, Any]) -> None:
        """Do this beside what is dragged; stopped by the next change."""
        task = asyncio.get_running_loop().create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def ask(self, words: str, method: str, *given: Any) -> Any:
        """What the other process says, None if it was stopped or failed, which is told."""
        self._worker = self._worker or Worker(self._make, self._say)
        self._at(words, True)
        try:
            return await self._worker.ask(method, *given)
        except Stopped:
            if self._worker is not None:  # nobody stopped it
                self._worker = None
                self._failed(Failed("the process that verifies has ended by itself; the next design begins it anew"))
        except Failed as error:
            self._failed(error)
        finally:
            self._at(words, False)
        return None

    def stop(self) -> None:
        """End what it is at."""
        for task in self._tasks:
            task.cancel()
        if self._worker is not None:
            self._worker.stop()
            self._worker = None


def _serve(make: Callable[[Callable[[str], None]], Any], pipe: Connection) -> None:
    """Answer until the other end is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the one who asks
    asked = make(lambda text: pipe.send((SAID, text)))
    while True:
        try:
            method, given = pipe.recv()
        except (EOFError, OSError):
            return
        try:
            found = guarded(getattr(asked, method), *given)
            pipe.send((FAILED if isinstance(found, Fault) else DONE, found))
        except HopoptError as error:
            pipe.send((FAILED, one_line(error)))
