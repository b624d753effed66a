"""From where a strategy comes back to the orbit that it settles on."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hopopt.comparison.hops.trials import Hops, HopsTrial, moved, reached_apex
from hopopt.control.closed_loop import make_controller
from hopopt.control.strategies import find
from hopopt.extensions import carried
from hopopt.leg.scales import Scale
from hopopt.sim.state import State

HIGHER = np.linspace(-0.15, 0.15, 7)  # [m on the paper's leg] starts of a basin
FASTER = np.linspace(-0.6, 0.6, 7)  # [m/s on the paper's leg]
BACK, NEAR = 4, 0.9  # hops after which a leg is back if it clears this share of what it keeps up


@dataclass(frozen=True)
class Basin:
    """From where a strategy still hops: starts at its orbit's apex, higher by ``higher`` (i) [m] and faster forward by
    ``faster`` (j) [m/s]; ``hops`` (i, j): whether it is back on its orbit after a few hops."""

    higher: np.ndarray
    faster: np.ndarray
    hops: np.ndarray

    def as_dict(self) -> dict[str, Any]:
        """For ``--json``."""
        return {"higher_m": self.higher.tolist(), "faster_m_s": self.faster.tolist(), "hops": self.hops.tolist()}


def back(trial: HopsTrial, kept: float, begin: Sequence[State]) -> list[bool]:
    """For each start whether the hops come back to the clearance that is kept up [m]."""
    fresh, found = make_controller(trial.design, find(trial.strategy), trial.reference), []
    for start in begin:
        on = Hops(trial.hop(BACK, start, fresh=fresh), BACK)
        found.append(not on.fell and float(on.clearances[-1]) >= NEAR * kept)
    return found


def basin(trial: HopsTrial, found: Hops, processes: int) -> Basin | None:
    """From where a strategy comes back to what it settled on; None if it fell."""
    if found.typical is None:
        return None
    scale, apex = Scale.of(trial.design.leg), reached_apex(found.typical)
    higher, faster = HIGHER * scale.length, FASTER * scale.time
    cells = [moved(apex, h, v) for h in higher for v in faster]
    parts = side_by_side(back, [(trial, found.kept, cells[k::processes]) for k in range(processes)])
    hops = np.zeros(len(cells), dtype=bool)
    for k, part in enumerate(parts):
        hops[k::processes] = part
    return Basin(higher, faster, hops.reshape(len(higher), len(faster)))


def side_by_side(function: Callable[..., Any], jobs: Sequence[tuple[Any, ...]]) -> list[Any]:
    """A function's values for jobs, on as many processes."""
    from joblib import Parallel, delayed

    return list(Parallel(n_jobs=len(jobs), backend="loky")(delayed(carried(function))(*job) for job in jobs))  # type: ignore[arg-type]
