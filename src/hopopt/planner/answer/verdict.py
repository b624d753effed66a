"""A verdict on a plan: its checks, the error of its objective, and the certificate of first-order optimality.

planner/checks/judge.py makes all verdicts. *Verified* means that every check passed. The certificate stands beside that: a hop
that is feasible but not certified is verified all the same.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from hopopt.nlp.solver.ipopt import NlpSolution
from hopopt.optimality.certificate import Certificate
from hopopt.optimality.error_estimate import ObjectiveError
from hopopt.planner.answer.summary_extras import SecondOrder
from hopopt.verify.check import Check, failed

Multipliers = dict[str, np.ndarray]  # of one phase, or of the ends, by name


@dataclass(frozen=True)
class StatedError:
    """How far a stated objective may be off, in the objective's unit unless stated otherwise.

    too_high_by: by how much the claim may be better than the optimum: the larger one of estimate and simulation
    relative: the same, relative to the objective
    estimate: from the trajectories and multipliers
    simulated: the whole hop in one piece: its values, by how much it is short, or why it says nothing
    gain_of_relaxing: so much better might a hop be that keeps its limits at the nodes alone, by the multipliers
    could_be_beaten_by: to first order neighbouring hops may be better by this, and by what the tie-break weighs; None for a
        hop that is not certified
    """

    too_high_by: float
    relative: float
    estimate: ObjectiveError
    simulated: Mapping[str, Any]
    gain_of_relaxing: float
    could_be_beaten_by: float | None = None

    def beside(self, certificate: Certificate, solution: NlpSolution) -> "StatedError":
        """The error with what the certificate of a ``solution`` leaves open, and what its tie-break may have cost."""
        if not certificate.passed:
            return replace(self, could_be_beaten_by=None)
        still_open = sum(c.residual for c in certificate.checks if c.unit == "of the objective")
        beaten_by = self.too_high_by + still_open * abs(solution.objective) + solution.tie_break
        return replace(self, could_be_beaten_by=beaten_by)

    def as_dict(self) -> dict[str, Any]:
        """For the summary."""
        return {
            "too_high_by": self.too_high_by,
            "relative": self.relative,
            "estimate": self.estimate.as_dict(),
            "simulated": dict(self.simulated),
            "relaxed": {"gains": self.gain_of_relaxing},
            "could_be_beaten_by": self.could_be_beaten_by,
        }


@dataclass(frozen=True)
class Verdict:
    """What the checks say of a plan.

    checks: every check of the verification
    error: of the objective, as it is stated beside the answer; None without multipliers
    conditions: the certificate's conditions of first-order optimality; empty without multipliers
    multipliers: arrays that the certificate rests on, by phase, to be stored
    second_order: directions of the second-order test, of a stored result; None if it was not made
    of_file: of a stored result, that its files are as they were written and say what is computed again
    """

    checks: tuple[Check, ...]
    error: StatedError | None = None
    conditions: tuple[Check, ...] = ()
    multipliers: Mapping[str, Multipliers] = field(default_factory=dict, repr=False)
    second_order: SecondOrder | None = None
    of_file: tuple[Check, ...] = ()

    @property
    def verified(self) -> bool:
        """Whether every check passed."""
        return not self.failed

    @property
    def failed(self) -> list[Check]:
        """The checks that did not pass, the worst first."""
        return failed([*self.checks, *self.of_file])

    @property
    def failed_checks(self) -> list[str]:
        """Names of the checks that did not pass, the worst first."""
        return [check.name for check in self.failed]

    @property
    def certified(self) -> bool:
        """Whether every condition of first-order optimality holds."""
        return bool(self.conditions) and all(check.passed for check in self.conditions)

    def with_checks(self, more: Iterable[Check], of_file: Iterable[Check] = ()) -> "Verdict":
        """The verdict with further checks, of the hop and of the files that it is stored in, that must hold too."""
        return replace(self, checks=(*self.checks, *more), of_file=(*self.of_file, *of_file))
