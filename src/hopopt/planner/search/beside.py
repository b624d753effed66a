"""Other processes that search beside this one: they begin while the first start is solved here, and hold the same hop."""

from collections.abc import Callable
from itertools import count
from types import TracebackType
from typing import Any, Generic, TypeVar

from hopopt.design import Design
from hopopt.ocp.hop import Hop
from hopopt.ocp.rules import RULES

T = TypeVar("T")
_numbers, _held = count(), dict[int, Hop]()  # of hops; those that this process works at for another


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
    return Task(lambda: function(*given), _pool_of(more).submit(function, *given) if more > 0 else None)


def _pool_of(more: int) -> Any:
    """So many processes, the same ones for all that asks for as many."""
    from joblib.externals.loky import get_reusable_executor

    return get_reusable_executor(max_workers=more)


class Beside:
    """So many processes more for a hop; with none of them all is done here, with the same results.

    They end when they have had nothing to do for some seconds, and at once when an error or Ctrl-C ends the search.
    """

    def __init__(self, hop: Hop, more: int):
        self.hop, self.more, self._pool, self._number = hop, more, None, next(_numbers)
        if more > 0:
            self._pool = _pool_of(more)
            self._recipe = hop.design.model_dump(exclude_none=True), hop.asked, hop.free_parameters, hop.constraints
            for _ in range(more):
                self._submitted(_nothing, ())

    def task(self, function: Callable[..., T], *given: Any) -> Task[T]:
        """``function(hop, *given)`` as a task."""
        return Task(lambda: function(self.hop, *given), self._submitted(function, given))

    def _submitted(self, function: Callable[..., Any], given: tuple[Any, ...]) -> Any:
        """A future of another process; None where there is none, or no longer: then all is done here."""
        if self._pool is None:
            return None
        from joblib.externals.loky.process_executor import BrokenProcessPool

        try:
            return self._pool.submit(_in_worker, self._number, self._recipe, self.hop.rules, function, given)
        except BrokenProcessPool:
            self._pool = None
            return None

    def __enter__(self) -> "Beside":
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        if kind is not None and self._pool is not None:
            self._pool.shutdown(wait=False, kill_workers=True)


def _nothing(hop: Hop) -> None:
    """So that a process imports what it needs before there is work for it."""


def _in_worker(
    number: int, recipe: tuple[Any, ...], rules: Any, function: Callable[..., T], given: tuple[Any, ...]
) -> T:
    if number not in _held:
        RULES[:] = rules  # what was added to them this process does not know
        _held.clear()
        _held[number] = Hop(Design.model_validate(recipe[0]), *recipe[1:])
    return function(_held[number], *given)
