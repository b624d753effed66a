"""What a user sees: exit codes, messages, files."""

import json
import re
import shutil
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import hopopt as ho
from command_line import said
from hopopt import load
from hopopt.cli import main as cli
from hopopt.cli.screen.answer import short
from hopopt.cli.screen.console import show
from hopopt.errors import NotSolvedError, one_line
from hopopt.planner.answer.extras import GlobalMethod, HopFamily
from waiting import beside_progress, wait_for

ROOT = Path(__file__).parents[2]
HOPOPT = [sys.executable, "-m", "hopopt.cli.main"]
COARSE = ["--starts", "1", "--no-figures", "--set", "solver.refine=false"]


def apart(*arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    """The command in a process of its own, as from a shell."""
    return subprocess.run([*HOPOPT, *arguments], cwd=cwd, capture_output=True, text=True, timeout=1200, check=False)


@pytest.fixture(scope="module")
def solved(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict, Path]:
    """The paper's leg solved by the command line with one start, as JSON; and the folder it ran in."""
    folder = tmp_path_factory.mktemp("solved")
    done = apart("solve", "--objective", "clearance", "--starts", "1", "--json", cwd=folder)
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stderr == ""  # silent when piped
    return json.loads(done.stdout), folder


def test_json_answer(solved: tuple[dict, Path]) -> None:
    s, _ = solved
    expected = (
        "objective clearance_m status verified exit_code phases saturation_mean verification starts wall_s result_dir"
    )
    assert set(expected.split()) <= set(s)
    assert s["verified"] is True
    assert s["exit_code"] == 0
    assert all(check["passed"] for check in s["verification"])
    assert sum(s["parts"].values()) == pytest.approx(s["clearance_m"], abs=1e-12)
    assert s["phases"]["stance"]["duration_s"] <= 0.4 + 1e-9


def test_result_folder(solved: tuple[dict, Path]) -> None:
    s, folder = solved
    result = folder / s["result_dir"]
    assert re.fullmatch(r"paper-[0-9a-f]{8}", result.name)
    assert {p.name for p in result.iterdir()} == {
        "solution.nc",
        "summary.json",
        "problem.toml",
        "manifest.json",
        "figures",
    }
    assert json.loads((result / "summary.json").read_text())["clearance_m"] == s["clearance_m"]
    assert len(list((result / "figures").glob("*.png"))) == 5
    assert ho.load(result / "problem.toml") == ho.load("paper")
    with xr.open_dataset(result / "solution.nc", group="stance", engine="h5netcdf") as data:
        assert data["tau"].attrs["units"] == "N m"
        assert list(data["joint"].values) == ["hip", "knee"]


def test_stored_solution_samples_as_the_tables_say(solved: tuple[dict, Path]) -> None:
    s, folder = solved
    solution = ho.read(folder / s["result_dir"])
    table = solution.tables["flight"]
    samples = solution.sample(table.t[1:-1, 4])
    np.testing.assert_allclose(samples.q, table.q[1:-1, 4], atol=1e-9)
    np.testing.assert_allclose(samples.tau, table.tau[1:-1, 4], atol=1e-5)
    assert solution.clearance == s["clearance_m"]


def test_verify_command_agrees(solved: tuple[dict, Path]) -> None:
    s, folder = solved
    done = said("verify", s["result_dir"], "--json", cwd=folder)
    assert done.returncode == 0, done.stdout
    assert json.loads(done.stdout)["verified"] is True


@pytest.mark.parametrize(
    ("group", "name", "fails"),
    [("stance", "tau", "stance replay"), pytest.param("flight", "q", "claimed height", marks=pytest.mark.slow)],
)
def test_a_tampered_file_fails(solved: tuple[dict, Path], tmp_path: Path, group: str, name: str, fails: str) -> None:
    s, folder = solved
    copy = tmp_path / "tampered"
    shutil.copytree(folder / s["result_dir"], copy)
    with xr.open_datatree(copy / "solution.nc", engine="h5netcdf") as tree:
        tree = tree.load()
    tree[group][name] = tree[group][name] * 1.01
    tree.to_netcdf(copy / "solution.nc", engine="h5netcdf")
    done = said("verify", str(copy), "--json", cwd=tmp_path)
    assert done.returncode == 3
    found = json.loads(done.stdout)
    failed = [c["name"] for c in (*found["checks"], *found["checks_of_the_file"]) if not c["passed"]]
    assert fails in failed
    assert {"tables agree with the collocation data", "files as they were written"} <= set(failed)


@pytest.mark.slow
def test_coarse_hop_is_not_stated_as_an_answer(tmp_path: Path) -> None:
    mesh = ["--set", "solver.stance_intervals=12", "--set", "solver.flight_intervals=12"]
    done = said("solve", *COARSE, *mesh, cwd=tmp_path)
    assert done.returncode == 3
    assert "NOT verified" in done.stdout
    assert "clearance 0" not in done.stdout
    assert "FAILED" in done.stdout
    (result,) = (tmp_path / "results").iterdir()
    summary = json.loads((result / "summary.json").read_text())
    assert summary["verified"] is False
    assert summary["starts"]["each"][0]["status"] == "Solve_Succeeded"  # Ipopt's word is not the truth
    again = said("solve", *COARSE, *mesh, cwd=tmp_path)
    assert again.returncode == 3
    assert len(list((tmp_path / "results").iterdir())) == 2  # nothing is overwritten


def test_ctrl_c_while_ipopt_works_is_heeded_and_said(tmp_path: Path) -> None:
    """CasADi would swallow it: the solve must not go on, and nothing is left behind. (A mesh that takes many seconds.)"""
    iterations = tmp_path / "iterations.txt"
    (tmp_path / "ipopt.opt").write_text(f"output_file {iterations.name}\nfile_print_level 5\n")  # Ipopt reads it
    command = [*HOPOPT, "solve", *COARSE, "--set", "solver.stance_intervals=1000"]
    running = subprocess.Popen(
        command, cwd=tmp_path, stderr=subprocess.PIPE, text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )  # fmt: skip
    wait_for(lambda: iterations.exists() and re.search(r"^ +1 ", iterations.read_text(), re.MULTILINE), running)
    running.send_signal(signal.SIGINT)
    words = running.communicate(timeout=600)[1]
    assert running.returncode in (130, -signal.SIGINT), words
    assert beside_progress(words) == ["hopopt: interrupted; nothing was written"]
    assert not (tmp_path / "results").exists()


@pytest.mark.slow
def test_motor_too_weak_to_stand(tmp_path: Path) -> None:
    done = said("solve", *COARSE, "--set", "leg.motor.max_torque=0.1", cwd=tmp_path)
    assert done.returncode == 1
    assert "Traceback" not in done.stderr
    assert re.search(
        r"the knee needs [\d.]+ N m to hold the start pose in stance at 0 s; its drive gives 10.0 N m", done.stderr
    )
    assert not (tmp_path / "results").exists()


def test_infeasible_hop_names_the_worst_constraints(tmp_path: Path) -> None:
    """A stance too short to leave the ground rising: nothing on the paper's leg can accelerate it so fast."""
    short = ["--set", "hop.stance_duration=[0.03, 0.031]", "--set", "hop.flight_duration=[0.6, 0.7]"]
    done = said("solve", *COARSE, *short, "--set", "solver.max_iterations=50", cwd=tmp_path)
    assert done.returncode == 1
    assert "Traceback" not in done.stderr
    assert re.search(
        r"is missed by [\d.e+-]+ ?\S* (in (stance|flight), [\d.]+ s after it began|between the phases)", done.stderr
    )


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["solve", "nowhere.toml"], ["nowhere.toml"]),
        (["solve", "--objective", "glory"], ["glory", "clearance", "apex"]),
        (["solve", "--set", "leg.gear.rato=80"], ["leg.gear.rato", "ratio"]),
        (["solve", "--set", "leg.shank.length=361"], ["leg.shank.length", "361", "millimetres"]),
        (["solve", "--set", "start.hip_height=0.2"], ["start.hip_height", "limits"]),
        (["solve", "--starts", "0"], ["--starts"]),
        (["solve", "--starts", "many"], ["many"]),
        (["sovle"], ["sovle"]),
        (["verify", "nowhere"], ["nowhere: there is no such folder", "hopopt solve"]),
        (["verify", "."], ["solution.nc is missing", "hopopt solve"]),
        (["solve", "paper.toml"], ["the built-in problem is called paper"]),
        (["solve", "--set", "leg.motor.laws=[]"], ["leg.motor.laws", "torque_cap", "speed_cap"]),
        (["solve", "--set", "leg.body.mass=1e400"], ["leg.body.mass", "not finite"]),
        (["solve", "--set", "solver.starts=-3"], ["solver.starts", "too small", "1 to 1000"]),
        (["new", "ü"], ['hopopt: name = "ü" is not allowed']),
        (["new", ""], ['"" names no file', "legs/mine"]),
        (["new", "../up/"], ['"../up/" names no file']),
    ],
)
def test_wrong_usage(arguments: list[str], words: list[str], tmp_path: Path) -> None:
    done = said(*arguments, cwd=tmp_path)
    assert done.returncode == 2
    assert done.stdout == ""
    assert "Traceback" not in done.stderr
    for word in words:
        assert word in done.stderr
    assert not list(tmp_path.iterdir())


