"""One point of a map: solved on the first mesh alone, warm from each family of hops that could be the best there.

A family that was so far below the best one is solved again after a way over the map on which it may have caught up. Where
no family leads to a hop, the point is solved from the problem's own starts; points of a list have no families.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np

from hopopt.errors import HopoptError, ProblemFileError, one_line
from hopopt.nlp.deadline import NEVER, Deadline
from hopopt.nlp.solver.ipopt import CARRIED, NlpSolution, NlpSolver
from hopopt.nlp.transcription import Transcription
from hopopt.ocp.hop import Hop
from hopopt.ocp.phases import STANCE
from hopopt.studies.maps.cold import TOLERANCE, cold_program, from_starts, settled
from hopopt.studies.sweep.definition import Definition
from hopopt.studies.sweep.first_program import first_program
from hopopt.studies.sweep.order import UNLIKE
from hopopt.studies.sweep.point_file import IMPOSSIBLE, NOT_SOLVED, PRELIMINARY, Point

WARM_ITERATIONS = 40  # at most, from a neighbour
WARM = CARRIED | {"ipopt.tol": TOLERANCE, "ipopt.max_iter": WARM_ITERATIONS}
CATCHES_UP = 0.2  # share of the objective that a family may gain on the best over an axis' whole range
ALWAYS = 0.02  # share of the objective: a family this near to the best is solved at every point
SAME_VALUE = 5e-4  # share of the objective within which two hops that look alike are one
LONGEST = 60.0  # s of one point
RESTART = 0  # family of what a restart found
NO_HOP = "no family of hops and no start led to a hop on the first mesh"


@dataclass(frozen=True)
class MapPoint(Point):
    """A point of a map; its value is of the first mesh, and nothing of it is verified.

    family: which family of hops it is of, from 1; 0: of one that a restart found
    switched: whether it is another family than at the point that it began from
    seen: families that were followed to it
    """

    family: int = RESTART
    switched: bool = False
    seen: tuple[int, ...] = ()

    @property
    def solved(self) -> bool:
        """Whether it has a value."""
        return self.outcome == PRELIMINARY

    @property
    def kind(self) -> str:
        """What it has the colour of: its family."""
        return f"preliminary, family {self.family}" if self.family else "preliminary, found by a restart"


@dataclass(frozen=True)
class Carried:
    """A hop of a family where it was solved last.

    x: variables [SI]; lam_g, lam_x: multipliers
    gap: how far its objective was below the best there, as a share of that
    at: the place in the map, every axis from 0 to 1: where it was solved, or led to no hop since then
    """

    x: np.ndarray
    lam_g: np.ndarray
    lam_x: np.ndarray
    gap: float
    at: np.ndarray

    def left(self, place: np.ndarray) -> "Carried":
        """The same at a place where it led to no hop, or was not tried: next it is tried only as far from there again."""
        return replace(self, at=place) if self.may_be_best(place) else self

    def may_be_best(self, place: np.ndarray) -> bool:
        """Whether its family may have caught up at another place."""
        return self.gap <= max(ALWAYS, CATCHES_UP * float(np.abs(place - self.at).sum()))


Families = Mapping[int, Carried]


def solved_at(definition: Definition, k: int, families: Families, before: int | None) -> tuple[MapPoint, Families]:
    """Point k from the families as they are carried to it, and those carried on; ``before``: the best family where it
    begins."""
    point = MapPoint(k, definition.values(k), NOT_SOLVED)
    return solved_with(definition, point, definition.normalized[k], families, before)


def solved_with(
    definition: Definition, point: MapPoint, place: np.ndarray, families: Families, before: int | None,
    until: Deadline = NEVER, restarts: bool = True,
) -> tuple[MapPoint, Families]:  # fmt: skip
    """A point at any place of the study, not only those of its list: as ``solved_at``, by a deadline; from the problem's own
    starts only with ``restarts`` or where there are no families."""
    try:
        hop = Hop(definition.design_with(point.values), definition.objective)
        found, t = _found(definition, hop, point, place, families, until.within(LONGEST), restarts)
    except ProblemFileError as error:
        words = error.problems[0].removeprefix("override ")
        return replace(point, outcome=IMPOSSIBLE, sentence=words), families
    except HopoptError as error:  # one point does not end a map
        return replace(point, sentence=one_line(error)), families
    if not found:
        return replace(
            point, sentence="no start led to a hop on the first mesh" if definition.listed else NO_HOP
        ), families
    distinct = _distinct(hop, t, found)
    best = next(iter(distinct))
    kept = {f: c.left(place) for f, c in families.items() if f not in found and f != RESTART}
    top = hop.objective.signed_value(distinct[best].value)
    for family, s in distinct.items():
        gap = (top - hop.objective.signed_value(s.value)) / max(abs(top), s.least)
        kept[family] = Carried(s.z * t.scale, s.lam_g, s.lam_x, gap, place)
    return _stated(hop, replace(point, seen=tuple(sorted(found))), distinct[best].value, best, before), kept


def _stated(hop: Hop, point: MapPoint, value: float, family: int, before: int | None) -> MapPoint:
    height = value if hop.objective.figure == "clearance_m" else None
    return replace(
        point, outcome=PRELIMINARY, objective_value=value, unverified_clearance_m=height, family=family,
        switched=before is not None and before != family,
    )  # fmt: skip


def _found(
    definition: Definition, hop: Hop, point: MapPoint, place: np.ndarray, families: Families, until: Deadline,
    restarts: bool,
) -> tuple[dict[int, NlpSolution], Transcription]:  # fmt: skip
    """What the families lead to that may be best here, else all of them, else the problem's starts; failures left out."""
    if not families:
        return _from_starts(definition, hop, point, until)
    t, solver = first_program(definition, hop, point.values, until, WARM)
    fitting = {f: c for f, c in families.items() if (len(c.x), len(c.lam_g)) == (len(t.scale), len(t.lbg))}
    likely = [f for f, c in fitting.items() if c.may_be_best(place)]
    for chosen in (likely, [f for f in fitting if f not in likely]):
        found = {f: s for f in chosen if not until.passed and (s := _warm(t, solver, fitting[f])).success}
        if found:
            return found, t
    return _from_starts(definition, hop, point, until) if restarts and not until.passed else ({}, t)


