"""By how much the smooth distances that the planner keeps differ from coal's, over random joint angles of public robots.

    python benchmarks/smooth_distance.py [ROBOTS] [ANGLES]

ROBOTS of benchmarks/public_legs.py, separated by commas (a1,b1,g1); ANGLES drawn evenly within the limits of each (10000), other
ones than those that the stated error is measured on. Counted where a link is from 0 to 0.03 of the leg's length. Prints a line for
each link and what it passes. The exit status is 1 if one errs by more than it states.
"""

import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from public_legs import LEGS

import hopopt as ho
from hopopt.design import Design
from hopopt.leg.geometry.distance import distances_of
from hopopt.leg.geometry.smooth import clearances
from hopopt.leg.geometry.solids import BODY, NEAR

SEED = 20261128


def design_of(name: str) -> Design:
    """A robot's leg, with the numbers that its file lacks."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / f"{name}.toml"
        file.write_text(LEGS[name].problem(name, LEGS[name].lacks), encoding="utf-8")
        return ho.load(file)


def errors(design: Design, count: int) -> Iterator[tuple[str, str, int, float, float]]:
    """Of each link: its name, what it passes, how many angles it was near at, the largest error there, and the stated one [m]."""
    leg, true, found = design.leg, distances_of(design), clearances(design)
    if found is None:
        return  # it has no shapes
    low, high = (np.array([getattr(leg.joint[joint], side) for joint in leg.joints]) for side in ("lower", "upper"))
    angles = np.random.default_rng(SEED).uniform(low, high, (count, len(low)))
    for link in found.links:
        least = true.all(angles, true.between(link.joint, link.other)).min(axis=1)
        smooth = np.array(link.function(angles[:, link.angles].T)).ravel()
        near = (smooth >= 0) & (smooth < NEAR * found.reach)
        off = np.abs(smooth - found.level * np.tanh(least / found.level))[near].max(initial=0.0)
        passed = "body" if link.other == BODY else leg.links[link.other]
        yield link.link, passed, int(near.sum()), float(off), link.error


def main() -> int:
    """Measure, and print."""
    names = sys.argv[1].split(",") if len(sys.argv) > 1 else ["a1", "b1", "g1"]
    count, worst = int(sys.argv[2]) if len(sys.argv) > 2 else 10_000, 0.0
    print("| robot | link | passes | near at | largest error [mm] | stated [mm] |\n|---|---|---|---|---|---|")
    for name in names:
        for link, passed, near, off, stated in errors(design_of(name), count):
            print(f"| {name} | {link} | {passed} | {near} | {1000 * off:.3f} | {1000 * stated:.3f} |", flush=True)
            worst = max(worst, off - stated)
    return int(worst > 0)


if __name__ == "__main__":
    sys.exit(main())
