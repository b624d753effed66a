"""The certificate and the switching structure as a result holds them: in the summary, and as arrays to be stored."""

from collections.abc import Mapping

import numpy as np

from hopopt.nlp.ipopt import NlpSolution
from hopopt.optimality import switching_structure as structure
from hopopt.optimality.certificate import Certificate, certify
from hopopt.planner.solution import Multipliers, Solution
from hopopt.planner.stated_error import could_be_beaten_by
from hopopt.verify.check import Check

SAME = 1e-9  # stored costates against those of the stored multipliers, relative


def attached(plan: Solution, solution: NlpSolution) -> Solution:
    """The plan with its certificate and its structure in the summary, and the multipliers it rests on."""
    certificate = certify(solution)
    beaten = could_be_beaten_by(plan.summary, certificate)
    summary = {
        **plan.summary,
        "objective_error": {**plan.summary["objective_error"], "could_be_beaten_by": beaten},
        "certified": certificate.passed,
        "certificate": certificate.as_dict(),
        "structure": structure.as_dict(structure.structure(solution)),
    }
    return plan.noted(summary=summary, multipliers=stored(certificate))


def stored(certificate: Certificate) -> dict[str, Multipliers]:
    """By phase, with N intervals, n abscissae and m limits: costate (N + 1, nx) at the edges, hamiltonian (N,) of each
    interval, limit_multiplier (N, n, m) per second at the abscissae, limit_at_end (m,), names of states and limits;
    and under "ends" the multipliers of the boundary constraints with their names."""
    found: dict[str, Multipliers] = {}
    for name, c in certificate.phases.items():
        states = [str(x) for s in c.layout.phase.states for x in s.components()]
        found[name] = {
            "costate": c.costate,
            "hamiltonian": c.mean_hamiltonian,
            "limit_multiplier": c.multipliers.density,
            "limit_at_end": c.multipliers.atom,
            "state": np.array(states),
            "limit": np.array([str(x) for x in c.multipliers.limits]),
        }
    ends = certificate.ends
    found["ends"] = {"multiplier": ends.multiplier, "constraint": np.array([str(x) for x in ends.labels])}
    return found


def agreement(certificate: Certificate, kept: Mapping[str, Multipliers]) -> Check:
    """Costates and multipliers as they lie in the file against those of the program's multipliers."""
    wrong = 0.0
    for name, fresh in stored(certificate).items():
        for part, computed in fresh.items():
            if computed.dtype.kind == "f" and computed.size:
                miss = float(np.abs(kept[name][part] - computed).max())
                wrong = max(wrong, miss / max(1.0, float(np.abs(computed).max())))
    return Check("stored costates", wrong, SAME, "relative")
