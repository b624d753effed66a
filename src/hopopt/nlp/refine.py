"""Mesh refinement: cut intervals whose error is too large; make ramps where the controls switch.

A switch inside an interval cannot be represented by its polynomial: cutting brackets it ever closer, but the
overshoot between the nodes stays. Once it is bracketed closely, the interval becomes a ramp: its controls are
linear between its ends, where the limits hold, so that nothing is gained by overshooting.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from hopopt.nlp.accuracy import IntervalErrors
from hopopt.nlp.ipopt import NlpSolution
from hopopt.nlp.mesh import PhaseMesh

PARTS = 4  # into how many pieces a flagged interval is cut
BRACKET = 1e-3  # of the phase: a flagged interval this short holds a switch
ROOM = 2  # short intervals on either side of a switch that become ramps too: it may move a little
FINEST = 1.5e-4  # of the phase: new ramps longer than this are cut at once (their excess goes with their length)


@dataclass(frozen=True)
class Refinement:
    """The next mesh; ``cut`` intervals were cut and ``ramps`` became ramps."""

    mesh: dict[str, PhaseMesh]
    cut: int
    ramps: int


def refine(solution: NlpSolution, errors: Mapping[str, IntervalErrors], tolerance: float, excess: float) -> Refinement:
    """The next mesh: intervals with a local error above ``tolerance`` or an excess above ``excess`` change."""
    meshes, cut, ramps = {}, 0, 0
    for name, e in errors.items():
        mesh = solution.transcription.mesh[name]
        lengths = solution.phases[name].lengths
        short = lengths < BRACKET * solution.phases[name].duration
        over = e.excess > excess
        near = np.convolve(over & short, np.ones(2 * ROOM + 1), mode="same") > 0.5
        switch = near & short & ~mesh.is_ramp
        flags = over | (e.local > tolerance) | (switch & (lengths > FINEST * solution.phases[name].duration))
        parts = np.where(flags, PARTS, 1)
        meshes[name] = _divide(solution, name, parts, mesh.is_ramp | switch)
        cut, ramps = cut + int((parts > 1).sum()), ramps + int(switch.sum())
    return Refinement(meshes, cut, ramps)


def _divide(solution: NlpSolution, phase: str, parts: np.ndarray, ramps: np.ndarray) -> PhaseMesh:
    """Every interval cut into its number of equal parts; the parts of a ramp are ramps."""
    mesh, trajectory = solution.transcription.mesh[phase], solution.phases[phase]
    t = trajectory.edges / trajectory.duration
    pieces = [t[k] + (t[k + 1] - t[k]) * np.arange(n) / n for k, n in enumerate(parts)]
    first = np.concatenate([[0], np.cumsum(parts)])
    ramps = np.repeat(ramps, parts)
    free = tuple(int(first[k]) for k in mesh.free)
    return PhaseMesh((*np.concatenate(pieces).tolist(), 1.0), free, tuple(int(k) for k in np.flatnonzero(ramps)))


def refine_everywhere(solution: NlpSolution) -> dict[str, PhaseMesh]:
    """Every interval cut in two, ramps kept."""
    return {
        name: _divide(solution, name, np.where(mesh.is_ramp, 1, 2), mesh.is_ramp)
        for name, mesh in solution.transcription.mesh.items()
    }
