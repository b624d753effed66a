"""Weighted least squares through the rows of logs, with the noise of the sensors estimated beside the parameters.

The rows are weighted by the covariance that the sensors' noise gives them. How large that noise is (one variance for each
encoder, torque and force signal, white) is estimated by restricted maximum likelihood (Patterson and Thompson, 1971). The
residuals need not be as the noise model says: they give a second covariance (HC3: MacKinnon and White, 1985). Degrees of
freedom of a parameter's variance are Satterthwaite's.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import linalg, optimize

from hopopt.errors import ResultError
from hopopt.robot_data.identification_rows import LogRows, Noise

FIT_ROUNDS = 12  # of weighted least squares at most
WEIGHED = 2  # rounds after which what the sensors' noise does to the rows is computed anew
SETTLED = 0.02  # of a standard error by which the last round still changes a parameter
LEAST_VARIANCE = 0.01  # of a sensor's variance as first guessed that the fit leaves at least
ENOUGH = 3  # rows for each parameter
FEWEST_FREE = 4.0  # degrees of freedom of a variance at least
MOST_LEVERAGE = 0.99  # of a row on its own residual that is corrected for
NOT_THIS_LEG = (
    "the logged torques do not move this leg as its angles say: are torque columns swapped, of the other sign, in another unit, "
    "or of the motor rather than the joint?"
)
TOO_LITTLE = "the logs hold too little motion to tell the parameters apart: log whole hops, landing included"


@dataclass(frozen=True)
class WeightedFit:
    """Where weighted least squares ended: parameters and lags theta [their units], their covariances from the noise model and
    from the residuals, variances of the sensors' noise, degrees of freedom of each variance of theta."""

    theta: np.ndarray
    covariance: np.ndarray
    from_residuals: np.ndarray
    variances: dict[str, float]
    freedom: np.ndarray

    @property
    def errors(self) -> np.ndarray:
        """Standard errors: the larger of both."""
        return np.sqrt(np.maximum(np.diag(self.covariance), np.diag(self.from_residuals)))


