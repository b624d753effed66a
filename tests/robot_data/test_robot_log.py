"""A robot's log, made by the plant with 14-bit encoders and noise: what is read off it is what the plant did."""

import csv
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hopopt.cli import main as cli
from hopopt.control.closed_loop import Run, simulate
from hopopt.control.strategies import BUILT_IN
from hopopt.design import Design
from hopopt.leg.robot import BASE
from hopopt.planner.solution import Solution
from hopopt.problem.load import load
from hopopt.robot_data.robot_hop import account
from hopopt.robot_data.robot_log import read_log, without_bounces
from hopopt.storage.solution import save
from refusals import refusal

STEP = 2 * np.pi / 2**14  # rad, of the encoders
EVERY = 4  # samples of the plant: 1 kHz
Columns = dict[str, np.ndarray]


@pytest.fixture(scope="module")
def design() -> Design:
    return load("paper")


@pytest.fixture(scope="module")
def run(design: Design) -> Run:
    """A hop with the paper's force control, landing included."""
    return simulate(design, BUILT_IN["force"])


@pytest.fixture(scope="module")
def columns(run: Run) -> Columns:
    """What a robot would log of it, with noise on speeds and torques."""
    trace, random = run.trace, np.random.default_rng(0)
    rows = np.flatnonzero(np.diff(trace.t, prepend=-1.0) > 1e-6)[::EVERY]
    found = {"t": trace.t[rows]}
    for k, joint in enumerate(("hip", "knee")):
        found[f"q_{joint}"] = STEP * np.round(trace.q[rows, BASE + k] / STEP)
        found[f"v_{joint}"] = trace.v[rows, BASE + k] + random.normal(0, 0.01, len(rows))
        found[f"tau_{joint}"] = trace.motor[rows, k] + random.normal(0, 0.3, len(rows))
    return found | {"force_z": trace.f[rows, 1], "contact": trace.contact[rows].astype(float)}


@pytest.fixture
def written(tmp_path: Path, columns: Columns) -> Callable[..., Path]:
    """Writes a log; columns may be replaced, left out (None) or named anew."""

    def write(names: dict[str, str] | None = None, **changed: Any) -> Path:
        given = {name: x for name, x in (columns | changed).items() if x is not None}
        file = tmp_path / "run.csv"
        with file.open("w", encoding="utf-8", newline="") as stream:
            writer = csv.writer(stream)
            writer.writerow([(names or {}).get(name, name) for name in given])
            writer.writerows(zip(*given.values(), strict=True))
        return file

    return write


@pytest.mark.parametrize("by", ["contact", "force_z"])
def test_a_log_tells_what_the_plant_did(design: Design, run: Run, written: Callable[..., Path], by: str) -> None:
    """Clearance, lift-off and budget within what rows 1 ms apart and the noise leave open."""
    other = {"contact": "force_z", "force_z": "contact"}[by]
    known, found = run.figures, account(design, read_log(written(**{other: None}), design), None)
    assert found["clearance_m"] == pytest.approx(known.clearance, abs=0.01)
    assert found["lift_off"]["time_s"] == pytest.approx(known.lift_off["time_s"], abs=0.006)
    assert found["lift_off"]["vertical_m_s"] == pytest.approx(known.lift_off["vertical_m_s"], abs=0.05)
    for part, value in known.budget.items():
        assert found["budget"][part] == pytest.approx(value, abs=0.02)
    assert not [words for words in found["limits_exceeded"] if "drive" in words]


def test_units_in_the_header_and_names_of_a_map_are_understood(
    design: Design, written: Callable[..., Path], columns: Columns
) -> None:
    plain = read_log(written(), design)
    other = read_log(
        written(
            {"t": "time [ms]", "q_knee": "q_knee [deg]"}, t=1000 * columns["t"], q_knee=np.rad2deg(columns["q_knee"])
        ),
        design,
        {"t": "time"},
    )
    np.testing.assert_allclose(other.t, plain.t, atol=1e-12)
    np.testing.assert_allclose(other.q, plain.q, atol=1e-12)


@pytest.mark.parametrize("separator", [";", "\t"])
@pytest.mark.parametrize("decimal", [".", ","])
def test_tables_of_other_countries_are_read(
    design: Design, written: Callable[..., Path], separator: str, decimal: str
) -> None:
    """The same table with semicolons or tabs, and with decimal commas."""
    plain = read_log(file := written(), design)
    text = file.read_text(encoding="utf-8").replace(",", separator).replace(".", decimal)
    file.write_text(text, encoding="utf-8")
    other = read_log(file, design)
    for name in ("t", "q", "v", "tau", "contact", "force"):
        np.testing.assert_array_equal(getattr(other, name), getattr(plain, name))


