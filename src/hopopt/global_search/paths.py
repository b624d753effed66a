"""Stances that begin exactly at the start: a forward search over extreme motions, guided by the value on the grid.

Of many states only the best in each cell are kept. A greedy choice by value would always follow one family of hops.
So states are told apart by what the stance did so far, and each kind keeps its own best.
"""

from dataclasses import dataclass

import numpy as np

from hopopt.compiled.kernel import kernel, packed
from hopopt.global_search.constants import StanceConstants, to_joint_angles
from hopopt.global_search.equations.dynamics import apex_height
from hopopt.global_search.equations.flight import Flight, highest
from hopopt.global_search.grid import interpolate, joint_heights, place
from hopopt.global_search.motions import KEEPS, between, extreme_motions, last_kept, workspace
from hopopt.global_search.result import Rollout, different
from hopopt.global_search.value import ValueFunction
from hopopt.nlp.deadline import Deadline

STANCE_STEPS = 48  # of the longest stance
BEAM_WIDTH = (
    4000  # states of each kind that are followed: with 1500 the long stance was lost on the paper's leg at friction 1.2
)
SEARCH_CELLS = 2.0  # cells of the search in one of the grid, along each axis
SUCCESSORS = 16  # room for those of one state
GROUNDED, DIPPING, SWAYING = 0.02, 0.03, 0.05  # share of the reach: knee's height, dip, sway that tell stances apart
THIRDS = 3  # of the longest stance, for each of which every kind has a best


@dataclass(frozen=True)
class _Front:
    """States after a step of the search.

    states: (k, 4) [rad, rad/s]
    parent: index in the front before (k,)
    acceleration: of the links in the step that led here (k, 2) [rad/s^2]
    apex: height the centre of mass reaches from here [m] (k,)
    lowest, sway: body's least height so far and its place over the foot then [m] (k,)
    knee: the knee's least height so far [m] (k,)
    """

    states: np.ndarray
    parent: np.ndarray
    acceleration: np.ndarray
    apex: np.ndarray
    lowest: np.ndarray
    sway: np.ndarray
    knee: np.ndarray

    def kept(self, index: np.ndarray) -> "_Front":
        return _Front(*(getattr(self, name)[index] for name in self.__dataclass_fields__))


@kernel
def _successors(c, w, grid, dt, states, ends, parents):
    """Ends of all motions from ``states``; returns how many."""
    total = 0
    for k in range(states.shape[0]):
        phi1, phi2, r1, r2 = states[k]
        count = extreme_motions(c, w, phi1, phi2, r1, r2, dt, 1)
        for i in range(count):
            if w.kind[i] == KEEPS:
                ends[total], parents[total] = w.end[i], k
                total += 1
            j = i + 1 if i + 1 < count else 0
            if (w.kind[i] == KEEPS) != (w.kind[j] == KEEPS):
                first, other = (i, j) if w.kind[i] == KEEPS else (j, i)
                share = last_kept(c, w, grid, first, other, phi1, phi2, r1, r2, dt)
                ends[total, 0], ends[total, 1], ends[total, 2], ends[total, 3] = between(w, first, other, share)
                parents[total] = k
                total += share > 0
    return total


@kernel
def _scores(c, grid, values, bends, states, apex, value, cells):
    """Apex heights [m], values [m] and cells of states."""
    for k in range(states.shape[0]):
        phi1, phi2, r1, r2 = states[k]
        apex[k] = apex_height(c, phi1, phi2, r1, r2)
        value[k] = interpolate(grid, values, bends, phi1, phi2, r1, r2)
        cells[k, 0], cells[k, 1], cells[k, 2], cells[k, 3] = place(grid, phi1, phi2, r1, r2)


