"""Damaged problem files, URDFs, arguments, logs and result folders: an answer or a sentence, never a traceback.

Seeded and small; HOPOPT_MUTANTS=50 makes fifty times as many.
"""

import json
import os
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

import hopopt as ho
from hopopt.cli.main import run
from hopopt.control.closed_loop import simulate
from hopopt.control.strategies import BUILT_IN
from hopopt.errors import HopoptError, NotSolvedError
from hopopt.leg.files.urdf import read_leg
from hopopt.leg.files.urdf_xml import UrdfError
from hopopt.planner.solution import Solution
from hopopt.problem.load import load
from hopopt.storage.solution import save
from hopopt.studies.sweep.definition import define
from hopopt.studies.sweep.point_file import NOT_SOLVED, VERIFIED, Point
from hopopt.studies.sweep.store import load_points, open_folder, read_definition, save_point

TIMES = int(os.environ.get("HOPOPT_MUTANTS", "1"))
PROBLEMS = Path(ho.__file__).parents[2] / "problems"
ODD = [
    "", "0", "-1", "1e160", "-1e308", "1e999", "nan", "inf", "1_0", "٣", "true", "[]", "{}", '""', "\x00", "\xa0", "💥",
    "9" * 5000, "x" * 300, "../..", "/dev/null", "/dev/full", "[[1]]", "=", ":", ",", "0:1:2", "1:2:1e9", "-1e308:1e308:3",
    "a=b=c", "leg", "leg.gear.ratio", "leg.gear.ratio=1:2:3", "lhs:" + "9" * 5000, "sobol:3", "<!--", "&#0;", "1e-400",
    "null", "-0.0", "1.5", "module:Class", "json:loads", "hop.stance_duration[" + "1" * 5000 + "]", "true\nfalse", "\\",
    "leg.thigh.length^1e9 = 1", "leg.gear.ratio^1e9 + 2 = 3", "catalogue: leg by leg", "1e12*leg.gear.ratio = 1e308",
]  # fmt: skip


def random(seed: int, count: int) -> Iterator[np.random.Generator]:
    """A generator for each mutant."""
    for k in range(count * TIMES):
        yield np.random.default_rng((seed, k))


def mutated(text: str, rng: np.random.Generator) -> str:
    """The text with one to three faults: a word replaced, a line lost or doubled, an end cut off, a character changed."""
    for _ in range(int(rng.integers(1, 4))):
        lines, at = text.splitlines(keepends=True), int(rng.integers(max(len(text), 1)))
        line, kind = int(rng.integers(max(len(lines), 1))), int(rng.integers(6))
        odd = ODD[int(rng.integers(len(ODD)))]
        if kind < 3 and lines:
            words = lines[line].split(" ")
            places = [k for k, word in enumerate(words) if any(c.isalnum() for c in word)] or [0]
            place = places[int(rng.integers(len(places)))]
            old = words[place].strip('",[]<>/\n') or words[place]
            words[place] = words[place].replace(old, odd) if old else odd
            lines[line] = " ".join(words)
            text = "".join(lines)
        elif kind == 3:
            text = text[:at] + odd + text[at + int(rng.integers(3)) :]
        elif kind == 4 and lines:
            text = "".join([*lines[:line], *([lines[line]] * 2 if rng.integers(2) else []), *lines[line + 1 :]])
        elif rng.integers(5) == 0:
            text = text[:at]
    return text


def damaged(content: bytes, rng: np.random.Generator) -> bytes:
    """Bytes with a few of them changed, or cut off."""
    at = int(rng.integers(max(len(content), 1)))
    if rng.integers(4) == 0:
        return content[:at]
    many = np.frombuffer(content, np.uint8).copy()
    many[at : at + int(rng.integers(1, 9))] = rng.integers(256)
    return many.tobytes()


