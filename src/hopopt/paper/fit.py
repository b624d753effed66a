"""The motor that the paper does not give, identified from the jump heights and saturations it does give.

Nonlinear least squares through the real simulator, with perfect encoders: figures of simulated hops against printed
ones, each in units of what its printed digits warrant. How well the values are determined is measured at the optimum
by central differences, wide enough to see that simulated heights jump where the leg swings once more in flight.
"""

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from joblib import Parallel, delayed
from scipy.optimize import least_squares
from scipy.stats import qmc

from hopopt.design import Design
from hopopt.paper.experiment import MOTOR, Experiment, Free, present
from hopopt.paper.result import EXPERIMENT, SIMULATION, CalibratedValue, Calibration, Figure, FigureComparison
from hopopt.paper.tracking_demand import point_masses, tracking_saturation
from hopopt.problem.render import rows

FIT_STEP = 0.01  # of the span between a value's bounds: step of the fit's differences
PROBE = 0.02  # of the span: step with which the optimum is examined
KNOWN = 1 / np.sqrt(12)  # of the span: standard error of a value of which only the bounds are known
OPTION_UNITS = {"k_p": "N m/rad", "k_d": "N m s/rad", "k_s": "N/m", "y_neu": "m", "C_amp": "m", "C_max": "1"}


def calibrate(
    design: Design,
    figures: Sequence[Figure] = SIMULATION,
    *,
    held_out: Sequence[Figure] = EXPERIMENT,
    free: Sequence[Free] = MOTOR,
    options: Mapping[str, Any] | None = None,
    scanned: int = 16,
    starts: int = 3,
    processes: int | None = None,
    progress: Callable[[str], None] | None = None,
) -> Calibration:
    """Identify the ``free`` values from printed figures; ``options`` are fixed settings of both strategies.

    Simulated are the problem's own values and ``scanned`` others between the bounds; the fit starts from the best
    ``starts`` of them. Raises UsageError for what cannot be freed.
    """
    say, tables = progress or (lambda line: None), design.model_dump(exclude_none=True)
    perfect = {**tables, "simulation": {**tables["simulation"], "encoder_bits": 0}}
    experiment = Experiment(perfect, tuple(free), tuple(figures), dict(options or {}))
    before = present(experiment)
    with Parallel(n_jobs=processes or os.cpu_count() or 1, backend="loky") as parallel:
        run: Any = parallel
        say("looking for starting points")
        places = [experiment.place(before), *qmc.Sobol(len(free), rng=0).random(scanned)]
        costs = [float(np.sum(r**2)) for r in run(delayed(experiment.residuals)(x) for x in places)]
        chosen = [places[k] for k in np.argsort(costs, kind="stable")[:starts]]
        say(f"fitting from the best {len(chosen)}")
        fits = sorted(run(delayed(_fit)(experiment, x) for x in chosen), key=lambda fit: fit.misfit)
        say("examining the best fit")
        here, slopes, jumps = _examine(experiment, fits[0].x, run)
        truth = replace(experiment, problem=tables, figures=tuple(held_out))
        unfitted = run([delayed(truth.simulated)(fits[0].x)])[0]
    simulations = len(experiment.strategies) * (len(places) + sum(fit.evaluations for fit in fits) + 2 * len(free) + 2)
    found = identify(slopes, jumps, fits[0].misfit)
    return Calibration(
        problem=design.name,
        parameters=tuple(_parameters(experiment, fits[0].x, before, found.errors, design)),
        compared=tuple(map(FigureComparison, figures, here.tolist(), (jumps * experiment.warrants).tolist())),
        held_out=tuple(map(FigureComparison, held_out, unfitted.tolist())),
        misfit=fits[0].misfit,
        freedom=len(figures) - len(free),
        condition=found.condition,
        correlation=tuple(map(tuple, found.correlation.tolist())),
        undetermined=tuple(_in_words(experiment, direction) for direction in found.open),
        starts=tuple((tuple(experiment.values(fit.x).tolist()), fit.misfit) for fit in fits),
        simulations=simulations,
        tracking=_tracking(experiment, fits[0].x),
    )


# ---- the fit and what is known around it -----------------------------------------------------------------------


@dataclass(frozen=True)
class FittedStart:
    """Where a start ended: x in [0, 1]^p, sum of squared residuals, evaluations of all figures."""

    x: np.ndarray
    misfit: float
    evaluations: int


