"""What the other verbs return, with methods: studies, fronts, robust hops, transitions and simulated runs."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Self, overload

from hopopt.api.asked import as_class, check_figure, figures
from hopopt.api.notebook import views
from hopopt.api.solution import Solution
from hopopt.comparison.hops import transition
from hopopt.comparison.robust import robust
from hopopt.control import closed_loop
from hopopt.design import Design
from hopopt.studies.choose import choice
from hopopt.studies.choose.run import written
from hopopt.studies.maps import found as maps
from hopopt.studies.pareto import front
from hopopt.studies.sweep import run

if TYPE_CHECKING:
    import pandas as pd  # pyright: ignore[reportMissingTypeStubs]
    import xarray as xr
    from matplotlib.figure import Figure


@dataclass(frozen=True, repr=False)
class Study(run.Study):
    """A finished study: its definition, every point in order, its folder, the seconds of this run."""

    @property
    def verified(self) -> bool:
        """Whether every point is."""
        return not self.failures

    @overload
    def plot(self, name: None = None) -> "dict[str, Figure]": ...
    @overload
    def plot(self, name: str) -> "Figure": ...
    def plot(self, name: str | None = None) -> "dict[str, Figure] | Figure":
        """All figures by name, or the one called ``name``: study. Raises UsageError for another name."""
        from hopopt.plots.studies.sweep import figures

        check_figure(name, *(known := figures(self)))
        return known if name is None else known[name]

    def to_xarray(self) -> "xr.Dataset":
        """The points, with a dimension for each varied entry if they are a grid."""
        return views.study_dataset(self)

    def to_dataframe(self) -> "pd.DataFrame":
        """A row for every point: the varied entries, then what came of it."""
        return views.study_frame(self)

    def _repr_html_(self) -> str:
        return views.study_html(self)


@dataclass(frozen=True, repr=False)
class Map(maps.Map, Study):
    """A study of the first mesh alone, with the points that were verified."""


@dataclass(frozen=True, repr=False)
class Choice(choice.Choice):
    """Motors and gears that clear a height, the best first, and what the others lack."""

    def problem(self, name: str | None = None) -> Design:
        """The problem with a pair on its leg, and the body that carries it.

        name: of a pair, such as "mini-cheetah" (None: the first that clears)

        Raises UsageError for a pair that was not tried, or if none clears.
        """
        return written(self, self.find(name))

    def plot(self, name: str | None = None) -> "Figure":
        """Clearance over the drives' mass ("mass") or over the peak of what they give together ("peak_power").

        Raises UsageError for another name.
        """
        from hopopt.plots.studies.choice import AGAINST, figure

        check_figure(name, *AGAINST)
        return figure(self, name or "mass")

    def to_dataframe(self) -> "pd.DataFrame":
        """A row for every pair, those that clear first: what --json gives of each."""
        return views.choice_frame(self)

    def _repr_html_(self) -> str:
        return views.choice_html(self)


@dataclass(repr=False)
class Front(front.Front):
    """A Pareto front of the clearance against what it costs, point by point."""

    # the list below may be added to while the front is traced; this one is of a front that is
    solutions: list[Solution | None] = field(default_factory=list)  # pyright: ignore

    @classmethod
    def with_methods(cls, found: front.Front) -> Self:
        """The front with its methods."""
        return as_class(
            cls, found, solutions=[None if s is None else Solution.with_methods(s) for s in found.solutions]
        )

    def plot(self, name: str | None = None) -> "Figure":
        """What a clearance costs at least, its one figure: front. Raises UsageError for another name."""
        from hopopt.plots.studies.pareto import figure

        check_figure(name, "front")
        return figure(self)

    def to_xarray(self) -> "xr.Dataset":
        """The points along the clearances that were asked for, asked_m [m]."""
        return views.front_dataset(self)

    def to_dataframe(self) -> "pd.DataFrame":
        """A row for every point in the order of its clearance; columns are named as those of a study."""
        return views.front_frame(self)


@dataclass(frozen=True, repr=False)
class RobustHop(robust.RobustHop):
    """What a share of the drawn legs reaches, and the bounds beside it.

    folder: where it lies; None if it is not kept
    """

    bound: Solution
    ideal_bound: Solution
    folder: Path | None = field(default=None, kw_only=True)

    @classmethod
    def with_methods(cls, found: robust.RobustHop) -> Self:
        """The robust hop with its methods."""
        return as_class(
            cls, found, bound=Solution.with_methods(found.bound), ideal_bound=Solution.with_methods(found.ideal_bound)
        )

    @property
    def verified(self) -> bool:
        """Whether both bounds and the plan are."""
        return self.exit_code == 0

    def plot(self, name: str | None = None) -> "Figure":
        """The share of the drawn legs over the clearance that they reach, and bounds: its one figure, share_of_legs.

        Raises UsageError for another name.
        """
        from hopopt.plots.controllers.robust import share_of_legs

        check_figure(name, "share_of_legs")
        return share_of_legs(self)

    def to_xarray(self) -> "xr.Dataset":
        """What every drawn leg reached, along strategies and legs."""
        return views.robust_dataset(self)

    def to_dataframe(self) -> "pd.DataFrame":
        """A row for every drawn leg and strategy; columns are named as those of a study."""
        return views.robust_frame(self)


@dataclass(frozen=True, repr=False)
class Transition(transition.Transition):
    """The fewest hops that lead onto a periodic hop.

    folder: where it lies; None if it is not kept
    """

    orbit: Solution
    begin: Solution | None = None
    folder: Path | None = field(default=None, kw_only=True)

    @classmethod
    def with_methods(cls, found: transition.Transition) -> Self:
        """The transition with its methods."""
        begin = None if found.begin is None else Solution.with_methods(found.begin)
        return as_class(cls, found, orbit=Solution.with_methods(found.orbit), begin=begin)

    def plot(self, name: str | None = None) -> "Figure":
        """Heights of the leg's lowest point and of the body over all hops, its one figure: heights.

        Raises UsageError for another name.
        """
        from hopopt.plots.transition import heights

        check_figure(name, "heights")
        return heights(self)


@dataclass(frozen=True, repr=False)
class Run(closed_loop.Run):
    """One simulated run.

    folder: where it lies; None if it is not kept
    """

    folder: Path | None = field(default=None, kw_only=True)

    @overload
    def plot(self, name: None = None) -> "dict[str, Figure]": ...
    @overload
    def plot(self, name: str) -> "Figure": ...
    def plot(self, name: str | None = None) -> "dict[str, Figure] | Figure":
        """All figures of the first hop by name, or the one called ``name``.

        name: foot_height, saturation, speed_torque, stiffness or stick

        Raises UsageError for another name.
        """
        from hopopt.plots.controllers.runs import FIGURES

        known = {key: draw for key, draw in FIGURES.items() if key != "budget"}  # which is of a run beside its bound
        return figures({self.strategy.name: self.figures}, known, name)
