"""The Python interface as an editor sees it: names, arguments, docstrings, classes; old names go on working."""

import inspect
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, assert_type

import numpy as np
import pytest
from matplotlib.figure import Figure

import hopopt as ho
from hopopt.comparison.hops.transition import Transition
from hopopt.comparison.ladder import Ladder, Rung
from hopopt.comparison.robust.robust import RobustHop
from hopopt.comparison.robust.robust_search import PlanTrial
from hopopt.comparison.robust.robustness import Reached
from hopopt.errors import UsageError
from hopopt.planner import solution
from hopopt.studies.pareto.front import Front

RESULTS = (
    ho.Comparison, ho.Front, ho.HopsComparison, ho.Ladder, ho.RobustHop, ho.Run, ho.Solution, ho.Study, ho.Transition,
)  # fmt: skip
METHODS = {
    f"{kind.__name__}.{name}": method for kind in RESULTS for name, method in vars(kind).items()
    if inspect.isfunction(method) and not name.startswith("_")
}  # fmt: skip
VERBS = {name: getattr(ho, name) for name in ho.__all__ if inspect.isfunction(getattr(ho, name))}
CHEAP = {"solver.stance_intervals": 8, "solver.flight_intervals": 4, "solver.refine": False}


# ---- what an editor sees -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("function", [*VERBS.values(), *METHODS.values()], ids=[*VERBS, *METHODS])
def test_every_argument_has_a_name_a_type_and_a_line(function: Callable[..., Any]) -> None:
    """None is swallowed by **; the docstring names each, of methods that take more than the name of a figure."""
    told, shown = inspect.getdoc(function) or "", inspect.signature(function)
    assert told
    assert shown.return_annotation is not inspect.Parameter.empty
    for name, argument in shown.parameters.items():
        if name == "self":
            continue
        assert argument.kind is not inspect.Parameter.VAR_KEYWORD
        assert argument.annotation is not inspect.Parameter.empty
        assert name in told or "as ``" in told, name


def test_the_problem_comes_first() -> None:
    asked = {name: next(iter(inspect.signature(verb).parameters)) for name, verb in VERBS.items()}
    others = ("constraint", "load", "objective", "read", "save", "verify")
    assert {asked[name] for name in asked.keys() - set(others)} == {"problem"}


def test_all_that_takes_long_tells_how_it_goes_on() -> None:
    quick = {"constraint", "explore", "identify", "load", "objective", "program", "read", "save"}
    longer = {"Solution.compare", "Solution.compare_hops", "Comparison.why", "HopsComparison.why"}
    for name, function in {**VERBS, **METHODS}.items():
        if name in (VERBS.keys() - quick) | longer:
            left_out = {"verify": {"time_limit", "results"}}.get(name, {"results"} if name.endswith("why") else set())
            assert {"time_limit", "results", "progress"} - left_out <= inspect.signature(function).parameters.keys(), (
                name
            )


@pytest.mark.parametrize("function", [*VERBS.values(), *METHODS.values()], ids=[*VERBS, *METHODS])
def test_every_path_may_be_text(function: Callable[..., Any]) -> None:
    asked = {name: str(argument.annotation) for name, argument in inspect.signature(function).parameters.items()}
    assert all(
        "str" in kind
        for name, kind in asked.items()
        if kind.startswith(("str | pathlib", "pathlib")) or name in ("results", "resume", "folder")
    )


@pytest.mark.parametrize("kind", RESULTS)
def test_every_result_is_drawn_by_name(kind: type) -> None:
    name = inspect.signature(kind.plot).parameters["name"]
    assert name.default is None


@pytest.mark.rarely
def test_a_type_checker_knows_what_methods_return(hop: ho.Solution, comparison: ho.Comparison) -> None:
    """pyright reads this test too."""
    assert_type(hop.compare("force"), ho.Comparison)
    assert_type(comparison.solution, ho.Solution)
    assert_type(comparison.plot("budget"), Figure)
    assert_type(comparison.plot(), dict[str, Figure])
    assert_type(hop.plot("stick"), Figure)


# ---- classes ------------------------------------------------------------------------------------------------------


def test_a_stored_hop_has_the_methods_of_a_solved_one(hop: ho.Solution, tmp_path: Path) -> None:
    saved = ho.save(hop, tmp_path)
    assert saved.result_dir is not None
    read = ho.read(saved.result_dir)
    assert type(saved) is type(read) is type(read.with_summary(wall_s=1.0)) is ho.Solution
    assert read.as_dict()["clearance_m"] == hop.clearance
    assert isinstance(read.plot("heights"), Figure)


def test_what_was_derived_of_a_hop_is_kept(hop: ho.Solution) -> None:
    plain = solution.Solution(hop.design, hop.objective, hop.phases, hop.summary)
    tables = plain.tables
    assert ho.Solution.with_methods(plain).tables is tables
    assert ho.Solution.with_methods(hop) is hop


def test_the_hops_in_a_comparison_have_methods(comparison: ho.Comparison, hop: ho.Solution) -> None:
    tracked = ho.Comparison.with_methods(replace(comparison, plan=_plain(hop)))
    assert type(tracked.solution) is type(tracked.plan) is ho.Solution
    assert comparison.verified is True


