"""Where the starts ended on the first mesh."""

from collections.abc import Sequence
from dataclasses import dataclass

from hopopt.planner.search.multistart import StartOutcome, grouped, same
from hopopt.record import Real, Strict, if_any, stated


@dataclass(frozen=True)
class Optimum(Strict):
    """One local optimum on the first mesh."""

    objective: Real = stated("[its unit]")
    count: int = stated("starts that ended there")
    starts: tuple[str, ...] = stated("their names")


@dataclass(frozen=True)
class StartEnded(Strict):
    """One start on the first mesh."""

    name: str = stated("of the start")
    status: str = stated("Ipopt's word")
    objective: Real = stated("[its unit]")
    iterations: int = stated("of Ipopt")
    seconds: float = stated("[s]")
    near: str | None = if_any("the start whose hop it was stopped near, and whose objective this is")


@dataclass(frozen=True)
class Starts(Strict):
    """Where the starts ended on the first mesh."""

    count: int = stated("how many were tried: they ended at a hop, were stopped near one, or failed")
    agreeing: int = stated("those that ended where the chosen one did, or were stopped near it")
    failed: tuple[str, ...] = stated("names of those without a hop")
    chosen: str = stated("the one whose hop this is")
    optima: tuple[Optimum, ...] = stated("the local optima, best first")
    each: tuple[StartEnded, ...] = stated("every start")
    asked: int | None = if_any("starting points among them; the others are relaxed problems, motions and known hops")
    ended: int | None = if_any("how many ended at a hop")
    stopped: tuple[str, ...] | None = if_any("names of those that were stopped near a hop that was known")
    apart: Real | None = if_any("two objectives closer than this count as one hop [its unit]")


def start_figures(
    outcomes: Sequence[StartOutcome], chosen: StartOutcome, asked: int | None = None, apart: float | None = None
) -> Starts:
    """How many starts ended where, on the first mesh; ``asked``: the starting points among them; ``apart``: as of ``grouped``."""

    def optimum(group: Sequence[StartOutcome]) -> Optimum:
        return Optimum(group[0].value, len(group), tuple(o.name for o in group))

    ranked = sorted(outcomes, key=lambda o: -o.signed_value)

    return Starts(
        count=len(outcomes),
        agreeing=sum(o.success and same(o.objective, chosen.objective, apart) for o in outcomes),
        failed=tuple(o.name for o in outcomes if not o.success),
        chosen=chosen.name,
        optima=tuple(optimum(group) for group in grouped(ranked, apart)),
        each=tuple(StartEnded(o.name, o.status, o.value, o.iterations, o.seconds, near=o.near) for o in outcomes),
        ended=sum(o.success and o.near is None for o in outcomes),
        stopped=tuple(o.name for o in outcomes if o.near is not None),
        asked=asked,
        apart=apart,
    )
