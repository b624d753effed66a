"""The figures that the paper states in its tables and results, each beside what hopopt's simulation gives."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hopopt.compare import PAPER, Comparison
from hopopt.leg.robot import BASE
from hopopt.sim.hop_figures import HopFigures

NEAR = 0.1  # relative: the paper's figures have two digits and come from a model it does not give in full
RANGE = (0.28, 0.40)  # [m] body heights over which the paper compares stiffness (fig. exp_sitff_clearance)
SATURATED = 0.95  # a ratio "close to 1"


@dataclass(frozen=True)
class PaperFigure:
    """One statement of the paper, what hopopt gets, and whether the two match."""

    statement: str
    paper: str
    hopopt: str
    matches: bool


def paper_figures(comparison: Comparison) -> list[PaperFigure]:
    """Every figure of the paper's results that can be computed; the comparison must hold force and position."""
    force, position = comparison.figures["force"], comparison.figures["position"]
    rows = []
    for name, f in (("force", force), ("position", position)):
        (simulated, measured), (c_simulated, c_measured) = PAPER[name]["foot_height_m"], PAPER[name]["knee_saturation"]
        knee = list(f.saturation_mean.values())[1]
        rows += [
            _number(f"{name} control, simulation: greatest foot height [m]", simulated, f.foot_height),
            _number(f"{name} control, experiment: greatest foot height [m]", measured, f.foot_height),
            _number(f"{name} control, simulation: C_avg of the knee in stance", c_simulated, knee),
            _number(f"{name} control, experiment: C_avg of the knee in stance", c_measured, knee),
        ]
    rows.append(
        _number("foot height of force over position, experiment", 1.58, force.foot_height / position.foot_height)
    )
    rows.append(
        _number("foot height of force over position, simulation", 0.44 / 0.32, force.foot_height / position.foot_height)
    )
    rows += [_stiffness(force, position), _early(position), _pegged(force), _energy(force)]
    return rows


def _number(statement: str, paper: float, found: float) -> PaperFigure:
    return PaperFigure(statement, f"{paper:.2f}", f"{found:.2f}", abs(found - paper) <= NEAR * abs(paper))


def _stiffness(force: HopFigures, position: HopFigures) -> PaperFigure:
    values = [mean_stiffness(f, *RANGE) for f in (force, position)]
    statement = f"mean actual stiffness, body {RANGE[0]:.2f} to {RANGE[1]:.2f} m: force above position [N/m]"
    return PaperFigure(statement, "larger", f"{values[0]:.0f} against {values[1]:.0f}", values[0] > values[1])


def stiffness(f: HopFigures, l0: float = 0.45) -> tuple[np.ndarray, np.ndarray]:
    """Body height over the foot [m] and secant stiffness of the two-mass model [N/m] at every sample of stance.

    k = (f_z - m_e g) / (l0 - y), with m_e the last link's mass: what the spring of the two-mass model would need.
    """
    trace, leg = f.trace, f.design.leg
    height = trace.q[f.stance, 1] - trace.points["foot"][f.stance, 1]
    own = leg.link[leg.links[-1]].mass * float(np.linalg.norm(trace.robot.model.gravity.linear))
    with np.errstate(divide="ignore"):
        return height, (trace.f[f.stance, 1] - own) / (l0 - height)


def mean_stiffness(f: HopFigures, low: float, high: float) -> float:
    """Mean of the actual stiffness [N/m] over body heights from low to high [m] on the way up."""
    height, k = stiffness(f)
    heights = np.linspace(low, high, 101)
    lowest = int(np.argmin(height))
    return float(np.mean(np.interp(heights, height[lowest:], k[lowest:])))


def _early(position: HopFigures) -> PaperFigure:
    ratio = position.saturation(1)
    t = position.trace.t[position.stance]
    first = t <= 0.5 * (t[0] + t[-1])
    mean = float(np.trapezoid(ratio[first], t[first]) / (t[first][-1] - t[first][0]))
    return PaperFigure(
        "position control: C of the knee in the first half of stance", "far less than 1", f"{mean:.2f} mean", mean < 0.8
    )


def _pegged(force: HopFigures) -> PaperFigure:
    t = force.trace.t[force.stance]
    share = float(np.trapezoid((force.saturation(1) > SATURATED).astype(float), t) / (t[-1] - t[0]))
    statement = "force control: the speed-torque curve coincides with the AOR, share of stance"
    return PaperFigure(statement, "all", f"{share:.2f}", share > 1 - NEAR)


def _energy(force: HopFigures) -> PaperFigure:
    """Eq. con_energy: m g (h_max - h_init) against the work of the joints, the knee's and the hip's."""
    trace, span = force.trace, force.stance
    w = trace.v[span, BASE:]
    work = float(np.trapezoid(np.sum(trace.tau[span] * w, axis=1), trace.t[span]))
    g = float(np.linalg.norm(trace.robot.model.gravity.linear))
    lifted = force.design.leg.body.mass * g * force.foot_height
    return PaperFigure(
        "eq. con_energy, force control: m g (h_max - h_init) = work of the joints [J]",
        "equal",
        f"{lifted:.1f} against {work:.1f}",
        abs(lifted - work) <= NEAR * work,
    )


def markdown(rows: Sequence[PaperFigure]) -> str:
    """The rows as a Markdown table."""
    lines = ["| the paper says | paper | hopopt | |", "|---|---|---|---|"]
    lines += [f"| {r.statement} | {r.paper} | {r.hopopt} | {'match' if r.matches else 'mismatch'} |" for r in rows]
    return "\n".join(lines)


def as_dicts(rows: Sequence[PaperFigure]) -> list[dict[str, Any]]:
    """For ``--json``."""
    return [{"statement": r.statement, "paper": r.paper, "hopopt": r.hopopt, "matches": r.matches} for r in rows]
