"""Compiled functions: the same digits, made only when asked for, and never a reason to fail."""

import errno
import os
from pathlib import Path
from time import monotonic, sleep

import casadi as ca
import numpy as np
import pytest

from hopopt.api import sweep
from hopopt.errors import NotSolvedError
from hopopt.nlp.solver import compiled as module
from hopopt.nlp.solver.compiled import FOLDER, WORTH_IT, compiled, compiling, make_library, missing
from hopopt.ocp.hop import Hop
from hopopt.planner.search import beside
from hopopt.planner.search.multistart import run_chunk
from hopopt.planner.solve import solve
from hopopt.problem.load import load


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv(FOLDER, str(tmp_path / "cache"))
    return tmp_path / "cache"


def long_function(steps: int = WORTH_IT) -> ca.Function:
    x = ca.SX.sym("x", 3)
    y = x
    for _ in range(steps // 3):
        y = ca.sin(y) * 1.1 + x / 3
    return ca.Function("f", [x], [y])


def no_room() -> None:
    raise OSError(errno.ENOSPC, "No space left on device")


def is_library(f: ca.Function) -> bool:
    return "External" in str(f)


def test_same_digits(cache: Path) -> None:
    f = long_function()
    with compiling():
        library = compiled(f)
    assert is_library(library)
    for x in np.random.default_rng(0).normal(size=(20, 3)):
        np.testing.assert_array_equal(np.array(f(x)), np.array(library(x)))


def test_libraries_are_made_only_within_compiling_and_used_everywhere(cache: Path) -> None:
    f = long_function()
    assert compiled(f) is f
    assert not cache.exists()
    with compiling():
        compiled(f)
    (library,) = cache.iterdir()  # and nothing half done beside it
    assert library.suffix == ".so"
    assert not library.stat().st_mode & 0o077
    assert is_library(compiled(f))
    assert not is_library(compiled(long_function(2 * WORTH_IT)))  # another function has no library


def test_the_folder_holds_no_more_than_is_allowed(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What was not used for longest goes first; what is used stays."""
    used, unused, new = (long_function(k * WORTH_IT) for k in (1, 3, 2))
    with compiling():
        compiled(used)
        compiled(unused)
        for library in cache.iterdir():
            os.utime(library, (0, 0))
        compiled(used)
        monkeypatch.setattr(module, "MOST_BYTES", sum(path.stat().st_size for path in cache.iterdir()))
        compiled(new)
    assert [is_library(compiled(f)) for f in (used, unused, new)] == [True, False, True]


def test_short_functions_stay(cache: Path) -> None:
    f = long_function(30)
    with compiling():
        assert compiled(f) is f


def test_it_can_be_turned_off(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(FOLDER, "off")
    f = long_function()
    with compiling():
        assert compiled(f) is f


@pytest.mark.parametrize("fault", ["no compiler", "broken compiler", "no room", "not a folder", "others may write"])
def test_whatever_fails_the_function_stays(fault: str, cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    f = long_function()
    if fault == "no compiler":
        monkeypatch.setenv("PATH", str(cache))
    if fault == "broken compiler":
        (tools := cache.parent / "tools").mkdir()
        (tools / "cc").write_text("#!/bin/sh\nexit 1\n")
        (tools / "cc").chmod(0o755)
        monkeypatch.setenv("PATH", f"{tools}:/usr/bin:/bin")
    if fault == "no room":
        monkeypatch.setattr(os, "fsync", lambda descriptor: no_room())
    if fault == "not a folder":
        cache.write_text("")
    if fault == "others may write":
        cache.mkdir()
        cache.chmod(0o777)
    with compiling():
        assert compiled(f) is f


DAMAGE = {
    "truncated": lambda content: content[: len(content) // 2],
    "empty": lambda content: b"",
    "foreign": lambda content: b"no library",
    "one bit": lambda content: content[:5000] + bytes([content[5000] ^ 1]) + content[5001:],
}


@pytest.mark.parametrize("damage", DAMAGE)
def test_a_damaged_library_is_not_loaded_but_made_again(damage: str, cache: Path) -> None:
    f, x = long_function(3 * WORTH_IT), np.array([0.1, 0.2, 0.3])
    with compiling():
        compiled(f)
    (library,) = cache.iterdir()
    whole = library.read_bytes()
    library.write_bytes(DAMAGE[damage](whole))
    assert compiled(f) is f
    with compiling():
        again = compiled(f)
    assert is_library(again)
    np.testing.assert_array_equal(np.array(f(x)), np.array(again(x)))
    (library,) = cache.iterdir()
    assert library.stat().st_size > len(whole) // 2


def test_a_hop_is_solved_to_the_same_digits(cache: Path) -> None:
    first = run_chunk(Hop(load("paper"), "clearance"), [0])[0]
    with compiling():
        second = run_chunk(Hop(load("paper"), "clearance"), [0])[0]
    assert list(cache.iterdir())
    assert second.iterations == first.iterations
    np.testing.assert_array_equal(second.vectors["z"], first.vectors["z"])


@pytest.mark.slow
def test_a_hop_that_cannot_be_is_explained_with_compiled_derivatives(cache: Path) -> None:
    """What limits conflict is found by a program made of the same derivatives."""
    design = load("paper", {"hop.stance_duration": [0.02, 0.03], "hop.flight_duration": [0.6, 1.0]})
    with compiling(), pytest.raises(NotSolvedError, match="cannot hold together"):
        solve(design, starts=1, processes=1)
    assert list(cache.iterdir())


@pytest.mark.slow
def test_a_study_compiles_what_its_points_share(cache: Path, tmp_path: Path) -> None:
    """And says the same as without; where points have programs of their own, nothing is compiled."""
    design = load("paper", {"hop.stance_duration": [0.03, 0.2]})
    study = sweep(design, {"leg.gear.ratio": [100.0]}, starts=1, processes=1, results=tmp_path / "a")
    assert len(list(cache.iterdir())) > 1
    assert study.points[0].clearance_m == solve(design, starts=1, processes=1).clearance
    made = set(cache.iterdir())
    sweep(design, {"contact.friction": [0.9]}, starts=1, processes=1, results=tmp_path / "b")
    assert set(cache.iterdir()) == made


def test_what_was_missing_is_made_later_the_longest_first(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    missing()  # of other tests
    short, long = long_function(4 * WORTH_IT), long_function(5 * WORTH_IT)  # which no test has failed to make
    for f in (short, long, short):
        assert compiled(f) is f
    wanted = missing()
    assert [len(serialized) for serialized in wanted] == [len(long.serialize()), len(short.serialize())]
    assert missing() == []
    for serialized in wanted:
        make_library(serialized)
    assert is_library(compiled(short))
    assert is_library(compiled(long))
    assert missing() == []
    compiled(long_function(6 * WORTH_IT))
    monkeypatch.setenv("PATH", str(cache))  # without a compiler
    assert missing() == []


@pytest.mark.rarely
def test_a_search_has_missing_libraries_made_in_another_process(cache: Path) -> None:
    """And a search that has no other process makes none."""
    design = load("paper")
    solve(design, starts=2, processes=1)
    assert not cache.exists()
    for pool in list(beside._pools.values()):
        beside._given_up(pool)  # it knows another cache
    solve(design, starts=2, processes=2)
    until = monotonic() + 300
    while not list(cache.glob("*.so")):
        assert monotonic() < until, "no library was made"
        sleep(0.1)
