"""What a calibration simulates and compares: strategies on a leg of which some values are free."""

from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import asdict, dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from pydantic import ValidationError

from hopopt.control.closed_loop import simulate
from hopopt.control.paper_options import PaperOptions
from hopopt.control.strategies import find
from hopopt.design import Design
from hopopt.errors import UsageError
from hopopt.paper.result import RPM, Figure
from hopopt.problem.render import values_of
from hopopt.sim.hop_metrics import HopFigures


@dataclass(frozen=True)
class Free:
    """What the fit may change, and between which bounds: an entry of the problem (leg.motor.max_torque), an option of
    both strategies (k_p), or an option of one (position.k_p)."""

    path: str
    lower: float
    upper: float

    @property
    def is_entry(self) -> bool:
        """Whether it is an entry of the problem rather than an option of a strategy."""
        return self.path.split(".")[0] in Design.model_fields

    def option_of(self, strategy: str) -> str | None:
        """The option of this strategy that it means, if it means one."""
        owner, _, option = self.path.rpartition(".")
        return None if self.is_entry or owner not in ("", strategy) else option


MOTOR = (Free("leg.motor.max_torque", 0.5, 5.0), Free("leg.motor.max_speed", 6000 * RPM, 16000 * RPM))


def parse_free(words: str) -> Free:
    """Free from "leg.motor.rotor_inertia=0:3e-5". Raises UsageError."""
    path, _, bounds = words.partition("=")
    try:
        lower, upper = (float(x) for x in bounds.split(":"))
    except ValueError:
        raise UsageError(f"{words}: write path=lower:upper, such as leg.motor.rotor_inertia=0:3e-5") from None
    return Free(path.strip(), lower, upper)


@dataclass(frozen=True)
class Experiment:
    """What is simulated and compared: a problem as nested tables, the free values, figures, fixed strategy options."""

    problem: dict[str, Any]
    free: tuple[Free, ...]
    figures: tuple[Figure, ...]
    options: Mapping[str, Any] = field(default_factory=dict)

    @property
    def strategies(self) -> list[str]:
        """Names of the strategies whose figures are compared."""
        return list(dict.fromkeys(f.strategy for f in self.figures))

    @property
    def warrants(self) -> np.ndarray:
        """(k,) in the figures' units."""
        return np.array([f.warrant for f in self.figures])

    def values(self, x: np.ndarray) -> np.ndarray:
        """Values (p,) at x in [0, 1]^p."""
        return np.array([f.lower + (f.upper - f.lower) * part for f, part in zip(self.free, x, strict=True)])

    def place(self, values: Sequence[float]) -> np.ndarray:
        """x in [0, 1]^p of values (p,), the nearest if they are out of bounds."""
        parts = [(v - f.lower) / (f.upper - f.lower) for f, v in zip(self.free, values, strict=True)]
        return np.clip(parts, 0.0, 1.0)

    def design(self, values: Sequence[float] | np.ndarray) -> Design:
        """The problem with values (p,). Raises pydantic's ValidationError where one is out of range."""
        tables = deepcopy(self.problem)
        for free, value in zip(self.free, values, strict=True):
            if free.is_entry:
                *way, key = free.path.split(".")
                table = tables
                for name in way:
                    table = table[name]
                table[key] = float(value)
        return Design.model_validate(tables)

    def settings(self, values: np.ndarray, strategy: str) -> dict[str, Any]:
        """Options of a strategy with values (p,)."""
        named = {f.option_of(strategy): float(v) for f, v in zip(self.free, values, strict=True)}
        return {**self.gains, **self.options, **{name: value for name, value in named.items() if name}}

    @cached_property
    def gains(self) -> dict[str, Any]:
        """Those of the problem as it is given: free masses and lengths are not to change them."""
        own = asdict(PaperOptions.of(Design.model_validate(self.problem), {}))
        return {name: value for name, value in own.items() if isinstance(value, float)}

    def hop(self, values: np.ndarray, strategy: str) -> HopFigures:
        """A strategy's hop with values (p,)."""
        return simulate(self.design(values), find(strategy), options=self.settings(values, strategy)).figures

    def simulated(self, x: np.ndarray) -> np.ndarray:
        """The figures (k,) at x in [0, 1]^p."""
        hops = {name: self.hop(self.values(x), name) for name in self.strategies}
        return np.array([f.of(hops[f.strategy]) for f in self.figures])

    def residuals(self, x: np.ndarray) -> np.ndarray:
        """Simulated less printed figures (k,) in units of their warrants, at x in [0, 1]^p."""
        return (self.simulated(x) - [f.value for f in self.figures]) / self.warrants


def present(experiment: Experiment) -> list[float]:
    """What the free values are now. Raises UsageError for what cannot be freed between its bounds."""
    entries = values_of(Design.model_validate(experiment.problem))
    known = entries | {
        f"{owner}{name}": value
        for owner in ("", *(f"{strategy}." for strategy in experiment.strategies))
        for name, value in (asdict(PaperOptions()) | experiment.gains | dict(experiment.options)).items()
    }
    for place, free in enumerate(experiment.free):
        if free.path in (other.path for other in experiment.free[:place]):
            raise UsageError(f"{free.path} is free already: leave it out")
        if not isinstance(known.get(free.path), int | float):
            raise UsageError(f"{free.path} is no number of the problem or of a strategy, so it cannot be freed")
        if not (free.lower < free.upper and np.isfinite([free.lower, free.upper]).all()):
            raise UsageError(
                f"{free.path}: the lower bound {free.lower:g} must be below the upper one, {free.upper:g}, both finite"
            )
    for end in (0.0, 1.0):
        try:
            experiment.design(experiment.values(np.full(len(experiment.free), end)))
        except ValidationError as error:
            where = "; ".join(".".join(map(str, fault["loc"])) + ": " + fault["msg"] for fault in error.errors())
            raise UsageError(f"a bound is out of range: {where}") from None
    return [float(known[free.path]) for free in experiment.free]
