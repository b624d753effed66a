"""Where the intervals of a mesh are cut."""

from collections.abc import Mapping

import numpy as np

from hopopt.nlp.ipopt import NlpSolution
from hopopt.nlp.mesh import PhaseMesh

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
