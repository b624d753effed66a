"""The comparison of strategies that hop on and on, as the command compare makes it of a periodic hop."""

import os
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from hopopt import amounts
from hopopt.cli.controllers.ladder import ladder_of
from hopopt.cli.options import progress

if TYPE_CHECKING:
    from hopopt.design import Design
    from hopopt.planner.solution import Solution


def compare_hops(
    design: "Design",
    names: Sequence[str] | None,
    bound: "Solution | None",
    hops: int,
    draws: int,
    seed: int,
    basins: bool,
    mujoco: bool,
    why: bool,
    results: Path,
    figures: bool,
    json_: bool,
) -> int:
    """Solve, hop on, save and print; the exit code."""
    began = time.perf_counter()
    amounts.check("hops", hops, 2)
    from hopopt.comparison.hops import hop_after_hop as studying
    from hopopt.comparison.robust.robustness import drawn
    from hopopt.plots.hops import save_all
    from hopopt.storage.folder import as_json
    from hopopt.storage.runs import save_runs
    from hopopt.storage.solution import save

    with progress(quiet=json_) as say:
        found = studying.compare_hops(
            design,
            names,
            hops=hops,
            bound=bound,
            draws=drawn(design, design.uncertainty, draws, seed),
            basins=basins,
            mujoco=mujoco,
            processes=os.cpu_count() or 1,
            progress=say,
        )
        data = found.as_dict() | {"seed": seed}
        steps = ladder_of(found, data, say) if why else None
        data["wall_s"] = time.perf_counter() - began
        traces = {name: figure.trace for name, figure in found.shown.items()}
        draw = (lambda folder: save_all(found, folder, steps)) if figures else None
        where = save_runs("hops", design, data, traces, results, draw)
        for solution in (found.solution, found.plan):
            if solution is not None and solution.result_dir is None:
                save(solution, where)
    if json_:
        print(as_json({**data, "result_dir": str(where)}))
        return found.exit_code
    from hopopt.cli.screen.hops import print_hops

    print_hops(data, f"{where}   ({data['wall_s']:.1f} s)")
    return found.exit_code
