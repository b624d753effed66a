"""A verdict on a plan: its checks, the error of its objective, and the certificate of first-order optimality.

planner/checks/judge.py makes all verdicts. *Verified* means that every check passed. The certificate stands beside that: a hop
that is feasible but not certified is verified all the same.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from hopopt.nlp.solver.ipopt import NlpSolution
from hopopt.optimality.certificate import Certificate
from hopopt.optimality.error_estimate import ObjectiveError
from hopopt.optimality.second_order import Curvature
from hopopt.record import Real, Strict, stated
from hopopt.verify.check import Check, failed
from hopopt.verify.whole_hop import Simulated

Multipliers = dict[str, np.ndarray]  # of one phase, or of the ends, by name


@dataclass(frozen=True)
class Relaxed(Strict):
    """A hop that keeps its limits at the nodes alone."""

    gains: Real = stated("what it may gain, by the multipliers [the objective's unit]")


@dataclass(frozen=True)
class StatedError(Strict):
    """How far the objective may be off [the objective's unit, unless stated otherwise].

    too_high_by: the larger one of estimate and simulation
    could_be_beaten_by: to first order, and by what the tie-break weighs
    """

    too_high_by: Real = stated("by how much the claim may be better than the optimum")
    relative: Real = stated("the same, relative to the objective")
    estimate: ObjectiveError = stated("from the trajectories and multipliers")
    simulated: Simulated = stated("from the hop simulated in one piece")
    relaxed: Relaxed = stated("what enforcing limits between the nodes costs")
    could_be_beaten_by: float | None = stated("neighbouring hops may be better by this; null if not certified")

    @property
    def either_way(self) -> float:
        """What the objective may be too good by, and neighbouring hops better by, together [its unit]."""
        return self.too_high_by + (self.could_be_beaten_by or 0.0)

    def beside(self, certificate: Certificate, solution: NlpSolution) -> "StatedError":
        """The error with what the certificate of a ``solution`` leaves open, and what its tie-break may have cost."""
        if not certificate.passed:
            return self
        still_open = sum(c.residual for c in certificate.checks if c.unit == "of the objective")
        beaten_by = self.too_high_by + still_open * abs(solution.objective) + solution.tie_break
        return replace(self, could_be_beaten_by=beaten_by)


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
    second_order: Curvature | None = None
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


@dataclass(frozen=True, kw_only=True)
class Verification:
    """What a summary says of a verdict: whether an answer is verified, in words, as the exit code, and check by check."""

    status: str = stated("in words", lambda v: "verified" if v.verified else "solved, not verified")
    verified: bool = stated("whether every check passed", lambda v: v.verified)
    exit_code: int = stated("0 verified, 3 not verified or contradicted", lambda v: 0 if v.verified else 3)
    verification: tuple[Check, ...] = stated("every check", lambda v: v.checks)
    failed_checks: tuple[str, ...] = stated(
        "names of those that failed, worst first", lambda v: tuple(check.name for check in v.failed)
    )


def multipliers_of(certificate: Certificate) -> dict[str, Multipliers]:
    """What a certificate rests on, as arrays to be stored.

    By phase, with N intervals, n abscissae and m limits: costate (N + 1, nx) at the edges, hamiltonian (N,) of each
    interval, limit_multiplier (N, n, m) per second at the abscissae, limit_at_end (m,), names of states and limits;
    and under "ends" the multipliers of the boundary constraints with their names.
    """
    found: dict[str, Multipliers] = {}
    for name, c in certificate.phases.items():
        found[name] = {
            "costate": c.costate,
            "hamiltonian": c.mean_hamiltonian,
            "limit_multiplier": c.multipliers.density,
            "limit_at_end": c.multipliers.atom,
            "state": np.array([str(x) for s in c.layout.phase.states for x in s.components()]),
            "limit": np.array([str(x) for x in c.multipliers.limits]),
        }
    ends = certificate.ends
    found["ends"] = {"multiplier": ends.multiplier, "constraint": np.array([str(x) for x in ends.labels])}
    return found
