"""What PD control reaches on public robots: plain, drawn up, tuned and with a counter-movement, beside the bound.

    python benchmarks/pd_on_legs.py [FOLDER] [ROBOTS]

FOLDER (public_legs) holds the answers of ``benchmarks/public_legs.py``, which is run first for a robot without one; ROBOTS
are some of its legs (separated by commas), without it all that are verified. Each robot is simulated under the paper's force
control, the same with the leg drawn up, that tuned on this leg, and the counter-movement. Prints a table, and beneath it what
holds each robot's best row down. The exit status is 1 if a row is lower than the one it began from by more than 1 mm on the
paper's leg, or within fewer limits.
"""

import sys
import time
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

from public_legs import LEGS, answer

import hopopt as ho
from hopopt.comparison.compare import tuned
from hopopt.control.closed_loop import Run, simulate
from hopopt.control.strategies import find
from hopopt.design import Design
from hopopt.leg.scales import Scale

ORDER = ("force", "force_tuck", "force_tuned")
ROWS = (*ORDER, "counter_movement")
LOWER = 1e-3  # [m] on the paper's leg, by which a row may be lower than the one it began from
SECONDS = 60.0  # of a solve


def runs(design: Design) -> dict[str, Run]:
    """Name of a row -> its run, up to the apex."""
    strategies = {name: find(name) for name in ROWS} | {"force_tuned": tuned(design, "force", 0, lambda text: None)[0]}
    return {name: simulate(design, strategies[name], past_apex=True) for name in ROWS}


def height(run: Run) -> float:
    """Clearance [m] within every limit; 0 where there is none."""
    return 0.0 if run.figures.no_hop or run.figures.limits_exceeded else run.figures.clearance


def out_of_order(design: Design, found: dict[str, Run]) -> list[str]:
    """Rows that are lower than the one before them, in words."""
    slack = LOWER * Scale.of(design.leg).length
    return [f"{b} below {a}" for a, b in pairwise(ORDER) if height(found[b]) < height(found[a]) - slack]


def cell(run: Run) -> str:
    """A row's clearance [m], and the first limit that it did not keep."""
    faults = [fault for fault in (run.figures.no_hop, *run.figures.limits_exceeded) if fault]
    return ", ".join([f"{run.figures.clearance:.3f}", *faults[:1]])


def words(name: str, found: dict[str, Run], bound: float | None) -> Iterator[str]:
    """Why each row is where it is, a line each."""
    for row, run in found.items():
        share = f" ({height(run) / bound:.0%} of the bound)" if bound else ""
        yield f"- {name}, {row}{share}: {run.limited_by or run.figures.no_hop}"


def main() -> int:
    """Simulate, and print."""
    given = sys.argv[1:]
    folder, faults, said = Path(given[0] if given else "public_legs"), list[str](), list[str]()
    print("| robot | bound [m] |" + "".join(f" `{name}` |" for name in ROWS) + " s |")
    print("|---|---|" + "---|" * (len(ROWS) + 1))
    for name in given[1].split(",") if len(given) > 1 else LEGS:
        found: dict[str, Any] = answer(name, folder, SECONDS)
        bound = found["clearance_m"] if found.get("verified") else None
        if bound is None and len(given) < 2:
            continue
        design, began = ho.load(folder / f"{name}.toml"), time.process_time()
        rows = runs(design)
        cells = [name, f"{bound:.3f}" if bound else "", *map(cell, rows.values()), f"{time.process_time() - began:.0f}"]
        print(f"| {' | '.join(cells)} |", flush=True)
        faults += [f"{name}: {fault}" for fault in out_of_order(design, rows)]
        said += words(name, rows, bound)
    print("", *said, "", *faults, sep="\n")
    return int(bool(faults))


if __name__ == "__main__":
    sys.exit(main())