def test_show(tmp_path: Path) -> None:
    done = said("show", "--json", "--set", "leg.gear.ratio=80", cwd=tmp_path)
    entries = json.loads(done.stdout)
    assert entries["leg.gear.ratio"]["value"] == 80
    assert entries["leg.thigh.length"] == {
        "value": 0.38,
        "unit": "m",
        "meaning": entries["leg.thigh.length"]["meaning"],
    }
    text = said("show", cwd=tmp_path).stdout
    assert re.search(r"leg\.motor\.max_torque +2\.0 +N m", text)
    assert entries["doubts"] == []
    assert entries["derived"]["joints"][1]["stall_torque"] == pytest.approx(160.0)
    assert "mass 8.27 kg, weight 81.13 N" in text
    assert re.search(r"knee +200 +12\.6 +628 +0\.119 +0\.0348", text)
    assert "doubt" not in text
    assert "doubt: the hip turns at" in said("show", "--set", "leg.motor.max_speed=60", cwd=tmp_path).stdout


def test_a_shape_is_shown_in_one_row(tmp_path: Path) -> None:
    shape = "points = [[0, 0, 0], [0, 0, -0.3]]\nradius = 0.025"
    trunk = "[leg.body.shapes.trunk]\npolygon = [[-0.2, 0], [0.2, 0], [0, 0.1]]\nradius = 1\ncounts = false"
    (tmp_path / "mine.toml").write_text(
        f'extends = "paper"\nname = "mine"\n{trunk}\n[leg.shank.shapes.calf]\n{shape}\n'
    )
    text = said("show", "mine.toml", cwd=tmp_path).stdout
    assert re.search(r"leg\.body\.shapes\.trunk +3 corners of a polygon; radius 1\.0; counts false +m", text)
    assert re.search(r"leg\.shank\.shapes\.calf +2 points; radius 0\.025 +m", text)
    assert text.count(".shapes.") == 2
    entries = json.loads(said("show", "mine.toml", "--json", cwd=tmp_path).stdout)
    assert entries["leg.shank.shapes.calf.radius"]["value"] == 0.025


