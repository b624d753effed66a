"""How fast the live page answers, and how near its first mesh is to a solve: one slider after another is dragged at random.

    python benchmarks/explore_drags.py [PROBLEM] [--drags 40] [--solved 4] [--entry leg.gear.ratio ...]

Every drag begins from the problem as it is. Times are of one process, and of its processor; of ``--solved`` designs the
answer of ``hopopt solve`` stands beside the page's.
"""

import argparse
import random
import resource
import time
from pathlib import Path

import numpy as np

from hopopt.live.bench import PRELIMINARY, Bench
from hopopt.live.desk import Desk
from hopopt.planner.solve import solve
from hopopt.problem.load import changed, load

ENTRIES = [
    "leg.gear.ratio", "leg.motor.max_torque", "leg.body.mass", "leg.shank.length", "contact.friction=0.3:1.0",
]  # fmt: skip


def resident() -> float:
    """Resident size of this process [MB], on Linux."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize() / 1e6


def main() -> None:
    """Drag, and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("problem", nargs="?", default="paper")
    parser.add_argument("--drags", type=int, default=40)
    parser.add_argument("--solved", type=int, default=4)
    parser.add_argument("--entry", nargs="*", default=ENTRIES)
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    design, rng = load(asked.problem), random.Random(asked.seed)
    bench = Bench(design, "clearance", asked.entry)
    began = time.process_time()
    sliders, _ = bench.begin(1)
    print(f"{asked.problem}: begun in {time.process_time() - began:.1f} s of processor time")
    own = {s.entry: s.value for s in sliders}
    bench.learn(own, *Desk(bench.design, "clearance", Path("results")).search(own))  # as the page does when hands rest
    walls, cpus, hops = (
        list[float](),
        list[float](),
        list[tuple[dict[str, float], float]](),
    )
    sizes = list[float]()
    for _ in range(asked.drags):
        s = rng.choice(sliders)
        values = own | {s.entry: s.checked(rng.uniform(s.low, s.high))}
        wall, cpu = time.perf_counter(), time.process_time()
        found = bench.at(values)
        walls.append(time.perf_counter() - wall)
        cpus.append(time.process_time() - cpu)
        sizes.append(resident())
        if found.outcome == PRELIMINARY and found.value is not None:
            hops.append((values, found.value))
    for name, times in (("wall", walls), ("processor", cpus)):
        print(
            f"{asked.drags} drags, {name} time: median {np.median(times):.2f} s, 95 % within {np.quantile(times, 0.95):.2f} s"
        )
    print(f"{len(hops)} have a hop")
    print(
        f"resident size: {sizes[(len(sizes) - 1) // 5]:.0f} MB after a fifth of the drags, {sizes[-1]:.0f} MB at the end"
    )
    for values, value in rng.sample(hops, min(asked.solved, len(hops))):
        answer = solve(changed(bench.design, values), processes=1)
        told = ", ".join(f"{entry} {x:.4g}" for entry, x in values.items() if x != own[entry])
        state = "verified" if answer.verified else "NOT verified"
        print(
            f"{told}: page {value:.4f} m, solve {answer.clearance:.4f} m ({state}), {value / answer.clearance - 1:+.2%}"
        )


if __name__ == "__main__":
    main()
