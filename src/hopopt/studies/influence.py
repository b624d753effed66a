"""What one entry of a problem changes in the height: by its derivative, and by solving again."""

from dataclasses import dataclass
from typing import Any

import numpy as np

AGREE = 0.01  # relative difference, beyond the noise, at which derivative and difference still agree
KINK = 0.1  # relative difference of the slopes to both sides, beyond the noise, that no smooth optimum has


@dataclass(frozen=True)
class Difference:
    """What solving again gave: (J+ - J-) / 2h, (J+ - J0) / h and (J0 - J-) / h [m per unit], h = step |value|, or
    step [the entry's unit] for an entry that is 0; if it may not be more or less, the slope from three points beside it.

    noise is what the mesh can make of each [m per unit]; fault says why there is none.
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
        return abs(self.forward - self.backward) > KINK * max(abs(self.forward), abs(self.backward)) + 2 * self.noise

    def agrees(self, slope: float) -> bool:
        """Whether a derivative [m per unit] is confirmed."""
        return not self.one_sided and bool(abs(self.central - slope) <= AGREE * abs(slope) + self.noise)

    def verdict(self, slope: float) -> str:
        """In words, what solving again says of a derivative [m per unit]."""
        if self.fault:
            return self.fault
        if self.one_sided:
            return f"one-sided: {self.forward:+.4g} upwards, {self.backward:+.4g} downwards"
        if abs(slope) <= self.noise and self.agrees(slope):
            return "agrees: no more than noise"
        share = abs(self.central - slope) / max(abs(slope), self.noise)
        return f"{'agrees within' if self.agrees(slope) else 'differs by'} {share:.1%}"


PERCENT = 0.01
CM = 100.0  # [cm/m]


@dataclass(frozen=True)
class Influence:
    """d height / d one entry of the problem [m per its unit], at its value; ``part_of`` names the entry of the whole
    leg that a single joint's drive takes its value from."""

    name: str
    value: float
    unit: str
    m_per_unit: float
    part_of: str | None = None
    difference: Difference | None = None

    @property
    def cm_per_percent(self) -> float:
        """What one per cent more of it gains [cm]; 0 for an entry that is 0."""
        return CM * PERCENT * self.value * self.m_per_unit or 0.0  # no -0

    @property
    def of_leg(self) -> bool:
        """Whether it is a number of the machine, not of what it is asked to do."""
        return self.name.startswith("leg.")

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        figures = {name: getattr(self, name) for name in ("name", "value", "unit", "cm_per_percent", "m_per_unit")}
        if self.part_of:
            figures["part_of"] = self.part_of
        if d := self.difference:
            figures |= {"finite_difference_m_per_unit": d.central, "step": d.step, "noise_m_per_unit": d.noise}
            figures |= {"forward_m_per_unit": d.forward, "backward_m_per_unit": d.backward}
            agrees = None if d.fault else d.agrees(self.m_per_unit)
            figures |= {"confirmed": agrees, "verdict": d.verdict(self.m_per_unit)}
        return figures
