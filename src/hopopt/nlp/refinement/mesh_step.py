"""Where the intervals of a mesh are cut."""

from collections.abc import Mapping

import numpy as np

from hopopt.nlp.mesh import PhaseMesh
from hopopt.nlp.solver.ipopt import NlpSolution

GROWTH = 1.5  # times the intervals of a mesh: how fine the next may be where not all cuts fit
LITTLE = 0.1  # share of them: room for fewer is not worth a mesh
Parts = Mapping[str, np.ndarray]  # for each phase, into how many pieces each interval is to be cut
Cuts = Mapping[
    str, list[np.ndarray]
]  # for each phase, the normalised times (0 to 1) at which each interval is to be cut


def equal(pieces: np.ndarray) -> list[np.ndarray]:
    """Places that cut each interval into so many equal pieces."""
    return [np.arange(1, n) / n for n in pieces]


def about(s: float, width: float) -> np.ndarray:
    """Places that leave a short piece about s, in which a switch is expected, and others beside it, in case it is not."""
    normalised_times = s + width * np.array([-2.5, -0.5, 0.5, 2.5])
    return normalised_times[(normalised_times > 0.5 * width) & (normalised_times < 1 - 0.5 * width)]


def pieces_of(normalised_times: list[np.ndarray]) -> np.ndarray:
    """Into how many pieces each interval is cut."""
    return np.array([len(p) + 1 for p in normalised_times])


def fitting(pieces: Parts, urgency: Mapping[str, np.ndarray], most: int) -> Parts | None:
    """So many pieces or, where the mesh would have more than ``most`` intervals, those of the most urgent alone.

    The next mesh is no more than GROWTH times as fine then; None if hardly any would be cut.
    """
    if sum(int(p.sum()) for p in pieces.values()) <= most:
        return pieces
    now = sum(len(p) for p in pieces.values())
    room, order = min(most, int(GROWTH * now)) - now, list(pieces)
    more = np.concatenate([pieces[name] - 1 for name in order])
    first = np.argsort(-np.concatenate([urgency[name] for name in order]) * (more > 0), kind="stable")
    kept = np.zeros(now, dtype=int)
    kept[first] = np.where(np.cumsum(more[first]) <= room, more[first], 0)
    if room < LITTLE * now or not kept.any():
        return None
    ends = np.cumsum([len(pieces[name]) for name in order])[:-1]
    return {name: part + 1 for name, part in zip(order, np.split(kept, ends), strict=True)}


def only(cuts: Cuts, pieces: Parts) -> Cuts:
    """The cuts of the intervals that are to be in pieces."""
    return {name: [own[: n - 1] for own, n in zip(cuts[name], pieces[name], strict=True)] for name in cuts}


def any_cut(cuts: Cuts) -> bool:
    """Whether there is anything to cut."""
    return any(len(p) for normalised_times in cuts.values() for p in normalised_times)


def cut(solution: NlpSolution, phase: str, normalised_times: list[np.ndarray]) -> PhaseMesh:
    """Every interval of a phase cut at its normalised times (0 to 1)."""
    trajectory, first = solution.phases[phase], np.concatenate([[0], np.cumsum(pieces_of(normalised_times))])
    t = trajectory.edges / trajectory.duration
    edges = [t[k] + (t[k + 1] - t[k]) * np.concatenate([[0.0], p]) for k, p in enumerate(normalised_times)]
    free = tuple(int(first[k]) for k in solution.transcription.mesh[phase].free)
    return PhaseMesh((*np.concatenate(edges).tolist(), 1.0), free)
