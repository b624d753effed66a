"""The certificate's costates and multipliers as arrays to be stored, and whether a file's agree with the program's."""

from collections.abc import Mapping

import numpy as np

from hopopt.optimality.certificate import Certificate
from hopopt.planner.answer.verdict import Multipliers
from hopopt.verify.check import Check

SAME = 1e-9  # stored costates against those of the stored multipliers, relative


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


def agreement(computed: Mapping[str, Multipliers], kept: Mapping[str, Multipliers]) -> Check:
    """Costates and multipliers as they lie in the file (``kept``) against those of the program's multipliers."""
    wrong = 0.0
    for name, fresh in computed.items():
        for part, values in fresh.items():
            if values.dtype.kind == "f" and values.size:
                miss = float(np.abs(kept[name][part] - values).max())
                wrong = max(wrong, miss / max(1.0, float(np.abs(values).max())))
    return Check("stored costates", wrong, SAME, "relative")
