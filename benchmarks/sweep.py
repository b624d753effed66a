"""Points per second of a study against separate cold solves of the same points, as ratios; and how well they agree.

    python benchmarks/sweep.py [COUNT] [STANCE]

COUNT gear ratios from 80 to 120 (12 unless told) of the paper's leg with a longest stance of STANCE s (0.4 unless
told), each of the three ways in one process, one after the other, so that a busy machine slows all alike: the study;
the library's `solve` with the problem's starts, which is what gives a single answer the same confidence; and `solve`
with one start.
"""

import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import hopopt as ho


def timed(work: Callable[[], Any]) -> tuple[Any, float]:
    """What the work gives, and the seconds it took."""
    began = time.perf_counter()
    return work(), time.perf_counter() - began


def compare(study: ho.Study, seconds: float, starts: int | None) -> str:
    """One line: speed and agreement of a study against cold solves with so many starts."""
    total, worse, better = 0.0, 0.0, 0.0
    for k, p in enumerate(study.points):
        design = study.definition.design_at(k)
        alone, took = timed(lambda d=design: ho.solve(d, starts=starts, processes=1))
        total += took
        if p.clearance_m is not None and alone.verified:
            difference = p.clearance_m / alone.clearance - 1
            worse, better = min(worse, difference), max(better, difference)
    what = "the problem's starts" if starts is None else f"{starts} start"
    return (
        f"cold solves, {what}: {total:.1f} s; the study is {total / seconds:.2f} times as fast; "
        f"its clearances differ by {worse:+.1e} to {better:+.1e} relatively"
    )


def main() -> None:
    """Measure and print."""
    count, stance = int((sys.argv[1:] or ["12"])[0]), float((sys.argv[2:] or ["0.4"])[0])
    design = ho.load("paper", {"hop.stance_duration": (0.03, stance)})
    vary = {"leg.gear.ratio": np.linspace(80, 120, count)}
    with tempfile.TemporaryDirectory() as folder:
        study, seconds = timed(lambda: ho.sweep(design, vary, processes=1, results=Path(folder)))
    verified = sum(p.verified for p in study.points)
    print(f"study: {count} points in {seconds:.1f} s, {verified} verified, {study.corrected} corrected", flush=True)
    print(compare(study, seconds, None), flush=True)
    print(compare(study, seconds, 1), flush=True)


if __name__ == "__main__":
    main()
