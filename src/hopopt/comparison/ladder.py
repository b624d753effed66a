"""Why PD control is lower than the optimum: a ladder of verified optima, each with one more freedom that PD lacks.

The first rung has the freedoms of the simulated PD hop alone, measured on it: it pushes no longer, the body leaves the
foot's plumb line no further and never descends, the foot needs no more friction, the leg is drawn up no further. So PD's
own hop is one of those that it chooses from. Every further rung lifts one of these, and the last is the bound.
Hop after hop it is the hop on which PD settles: it moves no faster than that and lands no harder.
Gains overlap: what one freedom brings depends on those before it, so they are measured in several orders.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np

from hopopt.comparison.compare import Comparison
from hopopt.comparison.hops.hop_after_hop import HopsComparison
from hopopt.comparison.losses import Lifted, beyond_the_bound
from hopopt.design import Design
from hopopt.errors import UsageError
from hopopt.leg.kinematics import reach
from hopopt.leg.scales import Scale
from hopopt.nlp.deadline import NEVER, Deadline
from hopopt.ocp.custom import Custom, Moment, Terms
from hopopt.ocp.hop import Hop
from hopopt.planner.answer.motion_figures import NO_FRICTION
from hopopt.planner.search.from_known import solved_from_known
from hopopt.planner.solution import Solution
from hopopt.planner.solve import TIME_LIMIT, solve
from hopopt.problem.load import changed
from hopopt.sim.hop_metrics import HopFigures

CONTROL = "best control of the same freedoms"
PD_SLACK = 1e-3  # of what PD uses: room for its own hop
DESCENDS = 0.02  # [m/s] on the paper's leg of the body downwards in stance, below which it counts as not descending
STRAYS = 0.02  # [m/s] on the paper's leg, by which PD's mean speed may differ from what is asked, and count as that
RUNG_STARTS = 2  # of every rung
BELOW = 1e-5  # [m] on the paper's leg, by which a rung may be below another that has less


@dataclass(frozen=True)
class Freedom:
    """Something that PD does not have: what lifting it ``allows``, and how it is withheld, by entries of the problem or a
    path constraint.

    widens: whether lifting it leaves every hop possible that was so before; another speed does not.
    """

    allows: str
    entries: Mapping[str, Any] = field(default_factory=dict)
    constraints: tuple[Custom, ...] = ()
    widens: bool = True


@dataclass(frozen=True)
class Rung:
    """One rung: what it allows beyond the one below, its clearance [m], what that gains [m] here and over all orders, and
    whether it is verified."""

    allows: str
    clearance_m: float
    gain_m: float
    least_gain_m: float
    most_gain_m: float
    verified: bool


@dataclass(frozen=True)
class Ladder:
    """From a PD strategy to the bound.

    strategy: the PD strategy
    from_m: its clearance [m]
    rungs: verified optima with one more freedom each, in the first order
    orders: in which freedoms are lifted
    gains: of each order [m], that of better control first; each sums to the whole gap
    beyond: what collisions and losses of drives cost both, rungs above the bound; of a hop from rest
    missing: what the rung above those lifts, whose optimum was not found; empty where all were
    """

    strategy: str
    from_m: float
    rungs: tuple[Rung, ...]
    orders: tuple[tuple[str, ...], ...]
    gains: tuple[tuple[float, ...], ...]
    beyond: tuple[Lifted, ...] = ()
    missing: str = ""

    def __repr__(self) -> str:
        rungs = ", ".join(f"{r.allows} {r.clearance_m:.3f} m" for r in self.rungs)
        return f"<Ladder from {self.strategy} {self.from_m:.3f} m: {rungs}>"

    @property
    def verified(self) -> bool:
        """Whether every rung is."""
        return all(rung.verified for rung in self.rungs)

    def as_dict(self) -> dict[str, Any]:
        """Entries of the comparison's JSON."""
        pairs = zip(self.orders, self.gains, strict=True)
        return {
            "ladder": [vars(rung) for rung in self.rungs],
            "ladder_from": {"strategy": self.strategy, "clearance_m": self.from_m},
            "ladder_orders": [{"allows": list(order), "gains_m": list(gains)} for order, gains in pairs],
            "ladder_beyond": [vars(lifted) for lifted in self.beyond],
            "ladder_missing": self.missing or None,
        }


