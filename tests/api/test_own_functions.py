"""Functions and numbers of a user's own in solves and studies: by name in every process, stored, and read elsewhere."""

import importlib
import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest

import hopopt as ho
from hopopt import extensions
from hopopt.cli.main import run
from hopopt.comparison.compare import compare
from hopopt.errors import ProblemFileError, UsageError
from hopopt.ocp.custom import Moment, as_objective, custom, symbols
from hopopt.ocp.hop import Hop
from hopopt.ocp.hops.several_hops import JointState, several_hops
from hopopt.ocp.hops.shared_control import TrueLeg
from hopopt.ocp.objectives.registry import find
from hopopt.ocp.rules import RULES
from hopopt.planner.reserve import reserved
from hopopt.planner.search.from_known import solved_from_known
from hopopt.problem.own import name_of, with_constraints
from hopopt.studies.pareto.front import FrontPoint, read_front
from once import solved_once
from registries import clean_registries
from stored_results import stored_study

MOST = {"parameters.most": {"value": 400.0, "lower": 100.0, "upper": 2000.0, "unit": "N"}}
MODULE = """
import casadi as ca
import hopopt as ho


@ho.constraint(unit="N", scale=400.0, phases=("stance",))
def soft(now):
    return now.p["most"] - now.f[-1]


@ho.objective(unit="m", scale=0.5)
def com_rise(end):
    return end.points["com"][1] - end.lift_off.points["com"][1]
"""


@ho.constraint(unit="N", scale=400.0, phases=("stance",))
def soft(now: Moment) -> Any:
    return now.p["most"] - now.f[-1]


@pytest.fixture(autouse=True)
def _registries() -> Iterator[None]:
    with clean_registries():
        RULES["soft"] = soft
        yield


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"parameters.most.value": 50.0}, "parameters.most.value = 50.0 is below parameters.most.lower = 100.0"),
        ({"parameters.most.value": 5e3}, "parameters.most.value = 5000.0 is above parameters.most.upper = 2000.0"),
        ({"parameters.2nd.value": 1.0}, "parameters.2nd is no name of a number"),
        ({"parameters.most.most": 1.0}, "parameters.most.most is not a known key"),
    ],
)
def test_a_number_of_ones_own_that_cannot_be_is_said_in_a_sentence(changes: dict[str, float], words: str) -> None:
    with pytest.raises(ProblemFileError) as refused:
        ho.load("paper", MOST | changes)
    assert words in refused.value.problems[0]


def test_a_named_constraint_holds_in_every_kind_of_hop() -> None:
    design = ho.load("paper", MOST | {"hop.constraints": ["soft"]})
    for kind in ("single", "landing", "periodic"):
        hop = Hop(design.of_kind(kind))
        held = {phase.name for phase in hop.problem.phases for c in phase.path if str(c.name) == "soft"}
        assert held == ({"stance", "landing"} if kind == "landing" else {"stance"})
        assert "parameters.most.value" in {p.name for p in hop.problem.parameters}
    rest = JointState(np.array([1.0, -2.0]), np.zeros(2))
    way = several_hops(Hop(design.of_kind("periodic")), rest, rest, [0.0, 0.0])
    assert sum(str(c.name) == "soft" for phase in way.phases for c in phase.path) == 2
    one_of_several = TrueLeg(1, design, np.ones(2), np.array([1.0, -2.0]))
    assert "soft" in {str(c.name) for c in one_of_several.phases["stance"].phase.path}


def test_what_cannot_go_to_worker_processes_is_said_before_the_work() -> None:
    held = ca.SX.sym("x")

    def closure(now: Moment) -> Any:
        return 500 + 0 * held - now.f[-1]

    with pytest.raises(UsageError, match=r"closure cannot go to worker processes .*: give processes=1"):
        ho.sweep("paper", {"leg.gear.ratio": [70, 80]}, constraints=[closure], processes=2)


def test_a_function_that_writes_into_its_moment_changes_nothing_for_the_others() -> None:
    """All of a phase are given the same instant."""

    def writes(now: Any) -> Any:
        now.q[1], now.points["foot"], now.lift_off.q[1] = 0.0, None, 0.0
        return now.lift_off.q[0]

    end = symbols(2, ("foot",), True, {})
    custom(writes)(end)
    assert end.lift_off is not None
    assert (str(end.q[1]), str(end.lift_off.q[1]), str(end.points["foot"])) == ("q_1", "q_1", "[foot_0, foot_1]")


@pytest.mark.parametrize(
    ("function", "words"),
    [
        (lambda now: now.f[-1] < 400, "has no slope: return a difference"),
        (lambda now: [400 - now.f[-1], 1.0], "has no slope"),
        (lambda now: np.nan * now.f[-1], "is no finite number"),
        (lambda now: ca.SX.sym("mine") - now.f[-1], "depends on mine, which is no part of the moment"),
        (lambda now: 3.0, "does not depend on the hop"),
        (lambda now: "400 N", "returned str: a CasADi expression"),
    ],
)
def test_what_no_optimiser_can_use_is_said_in_a_sentence(function: Any, words: str) -> None:
    """A comparison would count as kept everywhere; a number that is none ends in Ipopt."""
    with pytest.raises(UsageError, match=words):
        ho.program("paper", constraints=[function])


