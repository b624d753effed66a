"""A study killed again and again, at instants chosen at random: after --resume its table is that of one undisturbed."""

import json
import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from stored_tables import table
from waiting import beside_progress, wait_for

KILLS = int(os.environ.get("HOPOPT_KILLS", "2"))  # 20 take four minutes
CHEAP = ["hop.stance_duration=[0.03, 0.2]", "solver.refine=false", "solver.stance_intervals=16", "solver.starts=2"]
VARY = ["leg.gear.ratio=70:150:3", "leg.shank.length=0.2,0.36"]
SWEEP = [sys.executable, "-m", "hopopt.cli.main", "sweep", "--processes", "2", "--no-figures"]


def begin(cwd: Path, *arguments: str) -> subprocess.Popen[str]:
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    options = {"cwd": cwd, "env": environment, "start_new_session": True, "text": True}
    return subprocess.Popen([*SWEEP, *arguments], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, **options)


def defined() -> list[str]:
    return [word for entry in CHEAP for word in ("--set", entry)] + [
        word for entry in VARY for word in ("--vary", entry)
    ]


def points(folder: Path) -> dict[str, dict]:
    """What is kept of every point and pass, without timings and the digests that count them in."""
    found = {path.name: json.loads(path.read_text()) for path in (folder / "points").glob("[0-9]*.json")}
    return {name: {k: v for k, v in data.items() if k not in ("seconds", "sha256")} for name, data in found.items()}


@pytest.mark.rarely
def test_killed_at_random_instants_the_table_is_the_same(tmp_path: Path) -> None:
    began = time.monotonic()
    whole = begin(tmp_path, *defined(), "--results", "whole")
    assert beside_progress(whole.communicate(timeout=1800)[1]) == []
    lasted = time.monotonic() - began
    random = np.random.default_rng(0)
    first = begin(tmp_path, *defined(), "--results", "killed")
    wait_for(lambda: list(tmp_path.glob("killed/*/sweep.json")), first)
    (folder,) = tmp_path.glob("killed/*")
    running, kills = first, 0
    while kills < KILLS:
        with suppress(subprocess.TimeoutExpired):
            running.wait(float(random.uniform(0.0, 0.2 * lasted)))
        if running.poll() is None:
            os.kill(running.pid, signal.SIGKILL)
            kills += 1
        running.communicate()
        if (folder / "table.csv").exists():  # finished between two kills: the last steps once more, from the files
            (folder / "table.csv").unlink()
            newest = sorted((folder / "points").glob("[0-9]*-*.json"), key=lambda path: path.stat().st_mtime_ns)
            for path in newest[len(newest) // 2 :]:
                path.unlink()
        running = begin(tmp_path, "--resume", str(folder))
    assert beside_progress(running.communicate(timeout=1800)[1]) == []
    (undisturbed,) = tmp_path.glob("whole/*")
    assert table(folder) == table(undisturbed)
    assert points(folder) == points(undisturbed)
    assert (folder / "sweep.nc").exists()