def ladder(
    comparison: Comparison | HopsComparison,
    say: Callable[[str], None] = lambda text: None,
    orders: int = 3,
    until: Deadline = NEVER,
) -> Ladder:
    """The ladder of a comparison, from its best PD strategy that keeps every limit.

    orders: in which freedoms are lifted, of which gains are told, 1 to 3. Raises UsageError if there is none or the bound is not verified, NotSolvedError if a rung is not solved.
    """
    if not comparison.solution.verified:
        raise UsageError("why PD is lower: the bound is not verified, so nothing is said of what is missing to it")
    name, figures = _best_pd(comparison)
    freedoms = list(withheld(figures))
    solved = _Rungs(comparison.solution, freedoms, say, until)
    names = tuple(f.allows for f in freedoms)
    chosen = tuple(dict.fromkeys(tuple(names[k] for k in order) for order in _orders(len(names))))[:orders]
    for k, order in enumerate(chosen):  # before any is read: one order may find a better hop for another
        if k and until.passed:
            chosen = chosen[:k]
            break
        solved.climb(order)
    climbed = [solved.along(order) for order in chosen]
    clearances = [[figures.clearance, *(s.clearance for s in rungs)] for rungs in climbed]
    gains = tuple(tuple(map(float, np.diff(heights))) for heights in clearances)
    beyond, missing = beyond_the_bound(comparison, name, say) if isinstance(comparison, Comparison) else ((), "")
    return Ladder(name, figures.clearance, tuple(_rungs(chosen, gains, climbed[0])), chosen, gains, beyond, missing)


def _rungs(
    orders: Sequence[tuple[str, ...]], gains: Sequence[tuple[float, ...]], first: Sequence[Solution]
) -> Iterator[Rung]:
    """The rungs of the first order, with the range of each one's gain over all."""
    for k, (what, s) in enumerate(zip((CONTROL, *orders[0]), first, strict=True)):
        each = [g[0 if k == 0 else 1 + order.index(what)] for order, g in zip(orders, gains, strict=True)]
        yield Rung(what, s.clearance, each[0], min(each), max(each), s.verified)


