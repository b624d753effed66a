"""Where a drive's torque jumps from one line of its operating region to another, exactly at an edge of the mesh."""

from collections.abc import Sequence

import numpy as np

from hopopt.leg.limit_id import Kind, kind_of
from hopopt.nlp.refinement.interval_errors import stage_values
from hopopt.nlp.solver.ipopt import NlpSolution

ON_LINE = 5e-3  # share of the line: what is left of it where it counts as used up (limits may be tightened a little)
LEAST_JUMP = 0.05  # share of the line: a smaller change is a kink, where lines meet
SIDES = np.array([0.0, 0.25, 0.5, 0.75, 1.0])  # places of the intervals beside an edge


def jumps(solution: NlpSolution, phase: str, times: Sequence[float]) -> tuple[float, ...]:
    """Those of the edges nearest to ``times`` [s] at which some drive's torque jumps: throughout the interval before on
    one line, throughout the one after on another."""
    p, path = solution.phases[phase], stage_values(solution, phase, SIDES)[2]
    edges = sorted({int(np.argmin(np.abs(p.edges[1:-1] - t))) + 1 for t in times})
    return tuple(float(p.edges[k]) for k in edges if any(_jumps(use, k) for use in _uses(solution, phase, path)))


def _uses(solution: NlpSolution, phase: str, path: np.ndarray) -> list[np.ndarray]:
    """Use of every line of each drive, both ways, (N, places, 2 lines) each: 1 on the line."""
    stage, found, at = solution.transcription.layouts[phase].stage, [], 0
    for constraint, size in zip(stage.phase.path, stage.path_sizes, strict=True):
        if kind_of(constraint.name) is Kind.REGION:
            own = path[:, :, at : at + size]
            found.append(np.concatenate([own, -own], axis=2))
        at += size
    return found


def _jumps(use: np.ndarray, k: int) -> bool:
    """Whether a drive's use (N, places, lines) of its lines jumps at edge k."""
    before, after = (np.flatnonzero(use[i].min(axis=0) > 1 - ON_LINE) for i in (k - 1, k))
    return any(use[k, 0, a] < 1 - LEAST_JUMP for a in before) and any(use[k - 1, -1, b] < 1 - LEAST_JUMP for b in after)
