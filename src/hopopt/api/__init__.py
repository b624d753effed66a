"""The Python API: its verbs, and what a solution, a comparison and a study of many solves can be asked to do.

Results are values; what acts on them is here, and given to them as methods for whoever works in a notebook. Figures
and derivatives are imported on first use.
"""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hopopt.api import notebook_views as views
from hopopt.comparison.compare import Comparison
from hopopt.comparison.compare import compare as compare_strategies
from hopopt.comparison.hops.hop_after_hop import HOPS, HopsComparison
from hopopt.comparison.hops.hop_after_hop import compare_hops as hop_after_hop
from hopopt.comparison.hops.transition import Transition
from hopopt.comparison.hops.transition import transition as way_onto_orbit
from hopopt.comparison.ladder import Ladder, ladder
from hopopt.comparison.robust.robust import RobustHop
from hopopt.comparison.robust.robust import robust as robust_hop
from hopopt.comparison.simulation import simulate
from hopopt.design import Design
from hopopt.errors import UsageError
from hopopt.ocp.custom import constraint, objective
from hopopt.planner.solution import Solution
from hopopt.planner.solve import solve
from hopopt.problem.load import as_design, load
from hopopt.storage.solution import read, save
from hopopt.studies.codesign import codesign
from hopopt.studies.pareto import Front, front
from hopopt.studies.sweep.run import Study, sweep

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from hopopt.robot_data.identification import Identification
    from hopopt.studies.influence import Influence

__all__ = [
    "Comparison",
    "Front",
    "Solution",
    "Study",
    "codesign",
    "constraint",
    "front",
    "identify",
    "load",
    "objective",
    "read",
    "robust",
    "save",
    "simulate",
    "solve",
    "sweep",
    "transition",
]


def identify(problem: Design | str | Path, *runs: str | Path, known: Sequence[str] = ()) -> "Identification":
    """A leg's parameters from logs of its hops, with 95 % intervals; see ``hopopt identify``.

    problem: what is believed of the leg, a problem or its name or file
    runs: CSV files of logs
    known: keys of parameters that are right in the problem

    Raises UsageError for a leg that cannot be identified, ResultError for a log that cannot be read or is not of this leg.
    """
    from hopopt.robot_data.identification import identify
    from hopopt.robot_data.robot_log import read_log

    design = as_design(problem)
    return identify(design, [read_log(Path(run), design) for run in runs], known)


def robust(
    problem: Design | str | Path | Solution, *, draws: int = 200, evaluations: int = 8, starts: int | None = None,
    **promise: Any,
) -> RobustHop:  # fmt: skip
    """The plan and tracker with the greatest clearance that a share of the legs within ``[uncertainty]`` reaches.

    problem: a problem, its name or file, or its highest hop
    draws: fresh legs on which the promise stands
    evaluations: reserves that are tried, and programs for several legs at most
    starts: starting points of each bound's solve
    promise: share (0.95) of all legs, confidence (0.95) of that statement, seed (0) of the draws

    Raises UsageError for a problem without uncertainty and for promises that so few draws cannot make, NotSolvedError if no
    plan is found.
    """
    bound = problem if isinstance(problem, Solution) else None
    design = bound.design if bound else as_design(problem)  # type: ignore[arg-type]
    more = {"starts": starts, "processes": os.cpu_count() or 1, "bound": bound}
    return robust_hop(design, draws=draws, evaluations=evaluations, **more, **promise)  # type: ignore[arg-type]


def transition(
    problem: Design | str | Path | Solution,
    begin: Solution | None = None,
    clearances: Sequence[float] = (),
    **more: Any,
) -> Transition:
    """The fewest hops from rest, or from the periodic hop ``begin``, onto a periodic hop: one program, of least effort.

    problem: the periodic hop on which they end; or a problem, its name or file, whose highest one is solved for
    begin: the periodic hop from which they start; None from rest
    clearances: what each hop must clear at least [m]; so many hops
    more: most hops that are tried (4), starts of the periodic hop that is solved for

    Raises UsageError for hops that are not periodic or of another leg, NotSolvedError if no number of hops leads there.
    """
    orbit = problem if isinstance(problem, Solution) else None
    design = orbit.design if orbit else as_design(problem)  # type: ignore[arg-type]
    return way_onto_orbit(design, begin=begin, orbit=orbit, clearances=clearances, **more)


