"""Points per second of a study against separate cold solves of its points, and how well they agree.

    python benchmarks/sweep.py [SAMPLE] [ENTRY=VALUE ...]

The study: gear ratios 60 to 160 and shanks of 0.30 to 0.42 m, 77 points, of the paper's leg with the entries given
changed, on two processes. The reference: SAMPLE of its possible points (12 unless told), drawn at random, solved by
`solve` on the same two processes, one point in each: with the problem's starts, which is what `hopopt solve` does,
and with one start, which can end lower; and by as many commands `hopopt solve` without figures and the paper's control,
what somebody without a study would run: two at a time, and one after the other, each with its starts on both processes.
A busy machine slows all alike. Seconds a point count possible points alone.
"""

import subprocess
import sys
import tempfile
import time
from typing import Any

import numpy as np
from joblib import Parallel, delayed

import hopopt as ho
from hopopt.studies.sweep.point_file import IMPOSSIBLE

GRID = {"leg.gear.ratio": "60:160:11", "leg.shank.length": "0.30:0.42:7"}
PROCESSES = 2


def alone(entries: dict[str, Any], changes: list[str], starts: int | None) -> tuple[float, bool, float, float]:
    """Objective, whether verified, wall and CPU seconds of one cold solve."""
    began, work = time.perf_counter(), time.process_time()
    s = ho.solve(ho.load("paper", [*changes, *(f"{k}={v!r}" for k, v in entries.items())]), starts=starts, processes=1)
    return s.summary.objective_value, s.verified, time.perf_counter() - began, time.process_time() - work


def compare(study: ho.Study, chosen: list[int], changes: list[str], starts: int | None, rate: float) -> str:
    """Speed and agreement of a study against cold solves of some of its points."""
    points = [study.points[k] for k in chosen]
    began = time.perf_counter()
    jobs = (delayed(alone)(dict(p.values), changes, starts) for p in points)
    found: list[Any] = Parallel(n_jobs=PROCESSES)(jobs)  # type: ignore[assignment]
    each = (time.perf_counter() - began) / len(points)
    lines = [
        f"cold solves, {starts or 'the problem’s'} starts: {each:.2f} s a point: the study is {each / rate:.2f} times as fast"
    ]
    for p, (value, verified, wall, cpu) in zip(points, found, strict=True):
        difference = (p.objective_value or np.nan) / value - 1
        lines.append(
            f"  {p.index:3d} {value:.6f} {'' if verified else 'not verified '}in {wall:.1f} s (CPU {cpu:.1f} s); "
            f"study {p.outcome}, {difference:+.1e}"
        )
    return "\n".join(lines)


def commands(study: ho.Study, chosen: list[int], changes: list[str], rate: float, at_a_time: int) -> str:
    """Speed of a study against a command for each of some of its points."""

    def command(entries: dict[str, Any]) -> None:
        said = [word for entry in (*changes, *(f"{k}={v!r}" for k, v in entries.items())) for word in ("--set", entry)]
        with tempfile.TemporaryDirectory() as folder:
            quick = ["--processes", str(PROCESSES // at_a_time), "--no-control", "--no-figures", "--json"]
            line = [sys.executable, "-m", "hopopt", "solve", "paper", *said, *quick, "--results", folder]
            subprocess.run(line, stdout=subprocess.DEVNULL, check=True)

    began = time.perf_counter()
    Parallel(n_jobs=at_a_time, prefer="threads")(delayed(command)(dict(study.points[k].values)) for k in chosen)
    each = (time.perf_counter() - began) / len(chosen)
    return f"commands, {at_a_time} at a time: {each:.2f} s a point: the study is {each / rate:.2f} times as fast"


def main() -> None:
    """Measure and print."""
    count, changes = int((sys.argv[1:] or ["12"])[0]), sys.argv[2:]
    with tempfile.TemporaryDirectory() as folder:
        began = time.perf_counter()
        study = ho.sweep(ho.load("paper", changes), GRID, processes=PROCESSES, results=folder)
        seconds = time.perf_counter() - began
    possible = [p.index for p in study.points if p.outcome != IMPOSSIBLE]
    verified = sum(p.verified for p in study.points)
    rate = seconds / len(possible)
    print(
        f"study: {len(study.points)} points, {len(possible)} possible, {verified} verified, {study.corrected} corrected"
    )
    print(f"{seconds:.1f} s on {PROCESSES} processes, {rate:.2f} s a possible point", flush=True)
    for p in study.failures:
        if p.outcome != IMPOSSIBLE:
            print(f"  {p.index:3d} {p.outcome}: {p.sentence}")
    chosen = sorted(np.random.default_rng(0).choice(possible, min(count, len(possible)), replace=False).tolist())
    for starts in (None, 1):
        print(compare(study, chosen, changes, starts, rate), flush=True)
    for at_a_time in (PROCESSES, 1):
        print(commands(study, chosen, changes, rate, at_a_time), flush=True)


if __name__ == "__main__":
    main()
