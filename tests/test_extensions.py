"""Modules of a user's own: named in problem files, recorded in results, asked for where they are missing."""

import json
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import hopopt as ho
from hopopt import extensions
from hopopt.cli.main import run
from hopopt.control.strategies import find as strategy
from hopopt.errors import ProblemFileError, UsageError
from hopopt.ocp.objectives.registry import find
from hopopt.planner.solution import Solution
from registries import clean_registries

MODULE = """
from math import sqrt

import casadi as ca
import hopopt as ho
from hopopt.control.strategies import BUILT_IN
from hopopt.drivetrain.operating_region.half_planes import HalfPlane
from hopopt.drivetrain.operating_region.laws import LAWS
from hopopt.nlp.schemes import SCHEMES, Scheme
from hopopt.ocp.objectives.registry import OBJECTIVES
from hopopt.ocp.rules import RULES

__version__ = "1.2"


def derated(torque, speed):
    return [HalfPlane("derated line", sign * torque / 0.9, sign * speed, "forward") for sign in (1, -1)]


@ho.constraint(upper=400.0, unit="N", scale=400.0, phases=("stance",))
def soft(now):
    return now.f[-1]


@ho.objective(unit="m", scale=0.5)
def com_rise(end):
    return end.points["com"][1] - end.lift_off.points["com"][1]


class Push:
    def __init__(self, setting):
        pass

    def torque(self, now):
        return 0 * now.q


c = (0.0, (1 - 1 / sqrt(5)) / 2, (1 + 1 / sqrt(5)) / 2, 1.0)
LAWS["derated"], RULES["soft"], OBJECTIVES["com_rise"], BUILT_IN["push"] = derated, soft, com_rise, Push
SCHEMES["lobatto-4"] = Scheme("lobatto-4", c, c, order=6)
"""
PROBLEM = """extends = "paper"
name = "mine"
[leg.motor]
laws = ["derated"]
[hop]
constraints = ["soft"]
[solver]
scheme = "lobatto-4"
"""


@pytest.fixture
def module(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """The module in the current folder, under a name of this test alone."""
    name = f"my_{re.sub(r'[^a-z0-9]', '_', tmp_path.name.lower())}"
    (tmp_path / f"{name}.py").write_text(MODULE)
    (tmp_path / "leg.toml").write_text(PROBLEM)
    monkeypatch.chdir(tmp_path)
    with clean_registries():
        yield name


def test_a_problem_file_names_and_does_not_load(module: str) -> None:
    with pytest.raises(ProblemFileError) as refused:
        ho.load("leg.toml")
    assert [("--with my_module" in words) for words in refused.value.problems] == [True] * 3
    assert module not in sys.modules
    with pytest.raises(ProblemFileError, match=f"needs {module}: add --with {module}"):
        ho.load("leg.toml", {"needs": [module]})
    assert module not in sys.modules


def test_names_of_a_module_that_was_asked_for_may_stand_in_a_problem(module: str) -> None:
    extensions.load(module)
    design = ho.load("leg.toml")
    assert design.needs == (module,)
    assert find("com_rise").unit == "m"
    assert strategy("push").meaning == f"from {module}"
    (found,) = extensions.used([("law", "derated"), ("law", "paper"), ("constraint", "soft")])
    assert (found.module, found.version, found.entries) == (module, "1.2", ("law derated", "constraint soft"))
    assert not extensions.doubts([found])
    Path(f"{module}.py").write_text(MODULE + "\n# changed\n")
    assert "not as it was" in extensions.doubts([found])[0]


def test_what_is_built_in_stays(module: str) -> None:
    Path(f"{module}.py").write_text(MODULE + 'LAWS["paper"] = derated\n')
    with pytest.raises(UsageError, match="the law paper is built in: choose another name"):
        extensions.load(module)


@pytest.mark.parametrize("name", ["no_such_module", "../evil", "os.path; import os", ""])
def test_a_module_that_is_none_is_said_in_a_sentence(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["show", "--with", name]) == 2
    (said,) = capsys.readouterr().err.splitlines()
    assert f"--with {name}" in said or "write the name of a module" in said


def test_a_module_alone_shows_how_to_begin(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["--with", "json"]) == 0
    assert "Begin with:" in capsys.readouterr().out


def test_a_module_with_an_error_is_said_in_a_sentence(module: str, capsys: pytest.CaptureFixture[str]) -> None:
    Path(f"{module}.py").write_text("1 / 0\n")
    assert run(["show", f"--with={module}"]) == 2
    assert "cannot be imported: ZeroDivisionError" in capsys.readouterr().err


def test_installed_modules_are_found_by_their_entry_point(module: str, tmp_path: Path) -> None:
    """A package of another process, which nothing but its metadata tells of."""
    info = tmp_path / "mine-3.4.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: mine\nVersion: 3.4\n")
    (info / "entry_points.txt").write_text(f"[hopopt]\nmine = {module}\n")
    words = "import hopopt as ho, sys; print(ho.load('paper').needs, ho.load('leg.toml').needs)"
    done = subprocess.run(
        [sys.executable, "-c", words], capture_output=True, text=True, check=True, env=with_path(tmp_path)
    )
    assert done.stdout.split("\n")[0] == f"None ('{module}',)"