def _orders(count: int) -> Iterator[Sequence[int]]:
    """As stated, backwards, and from the middle."""
    stated = list(range(count))
    yield from (stated, stated[::-1], stated[count // 2 :] + stated[: count // 2])


def _best_pd(comparison: Comparison | HopsComparison) -> tuple[str, HopFigures]:
    """The highest strategy that follows no plan and keeps every limit."""
    own = {name: f for name, f in comparison.without_plan.items() if f.flies and not f.limits_exceeded}
    if not own:
        raise UsageError("why PD is lower: no PD strategy of this comparison hops within every limit")
    return max(own.items(), key=lambda pair: pair[1].clearance)


def withheld(f: HopFigures) -> Iterator[Freedom]:
    """The freedoms that a simulated hop did not use, each withheld as far as it did not."""
    trace, design, stance = f.trace, f.design, f.stance
    shortest, longest = design.hop.stance_duration
    lasted = (1 + PD_SLACK) * f.lift_off["time_s"]
    if shortest < lasted < longest:
        yield Freedom("a longer stance", {"hop.stance_duration": [shortest, lasted]})
    if design.hop.counter_movement and trace.v[stance, 1].min() > -DESCENDS * f.scale.time:
        yield Freedom("a counter-movement", {"hop.counter_movement": False})
    size, hip = reach(design.leg), design.leg.joints[0]
    away = PD_SLACK * size + float(np.abs(trace.points[hip] - trace.points["foot"])[stance, 0].max())
    yield Freedom(
        "the body off the plumb line", constraints=(_limit("plumb line", _beside(hip), -away, away, "stance", size),)
    )
    if design.contact.friction is None and f.slip_ratio < NO_FRICTION:
        yield Freedom("more grip", {"contact.friction": float(f.slip_ratio)})
    if design.hop.periodic:
        yield from _of_a_cycle(f)
    end = f.flight.stop if design.hop.periodic else (f.highest or f.flight.start) + 1
    flight = slice(f.flight.start, end)
    drawn_up = float(np.linalg.norm(trace.points[hip] - trace.points["foot"], axis=1)[flight].min())
    yield Freedom(
        "the leg drawn up fully",
        constraints=(_limit("leg length", _length(hip), (1 - PD_SLACK) * drawn_up, np.inf, "flight", size),),
    )


def _of_a_cycle(f: HopFigures) -> Iterator[Freedom]:
    """How hard PD lands, and how fast it moves along the ground hop after hop, which no rung but the last need do alike."""
    trace, hop = f.trace, f.design.hop
    lost = (1 + PD_SLACK) * float(sum(event.lost for event in trace.events))
    if lost < (hop.touchdown_loss or np.inf):
        yield Freedom("a harder landing", {"hop.touchdown_loss": lost})
    speed = float((trace.q[-1, 0] - trace.q[0, 0]) / (trace.t[-1] - trace.t[0]))
    if abs(speed - hop.speed) > STRAYS * f.scale.time:
        yield Freedom(
            "no drift" if hop.speed == 0 else "the speed that is asked for", {"hop.speed": speed}, widens=False
        )


def _limit(name: str, value: Callable[[Moment], ca.SX], lower: float, upper: float, phase: str, size: float) -> Custom:
    return Custom(f"ladder:{name}", value, Terms("m", lower=lower, upper=upper, scale=size, phases=(phase,)))


def _beside(hip: str) -> Callable[[Moment], ca.SX]:
    """How far the hip is ahead of the foot [m]."""
    return lambda now: now.points[hip][0] - now.points["foot"][0]


def _length(hip: str) -> Callable[[Moment], ca.SX]:
    """Distance of the foot from the hip [m]."""
    return lambda now: ca.norm_2(now.points[hip] - now.points["foot"])


class _Rungs:
    """Verified optima with some of the freedoms, each solved once."""

    def __init__(self, bound: Solution, freedoms: Sequence[Freedom], say: Callable[[str], None], until: Deadline):
        self.bound, self.freedoms, self.say, self.until = bound, freedoms, say, until
        self.known: dict[frozenset[str], Solution] = {frozenset(f.allows for f in freedoms): bound}

    def along(self, order: Sequence[str]) -> list[Solution]:
        """Those known with none of the freedoms, and with one more at a time in this order."""
        return [self.known[frozenset(order[:k])] for k in range(len(order) + 1)]

    def climb(self, order: Sequence[str]) -> None:
        """Solve what is not known along an order, each no lower than the one that has fewer freedoms."""
        below, widens = None, {f.allows: f.widens for f in self.freedoms}
        for k in range(len(order) + 1):
            below = self._with_freedoms(frozenset(order[:k]), below if k and widens[order[k - 1]] else None)

    def _with_freedoms(self, allowed: frozenset[str], below: Solution | None) -> Solution:
        if allowed not in self.known:
            which = f"ladder: optimum {len(self.known) + 1}"
            self.say(f"{which}, with {', '.join(sorted(allowed)) or CONTROL}")
            design, constraints = self._problem(allowed)
            left = min(TIME_LIMIT, self.until.seconds_left)
            self.known[allowed] = solve(
                design, constraints=constraints, starts=RUNG_STARTS, time_limit=left,
                progress=lambda text: self.say(f"{which}: {text}"),
            )  # fmt: skip
        found = self.known[allowed]
        if below is not None and found.clearance < below.clearance - BELOW * Scale.of(self.bound.design.leg).length:
            self.say(f"ladder: once more from the hop below, {below.clearance:.4f} m")
            design, constraints = self._problem(allowed)
            again = solved_from_known(Hop(design, constraints=constraints), below, self.say, NEVER.within(TIME_LIMIT))
            if again.verified and again.clearance > found.clearance:
                self.known[allowed] = again
        return self.known[allowed]

    def _problem(self, allowed: frozenset[str]) -> tuple[Design, tuple[Custom, ...]]:
        kept = [f for f in self.freedoms if f.allows not in allowed]
        entries = {name: value for f in kept for name, value in f.entries.items()}
        return changed(self.bound.design, entries), tuple(c for f in kept for c in f.constraints)
