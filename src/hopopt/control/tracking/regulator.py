"""Linear-quadratic-Gaussian gains along a planned phase (Anderson and Moore, Optimal Control, chapters 3 and 8).

A Riccati recursion backwards over the control periods gives the feedback, one forwards the Kalman filter that makes joint
speeds from coarse encoders, both on the dynamics linearised along the plan. Costs and noise are stated per time, so that
feedback and filter of a fast controller are those of a slow one. Torques that disturb vary within a period too: taken as
held, they would leave a filter of very good encoders on the edge of stability (its poles go to the sampled plant's zeros, one
of which is -1; Astrom, Hagander and Sternby, Zeros of sampled systems, 1984).
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import expm

from hopopt.compiled.kernel import kernel
from hopopt.control.reference import PhaseReference
from hopopt.control.tracking.linearisation import Linearisation
from hopopt.leg.scales import Scale
from hopopt.sim.machine import Machine

GRID = 1e-3  # [s] on the paper's leg: between times where the dynamics are linearised; in between they change linearly


@dataclass(frozen=True)
class Noise:
    """Standard errors that the filter takes: angle [rad] of a reading; torque [N m] through every period; as the phase begins,
    of the speeds [rad/s], and of the torque [N m] over the period that led there."""

    angle: float
    torque: float
    speed: float
    jump: float


@dataclass(frozen=True)
class Gains:
    """Along one phase, for each control period: the error (q, v) moves by A and by held torque B, feedback K
    (periods, n, 2 n), filter L (periods, 2 n, n); x' P x is the cost of all that follows (periods + 1, 2 n, 2 n).

    Q (2 n, 2 n) and R (n, n): what errors and added torques of one control period cost.
    """

    A: np.ndarray
    B: np.ndarray
    K: np.ndarray
    L: np.ndarray
    P: np.ndarray
    Q: np.ndarray
    R: np.ndarray

    def at(self, period: int) -> tuple[np.ndarray, ...]:
        """A, B, K, L of a period; beyond the last, the last."""
        k = min(period, len(self.K) - 1)
        return self.A[k], self.B[k], self.K[k], self.L[k]

    def with_feedback(self, K: np.ndarray) -> "Gains":
        """The same with one feedback K (n, 2 n) for all periods."""
        return replace(self, K=np.broadcast_to(K, self.K.shape))

    def cost_to_go(self, period: int) -> np.ndarray:
        """P where a period begins; beyond the last, at the end of the phase."""
        return self.P[min(period, len(self.P) - 1)]


def regulator(
    machine: Machine, phase: PhaseReference, period: float, contact: bool, costs: tuple[np.ndarray, ...], noise: Noise
) -> Gains:
    """Feedback and filter gains along a phase. costs: Q and R of a period, Q at the end of the phase, as in ``Gains``."""
    A, B = linearised(machine, phase, period, contact)
    K, P = feedback(A, B, *costs)
    return Gains(A, B, K, kalman(A, B, period, noise), P, *costs[:2])


def feedback(
    A: np.ndarray, B: np.ndarray, Q: np.ndarray, R: np.ndarray, end: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """K and P of all periods, from the end backwards."""
    return _riccati(A, B, Q, R, end)


@kernel
def _riccati(
    A: np.ndarray, B: np.ndarray, Q: np.ndarray, R: np.ndarray, end: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    periods, size, n = B.shape
    K, P = np.empty((periods, n, size)), np.empty((periods + 1, size, size))
    P[periods] = end
    for k in range(periods - 1, -1, -1):
        after = P[k + 1]
        K[k] = np.linalg.solve(R + B[k].T @ after @ B[k], B[k].T @ after @ A[k])
        cost = Q + A[k].T @ after @ (A[k] - B[k] @ K[k])
        P[k] = 0.5 * (cost + cost.T)
    return K, P


def kalman(A: np.ndarray, B: np.ndarray, period: float, noise: Noise) -> np.ndarray:
    """L of all periods, from the beginning forwards."""
    n = B.shape[2]
    moved = B @ B.transpose(0, 2, 1)
    moved[:, :n, :n] += period**2 / 12 * moved[:, n:, n:]  # what torques do to angles that change within the period
    S = np.diag([noise.angle**2] * n + [noise.speed**2] * n) + noise.jump**2 * moved[0]
    return _filtered(A, moved, S, np.eye(n) * noise.angle**2, noise.torque**2)


@kernel
def _filtered(A: np.ndarray, moved: np.ndarray, S: np.ndarray, V: np.ndarray, torque: float) -> np.ndarray:
    n, (periods, size, _) = len(V), A.shape
    L = np.empty((periods, size, n))
    for k in range(periods):
        L[k] = np.linalg.solve(np.ascontiguousarray(S[:n, :n]) + V, S[:n]).T
        S = A[k] @ (S - L[k] @ S[:n]) @ A[k].T + torque * moved[k]
        S = 0.5 * (S + S.T)
    return L


def linearised(machine: Machine, phase: PhaseReference, period: float, contact: bool) -> tuple[np.ndarray, np.ndarray]:
    """A (periods, 2 n, 2 n), B (periods, 2 n, n) of joint errors over one period of held torque about the plan: x+ = A x + B u."""
    n, periods = machine.n, max(1, int(phase.duration / period))
    apart = max(1, int(GRID * Scale.of(machine.leg).time / period + 1e-6))
    known = np.unique(np.append(np.arange(0, periods, apart), periods - 1))
    slopes = Linearisation(machine).slopes(np.array([np.concatenate(phase.at(k * period)) for k in known]), contact)
    system = np.zeros((periods, 3 * n, 3 * n))
    system[:, :n, n : 2 * n] = period * np.eye(n)
    for row, column in np.ndindex(n, 3 * n):
        system[:, n + row, column] = period * np.interp(np.arange(periods), known, slopes[:, row, column])
    moved = expm(system)
    return moved[:, : 2 * n, : 2 * n].copy(), moved[:, : 2 * n, 2 * n :].copy()
