"""Whether the exported tracker in C reaches what ``hopopt robust`` promises: compiled, and run against the plant.

    python benchmarks/robust_in_c.py FOLDER [FOLDER ...]

Each FOLDER is one of ``hopopt robust``. Its plan and tracker are exported in C, compiled without a warning by gcc or cc, and
simulated on the legs that the promise is of: as many, drawn anew from its default seed. Prints promise, what the compiled tracker
reaches by the same rank, how many legs fell, and by how much a leg is off Python's. The exit status is 1 if a
promise is missed by more than 2 %.
"""

import json
import sys
import tempfile
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "tests"))

from hopopt.comparison.robust.robustness import OTHER_LEGS, Reached, drawn  # noqa: E402
from hopopt.comparison.robust.stored import read_robust  # noqa: E402
from hopopt.control.closed_loop import simulate  # noqa: E402
from hopopt.control.strategies import find  # noqa: E402
from hopopt.export.tracker_c import constants_bytes, to_c  # noqa: E402
from hopopt.planner.reserve import TrackedPlan  # noqa: E402
from tracker_in_c import compiled  # noqa: E402

MISSED = 0.02  # share of a promise that the compiled tracker may miss


def row(folder: Path, built: Path) -> tuple[str, bool]:
    """A line of the table, and whether the promise is kept."""
    data, best = json.loads((folder / "robust.json").read_text(encoding="utf-8")), read_robust(folder).best
    code = to_c(TrackedPlan(best.plan, best.reference))
    make, strategy = compiled(built, code, "-Wdouble-promotion"), find("track")
    legs = drawn(best.design, best.design.uncertainty, data["draws"], OTHER_LEGS)  # of the default seed, 0
    runs = [
        simulate(
            best.design, strategy, plant=leg.leg, torque_gain=leg.torque_gain, start=leg.start, controller=make(), past_apex=True
        )
        for leg in legs
    ]  # fmt: skip
    found = Reached(
        np.array([run.figures.clearance for run in runs]),
        tuple(run.figures.no_hop or run.trace.outcome for run in runs),
    )
    reaches, promise = found.promised(data["share"], data["confidence"]), data["clearance_m"]
    off = float(np.abs(found.clearances - np.array(data["clearances_m"]["track"])).max())
    cells = data["problem"], data["draws"], f"{promise:.4f}", f"{reaches:.4f}", found.fell, f"{1e3 * off:.1f}"
    size = f"{constants_bytes(code) / 1e3:.0f}"
    return "| " + " | ".join(map(str, (*cells, size))) + " |", bool(reaches >= (1 - MISSED) * promise)


def main() -> int:
    """Compile, simulate, and print."""
    kept = []
    print(
        "| leg | draws | promise [m] | in C [m] | fell | off Python by [mm] | constants [kB] |\n|---|---|---|---|---|---|---|"
    )
    for folder in map(Path, sys.argv[1:]):
        with tempfile.TemporaryDirectory() as built:
            text, well = row(folder, Path(built))
        print(text, flush=True)
        kept.append(well)
    return int(not all(kept))


if __name__ == "__main__":
    sys.exit(main())
