"""Results written into folders of their own: what ``save`` does, and verbs that are given ``results``."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from hopopt.comparison import stored as comparisons
from hopopt.comparison.compare import Comparison
from hopopt.comparison.hops import stored as hops
from hopopt.comparison.hops.hop_after_hop import HopsComparison
from hopopt.comparison.hops.transition import Transition
from hopopt.comparison.robust import stored as robust
from hopopt.comparison.robust.robust import RobustHop
from hopopt.control.closed_loop import Run
from hopopt.errors import UsageError
from hopopt.planner.solution import Solution
from hopopt.storage import solution as storage
from hopopt.storage.folder import prepare

Kept = TypeVar("Kept", bound="Solution | Comparison | HopsComparison | RobustHop | Transition | Run")
Figures = Callable[[Any, Path], Any]
WRITERS: Mapping[type, Callable[[Any, Path, Any], Path]] = {
    Comparison: lambda c, place, draw: comparisons.save_comparison(c, place, figures=draw),
    HopsComparison: lambda c, place, draw: hops.save_hops(c, place, figures=draw),
    RobustHop: lambda r, place, draw: robust.save_robust(r, place, figures=draw),
    Transition: lambda t, place, draw: hops.save_transition(t, place, figures=draw),
    Run: lambda r, place, draw: comparisons.save_run(r, len(r.trace.times_of("touchdown")), place, figures=draw),
}


def save(found: Kept, results: str | Path = "results", figures: Figures | None = None) -> Kept:
    """Write a result into a new folder; the same result with its ``folder`` noted. Studies and fronts keep themselves.

    found: a solution, comparison, robust plan, transition or run
    results: the folder below which
    figures: called with the result and a folder, draws what is to lie there

    Raises ResultError if it cannot be written; the data of a solution are then kept in a folder for temporary files.
    """
    made: Any = found
    if isinstance(made, Solution):
        made = storage.save(made, results, figures)
        return made
    draw = None if figures is None else partial(figures, found)
    for kind, write in WRITERS.items():
        if isinstance(made, kind):
            return replace(made, folder=write(made, Path(results), draw))
    raise UsageError(f"a {type(found).__name__} cannot be saved: it keeps itself, or is no result")


def check_can_be_kept(results: str | Path | None) -> None:
    """ResultError, before the work, if nothing can be written there."""
    if results is not None:
        prepare(Path(results))


def kept(found: Kept, results: str | Path | None) -> Kept:
    """What was found, written if there is a folder for it."""
    return found if results is None else save(found, results)
