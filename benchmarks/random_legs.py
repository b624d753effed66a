"""How dependable an answer is on legs that nobody tuned anything for: the share verified, and what became of the rest.

    python benchmarks/random_legs.py [LEGS] [STARTS] [SEED]

Draws feasible legs (200 unless told): sizes, masses, drives, angle limits, friction, starts and rules of the hop all at
random around a leg that can carry itself. Each is solved from STARTS starts (3) on one of two processes. Prints a line
for each, the clearance against the upper bound of docs/bound.md, and a table of how they ended. An answer is verified,
solved but not verified (its failed checks are named), or not solved (with the reason); anything else, a traceback
above all, is a defect, and so is a clearance above the bound: the exit status is then 1.
"""

import sys
import time
from collections import Counter
from dataclasses import dataclass
from typing import Any

import numpy as np
from joblib import Parallel, delayed

import hopopt as ho
from hopopt.design import Design
from hopopt.errors import HopoptError, NotSolvedError, one_line
from hopopt.leg.robot import build_robot
from hopopt.ocp.guesses.feasibility import drives_too_weak, joints_without_inertia

PROCESSES = 2
GRAVITY = 9.81
VERIFIED, UNVERIFIED, NOT_SOLVED, DEFECT = "verified", "not verified", "not solved", "defect"


def draw(rng: np.random.Generator) -> dict[str, Any]:
    """Entries of a leg whose knee can hold its weight between 1.5 and 5 times where the hop begins."""
    thigh = rng.uniform(0.12, 0.5)
    shank = thigh * rng.uniform(0.75, 1.25)
    body, links = rng.uniform(1.0, 3.0) * (thigh / 0.15) ** 1.5, rng.uniform(0.05, 0.35)
    ratio, crouch = float(rng.choice([6, 9, 20, 50, 100])), rng.uniform(0.45, 0.85)
    weight = GRAVITY * body * (1 + links)
    torque = weight * thigh * rng.uniform(1.5, 5.0) / ratio
    speed = ratio * rng.uniform(8.0, 30.0)
    entries = {
        "leg.thigh.length": thigh,
        "leg.shank.length": shank,
        "leg.body.mass": body,
        "leg.thigh.mass": body * links * rng.uniform(0.5, 0.8),
        "leg.shank.mass": body * links * rng.uniform(0.1, 0.4),
        "leg.hip.lower": -rng.uniform(0.4, 1.2),
        "leg.hip.upper": rng.uniform(1.0, 1.5),
        "leg.knee.lower": -rng.uniform(2.1, 2.7),
        "leg.knee.upper": -rng.uniform(0.05, 0.4),
        "leg.gear.ratio": ratio,
        "leg.motor.max_torque": torque,
        "leg.motor.max_speed": speed,
        "leg.motor.rotor_inertia": rng.uniform(0.0, 0.05) * body * thigh**2 / ratio**2,
        "leg.motor.laws": ["paper"] if rng.random() < 0.5 else ["four-quadrant"],
        "leg.motor.torque_cap": torque,
        "start.hip_height": (thigh + shank) * crouch,
        "start.foot_x": rng.uniform(-0.05, 0.05) * thigh,
        "hop.stance_duration": [0.02, rng.uniform(0.15, 0.4)],
        "hop.foot_window": rng.uniform(0.1, 0.4) * thigh,
        "hop.counter_movement": bool(rng.random() < 0.7),
        "hop.flight_duration": [0.01, 1.5],
    }
    if rng.random() < 0.5:
        entries["contact.friction"] = rng.uniform(0.4, 1.0)
    return {name: round(x, 5) if isinstance(x, float) else x for name, x in entries.items()}


def feasible_legs(count: int, seed: int) -> list[dict[str, Any]]:
    """The first draws that are valid problems and can stand where they begin."""
    ho.load("paper")  # without it no draw could be read either
    found, rng = [], np.random.default_rng(seed)
    while len(found) < count:
        entries = draw(rng)
        try:
            design = loaded(entries)
            if not any(faults(design, build_robot(design.leg)) for faults in (joints_without_inertia, drives_too_weak)):
                found.append(entries)
        except HopoptError:
            continue
    return found


def loaded(entries: dict[str, Any]) -> Design:
    """The paper's problem with these entries."""
    said = (f"{name}={str(x).lower() if isinstance(x, bool) else repr(x)}" for name, x in entries.items())
    return ho.load("paper", list(said))


@dataclass(frozen=True)
class Outcome:
    """How one leg (by its number) ended, in a word and in a sentence, its clearance and the bound on it [m], seconds, and whether its hop,
    simulated in one piece, stayed with the plan."""

    leg: int
    ended: str
    sentence: str
    clearance: float
    bound: float
    seconds: float
    followed: bool = False


def solved(leg: int, entries: dict[str, Any], starts: int) -> Outcome:
    """One leg's answer."""
    began = time.perf_counter()
    try:
        s = ho.solve(loaded(entries), starts=starts, processes=1)
    except NotSolvedError as error:
        return Outcome(leg, NOT_SOLVED, one_line(error), np.nan, np.nan, time.perf_counter() - began)
    except Exception as error:  # the point of the benchmark is that there is none
        return Outcome(leg, DEFECT, f"{type(error).__name__}: {error}", np.nan, np.nan, time.perf_counter() - began)
    clearance, bound = s.clearance, s.summary.upper_bound.clearance_m or np.inf
    ended, sentence = (VERIFIED, "") if s.verified else (UNVERIFIED, ", ".join(s.summary.failed_checks))
    if not clearance <= bound:
        ended, sentence = DEFECT, f"above the bound of {bound:.3f} m"
    followed = bool(s.summary.objective_error.simulated.followed)
    return Outcome(leg, ended, sentence, clearance, bound, time.perf_counter() - began, followed)


def main() -> int:
    """Solve, print, and say whether there was a defect."""
    count, starts, seed = (int(x) for x in (sys.argv[1:] + ["200", "3", "0"][len(sys.argv) - 1 :])[:3])
    legs = feasible_legs(count, seed)
    jobs = (delayed(solved)(k, entries, starts) for k, entries in enumerate(legs))
    ended: Counter[str] = Counter()
    shares, seconds, followed = [], 0.0, 0
    results: Any = Parallel(n_jobs=PROCESSES, return_as="generator_unordered")(jobs)
    for found in results:
        ended[found.ended] += 1
        shares.append(found.clearance / found.bound)
        seconds += found.seconds
        followed += found.followed
        height = f"{found.clearance:.4f} m of {found.bound:.2f} m"
        print(f"{found.leg:3d} {found.ended}: {height}, {found.seconds:.0f} s", flush=True)
        if found.sentence:
            print(f"    {found.sentence}\n    {legs[found.leg]}", flush=True)
    print(f"\n{', '.join(f'{n} {what}' for what, n in ended.most_common())} of {count} (seed {seed}, {starts} starts)")
    print(f"verified: {100 * ended[VERIFIED] / count:.1f} %; {seconds / count:.1f} s a leg")
    print(f"simulated in one piece, {followed} stayed with the plan (docs/certificate.md)")
    print(f"clearance / bound: at most {np.nanmax(shares):.3f}, median {np.nanmedian(shares):.3f}")
    return 1 if ended[DEFECT] else 0


if __name__ == "__main__":
    sys.exit(main())
