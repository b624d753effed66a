"""What notebooks show of results, and results as xarray and pandas hold them."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import hopopt as ho
from hopopt.errors import UsageError
from hopopt.studies.sweep.definition import define
from hopopt.studies.sweep.point_file import NOT_SOLVED, VERIFIED, Point


@pytest.fixture
def study(tmp_path: Path) -> ho.Study:
    definition = define(ho.load("paper"), {"leg.gear.ratio": [80, 90, 100]})
    heights = (0.7, 0.8, None)
    points = [
        Point(k, definition.values(k), NOT_SOLVED if z is None else VERIFIED, objective_value=z, clearance_m=z)
        for k, z in enumerate(heights)
    ]
    return ho.Study(definition, tuple(points), tmp_path, 1.0)


def test_a_hop_as_a_dataset(hop: ho.Solution) -> None:
    """Power by named joints, integrated, is the work that the answer states; units stand beside every quantity."""
    data = hop.to_xarray(np.linspace(0.0, hop.lift_off, 4001)[:-1])
    assert list(data.joint.values) == ["hip", "knee"]
    assert data.sel(name="foot", axis="z").point.values == pytest.approx(0.0, abs=1e-6)
    units = {name: data[name].attrs["units"] for name in ("angle", "speed", "torque", "force", "position")}
    assert units == {"angle": "rad", "speed": "rad/s", "torque": "N m", "force": "N", "position": "m"}
    work = np.trapezoid((data.torque * data.speed).sum("joint").values, data.t.values)
    assert work == pytest.approx(hop.summary.energy["stance_net_J"], rel=1e-3)
    assert float(hop.to_xarray().sel(name="foot", axis="z").point[-1]) == pytest.approx(hop.clearance, abs=1e-9)


def test_a_hop_as_a_table(hop: ho.Solution) -> None:
    table = hop.to_dataframe([0.0, hop.duration])
    assert table.index.name == "t [s]"
    assert {"knee torque [N m]", "hip angle [rad]", "body z [m]", "foot z [m]", "force z [N]"} <= set(table.columns)
    assert table["foot z [m]"].iloc[-1] == pytest.approx(hop.clearance, abs=1e-9)


@pytest.mark.parametrize("t", [-0.01, 99.0, [0.1, np.nan]])
def test_a_time_outside_the_hop_is_an_error(hop: ho.Solution, t: float) -> None:
    with pytest.raises(UsageError, match="outside the hop, 0 to"):
        hop.sample(t)


def test_results_are_shown_short(hop: ho.Solution, comparison: ho.Comparison, study: ho.Study) -> None:
    assert repr(comparison).startswith("<Comparison on paper: optimum 0.799 m, force 0.")
    assert repr(study) == "<Study of paper over leg.gear.ratio: 2 of 3 verified, best at leg.gear.ratio = 90>"
    for shown, words in ((hop, "0.7994 m"), (comparison, "0.7994 m"), (study, "0.8000 m")):
        assert len(repr(shown)) < 200
        html = shown._repr_html_()
        assert html.startswith("<table>")
        assert words in html


def test_strategies_and_points_as_tables(comparison: ho.Comparison, study: ho.Study) -> None:
    rows = comparison.to_dataframe()
    assert list(rows.index) == ["optimum", "force"]
    assert rows.loc["force", "share_of_bound"] == pytest.approx(
        rows.loc["force", "clearance_m"] / rows.loc["optimum", "clearance_m"]
    )
    assert float(comparison.to_xarray().clearance_m.sel(strategy="optimum")) == pytest.approx(
        comparison.bound, rel=1e-12
    )
    points = study.to_dataframe()
    assert list(points["leg.gear.ratio"]) == [80.0, 90.0, 100.0]
    assert np.nanmax(points["clearance_m"]) == 0.8
    assert study.to_xarray().clearance_m.attrs["units"] == "m"


def test_a_simulation_by_name(comparison: ho.Comparison) -> None:
    """The same hop as that of the comparison."""
    run = ho.simulate("paper", "force")
    assert run.figures.clearance == comparison.figures["force"].clearance


def test_completion_offers_public_names_alone() -> None:
    code = "import hopopt; hopopt.load('paper'); print(*dir(hopopt))"
    shown = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60)
    assert shown.stdout.split() == sorted(ho.__all__)


def test_points_that_differ_in_the_last_digits_each_have_a_row(tmp_path: Path) -> None:
    definition = define(ho.load("paper"), {"leg.gear.ratio": [100.0, 100.00001, 100.00002]})
    points = tuple(Point(k, definition.values(k), NOT_SOLVED, "no start led to a hop") for k in range(3))
    assert ho.Study(definition, points, tmp_path, 1.0)._repr_html_().count("<tr>") == 3


def test_an_optimum_that_is_not_verified_is_no_number_in_a_notebook(comparison: ho.Comparison) -> None:
    unverified = replace(comparison, solution=comparison.solution.with_summary(verified=False))
    assert "<th>optimum</th><td>not verified</td>" in unverified._repr_html_()
    assert "not verified" not in comparison._repr_html_()
