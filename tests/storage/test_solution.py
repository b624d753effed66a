"""Results folders: what was computed is never lost, and what cannot be written or read is said in a sentence."""

import json
import logging
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from hopopt.errors import HopoptError, ResultError
from hopopt.planner.solution import Solution
from hopopt.storage.folder import prepare
from hopopt.storage.netcdf import Group, to_bytes
from hopopt.storage.netcdf import read as read_netcdf
from hopopt.storage.seal.recheck import recheck
from hopopt.storage.solution import FOLDER_KINDS, read, save
from once import solved_once

QUICK = {"solver.refine": False, "solver.stance_intervals": 12, "solver.flight_intervals": 6}
DATA = {"solution.nc", "summary.json", "problem.toml", "manifest.json"}


@pytest.fixture(scope="module")
def solution() -> Solution:
    """Any solution; that its mesh is too coarse to be true does not matter here."""
    return solved_once(QUICK)


def contents(folder: Path | None) -> set[str]:
    assert folder is not None
    return {path.name for path in folder.iterdir()}


def test_what_is_saved_is_read_back(solution: Solution, tmp_path: Path) -> None:
    saved = save(solution, tmp_path)
    assert contents(saved.result_dir) == DATA
    again = read(str(saved.result_dir))
    assert again.design == solution.design
    assert again.summary.clearance_m == solution.clearance
    for phase, table in solution.tables.items():
        for name in ("t", "q", "v", "a", "tau", "f"):
            np.testing.assert_array_equal(getattr(again.tables[phase], name), getattr(table, name))


def test_costates_and_multipliers_are_read_back(solution: Solution, tmp_path: Path) -> None:
    again = read(str(save(solution, tmp_path).result_dir))
    assert set(again.multipliers) == {"stance", "flight", "ends"}
    for group, arrays in solution.multipliers.items():
        for name, array in arrays.items():
            np.testing.assert_array_equal(again.multipliers[group][name], array)
    assert again.multipliers["stance"]["costate"].shape[1] == len(again.multipliers["stance"]["state"])


def test_a_result_without_certificate_or_multipliers_is_read(solution: Solution, tmp_path: Path) -> None:
    """As stored by earlier versions: without costates they are recomputed, without multipliers it is said."""
    import xarray as xr

    folder = save(solution, tmp_path).result_dir
    assert folder is not None
    for group, certified in (("certificate", True), ("nlp", False)):
        with xr.open_datatree(folder / "solution.nc", engine="h5netcdf") as tree:
            tree = tree.load()
        del tree[group]  # type: ignore[attr-defined]
        tree.to_netcdf(folder / "solution.nc", engine="h5netcdf")
        again = read(folder)
        assert again.clearance == solution.clearance
        assert bool(recheck(again).conditions) == certified
    assert "first-order conditions" in recheck(again).failed_checks


def test_data_lie_in_their_folder_before_figures_are_drawn(solution: Solution, tmp_path: Path) -> None:
    seen = []
    saved = save(solution, tmp_path, lambda s, folder: seen.append((s.result_dir, contents(folder.parent))))
    assert seen == [(saved.result_dir, DATA | {"figures"})]
    assert saved.summary.notes == solution.summary.notes


@pytest.mark.parametrize(
    "fault", [ValueError("no such\nfont"), OSError(28, "No space left on device"), KeyboardInterrupt()]
)
def test_figures_that_fail_leave_the_data_and_a_note(
    solution: Solution, tmp_path: Path, caplog: pytest.LogCaptureFixture, fault: BaseException
) -> None:
    def draw(_: Solution, folder: Path) -> None:
        (folder / "heights.png").write_bytes(b"drawn before the fault")
        raise fault

    with caplog.at_level(logging.WARNING, "hopopt"):
        saved = save(solution, tmp_path, draw)
    *before, note = saved.summary.notes
    assert tuple(before) == solution.summary.notes
    assert caplog.messages == [note]
    assert "figures" in note
    assert str(saved.result_dir) in note
    assert "\n" not in note
    again = read(str(saved.result_dir))
    assert again.summary.notes == (*before, note)
    assert again.clearance == solution.clearance
    assert contents(saved.result_dir) == DATA | {"figures"}
    assert contents(tmp_path) == {saved.result_dir.name}  # type: ignore[union-attr]


