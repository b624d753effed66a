"""What a stored answer states of the paper's control, simulated again."""

from collections.abc import Iterator

from hopopt.planner.solution import Solution
from hopopt.planner.summary_entry import as_data
from hopopt.storage.stated_figures import difference
from hopopt.studies.compare import paper_strategy
from hopopt.verify.check import Check

REPEATED = 1e-3  # relative: encoders round, so that other rounding of numbers can grow in a run


def control_check(solution: Solution) -> Iterator[Check]:
    """That the figures of the paper's control are those of a new simulation, if the answer states any."""
    if solution.summary.paper_strategy is not None:
        stated, found = (
            as_data(s) for s in (solution.summary.paper_strategy, paper_strategy(solution.noted(doubts=())))
        )
        wrong = {key: difference(x, (found or {}).get(key)) for key, x in stated.items()}
        worst = max(wrong, key=lambda key: wrong[key])
        where = f"paper_strategy.{worst}"
        yield Check("the paper's control as simulated", wrong[worst], REPEATED, "relative", where)
