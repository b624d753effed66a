"""Compiled loops kept on disk: loaded if whole, compiled again if not, and never a reason to fail."""

import errno
import gc
import importlib.util
import os
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
from numba.core import compiler
from numba.core import config as numba_config

from hopopt.compiled import kernel_cache
from hopopt.compiled.kernel import LEVEL, kernel

config: Any = numba_config  # whose entries type checkers do not know


@pytest.fixture
def function(tmp_path: Path) -> Callable[[float], float]:
    """Of a module whose cache lies beside it."""
    (tmp_path / "loops.py").write_text("def f(x):\n    return 2.0 * x + 1.0\n")
    return executed(tmp_path / "loops.py").f


def executed(path: Path) -> Any:
    """The module in a file."""
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def loaded(made: Any) -> bool:
    """Whether its machine code for 3.0 came from disk; that the answer is right."""
    assert made(3.0) == 7.0
    return bool(made.compiled.stats.cache_hits)


def damaged(content: bytes) -> list[bytes]:
    middle = len(content) // 2
    return [content[:middle], b"", b"foreign", content[:middle] + bytes([content[middle] ^ 1]) + content[middle + 1 :]]


@pytest.mark.parametrize("suffix", [".nbi", ".nbc"])
def test_what_is_damaged_is_compiled_again(suffix: str, function: Callable[..., float], tmp_path: Path) -> None:
    assert not loaded(kernel(function))
    assert loaded(kernel(function))
    (path,) = tmp_path.rglob(f"*{suffix}")
    for content in damaged(path.read_bytes()):
        path.write_bytes(content)
        assert not loaded(kernel(function))
        assert loaded(kernel(function))
    assert not list(tmp_path.rglob(".*@*"))


def test_a_file_of_another_function_is_not_taken_for_it(function: Callable[..., float], tmp_path: Path) -> None:
    """As after an end between the writing of numba's index and of its data."""
    made = kernel(function)
    assert made(3.0) == 7.0
    first = next(tmp_path.rglob("*.1.nbc")).read_bytes()
    assert made(3) == 7  # whole numbers: another machine code
    next(tmp_path.rglob("*.2.nbc")).write_bytes(first)
    again = kernel(function)
    assert again(3) == 7
    assert not again.compiled.stats.cache_hits


def test_the_level_of_a_callers_own_functions_stays(
    function: Callable[..., float], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also where two threads compile at once, both at the level of the kernels."""
    monkeypatch.setattr(config, "OPT", type(config.OPT)(3))
    before, levels, compiled = config.OPT, list[int](), compiler.compile_extra
    monkeypatch.setattr(
        compiler, "compile_extra", lambda *given, **more: levels.append(int(config.OPT)) or compiled(*given, **more)
    )
    made = [kernel(function) for _ in range(2)]
    with ThreadPoolExecutor(2) as pool:
        assert list(pool.map(lambda one: one(3.0), made)) == [7.0, 7.0]
    assert set(levels) == {LEVEL}
    assert config.OPT is before


def test_what_python_calls_and_what_compiled_functions_call_are_kept_apart(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And a constant is a number like others: nothing is compiled for it alone."""
    (tmp_path / "both.py").write_text(
        "def of(n):\n    return n + 1\n\ndef twice(n):\n    return called(n) + called(1)\n"
    )
    for kept in (False, True):
        module = executed(tmp_path / "both.py")
        monkeypatch.setitem(sys.modules, "both", module)  # numba looks for it where it has forgotten what was compiled
        module.called = inner = kernel(module.of)
        outer = kernel(module.twice)
        assert (outer(3), inner(3)) == (6, 4)
        assert len(inner.called.signatures) == (0 if kept else 1)
        assert bool(outer.compiled.stats.cache_hits) is bool(inner.compiled.stats.cache_hits) is kept
        del inner, outer, module
        gc.collect()


def test_a_full_disk_is_no_reason_to_fail(function: Callable[..., float], monkeypatch: pytest.MonkeyPatch) -> None:
    def no_room(descriptor: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "fsync", no_room)
    assert not loaded(kernel(function))
    assert not loaded(kernel(function))


def test_numbers_of_another_file_are_sources_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A compiled function holds them; files of packages without such functions do not count."""
    monkeypatch.setattr(kernel_cache, "PACKAGE", tmp_path)
    for name, text in {"fast/loops.py": "@kernel", "fast/numbers.py": "SLOW = 1", "other/words.py": "WORD = 1"}.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    before = kernel_cache._sources.__wrapped__()
    (tmp_path / "other/words.py").write_text("WORD = 2")
    assert kernel_cache._sources.__wrapped__() == before
    (tmp_path / "fast/numbers.py").write_text("SLOW = 2")
    assert kernel_cache._sources.__wrapped__() != before
