"""The next mesh, from what is wrong with a solution in each interval, what that costs, and what is aimed at.

Where limits are enforced between the nodes (``next_cuts``), an interval is cut at once into as many pieces as its
local error and its tightening cost ask for by their orders. The local error falls with the interval's length to the
power of the nodes and one, the cost of a switch with its square. An interval that does not answer to enforcing its
limits is cut too. Where limits are tightened at the end (``cuts_before_tightening``), all that is wrong is cut into as
many pieces.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hopopt.nlp.deadline import NEVER, Deadline
from hopopt.nlp.mesh import PhaseMesh
from hopopt.nlp.refinement.interval_errors import IntervalErrors
from hopopt.nlp.refinement.tightening_cost import excess_costs, normalised_switch_times, tightening_costs
from hopopt.nlp.solver.ipopt import NlpSolution

BUDGET = 0.5  # share of the allowed tightening cost that a refinement is content with
AIM = 0.3  # share of the allowed local error, and of the tightening cost, that a cut aims at
CUT_SHARE = 0.3  # share of what is allowed, above which an interval is cut where others must be
PIECES = 8  # into which an interval is cut at most
UNRESPONSIVE_PIECES = 4  # pieces for an interval that does not answer
ANSWERS = 0.5  # share of its last excess, above which an interval does not answer to enforcing its limits
SLOW_ORDER = 2  # order to which an error falls that is still there on the second mesh
GRADED = 4.0  # times shorter: intervals of switches that should be that are cut about them
EARLY_MESHES = 2  # meshes before an error that wanders is suspected
LONGEST_INTERVAL = 0.01  # share of the phase: longer intervals may harbour one
AT_ONCE, LATER = 4, 4  # where limits are tightened at the end: pieces of all that is cut; as EARLY_MESHES
GROWTH = 1.5  # times the intervals of a mesh: how fine the next may be where not all cuts fit
NEARLY = 10.0  # times the local error that is aimed at, below which a mesh's objective tells of its optimum
SMEARED = 3e-3  # relative to the objective: more than the switches of a coarse mesh cost it
YET_TO_COME = 10.0  # times the objective's change with the last mesh: more than all finer meshes change it
LITTLE_ROOM = 0.1  # share of them: room for fewer is not worth a mesh
Cuts = Mapping[
    str, list[np.ndarray]
]  # for each phase, the normalised times (0 to 1) at which each interval is to be cut


@dataclass(frozen=True)
class Aims:
    """What a refinement is to reach, and with how much effort.

    local_error: of any interval, scaled
    change: relative change of the objective with the last mesh
    excess: share of its range by which a limit may be passed
    tightening_cost: relative to the objective
    meshes: most of them
    iterations: most of them on each mesh
    restarts: so many times ``iterations`` may go, over all meshes, into solving again without the last one's
        multipliers; restarts that only a doubt asks for are counted, but never refused
    until: by when it ends, with the mesh it is at
    known: objective, without its tie-break, of a hop that is verified [its unit]: what finer meshes cannot bring above it is left
    """

    local_error: float
    change: float
    excess: float
    tightening_cost: float
    meshes: int
    iterations: int
    restarts: float = 5.0
    until: Deadline = NEVER
    known: float | None = None


@dataclass(frozen=True)
class Measured:
    """A solution with what is wrong with it in each of a phase's N intervals, by phase."""

    solution: NlpSolution
    errors: Mapping[str, IntervalErrors]

    @cached_property
    def excess_costs(self) -> dict[str, np.ndarray]:
        """What tightening the limits by their excess would cost, (N,) [objective's unit]."""
        return excess_costs(self.solution, self.errors)

    @cached_property
    def costs(self) -> dict[str, np.ndarray]:
        """What the limits cost that were tightened, and what those would that are passed, (N,) [objective's unit]."""
        return {name: cost + self.excess_costs[name] for name, cost in tightening_costs(self.solution).items()}

    @property
    def cost(self) -> float:
        """All of that together [objective's unit]."""
        return sum(float(cost.sum()) for cost in self.costs.values())

    def budget(self, aims: Aims) -> float:
        """What all limits may cost [objective's unit]."""
        return BUDGET * aims.tightening_cost * self.solution.magnitude

    def urgency(self, aims: Aims) -> dict[str, np.ndarray]:
        """How far each interval is from all aims together, (N,)."""
        return {
            name: e.local / aims.local_error + e.excess / aims.excess + self.costs[name] / self.budget(aims)
            for name, e in self.errors.items()
        }


