"""Whether the paper's force control, scaled to a leg, hops there: built-in legs and random ones of two joints.

    python benchmarks/scaled_control.py [LEGS] [EVALUATIONS] [SEED] [FIRST]

Simulates it on every built-in leg of two joints and on LEGS random ones (50), those of benchmarks/random_legs.py, from
number FIRST on (0; the built-in ones then are left out). Tunes it there too, on EVALUATIONS hops each (24), at 1 kHz with
perfect encoders for speed. The gains found are then simulated on the machine as the problem describes it.

Tuning also chooses how the leg pushes and folds. So the scaled gains hop twice: in the paper's form, and in the form that
tuning chose. They should clear half of what the tuned gains do, or a limit in the way is named. Prints a line for each
leg, and how many pass in the form chosen, and in the paper's; the exit status is 1 if one fails in the form chosen.
"""

import sys
from typing import Any

from random_legs import feasible_legs, loaded

import hopopt as ho
from hopopt.comparison.gain_tuning import tune
from hopopt.control.closed_loop import simulate
from hopopt.control.strategies import find
from hopopt.design import Design
from hopopt.problem.load import changed
from hopopt.sim.hop_metrics import HopFigures

BUILT_IN = (
    "paper", "paper_four_quadrant", "paper_no_countermovement", "a1_leg", "b1_leg", "go1_leg", "go2_leg", "hyq_leg",
    "solo12_leg",
)  # fmt: skip
HALF = 0.5


QUICK = {"simulation.control_rate": 1000.0, "simulation.encoder_bits": 0, "simulation.speed_window": 1}
FORM = ("retraction", "stance")


def hop(design: Design, options: dict[str, Any] | None = None) -> HopFigures:
    """The first hop of the force control, to past its apex: scaled gains, or these."""
    return simulate(design, find("force"), past_apex=True, options=options).figures


def passes(f: HopFigures, best: HopFigures) -> tuple[bool, str]:
    """Whether a hop is half as high as the best or names a limit, and what is said of it."""
    named = "; ".join(words for words in (f.no_hop, f.cut_short, *f.limits_exceeded) if words)
    share = f.clearance / best.clearance if best.clearance else 1.0
    lift = f"lift-off at {f.lift_off['time_s']:.3f} s with {f.lift_off['vertical_m_s']:.2f} m/s"
    return bool(named) or share >= HALF, f"{f.clearance:.3f} m ({share:.0%}), {lift}, {named or 'every limit kept'}"


def judged(design: Design, evaluations: int) -> tuple[bool, bool, str]:
    """Whether the scaled gains pass in the form that tuning chose, whether in the paper's, and a line."""
    options = tune(changed(design, QUICK), "force", evaluations=evaluations, processes=1).best.options
    best, form = hop(design, options), {name: options[name] for name in FORM}
    (alike, words), (plain, own) = (passes(hop(design, given), best) for given in (form, {}))
    return alike, plain, f"tuned {best.clearance:.3f} m {form}; scaled alike {words}; scaled {own}"


def main() -> int:
    """Simulate, tune, print."""
    count, evaluations, seed, first = (int(x) for x in (sys.argv[1:] + ["50", "24", "0", "0"][len(sys.argv) - 1 :])[:4])
    legs = {} if first else {name: ho.load(name) for name in BUILT_IN}
    legs |= {f"leg {k}": loaded(entries) for k, entries in enumerate(feasible_legs(first + count, seed)) if k >= first}
    found = []
    for name, design in legs.items():
        *passed, said = judged(design, evaluations)
        found.append(passed)
        print(f"{name}: {said}", flush=True)
    alike, plain = (sum(column) for column in zip(*found, strict=True))
    print(f"of {len(found)} legs {alike} pass in the form that tuning chose, {plain} in the paper's")
    return 0 if alike == len(found) else 1


if __name__ == "__main__":
    sys.exit(main())