def test_what_is_a_number_at_some_instants_alone_is_taken() -> None:
    def roots(now: Moment) -> Any:
        return [ca.sqrt(now.f[-1] - 100.0), ca.log(now.q[1]), ca.acos(now.q[2]), 400.0 - ca.fabs(now.tau)]

    assert any("roots" in name for name in ho.program("paper", constraints=[roots]).row_names)


def test_different_functions_of_one_name_are_refused() -> None:
    """Only one of them would be found by it."""

    def at_most(most: float) -> Any:
        return lambda now: most - now.f[-1]

    for ask in (ho.program, ho.solve):
        with pytest.raises(UsageError, match=r"two different constraints are called .*lambda>: give each a name"):
            ask("paper", constraints=[at_most(400.0), at_most(300.0)])
    with pytest.raises(UsageError, match="two different constraints"):
        ho.sweep("paper", {"leg.gear.ratio": [70, 80]}, constraints=[at_most(400.0), at_most(300.0)])


def test_functions_of_one_name_that_differ_keep_apart_between_calls() -> None:
    """What was asked with the first is not asked with the second later."""

    def at_most(most: float) -> Any:
        return lambda now: most - now.f[-1]

    first, second, again = (name_of(at_most(most)) for most in (400.0, 300.0, 400.0))
    assert first == again
    assert second == f"{first}-2"
    row = [extensions.function(name)(symbols(2, ("foot",), False, {})) for name in (first, second)]
    assert [str(x) for x in row] == ["(400-f_1)", "(300-f_1)"]
    named = with_constraints(ho.load("paper"), [at_most(300.0)])
    assert named.hop.constraints == (second,)
    assert any(second in name for name in ho.program(named).row_names)


def test_a_study_of_a_notebooks_objective_says_to_define_it_in_a_module(tmp_path: Path) -> None:
    folder = stored_study(tmp_path, {"leg.gear.ratio": [70, 80]}, [0.6, 0.7]).folder
    told = json.loads((folder / "sweep.json").read_text()) | {"objective": "__main__:rise"}
    (folder / "sweep.json").write_text(json.dumps(told))
    with pytest.raises(UsageError, match="rise was defined in a notebook or script") as refused:
        ho.read(folder)
    assert "define it in a module of your own" in str(refused.value)
    assert "--with __main__" not in str(refused.value)


def test_a_front_of_a_notebooks_objective_shows_its_name_alone() -> None:
    def most_force(now: Moment) -> Any:
        return now.f[-1]

    most_force.__module__, most_force.__qualname__ = "__main__", "most_force"
    asked = ((as_objective(custom(most_force)), "most_force", ""), (find("peak_force"), "peak force", " [N]"))
    for objective, words, unit in asked:
        point = FrontPoint("least", 0.3, 0.3, 2.0, True)
        front = ho.Front(ho.load("paper"), objective, None, [point], [None])
        assert front.plot().axes[0].get_ylabel() == f"{words}{unit}"
        assert front.plot().get_suptitle().endswith(f"the least {words} for each clearance")


def test_a_front_needs_an_objective_that_a_clearance_is_asked_with() -> None:
    with pytest.raises(UsageError, match="objective\\(clearance=True, maximize=False\\)"):
        ho.pareto("paper", lambda now: now.f[-1], processes=1)


@pytest.mark.rarely
def test_strategies_are_not_held_against_a_constraint_of_ones_own(hop: ho.Solution) -> None:
    """A bound that is wrong, as a run passes it: it is not said of one that keeps more than strategies do."""
    low = hop.with_summary(clearance_m=0.1, objective_value=0.1)
    assert compare(low.design, ["force"], bound=low).beaten_by == ["force"]
    named = low.design.model_copy(update={"hop": low.design.hop.model_copy(update={"constraints": ("soft",)})})
    found = compare(named, ["force"], bound=low.noted(design=named))
    assert not found.beaten_by
    assert any("the bound keeps soft" in words for words in found.notes)


def test_a_hop_that_is_solved_takes_no_more_constraints(hop: ho.Solution) -> None:
    with pytest.raises(UsageError, match="solved already"):
        ho.robust(hop, constraints=[soft], processes=1)


def test_a_stored_front_is_read_without_its_module(tmp_path: Path, hop: ho.Solution) -> None:
    stored = ho.save(hop, tmp_path / "points")
    assert stored.result_dir is not None
    point = FrontPoint("least swing", 0.5, 0.5, 2.0, True, result_dir=str(stored.result_dir))
    about = {"against": "gone:swing", "unit": "J", "meaning": "its own", "complete": True, "points": [vars(point)]}
    (tmp_path / "front.json").write_text(json.dumps(about))
    front = read_front(tmp_path)
    assert (front.against.unit, front.points[0].value) == ("J", 2.0)
    assert run(["show", str(tmp_path)]) == 0