def with_path(folder: Path) -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": f"{folder}{os.pathsep}{os.environ.get('PYTHONPATH', '')}"}


def hopopt(*words: str) -> "subprocess.CompletedProcess[str]":
    return subprocess.run([sys.executable, "-m", "hopopt", *words], capture_output=True, text=True, check=False)


@pytest.mark.slow
def test_an_answer_with_own_law_scheme_constraint_and_objective_is_read_and_verified_elsewhere(module: str) -> None:
    """Each command in a process of its own, with the module and without."""
    asked = ["solve", "leg.toml", "--objective", "com_rise", "--starts", "1", "--no-figures", "--no-control", "--json"]
    refused = hopopt(*asked)
    assert refused.returncode == 2
    assert "--with my_module" in refused.stderr
    found = json.loads(hopopt(*asked, "--with", module).stdout)
    assert found["verified"]
    assert found["peak_vertical_force_N"] == pytest.approx(400, rel=1e-3)
    (recorded,) = found["extensions"]
    assert recorded["entries"] == ["law derated", "constraint soft", "scheme lobatto-4", "objective com_rise"]
    folder = found["result_dir"]
    again = hopopt("verify", folder, "--with", module, "--json")
    assert again.returncode == 0
    assert {"stance soft", "claimed com_rise"} <= {c["name"] for c in json.loads(again.stdout)["checks"]}
    without = hopopt("verify", folder)
    assert without.returncode == 2
    assert without.stderr.splitlines() == [
        f"hopopt: {folder} needs {module}: add --with {module}, or import {module} in Python"
    ]
    shown = hopopt("show", folder)
    assert shown.returncode == 0
    assert f"needs {module}" in shown.stdout
    assert "limited by soft too" in shown.stdout


def test_a_result_without_its_module_is_still_a_motion(module: str, hop: Solution, tmp_path: Path) -> None:
    design = ho.load("paper", {"needs": [module], "name": "mine"}, without_modules=True)
    record = (extensions.Extension(module, "1.2", "0" * 16, ("law derated",)),)
    laws = design.leg.model_copy(update={"motor": design.leg.motor.model_copy(update={"laws": ("derated",)})})
    stored = hop.noted(design=design.model_copy(update={"leg": laws})).with_summary(extensions=record)
    read = ho.read(str(ho.save(stored, tmp_path).result_dir))
    assert read.clearance == hop.clearance
    assert read.sample([0.1]).q.shape == (1, 4)
    assert any(words.startswith(f"needs {module}") for words in read.shown.notes)
    with pytest.raises(UsageError, match=f"needs {module}"):
        read.sensitivity()
