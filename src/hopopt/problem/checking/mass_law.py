"""What torque weighs: power laws of mass against torque, fitted over the catalogue of motors and gears."""

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from hopopt.problem.catalogue import MARKS, catalogue, with_part
from hopopt.record import Strict, stated

PART_TORQUES = {
    "motor": ("max_torque", "torque_cap"),
    "gear": ("torque_cap",),
}  # the least of them is what the part gives


@dataclass(frozen=True)
class MassLaw(Strict):
    """mass [kg] = coefficient * (torque / N m)^exponent of the catalogue's parts, a least-squares line in logarithms.

    scatter: exp of the residuals' standard deviation; None, as the standard error, where two parts leave no residual
    """

    coefficient: float = stated("[kg]")
    exponent: float = stated("of the torque")
    scatter: float | None = stated("factor by which a part is typically off")
    exponent_error: float | None = stated("standard error")
    entries: int = stated("parts that were fitted")
    lowest: float = stated("their least torque [N m]")
    highest: float = stated("their largest torque [N m]")

    def mass(self, torque: float) -> float:
        """The fitted mass [kg] at a torque [N m]."""
        return self.coefficient * torque**self.exponent


def fit(torques: Sequence[float] | np.ndarray, masses: Sequence[float] | np.ndarray) -> MassLaw:
    """The power law through masses [kg] at torques [N m], (n,) each; ValueError for fewer than two different torques."""
    if np.unique(torques).size < 2:
        raise ValueError("a power law needs masses at two different torques at least")
    x, y = np.log(torques), np.log(masses)
    spread = float(np.sum((x - x.mean()) ** 2))
    exponent = float(np.sum((x - x.mean()) * (y - y.mean())) / spread)
    off = y - y.mean() - exponent * (x - x.mean())
    deviation = float(np.sqrt(np.sum(off**2) / (x.size - 2))) if x.size > 2 else None
    return MassLaw(
        coefficient=float(np.exp(y.mean() - exponent * x.mean())),
        exponent=exponent,
        scatter=None if deviation is None else float(np.exp(deviation)),
        exponent_error=None if deviation is None else deviation / spread**0.5,
        entries=x.size,
        lowest=float(np.min(torques)),
        highest=float(np.max(torques)),
    )


def weighed(part: str) -> dict[str, tuple[float, float]]:
    """{name: (torque [N m], mass [kg])} of the catalogue's motors or gears that have a mass and a limit for a short time.

    A motor's torque is what it gives, at standstill and with its drive's cap; a gear's is its cap, at the joint. Of the
    gears, which are of many kinds, only those count that no lighter one equals: another would not be chosen.
    """
    found = {}
    for name, entry in with_part(part, catalogue()).items():
        known = entry.parts[part]
        torques = [known[key] for key in PART_TORQUES[part] if key in known]
        if part in entry.masses and len(torques) == len(PART_TORQUES[part]):
            found[name] = min(torques), entry.masses[part]
    return found if part == "motor" else {name: pair for name, pair in found.items() if _light(pair, found.values())}


def _light(pair: tuple[float, float], others: Iterable[tuple[float, float]]) -> bool:
    """Whether no other part gives at least this torque at less mass, or more torque at this mass."""
    torque, mass = pair
    return not any((t >= torque and m < mass) or (t > torque and m <= mass) for t, m in others)


def mass_law(part: str) -> MassLaw:
    """The law of the catalogue's "motor" or "gear"."""
    pairs = weighed(part).values()
    return fit([torque for torque, _ in pairs], [mass for _, mass in pairs])


def as_json(part: str) -> dict[str, Any]:
    """The law, and what it was fitted to: {name: {"torque", "mass", "fitted", "source" of the mass}} (N m, kg, kg)."""
    law = mass_law(part)
    source = {name: MARKS[catalogue()[name].marks[part]["mass"]] for name in weighed(part)}
    pairs = {
        n: {"torque": t, "mass": m, "fitted": law.mass(t), "source": source[n]} for n, (t, m) in weighed(part).items()
    }
    return {**asdict(law), "unit_of_torque": "N m", "unit_of_mass": "kg", "fitted_to": pairs}