def plot_transition(found: Transition) -> "Figure":
    """Heights of the leg's lowest point and of the body over all hops."""
    from hopopt.plots.transition import heights

    return heights(found)


def plot_robust(found: RobustHop) -> "Figure":
    """The share of the drawn legs over the clearance that they reach, and the bounds."""
    from hopopt.plots.controllers.robust import share_of_legs

    return share_of_legs(found)


def plot_ladder(found: Ladder) -> "Figure":
    """The ladder as a staircase of clearances."""
    from hopopt.plots.controllers.ladder import staircase

    return staircase(found, found.strategy)


def plot(solution: Solution, name: str | None = None) -> "dict[str, Figure] | Figure":
    """All figures by name, or the one called ``name``: heights, joints, operating_region, stick, ground_force, obstacle of
    a hop over one, or tornado, which is drawn only if asked for. Raises UsageError for another name."""
    from hopopt.plots.hop import figures_of

    if name == "tornado":
        from hopopt.plots.studies.sensitivity import tornado

        return tornado(solution, sensitivity(solution))
    figures = figures_of(solution)
    if name is not None and name not in figures:
        raise UsageError(f"there is no figure {name!r}; there are {', '.join([*figures, 'tornado'])}")
    if name is not None:
        return figures[name](solution)
    return {key: draw(solution) for key, draw in figures.items()}


def sensitivity(solution: Solution) -> "list[Influence]":
    """What one more of every number of the problem changes in the height, the most rewarding per cent first; see
    ``hopopt.studies.sensitivity``. Raises UsageError where the start pose has no derivative."""
    from hopopt.studies.sensitivity import sensitivity

    return sensitivity(solution)


def compare(solution: Solution, *strategies: str, tune: int = 0) -> Comparison:
    """This hop as the bound, beside what controllers make of the same leg: those named, "all" that suit it, or the
    default rows of ``hopopt compare``.

    tune: hops on which the gains of "force" and "position" are tuned. Raises UsageError for unknown strategies,
    NotSolvedError if there is no plan to track.
    """
    return compare_strategies(solution.design, strategies or None, bound=solution, tune=tune)


def compare_hops(solution: Solution, *strategies: str, hops: int = HOPS) -> HopsComparison:
    """This periodic hop as the bound, beside what controllers keep up hop after hop: those named, "all" that suit it, or
    the default rows of ``hopopt compare --hop periodic``.

    hops: how many each does. Raises UsageError for unknown strategies, and for a hop that is not periodic.
    """
    return hop_after_hop(solution.design, strategies or None, hops=hops, bound=solution)


def plot_hops(comparison: HopsComparison, name: str) -> "Figure":
    """The figure called ``name``: clearances, orbit, or basin where basins were asked for."""
    from hopopt.plots.hops import FIGURES

    if name not in FIGURES:
        raise UsageError(f"there is no figure {name!r}; there are {', '.join(FIGURES)}")
    return FIGURES[name](comparison)


def plot_comparison(comparison: Comparison, name: str | None = None) -> "dict[str, Figure] | Figure":
    """All figures by name, or the one called ``name``: foot_height, saturation, speed_torque, stiffness, stick,
    budget."""
    from hopopt.plots.controllers.runs import FIGURES

    if name is not None:
        return FIGURES[name](comparison.figures)
    return {key: draw(comparison.figures) for key, draw in FIGURES.items()}


def plot_study(study: Study) -> "dict[str, Figure]":
    """The study's figures by name."""
    from hopopt.plots.studies.sweep import figures

    return figures(study)


Solution.plot, Solution.sensitivity, Solution.compare, Solution.compare_hops = plot, sensitivity, compare, compare_hops
Comparison.plot, Study.plot, HopsComparison.plot = plot_comparison, plot_study, plot_hops
Comparison.why = HopsComparison.why = ladder
Ladder.plot, RobustHop.plot, Transition.plot = plot_ladder, plot_robust, plot_transition
for kind, dataset, frame, table in (
    (Solution, views.solution_dataset, views.solution_frame, views.solution_html),
    (Comparison, views.comparison_dataset, views.comparison_frame, views.comparison_html),
    (Study, views.study_dataset, views.study_frame, views.study_html),
):
    kind.to_xarray, kind.to_dataframe = dataset, frame  # type: ignore[attr-defined]
    kind._repr_html_ = table  # type: ignore[attr-defined]
del kind, dataset, frame, table