def test_nothing_is_overwritten(solution: Solution, tmp_path: Path) -> None:
    first, second = save(solution, tmp_path), save(solution, tmp_path)
    assert second.result_dir == first.result_dir.with_name(f"{first.result_dir.name}-2")  # type: ignore[union-attr]
    assert json.loads((second.result_dir / "summary.json").read_text())["result_dir"] == str(second.result_dir)  # type: ignore[operator]


def test_a_folder_that_cannot_be_written(solution: Solution, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A file stands where the folder should be: the error names the folder and the reason, the data are kept."""
    place, blocked = tmp_path / "temporary", tmp_path / "blocked"
    place.mkdir()
    blocked.write_text("a file")
    monkeypatch.setattr("tempfile.tempdir", str(place))
    with pytest.raises(ResultError) as caught:
        save(solution, blocked)
    assert str(caught.value).startswith(f"{blocked}: the result cannot be written (")
    (kept,) = place.glob("hopopt-*/paper-*")
    assert f"it is kept in {kept}" in str(caught.value)
    assert read(kept).clearance == solution.clearance
    with pytest.raises(ResultError, match="results cannot be written"):
        prepare(blocked)


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(signal, "SIGXFSZ"), reason="needs a limit on the size of files")
def test_a_disk_that_fills_up_while_writing(solution: Solution, tmp_path: Path) -> None:
    """HDF5 itself crashes then; in a process of its own, where no file may grow beyond 20 kB."""
    code = (
        "import resource, signal, sys; from pathlib import Path; from hopopt.storage.solution import read, save\n"
        "from hopopt.errors import ResultError\n"
        "s = read(sys.argv[1]); signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))\n"
        "try: save(s, Path('full'))\n"
        "except ResultError as error: print(error)\n"
    )
    saved, temporary = save(solution, tmp_path / "results"), tmp_path / "temporary"
    temporary.mkdir()
    done = subprocess.run(
        [sys.executable, "-c", code, str(saved.result_dir)], cwd=tmp_path, capture_output=True, text=True, timeout=1200,
        check=False, env={**os.environ, "TMPDIR": str(temporary)},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("full: the result cannot be written (File too large)")
    assert len(done.stdout.splitlines()) == 1
    assert not list((tmp_path / "full").iterdir())
    assert not list(temporary.iterdir())


# ---- reading ------------------------------------------------------------------------------------------------


def test_a_folder_of_results_names_those_in_it(solution: Solution, tmp_path: Path) -> None:
    saved = save(solution, tmp_path)
    with pytest.raises(ResultError, match=r"solution.nc is missing.*such as ") as caught:
        read(tmp_path)
    assert str(saved.result_dir) in str(caught.value)


@pytest.mark.parametrize("name", sorted(DATA - {"manifest.json"}))
@pytest.mark.parametrize("damage", ["cut short", "emptied", "removed"])
def test_damaged_files(solution: Solution, tmp_path: Path, name: str, damage: str) -> None:
    folder = save(solution, tmp_path).result_dir
    assert folder is not None
    path = folder / name
    raw = path.read_bytes()
    path.write_bytes({"cut short": raw[: len(raw) // 2], "emptied": b"", "removed": b""}[damage])
    if damage == "removed":
        path.unlink()
    with pytest.raises(HopoptError) as caught:
        read(folder)
    said = str(caught.value)
    assert name in said
    assert said.startswith(str(folder))
    assert len(said.splitlines()) == 1
    assert (
        ": solve it again" in said
        or {"removed": "hopopt solve", "cut short": "changed", "emptied": "changed"}[damage] in said
    )


def test_a_folder_that_may_not_be_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(path: Path) -> bool:
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr(Path, "is_file", refused)
    with pytest.raises(ResultError) as caught:
        read(tmp_path)
    assert str(caught.value) == f"{tmp_path}: it cannot be read (Permission denied)"


def test_the_folder_of_a_study_is_told_as_such(tmp_path: Path) -> None:
    (tmp_path / "table.csv").write_text("")
    with pytest.raises(ResultError, match=r"a study, not a single result \(its table is table.csv"):
        read(tmp_path)


@pytest.mark.parametrize(("file", "kind"), FOLDER_KINDS.items())
def test_the_folder_of_another_command_is_told_as_what_it_is(file: str, kind: str, tmp_path: Path) -> None:
    (tmp_path / file).write_text("{}")
    with pytest.raises(ResultError, match=f"{kind}, not a single result.*: give a folder that `hopopt solve` wrote"):
        read(tmp_path)


@pytest.mark.parametrize("source", ["x" * 5000, "\0", "", "/dev/null", "ü/ß"])
def test_folders_that_are_none(source: str) -> None:
    with pytest.raises(ResultError):
        read(source)


def test_a_phase_that_is_missing(solution: Solution, tmp_path: Path) -> None:
    saved, other = save(solution, tmp_path / "a"), tmp_path / "b"
    shutil.copytree(str(saved.result_dir), other)
    import xarray as xr

    with xr.open_datatree(other / "solution.nc", engine="h5netcdf") as tree:
        tree = tree.load()
    del tree["flight"]  # type: ignore[attr-defined]
    tree.to_netcdf(other / "solution.nc", engine="h5netcdf")
    with pytest.raises(ResultError, match="an entry is missing"):
        read(other)


def test_the_file_is_one_that_xarray_reads(tmp_path: Path) -> None:
    import xarray as xr

    values, names = np.array([[1.0, np.inf], [np.nan, -2.0]]), np.array(["hip", "knee"])
    inner = Group({"x": (("row", "joint"), values, {"units": "m"}), "joint": (("joint",), names, {})}, {"kind": "test"})
    (tmp_path / "a.nc").write_bytes(to_bytes({"/": Group(attributes={"format": 1}), "outer/inner": inner}))
    expected = xr.Dataset({"x": (("row", "joint"), values, {"units": "m"})}, {"joint": names}, {"kind": "test"})
    with xr.open_datatree(tmp_path / "a.nc", engine="h5netcdf") as tree:
        xr.testing.assert_identical(tree["outer/inner"].to_dataset(), expected)
        assert {"format": 1, "groups": "outer/inner"}.items() <= tree.attrs.items()
    again = read_netcdf(tmp_path / "a.nc")["outer/inner"]
    np.testing.assert_array_equal(again["x"], values)
    np.testing.assert_array_equal(again["joint"], names)
    assert again.variables["x"][0] == ("row", "joint")
    assert again.attributes == {"kind": "test"}


def test_a_result_opens_in_plain_xarray_with_names_and_units(solution: Solution, tmp_path: Path) -> None:
    """The root names the groups and what opens them; every variable says what it is, every number its unit."""
    import xarray as xr

    folder = save(solution, tmp_path).result_dir
    assert folder is not None
    with xr.open_dataset(folder / "solution.nc", engine="h5netcdf") as root:
        assert not root.variables
        named = root.attrs["groups"].split(", ")
        assert "group=" in root.attrs["to_open"]
        assert "to_dataframe()" in root.attrs["in_python"]
    assert {"stance", "flight", "nlp", "certificate/stance"} <= set(named)
    with xr.open_datatree(folder / "solution.nc", engine="h5netcdf") as tree:
        inside = {group.path.strip("/"): group.variables for group in tree.subtree if group.variables}
        assert set(inside) == set(named)
        said = [(group, name, x) for group, found in inside.items() for name, x in found.items()]
        assert not [(group, name) for group, name, x in said if not x.attrs.get("long_name")]
        assert not [(group, name) for group, name, x in said if x.dtype.kind in "fi" and not x.attrs.get("units")]
