"""A study on a Dask cluster: the same table, even if a worker is killed on the way; what is missing is said."""

import importlib
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

import hopopt as ho
from hopopt.errors import UsageError
from stored_tables import table
from waiting import beside_progress, descendants, wait_for

pytest.importorskip("distributed")

CHEAP = ["hop.stance_duration=[0.03, 0.2]", "solver.refine=false", "solver.stance_intervals=20", "solver.starts=1"]
VARY = {"leg.gear.ratio": [100, 110, 120, 130, 140, 150], "leg.shank.length": [0.2, 0.361]}  # half of it impossible


@pytest.fixture(scope="module")
def expected(tmp_path_factory: pytest.TempPathFactory) -> list[dict[str, str]]:
    design = ho.load("paper", CHEAP)
    return table(ho.sweep(design, VARY, processes=1, results=tmp_path_factory.mktemp("alone")).folder)


def workers_of(parent: int) -> list[int]:
    """Processes below a process that are workers of a cluster."""
    return [pid for pid in descendants(parent) if b"spawn_main" in Path(f"/proc/{pid}/cmdline").read_bytes()]


@pytest.mark.rarely
@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="finds the workers through /proc")
def test_a_worker_killed_on_the_way_costs_nothing(tmp_path: Path, expected: list[dict[str, str]]) -> None:
    sets = [word for entry in CHEAP for word in ("--set", entry)]
    vary = [word for entry, values in VARY.items() for word in ("--vary", f"{entry}={','.join(map(str, values))}")]
    command = [
        sys.executable,
        "-m",
        "hopopt.cli.main",
        "sweep",
        *sets,
        *vary,
        "--processes",
        "2",
        "--scheduler",
        "local",
    ]
    with subprocess.Popen([*command, "--no-figures"], cwd=tmp_path, stderr=subprocess.PIPE, text=True) as running:
        wait_for(lambda: list(tmp_path.glob("results/*/points/*.npz")), running)
        before = workers_of(running.pid)
        assert len(before) >= 2
        os.kill(before[-1], signal.SIGKILL)
        words = running.communicate(timeout=1200)[1]
    assert beside_progress(words) == []
    assert running.returncode == 3  # one mesh is not verified
    (folder,) = tmp_path.glob("results/*")
    assert table(folder) == expected
    assert len(expected) == 12


@pytest.mark.rarely
def test_motors_and_gears_are_chosen_by_the_workers_as_here(tmp_path: Path) -> None:
    asked = {"only": ["mini-cheetah", "apex-af042-20"], "verify": 0, "processes": 1, "results": tmp_path}
    here, there = (ho.choose("paper", 0.4, **asked, scheduler=scheduler) for scheduler in (None, "local"))
    assert len(here.clearing) == 2
    assert there.candidates == here.candidates


def test_without_dask_it_is_said_in_a_sentence(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(UsageError, match=r"hopopt\[dask\]"):
        ho.sweep(ho.load("paper", CHEAP), VARY, scheduler="local", results=tmp_path)


def test_a_scheduler_that_does_not_answer(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(importlib.import_module("hopopt.studies.sweep.workers.dask_workers"), "SCHEDULER_TIMEOUT", 0.5)
    with pytest.raises(UsageError, match="no Dask scheduler answers"):
        ho.sweep(ho.load("paper", CHEAP), VARY, scheduler="tcp://127.0.0.1:9", results=tmp_path)
