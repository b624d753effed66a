"""Any single entry of a result that is altered, drawn at random, is told: the exit code is not 0, and nothing is sealed."""

import json
import os
import random
import shutil
from collections.abc import Callable, Iterator
from math import inf, nextafter
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from hopopt.cli.main import run
from hopopt.planner.checks.verdict import Verdict
from hopopt.planner.solution import Solution
from hopopt.storage.seal import recheck as recheck_module
from hopopt.storage.seal.digests import DATA, MANIFEST, digests
from hopopt.storage.seal.recheck import recheck
from hopopt.storage.solution import read, save

SEED = 52
FEW, MANY = 40, int(os.environ.get("HOPOPT_ALTERATIONS", "300"))  # 2000 before a release
Alter = Callable[[Path, random.Random], str]


def other(value: Any, rng: random.Random) -> Any:
    """A value that differs from the one given, if by the last digit alone."""
    if isinstance(value, bool) or value is None:
        return not value
    if isinstance(value, int | float):
        return rng.choice([value + 1, -value - 1, nextafter(value, inf), 1.01 * value + 1e-12])
    if isinstance(value, str):
        return value + "x" if value else "x"
    return {} if value else [1.0]


def places(data: Any, way: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """The way to every entry of JSON data, and to every entry of an entry."""
    items = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    for key, value in items:
        yield (*way, key)
        yield from places(value, (*way, key))


def altered_json(path: Path, rng: random.Random) -> str:
    data = json.loads(path.read_text(encoding="utf-8"))
    *way, last = rng.choice(list(places(data)))
    owner = data
    for key in way:
        owner = owner[key]
    how = rng.choice(["other", "other", "other", "gone", "more"])
    if how == "gone":
        del owner[last]
    elif how == "more" and isinstance(owner, dict):
        owner[f"{last}_"] = owner[last]
    else:
        owner[last] = other(owner[last], rng)
    path.write_text(json.dumps(data, indent=2) + "\n", encoding="utf-8")
    return f"{how} {'.'.join(map(str, (*way, last)))}"


def altered_lines(path: Path, rng: random.Random) -> str:
    lines = path.read_text(encoding="utf-8").splitlines()
    at = rng.choice([k for k, line in enumerate(lines) if "=" in line])
    was = lines[at]
    name, _, value = was.partition("=")
    lines[at] = rng.choice([f"# {was}", f"{name}= {rng.randint(2, 9)}{value.strip()}"])
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return f"{was} -> {lines[at]}"


def altered_arrays(path: Path, rng: random.Random) -> str:
    with h5py.File(path, "r+") as file:
        found: list[Any] = []
        file.visititems(lambda name, item: found.append(item) if isinstance(item, h5py.Dataset) and item.size else None)
        chosen = rng.choice(found)
        if rng.random() < 0.1:
            name = chosen.name
            del file[name]
            return f"gone {name}"
        if rng.random() < 0.1 and (named := [key for key in chosen.attrs if key in ("units", "long_name")]):
            chosen.attrs[named[0]] = f"{chosen.attrs[named[0]]}x"
            return f"{chosen.name} {named[0]}"
        at = np.unravel_index(rng.randrange(chosen.size), chosen.shape)
        was = chosen[at]
        words = isinstance(was, bytes | str)
        new = "other" if words else 0.5 if not np.isfinite(was) else other(was.item(), rng)
        chosen[at] = new
        if not words and chosen[at] == was:  # of a whole number, whose last digit is not that of a float
            chosen[at] = was + 1
        return f"{chosen.name}{list(map(int, at))}: {was} -> {chosen[at]}"


WAYS: dict[str, Alter] = {
    "summary.json": altered_json, MANIFEST: altered_json, "problem.toml": altered_lines, "solution.nc": altered_arrays,
}  # fmt: skip
WEIGHTS = (5, 2, 1, 4)


@pytest.fixture(scope="module")
def stored(hop: Solution, tmp_path_factory: pytest.TempPathFactory) -> Path:
    found = save(hop, tmp_path_factory.mktemp("results")).result_dir
    assert found
    return found


@pytest.fixture(scope="module")
def verdict(stored: Path) -> Verdict:
    found = recheck(read(stored))
    assert found.verified
    return found


@pytest.fixture
def nothing_else_notices(verdict: Verdict, monkeypatch: pytest.MonkeyPatch) -> None:
    """The hardest case, and a cheap one: all that is computed again of an altered result is as it was stated."""
    monkeypatch.setattr(recheck_module, "_recheck", lambda solution: verdict)


def told(folder: Path, capsys: pytest.CaptureFixture[str]) -> tuple[int, str]:
    """Exit code of hopopt verify, and what it says; nothing is written."""
    files = [*DATA, MANIFEST]
    before = digests(folder, files)
    code = run(["verify", str(folder), "--json"])
    assert digests(folder, files) == before
    return code, capsys.readouterr().err


def each(stored: Path, count: int, seed: int, work: Path) -> Iterator[tuple[Path, str, str]]:
    """So many altered copies of a result, one after the other, each with the file and what was done to it."""
    rng = random.Random(seed)
    for k in range(count):
        copy = Path(shutil.copytree(stored, work / str(k)))
        (file,) = rng.choices(list(WAYS), WEIGHTS)
        yield copy, file, WAYS[file](copy / file, rng)
        shutil.rmtree(copy)


def all_told(stored: Path, count: int, work: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert told(stored, capsys) == (0, "")
    for copy, file, how in each(stored, count, SEED, work):
        code, said = told(copy, capsys)
        assert code in (2, 3), (file, how)
        assert file in said, (file, how, said)
    assert told(stored, capsys) == (0, "")


@pytest.mark.slow
@pytest.mark.usefixtures("nothing_else_notices")
def test_an_altered_entry_is_told(stored: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    all_told(stored, FEW, tmp_path, capsys)


@pytest.mark.rarely
@pytest.mark.usefixtures("nothing_else_notices")
def test_many_altered_entries_are_told(stored: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    all_told(stored, MANY, tmp_path, capsys)


@pytest.mark.slow
@pytest.mark.parametrize("count", [3, pytest.param(12, marks=pytest.mark.rarely)])
def test_altered_entries_are_told_where_all_is_computed_again(
    count: int, stored: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """What is damaged must not stop what is computed again before it is told; the digests, which tell it, are tried above."""
    for copy, file, how in each(stored, count, SEED + 1, tmp_path):
        code, said = told(copy, capsys)
        assert code in (2, 3), (file, how)
        assert file in said, (file, how, said)


@pytest.mark.parametrize(
    ("file", "entry", "change"),
    [
        ("summary.json", "starts", lambda data: data["starts"].update(count=5000)),
        ("summary.json", "starts", lambda data: data["starts"].update(chosen="swing")),
        ("summary.json", "mesh", lambda data: data["mesh"][0].update(objective=0.1)),
        ("summary.json", "exit_code", lambda data: data.update(exit_code=3)),
        ("summary.json", "wall_s", lambda data: data.update(wall_s=0.0)),
        (MANIFEST, "versions", lambda data: data["versions"].update(casadi="9")),
    ],
)
@pytest.mark.usefixtures("nothing_else_notices")
def test_what_only_the_search_knew_is_named_when_it_was_altered(
    stored: Path,
    tmp_path: Path,
    file: str,
    entry: str,
    change: Callable[[Any], None],
    capsys: pytest.CaptureFixture[str],
) -> None:
    copy = Path(shutil.copytree(stored, tmp_path / "copy"))
    data = json.loads((copy / file).read_text())
    change(data)
    (copy / file).write_text(json.dumps(data))
    assert told(copy, capsys) == (
        3,
        f"hopopt: {file} was changed after it was written: {entry} (its digest differs from {MANIFEST})\n",
    )
