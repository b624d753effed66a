"""Path constraints of a program that nothing else checks, by their values between the nodes: whoever added them."""

from collections.abc import Collection, Mapping

import numpy as np

from hopopt.leg.limit_id import kind_of
from hopopt.nlp.refinement.interval_errors import IntervalErrors
from hopopt.nlp.solver.ipopt import NlpSolution
from hopopt.verify.check import LIMIT, Check
from hopopt.verify.limits import LIMIT_KINDS


def program_limits(
    solution: NlpSolution, errors: Mapping[str, IntervalErrors], checked: Collection[str]
) -> list[Check]:
    """A check for each path constraint of a phase that is not of a kind that verification knows, nor ``checked`` by name.

    errors: of every interval, by phase: by how much limits are passed there, in their scales
    """
    found = []
    for phase, error in errors.items():
        passed, edges = np.maximum(error.below, error.above), solution.phases[phase].edges
        for c in solution.transcription.problem.phase(phase).path:
            if kind_of(c.name) in LIMIT_KINDS or (name := f"{phase} {c.name}") in checked:
                continue
            of_interval = passed[:, [label.of == c.name for label in error.limits]].max(axis=1)
            worst = int(of_interval.argmax())
            where = f"interval from {edges[worst]:.4f} s after {phase} began"
            found.append(Check(name, float(of_interval[worst]), LIMIT, "of its range", where))
    return found
