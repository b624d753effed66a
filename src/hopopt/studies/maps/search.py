"""Where a map begins: the search of a single solve at the point nearest its middle, and the families that it finds."""

from collections.abc import Iterator, Sequence

import numpy as np

from hopopt.errors import NotSolvedError, ProblemFileError, UsageError
from hopopt.nlp.deadline import NEVER
from hopopt.ocp.hop import Hop
from hopopt.planner.motion import Motion
from hopopt.planner.search.families import motion, words
from hopopt.planner.search.first_mesh import search_first_mesh
from hopopt.planner.search.multistart import Progress, StartOutcome, distinct, first_transcription, solution_of
from hopopt.planner.search.required_clearance import from_highest
from hopopt.planner.solve import SEARCHING, TIME_LIMIT
from hopopt.studies.maps.piece import FIRST, Part
from hopopt.studies.maps.warm import Carried
from hopopt.studies.sweep.definition import Definition

FAMILIES = 3  # that are carried through the map, at most
WORTH_CARRYING = 0.3  # share of the best's objective by which a family may be worse
TRIED = 4  # points, from the middle outwards, at which a hop is looked for


def first_search(definition: Definition, processes: int, say: Progress) -> Part:
    """The families of the first point at which the search finds a hop, as they are carried on from there; UsageError if no
    point is a possible problem, NotSolvedError if none of the first that are has a hop. No families of a list."""
    if definition.listed:
        return Part(FIRST, 0, (), {})
    reason: Exception = UsageError("no point of the study is a possible problem")
    for tried, (k, hop) in enumerate(_possible(definition)):
        if tried == TRIED:
            break
        say(f"searching at the first design, number {k + 1} of {len(definition.points)}")
        try:
            until = NEVER.within(SEARCHING * TIME_LIMIT)
            count = definition.starts or hop.design.solver.starts
            besides = from_highest(hop, count, say, until=until)
            found = distinct(search_first_mesh(hop, count, processes, say, besides, until).outcomes)
        except NotSolvedError as error:
            reason = error
            continue
        if found:
            return _carried(definition, hop, k, found)
        reason = NotSolvedError(
            f"{definition.design.name}: no hop was found at the designs where the map was to begin."
        )
    raise reason


def _possible(definition: Definition) -> Iterator[tuple[int, Hop]]:
    """Points that are possible problems, from the middle outwards."""
    faults = list[str]()
    distance = np.linalg.norm(definition.normalized - 0.5, axis=1)
    for k in np.argsort(distance, kind="stable").tolist():
        try:
            hop = Hop(definition.design_at(k), definition.objective)
        except ProblemFileError as error:
            faults = faults or [error.problems[0].removeprefix("override ")]
            continue
        yield k, hop
    if len(faults) and len(definition.points) == 1:
        raise UsageError(f"no point of the study is a possible problem: {faults[0]}")


def _carried(definition: Definition, hop: Hop, k: int, found: list[StartOutcome]) -> Part:
    carried, said = families_of(hop, found, definition.normalized[k])
    return Part(FIRST, 0, (), {}, {k: carried}, said)


def families_of(
    hop: Hop, found: Sequence[StartOutcome], place: np.ndarray
) -> tuple[dict[int, Carried], tuple[str, ...]]:
    """Of the different hops that a search found, the best first, those worth carrying on from a place, by family from 1 on;
    and what they do, in words."""
    t = first_transcription(hop)
    top, size = found[0].signed_value, max(abs(found[0].objective), 1e-9)
    worth = [o for o in found[:FAMILIES] if top - o.signed_value <= WORTH_CARRYING * size]
    carried, said = dict[int, Carried](), list[str]()
    for family, o in enumerate(worth, 1):
        v = o.vectors
        gap = (top - o.signed_value) / size
        carried[family] = Carried(v["z"] * t.scale, v["lam_g"], v["lam_x"], gap, place)
        said.append(words(motion(hop, Motion(hop.design, hop.objective.name, solution_of(o, t).phases))))
    return carried, tuple(said)
