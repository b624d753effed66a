"""What a release says of itself: one version, and a citation that fits it; the source distribution has what is needed, and
the wheel works alone."""

import json
import os
import subprocess
import tomllib
import venv
from pathlib import Path

import pytest
import yaml
from packaging.requirements import Requirement
from packaging.version import Version

from hopopt.cli.setup.versions import PYTHON, TESTED
from hopopt.planner.solution import Solution

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


def test_the_citation_is_of_this_version_and_names_the_paper() -> None:
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert cited["version"] == PROJECT["project"]["version"]
    assert cited["license"] == PROJECT["project"]["license"]
    (paper,) = cited["references"]
    assert paper["url"] == PROJECT["project"]["urls"]["Paper"]
    assert len(paper["authors"]) == 8


def test_the_source_distribution_has_documents_and_problems() -> None:
    included = PROJECT["tool"]["hatch"]["build"]["targets"]["sdist"]["include"]
    assert {"src", "problems", "docs", "notebooks", "CITATION.cff", "LICENSE"} <= set(included)
    assert all((ROOT / name).exists() for name in included)


def test_every_dependency_is_tested_in_a_version_that_is_allowed() -> None:
    extras = PROJECT["project"]["optional-dependencies"]
    needs = PROJECT["project"]["dependencies"] + [
        n for e in ("dask", "explore", "mcap", "mujoco", "robots", "view") for n in extras[e]
    ]
    needed = [Requirement(line) for line in needs]
    assert {need.name for need in needed} == TESTED.keys()
    assert all(need.specifier.contains(TESTED[need.name]) for need in needed)


def test_the_pythons_that_are_tested_begin_with_the_first_that_is_allowed() -> None:
    said = [line.removeprefix(PYTHON) for line in PROJECT["project"]["classifiers"] if line.startswith(PYTHON)]
    assert PROJECT["project"]["requires-python"] == f">={min(said, key=Version)}"


# ---- the wheel alone ----------------------------------------------------------------------------------------


def done(*words: str | Path, cwd: Path, code: int = 0) -> subprocess.CompletedProcess[str]:
    """A command in an environment without this source, which ends with a code."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    found = subprocess.run(
        [str(word) for word in words], cwd=cwd, env=kept | {"HOPOPT_CACHE": "off"}, capture_output=True, text=True, timeout=600,
        check=False,
    )  # fmt: skip
    assert found.returncode == code, found.stderr[-2000:]
    return found


@pytest.fixture(scope="module")
def alone(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The command of the wheel that is built of this source, in a new environment with what it depends on, no extras."""
    home = tmp_path_factory.mktemp("alone")
    venv.create(home / "env", with_pip=True)
    bin_ = home / "env" / ("Scripts" if os.name == "nt" else "bin")
    pip = [bin_ / "python", "-m", "pip", "--quiet", "--disable-pip-version-check"]
    try:
        done(*pip, "download", "--no-deps", "--dest", home / "tried", "hatchling", cwd=home)
    except AssertionError:
        pytest.skip("pip reaches no package index here")
    done(*pip, "wheel", "--no-deps", "--wheel-dir", home / "dist", ROOT, cwd=home)
    (wheel,) = (home / "dist").iterdir()
    done(*pip, "install", "--no-compile", wheel, cwd=home)
    return bin_ / "hopopt"


@pytest.mark.slow
def test_the_wheel_alone_does_the_main_job_in_an_empty_folder(alone: Path, tmp_path: Path, hop: Solution) -> None:
    """Solve, page and exit codes; the paper's leg clears what it clears from this source. .ci/run simulates from a wheel."""
    empty = tmp_path / "an empty folder"
    empty.mkdir()
    solved = json.loads(
        done(alone, "solve", "--objective", "clearance", "--starts", "1", "--no-control", "--json", cwd=empty).stdout
    )
    assert solved["verified"]
    assert solved["clearance_m"] == pytest.approx(hop.clearance, rel=1e-4)
    result = solved["result_dir"]
    assert {path.name for path in (empty / result).iterdir()} >= {
        "solution.nc",
        "summary.json",
        "problem.toml",
        "figures",
    }
    assert done(alone, "report", result, cwd=empty).stdout.startswith("report.html written")
    assert (empty / "report.html").read_text(encoding="utf-8").startswith("<!doctype html>")
    for words, extra in ((("view", result), "view"), (("log", "run.mcap"), "mcap")):
        assert f"pip install 'hopopt[{extra}]'" in done(alone, *words, cwd=empty, code=2).stderr