def test_problem_files(tmp_path: Path) -> None:
    texts = [path.read_text(encoding="utf-8") for path in sorted(PROBLEMS.glob("*.toml"))]
    path, refused = tmp_path / "m.toml", 0
    shutil.copy(PROBLEMS / "three_joint.urdf", tmp_path)
    for rng in random(1, 100):
        path.write_text(mutated(texts[int(rng.integers(len(texts)))], rng), encoding="utf-8", errors="surrogatepass")
        try:
            load(path)
        except HopoptError as error:
            refused += 1
            assert str(error)
    assert refused > 20 * TIMES


def test_urdfs() -> None:
    text, refused = (PROBLEMS / "three_joint.urdf").read_text(encoding="utf-8"), 0
    for rng in random(2, 500):
        try:
            leg = read_leg(mutated(text, rng).encode(), ("hip", "knee", "ankle"), "toe", {})
        except UrdfError as error:
            refused += 1
            assert str(error)
            continue
        figures = [x for link in leg.links for x in (*link.axis, *link.vector, link.mass, *link.com, *link.inertia)]
        assert np.isfinite(figures).all()
    assert refused > 100 * TIMES


OPTIONS = ["--set", "--vary", "--sample", "--seed", "--starts", "--processes", "--objective", "--free", "--couple", "--json",
           "--constraint", "--resume", "--results", "--result", "--time-limit", "--scheduler", "--strategies", "--option",
           "--plan", "--bound", "--draws", "--points", "--against", "--grids", "--nodes", "--urdf", "--confirm", "--hop",
           "--hops", "--basin", "--share", "--confidence", "--evaluations", "--known", "--map", "--output", "--leg", "--why",
           "--worth", "--tune", "--mass", "--torque", "--to", "--from", "--clearance", "--most"]  # fmt: skip
COMMANDS = ["solve", "sweep", "show", "verify", "new", "simulate", "compare", "export", "sensitivity", "diagnose",
            "pareto", "families", "evidence", "calibrate", "tune", "schema", "actuators", "animate", "robust", "identify",
            "log", "report", "reproduce", "transition"]  # fmt: skip
USUAL = {
    "--set": "leg.gear.ratio={}", "--vary": "leg.gear.ratio={}", "--free": "leg.gear.ratio={}", "--sample": "lhs:{}",
    "--couple": "leg.gear.ratio^{} = 3", "--objective": "{}",
}  # fmt: skip


def arguments(rng: np.random.Generator) -> list[str]:
    """A command line of a command, what it is for, and options, most of them odd."""
    words = [COMMANDS[int(rng.integers(len(COMMANDS)))], *(["paper"] if rng.integers(2) else [])]
    if rng.integers(3) == 0:
        words.append(ODD[int(rng.integers(len(ODD)))])
    for _ in range(int(rng.integers(1, 4))):
        option, odd = OPTIONS[int(rng.integers(len(OPTIONS)))], ODD[int(rng.integers(len(ODD)))]
        words += [option, USUAL.get(option, "{}").format(odd) if rng.integers(2) else odd]
    return words


