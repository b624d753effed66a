"""Another process that answers questions one after another, and can be stopped in the middle of one."""

import asyncio
import atexit
import os
import signal
from collections.abc import Callable
from contextlib import suppress
from multiprocessing import get_context
from multiprocessing.connection import Connection
from threading import Lock, Thread
from typing import Any

from hopopt.errors import HopoptError, one_line
from hopopt.extensions import carried
from hopopt.studies.faults import Fault, guarded

SAID, DONE, FAILED, LEFT = "said", "done", "failed", "left"
LEAVE = getattr(signal, "SIGUSR1", None)  # tells the process to leave a question; a system without it waits for answers


class Stopped(Exception):
    """The process was stopped before it had answered."""


class Left(Exception):
    """The question was left before it was answered, as it was asked to be."""


class _Leave(BaseException):
    """In the other process: the answer is no longer wanted."""


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
        spawn = get_context("spawn")
        here, there = spawn.Pipe()
        self._pipe, self._say = here, say
        self._pipe_free = Lock()  # of threads: one that was cancelled still waits for its answer
        self._count, self._method = 0, ""  # of questions; of the one that is being answered
        self._unwanted = spawn.RawValue("q", 0)  # number of the question that is to be left
        self._process = spawn.Process(target=carried(_serve), args=(make, there, self._unwanted))
        self._process.start()
        atexit.register(self._process.kill)  # it waits for questions, and would be waited for
        there.close()

    async def ask(self, method: str, *given: Any) -> Any:
        """What a method of the object returns; Failed with its sentence if it raises, Stopped if the process ends, Left if
        ``leave`` was called meanwhile."""
        loop = asyncio.get_running_loop()
        answer = loop.create_future()
        Thread(target=self._answer, args=(method, given, loop, answer), daemon=True).start()
        kind, value = await answer
        if kind == DONE:
            return value
        if kind is None:
            raise Stopped
        if kind == LEFT:
            raise Left
        raise Failed(value.sentence, value) if isinstance(value, Fault) else Failed(value)

    def _answer(
        self, method: str, given: tuple[Any, ...], loop: asyncio.AbstractEventLoop, answer: asyncio.Future[Any]
    ) -> None:
        """Send a question and wait for the answer, in a thread of its own."""
        found: tuple[str | None, Any] = None, None
        try:
            with self._pipe_free:
                self._count, self._method = self._count + 1, method
                self._pipe.send((method, given))
                while (found := self._pipe.recv())[0] == SAID:
                    loop.call_soon_threadsafe(self._say, found[1])
                self._method = ""
        except Exception:  # the process, or the loop that asked, is no more
            found = None, None
        if not loop.is_closed():
            loop.call_soon_threadsafe(lambda: answer.done() or answer.set_result(found))

    def leave(self, *methods: str) -> None:
        """Leave the question that is being answered, if it is to one of these methods; not the first, which may find the
        process not ready."""
        number = self._count
        if LEAVE is None or self._process.pid is None or self._unwanted.value == number:
            return
        if number > 1 and self._method in methods:
            self._unwanted.value = number
            with suppress(ProcessLookupError):
                os.kill(self._process.pid, LEAVE)

    def stop(self) -> None:
        """End the process, whatever it is at."""
        atexit.unregister(self._process.kill)
        self._process.kill()
        self._process.join()
        self._pipe.close()


def _serve(make: Callable[[Callable[[str], None]], Any], pipe: Connection, unwanted: Any) -> None:
    """Answer until the other end is closed; leave the question whose number is ``unwanted``."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the one who asks
    answered = number = 0

    def leave(*_: Any) -> None:
        if answered < number == unwanted.value:
            raise _Leave

    if LEAVE is not None:
        signal.signal(LEAVE, leave)
    asked = make(lambda text: pipe.send((SAID, text)))
    while True:
        try:
            method, given = pipe.recv()
        except (EOFError, OSError):
            return
        try:
            number += 1
            reply = _reply(asked, method, given)
            answered = number
        except _Leave:
            answered, reply = number, (LEFT, None)
        pipe.send(reply)


def _reply(asked: Any, method: str, given: tuple[Any, ...]) -> tuple[str, Any]:
    try:
        found = guarded(getattr(asked, method), *given)
    except HopoptError as error:
        return FAILED, one_line(error)
    return (FAILED if isinstance(found, Fault) else DONE), found
