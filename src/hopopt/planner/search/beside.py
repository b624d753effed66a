"""Other processes that search beside this one: they begin while the first start is solved here, and hold the same hop."""

import atexit
import gc
import os
import signal
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from itertools import count
from queue import Empty
from types import TracebackType
from typing import Any, Generic, TypeVar

from hopopt.design import Design
from hopopt.extensions import carried
from hopopt.nlp.solver.compiled import make_library, missing
from hopopt.ocp.hop import Hop

T = TypeVar("T")
LONGEST_IDLE = 10.0  # s after which a process that has nothing to do ends
_numbers, _held = count(), dict[int, Hop]()  # of hops; those that this process works at for another
_pools = dict[int, Any]()  # of processes, by how many they are


class Task(Generic[T]):
    """Something to be done to a hop, in another process or, if none of them has begun it, in this one.

    do: does it here; future: of another process, or None if there is none
    """

    def __init__(self, do: Callable[[], T], future: Any):
        self._do, self._future = do, future
        self._done: list[T] = []

    def done_here(self) -> bool:
        """Do it here and now, unless another process has begun it; whether it was done here."""
        if self._done or (self._future is not None and not self._future.cancel()):
            return False
        self._done.append(self._do())
        return True

    def result(self) -> T:
        """What came of it; here and now, if no process has begun it, or one has died at it."""
        if self.done_here() or self._done:
            return self._done[0]
        from joblib.externals.loky.process_executor import BrokenProcessPool

        try:
            return self._future.result()
        except BrokenProcessPool:
            self._done.append(self._do())
            return self._done[0]


def ahead(function: Callable[..., T], *given: Any, more: int) -> Task[T]:
    """``function(*given)`` as a task for one of so many more processes."""
    return Task(lambda: function(*given), _submitted(_pool_of(more), function, given) if more > 0 else None)


def make_missing(processes: int | None) -> None:
    """Let other processes, where there are any, make libraries that were missing here; nobody waits for them."""
    more = (processes or os.cpu_count() or 1) - 1
    for serialized in missing() if more > 0 else []:
        _submitted(_pool_of(more), make_library, (serialized,))


def _submitted(pool: Any, function: Callable[..., Any], given: tuple[Any, ...]) -> Any:
    """A future of another process; None if one of them has died: then it is done here."""
    from joblib.externals.loky.process_executor import BrokenProcessPool

    try:
        return pool.submit(carried(function), *given)
    except BrokenProcessPool:
        _given_up(pool)
        return None


def _pool_of(more: int) -> Any:
    """So many processes, the same ones for all that asks for as many; not joblib's own, which others divide work with."""
    if more not in _pools:
        from joblib.externals.loky import ProcessPoolExecutor

        alone = {"OMP_NUM_THREADS": "1"}
        begin = {"initializer": begin_worker, "initargs": (os.getpid(),)}
        _pools[more] = pool = ProcessPoolExecutor(more, timeout=LONGEST_IDLE, env=alone, **begin)
        atexit.register(_given_up, pool)  # before Python takes apart what its threads still need
    return _pools[more]


def begin_worker(parent: int) -> None:
    """Leave Ctrl-C to the parent, and end with it even if it is killed, be it before this worker has begun."""
    gc.set_threshold(100_000)  # as in the parent (cli/main.py)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with, args=(parent,), daemon=True).start()


def _end_with(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(0.5)
    os._exit(1)


def _given_up(pool: Any) -> None:
    """End what is left of processes of which one died, or whose work nobody waits for."""
    for more in [more for more, kept in _pools.items() if kept is pool]:
        del _pools[more]
    end_at_once(pool, wait=False)


def end_at_once(pool: Any, wait: bool = True) -> None:
    """Kill a pool's processes, whatever they are at.

    pool: joblib's, of processes; wait: until they have ended
    """
    with suppress(Empty):  # its thread would look for work that it has just given up, and complain
        while True:
            pool._work_ids.get_nowait()
    pool.shutdown(wait=wait, kill_workers=True)


class Beside:
    """So many processes more for a hop; with none of them all is done here, with the same results.

    They end when they have had nothing to do for some seconds, and at once when an error or Ctrl-C ends the search.
    """

    def __init__(self, hop: Hop, more: int):
        self.hop, self._pool, self._number = hop, _pool_of(more) if more > 0 else None, next(_numbers)
        if self._pool is not None:
            self._recipe = hop.design.model_dump(exclude_none=True), hop.asked, hop.free_parameters, hop.constraints
            for _ in range(more):
                self._submitted(_nothing, ())

    def task(self, function: Callable[..., T], *given: Any) -> Task[T]:
        """``function(hop, *given)`` as a task."""
        return Task(lambda: function(self.hop, *given), self._submitted(function, given))

    def _submitted(self, function: Callable[..., Any], given: tuple[Any, ...]) -> Any:
        """A future of another process; None where there is none: then it is done here."""
        if self._pool is None:
            return None
        return _submitted(self._pool, _in_worker, (self._number, self._recipe, function, given))

    def __enter__(self) -> "Beside":
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        if kind is not None and self._pool is not None:
            _given_up(self._pool)


def _nothing(hop: Hop) -> None:
    """So that a process imports what it needs before there is work for it."""


def _in_worker(number: int, recipe: tuple[Any, ...], function: Callable[..., T], given: tuple[Any, ...]) -> T:
    if number not in _held:
        _held.clear()
        _held[number] = Hop(Design.model_validate(recipe[0]), *recipe[1:])
    return function(_held[number], *given)
