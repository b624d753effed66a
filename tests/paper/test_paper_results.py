"""The paper's results beside the simulation's: the table of the docs is what the command prints."""

import json
from pathlib import Path

import numpy as np
import pytest

from hopopt.cli.main import run
from hopopt.control.strategies import find
from hopopt.leg.robot import BASE
from hopopt.paper.paper_results import NEAR_PRINTED, paper_results
from hopopt.paper.stiffness import mean_stiffness, secant_stiffness
from hopopt.problem.load import load
from once import simulated_once

DOCS = Path(__file__).parents[2] / "docs" / "paper.md"


@pytest.fixture(scope="module")
def hops():
    design = load("paper")
    return [simulated_once(design, find(name)).figures for name in ("force", "position_soft")]


@pytest.mark.rarely
def test_the_table_of_the_docs_is_what_the_command_prints(capsys):
    assert run(["reproduce"]) == 0
    table = capsys.readouterr().out.strip()
    assert table in DOCS.read_text(encoding="utf-8")
    assert table.count("\n") > 12


@pytest.mark.slow
def test_for_a_script(capsys, monkeypatch):
    monkeypatch.setattr("hopopt.cli.paper.reproduce.simulate", simulated_once)
    assert run(["reproduce", "--json"]) == 0
    data = json.loads(capsys.readouterr().out)
    assert {len(rows) for rows in data["figures"].values()} == {14}
    assert all(
        set(row) == {"statement", "paper", "hopopt", "matches"} for rows in data["figures"].values() for row in rows
    )


def test_a_match_is_within_ten_per_cent(hops):
    for row in paper_results(*hops):
        if row.paper.replace(".", "").isdigit():
            paper, found = float(row.paper), float(row.hopopt)
            if abs(abs(found / paper - 1) - NEAR_PRINTED) > 0.02:  # the table rounds
                assert row.matches == (abs(found / paper - 1) <= NEAR_PRINTED)


@pytest.mark.rarely
def test_another_leg_is_not_graded(capsys):
    for other in (["paper", "--set", "leg.body.mass=5"], ["solo12_leg"]):  # which is off the ground at once
        assert run(["reproduce", *other]) == 0
        shown = capsys.readouterr().out
        assert "its figures do not apply" in shown
        assert "match" not in shown
        assert "nan" not in shown
        assert "-1 against" not in shown


def test_work_of_the_joints_in_stance_is_the_motors(hops):
    """The integral of tau d theta that the energy row takes, by the simulator's own account."""
    force = hops[0]
    span = force.stance
    work = np.trapezoid(np.sum(force.trace.tau[span] * force.trace.v[span, BASE:], axis=1), force.trace.t[span])
    assert work == pytest.approx(force.trace.work[span.stop - 1, 0], rel=1e-3)


def test_stiffness_is_force_over_shortening(hops):
    y, k = secant_stiffness(hops[0])
    at = int(np.flatnonzero(np.isfinite(k))[40])
    f_z, m_e = hops[0].trace.f[at, 1], 0.8
    assert k[at] * (0.45 - y[at]) == pytest.approx(f_z - m_e * 9.81, rel=1e-6)
    assert np.nanmin(k) < mean_stiffness(hops[0], 0.28, 0.40) < np.nanmax(k)


@pytest.mark.slow
def test_a_leg_too_weak_to_hop_is_said_to_be(capsys):
    assert run(["reproduce", "--set", "leg.motor.max_torque=0.3"]) == 2
    assert "never lifts the foot" in capsys.readouterr().err
