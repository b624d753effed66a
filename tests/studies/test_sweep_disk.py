"""A disk that fills or becomes read-only during a study: what is safe is said, --resume ends as if nothing had been."""

import errno
import os
import platform
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

import hopopt as ho
from hopopt.api import sweep
from hopopt.cli.main import run
from hopopt.errors import HopoptError, ResultError
from hopopt.files import remove_abandoned, write_whole
from hopopt.studies.sweep.workers.dask_workers import dask_workers
from stored_tables import table
from waiting import descendants

CHEAP = [
    "hop.stance_duration=[0.03, 0.2]",
    "solver.refine=false",
    "solver.stance_intervals=8",
    "solver.flight_intervals=2",
    "solver.starts=1",
]
VARY = {"leg.gear.ratio": [100, 120], "leg.shank.length": [0.2, 0.361]}


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> list[dict[str, str]]:
    design = ho.load("paper", CHEAP)
    return table(sweep(design, VARY, processes=1, results=tmp_path_factory.mktemp("whole")).folder)


def failing(writes: int, code: int) -> Callable[[int], None]:
    """In place of os.fsync: fails from that write on."""
    left = [writes]

    def fsync(descriptor: int) -> None:
        left[0] -= 1
        if left[0] < 0:
            raise OSError(code, os.strerror(code))

    return fsync


# Of 19 writes the first 3 are the problem, the definition and their digests, and the last 4 the tables and theirs.
@pytest.mark.parametrize(
    ("writes", "code"),
    [
        pytest.param(3, errno.ENOSPC, marks=pytest.mark.slow),
        (7, errno.EROFS),
        pytest.param(5, errno.EROFS, marks=pytest.mark.slow),
        pytest.param(9, errno.EDQUOT, marks=pytest.mark.slow),
    ],
)
def test_a_disk_that_fills_is_said_and_the_study_goes_on(
    writes: int, code: int, undisturbed: list[dict[str, str]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    design = ho.load("paper", CHEAP)
    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", failing(writes, code))
        with pytest.raises(ResultError) as raised:
            sweep(design, VARY, processes=1, results=tmp_path)
    (folder,) = tmp_path.iterdir()
    assert os.strerror(code) in str(raised.value)
    assert f"what is finished is kept: make room, then hopopt sweep --resume {folder}" in str(raised.value)
    assert not list(folder.rglob(".*"))
    assert run(["sweep", "--resume", str(folder), "--processes", "1", "--no-figures", "--json"]) == 3  # one mesh only
    assert capsys.readouterr().err == ""
    assert table(folder) == undisturbed


@pytest.fixture(scope="module")
def scheduler() -> Iterator[str]:
    """Address of a Dask scheduler with a worker, in this process."""
    distributed = pytest.importorskip("distributed")
    options = {"processes": False, "protocol": "tcp", "dashboard_address": "127.0.0.1:0"}
    with distributed.LocalCluster(n_workers=1, threads_per_worker=1, **options) as cluster:
        yield cluster.scheduler_address


def test_with_dask_it_is_the_disk_too_and_not_the_workers(
    scheduler: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "fsync", failing(4, errno.ENOSPC))
    with pytest.raises(ResultError, match="No space left on device") as raised:
        sweep(ho.load("paper", CHEAP), VARY, scheduler=scheduler, results=tmp_path)
    assert "lost" not in str(raised.value)


def test_a_cluster_is_nobody_s_default(scheduler: str) -> None:
    """Else what is written beside it, or after it is gone, would ask for it."""
    from dask import config

    job: Any = abs
    with dask_workers(1, scheduler) as crew:
        crew.submit(job, -1)
        assert config.get("scheduler", None) is None
        assert crew.done() == [1]


def refused() -> Any:
    raise PermissionError(errno.EACCES, "Permission denied")


def test_what_a_job_raises_on_a_worker_is_not_a_lost_scheduler(scheduler: str) -> None:
    with dask_workers(1, scheduler) as crew:
        crew.submit(refused)
        with pytest.raises(HopoptError, match="a worker failed with PermissionError: Permission denied"):
            crew.done()


@pytest.mark.skipif(not Path("/proc/net/tcp").exists(), reason="finds what listens through /proc")
def test_a_cluster_of_its_own_listens_on_the_loopback_address_alone() -> None:
    pytest.importorskip("distributed")
    with dask_workers(1, "local"):
        own = [f"/proc/{pid}" for pid in [os.getpid(), *descendants(os.getpid())]]
        links = [os.readlink(path) for folder in own for path in Path(folder).glob("fd/*") if os.path.lexists(path)]
        sockets = {link[8:-1] for link in links if link.startswith("socket:[")}
        lines = [
            line.split() for name in ("tcp", "tcp6") for line in Path(f"/proc/net/{name}").read_text().splitlines()
        ]
    listening = [line[1] for line in lines if len(line) > 9 and line[3] == "0A" and line[9] in sockets]
    assert len(listening) >= 2  # scheduler and worker
    assert {address.partition(":")[0] for address in listening} == {"0100007F"}


def test_what_killed_runs_left_is_removed_and_nothing_else(tmp_path: Path) -> None:
    """Files and folders of processes that have ended on this computer; not of those that run, or run elsewhere."""
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    here = platform.node()
    left = [f".0001-0.json.{ended.pid}@{here}", f".writing-abc.{ended.pid}@{here}", f".x.{10**30}@{here}"]
    kept = [f".0001-0.json.{os.getppid()}@{here}", f".0001-0.json.{ended.pid}@elsewhere.{here}", ".notes", "a@b"]
    for name in left + kept:
        (tmp_path / name).mkdir() if "writing" in name else (tmp_path / name).write_text("x")
    (tmp_path / left[1] / "solution.nc").write_text("half")
    remove_abandoned(tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(kept)


def test_a_file_is_written_whole_or_not_at_all(tmp_path: Path) -> None:
    """With a limit of the operating system, in a process of its own: what was there before stays."""
    (tmp_path / "file").write_bytes(b"before")
    words = (
        "import resource, signal, pathlib, hopopt.files\n"
        "signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096))\n"
        f"hopopt.files.write_whole(pathlib.Path({str(tmp_path / 'file')!r}), bytes(100_000))\n"
    )
    done = subprocess.run([sys.executable, "-c", words], capture_output=True, text=True, timeout=60)
    assert "File too large" in done.stderr
    assert [path.read_bytes() for path in tmp_path.iterdir()] == [b"before"]
    write_whole(tmp_path / "file", bytes(100_000))
    assert (tmp_path / "file").stat().st_size == 100_000
