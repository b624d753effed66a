"""The best hop of a leg on the first mesh, solved again whenever its numbers change: warm, from the nearest design known.

Families are watched as in a map (studies/maps/warm.py): each that could be the best at the new place is solved.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from hopopt.design import Design
from hopopt.live.picture import picture
from hopopt.live.sliders import BODY, Slider, added_mass, most_rewarding, named, per_percent
from hopopt.nlp.deadline import NEVER, Deadline
from hopopt.nlp.solver.compiled import compiling
from hopopt.nlp.solver.ipopt import NlpSolution
from hopopt.nlp.transcription import Transcription
from hopopt.ocp.hop import Hop
from hopopt.ocp.objectives.registry import find
from hopopt.optimality.directions.parametric_sensitivity import gradient_by_parameters, slopes
from hopopt.optimality.error_estimate import objective_error
from hopopt.planner.motion import Motion
from hopopt.planner.search.first_mesh import search_first_mesh
from hopopt.planner.search.multistart import SAME_OPTIMUM, distinct, first_transcription, not_solved, solution_of
from hopopt.planner.search.required_clearance import from_highest
from hopopt.planner.solve import SEARCHING, TIME_LIMIT
from hopopt.problem.load import changed
from hopopt.problem.render import value_at
from hopopt.studies.maps.search import families_of
from hopopt.studies.maps.warm import WARM, Carried, Families, MapPoint, solved_with
from hopopt.studies.sensitivity import by_entry
from hopopt.studies.sweep.definition import Definition
from hopopt.studies.sweep.first_program import first_program, stored_outcome
from hopopt.studies.sweep.point_file import IMPOSSIBLE, NOT_SOLVED

KEPT = 200  # designs that others are solved from
HALVINGS = 2  # of the way to a design that the best family does not lead to at once
TOLD = 3  # entries that are said to hold the hop back
PRELIMINARY, NO_HOP = "preliminary", "no hop"
LONGEST = 2.0  # s of one answer: twice what 95 % take at most; whoever waits longer has let go of the slider
LATE = f"no hop was found within {LONGEST:g} s from the designs that are known; when the hands rest it is searched for from the start"
ONE_PLACE = "lhs:1"  # a study asks for points; its places are given one by one


@dataclass(frozen=True)
class Found:
    """What a design leads to on the first mesh.

    outcome: "preliminary", "impossible problem" or "no hop"; sentence: why it is none
    value: the objective [its unit], and error: by how much the first mesh's may be off, to first order
    words: what hops of its family do
    switched: another family is the best here than before
    limits: entries that hold it back most, each with what 1 % of it changes [the objective's unit]
    figures: what a list of designs tells (picture.py); picture: the hop as it is drawn
    carried: what verification begins from
    """

    outcome: str
    sentence: str = ""
    value: float | None = None
    error: float | None = None
    words: str = ""
    switched: bool = False
    limits: tuple[tuple[str, float], ...] = ()
    figures: Mapping[str, float | None] = field(default_factory=dict)
    picture: Mapping[str, Any] | None = None
    carried: Carried | None = None


@dataclass(frozen=True)
class Learnt:
    """What a search taught: whether it found a ``better`` hop there than was known, and how many ``new`` kinds."""

    better: bool = False
    new: int = 0


@dataclass(frozen=True)
class _Known:
    """A design that others are solved from: its place, its families, which of them was the best, and its values."""

    place: np.ndarray
    families: Families
    best: int
    values: Mapping[str, float]


class Bench:
    """A leg whose numbers change.

    design: the problem; objective: its objective
    asked: entries that get sliders, by name or with their ranges; none: the most rewarding ones
    """

    def __init__(
        self, design: Design, objective: str, asked: Sequence[str] = (), say: Callable[[str], None] = lambda text: None
    ):  # fmt: skip
        self._say, self._goal = say, find(objective)
        self.sliders = named(design, asked)
        unset = {s.entry: s.value for s in self.sliders if value_at(design, s.entry) is None}
        self.design = self._own = changed(design, unset) if unset else design
        self._own_sliders = self.sliders
        self._known, self._words, self._family = list[_Known](), dict[int, str](), None

    def begin(self, processes: int | None) -> tuple[list[Slider], Found]:
        """The sliders, and the hop of the problem as it is, from the first start that leads to one; NotSolvedError if none
        does."""
        hop, until = Hop(self.design, self._goal.name), NEVER.within(SEARCHING * TIME_LIMIT)
        for count in (1, max(2, self.design.solver.starts)):  # the first leads to one of most legs, in seconds
            besides = from_highest(hop, count, self._say, until=until)
            outcomes = search_first_mesh(hop, count, processes, self._say, besides, until).outcomes
            if found := distinct(outcomes):
                break
        else:
            raise not_solved(hop, outcomes, thorough=True, until=until)
        carried, words = families_of(hop, found, np.zeros(0))
        self._words = dict(enumerate(words, 1))
        if not self.sliders:
            nlp = _solution(hop, first_transcription(hop), carried[1], found[0].value)
            self.sliders = self._own_sliders = most_rewarding(self.design, _per_unit(hop, nlp))
        values = {s.entry: s.value for s in self.sliders}
        place = self._place(values)
        self._known = [_Known(place, {f: replace(c, at=place) for f, c in carried.items()}, 1, values)]
        with compiling():  # two seconds, once for a form of leg, that halve the time of all that follow
            return self.sliders, self.at(values, NEVER)

    def at(self, values: Mapping[str, float], until: Deadline | None = None) -> Found:
        """The hop with these values of the sliders' entries, within LONGEST or by a deadline."""
        definition, until = self._definition(), until or NEVER.within(LONGEST)
        point, families = self._solved(definition, values, until, restarts=True)
        if point.outcome == IMPOSSIBLE:
            return Found(IMPOSSIBLE, point.sentence)
        if not point.solved:
            return Found(NO_HOP, LATE if until.passed else point.sentence)
        return self._found(definition, point, families[point.family])

    def value_at(self, values: Mapping[str, float]) -> float | None:
        """The objective with these values alone, for a map; None where the hops that are known lead to none."""
        return self._solved(self._definition(), values, NEVER.within(LONGEST))[0].objective_value

    def learn(self, values: Mapping[str, float], families: Mapping[int, Carried], words: Sequence[str]) -> Learnt:
        """Take the kinds of hop that a search found at a design, the best first."""
        place, definition = self._place(values), self._definition()
        now = self._solved(definition, values, NEVER.within(LONGEST))[0].objective_value
        here = next((known for known in self._known if np.array_equal(known.place, place)), None)
        first = {0: replace(families[1], at=place)}
        begin = MapPoint(0, dict(values), NOT_SOLVED)
        point, found = solved_with(definition, begin, place, first, None, restarts=False)
        if point.objective_value is None:
            return Learnt()
        top, size = self._goal.signed_value(point.objective_value), abs(point.objective_value)
        best = -np.inf if now is None else self._goal.signed_value(now)
        seen = [] if here is None or now is None else [best - c.gap * abs(now) for c in here.families.values()]
        offered = {1: found[0], **{k: replace(c, at=place) for k, c in families.items() if k > 1}}
        last = max(self._words, default=0)
        new = {
            last + k: c
            for k, c in offered.items()
            if all(abs(top - families[k].gap * size - value) > SAME_OPTIMUM * size for value in seen)
        }
        self._words |= {k: words[k - last - 1] for k in new}
        better = bool(top - best > SAME_OPTIMUM * size)
        leads = last + 1 if better else here.best if here else 0
        self._remember(_Known(place, {**(here.families if here else {}), **new}, leads, values))
        return Learnt(better, len(new))

    def choose(self, choices: Mapping[str, str]) -> list[Slider]:
        """Take parts of the catalogue, by their places in the problem (none: as the problem has them); the sliders, which
        stand where the parts' numbers are, and that of the body's mass, which follows them."""
        mass = value_at(self._own, BODY)
        follows = {} if mass is None or not choices else {BODY: mass + added_mass(self._own, choices)}
        self.design = changed(self._own, {**choices, **follows}) if choices else self._own
        sliders = {s.entry: s for s in self._own_sliders}
        if follows and BODY not in sliders:
            sliders |= {s.entry: s for s in named(self.design, [BODY])}
        values = {entry: value_at(self.design, entry) for entry in sliders}
        self.sliders = [s.about(float(x)) for s in sliders.values() if isinstance(x := values[s.entry], (int, float))]
        last = self._known[-1]
        at = {s.entry: s.value for s in self.sliders}
        place = self._place(at)
        kinds = self._families(last.place)  # any of them may be the best with other parts
        self._known = [_Known(place, {f: replace(c, at=place, gap=0.0) for f, c in kinds.items()}, last.best, at)]
        return self.sliders

    def _solved(
        self, definition: Definition, values: Mapping[str, float], until: Deadline, halvings: int = HALVINGS,
        restarts: bool = False,
    ) -> tuple[MapPoint, Families]:  # fmt: skip
        """A design from the nearest known; where its best family does not lead there, by way of one in the middle."""
        place, near = self._place(values), self._nearest(values)
        begin = MapPoint(0, dict(values), NOT_SOLVED)
        point, families = solved_with(definition, begin, place, self._families(place), near.best, until, restarts=False)
        if point.outcome == IMPOSSIBLE:
            return point, families
        if near.best not in point.seen and halvings and not until.passed:
            self._solved(definition, self._between(near, values), until, halvings - 1)
            nearer = self._nearest(values)
            if nearer is not near:
                other, more = solved_with(
                    definition, point, place, self._families(place), nearer.best, until, restarts=False
                )
                if other.solved and (not point.solved or self._better(other, point)):
                    point, families = other, more
        if restarts and not point.solved and not until.passed:
            point, families = solved_with(definition, begin, place, self._families(place), near.best, until)
        if point.solved:
            self._remember(_Known(place, families, point.family, values))
        return point, families

    def _better(self, one: MapPoint, other: MapPoint) -> bool:
        value = self._goal.signed_value
        return value(one.objective_value or 0.0) > value(other.objective_value or 0.0)

    def _nearest(self, values: Mapping[str, float]) -> _Known:
        place = self._place(values)
        return min(self._known, key=lambda known: float(np.abs(known.place - place).sum()))

    def _between(self, near: _Known, values: Mapping[str, float]) -> dict[str, float]:
        """Values in the middle between a known design's and these; whole numbers stay as they are here."""
        return {
            s.entry: values[s.entry] if s.whole else 0.5 * (values[s.entry] + near.values[s.entry])
            for s in self.sliders
        }

    def _definition(self) -> Definition:
        axes = tuple(s.axis for s in self.sliders)
        return Definition(self.design, self._goal.name, axes, ONE_PLACE, preliminary=True)

    def _place(self, values: Mapping[str, float]) -> np.ndarray:
        """Every slider from 0 to 1."""
        return np.array([(values[s.entry] - s.low) / (s.high - s.low) for s in self.sliders])

    def _families(self, place: np.ndarray) -> dict[int, Carried]:
        """Every family that is known, from the nearest design at which it was solved."""
        found = dict[int, Carried]()
        for known in sorted(self._known, key=lambda known: -float(np.abs(known.place - place).sum())):
            found |= known.families
        return found

    def _remember(self, new: _Known) -> None:
        others = [known for known in self._known if not np.array_equal(known.place, new.place)]
        self._known = [*others[1 - KEPT :], new]

    def _found(self, definition: Definition, point: MapPoint, carried: Carried) -> Found:
        hop = Hop(definition.design_with(point.values), definition.objective)
        t, _ = first_program(definition, hop, point.values, NEVER, WARM)
        nlp = _solution(hop, t, carried, point.objective_value or 0.0)
        motion, error = Motion(hop.design, hop.objective.name, nlp.phases), objective_error(nlp)
        switched = self._family is not None and point.family != self._family
        self._family = point.family
        shown = picture(motion)
        return Found(
            PRELIMINARY, "", point.objective_value, error.too_high_by - error.second_order,
            self._words.get(point.family, ""), switched, _holding_back(hop, nlp), shown.figures, shown.drawn, carried,
        )  # fmt: skip


def _solution(hop: Hop, t: Transcription, carried: Carried, value: float) -> NlpSolution:
    """What is carried as a solution of a first mesh's program."""
    begin = {"x": carried.x, "lam_g": carried.lam_g, "lam_x": carried.lam_x, "objective": np.array(value)}
    return solution_of(stored_outcome(hop, t, begin), t)


def _per_unit(hop: Hop, nlp: NlpSolution) -> dict[str, float]:
    """The objective's derivatives by entries of the problem [its unit per theirs]."""
    return by_entry(hop.design, slopes(nlp, gradient_by_parameters(nlp.transcription)))


def _holding_back(hop: Hop, nlp: NlpSolution) -> tuple[tuple[str, float], ...]:
    """The entries of which 1 % changes the objective most, with that change."""
    found = per_percent(hop.design, _per_unit(hop, nlp))
    return tuple(sorted(found.items(), key=lambda item: -abs(item[1]))[:TOLD])