def test_a_stored_answer_is_shown_whole(solved: tuple[dict, Path]) -> None:
    """With what the paper's control reaches, which is simulated after it was stored; short where it was found."""
    s, folder = solved
    assert json.loads(said("show", s["result_dir"], "--json", cwd=folder).stdout) == s
    whole = said("show", s["result_dir"], cwd=folder).stdout
    for name in ("hop", "effort", "limits", "control", "structure", "evidence", "results"):
        assert re.search(rf"^  {name} ", whole, re.M), name
    assert f"{s['paper_strategy']['share_of_bound']:.0%} of the optimum" in whole
    short = said("solve", *COARSE, "--no-control", cwd=folder).stdout  # not verified: whole too
    assert "FAILED" in short
    copy = shutil.copytree(folder / s["result_dir"], folder / "copy")
    for summary in ({}, [], {**s, "phases": {}}, {**s, "parts": None}):  # damaged, or of another version
        (copy / "summary.json").write_text(json.dumps(summary))
        done = said("show", str(copy), cwd=folder)
        assert done.returncode == 2
        assert done.stderr.startswith(f"hopopt: {copy}")
        assert done.stderr.endswith("solve it again\n")
        assert len(done.stderr.splitlines()) == 1
        assert done.stdout == ""
    done = said("show", s["result_dir"], "--set", "leg.gear.ratio=80", cwd=folder)
    assert done.returncode == 2
    assert "stored answer" in done.stderr


