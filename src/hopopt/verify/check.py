"""One claim about a plan: what was measured, and what is allowed."""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

STATE, LIMIT, BALANCE, EXACT, KKT = 1e-5, 1e-4, 1e-6, 1e-7, 1e-6  # tolerances: SI, share of the range, relative
TINY = 1e-300  # what a tolerance of nothing counts as, where checks are compared
FIGURE = 1e-4  # relative: a claimed work or peak, which has kinks between the nodes


@dataclass(frozen=True)
class Check:
    """One claim: what was measured against what is allowed; ``where`` says where the worst was found, ``left_out`` why
    nothing can be measured, if so: such a check neither passes nor fails."""

    name: str
    residual: float
    tolerance: float
    unit: str
    where: str = ""
    left_out: str = ""

    @property
    def passed(self) -> bool:
        """Whether it holds; also of a check that is left out."""
        return bool(self.left_out or (np.isfinite(self.residual) and self.residual <= self.tolerance))

    def as_dict(self) -> dict[str, Any]:
        """For the summary: all fields and whether it passed."""
        return {**asdict(self), "passed": self.passed}


def failed(checks: list[Check]) -> list[Check]:
    """The checks that did not pass, worst first."""
    bad = [c for c in checks if not c.passed]
    return sorted(bad, key=lambda c: -c.residual / max(c.tolerance, TINY))
