"""Folders of simulated runs: what is written is read back, and opens in plain xarray with names and units."""

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from hopopt.control import strategies
from hopopt.control.closed_loop import simulate
from hopopt.problem.load import load
from hopopt.storage.runs import ARRAYS, read_runs, save_runs


@pytest.mark.slow
def test_runs_are_read_back_and_say_what_they_hold(tmp_path: Path) -> None:
    design = load("paper")
    trace = simulate(design, strategies.find("force")).trace
    runs = {"force": trace, "mine:Push": trace}
    folder = save_runs("comparison", design, {"strategies": {name: {} for name in runs}}, runs, tmp_path)
    with xr.open_datatree(folder / "runs.nc", engine="h5netcdf") as tree:
        assert tree.attrs["groups"] == "force, mine.Push"
        for name, run in tree.children.items():
            assert run.attrs["outcome"] == trace.outcome
            assert not [v for v, x in run.variables.items() if not x.attrs.get("long_name")], name
            assert not [v for v, x in run.variables.items() if x.dtype.kind in "fi" and not x.attrs.get("units")], name
            assert list(run.to_dataset()["joint"].values) == ["hip", "knee"]
    again = read_runs(folder, "comparison").traces["mine:Push"]
    for name in (*ARRAYS, "contact"):
        np.testing.assert_array_equal(getattr(again, name), getattr(trace, name))
    assert [(e.kind, e.t) for e in again.events] == [(e.kind, e.t) for e in trace.events]
    assert again.outcome == trace.outcome
