"""A solver at work heeds signals, and its errors are told apart from them."""

import os
import signal
import threading
from collections.abc import Callable
from types import FrameType
from typing import Any, Never

import casadi as ca
import numpy as np
import pytest

from hopopt.errors import NotSolvedError
from hopopt.nlp.mesh import uniform
from hopopt.nlp.schemes import radau
from hopopt.nlp.solver.casadi_solver import CasadiSolver
from hopopt.nlp.solver.ipopt import FOREIGN, OPTIONS, NlpSolver
from hopopt.nlp.solver.known_optima import Known, KnownOptima
from hopopt.nlp.transcription import Transcription
from known_problems import bryson_denham, guesses

SOON = 0.05  # s, in which no solver ends here


class Stopped(Exception):
    pass


def stop(number: int, frame: FrameType | None) -> Never:
    raise Stopped


def endless(plugin: str, options: dict[str, Any]) -> CasadiSolver:
    """A valley of 400 variables, which takes many iterations."""
    x = ca.MX.sym("x", 400)
    f = ca.sum1(100 * (x[1:] - x[:-1] ** 2) ** 2 + (1 - x[:-1]) ** 2)
    return CasadiSolver(plugin, {"x": x, "f": f}, options)


@pytest.mark.parametrize("plugin", ["ipopt", "uno"])
@pytest.mark.parametrize(
    ("number", "handler", "raised"),
    [(signal.SIGINT, signal.default_int_handler, KeyboardInterrupt), (signal.SIGTERM, stop, Stopped)],
)
def test_what_a_signals_handler_raises_ends_the_solve(
    plugin: str, number: signal.Signals, handler: Callable[..., Any], raised: type[BaseException]
) -> None:
    if not ca.has_nlpsol(plugin):
        pytest.skip(f"{plugin} is not part of this CasADi")
    options = {**OPTIONS, "ipopt.max_iter": 10**6} if plugin == "ipopt" else {"print_time": False}
    solver, before = endless(plugin, options), signal.signal(number, handler)
    try:
        threading.Timer(SOON, os.kill, (os.getpid(), number)).start()
        with pytest.raises(raised):
            solver(x0=np.full(400, -1.2))
        assert signal.getsignal(number) is handler
    finally:
        signal.signal(number, before)


def test_outside_the_main_thread_a_solver_works_too() -> None:
    """Where no handler may be set; signals are heeded in the main thread."""
    x = ca.MX.sym("x")
    solver, found = CasadiSolver("ipopt", {"x": x, "f": (x - 2) ** 2}, OPTIONS), []
    thread = threading.Thread(target=lambda: found.append(float(solver(x0=0)["x"])))
    thread.start()
    thread.join()
    assert found == [pytest.approx(2)]


@pytest.fixture
def program() -> Transcription:
    return Transcription(bryson_denham().problem, radau(3), {"move": uniform(6)})


def test_an_error_beside_ipopt_is_no_interrupt(program: Transcription, monkeypatch: pytest.MonkeyPatch) -> None:
    account = CasadiSolver.stats
    monkeypatch.setattr(CasadiSolver, "stats", lambda s: {**account(s), "return_status": FOREIGN})
    with pytest.raises(NotSolvedError, match="an error in what it calls"):
        NlpSolver(program)(guesses(bryson_denham()))


@pytest.mark.parametrize("error", [ZeroDivisionError, KeyboardInterrupt, SystemExit])
def test_an_error_in_what_ipopt_asks_at_an_iteration_keeps_its_kind(
    error: type[BaseException],
    program: Transcription,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    def near(*_: object) -> Never:
        raise error

    monkeypatch.setattr(KnownOptima, "near", near)
    watch = KnownOptima(len(program.scale), program.lbg, program.ubg, np.arange(2))
    watch.known.append(Known(np.zeros(len(program.scale)), 0.0))
    with pytest.raises(error):
        NlpSolver(program, known=watch)(guesses(bryson_denham()))
    assert capfd.readouterr() == ("", "")


def test_what_a_handler_raised_is_told_though_the_solver_fails_too(monkeypatch: pytest.MonkeyPatch) -> None:
    x = ca.MX.sym("x")
    solver = CasadiSolver("ipopt", {"x": x, "f": x**2}, OPTIONS)

    def failing(**given: Any) -> Never:
        solver.callback.run(stop, 0, None)
        raise RuntimeError("the solver's own")

    monkeypatch.setattr(solver, "_solver", failing)
    with pytest.raises(Stopped):
        solver(x0=0)
