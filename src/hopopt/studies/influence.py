"""What one entry of a problem changes in the objective: by its derivative, and by solving again."""

from dataclasses import dataclass
from typing import Any

import numpy as np

SLOPES_AGREE = 0.01  # relative difference, beyond the noise, at which derivative and difference still agree
LEAST_KINK = 0.1  # relative difference of the slopes to both sides, beyond the noise, that no smooth optimum has


@dataclass(frozen=True)
class Difference:
    """What solving again gave: (J+ - J-) / 2h, (J+ - J0) / h and (J0 - J-) / h [objective's unit per its unit], h = step |value|, or
    step [the entry's unit] for an entry that is 0; if it may not be more or less, the slope from three points beside it.

    noise is what the mesh can make of each; fault says why there is none.
    """

    step: float = 0.0
    central: float = np.nan
    forward: float = np.nan
    backward: float = np.nan
    noise: float = 0.0
    fault: str = ""

    @property
    def one_sided(self) -> bool:
        """Whether more and less of the entry tell different slopes: it is where the active limits change."""
        return (
            abs(self.forward - self.backward) > LEAST_KINK * max(abs(self.forward), abs(self.backward)) + 2 * self.noise
        )

    def agrees(self, slope: float, less: float | None = None) -> bool:
        """Whether a derivative is confirmed; ``less``: the one towards less, where it is another."""
        if less is not None:
            pairs = (self.forward, slope), (self.backward, less)
            known = [(found, told) for found, told in pairs if np.isfinite(found)]  # an entry at its end has one side
            return bool(known) and all(
                abs(found - told) <= SLOPES_AGREE * abs(told) + 2 * self.noise for found, told in known
            )
        return not self.one_sided and bool(abs(self.central - slope) <= SLOPES_AGREE * abs(slope) + self.noise)

    def verdict(self, slope: float, less: float | None = None) -> str:
        """In words, what solving again says of a derivative, and of the one towards less."""
        if self.fault:
            return self.fault
        if less is not None:
            both = (self.forward, "upwards"), (self.backward, "downwards")
            sides = ", ".join(f"{x:+.4g} {way}" if np.isfinite(x) else f"none {way}" for x, way in both)
            return f"{'agrees' if self.agrees(slope, less) else 'differs'}: {sides}"
        if self.one_sided:
            return f"one-sided: {self.forward:+.4g} upwards, {self.backward:+.4g} downwards"
        if abs(slope) <= self.noise and self.agrees(slope):
            return "agrees: no more than noise"
        share = abs(self.central - slope) / max(abs(slope), self.noise)
        return f"{'agrees within' if self.agrees(slope) else 'differs by'} {share:.1%}"


PERCENT = 0.01
JSON = (
    "name",
    "value",
    "unit",
    "objective_unit",
    "per_percent",
    "per_unit",
    "error_per_unit",
)  # what every entry has there


@dataclass(frozen=True)
class Influence:
    """What one entry of the problem changes in the objective, to first order.

    name: the entry of the problem
    value: the entry's [its unit]
    unit: the entry's
    per_unit: d objective / d entry [objective_unit per its unit]; at a kink, towards more of it
    part_of: the entry of the whole leg that a single joint's drive takes its value from
    difference: what solving again gave
    less_per_unit: at a kink, d objective / d entry towards less of it [objective_unit per its unit]
    between: the limits that trade places there, in words
    error_per_unit: what its mesh makes of the derivative, estimated [objective_unit per its unit]; None of an entry that is 0
    objective_unit: of what is derived
    maximize: whether more of that is better
    """

    name: str
    value: float
    unit: str
    per_unit: float
    part_of: str | None = None
    difference: Difference | None = None
    less_per_unit: float | None = None
    between: tuple[str, ...] = ()
    error_per_unit: float | None = None
    objective_unit: str = "m"
    maximize: bool = True

    @property
    def per_percent(self) -> float:
        """What one per cent more of it changes [objective_unit]; 0 for an entry that is 0."""
        return PERCENT * self.value * self.per_unit or 0.0  # no -0

    @property
    def per_percent_less(self) -> float:
        """What one per cent less of it changes [objective_unit]."""
        slope = self.per_unit if self.less_per_unit is None else self.less_per_unit
        return -PERCENT * self.value * slope or 0.0

    @property
    def kinked(self) -> bool:
        """Whether limits trade places, so that more and less of it differ."""
        return self.less_per_unit is not None

    @property
    def best(self) -> float:
        """What one per cent gains the better way [objective_unit]; below 0 at a kink from which both ways lose."""
        sign = 1.0 if self.maximize else -1.0
        return max(sign * self.per_percent, sign * self.per_percent_less)

    @property
    def most(self) -> float:
        """The larger change of the objective with one per cent either way [objective_unit]."""
        return max(abs(self.per_percent), abs(self.per_percent_less))

    @property
    def of_leg(self) -> bool:
        """Whether it is a number of the machine, not of what it is asked to do."""
        return self.name.startswith("leg.")

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        figures = {name: getattr(self, name) for name in JSON}
        if self.part_of:
            figures["part_of"] = self.part_of
        if self.kinked:
            figures |= {"less_per_unit": self.less_per_unit, "per_percent_less": self.per_percent_less}
            figures |= {"between_limits": list(self.between)}
        if d := self.difference:
            figures |= {"finite_difference_per_unit": d.central, "step": d.step, "noise_per_unit": d.noise}
            figures |= {"forward_per_unit": d.forward, "backward_per_unit": d.backward}
            sides = self.per_unit, self.less_per_unit
            agrees = None if d.fault else d.agrees(*sides)
            figures |= {"confirmed": agrees, "verdict": d.verdict(*sides)}
        return figures
