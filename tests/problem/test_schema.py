"""The JSON schemas of problem files and summaries: they ship with the package, accept what is right, refuse misspelt keys."""

import json
import tomllib
from collections.abc import Iterator
from dataclasses import fields
from importlib.resources import files
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft7Validator, Draft202012Validator

from hopopt.cli.main import run
from hopopt.ocp.custom import CUSTOM_FIGURE
from hopopt.planner.solution import Solution
from hopopt.problem.catalogue import problems_folder
from hopopt.problem.load import load, resolved_toml, template
from hopopt.problem.schema import problem_schema
from hopopt.record import as_data
from hopopt.storage.summary import summary_schema
from hopopt.verify.measures import MEASURES, Measures

PROBLEMS = sorted(problems_folder().glob("*.toml"))
NAMED = ("leg.hip", "leg.knee", "leg.thigh", "leg.shank")  # tables whose names the file itself gives


def problem(text: str) -> Draft7Validator:
    """The validator of problem files, which must accept the text first."""
    found = Draft7Validator(problem_schema())
    assert not list(found.iter_errors(tomllib.loads(text)))
    return found


def tables(data: Any, path: str = "") -> Iterator[tuple[str, dict[str, Any]]]:
    """Every table within tables, with its path."""
    yield path, data
    for key, value in data.items():
        if isinstance(value, dict):
            yield from tables(value, f"{path}.{key}".lstrip("."))


@pytest.mark.parametrize(("name", "made"), [("problem", problem_schema), ("summary", summary_schema)])
def test_the_package_ships_the_schema_that_the_command_prints(
    name: str, made: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    """If it fails after a change of the model: hopopt schema NAME > src/hopopt/schemas/NAME.json."""
    assert run(["schema", name]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed == json.loads((files("hopopt") / "schemas" / f"{name}.json").read_text(encoding="utf-8")) == made()


def test_schemas_are_schemas() -> None:
    Draft7Validator.check_schema(problem_schema())
    Draft202012Validator.check_schema(summary_schema())


@pytest.mark.parametrize("path", PROBLEMS, ids=lambda path: path.stem)
def test_built_in_problems_are_accepted(path: Path) -> None:
    problem(path.read_text(encoding="utf-8"))


@pytest.mark.parametrize("path", PROBLEMS, ids=lambda path: path.stem)
def test_problems_with_every_default_filled_in_are_accepted(path: Path) -> None:
    try:
        problem(resolved_toml(load(path)))
    except Exception as error:
        if "example-robot-data" not in str(error):
            raise
        pytest.skip("needs the public robots")


def test_misspelt_keys_of_a_problem_are_refused() -> None:
    """Each key of each table of a file that states everything, with one letter too many."""
    text = resolved_toml(load("paper"))
    accepts = problem(text)
    count = 0
    for where, table in tables(tomllib.loads(text)):
        for key in table:
            wrong = tomllib.loads(text)
            place = wrong
            for step in filter(None, where.split(".")):
                place = place[step]
            if f"{where}.{key}" not in NAMED:
                place[f"{key}x"] = place.pop(key)
                assert not accepts.is_valid(wrong), f"{where}.{key}"
                count += 1
    assert count > 60


@pytest.mark.parametrize(
    "lines",
    [
        "leg.gear.ratio = 1e6", "leg.gear.ratio = true", 'solver.scheme = "euler"', "hop.stance_duration = [0.1]",
        'leg.motor = "maxon EC 45"', "solver.starts = 1.5", "leg.urdf = 3",
    ],
)  # fmt: skip
def test_values_that_no_entry_has_are_refused(lines: str) -> None:
    wrong = tomllib.loads(f'name = "x"\nextends = "paper"\n{lines}')
    assert not Draft7Validator(problem_schema()).is_valid(wrong)


def test_entries_have_meaning_unit_range_and_default() -> None:
    entry = problem_schema()["definitions"]["Solver"]["properties"]["tolerance"]
    assert entry == {
        "description": "local error allowed in every interval", "default": 1e-5, "minimum": 1e-12, "maximum": 0.01,
        "type": "number",
    }  # fmt: skip
    found = problem_schema()["definitions"]
    assert found["Body"]["properties"]["mass"]["description"].endswith("[kg]")
    bare = [f"{t}.{e}" for t, s in found.items() for e, x in s.get("properties", {}).items() if not ({"description", "$ref", "anyOf"} & x.keys() or t == "Leg")]  # fmt: skip
    assert set(bare) <= {"Solver.scheme"}


def test_a_new_file_is_accepted() -> None:
    problem(template("mine"))


def test_a_stored_summary_is_accepted_and_misspelt_keys_are_refused(hop: Solution) -> None:
    accepts = Draft202012Validator(summary_schema())
    text = json.dumps(as_data(hop.summary))
    accepts.validate(json.loads(text))
    free = ("timings_s", "losses", "saturation_mean", "energy", "active_limits", "idle_limits", "certificate", "phases")
    for where, table in tables(json.loads(text)):
        if where.split(".")[-1] in (*free, "gain_per_percent_m", "peak_torque_Nm", "peak_speed_rad_s", "intervals"):
            continue
        for key in table:
            wrong = json.loads(text)
            place = wrong
            for step in _steps(where, json.loads(text)):
                place = place[step]
            place[f"{key}x"] = place.pop(key)
            assert not accepts.is_valid(wrong), f"{where}.{key}"


def _steps(where: str, data: Any) -> Iterator[str]:
    """The keys on the way to a table; keys may hold dots."""
    while where:
        key = max((k for k in data if where == k or where.startswith(f"{k}.")), key=len)
        yield key
        data, where = data[key], where[len(key) + 1 :]


def test_a_summary_has_room_for_every_objective() -> None:
    assert {f.name for f in fields(Measures)} == {"apex_m", *MEASURES, CUSTOM_FIGURE}
