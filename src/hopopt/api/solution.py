"""A solved hop, and the controllers beside it, as users get them: with methods.

What draws and what takes long to import is imported when it is asked for.
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self, overload

from numpy.typing import ArrayLike

from hopopt.api.asked import Progress, as_class, check_figure, figures, renamed, told, within
from hopopt.api.keeping import check_can_be_kept, kept
from hopopt.api.notebook import views
from hopopt.comparison import compare, ladder
from hopopt.comparison.hops import hop_after_hop
from hopopt.control.strategies import named
from hopopt.errors import ResultError
from hopopt.planner import solution
from hopopt.planner.checks.smooth_plan import SmoothPlan, smooth_plan
from hopopt.storage.solution import stated
from hopopt.studies.influence import Influence

if TYPE_CHECKING:
    import pandas as pd  # pyright: ignore[reportMissingTypeStubs]
    import xarray as xr
    from matplotlib.figure import Figure


class Solution(solution.Solution):
    """A hop that was solved or read: functions of time, and every figure that is printed of it."""

    @classmethod
    def with_methods(cls, found: solution.Solution) -> Self:
        """The planner's solution with its methods."""
        return found if isinstance(found, cls) else as_class(cls, found)

    @property
    def folder(self) -> Path | None:
        """Where it lies; None if it is not kept."""
        return self.result_dir

    def as_dict(self) -> dict[str, Any]:
        """Every figure, as ``hopopt show --json`` prints it."""
        return stated(self.summary)

    @overload
    def plot(self, name: None = None) -> "dict[str, Figure]": ...
    @overload
    def plot(self, name: str) -> "Figure": ...
    def plot(self, name: str | None = None) -> "dict[str, Figure] | Figure":
        """All figures by name, or the one called ``name``.

        name: heights, joints, operating_region, stick, ground_force; obstacle of a hop over one; tornado, which takes
            longer and is drawn only if it is asked for

        Raises UsageError for another name.
        """
        from hopopt.plots.hop import figures_of
        from hopopt.plots.studies.sensitivity import tornado

        known = figures_of(self)
        check_figure(name, *known, "tornado")
        return tornado(self, self.sensitivity()) if name == "tornado" else figures(self, known, name)

    def smooth(self, *, time_limit: float | None = None) -> SmoothPlan:
        """A plan whose torques vary less, as good as this hop within 1e-5 of its objective, a height within 0.01 mm.

        It is verified as the hop is (``hopopt export --smooth``).

        time_limit: seconds after which it ends without one; None: no limit

        Raises NotSolvedError where none is found, and ResultError for a hop that is not verified, or was stored without multipliers.
        """
        if not self.verified:
            raise ResultError(f"{self.folder or self.design.name}: a smooth plan is made of a verified hop")
        return smooth_plan(self, within(time_limit))

    def sensitivity(self) -> "Influences":
        """What one more of every number of the problem changes in the objective, the most rewarding per cent first.

        Raises UsageError where the start pose has no derivative.
        """
        from hopopt.studies.sensitivity import sensitivity

        return Influences(sensitivity(self))

    def compare(
        self,
        *strategies: str | type,
        tune: int = 0,
        mujoco: bool = False,
        time_limit: float | None = None,
        results: str | Path | None = None,
        progress: Progress = None,
    ) -> "Comparison":
        """This hop as the bound, beside what controllers make of the same leg.

        strategies: their names, or classes of your own; "all" for every one that suits the leg; none: the default rows of
            ``hopopt compare``
        tune: hops on which the gains of "force" and "position" are tuned
        mujoco: simulate in MuJoCo too
        time_limit: [s] after which no strategy is begun any more, which a note says (None: no limit)
        results: the folder below which a new one keeps what was found (None: nothing is written)
        progress: a function that is told a line of text; True: lines on standard error; None: a bar in a notebook

        Raises UsageError for strategies that are unknown or do not suit the leg, NotSolvedError if there is no plan to
        track, MissingExtraError without MuJoCo.
        """
        check_can_be_kept(results)
        names = [named(s) for s in strategies]
        found = compare.compare(
            self.design,
            names or None,
            bound=self,
            tune=tune,
            mujoco=mujoco,
            progress=told(progress),
            until=within(time_limit),
        )
        return kept(Comparison.with_methods(found), results)

    def compare_hops(
        self,
        *strategies: str | type,
        hops: int = hop_after_hop.MOST_HOPS,
        basins: bool = False,
        mujoco: bool = False,
        processes: int = 1,
        time_limit: float | None = None,
        results: str | Path | None = None,
        progress: Progress = None,
    ) -> "HopsComparison":
        """This periodic hop as the bound, beside what controllers keep up hop after hop.

        strategies: as ``compare`` takes them; none: the default rows of ``hopopt compare --hop periodic``
        hops: how many each does, at least 2
        basins: find from where each comes back, too
        mujoco: hop in MuJoCo too
        processes: strategies that are simulated side by side
        time_limit, results: as of ``compare``
        progress: a function that is told a line of text; True: lines on standard error; None: a bar in a notebook

        Raises UsageError for strategies that are unknown or do not suit the leg, and for a hop that is not periodic.
        """
        check_can_be_kept(results)
        names = [named(s) for s in strategies]
        found = hop_after_hop.compare_hops(
            self.design, names or None, hops=hops, bound=self, basins=basins, mujoco=mujoco, processes=processes,
            progress=told(progress), until=within(time_limit),
        )  # fmt: skip
        return kept(HopsComparison.with_methods(found), results)

    def to_xarray(self, t: ArrayLike | None = None) -> "xr.Dataset":
        """The hop at times, with names of joints and points, and units.

        t: times (k,) [s] since stance began; None: 201 equal steps

        Raises UsageError for times outside the hop.
        """
        return views.solution_dataset(self, t)

    def to_dataframe(self, t: ArrayLike | None = None) -> "pd.DataFrame":
        """The same as a table: a row for every time, columns such as "knee torque [N m]"."""
        return views.solution_frame(self, t)

    def _repr_html_(self) -> str:
        return views.solution_html(self)


