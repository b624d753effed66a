"""Two commands that begin or end at the same moment: each has a folder of its own, whole, and nothing is lost."""

import json
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from joblib import Parallel, delayed

from hopopt.evidence.families import one_entry
from hopopt.evidence.families import open_folder as open_families
from hopopt.evidence.local_optima import open_study as open_evidence
from hopopt.problem.load import load
from hopopt.storage.folder import new_folder, new_work_folder, prepare, published
from hopopt.storage.runs import save_runs
from hopopt.studies.sweep.definition import define
from hopopt.studies.sweep.store import open_folder as open_sweep

EACH = 20  # folders of each process
VARY = {"leg.gear.ratio": [90.0, 100.0]}


def save_a_run(results: Path, who: int) -> None:
    folder = save_runs("simulation", load("paper"), {"who": who}, {}, results)
    assert json.loads((folder / "simulation.json").read_text(encoding="utf-8"))["who"] == who


WRITERS: dict[str, Callable[[Path, int], object]] = {
    "runs": save_a_run,
    "sweep": lambda results, who: open_sweep(define(load("paper"), VARY), results),
    "families": lambda results, who: open_families(one_entry(define(load("paper"), VARY)), results),
    "pareto": lambda results, who: new_folder(results / "paper-pareto-time"),
    "evidence": lambda results, who: open_evidence(load("paper"), "clearance", results),
}


def write(writer: Callable[[Path, int], object], place: Path, results: Path, who: int) -> None:
    """What one of two processes does, in step with the other."""
    for k in range(EACH):
        (place / f"{k}-{who}").touch()
        while not (place / f"{k}-{1 - who}").exists():
            time.sleep(1e-5)
        writer(results, who)


def at_once(writer: Callable[[Path, int], object], place: Path, results: Path) -> None:
    Parallel(n_jobs=2, backend="loky", timeout=120)(delayed(write)(writer, place, results, who) for who in range(2))


@pytest.mark.parametrize("kind", WRITERS)
def test_two_processes_that_end_at_once_have_two_whole_folders(kind: str, tmp_path: Path) -> None:
    writer, results = WRITERS[kind], tmp_path / "results"
    at_once(writer, tmp_path, results)
    folders = list(results.iterdir())
    assert len(folders) == 2 * EACH
    assert all((folder / "problem.toml").is_file() for folder in folders if kind != "pareto")
    if kind == "runs":
        owners = [json.loads((folder / "simulation.json").read_text(encoding="utf-8"))["who"] for folder in folders]
        assert sorted(owners) == [0] * EACH + [1] * EACH


def test_two_processes_that_begin_at_once_may_both_write(tmp_path: Path) -> None:
    """And nothing is made, not even of a folder in folders that are not there."""
    results = tmp_path / "new" / "results"
    at_once(lambda results, who: prepare(results), tmp_path, results)
    assert not (tmp_path / "new").exists()


def test_a_name_that_is_taken_at_the_last_moment_is_left_to_whoever_took_it(tmp_path: Path) -> None:
    work, told = new_work_folder(tmp_path), list[str]()

    def named(folder: Path) -> None:
        told.append(folder.name)
        if len(told) < 3:
            folder.mkdir()
            (folder / "theirs").touch()

    assert published(work, tmp_path / "found", named).name == "found-3"
    assert told == ["found", "found-2", "found-3"]
    assert (tmp_path / "found" / "theirs").exists()
