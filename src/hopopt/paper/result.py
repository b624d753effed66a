"""What a calibration found: values with their errors, figures beside the paper's, in numbers and in plain lines."""

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from hopopt.sim.hop_metrics import HopFigures

RPM = np.pi / 30  # [rad/s]
MATCH = 2.0  # a figure is matched within so many times what its digits warrant
HEIGHT, SATURATION = "greatest foot height", "mean saturation of the knee in stance"


@dataclass(frozen=True)
class Figure:
    """A printed figure of a strategy: HEIGHT [m] or SATURATION [1]; ``warrant`` is what its digits are good for."""

    strategy: str
    quantity: str
    value: float
    warrant: float

    @property
    def unit(self) -> str:
        """SI unit, nothing for a ratio."""
        return " m" if self.quantity == HEIGHT else ""

    def of(self, hop: HopFigures) -> float:
        """The same quantity of a simulated hop."""
        return hop.foot_height if self.quantity == HEIGHT else hop.saturation_mean[hop.trace.robot.joints[-1]]


def paper_figures(force: tuple[float, float], position: tuple[float, float]) -> tuple[Figure, ...]:
    """Four figures from (foot height [m], mean saturation) of both strategies, with what the paper's digits warrant."""
    return tuple(
        Figure(strategy, quantity, value, warrant)
        for strategy, values in (("force", force), ("position", position))
        for quantity, value, warrant in zip((HEIGHT, SATURATION), values, (0.01, 0.05), strict=True)
    )


SIMULATION = paper_figures(force=(0.44, 1.0), position=(0.32, 0.5))  # section III
EXPERIMENT = paper_figures(force=(0.38, 1.0), position=(0.24, 0.7))  # section IV


@dataclass(frozen=True)
class CalibratedValue:
    """A calibrated value; standard_error is None where the figures tell no more about it than its bounds do."""

    path: str
    unit: str
    before: float
    value: float
    standard_error: float | None
    lower: float
    upper: float

    @property
    def at_bound(self) -> bool:
        """Whether the fit ran into a bound."""
        return min(self.value - self.lower, self.upper - self.value) <= 1e-3 * (self.upper - self.lower)

    @property
    def rounded(self) -> float:
        """The value to the second digit of its standard error, or to four digits where there is none."""
        first = np.floor(np.log10(self.standard_error or 1e-2 * abs(self.value) or 1.0))
        return round(self.value, 1 - int(first))


@dataclass(frozen=True)
class FigureComparison:
    """A printed figure beside the simulated one; ``jump`` is how far the latter strays from a straight line nearby."""

    figure: Figure
    simulated: float
    jump: float = 0.0

    @property
    def matched(self) -> bool:
        """Whether they agree within MATCH times the warrant."""
        return abs(self.simulated - self.figure.value) <= MATCH * self.figure.warrant


@dataclass(frozen=True)
class Calibration:
    """The identified values, how well they are determined, and every figure against the paper's.

    misfit is the sum of squared residuals in units of the warrants, ``freedom`` how many figures more than values there
    are; standard errors are widened by sqrt(misfit / freedom) where that exceeds 1. condition is that of the scaled
    Jacobian, correlation (p, p); ``undetermined`` says which changes together the figures leave open. starts holds the
    values and the misfit where each start ended, best first. tracking is the mean saturation of the knee that keeping
    to y_des exactly would take on this leg, and on the reference's own two masses.
    """

    problem: str
    parameters: tuple[CalibratedValue, ...]
    compared: tuple[FigureComparison, ...]
    held_out: tuple[FigureComparison, ...]
    misfit: float
    freedom: int
    condition: float
    correlation: tuple[tuple[float, ...], ...]
    undetermined: tuple[str, ...]
    starts: tuple[tuple[tuple[float, ...], float], ...]
    simulations: int
    tracking: tuple[float, float]

    @property
    def determined(self) -> bool:
        """Whether every value is known better than by its bounds, and no other answer fits as well."""
        return not self.rivals and not any(p.standard_error is None or p.at_bound for p in self.parameters)

    @property
    def rivals(self) -> list[tuple[float, ...]]:
        """Values that fit as well, within one standard error, and yet lie more than three from the best."""
        allowed = self.misfit + max(1.0, self.misfit / self.freedom if self.freedom > 0 else 1.0)
        return [v for v, misfit in self.starts[1:] if misfit <= allowed and self._far(v)]

    def _far(self, values: Sequence[float]) -> bool:
        errors = [(p.standard_error or p.upper - p.lower) for p in self.parameters]
        return any(abs(v - p.value) > 3 * e for v, p, e in zip(values, self.parameters, errors, strict=True))

    @property
    def matched(self) -> bool:
        """Whether every figure that was fitted is matched."""
        return all(c.matched for c in self.compared)

    def as_dict(self) -> dict[str, Any]:
        """Everything in numbers, for ``--json``."""
        data = {**asdict(self), "determined": self.determined, "matched": self.matched, "rivals": self.rivals}
        for p, entry in zip(self.parameters, data["parameters"], strict=True):
            entry["at_bound"] = p.at_bound
        for name in ("compared", "held_out"):
            for c, entry in zip(getattr(self, name), data[name], strict=True):
                entry["matched"] = c.matched
        data["starts"] = [{"values": list(values), "misfit": misfit} for values, misfit in self.starts]
        return data


