"""A robot's log in an MCAP file, of ROS 2 or in JSON: the same log as the CSV file with the same numbers."""

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hopopt.cli import main as cli
from hopopt.control.closed_loop import simulate
from hopopt.control.strategies import BUILT_IN
from hopopt.design import Design
from hopopt.leg.robot import BASE
from hopopt.problem.load import load
from hopopt.robot_data import log_mcap
from hopopt.robot_data.robot_log import RobotLog, read_log
from refusals import refusal

writing = pytest.importorskip("mcap.writer", reason="MCAP files need pip install 'hopopt[mcap]'")
ros2 = pytest.importorskip("mcap_ros2.writer", reason="MCAP files need pip install 'hopopt[mcap]'")

Columns = dict[str, np.ndarray]
START = 1_700_000_000_000_000_000  # [ns], of the robot's clock
HEADER = "================\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n"
TIME = "================\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
JOINTS = (
    f"std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n{HEADER}{TIME}"
)
VECTOR = "================\nMSG: geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z\n"
WRENCH = (
    "std_msgs/Header header\ngeometry_msgs/Wrench wrench\n================\nMSG: geometry_msgs/Wrench\n"
    f"geometry_msgs/Vector3 force\ngeometry_msgs/Vector3 torque\n{VECTOR}{HEADER}{TIME}"
)


@pytest.fixture(scope="module")
def design() -> Design:
    return load("paper")


@pytest.fixture(scope="module")
def columns(design: Design) -> Columns:
    """A hop with the paper's force control at 1 kHz, in numbers that a stamp of nanoseconds holds."""
    trace = simulate(design, BUILT_IN["force"]).trace
    rows = np.flatnonzero(np.diff(trace.t, prepend=-1.0) > 1e-6)[::4]
    found = {"t": np.round(trace.t[rows], 9)}
    for k, joint in enumerate(("hip", "knee")):
        found |= {f"q_{joint}": trace.q[rows, BASE + k], f"v_{joint}": trace.v[rows, BASE + k]}
        found |= {f"tau_{joint}": trace.motor[rows, k], f"command_{joint}": trace.command[rows, k]}
    return found | {"force_x": trace.f[rows, 0], "force_z": trace.f[rows, 1], "contact": trace.contact[rows] * 1.0}


@pytest.fixture
def plain(tmp_path: Path, columns: Columns, design: Design) -> RobotLog:
    """The same as a CSV file."""
    file = tmp_path / "run.csv"
    with file.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream)
        writer.writerows([list(columns), *zip(*(x.tolist() for x in columns.values()), strict=True)])
    return read_log(file, design)


def nanoseconds(t: float) -> int:
    return START + round(t * 1e9)