class Regression:
    """The rows of all logs as functions of the free parameters: x = fixed + columns theta; ``about`` are standard deviations of
    theta that are known beforehand, infinite for most: ramps are late by a period of the log or less."""

    def __init__(self, rows: Sequence[LogRows], fixed: np.ndarray, columns: np.ndarray, about: np.ndarray):
        self.rows, self.fixed, self.columns, self.about = rows, fixed, columns, about
        levels = [r.noise_levels() for r in rows]
        names = sorted({name for level in levels for name in level})
        self.guessed = {
            name: float(np.mean([level[name] ** 2 for level in levels if name in level])) + 1e-30 for name in names
        }
        self.variances = self.guessed

    def linear(self, theta: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
        """Residuals and their derivatives by theta, of every log."""
        blocks = [r.blocks(self.fixed + self.columns @ theta) for r in self.rows]
        return [(np.concatenate([b.e for b in log]), np.vstack([b.J for b in log]) @ self.columns) for log in blocks]

    def shares(self, theta: np.ndarray) -> list[dict[str, np.ndarray]]:
        """Covariance of the rows of every log for each sensor's noise of variance 1."""
        noise: list[Noise] = [r.noise(self.fixed + self.columns @ theta) for r in self.rows]
        return [{name: (B @ B.T).toarray() for name, B in log.items()} for log in noise]

    def fit(self, theta: np.ndarray) -> WeightedFit:
        """Weighted least squares from theta on, weights and variances made anew in every round. Raises ResultError where that
        comes to nothing."""
        if sum(r.count for r in self.rows) < ENOUGH * len(theta):
            raise ResultError(TOO_LITTLE)
        shares, number = self.shares(theta), 0
        while True:
            try:
                step, fit = self._round(theta, shares)
            except (linalg.LinAlgError, ValueError, RuntimeError):  # nothing tells them apart, or no number is finite
                raise ResultError(NOT_THIS_LEG if number else TOO_LITTLE) from None
            number, theta = number + 1, fit.theta
            settled = np.all(np.abs(step) < SETTLED * np.sqrt(np.diag(fit.covariance)))
            if number == FIT_ROUNDS or (number > WEIGHED + 1 and settled):
                return fit
            self.variances = fit.variances
            if number == WEIGHED:
                shares = self.shares(theta)

    def _round(self, theta: np.ndarray, shares: Sequence[Mapping[str, np.ndarray]]) -> tuple[np.ndarray, WeightedFit]:
        """A step of theta, and the fit there with the variances that the residuals show."""
        white, wide, factors = [], [], []
        for (e, J), log in zip(self.linear(theta), shares, strict=True):
            whole = sum(self.variances[name] * S for name, S in log.items())
            L = linalg.cholesky(whole + 1e-9 * np.diag(np.diag(whole)), lower=True)
            white.append(linalg.solve_triangular(L, e, lower=True))
            wide.append(linalg.solve_triangular(L, J, lower=True))
            factors.append(L)
        e = np.concatenate([*white, (theta / self.about)[np.isfinite(self.about)]])
        J = np.vstack([*wide, np.diag(1 / self.about)[np.isfinite(self.about)]])
        size = np.maximum(np.linalg.norm(J, axis=0), 1e-300)
        solved: Any = linalg.lstsq(J / size, -e)
        if solved[2] < J.shape[1]:  # the rank
            raise linalg.LinAlgError("parameters cannot be told apart")
        step = solved[0] / size
        Q, upper = np.linalg.qr(J / size)
        half = linalg.solve_triangular(upper, np.eye(len(step))) / size[:, None]
        covariance, left = half @ half.T, e + J @ step
        leverage = np.minimum(np.sum(Q**2, axis=1), MOST_LEVERAGE)
        influence = (Q * (left / (1 - leverage))[:, None]) @ half.T
        variances, freedom = self._variances(factors, shares, Q, left, half)
        fit = WeightedFit(theta + step, covariance, influence.T @ influence, variances, freedom)
        return step, fit

    def _variances(
        self,
        factors: Sequence[np.ndarray],
        shares: Sequence[Mapping[str, np.ndarray]],
        Q: np.ndarray,
        left: np.ndarray,
        half: np.ndarray,
    ) -> tuple[dict[str, float], np.ndarray]:
        """One step of restricted maximum likelihood: variances, none negative, whose covariance is nearest to the residuals';
        and Satterthwaite's degrees of freedom of each parameter's variance (half half^T is their covariance)."""
        names, at = list(self.variances), 0
        size = len(names)
        between, inside = np.zeros((size, size)), np.zeros((size, Q.shape[1], Q.shape[1]))
        crossed, shown = np.zeros((size, size)), np.zeros(size)
        for L, log in zip(factors, shares, strict=True):
            here = slice(at, at + len(L))
            q, r, parts = Q[here], left[here], []
            for name in names:
                S = self.variances[name] * log[name] if name in log else np.zeros_like(L)
                parts.append(linalg.solve_triangular(L, linalg.solve_triangular(L, S, lower=True).T, lower=True))
            images = [W @ q for W in parts]
            for a, W in enumerate(parts):
                shown[a] += r @ W @ r
                inside[a] += q.T @ images[a]
                for b in range(size):
                    between[a, b] += np.sum(W * parts[b])
                    crossed[a, b] += np.sum(images[a] * images[b])
            at += len(L)
        loops = np.einsum("aij,bji->ab", inside, inside)
        information = between - 2 * crossed + loops
        factor, _ = optimize.nnls(information, shown)
        least = np.array([LEAST_VARIANCE * self.guessed[name] / self.variances[name] for name in names])
        sure = factor > least
        slopes = np.einsum("ij,ajk,ik->ia", half, inside[sure], half)
        spread = np.sum(slopes * (slopes @ linalg.pinvh(information[np.ix_(sure, sure)])), axis=1)
        freedom = np.sum(half**2, axis=1) ** 2 / np.maximum(spread, 1e-300)
        found = {n: float(x) * self.variances[n] for n, x in zip(names, np.maximum(factor, least), strict=True)}
        return found, np.clip(freedom, FEWEST_FREE, len(left) - len(half))
