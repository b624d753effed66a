"""CasADi's solvers of nonlinear programs, called so that signals and errors of callbacks are heeded.

While such a solver works, CasADi lets Python's signal handlers run. What one raised, as KeyboardInterrupt at Ctrl-C, would be
swallowed, or told as a SystemError, depending on solver and versions. So it is kept, the solver is stopped at its next
iteration, and then it is raised.
"""

import signal
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from types import FrameType
from typing import Any

import casadi as ca


class IterationCallback(ca.Callback):
    """Asked by a solver at each iteration whether to stop: if ``stops`` says so, or an error was raised.

    size: of the program's variables; rows: of its constraints; error: the first that a signal's handler or ``stops`` raised
    during the last solve, or None.
    """

    def __init__(self, size: int, rows: int):
        ca.Callback.__init__(self)
        self.size, self.rows = size, rows
        self.error: BaseException | None = None
        self.construct("at_iteration", {})

    def stops(self, values: Mapping[str, Any]) -> bool:
        """Whether to stop at the iterate with these outputs of a solver, by CasADi's names."""
        return False

    def run(self, function: Callable[..., Any], *given: Any) -> Any:
        """What the function gives; None, and its error kept, if it raises one."""
        try:
            return function(*given)
        except BaseException as error:
            self.error = self.error or error

    def get_n_in(self) -> int:
        """CasADi: as many inputs as a solver has outputs."""
        return ca.nlpsol_n_out()

    def get_n_out(self) -> int:
        """CasADi: one output, whether to stop."""
        return 1

    def get_sparsity_in(self, i: int) -> ca.Sparsity:
        """CasADi: shapes of a solver's outputs."""
        name = ca.nlpsol_out(i)
        sizes = {"f": 1, "x": self.size, "lam_x": self.size, "g": self.rows, "lam_g": self.rows}
        return ca.Sparsity.dense(sizes[name]) if name in sizes else ca.Sparsity(0, 0)

    def eval(self, arg: Sequence[Any]) -> list[int]:
        """CasADi: [1] to stop, [0] to go on."""
        values = dict(zip((ca.nlpsol_out(i) for i in range(len(arg))), arg, strict=True))
        stop = self.run(self.stops, values)
        return [int(bool(stop) or self.error is not None)]


class CasadiSolver:
    """One of CasADi's ``nlpsol``, to be called as that is; raises what its callback or a signal's handler raised."""

    def __init__(
        self,
        plugin: str,
        program: Mapping[str, Any],
        options: Mapping[str, Any],
        callback: IterationCallback | None = None,
    ):
        rows = program["g"].numel() if "g" in program else 0
        self.callback = callback or IterationCallback(program["x"].numel(), rows)
        self._solver = ca.nlpsol("hopopt", plugin, dict(program), {**options, "iteration_callback": self.callback})

    def __call__(self, **given: Any) -> dict[str, ca.DM]:
        self.callback.error = None
        try:
            with _signals_told(self.callback):
                return self._solver(**given)
        finally:
            if self.callback.error is not None:  # whatever the solver raised then
                raise self.callback.error

    def stats(self) -> dict[str, Any]:
        """CasADi's account of the last call."""
        return self._solver.stats()


@contextmanager
def _signals_told(callback: IterationCallback) -> Iterator[None]:
    """Within it the callback keeps what Python's signal handlers raise; they run in the main thread alone."""
    here = threading.current_thread() is threading.main_thread()
    handlers = {n: h for n in signal.valid_signals() if callable(h := signal.getsignal(n))} if here else {}

    def told(handler: Callable[[int, FrameType | None], Any]) -> Callable[[int, FrameType | None], None]:
        return lambda number, frame: callback.run(handler, number, frame)

    try:
        for number, handler in handlers.items():
            signal.signal(number, told(handler))
        yield
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
