"""What a stored answer states of controllers, simulated again."""

import os
from collections.abc import Iterator, Mapping
from typing import Any

from hopopt.comparison.paper_control import paper_strategy
from hopopt.comparison.robust.robustness import can_be_had
from hopopt.planner.solution import Solution
from hopopt.record import as_data
from hopopt.storage.stated_figures import difference
from hopopt.verify.check import Check

REPEATED = 1e-3  # relative: encoders round, so that other rounding of numbers can grow in a run


def control_check(solution: Solution) -> Iterator[Check]:
    """That the figures of controllers are those of a new simulation, if the answer states any."""
    s, clean = solution.summary, solution.noted(doubts=())
    if s.paper_strategy is not None:
        yield _same("the paper's control as simulated", "paper_strategy", s.paper_strategy, paper_strategy(clean))
    if (had := s.can_be_had) is not None:
        again = can_be_had(clean, had.draws, had.seed, os.cpu_count() or 1)
        yield _same("what can be had as simulated", "can_be_had", had, again)


def _same(name: str, entry: str, stated: Any, found: Any) -> Check:
    """The largest difference of an entry of the summary from what was found again."""
    was, now = _flat(as_data(stated)), _flat(as_data(found) or {})
    wrong = {key: difference(x, now.get(key)) for key, x in was.items()}
    worst = max(wrong, key=lambda key: wrong[key])
    return Check(name, wrong[worst], REPEATED, "relative", f"{entry}.{worst}")


def _flat(data: Mapping[str, Any]) -> dict[str, Any]:
    """Entries of entries by their keys with dots."""
    found = dict[str, Any]()
    for key, x in data.items():
        found |= {f"{key}.{k}": y for k, y in _flat(x).items()} if isinstance(x, Mapping) else {key: x}
    return found
