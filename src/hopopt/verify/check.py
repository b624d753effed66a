"""One claim about a plan: what was measured, and what is allowed."""

from dataclasses import dataclass

import numpy as np
from pydantic import computed_field

from hopopt.record import Derived, Real, stated

STATE, LIMIT, BALANCE, EXACT, KKT = 1e-5, 1e-4, 1e-6, 1e-7, 1e-6  # tolerances: SI, share of the range, relative
LEAST_TOLERANCE = 1e-300  # what a tolerance of nothing counts as, where checks are compared
FIGURE_TOLERANCE = 1e-4  # relative: a claimed work or peak, which has kinks between the nodes


@dataclass(frozen=True)
class Condition(Derived):
    """What was measured against what is allowed."""

    residual: Real = stated("what was measured [unit]")
    tolerance: float = stated("what is allowed [unit]")
    unit: str = stated("of both")
    where: str = stated("where the worst was found", default="")
    left_out: str = stated("why nothing can be measured; empty if it was", default="")

    @computed_field(description="whether it holds, or is left out")
    @property
    def passed(self) -> bool:
        """Whether it holds; also of a check that is left out."""
        return bool(self.left_out or (np.isfinite(self.residual) and self.residual <= self.tolerance))


@dataclass(frozen=True)
class Named:
    """What stands before a condition's fields in a check: ``Check(name, residual, tolerance, unit, where, left_out)``."""

    name: str = stated("what is checked")


@dataclass(frozen=True)
class Check(Condition, Named):
    """One check of the verification."""


def failed(checks: list[Check]) -> list[Check]:
    """The checks that did not pass, worst first."""
    bad = [c for c in checks if not c.passed]
    return sorted(bad, key=lambda c: -c.residual / max(c.tolerance, LEAST_TOLERANCE))