def test_what_is_no_table_is_named(tmp_path: Path, written: Callable[..., Path], capsys: pytest.CaptureFixture) -> None:
    """An empty file, a folder, a column twice, and commas of thousands, which are no decimal commas."""
    empty, folder = tmp_path / "empty.csv", tmp_path / "logs.mcap"
    empty.write_text("\n", encoding="utf-8")
    folder.mkdir()
    assert "the file is empty: it needs a header" in refusal(["log", str(empty)], capsys)
    for command in ("log", "identify"):
        for path in (tmp_path, folder):
            assert "this is a folder: name the file of one log in it" in refusal([command, str(path)], capsys)
    twice = written({"v_hip": "q_hip [deg]"})
    assert "there are two columns q_hip" in refusal(["log", str(twice)], capsys)
    table = written().read_text(encoding="utf-8").replace(",", ";").splitlines()
    table[5] = "1,234" + table[5][table[5].index(";") :]
    twice.write_text("\n".join(table), encoding="utf-8")
    assert "row 6, t: '1,234' is not a number" in refusal(["log", str(twice)], capsys)


def test_a_torque_that_no_drive_gives_is_named(design: Design, written: Callable[..., Path], columns: Columns) -> None:
    too_much = np.where(np.arange(len(columns["t"])) == 30, 400.0, columns["tau_knee"])
    found = account(design, read_log(written(tau_knee=too_much), design), None)["limits_exceeded"]
    assert any(words.startswith("knee with 400 N m") for words in found)
    assert not any(words.startswith("hip with") for words in found)


def test_a_short_bounce_is_no_hop() -> None:
    t = np.arange(0.0, 0.1, 0.01)
    contact = np.array([1, 1, 0, 1, 1, 1, 0, 0, 0, 0], dtype=bool)
    assert without_bounces(t, contact, 0.02).tolist() == [1, 1, 1, 1, 1, 1, 0, 0, 0, 0]


def broken(columns: Columns) -> dict[str, tuple[dict[str, Any], str]]:
    """Faults of a log: the columns changed, and what is said."""
    t, n = columns["t"], len(columns["t"])
    return {
        "gap": ({"t": np.where(np.arange(n) > n // 2, t + 0.1, t)}, "nothing was logged from"),
        "backwards": ({"t": t[::-1]}, "time does not increase"),
        "milliseconds": ({"t": 1000 * t}, "is t in ms?"),
        "degrees": ({"q_knee": np.rad2deg(columns["q_knee"])}, "is it in degrees"),
        "swapped": ({"v_hip": columns["v_knee"], "v_knee": columns["v_hip"]}, "are columns swapped"),
        "no speed": ({"v_knee": np.zeros(n)}, "v_knee is not the rate of q_knee"),
        "sign": ({"v_knee": -columns["v_knee"]}, "its sign the other way round"),
        "no number": ({"tau_hip": np.where(np.arange(n) == 7, "stall", columns["tau_hip"])}, "row 9, tau_hip: 'stall'"),
        "no phase": ({"contact": None, "force_z": None}, "nothing says when the foot stands"),
        "no flight": ({"contact": np.ones(n)}, "the foot never leaves the ground"),
        "in the air": ({"contact": np.zeros(n)}, "the foot does not stand at its beginning"),
        "missing": ({"q_knee": None}, "there is no column q_knee; it has t, q_hip"),
    }


@pytest.mark.parametrize(
    "fault",
    ["gap", "backwards", "milliseconds", "degrees", "swapped", "no speed", "sign", "no number", "no phase", "no flight", "in the air", "missing"],
)  # fmt: skip
def test_a_broken_log_is_refused_in_a_sentence(
    fault: str, written: Callable[..., Path], columns: Columns, capsys: pytest.CaptureFixture
) -> None:
    changed, message = broken(columns)[fault]
    file = written(**changed)
    assert message in refusal(["log", str(file), "--report", str(file.with_name("page.html"))], capsys)
    assert [path.name for path in file.parent.iterdir()] == ["run.csv"]


def test_the_command_sets_a_run_beside_the_bound(
    hop: Solution, written: Callable[..., Path], capsys: pytest.CaptureFixture
) -> None:
    """Share and gap: the gap's parts sum to what is missing."""
    file = written()
    bound, page = save(hop, file.parent / "results").result_dir, file.with_name("page.html")
    assert cli.run(["log", str(file), "--bound", str(bound), "--report", str(page), "--json"]) == 0
    data = json.loads(capsys.readouterr().out)
    assert data["bound_m"] == hop.clearance
    assert data["share_of_bound"] == pytest.approx(data["clearance_m"] / hop.clearance, abs=1e-12)
    assert sum(data["gap"].values()) == pytest.approx(hop.clearance - data["clearance_m"], abs=1e-9)
    text = page.read_text(encoding="utf-8")
    assert f"clearance {data['clearance_m']:.3f} m, {data['share_of_bound']:.0%} of the bound" in text
    assert cli.run(["log", str(file), "--bound", str(bound)]) == 0
    assert "missing of the bound: push" in capsys.readouterr().out