def test_new_never_overwrites(tmp_path: Path) -> None:
    assert said("new", "mine", cwd=tmp_path).returncode == 0
    text = (tmp_path / "mine.toml").read_text()
    assert ho.load(tmp_path / "mine.toml").name == "mine"
    done = said("new", "mine.toml", cwd=tmp_path)
    assert done.returncode == 2
    assert "exists already" in done.stderr
    assert (tmp_path / "mine.toml").read_text() == text


def test_help_answers_at_once(tmp_path: Path) -> None:
    """Nothing heavy is imported for the help; the time itself is shown by the benchmark."""
    code = "import sys, hopopt.cli.main as c; c.run(['--help']); print(sorted({'casadi','numpy','pinocchio','scipy'} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert done.stdout.strip().endswith("[]")
    assert "hopopt solve --objective clearance" in done.stdout


def test_it_runs_as_a_module_too(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "hopopt", "solve", "--starts", "x"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert "--starts" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.rarely
def test_several_starts_side_by_side(tmp_path: Path) -> None:
    done = said("solve", "--json", "--no-figures", "--starts", "5", "--set", "solver.refine=false", cwd=tmp_path)
    s = json.loads(done.stdout)
    assert done.returncode == 3
    count = s["starts"]["count"]
    assert count > 5  # relaxed problems and motions of the global method beside the starts
    assert sum(o["count"] for o in s["starts"]["optima"]) + len(s["starts"]["failed"]) == count
    best = max(o["objective"] for o in s["starts"]["optima"])
    assert best == max(e["objective"] for e in s["starts"]["each"] if e["status"] == "Solve_Succeeded")


def readme_block(language: str, containing: str) -> str:
    blocks = re.findall(rf"```{language}\n(.*?)```", (ROOT / "README.md").read_text(), re.S)
    return next(block for block in blocks if containing in block)


def test_the_answer_in_the_readme(solved: tuple[dict, Path], capsys: pytest.CaptureFixture[str]) -> None:
    """Word by word, but for figures: the last digits are a machine's. One start is solved here, so what the search of
    several starts found is put in."""

    def words(text: str) -> str:
        return re.sub(r"[-+]?\d+(\.\d+)?(e-\d+)?", "#", text).replace("starts", "start")

    s, folder = solved
    solution = ho.read(folder / s["result_dir"])
    better, worse = (
        HopFamily(height, height, height > 0.75, (name,), 1, "")
        for height, name in ((0.8, "push"), (0.7, "wider joint range"))
    )
    searched = replace(
        solution.summary,
        starts=replace(solution.summary.starts, count=13, asked=6, apart=1e-3),
        searched=True,
        families=(better, worse),
        global_=GlobalMethod("some", (15,) * 4, 0.775, False, motion_m=0.78, solved_m=solution.clearance),
    )
    show(short(solution.noted(summary=searched)))
    told, shown = words(capsys.readouterr().out), readme_block("text", "clearance")
    for line in shown.splitlines():
        assert all(words(part) in told for part in line.split("...")), line
    (height,), (share,) = (re.findall(words, shown) for words in (r"clearance (\S+) m, ver", r"(\d+)% of the optimum"))
    assert float(height) == pytest.approx(s["clearance_m"], abs=1e-4)
    assert int(share) / 100 == pytest.approx(s["paper_strategy"]["share_of_bound"], abs=0.006)


@pytest.mark.slow
def test_readme_commands(tmp_path: Path) -> None:
    """With one start: .ci/run searches, by the README's main command."""
    for line in readme_block("sh", "hopopt new").splitlines():
        command = [*line.split("#")[0].split(), *(ONE_START if "solve" in line else [])]
        if command[2].startswith("results/"):
            command[2] = str(next(p for p in (tmp_path / "results").iterdir() if p.name.startswith("my_leg")))
        done = said(*command[1:], cwd=tmp_path)
        assert done.returncode == 0, f"{line}\n{done.stdout}{done.stderr}"


ONE_START = ["--set", "solver.starts=1"]  # where a command takes minutes with all of them
SHORT = [
    "--set",
    "hop.stance_duration=[0.03, 0.2]",
    "--set",
    "simulation.control_rate=1000",
]  # few intervals and periods


@pytest.mark.rarely
def test_readme_commands_about_controllers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With the user-defined strategy that docs/own_controller.md shows."""
    shown = re.findall(r"```python\n(.*?)```", (ROOT / "docs" / "own_controller.md").read_text(), re.S)[0]
    (tmp_path / "my_module.py").write_text(shown.replace("class PushThenTuck", "class MyController"))
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr("hopopt.comparison.robust.robust.TUNING_DRAWS", 4)
    said("new", "my_leg", cwd=tmp_path)
    lines = readme_block("sh", "hopopt compare") + readme_block("sh", "hopopt sensitivity")
    for line in lines.splitlines():
        few = "--share 0.5 --confidence 0.5 --draws 4 --evaluations 1 --starts 1"  # the whole takes minutes
        command = line.split("#")[0].replace("--draws 60 --evaluations 4", few).split()
        more = ONE_START if command[1] in ("compare", "sensitivity", "sweep") else []
        done = said(*command[1:], *more, *SHORT, cwd=tmp_path)
        assert done.returncode == 0, f"{line}\n{done.stdout}{done.stderr}"


@pytest.mark.rarely
def test_readme_commands_about_costs(tmp_path: Path) -> None:
    for line in readme_block("sh", "hopopt pareto").splitlines():
        command = line.split("#")[0].replace("--points 4 --starts 2", "--points 3").split()
        done = said(*command[1:], *ONE_START, *SHORT, cwd=tmp_path)
        assert done.returncode == 0, f"{line}\n{done.stdout}{done.stderr}"


@pytest.mark.slow
def test_readme_python(tmp_path: Path) -> None:
    code = readme_block("python", "import hopopt")
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.endswith("True\n")
    assert (tmp_path / "heights.png").stat().st_size > 10_000


@pytest.mark.slow
@pytest.mark.parametrize("problem", ["paper_no_countermovement", "paper_four_quadrant"])
def test_built_in_variants_are_verified(problem: str, tmp_path: Path) -> None:
    done = said("solve", problem, "--starts", "1", "--no-figures", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    assert json.loads(done.stdout)["verified"] is True


def test_a_wrong_option_points_at_its_command_s_help(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.run(["sweep", "paper", "--vary"]) == 2
    assert capsys.readouterr().err.endswith("Try: hopopt sweep --help\n")
    assert cli.run(["nonsense"]) == 2
    assert capsys.readouterr().err.endswith("Try: hopopt --help\n")


def test_a_new_problem_may_lie_in_a_new_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert cli.run(["new", "legs/mine"]) == 0
    assert load("legs/mine.toml").name == "mine"
    assert cli.run(["new", "legs/mine"]) == 2  # not overwritten


def test_the_sentences_of_an_error_in_one_line() -> None:
    error = NotSolvedError("mine: no hop (upright: failed).", ["Worst constraints:", "a is missed by 1 m", "b by 2 m"])
    assert one_line(error) == "mine: no hop (upright: failed). Worst constraints: a is missed by 1 m; b by 2 m"


def test_no_strategy_and_a_misspelt_table_are_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.run(["compare", "--strategies", ","]) == 2
    assert "--strategies names none" in capsys.readouterr().err
    (tmp_path / "mine.toml").write_text(
        'name = "mine"\n[leg]\njoints = ["hip"]\nlinks = ["thigh"]\n[leg.bodi]\nmass = 3\n'
    )
    assert cli.run(["show", str(tmp_path / "mine.toml")]) == 2
    said = capsys.readouterr().err
    assert "leg.bodi is not a known key (did you mean body?)" in said
    assert "None" not in said
