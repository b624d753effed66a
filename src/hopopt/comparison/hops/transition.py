"""From rest, or from one periodic hop, to another: the fewest hops that lead there, as one program."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hopopt.design import Design
from hopopt.drivetrain.dynamics import refuse_series_springs
from hopopt.errors import NotSolvedError, UsageError
from hopopt.nlp.deadline import NEVER, Deadline
from hopopt.ocp.hops.several_hops import in_words
from hopopt.planner.several_hops import HopsPlan, plan_hops
from hopopt.planner.solution import Solution
from hopopt.planner.solve import TIME_LIMIT, solve

MOST, LARGEST = 4, 20  # hops that are tried, and that may be asked for


@dataclass(frozen=True)
class Transition:
    """The fewest hops that lead onto an orbit.

    plan: the hops.
    orbit: the periodic hop on which they end.
    begin: the periodic hop from which they start; None from rest.
    fewer: why fewer hops were not found to do, a sentence for each number.
    """

    plan: HopsPlan
    orbit: Solution
    begin: Solution | None = None
    fewer: tuple[str, ...] = ()

    def __repr__(self) -> str:
        state = "verified" if self.verified else "not verified"
        return (
            f"<Transition of {self.design.name}: {in_words(len(self.plan.hops))}, {self.plan.duration:.3f} s, {state}>"
        )

    @property
    def design(self) -> Design:
        """The problem that the hops solve; a stored orbit may be of another ground."""
        return self.plan.hops[0].design

    @property
    def verified(self) -> bool:
        """Whether the hops are, and the orbits at both ends."""
        return self.plan.verdict.verified and self.orbit.verified and (self.begin is None or self.begin.verified)

    @property
    def exit_code(self) -> int:
        """0 if verified, else 3."""
        return 0 if self.verified else 3

    def as_dict(self) -> dict[str, Any]:
        """One object, for ``--json``."""
        return {
            "problem": self.design.name,
            "hops": len(self.plan.hops),
            "duration_s": self.plan.duration,
            "effort_s": self.plan.effort,
            "clearances_m": list(self.plan.clearances),
            "durations_s": [{name: phase.duration for name, phase in hop.phases.items()} for hop in self.plan.hops],
            "from": None if self.begin is None else _orbit(self.begin),
            "to": _orbit(self.orbit),
            "fewer_hops": list(self.fewer),
            "verified": self.verified,
            "certified": self.plan.verdict.certified,
            "checks": len(self.plan.verdict.checks),
            "failed_checks": self.plan.verdict.failed_checks,
            "exit_code": self.exit_code,
        }


def _orbit(solution: Solution) -> dict[str, Any]:
    orbit = solution.summary.orbit
    assert orbit is not None
    where = str(solution.result_dir) if solution.result_dir else None
    return {
        "clearance_m": solution.clearance,
        "period_s": orbit.period_s,
        "verified": solution.verified,
        "result": where,
    }


def transition(
    design: Design,
    *,
    begin: Solution | None = None,
    orbit: Solution | None = None,
    clearances: Sequence[float] = (),
    most: int = MOST,
    starts: int | None = None,
    processes: int = 1,
    progress: Callable[[str], None] | None = None,
    until: Deadline = NEVER,
) -> Transition:
    """The fewest hops from rest, or from the periodic hop ``begin``, onto the periodic hop ``orbit``: by default the highest.

    clearances: what each hop must clear at least [m], which says how many there are; most: hops that are tried otherwise.
    Raises UsageError for hops that are not periodic or of another leg, NotSolvedError if no number of hops leads there.
    """
    say = progress or (lambda text: None)
    refuse_series_springs(design.leg, "a plan of several hops")
    design = design.of_kind("periodic")
    if not all(np.isfinite(least) and least >= 0 for least in clearances):
        raise UsageError(
            f"clearances {', '.join(f'{c:g}' for c in clearances)}: heights in metres from 0 on are needed"
        )
    for count in (most, max(len(clearances), 1)):
        if not 1 <= count <= LARGEST:
            raise UsageError(f"{count} hops: from 1 to {LARGEST} are looked for")
    for words, known in (("from", begin), ("onto", orbit)):
        if known is not None:
            _suits(design, known, words)
    if orbit is None:
        say("solving for the periodic hop")
        orbit = solve(design, starts=starts, processes=processes, time_limit=min(TIME_LIMIT, until.seconds_left))
    tried = [tuple(clearances)] if clearances else [(0.0,) * count for count in range(1, most + 1)]
    fewer = list[str]()
    for each in tried[:-1]:
        try:
            return Transition(_looked_for(design, begin, orbit, each, say, until), orbit, begin, tuple(fewer))
        except NotSolvedError as error:
            fewer.append(error.diagnosis[0] if error.diagnosis else str(error))
    return Transition(_looked_for(design, begin, orbit, tried[-1], say, until), orbit, begin, tuple(fewer))


def _looked_for(
    design: Design,
    begin: Solution | None,
    orbit: Solution,
    clearances: Sequence[float],
    say: Callable[[str], None],
    until: Deadline,
) -> HopsPlan:
    say(f"looking for a way onto the orbit in {in_words(len(clearances))}")
    return plan_hops(design, begin, orbit, clearances, say, until.within(TIME_LIMIT))


def _suits(design: Design, known: Solution, words: str) -> None:
    """UsageError for a stored hop that is not periodic, or of another leg."""
    where = known.result_dir or known.design.name
    if not known.design.hop.periodic:
        raise UsageError(f"{where}: a way {words} a periodic hop is asked for; solve one: hopopt solve --hop periodic")
    if known.design.leg != design.leg:
        raise UsageError(f"{where}: this hop is of another leg than the problem {design.name}")