def test_the_hops_of_fronts_transitions_and_robust_hops_have_methods(hop: ho.Solution) -> None:
    plain: Any = _plain(hop)
    front = ho.Front.with_methods(Front(hop.design, plain, solutions=[plain, None]))
    assert type(front.solutions[0]) is ho.Solution
    assert front.solutions[1] is None
    assert front.verified is False  # there is no point yet
    way = ho.Transition.with_methods(Transition(plain, plain, plain))
    assert type(way.orbit) is type(way.begin) is ho.Solution
    found = ho.RobustHop.with_methods(_robust(plain))
    assert type(found.bound) is type(found.ideal_bound) is ho.Solution
    assert found.verified is True


def _plain(hop: ho.Solution) -> solution.Solution:
    """A hop as the packages below the interface have it."""
    return solution.Solution(hop.design, hop.objective, hop.phases, hop.summary)


def _robust(hop: solution.Solution) -> RobustHop:
    reached = Reached(np.array([0.6, 0.7, 0.75]), ("past its apex",) * 3)
    reference: Any = hop
    best = PlanTrial("reserve", hop.design, hop, reference, True, 0.6, 0.6)
    return RobustHop(best, {}, hop, hop, reached, {}, None, 0.5, 0.5, 1)


# ---- figures ------------------------------------------------------------------------------------------------------


def test_figures_of_a_comparison_are_those_that_are_named(comparison: ho.Comparison) -> None:
    assert set(comparison.plot()) == {"foot_height", "saturation", "speed_torque", "stiffness", "stick", "budget"}
    with pytest.raises(UsageError, match="there is no figure 'heights'; there are foot_height, "):
        comparison.plot("heights")


def test_a_simulated_run_is_drawn_without_a_bound() -> None:
    run = ho.simulate("paper", "force")
    assert type(run) is ho.Run
    assert len(run.plot("foot_height").axes[0].get_lines()) >= 1
    with pytest.raises(UsageError, match="there is no figure 'budget'"):
        run.plot("budget")


def test_a_result_with_one_figure_gives_that_one() -> None:
    ladder = ho.Ladder("force", 0.4, (Rung("grip", 0.6, 0.2, 0.2, 0.2, True),), (("grip",),), ((0.2,),))
    assert isinstance(ladder, Ladder)
    assert isinstance(ladder.plot(), Figure)
    assert isinstance(ladder.plot("why"), Figure)
    with pytest.raises(UsageError, match="there is no figure 'heights'; there is why"):
        ladder.plot("heights")


# ---- what is written, and said ------------------------------------------------------------------------------------


def test_nothing_is_written_where_no_folder_is_given(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A study keeps its points among temporary files, from which it goes on; progress=True is on standard error."""
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    problem, vary = ho.load("paper", CHEAP), {"leg.gear.ratio": [100.0]}
    study = ho.sweep(problem, vary, starts=1, processes=1, progress=True)
    assert type(study) is ho.Study
    assert study.folder.is_relative_to(tmp_path)
    assert list(study.plot()) == ["study"]
    assert not list((tmp_path / "here").iterdir())
    assert "1" in capsys.readouterr().err
    said = list[str]()
    again = ho.sweep(problem, vary, starts=1, processes=1, resume=study.folder, progress=said.append)
    assert again.points == study.points
    assert capsys.readouterr().err == ""


# ---- old names ----------------------------------------------------------------------------------------------------


def test_old_verbs_warn_and_work() -> None:
    old: Any = ho
    with pytest.warns(DeprecationWarning, match="is now hopopt.pareto"), pytest.raises(UsageError, match="no front"):
        old.front("paper", "clearance")
    free = {"leg.gear.ratio": (100, 50)}
    with pytest.warns(DeprecationWarning, match="solve.problem, free"), pytest.raises(UsageError, match="no room"):
        old.codesign(ho.load("paper"), free)
    assert {"front", "codesign"} & {*dir(ho)} == set()


def test_old_arguments_warn_and_work(comparison: ho.Comparison) -> None:
    old: Any = ho
    words = r"sweep\(design=...\) is now sweep\(problem=...\)"
    with pytest.warns(DeprecationWarning, match=words), pytest.raises(UsageError, match="at most"):
        old.sweep(design="paper", vary={"leg.gear.ratio": [80.0]}, starts=1001)
    unverified: Any = replace(comparison, solution=comparison.solution.with_summary(verified=False))
    with pytest.warns(DeprecationWarning, match=r"why\(say=...\)"), pytest.raises(UsageError, match="not verified"):
        unverified.why(say=print)


def test_free_numbers_have_no_structure_and_couplings_need_them() -> None:
    with pytest.raises(UsageError, match="structure goes with a design that is given"):
        ho.solve("paper", free={"leg.gear.ratio": (50, 200)}, structure=True)
    with pytest.raises(UsageError, match="couple relates numbers that are free"):
        ho.solve("paper", couple=["leg.thigh.length = 0.4"])