@pytest.fixture
def no_search(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """What takes long ends as a problem without a solution does; files are written below ``tmp_path``."""

    def ended(*args: object, **more: object) -> None:
        raise NotSolvedError("not solved in this test")

    monkeypatch.chdir(tmp_path)
    for place in (
        "planner.solve.solve", "studies.codesign.codesign", "cli.studies.sweep.run", "control.closed_loop.simulate",
        "comparison.compare.compare", "cli.controllers.simulate.plan_to_track", "cli.studies.pareto.front",
        "cli.studies.families.open_folder", "evidence.local_optima.run_starts", "paper.fit.calibrate",
        "comparison.gain_tuning.tune", "comparison.robust.robust.robust", "cli.controllers.compare.compare_hops",
        "cli.robot_data.identify.identification", "cli.paper.reproduce.simulate", "cli.controllers.compare.ladder",
        "cli.answer.diagnose.worths", "comparison.hops.transition.solve", "comparison.hops.transition.plan_hops",
    ):  # fmt: skip
        monkeypatch.setattr(f"hopopt.{place}", ended)


def test_arguments(no_search: None, capsys: pytest.CaptureFixture[str]) -> None:
    codes = []
    for rng in random(3, 150):
        words = arguments(rng)
        codes.append(run(words))
        assert codes[-1] in (0, 1, 2, 3), words
        assert "Traceback" not in capsys.readouterr().err, words
    assert codes.count(2) > 50 * TIMES


@pytest.mark.slow
def test_logs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Those of a robot's hop and their maps of names."""
    trace = simulate(load("paper"), BUILT_IN["force"]).trace
    rows = np.flatnonzero(np.diff(trace.t, prepend=-1.0) > 1e-6)[::4]
    names = ["t", *(f"{part}_{joint}" for part in ("q", "v", "tau") for joint in ("hip", "knee")), "force_z"]
    columns = [trace.t, *trace.q.T[-2:], *trace.v.T[-2:], *trace.motor.T, trace.f[:, 1]]
    lines = [",".join(f"{x[row]:.6g}" for x in columns) for row in rows]
    whole = "\n".join([",".join(names), *lines]) + "\n"
    path, map_, codes = tmp_path / "run.csv", tmp_path / "names.toml", []
    for rng in random(6, 60):
        faulty = mutated(whole.replace(",", " , "), rng).replace(" , ", ",") if rng.integers(4) else mutated(whole, rng)
        path.write_text(faulty, encoding="utf-8", errors="surrogatepass")
        map_.write_text(mutated('q_hip = "q_hip"\n', rng), encoding="utf-8", errors="surrogatepass")
        codes.append(run(["log", str(path), "--json", *(["--map", str(map_)] if rng.integers(3) == 0 else [])]))
        assert codes[-1] in (0, 2)
        out = capsys.readouterr()
        assert "Traceback" not in out.err
        if codes[-1] == 0:
            json.loads(out.out, parse_constant=lambda word: pytest.fail(f"{word} among the figures"))
    assert codes.count(2) > 10 * TIMES


def test_result_folders(hop: Solution, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """One that was changed is never shown as verified."""
    whole = save(hop, tmp_path / "whole").result_dir
    assert whole is not None
    files = sorted(path.name for path in whole.iterdir() if path.is_file())
    for rng in random(4, 40):
        folder = tmp_path / "damaged"
        shutil.copytree(whole, folder)
        path = folder / files[int(rng.integers(len(files)))]
        before = path.read_bytes()
        path.write_bytes(
            mutated(before.decode(), rng).encode() if path.suffix != ".nc" and rng.integers(2) else damaged(before, rng)
        )
        changed = path.read_bytes() != before
        code, out = run(["show", str(folder), "--json"]), capsys.readouterr()
        assert code in (0, 2)
        assert "Traceback" not in out.err
        if code == 0 and changed:
            assert json.loads(out.out)["verified"] is False or path.name == "manifest.json"
        shutil.rmtree(folder)


def read_study(folder: Path) -> None:
    load_points(folder, read_definition(folder))


@pytest.mark.parametrize(
    "read", [read_study, lambda folder: run(["sweep", "--resume", str(folder), "--scheduler", "x://y"])]
)
def test_study_folders(read: Callable[[Path], object], tmp_path: Path) -> None:
    definition = define(load("paper"), {"leg.gear.ratio": [90.0, 100.0]})
    whole = open_folder(definition, tmp_path / "whole")
    parts = {"a": 0.1, "b": 0.2}
    begin = {"x": np.zeros(3), "shape": np.zeros(3)}
    save_point(
        whole, Point(0, definition.values(0), VERIFIED, objective_value=0.3, clearance_m=0.3, parts=parts), begin
    )
    save_point(whole, Point(1, definition.values(1), NOT_SOLVED, "in a sentence"), {})
    read_study(whole)
    files = sorted(path.relative_to(whole) for path in whole.rglob("*") if path.is_file())
    for rng in random(5, 40):
        folder = tmp_path / "damaged"
        shutil.copytree(whole, folder)
        path = folder / files[int(rng.integers(len(files)))]
        before = path.read_bytes()
        path.write_bytes(mutated(before.decode(), rng).encode() if path.suffix != ".npz" else damaged(before, rng))
        try:
            read(folder)
        except HopoptError as error:
            assert str(error)
        shutil.rmtree(folder)