def _warm(t: Transcription, solver: NlpSolver, carried: Carried) -> NlpSolution:
    return solver.from_vector(carried.x / t.scale, (carried.lam_g, carried.lam_x))


def _from_starts(
    definition: Definition, hop: Hop, point: MapPoint, until: Deadline
) -> tuple[dict[int, NlpSolution], Transcription]:
    """The first hop that the problem's starts lead to, of a list the best."""
    solver = cold_program(definition, hop, point, until)
    ended = list(islice(from_starts(hop, solver, definition.wish), None if definition.listed else 1))
    best = max(ended, key=lambda s: hop.objective.signed_value(s.value), default=None)
    return {} if best is None else {RESTART: best}, solver.transcription


def _distinct(hop: Hop, t: Transcription, found: Mapping[int, NlpSolution]) -> dict[int, NlpSolution]:
    """The hops that are no other's, the best first: two families can end in one."""
    ranked = sorted(found.items(), key=lambda each: (-hop.objective.signed_value(each[1].value), each[0]))
    kept = dict[int, NlpSolution]()
    for family, s in ranked:
        if not any(_alike(t, s, other) for other in kept.values()):
            kept[family] = s
    return kept


def _alike(t: Transcription, a: NlpSolution, b: NlpSolution) -> bool:
    """Whether two hops of one program are the same, by their values and stances."""
    where = t.variables[STANCE]
    apart = np.abs(a.z - b.z)
    near = max(apart[where.x].max(), apart[where.durations].max()) < UNLIKE
    return near and abs(a.value - b.value) <= SAME_VALUE * max(abs(a.value), a.least)


def solved_from_points(
    definition: Definition, point: MapPoint, begins: Sequence[tuple[int, np.ndarray]]
) -> tuple[MapPoint, np.ndarray]:
    """A point solved again from the variables (SI) at others, each with its family; the better of it and what they lead
    to, and its variables, empty if it is the point as it was."""
    hop = Hop(definition.design_at(point.index), definition.objective)
    solver = cold_program(definition, hop, point, NEVER.within(LONGEST))
    best, x, seen = point, np.zeros(0), tuple(sorted({*point.seen, *(family for family, _ in begins)}))
    for family, begin in begins:
        if len(begin) != len(solver.transcription.scale):  # another mesh
            continue
        s = settled(solver, solver.from_vector(begin.astype(float) / solver.transcription.scale))
        if s.success and _better(hop, s.value, best):
            best, x = _stated(hop, point, s.value, family, point.family), s.z * solver.transcription.scale
    return replace(best, seen=seen, corrected=point.corrected or len(x) > 0), x


def _better(hop: Hop, value: float, than: Point) -> bool:
    if than.objective_value is None:
        return True
    return hop.objective.signed_value(value - than.objective_value) > SAME_VALUE * abs(than.objective_value)
