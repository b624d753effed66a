"""The actual stiffness of a hop: that of the two-mass model's spring which would push as the leg does."""

import numpy as np

from hopopt.control.paper_options import PaperOptions
from hopopt.control.similarity import Size, factors
from hopopt.design import Design
from hopopt.leg.scales import weight
from hopopt.sim.hop_metrics import HopFigures

HEIGHT_MARGIN = 0.03  # [m] on the paper's leg, below the neutral height, where the secant stiffness diverges
PAPER_RANGE = (0.28, 0.40)  # [m] heights of the body over which the paper compares it (fig. exp_sitff_clearance)


def neutral(design: Design) -> float:
    """y_neu [m] of the paper's strategies on this leg."""
    return PaperOptions.of(design, {}).y_neu


def secant_stiffness(run: HopFigures) -> tuple[np.ndarray, np.ndarray]:
    """k = (f_z - m_e g) / (y_neu - y): height y [m] of the body over the foot and stiffness k [N/m] at every sample of
    stance, (k,) each.

    Not a number where y is near or above the neutral height. Neither where the foot is about to be let go: f_z < 0 by
    more than a percent of the weight.
    """
    trace, leg, span = run.trace, run.design.leg, run.stance
    y = trace.q[span, 1] - trace.points["foot"][span, 1]
    foot = leg.link[leg.links[-1]].mass * float(np.linalg.norm(trace.robot.model.gravity.linear))
    y_neu, margin = neutral(run.design), HEIGHT_MARGIN * factors(Size.of(run.design))["C_amp"]
    valid = (y <= y_neu - margin) & (trace.f[span, 1] >= -0.01 * weight(trace.robot.model))
    return y, np.where(valid, trace.f[span, 1] - foot, np.nan) / np.where(valid, y_neu - y, 1.0)


def mean_stiffness(run: HopFigures, low: float, high: float) -> float:
    """Mean of the actual stiffness [N/m] over body heights from low to high [m], on the way up; not a number where
    there is none, as of a leg that does not push there."""
    y, k = secant_stiffness(run)
    lowest = int(np.argmin(y))
    known = np.isfinite(k[lowest:])
    y, k = y[lowest:][known], k[lowest:][known]
    if not ((low <= y) & (y <= high)).any():
        return float("nan")
    return float(np.mean(np.interp(np.linspace(low, high, 101), y, k)))
