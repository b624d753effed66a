"""How dependable an answer is on legs whose drives do not turn as their joints do: verified and certified.

    python benchmarks/random_transmissions.py [LEGS] [STARTS] [SEED] [PROCESSES]

Takes the random legs of random_legs.py (10 unless told) and gives the knee a law drawn at random, some legs a belt or a spring
besides. Each is solved from STARTS starts (3). Every law has the gear's own ratio in the middle of the knee's range. Prints a line for each.
"""

import sys
import time
from collections import Counter
from typing import Any

import numpy as np
from joblib import Parallel, delayed
from random_legs import feasible_legs

import hopopt as ho
from hopopt.errors import HopoptError, ProblemFileError, one_line

KNEE = "leg.knee.transmission"
STEEPEST = 0.4  # share by which a ratio changes from the middle of the knee's range to its ends


def law(entries: dict[str, Any], rng: np.random.Generator) -> dict[str, Any]:
    """Entries of a law of the knee's own angle."""
    low, high = entries["leg.knee.lower"], entries["leg.knee.upper"]
    middle, half = (low + high) / 2, (high - low) / 2
    kind = rng.choice(["linear", "table", "rod", "four_bar"])
    change = float(rng.uniform(-STEEPEST, STEEPEST))
    if kind == "linear":
        return {f"{KNEE}.linear": {"slope": change / half, "at": middle}}
    if kind == "table":
        return {f"{KNEE}.table": {"angle": [low, middle, high], "ratio": [1 - change, 1.0, 1 + change]}}
    arm = float(rng.uniform(0.03, 0.08))
    if kind == "rod":
        base, folded = float(rng.uniform(2, 5)) * arm, middle - np.pi / 2
        length = np.hypot(base, arm)
        return {f"{KNEE}.rod": {"base": base, "arm": arm, "folded": folded, "travel": base * arm / length}}
    ground = float(rng.uniform(3, 6)) * arm  # a parallelogram, its crank a little longer or shorter than the arm
    bar = {"ground": ground, "rod": ground, "arm": arm, "crank": arm * float(rng.uniform(1.0, 1.3))}
    return {f"{KNEE}.four_bar": bar | {"stretched": middle - np.pi / 2, "ahead": True}}


def transmission(entries: dict[str, Any], rng: np.random.Generator) -> dict[str, Any]:
    """The leg's entries with a transmission that its problem takes."""
    while True:
        found = entries | law(entries, rng)
        if rng.random() < 0.4:
            found[f"{KNEE}.coupling"] = {"hip": {"ratio": float(rng.uniform(-0.5, 1.0))}}
        if rng.random() < 0.3:
            stall = entries["leg.gear.ratio"] * entries["leg.motor.max_torque"]
            middle = (entries["leg.knee.lower"] + entries["leg.knee.upper"]) / 2
            found |= {"leg.spring.knee.stiffness": 0.1 * stall, "leg.spring.knee.rest_angle": middle}
        try:
            ho.load("paper", found)
        except ProblemFileError:
            continue
        return found


def solved(entries: dict[str, Any], starts: int) -> tuple[float, str, float, float]:
    """Clearance [m], how it ended, by how much the hop in one piece is short of it [m], and processor time [s]."""
    began = time.process_time()
    try:
        s = ho.solve(ho.load("paper", entries), starts=starts, processes=1)
    except HopoptError as error:
        return np.nan, one_line(error), np.nan, time.process_time() - began
    words = "certified" if s.summary.certified else f"verified={s.verified}: {s.summary.failed_checks}"
    whole = s.summary.objective_error.simulated
    short = np.nan if whole is None or whole.clearance_m is None else s.clearance - whole.clearance_m
    return s.clearance, words, short, time.process_time() - began


def main() -> int:
    """Solve, print; 1 if fewer than 94 per cent are verified and certified."""
    count, starts, seed, processes = (int(x) for x in (sys.argv[1:] + ["10", "3", "0", "2"][len(sys.argv) - 1 :])[:4])
    rng = np.random.default_rng(seed)
    legs = [transmission(entries, rng) for entries in feasible_legs(count, seed)]
    jobs = (delayed(solved)(entries, starts) for entries in legs)
    results: Any = Parallel(n_jobs=processes, return_as="generator")(jobs)
    ended = Counter[bool]()
    for k, (entries, (height, words, short, seconds)) in enumerate(zip(legs, results, strict=True)):
        kind = next(name.rpartition(".")[2] for name in entries if name.startswith(f"{KNEE}."))
        more = [name for name in (f"{KNEE}.coupling", "leg.spring.knee.stiffness") if name in entries]
        extra = "".join(f", {'belt' if 'coupling' in name else 'spring'}" for name in more)
        print(
            f"{k:3d} {height:.4f} m {words} ({kind}{extra}), in one piece {short:+.1e} m, {seconds:.0f} s", flush=True
        )
        ended[words == "certified"] += 1
        if words != "certified":
            print(f"    {entries}", flush=True)
    print(f"{ended[True]} of {count} verified and certified (seed {seed}, {starts} starts)")
    return 0 if ended[True] >= 0.94 * count else 1


if __name__ == "__main__":
    sys.exit(main())
