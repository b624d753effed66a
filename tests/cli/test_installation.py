"""hopopt doctor: what there is, what is missing, and a self-test that finds an installation that computes wrongly."""

import json
import re
from importlib.metadata import version

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest

from hopopt.cli import main as cli
from hopopt.cli.setup import installation, versions
from hopopt.cli.setup.installation import SELF_TESTS, Finding, findings


@pytest.fixture(scope="module")
def found() -> dict[str, Finding]:
    return {f.name: f for f in findings()}


def test_this_installation_works(found: dict[str, Finding]) -> None:
    assert all(f.ok for f in found.values() if f.needed), found
    assert found["casadi"].found == version("casadi")
    assert [f.name for f in found.values() if f.group == "self-test"] == list(SELF_TESTS)


def test_a_wrong_result_of_a_library_is_found(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture) -> None:
    """Torques off by a millionth: the self-test fails, the command says so and ends with 1."""
    rnea = pin.rnea
    monkeypatch.setattr(pin, "rnea", lambda *given: (1 + 1e-6) * rnea(*given))
    monkeypatch.setattr(installation, "SELF_TESTS", {"dynamics, CasADi and Pinocchio": installation.dynamics})
    assert cli.run(["doctor", "--json"]) == 1
    data = json.loads(capsys.readouterr().out)
    assert data["works"] is False
    assert [f["name"] for f in data["findings"] if not f["ok"] and f["needed"]] == ["dynamics, CasADi and Pinocchio"]


def test_missing_things_are_named_with_what_to_do(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    """No compiler and no extra are no fault; no Ipopt is one."""
    monkeypatch.setattr(installation, "SELF_TESTS", {})
    monkeypatch.setenv("PATH", "")
    monkeypatch.setattr(installation, "EXTRAS", {"no-such-package": "dask"})
    assert cli.run(["doctor"]) == 0
    printed = capsys.readouterr().out
    assert "no-such-package: optional: pip install 'hopopt[dask]'" in printed
    assert "none (cc)" in printed
    assert "hopopt works here" in printed
    monkeypatch.setattr(ca, "has_nlpsol", lambda name: name != "ipopt")
    assert cli.run(["doctor"]) == 1
    assert "ipopt: install casadi from its wheel" in capsys.readouterr().out


def test_versions_that_do_not_work_or_are_not_tested_are_named(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    """One that is too old is a fault, of an optional package none; one that is newer than any that is tested is none."""
    monkeypatch.setattr(installation, "SELF_TESTS", {})
    there = {"python": "3.99.1", "numpy": "99.1.0"}
    monkeypatch.setattr(installation, "installed", lambda name: there.get(name) or versions.TESTED.get(name, "1.0"))
    assert cli.run(["doctor"]) == 0
    printed = capsys.readouterr().out
    assert f"numpy: 99.1.0 is newer than {versions.TESTED['numpy']}, the last that hopopt is tested with" in printed
    assert re.search(
        r"^python: 3\.99\.1 is newer than 3\.\d+, the last that hopopt is tested with$", printed, re.MULTILINE
    )
    there |= {"mujoco": "0.1"}
    assert cli.run(["doctor"]) == 0
    assert re.search(
        r"^mujoco: 0\.1 is older than .*: pip install --upgrade mujoco$", capsys.readouterr().out, re.MULTILINE
    )
    there |= {"casadi": "0.1"}
    assert cli.run(["doctor", "--json"]) == 1
    wrong = [f for f in json.loads(capsys.readouterr().out)["findings"] if f["needed"] and not f["ok"]]
    assert [f["name"] for f in wrong] == ["casadi"]
    assert wrong[0]["advice"].startswith("0.1 is older than ")


def test_an_error_in_a_self_test_is_a_finding(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken() -> tuple[float, float, float]:
        raise RuntimeError("plug-in not found")

    monkeypatch.setattr(installation, "SELF_TESTS", {"broken": broken, "nan": lambda: (np.nan, 1.0, 1e-9)})
    tests = [f for f in findings() if f.group == "self-test"]
    assert [f.ok for f in tests] == [False, False]
    assert "plug-in not found" in tests[0].found
