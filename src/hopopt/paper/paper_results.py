"""The figures that the paper states in its tables and results, each beside what hopopt's simulation gives."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hopopt.design import Leg
from hopopt.errors import UsageError
from hopopt.leg.robot import BASE
from hopopt.paper.stiffness import PAPER_RANGE, mean_stiffness
from hopopt.problem.load import load
from hopopt.sim.hop_metrics import HopFigures

PAPER = {  # the paper's printed figures: simulation, experiment
    "force": {"foot_height_m": (0.44, 0.38), "knee_saturation": (1.0, 1.0)},
    "position": {"foot_height_m": (0.32, 0.24), "knee_saturation": (0.5, 0.7)},
    "position_soft": {"foot_height_m": (0.32, 0.24), "knee_saturation": (0.5, 0.7)},
}
NEAR_PRINTED = 0.1  # relative: the paper's figures have two digits and come from a model it does not give in full
SATURATED = 0.95  # a ratio "close to 1"
MATCHES = {True: "match", False: "mismatch", None: "-"}


def is_the_papers(leg: Leg) -> bool:
    """Whether its guides, body, links and joint axes are given as the paper's are: the printed figures say nothing of other
    robots."""
    return _frame(leg) == _frame(load("paper").leg)


def _frame(leg: Leg) -> tuple[Any, ...]:
    return leg.guides, leg.links, leg.body, leg.link, [leg.joint[name].axis for name in leg.joints]


@dataclass(frozen=True)
class PaperFigure:
    """One statement of the paper, what hopopt gets, and whether the two match; None where they are not comparable."""

    statement: str
    paper: str
    hopopt: str
    matches: bool | None


def paper_results(force: HopFigures, position: HopFigures) -> list[PaperFigure]:
    """Every figure of the paper's results that can be computed, from a hop of each of its strategies.

    Raises UsageError if one of them never leaves the ground.
    """
    rows = []
    for name, f in (("force", force), ("position", position)):
        (simulated, measured), (c_simulated, c_measured) = PAPER[name]["foot_height_m"], PAPER[name]["knee_saturation"]
        if not f.flies:
            raise UsageError(f"{name} control never lifts the foot off this leg: the paper's figures are of hops")
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
    return rows if is_the_papers(force.design.leg) else [replace(row, matches=None) for row in rows]


def _number(statement: str, paper: float, found: float) -> PaperFigure:
    return PaperFigure(statement, f"{paper:.2f}", _shown(found), abs(found - paper) <= NEAR_PRINTED * abs(paper))


def _shown(value: float, digits: int = 2) -> str:
    """A figure in so many digits; a dash for one that this leg's hop does not have."""
    return f"{value:.{digits}f}" if np.isfinite(value) else "-"


def _stiffness(force: HopFigures, position: HopFigures) -> PaperFigure:
    values = [mean_stiffness(f, *PAPER_RANGE) for f in (force, position)]
    statement = (
        f"mean actual stiffness, body {PAPER_RANGE[0]:.2f} to {PAPER_RANGE[1]:.2f} m: force above position [N/m]"
    )
    return PaperFigure(statement, "larger", " against ".join(_shown(v, 0) for v in values), values[0] > values[1])


def _early(position: HopFigures) -> PaperFigure:
    ratio = position.saturation(1)
    t = position.trace.t[position.stance]
    first = t <= 0.5 * (t[0] + t[-1])
    mean = _mean(ratio[first], t[first])
    return PaperFigure(
        "position control: C of the knee in the first half of stance",
        "far less than 1",
        f"{_shown(mean)} mean",
        mean < 0.8,
    )


def _pegged(force: HopFigures) -> PaperFigure:
    t = force.trace.t[force.stance]
    share = _mean((force.saturation(1) > SATURATED).astype(float), t)
    statement = "force control: the speed-torque curve coincides with the AOR, share of stance"
    return PaperFigure(statement, "all", _shown(share), share > 1 - NEAR_PRINTED)


def _mean(values: np.ndarray, t: np.ndarray) -> float:
    """Mean over time; not a number where there is none, as of a leg that is off the ground at once."""
    return float(np.trapezoid(values, t) / (t[-1] - t[0])) if len(t) > 1 else float("nan")


def _energy(force: HopFigures) -> PaperFigure:
    """The paper's eq. 15: m g (h_max - h_init) against the work of the joints, the knee's and the hip's."""
    trace, span = force.trace, force.stance
    w = trace.v[span, BASE:]
    work = float(np.trapezoid(np.sum(trace.tau[span] * w, axis=1), trace.t[span]))
    g = float(np.linalg.norm(trace.robot.model.gravity.linear))
    lifted = force.design.leg.body.mass * g * force.foot_height
    return PaperFigure(
        "eq. 15, force control: m g (h_max - h_init) = work of the joints [J]",
        "equal",
        f"{lifted:.1f} against {work:.1f}",
        abs(lifted - work) <= NEAR_PRINTED * work,
    )


def markdown(columns: Mapping[str, Sequence[PaperFigure]]) -> str:
    """The same figures from several settings, by name, as a Markdown table."""
    lines = ["| the paper says | paper |" + "".join(f" {name} | |" for name in columns)]
    lines.append("|---|---|" + "---|---|" * len(columns))
    for row in zip(*columns.values(), strict=True):
        found = "".join(f" {r.hopopt} | {MATCHES[r.matches]} |" for r in row)
        lines.append(f"| {row[0].statement} | {row[0].paper} |{found}")
    return "\n".join(lines)