def in_ros2(file: Path, columns: Columns, stamped: bool = True) -> Path:
    """/joint_states and /joint_commands, the force at half the rate, contact only when it changes, and what a robot logs
    besides."""
    with file.open("wb") as stream:
        writer = ros2.Writer(stream)
        joints = writer.register_msgdef("sensor_msgs/msg/JointState", JOINTS)
        wrench = writer.register_msgdef("geometry_msgs/msg/WrenchStamped", WRENCH)
        boolean = writer.register_msgdef("std_msgs/msg/Bool", "bool data\n")
        writer.write_message("/diagnostics", writer.register_msgdef("own/Load", "float64 load\n"), {"load": 0.5}, START)
        picture = writer.register_msgdef("own/Picture", "uint8[] data\n")
        writer.write_message("/camera", picture, {"data": bytes(100_000)}, START + 10**8)
        words = writer.register_msgdef("std_msgs/msg/String", "string data\n")
        writer.write_message("/rosout", words, {"data": "hop"}, START)
        before = None
        for k, t in enumerate(columns["t"].tolist()):
            row, at = {name: float(x[k]) for name, x in columns.items()}, nanoseconds(t)
            stamp = {"sec": at // 10**9, "nanosec": at % 10**9} if stamped else {"sec": 0, "nanosec": 0}
            head = {"header": {"stamp": stamp, "frame_id": ""}, "name": ["knee", "hip"]}
            parts = {"position": "q_", "velocity": "v_", "effort": "tau_"}
            state = {part: [row[f"{p}knee"], row[f"{p}hip"]] for part, p in parts.items()}
            later = at + 3_000_000 if stamped else at  # written later than it was measured
            if row["contact"] != before:
                writer.write_message("/foot/contact", boolean, {"data": bool(row["contact"])}, at)
                before = row["contact"]
            writer.write_message("/joint_states", joints, head | state, later)
            asked = {"position": [], "velocity": [], "effort": [row["command_knee"], row["command_hip"]]}
            writer.write_message("/joint_commands", joints, head | asked, later)
            if k % 2 == 0 or k == len(columns["t"]) - 1:
                force = {"x": row["force_x"], "y": 0.0, "z": row["force_z"]}
                felt = {"header": head["header"], "wrench": {"force": force, "torque": {"x": 0.0, "y": 0.0, "z": 0.0}}}
                writer.write_message("/force", wrench, felt, later)
        writer.finish()
    return file


def in_json(file: Path, messages: list[tuple[str, float, Any]]) -> Path:
    """Topic, time [s] and object of every message."""
    with file.open("wb") as stream:
        writer, channels = writing.Writer(stream), dict[str, int]()
        writer.start()
        schema = writer.register_schema("row", "jsonschema", b"{}")
        for topic, t, message in messages:
            if topic not in channels:
                channels[topic] = writer.register_channel(topic, "json", schema)
            at = nanoseconds(t)
            writer.add_message(channels[topic], at, json.dumps(message).encode(), at)
        writer.finish()
    return file


def same(found: RobotLog, plain: RobotLog, but: tuple[str, ...] = ()) -> None:
    for name, value in vars(plain).items():
        if name not in but:
            np.testing.assert_allclose(getattr(found, name), value, rtol=0, atol=2e-9, err_msg=name)


@pytest.mark.parametrize("stamped", [True, False])
def test_a_log_of_ros2_is_the_csv_file_with_the_same_numbers(
    tmp_path: Path, columns: Columns, plain: RobotLog, design: Design, stamped: bool
) -> None:
    """Times are those of the headers, or of the log where these are empty; the force is linear between its messages."""
    found = read_log(in_ros2(tmp_path / "run.mcap", columns, stamped), design)
    same(found, plain, ("force",))
    every = np.r_[0 : len(plain.t) : 2, len(plain.t) - 1]
    np.testing.assert_allclose(found.force[every], plain.force[every], atol=1e-9)
    expected = np.interp(plain.t, plain.t[every], plain.force[every, 1])
    np.testing.assert_allclose(found.force[:, 1], expected, atol=1e-6 * expected.max())


def test_a_log_in_json_is_the_csv_file_with_the_same_numbers(
    tmp_path: Path, columns: Columns, plain: RobotLog, design: Design
) -> None:
    rows = [dict(zip(columns, row, strict=True)) for row in zip(*(x.tolist() for x in columns.values()), strict=True)]
    same(read_log(in_json(tmp_path / "own.mcap", [("/row", r["t"], r) for r in rows]), design), plain)
    degrees = [
        {("q_hip [deg]" if n == "q_hip" else n): np.rad2deg(x) if n == "q_hip" else x for n, x in r.items()}
        for r in rows
    ]
    same(read_log(in_json(tmp_path / "degrees.mcap", [("/row", r["t"], r) for r in degrees]), design), plain)


def test_names_of_a_map_and_objects_within_objects_are_understood(
    tmp_path: Path, columns: Columns, plain: RobotLog, design: Design
) -> None:
    messages = list[tuple[str, float, Any]]()
    for k, t in enumerate(columns["t"].tolist()):
        row = {name: float(x[k]) for name, x in columns.items()}
        state = {"name": ["LF_HFE", "LF_KFE"], "position": [row["q_hip"], row["q_knee"]]}
        state |= {"velocity": [row["v_hip"], row["v_knee"]], "effort": [row["tau_hip"], row["tau_knee"]]}
        messages += [("/joint_states", t, state), ("/foot", t, {"left": {"on": bool(row["contact"])}})]
    names = {
        f"{part}{ours}": f"{part}{theirs}"
        for part in ("q_", "v_", "tau_")
        for ours, theirs in (("hip", "LF_HFE"), ("knee", "LF_KFE"))
    }
    found = read_log(in_json(tmp_path / "run.mcap", messages), design, names | {"contact": "left.on"})
    same(found, plain, ("force", "command"))


def test_the_command_reads_it(
    tmp_path: Path, columns: Columns, plain: RobotLog, design: Design, capsys: pytest.CaptureFixture
) -> None:
    """hopopt log says the same of both files."""
    in_ros2(tmp_path / "run.mcap", columns)
    said = {}
    for kind in ("csv", "mcap"):
        assert cli.run(["log", str(tmp_path / f"run.{kind}"), "--json"]) == 0
        said[kind] = json.loads(capsys.readouterr().out)
    for key in ("clearance_m", "lift_off", "budget"):
        assert said["mcap"][key] == pytest.approx(said["csv"][key], abs=1e-6)


def test_identify_finds_the_same_in_both_files(
    tmp_path: Path, columns: Columns, plain: RobotLog, capsys: pytest.CaptureFixture
) -> None:
    rows = [dict(zip(columns, row, strict=True)) for row in zip(*(x.tolist() for x in columns.values()), strict=True)]
    in_json(tmp_path / "run.mcap", [("/row", row["t"], row) for row in rows])
    found = []
    for kind in ("csv", "mcap"):
        assert cli.run(["identify", str(tmp_path / f"run.{kind}"), "--json"]) == 0
        found.append(json.loads(capsys.readouterr().out)["parameters"])
    assert {key: p["value"] for key, p in found[0].items()} == {key: p["value"] for key, p in found[1].items()}


def cut(file: Path) -> Path:
    file.write_bytes(file.read_bytes()[:-2000])
    return file


def test_what_cannot_be_read_is_said_in_a_sentence(
    tmp_path: Path, columns: Columns, capsys: pytest.CaptureFixture
) -> None:
    texts = tmp_path / "texts.mcap"
    cases = {
        tmp_path / "none.mcap": "there is no such file",
        cut(in_ros2(tmp_path / "cut.mcap", columns)): "it is no whole MCAP file",
        in_json(texts, [("/words", 0.0, {"data": "hello"})]): "no topic has numbers",
        in_json(tmp_path / "few.mcap", [("/row", 0.0, {"q_hip": 1.0})]): "1 rows show no hop",
        in_json(
            tmp_path / "apart.mcap", [("/a", 0.0, {"q_hip": 1.0}), ("/b", 5.0, {"force_z": 2.0})]
        ): "no time in common",
    }
    noise = tmp_path / "noise.mcap"
    noise.write_bytes(b"t,q_hip\n1,2\n")
    cases[noise] = "it is no whole MCAP file"
    for file, message in cases.items():
        assert message in refusal(["log", str(file)], capsys)


def test_damaged_bytes_never_end_in_a_traceback(
    tmp_path: Path, columns: Columns, capsys: pytest.CaptureFixture
) -> None:
    """Single bytes changed anywhere in the file."""
    whole = in_ros2(tmp_path / "whole.mcap", {name: x[:60] for name, x in columns.items()}).read_bytes()
    file, random = tmp_path / "damaged.mcap", np.random.default_rng(1)
    for at in random.integers(0, len(whole), 40):
        file.write_bytes(whole[:at] + bytes([random.integers(256)]) + whole[at + 1 :])
        assert cli.run(["log", str(file)]) in (0, 2)
        assert "Traceback" not in capsys.readouterr().err


def test_without_the_extra_the_command_says_what_to_install(
    tmp_path: Path, columns: Columns, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    def missing(name: str) -> Any:
        raise ModuleNotFoundError(name)

    file = in_ros2(tmp_path / "run.mcap", columns)
    monkeypatch.setattr(log_mcap, "import_module", missing)
    assert "is not installed: pip install 'hopopt[mcap]'" in refusal(["log", str(file)], capsys)
