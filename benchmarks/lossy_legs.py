"""How dependable an answer is on legs whose drives lose something: verified, certified, and never higher with a loss more.

    python benchmarks/lossy_legs.py [LEGS] [STARTS] [SEED] [PROCESSES] [FILE]

Takes the random legs of random_legs.py (10 unless told) and solves each three times from STARTS starts (3): as it is, with
gears that lose 5 to 40 per cent and rub, and with these on a supply that sags, each within LIMIT seconds. FILE keeps what
is done, and what it has is not solved again. Prints a line for each, and how often a
clearance rose by more than 0.1 per cent of the leg's length where something more was lost: then a better hop was overlooked.
"""

import json
import sys
import time
from collections import Counter
from collections.abc import Iterator
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from joblib import Parallel, delayed
from random_legs import feasible_legs, loaded

from hopopt import solve
from hopopt.errors import HopoptError, one_line

KINDS = ("lossless", "lossy gears", "lossy gears, weak supply")
ROSE = 1e-3  # of the leg's length
VOLTAGE = 48.0
LIMIT = 240.0  # s for a hop
Ended = tuple[float, str, float]  # clearance [m], how it ended, processor time [s]


def losses(entries: dict[str, Any], rng: np.random.Generator) -> list[dict[str, Any]]:
    """The entries of a leg with none of the losses, with those of gears, and with a supply's too."""
    ratio, torque, speed = (entries[f"leg.{path}"] for path in ("gear.ratio", "motor.max_torque", "motor.max_speed"))
    stall = ratio * torque
    gears = {
        "leg.gear.efficiency": round(rng.uniform(0.6, 0.95), 3),
        "leg.gear.friction": round(stall * rng.uniform(0.0, 0.03), 6),
        "leg.gear.damping": round(stall / (speed / ratio) * rng.uniform(0.0, 0.02), 8),
    }
    most = 2 * torque * speed / 4  # of two motors, mechanically [W]
    sags = {
        "supply.voltage": VOLTAGE,
        "supply.internal_resistance": round(rng.uniform(0.05, 0.4) * VOLTAGE**2 / (4 * most), 6),
    }
    return [entries, entries | gears, entries | gears | sags]


def solved(entries: dict[str, Any], starts: int) -> Ended:
    """A leg's answer."""
    began = time.process_time()
    try:
        s = solve(loaded(entries), starts=starts, processes=1, time_limit=LIMIT)
    except HopoptError as error:
        return np.nan, one_line(error), time.process_time() - began
    words = "certified" if s.summary.certified else "verified" if s.verified else "not verified"
    open_conditions = [name for name, check in s.summary.certificate.items() if not check.passed]
    if why := [*s.summary.failed_checks, *open_conditions]:
        words += f" ({', '.join(why)}; refinement: {s.summary.refinement_ended})"
    return s.clearance, words, time.process_time() - began


def answers(
    legs: list[list[dict[str, Any]]], asked: dict[str, int], processes: int, file: Path | None
) -> Iterator[Ended]:
    """Each leg's of each kind, in order: as the file has it, else solved and written there."""
    lines = map(json.loads, file.read_text().splitlines()) if file is not None and file.exists() else ()
    known = {(leg, kind): ended for was, leg, kind, *ended in lines if was == asked}
    missing = [(k, n) for k, n in product(range(len(legs)), range(len(KINDS))) if (k, n) not in known]
    jobs = (delayed(solved)(legs[k][n], asked["starts"]) for k, n in missing)
    found: Any = Parallel(n_jobs=processes, return_as="generator")(jobs)
    for key in product(range(len(legs)), range(len(KINDS))):
        if key not in known:
            known[key] = next(found)
            if file is not None:
                with file.open("a") as stream:
                    stream.write(json.dumps([asked, *key, *known[key]]) + "\n")
        height, words, seconds = known[key]
        yield height, words, seconds


def main() -> int:
    """Solve, print; 1 if a clearance rose where something more is lost."""
    given = sys.argv[1:5]
    count, starts, seed, processes = (int(x) for x in given + ["10", "3", "0", "2"][len(given) :])
    file = Path(sys.argv[5]) if len(sys.argv) > 5 else None
    rng = np.random.default_rng(seed)
    legs = [losses(entries, rng) for entries in feasible_legs(count, seed)]
    results = answers(legs, {"starts": starts, "seed": seed}, processes, file)
    ended, seconds, rose = Counter[tuple[str, str]](), np.zeros(3), 0
    for k, leg in enumerate(legs):
        found = [next(results) for _ in KINDS]
        size, heights = leg[0]["leg.thigh.length"] + leg[0]["leg.shank.length"], np.array([f[0] for f in found])
        wrong = bool((np.diff(heights) > ROSE * size).any())
        rose += wrong
        seconds += [f[2] for f in found]
        shown = ", ".join(f"{height:.4f} m {words}" for height, words, _ in found)
        print(f"{k:3d} {shown}{'   ROSE' if wrong else ''}", flush=True)
        for kind, (_, words, _), entries in zip(KINDS, found, leg, strict=True):
            ended[kind, words.partition(" (")[0]] += 1
            if words != "certified":
                print(f"    {kind}: {words}\n    {entries}", flush=True)
    for (kind, words), n in sorted(ended.items()):
        print(f"{kind}: {n} of {count} {words}")
    print(f"processor time, of lossless ones: {', '.join(f'{s / seconds[0]:.2f}' for s in seconds)}")
    print(f"clearance rose with losses on {rose} of {count} legs (seed {seed}, {starts} starts)")
    return 1 if rose else 0


if __name__ == "__main__":
    sys.exit(main())
