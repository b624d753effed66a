"""How dependable an answer is on legs whose drives do not turn as their joints do: verified and certified.

    python benchmarks/random_transmissions.py [LEGS] [STARTS] [SEED] [PROCESSES] [FILE]

Takes the random legs of random_legs.py (50 unless told) and gives the knee a law drawn at random, some legs a belt or a spring
besides. Each is solved from STARTS starts (1) within LIMIT seconds. Every law has the gear's own ratio in the middle of the
knee's range. Prints a line for each as it ends. FILE keeps the lines, and what it has is not solved again.
"""

import json
import sys
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from joblib import Parallel, delayed
from random_legs import feasible_legs

import hopopt as ho
from hopopt.errors import HopoptError, ProblemFileError, one_line

KNEE = "leg.knee.transmission"
STEEPEST = 0.4  # share by which a ratio changes from the middle of the knee's range to its ends
LIMIT = 180.0  # s for a leg
CERTIFIED = "certified"


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


@dataclass(frozen=True)
class Outcome:
    """How a leg (by its number) ended: clearance [m], "certified" or what is missing, by how much the hop in one piece is short
    of the plan [m], and processor time [s]."""

    leg: int
    clearance: float
    ended: str
    short: float
    seconds: float


def solved(leg: int, entries: dict[str, Any], starts: int) -> Outcome:
    """One leg's answer."""
    began = time.process_time()
    try:
        s = ho.solve(ho.load("paper", entries), starts=starts, processes=1, time_limit=LIMIT)
    except HopoptError as error:
        return Outcome(leg, np.nan, one_line(error), np.nan, time.process_time() - began)
    words = CERTIFIED if s.summary.certified else f"verified={s.verified}: {s.summary.failed_checks}"
    whole = s.summary.objective_error.simulated
    short = np.nan if whole is None or whole.clearance_m is None else s.clearance - whole.clearance_m
    return Outcome(leg, s.clearance, words, short, time.process_time() - began)


def kind(entries: dict[str, Any]) -> str:
    """The law of a leg's knee and what it has besides, in words."""
    laws = [name.rpartition(".")[2] for name in entries if name.startswith(f"{KNEE}.")]
    words = [{"coupling": "belt"}.get(law, law) for law in laws]
    return ", ".join([*words, *(["spring"] if "leg.spring.knee.stiffness" in entries else [])])


def kept(file: Path | None, asked: dict[str, int]) -> dict[int, Outcome]:
    """What a file has of an earlier run with these numbers of starts and seed."""
    lines = map(json.loads, file.read_text().splitlines()) if file is not None and file.exists() else ()
    found = [Outcome(**line["outcome"]) for line in lines if line["asked"] == asked]
    return {outcome.leg: outcome for outcome in found}


def outcomes(legs: list[dict[str, Any]], asked: dict[str, int], processes: int, file: Path | None) -> Iterator[Outcome]:
    """Each leg's answer: those of the file first, then the others as they end."""
    known = kept(file, asked)
    yield from (outcome for leg, outcome in known.items() if leg < len(legs))
    jobs = (delayed(solved)(k, entries, asked["starts"]) for k, entries in enumerate(legs) if k not in known)
    ended: Any = Parallel(n_jobs=processes, return_as="generator_unordered")(jobs)
    for outcome in ended:
        if file is not None:
            with file.open("a") as stream:
                stream.write(json.dumps({"asked": asked, "outcome": asdict(outcome)}) + "\n")
        yield outcome


def main() -> int:
    """Solve, print; 1 if fewer than 94 per cent are verified and certified."""
    given = sys.argv[1:5]
    count, starts, seed, processes = (int(x) for x in given + ["50", "1", "0", "2"][len(given) :])
    file = Path(sys.argv[5]) if len(sys.argv) > 5 else None
    rng = np.random.default_rng(seed)
    legs = [transmission(entries, rng) for entries in feasible_legs(count, seed)]
    good, seconds = 0, 0.0
    for k, found in enumerate(outcomes(legs, {"starts": starts, "seed": seed}, processes, file), start=1):
        good, seconds = good + (found.ended == CERTIFIED), seconds + found.seconds
        short = f"in one piece {found.short:+.1e} m"
        said = f"{found.leg:3d} {found.clearance:.4f} m {found.ended} ({kind(legs[found.leg])}), {short}"
        print(f"{said}, {found.seconds:.0f} s; {good} of {k}", flush=True)
        if found.ended != CERTIFIED:
            print(f"    {legs[found.leg]}", flush=True)
    print(f"{good} of {count} verified and certified (seed {seed}, {starts} starts), {seconds / count:.0f} s a leg")
    return 0 if good >= 0.94 * count else 1


if __name__ == "__main__":
    sys.exit(main())
