"""A motor's heat: winding and housing as two bodies, and what a hop that is done over and over makes of them.

With the rises T_w and T_h above the ambient temperature, and R_w what the copper has at the winding's temperature,

    C_w T_w' = R_w i^2 - (T_w - T_h) / R_wh,    C_h T_h' = (T_w - T_h) / R_wh - T_h / R_ha,    C = time constant / resistance

A hop's torques make that a linear equation in both, so a whole hop is one affine function of the rises with which it begins.
Rates are of numbers, arrays or CasADi symbols.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from scipy.linalg import expm

from hopopt.design import Leg

COPPER, REFERENCE = 3.9e-3, 25.0  # [1/K] of the resistance that is stated, and the temperature [degC] at which it is
BODIES = ("winding_to_housing", "housing_to_ambient", "winding_time_constant", "housing_time_constant")
LIMIT = "winding_limit"
MOST_HOPS = 1_000_000  # that are counted: what lasts as long lasts


@dataclass(frozen=True)
class TwoBodies:
    """The thermal entries of a motor.

    winding_to_housing, housing_to_ambient: thermal resistances R_wh, R_ha [K/W]
    winding_time_constant, housing_time_constant: R_wh C_w, R_ha C_h [s]
    ambient: [degC]
    copper: by which share of the stated resistance that of the winding grows [1/K]
    """

    winding_to_housing: Any
    housing_to_ambient: Any
    winding_time_constant: Any
    housing_time_constant: Any
    ambient: Any
    copper: float = COPPER

    @classmethod
    def of(cls, leg: Leg, joint: str, p: Mapping[str, Any], ambient: float) -> Self | None:
        """Those of a joint's motor, from parameter values or symbols by their paths; None where the problem has none."""
        found: dict[str, Any] = {name: p.get(leg.drive(joint, "motor", name)[0]) for name in BODIES}
        return None if any(x is None for x in found.values()) else cls(**found, ambient=ambient)

    def rates(self, winding: Any, housing: Any, heat: Any) -> tuple[Any, Any]:
        """Of the rises of winding and housing [K] above ambient [K/s]; heat [W]: of the winding at the resistance stated."""
        warm = 1 + self.copper * (self.ambient + winding - REFERENCE)
        passed = (winding - housing) / self.winding_to_housing
        of_winding = (heat * warm - passed) * self.winding_to_housing / self.winding_time_constant
        of_housing = (passed - housing / self.housing_to_ambient) * self.housing_to_ambient / self.housing_time_constant
        return of_winding, of_housing

    def cooling(self, duration: float) -> np.ndarray:
        """What a time [s] without current leaves of the rises, (2, 2)."""
        columns = self.rates(1.0, 0.0, 0.0), self.rates(0.0, 1.0, 0.0)
        return expm(duration * np.array(columns, dtype=float).T)


@dataclass(frozen=True)
class Cycle:
    """A hop, and the pause after it: the rises of winding and housing (2) [K] at its end are ``kept`` (2, 2) times those with
    which it begins, and ``gained`` (2); ``cooled`` (2, 2) times these are left when the next begins."""

    kept: np.ndarray
    gained: np.ndarray
    cooled: np.ndarray

    def after(self, hops: int) -> np.ndarray:
        """Rises (2) [K] at the end of so many hops, the first from cold."""
        whole = np.zeros((3, 3))
        whole[:2] = np.hstack([self.kept @ self.cooled, self.gained[:, None]])
        whole[2, 2] = 1.0
        return (np.linalg.matrix_power(whole, hops) @ np.array([0.0, 0.0, 1.0]))[:2]

    @property
    def steady(self) -> np.ndarray | None:
        """Rises (2) [K] at the end of every hop when they no longer change; None where they grow without end."""
        turn = self.kept @ self.cooled
        if np.abs(np.linalg.eigvals(turn)).max() >= 1.0:
            return None
        return np.linalg.solve(np.eye(2) - turn, self.gained)

    def hops_within(self, most: float) -> int | None:
        """How many hops from cold end with the winding no more than ``most`` [K] above ambient; None for as many as one likes."""
        low, high = 0, 1
        while self.after(high)[0] <= most:
            low, high = high, 2 * high
            if low >= MOST_HOPS:
                return None
        while high - low > 1:
            middle = (low + high) // 2
            low, high = (middle, high) if self.after(middle)[0] <= most else (low, middle)
        return low


def limited(leg: Leg, joint: str) -> bool:
    """Whether the problem limits how hot a joint's winding may get."""
    return leg.drive(joint, "motor", LIMIT)[1] is not None