def outdone(m: Measured, aims: Aims, change: float) -> bool:
    """Whether a mesh is so accurate, and a known hop so much better, that finer ones cannot gain more on it than the ``change`` that
    is aimed at. ``change``: relative, of the objective with the last mesh."""
    local = max(float(e.local.max()) for e in m.errors.values())
    if aims.known is None or local > NEARLY * aims.local_error:
        return False
    loss = m.solution.transcription.problem.objective.cost(m.solution.value - aims.known)
    lacking = min(SMEARED, YET_TO_COME * change) * m.solution.magnitude
    gained = lacking + m.cost - loss  # at most: the cost, as limits need no tightening on a finer mesh
    return loss > 0 and gained < aims.change * m.solution.magnitude


def next_cuts(m: Measured, aims: Aims, solves: int, answered: Mapping[str, np.ndarray]) -> Cuts:
    """Where each interval is to be cut: if something asks for it, what nearly does is cut too.

    solves: so far; answered: excess (N,) of each phase's intervals to which the limits enforced since then answer.
    """
    unresponsive = {n: (e.excess > aims.excess) & (e.excess > ANSWERS * answered[n]) for n, e in m.errors.items()}
    asked = any(on.any() for on in unresponsive.values()) or any(
        (e.local > aims.local_error).any() for e in m.errors.values()
    )
    if not asked and m.cost <= m.budget(aims):
        return {name: equal(np.ones(len(on), dtype=int)) for name, on in unresponsive.items()}
    order = len(m.solution.transcription.scheme.c) + 1 if solves == 1 else SLOW_ORDER
    pieces = {}
    for name, e in m.errors.items():
        by_order = np.clip(np.ceil((e.local / (AIM * aims.local_error)) ** (1 / order)), 2, PIECES)
        inaccurate = _inaccurate(m, name, CUT_SHARE * aims.local_error, by_order, solves > EARLY_MESHES)
        pieces[name] = np.maximum(inaccurate, np.where(unresponsive[name], UNRESPONSIVE_PIECES, 1))
    return _costliest_too(m, aims, pieces, solves)


def _inaccurate(m: Measured, name: str, allowed: float, asked: np.ndarray | int, late: bool) -> np.ndarray:
    """Pieces for each interval by its local error; late in the refinement what the error may move to is halved."""
    over = m.errors[name].local > allowed
    moves = moves_to(over, m.solution.phases[name].lengths) & late
    return np.where(over, asked, np.where(moves, 2, 1)).astype(int)


