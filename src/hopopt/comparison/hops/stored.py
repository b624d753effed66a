"""Comparisons hop after hop and transitions in their folders, and read as what they were.

Of every strategy one whole hop is kept, its typical one, and the figures of all.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from hopopt.comparison.compare import planned_trace
from hopopt.comparison.hops.basin import Basin
from hopopt.comparison.hops.hop_after_hop import HopsComparison
from hopopt.comparison.hops.return_map import Multipliers
from hopopt.comparison.hops.transition import Transition
from hopopt.comparison.hops.trials import Hops
from hopopt.comparison.stored import stored_run
from hopopt.planner.checks.verdict import Verdict
from hopopt.planner.several_hops import HopsPlan
from hopopt.record import as_data
from hopopt.sim.hop_metrics import HopFigures
from hopopt.sim.hop_sequence import BOUNCED
from hopopt.storage.motions import read_motions, write_motions
from hopopt.storage.runs import read_data, read_runs, required_hop, save_runs, stored_hop
from hopopt.verify.check import Check

Figures = Callable[[Path], Any]
KIND, WAY = "hops", "transition"


@dataclass(frozen=True)
class StoredHops(Hops):
    """Many hops of a strategy as they were stored: ``each`` is the one that was kept whole, if there was one.

    row: what is stated of all of them
    """

    row: Mapping[str, Any] = field(default_factory=dict)

    @cached_property
    def clearances(self) -> np.ndarray:
        """Of every whole hop (k,) [m]."""
        return np.array(self.row["clearances_m"], dtype=float)

    @cached_property
    def each(self) -> tuple[HopFigures, ...]:
        """The figures of the hop that was kept whole."""
        return (HopFigures(self.run.design, self.run.trace, BOUNCED),) if len(self.clearances) else ()

    @property
    def fell(self) -> str:
        """How the run ended before all hops were done, in words; else empty."""
        return str(self.row["fell"])

    @property
    def settled(self) -> tuple[HopFigures, ...]:
        """The hop that was kept whole; none if the leg fell."""
        return () if self.fell else self.each

    @property
    def kept(self) -> float:
        """The clearance that is kept up [m]; 0 if the leg fell."""
        return float(self.row["kept_m"])

    @property
    def drift(self) -> float:
        """How far the body moves along the ground in a hop, on average [m]."""
        return float(self.row["drift_m_per_hop"])


def save_hops(
    found: HopsComparison, results: Path, data: Mapping[str, Any] | None = None, figures: Figures | None = None
) -> Path:
    """Write a comparison hop after hop into a new folder below ``results``, the folder; data and figures as of a comparison."""
    traces = {name: f.trace for name, f in found.shown.items()}
    hops = {"bound": found.solution, "plan": found.plan}
    return save_runs(KIND, found.solution.design, data or found.as_dict(), traces, results, figures, hops)


def read_hops(folder: Path) -> HopsComparison:
    """The comparison hop after hop in a folder; ResultError if files are missing or broken."""
    stored = read_runs(folder, KIND)
    rows, asked = stored.data["strategies"], int(stored.data["hops"])
    hops = {
        name: StoredHops(stored_run(stored, name, row), asked, _stability(row["stability"]), row)
        for name, row in rows.items()
    }
    basins = {name: _basin(row["basin"]) for name, row in rows.items() if row["basin"]}
    mujoco = {name: row["mujoco_clearances_m"] for name, row in rows.items() if row["mujoco_clearances_m"] is not None}
    bound, offset = replace(required_hop(folder, "bound"), design=stored.design), float(stored.data["start_offset_m"])
    return HopsComparison(
        bound, stored_hop(folder, "plan"), hops, asked, offset, {}, basins, mujoco, tuple(stored.data["notes"]), rows
    )


def _stability(row: Mapping[str, Any] | None) -> Multipliers | None:
    if row is None:
        return None
    return Multipliers(tuple(complex(*pair) for pair in row["multipliers"]), row["error"], row["closure"])


def _basin(row: Mapping[str, Any]) -> Basin:
    return Basin(*(np.array(row[key]) for key in ("higher_m", "faster_m_s", "hops")))


# ---- transitions --------------------------------------------------------------------------------------------------


def save_transition(
    found: Transition, results: Path, data: Mapping[str, Any] | None = None, figures: Figures | None = None
) -> Path:
    """Write a transition into a new folder below ``results``, the folder; data and figures as of a comparison."""
    named = {f"hop_{k}": hop for k, hop in enumerate(found.plan.hops, 1)}
    traces = {name: planned_trace(hop) for name, hop in named.items()}
    verdict = found.plan.verdict
    more = {
        "verification": [as_data(c) for c in verdict.checks],
        "conditions": [as_data(c) for c in verdict.conditions],
    }
    whole = {**(data or found.as_dict()), **more}
    folder = save_runs(WAY, found.design, whole, traces, results, figures, {"orbit": found.orbit, "begin": found.begin})
    write_motions(folder, named)
    return folder


def read_transition(folder: Path) -> Transition:
    """The transition in a folder; ResultError if files are missing or broken."""
    design, data = read_data(folder, WAY)
    checks, conditions = (tuple(_check(c) for c in data.get(key, ())) for key in ("verification", "conditions"))
    plan = HopsPlan(
        tuple(read_motions(folder, design).values()), float(data["effort_s"]), Verdict(checks, None, conditions)
    )
    return Transition(plan, required_hop(folder, "orbit"), stored_hop(folder, "begin"), tuple(data["fewer_hops"]))


def _check(row: Mapping[str, Any]) -> Check:
    given = {key: value for key, value in row.items() if key != "passed"}
    return Check(**{**given, "residual": float("inf") if row["residual"] is None else row["residual"]})
