"""Whether a limit more ever raises the highest periodic hop: the paper's leg within stances and limits of the touchdown.

    python benchmarks/landed_limits.py [STANCES] [FRICTION] [SEED] [LIMITS]

Stances are longest durations [s], 0.2,0.25,0.3,0.4 unless told; friction is a coefficient, or none; the seed is that of the
starts (0); limits are some of no,loss,impulse,gear,foot. Prints a row for each stance: the clearance [m] without a limit of the
touchdown and with each one alone, on the first mesh, and the time it took.
Exit code 1 if a case has over 1e-4 more than one that allows more.
"""

import sys
import time
from itertools import product

import numpy as np

from hopopt.ocp.hop import Hop
from hopopt.planner.search.first_mesh import search_first_mesh
from hopopt.problem.load import load
from hopopt.studies.consistency import CONTRADICTING_GAIN

STANCES = "0.2,0.25,0.3,0.4"
LIMITS = {
    "no limit": {}, "loss 1 J": {"hop.touchdown_loss": 1.0}, "impulse 2 N s": {"hop.touchdown_impulse": 2.0},
    "gear 20 N m": {"hop.touchdown_gear_torque": 20.0}, "foot 1 m/s": {"hop.touchdown_speed": 1.0},
}  # fmt: skip


def highest(stance: float, friction: str, seed: str, limits: dict[str, float]) -> float:
    """Clearance [m] of the best hop that the search finds on the first mesh."""
    ground = {} if friction == "none" else {"contact.friction": float(friction)}
    asked = {"hop.kind": "periodic", "hop.stance_duration": [0.03, stance], "solver.seed": int(seed)}
    hop = Hop(load("paper", {**asked, **ground, **limits}))
    outcomes = search_first_mesh(hop, hop.design.solver.starts, 1, lambda text: None).outcomes
    return max((o.value for o in outcomes if o.success), default=np.nan)


def main() -> int:
    """Solve every case; 1 if one of them has more than one that allows more."""
    given, friction, seed, names = (sys.argv[1:] + [STANCES, "none", "0", ",".join(LIMITS)][len(sys.argv) - 1 :])[:4]
    stances = sorted(float(s) for s in given.split(","))
    limits = {name: LIMITS[name] for name in LIMITS if any(name.startswith(word) for word in names.split(","))}
    if not limits:
        sys.exit(f"{names}: no limit begins so: {', '.join(LIMITS)}")
    print(f"friction {friction}".ljust(14), *(name.rjust(14) for name in limits), "CPU s".rjust(8))
    table = np.full((len(stances), len(limits)), np.nan)
    for row, stance in enumerate(stances):
        began = time.process_time()
        table[row] = [highest(stance, friction, seed, entries) for entries in limits.values()]
        print(
            f"{stance:g} s".ljust(14),
            *(f"{z:14.4f}" for z in table[row]),
            f"{time.process_time() - began:8.0f}",
            flush=True,
        )
    wrong = 0
    for (a, b), (c, d) in product(np.ndindex(*table.shape), repeat=2):
        wider = (a, b) != (c, d) and a >= c and (b == d or list(limits)[b] == "no limit")
        if wider and table[c, d] > (1 + CONTRADICTING_GAIN) * table[a, b]:
            wrong += 1
            print(f"{stances[c]:g} s, {list(limits)[d]}: more than {stances[a]:g} s, {list(limits)[b]}")
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
