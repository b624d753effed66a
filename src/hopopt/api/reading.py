"""Results that are kept in folders: read as what they were, and verified again."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeVar, overload

from hopopt import extensions
from hopopt.api.asked import Constraint, Objective, Progress, as_class, told
from hopopt.api.results import Front, Map, RobustHop, Run, Study, Transition
from hopopt.api.solution import Comparison, HopsComparison, Solution
from hopopt.comparison import stored as comparisons
from hopopt.comparison.control_recheck import control_check
from hopopt.comparison.hops import stored as hops
from hopopt.comparison.robust import stored as robust
from hopopt.errors import ResultError, UsageError
from hopopt.planner import solution
from hopopt.planner.checks.verdict import Verdict
from hopopt.storage import solution as storage
from hopopt.storage.folder import fitting
from hopopt.storage.seal.recheck import recheck, with_functions
from hopopt.studies.maps.run import map_in
from hopopt.studies.pareto.front import read_front, with_solutions
from hopopt.studies.sweep.recheck import recheck_study
from hopopt.studies.sweep.run import study_in
from hopopt.studies.sweep.store import read_definition

Result = Solution | Study | Front | Comparison | HopsComparison | RobustHop | Transition | Run
Kind = TypeVar("Kind", bound=Result)


def _study(folder: Path) -> Study:
    if read_definition(folder).preliminary:
        return as_class(Map, map_in(folder))
    return as_class(Study, study_in(folder))


READERS: Mapping[str, Callable[[Path], Result]] = {  # by a file that only such a folder has
    "solution.nc": lambda folder: Solution.with_methods(storage.read(folder)),
    "sweep.json": _study,
    "front.json": lambda folder: Front.with_methods(with_solutions(read_front(folder))),
    "comparison.json": lambda folder: Comparison.with_methods(comparisons.read_comparison(folder)),
    "hops.json": lambda folder: HopsComparison.with_methods(hops.read_hops(folder)),
    "robust.json": lambda folder: RobustHop.with_methods(robust.read_robust(folder)),
    "transition.json": lambda folder: Transition.with_methods(hops.read_transition(folder)),
    "simulation.json": lambda folder: as_class(Run, comparisons.read_run(folder)),
}


@overload
def read(folder: str | Path) -> Solution: ...
@overload
def read(folder: str | Path, kind: type[Kind]) -> Kind: ...
def read(folder: str | Path, kind: type[Result] | None = None) -> Result:
    """A result from its folder, as what it was: a hop, study, map, front, comparison, robust plan, transition or run.

    folder: that ``save``, a verb with ``results`` or a command wrote; ``doubts`` of a solution name files that were changed
    kind: which of them it must be, such as ``ho.Study``, so that an editor knows it; None: any, and an editor takes it for
        a ``Solution``

    Of a comparison hop after hop one whole hop of each strategy is kept; controllers are gone. Raises ResultError if something
    is missing or broken, or if it is of another kind; UsageError, naming the module, for a strategy whose module is not here.
    """
    folder = Path(folder)
    reader = next((made for name, made in READERS.items() if (folder / name).is_file()), None)
    if reader is None:
        storage.read(folder)  # says what is wrong with it
        raise ResultError(f"{folder}: no results folder")
    with fitting(folder):
        found = reader(folder)
    if kind is not None and not isinstance(found, kind):
        raise ResultError(f"{folder}: it holds a {type(found).__name__}, not a {kind.__name__}")
    return found if isinstance(found, Solution | Study | Front) else replace(found, folder=folder)


# ---- verified again -----------------------------------------------------------------------------------------------


@dataclass(frozen=True, repr=False)
class Verification:
    """What checking a result again says of it.

    result: what was checked, in words
    faults: what is wrong, a sentence each; empty of a result that is verified
    hops: name -> the verdict on each hop in it: checks with what was measured and what is allowed, certificate, error
    points: of a study, how many points were computed again
    """

    result: str
    faults: tuple[str, ...]
    hops: Mapping[str, Verdict] = field(default_factory=dict[str, Verdict])
    points: int = 0

    def __repr__(self) -> str:
        return f"<Verification of {self.result}: {'verified' if self.verified else f'NOT verified: {self.faults[0]}'}>"

    @property
    def verified(self) -> bool:
        """Whether nothing is wrong."""
        return not self.faults

    def as_dict(self) -> dict[str, Any]:
        """The verdict in words and, by hop, the names of checks that failed."""
        failed = {name: verdict.failed_checks for name, verdict in self.hops.items()}
        return {"verified": self.verified, "faults": list(self.faults), "failed_checks": failed, "points": self.points}


def verify(
    result: Result | str | Path,
    *,
    objective: Objective | None = None,
    constraints: Sequence[Constraint] = (),
    progress: Progress = None,
) -> Verification:
    """Check a result again, as ``hopopt verify`` does: every hop in it, every solved point of a study; nothing is written.

    result: what ``solve``, ``read`` or another verb returned, or a folder
    objective, constraints: functions of your own that a solution was found with, if they are not in a module
    progress: a function that is told a line of text; True: lines on standard error; None: a bar in a notebook

    Raises ResultError for a folder that cannot be read, UsageError for what has no hop of the optimiser, such as a run.
    """
    found, say = read(result) if isinstance(result, str | Path) else result, told(progress)
    if isinstance(found, Study):
        again, changed = recheck_study(found.folder, say)
        faults = (*changed, *(f"{r.path.name}: {r.fault or r.doubt}" for r in again if r.fault or r.doubt))
        return Verification(repr(found).strip("<>"), faults, points=len(again))
    verdicts = dict[str, Verdict]()
    for name, hop in _hops_in(found):
        say(f"checking {name}")
        own = with_functions(hop, objective, constraints) if objective or constraints else hop
        verdicts[name] = recheck(own).with_checks((), control_check(own))
    if not verdicts:
        raise UsageError(f"{found!r} has no hop of the optimiser that could be verified")
    return Verification(repr(found).strip("<>"), tuple(_faults(found, verdicts)), verdicts)


def _hops_in(found: Result) -> Iterator[tuple[str, solution.Solution]]:
    """The hops of the optimiser in a result, each with its name."""
    if isinstance(found, Solution):
        yield "hop", found
    elif isinstance(found, Front):
        yield from ((f"{p.asked_m:.4f} m", s) for p, s in zip(found.points, found.solutions, strict=True) if s)
    else:
        names = ("solution", "plan", "bound", "ideal_bound", "orbit", "begin")
        hops = ((name, getattr(found, name, None)) for name in names)
        yield from ((name, hop) for name, hop in hops if isinstance(hop, solution.Solution))


def _faults(found: Result, verdicts: Mapping[str, Verdict]) -> Iterator[str]:
    for name, hop in _hops_in(found):
        yield from extensions.doubts(hop.summary.extensions)
        yield from (f"{name}: {check.name} ({check.where})" for check in verdicts[name].failed)