def moves_to(over: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """Where errors of the intervals that are ``over`` may move to: those of a switch to its neighbours, those that
    live on coarse intervals to any other of them, (N,)."""
    coarse = lengths > max(0.5 * lengths.max(), LONGEST_INTERVAL * lengths.sum())
    return (np.convolve(over, [1, 1, 1])[1:-1] > 0) | (coarse & (over & coarse).any())


def _costliest(costs: Mapping[str, np.ndarray], budget: float) -> np.ndarray:
    """Costs of the intervals that are to be cut for the rest to be within the budget, cheapest first."""
    total = np.sort(np.concatenate(list(costs.values())))
    return total[np.searchsorted(np.cumsum(total), budget, side="right") :]


def _costliest_too(m: Measured, aims: Aims, others: Mapping[str, np.ndarray], solves: int) -> Cuts:
    """The costliest intervals cut until the rest is well within the budget, about their switch if that is known well
    enough (not on the first mesh); the others into so many pieces."""
    costly = _costliest(m.costs, CUT_SHARE * m.budget(aims))
    share, least = AIM * m.budget(aims) / max(1, len(costly)), costly.min(initial=np.inf)
    switch, found = normalised_switch_times(m.solution) if solves > 1 else {}, {}
    for name, each in m.costs.items():
        shorter = np.where(each >= least, np.sqrt(each / share), 1.0)  # by which share they should be
        found[name] = equal(np.maximum(others[name], np.clip(np.ceil(shorter), 1, PIECES)).astype(int))
        s = switch.get(name, np.full(len(each), np.nan))
        for k in np.flatnonzero((shorter > GRADED) & np.isfinite(s)):
            found[name][k] = about(float(s[k]), 1.0 / float(shorter[k]))
    return found


def cuts_before_tightening(m: Measured, aims: Aims, solves: int) -> Cuts:
    """Where limits are tightened at the end: inaccurate intervals cut, and the costliest until the rest is within what
    tightening may cost; ``solves``: so far."""
    least = _costliest(m.excess_costs, aims.tightening_cost * m.solution.magnitude).min(initial=np.inf)
    found = {}
    for name in m.errors:
        inaccurate = _inaccurate(m, name, aims.local_error, AT_ONCE, solves > LATER)
        found[name] = equal(np.maximum(inaccurate, np.where(m.excess_costs[name] >= least, AT_ONCE, 1)))
    return found


def cuts_of_what_is_wrong(m: Measured, aims: Aims) -> Cuts:
    """All intervals cut that are inaccurate or pass a limit."""
    wrong = {n: (e.excess > aims.excess) | (e.local > aims.local_error) for n, e in m.errors.items()}
    return {name: equal(np.where(on, AT_ONCE, 1)) for name, on in wrong.items()}


def uncut(m: Measured) -> Cuts:
    """Every interval as it is."""
    return {name: equal(np.ones(len(e.local), dtype=int)) for name, e in m.errors.items()}


def halved(m: Measured) -> Cuts:
    """Every interval in two."""
    return {name: equal(np.full(len(e.local), 2)) for name, e in m.errors.items()}


# ---- cuts ----------------------------------------------------------------------------------------------------


def equal(pieces: np.ndarray) -> list[np.ndarray]:
    """Places that cut each interval into so many equal pieces."""
    return [np.arange(1, n) / n for n in pieces]


def about(s: float, width: float) -> np.ndarray:
    """Places that leave a short piece about s, where a switch is expected, and others beside it, in case it is not."""
    normalised_times = s + width * np.array([-2.5, -0.5, 0.5, 2.5])
    return normalised_times[(normalised_times > 0.5 * width) & (normalised_times < 1 - 0.5 * width)]


def pieces_of(normalised_times: list[np.ndarray]) -> np.ndarray:
    """Into how many pieces each interval is cut."""
    return np.array([len(p) + 1 for p in normalised_times])


def any_cut(cuts: Cuts) -> bool:
    """Whether there is anything to cut."""
    return any(len(p) for normalised_times in cuts.values() for p in normalised_times)


def fitting(cuts: Cuts, urgency: Mapping[str, np.ndarray], most: int) -> Cuts | None:
    """The cuts or, where the mesh would have more than ``most`` intervals, those of the most urgent alone.

    The next mesh is no more than GROWTH times as fine then; None if hardly any would be cut. A mesh that stays as it is may have more.
    """
    more = np.concatenate([pieces_of(own) - 1 for own in cuts.values()])
    now = len(more)
    if not more.any() or now + more.sum() <= most:
        return cuts
    room, chosen = min(most, int(GROWTH * now)) - now, np.zeros(now, dtype=bool)
    first = np.argsort(-np.concatenate([urgency[name] for name in cuts]) * (more > 0), kind="stable")
    chosen[first] = (np.cumsum(more[first]) <= room) & (more[first] > 0)
    if room < LITTLE_ROOM * now or not chosen.any():
        return None
    kept = iter(chosen)
    return {name: [own if next(kept) else own[:0] for own in each] for name, each in cuts.items()}


def cut(solution: NlpSolution, phase: str, normalised_times: list[np.ndarray]) -> PhaseMesh:
    """Every interval of a phase cut at its normalised times (0 to 1); edges that are free at zeros are so no more."""
    trajectory, first = solution.phases[phase], np.concatenate([[0], np.cumsum(pieces_of(normalised_times))])
    t = trajectory.normalised_edges
    edges = [t[k] + (t[k + 1] - t[k]) * np.concatenate([[0.0], p]) for k, p in enumerate(normalised_times)]
    old = solution.transcription.mesh[phase]
    free = () if old.zeros else tuple(int(first[k]) for k in old.free)
    return PhaseMesh((*np.concatenate(edges).tolist(), 1.0), free)