def _fit(experiment: Experiment, x: np.ndarray) -> FittedStart:
    """Least squares from x in [0, 1]^p; shifted to [1, 2], so that steps relative to the values suit them."""
    p = len(x)
    found = least_squares(
        lambda y: experiment.residuals(y - 1), x + 1, bounds=(np.ones(p), np.full(p, 2.0)), diff_step=FIT_STEP,
        xtol=1e-3, ftol=1e-3, max_nfev=20,
    )  # fmt: skip
    return FittedStart(np.clip(found.x - 1, 0, 1), 2 * float(found.cost), int(found.nfev + p * (found.njev or 0)))


def _examine(experiment: Experiment, x: np.ndarray, run: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Figures here (k,), slopes (k, p) of the residuals per span of each value, and jumps (k,): how far residuals
    stray from a straight line within PROBE."""
    inside = np.clip(x, PROBE, 1 - PROBE)
    steps = PROBE * np.eye(len(x))
    places = [x, inside, *(inside + steps), *(inside - steps)]
    here, middle, *around = run(delayed(experiment.simulated)(place) for place in places)
    up, down = np.array(around).reshape(2, len(x), -1) / experiment.warrants
    jumps = np.abs(up + down - 2 * middle / experiment.warrants).max(axis=0) / 2
    return here, (up - down).T / (2 * PROBE), jumps


@dataclass(frozen=True)
class Determination:
    """Standard errors (p,) in spans (inf where undetermined), condition, correlation (p, p), open directions (p,)."""

    errors: np.ndarray
    condition: float
    correlation: np.ndarray
    open: list[np.ndarray]


def identify(slopes: np.ndarray, jumps: np.ndarray, misfit: float) -> Determination:
    """What figures say about values: from slopes (k, p) of the residuals, their jumps (k,) and sum of squares.

    A residual is worth its warrant (1) and its jump together. All errors are widened by sqrt(misfit / (k - p)) where
    that exceeds 1 (Birge). A direction is open if its error is no smaller than what the bounds alone leave, KNOWN.
    """
    k, p = slopes.shape
    widened = np.sqrt(max(1.0, misfit / (k - p))) if k > p else 1.0
    singular, directions = np.linalg.svd(slopes / np.hypot(1.0, jumps)[:, None])[1:]
    singular = np.maximum(np.append(singular, np.zeros(p - len(singular))), 1e-9)
    covariance = directions.T @ np.diag((widened / singular) ** 2) @ directions
    errors = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(errors, errors)
    unknown = [d for d, s in zip(directions, singular, strict=True) if widened / s >= KNOWN]
    return Determination(np.where(errors < KNOWN, errors, np.inf), singular[0] / singular[-1], correlation, unknown)


def _tracking(experiment: Experiment, x: np.ndarray) -> tuple[float, float]:
    """Mean saturation of the last joint with which y_des is kept to exactly: on the leg, on two point masses."""
    values = experiment.values(x)
    design, options = experiment.design(values), experiment.settings(values, "position")
    leg, masses = (tracking_saturation(d, options)[d.leg.joints[-1]] for d in (design, point_masses(design)))
    return leg, masses


def _parameters(
    experiment: Experiment, x: np.ndarray, before: Sequence[float], errors: np.ndarray, design: Design
) -> Iterator[CalibratedValue]:
    units = {row.path: row.unit for row in rows(design)} | OPTION_UNITS
    spans = [f.upper - f.lower for f in experiment.free]
    for f, was, value, error, span in zip(experiment.free, before, experiment.values(x), errors, spans, strict=True):
        unit = units.get(f.path if f.is_entry else f.path.split(".")[-1], "")
        error = float(error * span) if np.isfinite(error) else None
        yield CalibratedValue(f.path, unit, was, float(value), error, f.lower, f.upper)


def _in_words(experiment: Experiment, direction: np.ndarray) -> str:
    """A change of the values together, of a tenth of the bounds' span."""
    steps = 0.1 * (experiment.values(direction) - experiment.values(0 * direction))
    return ", ".join(
        f"{f.path} {step:+.2g}" for f, d, step in zip(experiment.free, direction, steps, strict=True) if abs(d) > 0.1
    )
