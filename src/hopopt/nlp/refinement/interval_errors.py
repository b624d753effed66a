"""How good a transcribed solution is between its nodes, interval by interval."""

from dataclasses import dataclass

import numpy as np

from hopopt.nlp.schemes import radau
from hopopt.nlp.solver.ipopt import NlpSolution
from hopopt.ocp.problem import Component

NORMALISED_TIMES = np.linspace(
    0.0, 1.0, 49
)  # where in every interval limits are looked at: twice as close as verification does


@dataclass(frozen=True)
class IntervalErrors:
    """What is wrong in each of a phase's N intervals, relative to the scale of each quantity.

    local (N,): error of the states. below, above (N, limits): by how much the lower and upper limits are passed
    somewhere in the interval; ``limits`` names the path constraints' components, then the states, the controls.
    """

    local: np.ndarray
    below: np.ndarray
    above: np.ndarray
    limits: tuple[Component, ...]

    @property
    def excess(self) -> np.ndarray:
        """The largest of both over all limits, (N,)."""
        return np.maximum(self.below, self.above).max(axis=1)


def stage_values(solution: NlpSolution, phase: str, places: np.ndarray) -> tuple[np.ndarray, ...]:
    """States (N, k, nx), derivatives (N, k, nx) and path values (N, k, ng) at the same normalised times of every interval."""
    t, x, u = solution.phases[phase].everywhere(places)
    return x, *solution.right_hand_sides(phase, t, x, u)[:2]


def interval_errors(solution: NlpSolution, phase: str) -> IntervalErrors:
    """Local errors of one phase, and how far its limits are passed."""
    return IntervalErrors(_local_error(solution, phase), *_passed(solution, phase))


def _local_error(solution: NlpSolution, phase: str) -> np.ndarray:
    """The largest |x(t_k) - x_i0 - h_i sum_j A_kj f(x(t_j), u(t_j), t_j, p)| / scale over an interval, (N,).

    x, u: the solution's polynomials; x_i0: the state where interval i of length h_i begins; t_k, A: abscissae and
    integration matrix of a Radau scheme with two points more; over all its points and all states, each in its scale.
    After Patterson, Hager and Rao, A ph mesh refinement method for optimal control (2015), where the scheme has one
    point more and each state's error is divided by 1 + its largest value in the interval: a scale does not depend on
    the unit.
    """
    trajectory, layout = solution.phases[phase], solution.transcription.layouts[phase]
    fine = radau(len(trajectory.scheme.c) + 2)
    x, xdot, _ = stage_values(solution, phase, np.array(fine.c))
    integral = np.einsum("kj,ijx->ikx", fine.A, xdot)
    expected = trajectory.x_start[:, None, :] + trajectory.lengths[:, None, None] * integral
    scale = layout.phase.columns(layout.phase.states, "scale")
    return np.max(np.abs(x - expected) / scale, axis=(1, 2))


def _passed(solution: NlpSolution, phase: str) -> tuple[np.ndarray, np.ndarray, tuple[Component, ...]]:
    """How far the lower and the upper limits are passed in each interval, (N, limits) each, and their names."""
    layout = solution.transcription.layouts[phase]
    x, _, path = stage_values(solution, phase, NORMALISED_TIMES)
    u = solution.phases[phase].everywhere(NORMALISED_TIMES)[2]
    bounded = (*layout.phase.states, *layout.phase.controls)
    lower, upper, scale = (
        np.concatenate([layout.stage.path_column(side), layout.phase.columns(bounded, side)])
        for side in ("lower", "upper", "scale")
    )
    names = [label for labels in layout.stage.path_labels for label in labels]
    names += [name for variable in bounded for name in variable.components()]
    value = np.concatenate([path, x, u], axis=2)
    below, above = (np.maximum(over, 0.0).max(axis=1) / scale for over in (lower - value, value - upper))
    return below, above, tuple(names)