@pytest.mark.rarely
def test_a_limits_own_number_has_the_derivative_that_solving_again_gives() -> None:
    named = {"hop.constraints": ["soft"]}
    low, at, high = (solved_once(MOST | named | {"parameters.most.value": most}) for most in (390.0, 400.0, 410.0))
    slope = next(i for i in ho.Solution.with_methods(at).sensitivity() if i.name == "parameters.most.value")
    assert slope.unit == "N"
    assert slope.per_unit == pytest.approx((high.clearance - low.clearance) / 20, rel=0.02)


@pytest.mark.rarely
def test_functions_that_are_given_have_derivatives_too() -> None:
    @ho.objective(unit="m", scale=0.5)
    def com_rise(end: Moment) -> Any:
        return end.points["com"][1] - end.lift_off.points["com"][1]  # type: ignore[union-attr]

    def solved(ratio: float) -> ho.Solution:
        design = ho.load("paper", MOST | {"leg.gear.ratio": ratio})
        return ho.solve(design, com_rise, constraints=[soft], starts=1, processes=1)

    low, at, high = map(solved, (79.0, 80.0, 81.0))
    slope = next(i for i in at.sensitivity() if i.name == "leg.gear.ratio").per_unit
    assert slope == pytest.approx((high.summary.objective_value - low.summary.objective_value) / 2, rel=0.01)


@pytest.mark.rarely
def test_a_limits_own_number_can_be_free() -> None:
    best = ho.solve(
        ho.load("paper", MOST), free={"parameters.most.value": (300.0, 420.0)}, constraints=["soft"], starts=1
    )
    assert best.verified
    assert best.design.parameters is not None
    assert best.design.parameters["most"].value == 420.0
    assert best.summary.peak_vertical_force_N == pytest.approx(420, rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["periodic", pytest.param("landing", marks=pytest.mark.rarely)])
def test_other_hops_keep_it(kind: str) -> None:
    found = solved_once(MOST | {"hop.constraints": ["soft"], "hop.kind": kind})
    assert found.verified
    assert found.summary.peak_vertical_force_N <= 400 * (1 + 1e-3)
    assert found.summary.check("stance soft").passed


@pytest.mark.rarely
def test_a_study_of_ones_own_is_stored_and_read_elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each command in a process of its own, the study's points in two more."""
    (tmp_path / "ours_studied.py").write_text(MODULE)
    (tmp_path / "leg.toml").write_text(
        'extends = "paper"\nname = "mine"\n[parameters.most]\nvalue = 400.0\nunit = "N"\n'
    )
    monkeypatch.chdir(tmp_path)

    def hopopt(*words: str) -> "subprocess.CompletedProcess[str]":
        return subprocess.run([sys.executable, "-m", "hopopt", *words], capture_output=True, text=True, check=False)

    asked = ["--objective", "ours_studied:com_rise", "--constraint", "ours_studied:soft", "--starts", "1", "--json"]
    done = hopopt(
        "sweep", "leg.toml", "--vary", "parameters.most.value=400,600", *asked, "--processes", "2", "--no-figures"
    )
    study = json.loads(done.stdout)
    assert study["outcomes"] == {"verified": 2}
    values = [p["objective_value"] for p in study["points"]]
    assert values[0] < values[1]
    folder = study["result_dir"]
    again = hopopt("verify", folder, "--with", "ours_studied")
    assert again.returncode == 0, again.stderr
    without = hopopt("verify", folder)
    assert without.returncode == 2
    assert "--with ours_studied" in without.stderr
    assert with_constraints(ho.load("leg.toml"), ["ours_studied:soft"]).needs == ("ours_studied",)
    (recorded,) = json.loads((Path(folder) / "sweep.json").read_text())["extensions"]
    assert recorded["digest"] == extensions.digest_of("ours_studied")  # that module is imported here by now


@pytest.mark.rarely
def test_a_plan_that_drawn_legs_track_keeps_it() -> None:
    """The plan with a reserve, as the search of a robust hop makes it; without the limit it pushes harder."""
    free, held = solved_once({}), solved_once(MOST | {"hop.constraints": ["soft"]})
    plans = [solved_from_known(Hop(reserved(hop.design)), hop) for hop in (free, held)]
    assert all(plan.verified for plan in plans)
    assert plans[1].summary.check("stance soft").passed
    assert plans[1].summary.peak_vertical_force_N <= 400 * (1 + 1e-3) < plans[0].summary.peak_vertical_force_N


def test_a_marked_function_of_an_imported_module_is_found_and_no_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "ours_imported.py").write_text(MODULE)
    monkeypatch.syspath_prepend(str(tmp_path))
    with pytest.raises(UsageError, match="ours_imported"):
        extensions.function("ours_imported:soft")  # nothing is imported for a name
    importlib.import_module("ours_imported")
    assert extensions.function("ours_imported:soft").__name__ == "soft"
    for name in ("os:system", "ours_imported:ca"):
        with pytest.raises(UsageError):
            extensions.function(name)