def text(c: Calibration) -> str:
    """What the screen shows, in plain lines."""
    lines = [
        f"{c.problem}: {len(c.parameters)} values from {len(c.compared)} printed figures, {c.simulations} simulated hops"
    ]
    lines += [f"  {line}" for p in c.parameters for line in [_parameter(p)]]
    lines += ["figures fitted", *_comparisons(c.compared), *_reasons(c)]
    lines += ["how well determined", *(f"  {line}" for line in _quality(c))]
    return "\n".join([*lines, "held out: the paper's experiment", *_comparisons(c.held_out)])


def _parameter(p: CalibratedValue) -> str:
    error = "undetermined" if p.standard_error is None else f"standard error {p.standard_error:.2g}"
    speed = f" ({p.value / RPM:.0f} rpm)" if p.path.endswith("max_speed") else ""
    bound = f", AT ITS BOUND ({p.lower:.5g} to {p.upper:.5g})" if p.at_bound else ""
    return f"{p.path} = {p.rounded:.6g} {p.unit}{speed}, {error}{bound}; was {p.before:.6g}"


def _comparisons(comparisons: Sequence[FigureComparison]) -> Iterator[str]:
    for c in comparisons:
        f = c.figure
        verdict = (
            "matched" if c.matched else f"NOT matched ({(c.simulated - f.value) / f.warrant:+.1f} of {f.warrant:g})"
        )
        jump = f", jumps by {c.jump:.2g} nearby" if c.jump > f.warrant else ""
        yield f"  {f.strategy}: {f.quantity}: paper {f.value:g}{f.unit}, simulated {c.simulated:.3f}{f.unit}, {verdict}{jump}"


def _reasons(c: Calibration) -> Iterator[str]:
    leg, masses = c.tracking
    for missed in (x.figure for x in c.compared if not x.matched):
        if missed.strategy == "position" and missed.quantity == SATURATION:
            yield (
                f"  why: keeping to y_des exactly takes a mean saturation of {leg:.2f} on this leg, {masses:.2f} on the two "
                "point masses of the reference alone; the rest is the thigh's and the rotors' inertia"
            )


def _quality(c: Calibration) -> Iterator[str]:
    per = (
        f", {c.misfit / c.freedom:.1f} for each of {c.freedom} spare figures (1 is a good fit)" if c.freedom > 0 else ""
    )
    yield f"misfit {c.misfit:.1f}{per}"
    pairs = [
        f"{a.path} with {b.path} {c.correlation[i][j]:+.2f}"
        for j, b in enumerate(c.parameters)
        for i, a in enumerate(c.parameters[:j])
    ]
    yield f"condition {c.condition:.3g}; correlation {', '.join(pairs)}" if pairs else f"condition {c.condition:.3g}"
    yield from (f"UNDETERMINED: {words} changes no figure noticeably" for words in c.undetermined)
    yield from (f"ANOTHER ANSWER fits as well: {', '.join(f'{v:.5g}' for v in values)}" for values in c.rivals)
    ends = "; ".join(f"{', '.join(f'{v:.5g}' for v in values)} (misfit {misfit:.1f})" for values, misfit in c.starts)
    yield f"starts ended at {ends}"
