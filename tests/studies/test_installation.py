"""hopopt doctor: what there is, what is missing, and a self-test that finds an installation that computes wrongly."""

import json
from importlib.metadata import version

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest

from hopopt.cli import main as cli
from hopopt.studies import installation
from hopopt.studies.installation import SELF_TESTS, Finding, findings


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


def test_an_error_in_a_self_test_is_a_finding(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken() -> tuple[float, float, float]:
        raise RuntimeError("plug-in not found")

    monkeypatch.setattr(installation, "SELF_TESTS", {"broken": broken, "nan": lambda: (np.nan, 1.0, 1e-9)})
    tests = [f for f in findings() if f.group == "self-test"]
    assert [f.ok for f in tests] == [False, False]
    assert "plug-in not found" in tests[0].found