class ForwardSearch:
    """The forward search from one start, step by step; ``fronts`` holds the states after each. TimeoutError if it has
    not ended by ``until``."""

    def __init__(
        self,
        c: StanceConstants,
        value: ValueFunction,
        start: np.ndarray,
        duration: tuple[float, float],
        until: Deadline,
    ):
        self.c, self.value, self.start, self.duration = c, value, start, duration
        self.reach = abs(complex(c.thigh_x, c.thigh_z)) + abs(complex(c.shank_x, c.shank_z))
        self.dt, self.packed, self.workspace = duration[1] / STANCE_STEPS, packed(c), workspace()
        self.grid = packed(value.grid)
        knee, hip = joint_heights(c, start[0], start[1])
        self.height, one = float(hip), np.zeros(1)
        first = _Front(start[None], one.astype(int), np.zeros((1, 2)), one, one + hip, one + self._x(start), one + knee)
        self.fronts = [first]
        for k in range(1, STANCE_STEPS + 1):
            if until.passed:
                raise TimeoutError
            front = self._next(self.fronts[-1], k)
            if not len(front.states):
                break
            self.fronts.append(front)

    def _next(self, front: _Front, k: int) -> _Front:
        """The states kept after step k."""
        ends = np.empty((len(front.states) * SUCCESSORS, 4))
        parent = np.empty(len(ends), dtype=np.int64)
        count = _successors(self.packed, self.workspace, self.grid, self.dt, front.states, ends, parent)
        ends, parent = ends[:count], parent[:count]
        left = round((self.duration[1] - k * self.dt) / self.value.step)
        apex, value, cells = np.empty(count), np.empty(count), np.empty((count, 4))
        none = np.zeros((0, 4), dtype=np.float32)
        _scores(self.packed, self.grid, self.value.layers[left], none, ends, apex, value, cells)
        score = np.maximum(value, apex) if k * self.dt >= self.duration[0] else value
        knee, hip = joint_heights(self.c, ends[:, 0], ends[:, 1])
        lower = hip < front.lowest[parent]
        new = _Front(
            ends, parent, (ends[:, 2:] - front.states[parent, 2:]) / self.dt, apex,
            np.where(lower, hip, front.lowest[parent]), np.where(lower, self._x(ends), front.sway[parent]),
            np.minimum(knee, front.knee[parent]),
        )  # fmt: skip
        return new.kept(_best_of_each(score, self.kinds(new), np.floor(cells * SEARCH_CELLS).astype(np.int64)))

    def _x(self, states: np.ndarray) -> np.ndarray:
        """The body's place over the foot [m]."""
        c, (phi1, phi2) = self.c, (states[..., 0], states[..., 1])
        thigh = c.thigh_x * np.cos(phi1) - c.thigh_z * np.sin(phi1)
        return -thigh - (c.shank_x * np.cos(phi2) - c.shank_z * np.sin(phi2))

    def kinds(self, front: _Front) -> np.ndarray:
        """A number for what each stance did so far: knee down to the ground, dip, sway in the dip."""
        dips = front.lowest < self.height - DIPPING * self.reach
        sways = np.where(dips, np.sign(front.sway) * (np.abs(front.sway) > SWAYING * self.reach), 0).astype(int)
        return (front.knee < GROUNDED * self.reach) * 6 + dips * 3 + sways + 1

    def rollouts(self, flight: Flight, count: int) -> tuple[Rollout, ...]:
        """The best stance of each kind and third of the duration, best first, without those that are alike."""
        best: dict[tuple[int, int], tuple[float, int, int]] = {}
        for k, front in enumerate(self.fronts[1:], start=1):
            if k * self.dt < self.duration[0] - 1e-9:
                continue
            kinds = self.kinds(front)
            for kind in np.unique(kinds):
                mine, key = np.flatnonzero(kinds == kind), (int(kind), (k - 1) * THIRDS // STANCE_STEPS)
                known = best[key][0] if key in best else -np.inf
                clearance, index = highest(self.c, flight, front.states[mine], front.apex[mine], known)
                if clearance > known:
                    best[key] = clearance, k, int(mine[index])
        ranked = sorted(best.values(), reverse=True)
        return tuple(different([self._rollout(k, index, clearance) for clearance, k, index in ranked])[:count])

    def _rollout(self, k: int, index: int, clearance: float) -> Rollout:
        states, accelerations = [], []
        for front in self.fronts[k:0:-1]:
            states.append(front.states[index])
            accelerations.append(front.acceleration[index])
            index = front.parent[index]
        x, a = np.array([*states, self.start])[::-1], np.array([accelerations[0], *accelerations])[::-1]
        q, v, joint_a = (to_joint_angles(self.c, part) for part in (x[:, :2], x[:, 2:], a))
        return Rollout(np.arange(k + 1) * self.dt, q, v, joint_a, clearance)


def _best_of_each(score: np.ndarray, kinds: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Indices of the states to be followed: the best in each cell, and of each kind the BEAM_WIDTH best."""
    order = np.argsort(-score)
    order = order[np.argsort(kinds[order].astype(np.int8), kind="stable")]  # few kinds: counted, not compared
    order = order[score[order] > 0]
    key = kinds[order]
    for column in cells[order].T:
        key = key * 4096 + column
    _, first = np.unique(key, return_index=True)
    order = order[np.sort(first)]
    begins = np.searchsorted(kinds[order], kinds[order])
    return order[np.arange(len(order)) - begins < BEAM_WIDTH]
