"""How good a transcribed solution is between its nodes, interval by interval."""

from dataclasses import dataclass

import numpy as np

from hopopt.nlp.ipopt import NlpSolution
from hopopt.nlp.schemes import radau

PLACES = np.linspace(0.0, 1.0, 9)  # where in every interval the path constraints are looked at


@dataclass(frozen=True)
class IntervalErrors:
    """Per interval of a phase, both relative to the scale: local error of the states, excess over a limit (N,).

    ``worst`` names the limit that is exceeded most in each interval.
    """

    local: np.ndarray
    excess: np.ndarray
    worst: tuple[str, ...]


def stage_values(solution: NlpSolution, phase: str, places: np.ndarray) -> tuple[np.ndarray, ...]:
    """States (N, k, nx), derivatives (N, k, nx) and path values (N, k, ng) at the same places of every interval."""
    layout = solution.transcription.layouts[phase]
    t, x, u = solution.phases[phase].everywhere(places)
    values = [np.atleast_1d(solution.parameters[q.name]) for q in solution.transcription.problem.parameters]
    p = np.concatenate(values) if values else np.zeros(0)
    flat = [np.ascontiguousarray(table.reshape(t.size, -1).T) for table in (x, u, t)]
    xdot, path, _ = layout.stage.function.map(t.size)(*flat, p)
    return x, *(np.array(table).T.reshape(*t.shape, -1) for table in (xdot, path))


def interval_errors(solution: NlpSolution, phase: str) -> IntervalErrors:
    """Local errors and constraint excess of one phase."""
    names, excess = _excess(solution, phase)
    worst = tuple(names[k] for k in excess.argmax(axis=1))
    return IntervalErrors(_local_error(solution, phase), excess.max(axis=1), worst)


def _local_error(solution: NlpSolution, phase: str) -> np.ndarray:
    """States against the integral of the right-hand sides along them, on a finer Radau grid; scaled, (N,).

    Patterson, Hager and Rao, A ph mesh refinement method for optimal control (2015).
    """
    trajectory, layout = solution.phases[phase], solution.transcription.layouts[phase]
    fine = radau(len(trajectory.scheme.c) + 2)
    x, xdot, _ = stage_values(solution, phase, np.array(fine.c))
    integral = np.einsum("kj,ijx->ikx", fine.A, xdot)
    expected = trajectory.x_start[:, None, :] + trajectory.lengths[:, None, None] * integral
    scale = layout.phase.columns(layout.phase.states, "scale")
    return np.max(np.abs(x - expected) / scale, axis=(1, 2))


def _excess(solution: NlpSolution, phase: str) -> tuple[list[str], np.ndarray]:
    """By how much of its scale each limit is exceeded in each interval, (N, limits), and the limits' names."""
    layout = solution.transcription.layouts[phase]
    x, _, path = stage_values(solution, phase, PLACES)
    u = solution.phases[phase].everywhere(PLACES)[2]
    names = [label for labels in layout.stage.path_labels for label in labels]
    sizes, constraints = layout.stage.path_sizes, layout.phase.path
    lower, upper, scale = (
        np.concatenate([np.broadcast_to(np.asarray(getattr(c, side), float), (n,)) for c, n in zip(constraints, sizes, strict=True)])
        if constraints else np.zeros(0)
        for side in ("lower", "upper", "scale")
    )  # fmt: skip
    bounded = (*layout.phase.states, *layout.phase.controls)
    names += [name for variable in bounded for name in variable.component_names()]
    value = np.concatenate([path, x, u], axis=2)
    lower = np.concatenate([lower, layout.phase.columns(bounded, "lower")])
    upper = np.concatenate([upper, layout.phase.columns(bounded, "upper")])
    scale = np.concatenate([scale, layout.phase.columns(bounded, "scale")])
    over = np.maximum(np.maximum(value - upper, lower - value), 0.0) / scale
    return names, over.max(axis=1)
