"""The researcher's program is more than its types: its problem is accepted, and its program has what is its own."""

import importlib
from pathlib import Path

import pytest

import hopopt as ho
from registries import clean_registries


def test_its_problem_and_program_are_there(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(Path(__file__).parent))
    with clean_registries():
        script = importlib.import_module("research_script")
        leg = ho.load("paper", script.ENTRIES)
        assert leg.needs == ("research_script",)
        program = ho.program(leg, script.body_rise)
        assert any("soft_ground" in name for name in program.row_names)
        assert "parameters.most.value" in program.parameter_names
        states, controls = program.components("stance")
        assert "torque rate" in " ".join(controls) or len(states) > 4  # the torques are states