@dataclass(frozen=True, repr=False)
class Ladder(ladder.Ladder):
    """From a PD strategy to the bound, one freedom at a time."""

    def plot(self, name: str | None = None) -> "Figure":
        """The ladder as a staircase of clearances, its one figure: why. Raises UsageError for another name."""
        from hopopt.plots.controllers.ladder import staircase

        check_figure(name, "why")
        return staircase(self, self.strategy)


@dataclass(frozen=True, repr=False)
class _BesideABound:
    """What both comparisons have.

    folder: where it lies; None if it is not kept
    """

    solution: Solution
    plan: Solution | None
    folder: Path | None = field(default=None, kw_only=True)

    @classmethod
    def with_methods(cls, found: compare.Comparison | hop_after_hop.HopsComparison) -> Self:
        """The comparison with its methods."""
        plan = None if found.plan is None else Solution.with_methods(found.plan)
        return as_class(cls, found, solution=Solution.with_methods(found.solution), plan=plan)

    @property
    def verified(self) -> bool:
        """Whether the bound is."""
        return self.solution.verified


class Influences(list[Influence]):
    """What the entries of a problem change in its objective, the most rewarding per cent first."""

    def to_dataframe(self) -> "pd.DataFrame":
        """A row for every entry: derivative, its error, what one per cent changes."""
        import pandas as pd  # pyright: ignore[reportMissingTypeStubs]

        return pd.DataFrame([i.as_dict() for i in self])


@dataclass(frozen=True, repr=False)
class Comparison(_BesideABound, compare.Comparison):
    """The bound, the runs of every strategy by name, and the plan that ``track`` followed."""

    @overload
    def plot(self, name: None = None) -> "dict[str, Figure]": ...
    @overload
    def plot(self, name: str) -> "Figure": ...
    def plot(self, name: str | None = None) -> "dict[str, Figure] | Figure":
        """All figures by name, or the one called ``name``.

        name: foot_height, saturation, speed_torque, stiffness, stick or budget

        Raises UsageError for another name.
        """
        from hopopt.plots.controllers.runs import FIGURES

        return figures(self.figures, FIGURES, name)

    @renamed(say="progress")
    def why(self, *, orders: int = 3, time_limit: float | None = None, progress: Progress = None) -> Ladder:
        """Why PD control is lower than the bound: optima with one more freedom each that PD lacks.

        orders: in how many orders the freedoms are lifted, 1 to 3
        time_limit: [s] after which no further order is begun (None: no limit)
        progress: a function that is told a line of text; True: lines on standard error; None: a bar in a notebook

        Raises UsageError if the bound is not verified or no PD strategy hops, NotSolvedError if a rung is not solved.
        """
        return as_class(Ladder, ladder.ladder(self, told(progress), orders, within(time_limit)))

    def to_xarray(self) -> "xr.Dataset":
        """The figures that are numbers, along the strategies."""
        return views.comparison_dataset(self)

    def to_dataframe(self) -> "pd.DataFrame":
        """The same as a table: a row for every strategy, the optimum first."""
        return views.comparison_frame(self)

    def _repr_html_(self) -> str:
        return views.comparison_html(self)


@dataclass(frozen=True, repr=False)
class HopsComparison(_BesideABound, hop_after_hop.HopsComparison):
    """The periodic bound, the plan that was tracked, and every strategy's hops by name."""

    @overload
    def plot(self, name: None = None) -> "dict[str, Figure]": ...
    @overload
    def plot(self, name: str) -> "Figure": ...
    def plot(self, name: str | None = None) -> "dict[str, Figure] | Figure":
        """All figures by name, or the one called ``name``.

        name: clearances, orbit; basin where basins were asked for

        Raises UsageError for another name.
        """
        from hopopt.plots.hops import FIGURES

        return figures(self, {key: draw for key, draw in FIGURES.items() if self.basins or key != "basin"}, name)

    @renamed(say="progress")
    def why(self, *, orders: int = 3, time_limit: float | None = None, progress: Progress = None) -> Ladder:
        """Why PD control keeps up less than the bound; as ``Comparison.why``."""
        return as_class(Ladder, ladder.ladder(self, told(progress), orders, within(time_limit)))

    def to_xarray(self) -> "xr.Dataset":
        """The figures that are numbers, along the strategies."""
        return views.comparison_dataset(self)

    def to_dataframe(self) -> "pd.DataFrame":
        """The same as a table: a row for every strategy."""
        return views.comparison_frame(self)
