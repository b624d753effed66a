"""Strategies on legs that differ from the believed one: seeded draws, and what a share of them reaches."""

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.special import bdtrc  # the binomial's survival function; scipy.stats takes a third of a second to import

from hopopt.amounts import check
from hopopt.comparison.compare import TUNED_PD, Comparison, chosen_names, compare, on_ideal_ground
from hopopt.control.closed_loop import make_controller, simulate
from hopopt.control.reference import PlanReference
from hopopt.control.strategies import find
from hopopt.design import Design, Leg, Uncertainty, as_changed
from hopopt.drivetrain.gear import TABLE, efficiency_table, worse_table
from hopopt.errors import UsageError
from hopopt.extensions import carried
from hopopt.leg.closed_chains import PARTS, side_link_scaled
from hopopt.leg.inertia import scaled
from hopopt.leg.kinematics import start_angles
from hopopt.leg.scales import radians
from hopopt.planner.answer.extras import Attained, CanBeHad
from hopopt.planner.reserve import reference_of
from hopopt.planner.solution import Solution
from hopopt.sim.plant import PAST_APEX

FAILED_SHARE = 0.5  # of the clearance on the believed leg, below which a leg has failed
CHOOSING_DRAWS = 16  # legs on which one of several strategies is chosen: a promise is made on others
OTHER_LEGS = 1_000_003  # added to a seed for legs that have nothing in common with its own
SHARE, SURE = 0.95, 0.95  # of the legs that a comparison speaks of, and how surely if the draws are enough


@dataclass(frozen=True)
class Draw:
    """A true leg: its problem, torque constants over the believed ones (n), joint angles at the start (n) [rad]."""

    leg: Design
    torque_gain: np.ndarray
    start: np.ndarray


@dataclass(frozen=True)
class Drawing:
    """Numbers drawn uniformly, or one of both ends."""

    rng: np.random.Generator
    corners: bool

    def uniform(self, low: float = 0.0, high: float = 1.0, size: int | None = None) -> Any:
        """Between low and high; of that ``size``."""
        drawn = self.rng.uniform(low, high, size)
        return np.where(drawn < (low + high) / 2, low, high) if self.corners else drawn


def drawn(design: Design, spread: Uncertainty, draws: int, seed: int, corners: bool = False) -> list[Draw]:
    """So many true legs, every quantity uniform within its spread, independently; or with ``corners`` at one of its ends.

    Where a link's centre of mass and inertia are given, they go with its mass and length, as a rod's do that are not. What later entries draw comes from a sequence of its own: a spread that is added leaves masses and torques as they were.
    """
    check("draws", draws, 0)
    check("seed", seed, 0)
    rng, more, last, beside = (
        Drawing(np.random.default_rng(s), corners) for s in (seed, *((seed, k) for k in (1, 2, 3)))
    )
    found = list[Draw]()
    n = len(design.leg.joints)
    for _ in range(draws):
        data = design.model_dump(exclude_none=True)
        for name in ("body", *design.leg.links):
            data["leg"][name] |= scaled(data["leg"][name], mass=1 + spread.mass * rng.uniform(-1, 1))
        gain = 1 + spread.torque_constant * rng.uniform(-1, 1, n)
        for name in design.leg.links:
            data["leg"][name] |= scaled(data["leg"][name], length=1 + spread.length * more.uniform(-1, 1))
        if design.contact.friction is not None:
            data["contact"]["friction"] *= 1 + spread.friction * more.uniform(-1, 1)
        start = start_angles(design) + spread.start_angle * radians(design.leg) * more.uniform(-1, 1, n)
        data["simulation"]["speed_error"] += spread.speed_error * last.uniform(-1, 1)
        data["simulation"]["torque_delay"] += spread.torque_delay * more.uniform()
        for name in design.leg.joints:
            kept = design.leg.drive(name, "gear", "efficiency")[1] or design.simulation.gear_efficiency
            lost, table = spread.gear_loss * more.uniform(), efficiency_table(design.leg, name)
            worse = {TABLE: worse_table(table, lost).model_dump()} if table else {"efficiency": kept * (1 - lost)}
            if lost:
                data["leg"][name].setdefault("gear", {}).update(worse)
        for parts, part in _side_links(data, design.leg):
            parts |= side_link_scaled(parts, part, 1 + spread.mass * beside.uniform(-1, 1))
        found.append(Draw(_true_leg(data), gain, start))
    return found


def extremes(design: Design, spread: Uncertainty, share: float) -> list[Draw]:
    """Legs apart by a share of the spreads: the heaviest with the weakest motors, the lightest with the strongest, and for
    each joint the one whose motor alone is strong. All stand on the most slippery ground within that share."""
    n, mass, torque = len(design.leg.joints), share * spread.mass, share * spread.torque_constant
    alone = [(0.0, 2 * np.eye(n)[k] - 1) for k in range(n)] if n > 1 else []
    found = list[Draw]()
    for heavier, stronger in [(1.0, -np.ones(n)), (-1.0, np.ones(n)), *alone]:
        data = design.model_dump(exclude_none=True)
        for name in ("body", *design.leg.links):
            data["leg"][name] |= scaled(data["leg"][name], mass=1 + heavier * mass)
        for parts, part in _side_links(data, design.leg):
            parts |= side_link_scaled(parts, part, 1 + heavier * mass)
        if design.contact.friction is not None:
            data["contact"]["friction"] *= 1 - share * spread.friction
        found.append(Draw(_true_leg(data), 1 + torque * stronger, start_angles(design)))
    return found


def _side_links(data: Mapping[str, Any], leg: Leg) -> Iterator[tuple[dict[str, Any], str]]:
    """Cranks and rods of a problem's five-bars: the entries of each one's five-bar, and which of both it is."""
    for joint in leg.five_bars:
        for part in PARTS:
            yield data["leg"][joint]["transmission"]["five_bar"], part


def _true_leg(data: Mapping[str, Any]) -> Design:
    return as_changed(data, "[uncertainty] leads to", "give less of it")


@dataclass(frozen=True)
class Reached:
    """What a strategy reaches on draws: clearances (draws,) [m], and how each run ended, or why it was no hop."""

    clearances: np.ndarray
    outcomes: tuple[str, ...]

    @property
    def fell(self) -> int:
        """How many legs did not come past the apex of a hop: they struck the ground, folded, or never left it."""
        return sum(outcome != PAST_APEX for outcome in self.outcomes)

    def promised(self, share: float, confidence: float) -> float:
        """The clearance [m] that at least this share of all legs reaches, with this confidence: an order statistic."""
        return self.from_below(rank(len(self.clearances), share, confidence))

    def from_below(self, place: int) -> float:
        """The smallest clearance [m] but place - 1."""
        return float(np.sort(self.clearances)[place - 1])


def rank(draws: int, share: float, confidence: float) -> int:
    """Which smallest clearance of so many draws (1: the least) at least this share of all legs reaches, with this
    confidence, whatever their distribution (Wilks, 1941): the greatest k with P(at least k draws among the lowest
    1 - share) >= confidence. UsageError if no draw is low enough for that."""
    if not (0 < share < 1 and 0 < confidence < 1):
        raise UsageError(f"share {share:g}, confidence {confidence:g}: both lie between 0 and 1, such as 0.95")
    k = np.arange(1, draws + 1)
    enough = np.flatnonzero(bdtrc(k - 1, draws, 1 - share) >= confidence)
    if not len(enough):
        least = int(np.ceil(np.log(1 - confidence) / np.log(share)))
        raise UsageError(
            f"{draws} draws cannot promise what {share:.4g} of the legs reach with confidence {confidence:.4g}: "
            f"give at least {least} draws"
        )
    return int(k[enough[-1]])


def reached(
    design: Design,
    name: str,
    reference: PlanReference | None,
    draws: list[Draw],
    processes: int,
    options: Mapping[str, Any] | None = None,
) -> Reached:
    """What a strategy that believes in ``design`` reaches on every draw, side by side on the cores."""
    from joblib import Parallel, delayed

    data, chunks = design.model_dump(exclude_none=True), [draws[k::processes] for k in range(processes)]
    jobs = (delayed(carried(_reached))(data, name, reference, chunk, options) for chunk in chunks if chunk)
    parts: Any = Parallel(n_jobs=processes, backend="loky")(jobs)
    clearances, outcomes = np.empty(len(draws)), [""] * len(draws)
    for k, part in enumerate(parts):
        clearances[k::processes] = [clearance for clearance, _ in part]
        outcomes[k::processes] = [outcome for _, outcome in part]
    return Reached(clearances, tuple(outcomes))


def _reached(
    data: dict[str, Any],
    name: str,
    reference: PlanReference | None,
    draws: list[Draw],
    options: Mapping[str, Any] | None,
) -> list[tuple[float, str]]:
    design, strategy = Design.model_validate(data), find(name)
    fresh, found = make_controller(design, strategy, reference, options), []  # its gains take longer than a hop
    for draw in draws:
        run = simulate(
            design,
            strategy,
            plant=draw.leg,
            torque_gain=draw.torque_gain,
            start=draw.start,
            controller=deepcopy(fresh),
            past_apex=True,
        )
        found.append((run.figures.clearance, run.figures.no_hop or run.trace.outcome))
    return found


def spread(
    comparison: Comparison,
    draws: int,
    seed: int,
    uncertainty: Uncertainty,
    processes: int,
    say: Callable[[str], None] = lambda text: None,
    names: Collection[str] | None = None,
) -> dict[str, dict[str, Any]]:
    """How the compared strategies, or the named ones, fare on the same drawn legs; failed is below half of what one clears on
    the believed leg.

    ``reached_m``: what SHARE of all legs reach, with ``confidence``, of each strategy by itself.
    """
    found = dict[str, dict[str, Any]]()
    legs = drawn(comparison.solution.design, uncertainty, draws, seed)
    place, confidence = _lowest_that_counts(draws)
    for name in comparison.runs if names is None else names:
        run = comparison.runs[name]
        say(f"{name} on {draws} drawn legs")
        each = _run_on(comparison, name, legs, processes)
        heights, plan = each.clearances, comparison.plan if run.strategy.needs_plan else None
        levels = {"lowest_m": 0, "p05_m": 5, "median_m": 50, "p95_m": 95, "highest_m": 100}
        usual = run.figures.clearance if plan is None else plan.clearance
        found[name] = {
            "draws": draws,
            "mass": uncertainty.mass,
            "torque": uncertainty.torque_constant,
            "seed": seed,
            "failed": int(np.sum(heights < FAILED_SHARE * usual)),
            **{key: float(np.percentile(heights, level)) for key, level in levels.items()},
            "share": SHARE,
            "confidence": confidence,
            "reached_m": each.from_below(place),
            "clearances_m": heights.tolist(),
        }
    return found


def _lowest_that_counts(draws: int) -> tuple[int, float]:
    """Which smallest clearance SHARE of the legs reach, and with which confidence: SURE, or that of the lowest draw."""
    try:
        place = rank(draws, SHARE, SURE)
    except UsageError:
        place = 1
    return place, float(bdtrc(place - 1, draws, 1 - SHARE))


def _run_on(comparison: Comparison, name: str, legs: list[Draw], processes: int) -> Reached:
    """A compared strategy on legs."""
    strategy = comparison.runs[name].strategy
    reference = reference_of(comparison.plan) if strategy.needs_plan and comparison.plan else None
    return reached(comparison.solution.design, strategy.name, reference, legs, processes, strategy.options)


def surest(found: Mapping[str, Reached]) -> str:
    """The strategy whose lowest leg clears most. What it promises must be stated on other legs: on these it was chosen."""
    return max(found, key=lambda name: found[name].clearances.min())


def chosen(
    comparison: Comparison,
    seed: int,
    uncertainty: Uncertainty,
    processes: int,
    say: Callable[[str], None] = lambda text: None,
) -> list[str]:
    """The compared strategy that tracks a plan and the one that tracks none that are the surest, on legs drawn for this alone."""
    found = list[str]()
    for tracking in (True, False):
        names = [name for name, run in comparison.runs.items() if run.strategy.needs_plan == tracking]
        if len(names) > 1:
            say(f"choosing from {', '.join(names)} on {CHOOSING_DRAWS} other legs")
            legs = drawn(comparison.solution.design, uncertainty, CHOOSING_DRAWS, seed + OTHER_LEGS)
            names = [surest({name: _run_on(comparison, name, legs, processes) for name in names})]
        found += names
    return found


def four_numbers(
    comparison: Comparison, mismatch: Mapping[str, Mapping[str, Any]], names: Sequence[str], ideal: Solution
) -> CanBeHad:
    """What can be had: the bounds on ideal ground and on this one, and what SHARE of the drawn legs reach on this ground
    with the named tracker and PD strategy, as ``chosen`` finds them; mismatch as ``spread`` finds it."""

    def attained(tracking: bool) -> Attained | None:
        name = next((n for n in names if comparison.runs[n].strategy.needs_plan == tracking), None)
        return None if name is None else Attained(name, mismatch[name]["reached_m"])

    any_of = next(iter(mismatch.values()))
    on_ideal, here = (s.clearance if s.verified else None for s in (ideal, comparison.solution))
    of_legs = SHARE, any_of["confidence"], any_of["draws"], any_of["seed"]
    return CanBeHad(on_ideal, here, *of_legs, tracked=attained(True), pd=attained(False))


def can_be_had(
    solution: Solution,
    draws: int,
    seed: int = 0,
    processes: int = 1,
    say: Callable[[str], None] = lambda text: None,
) -> CanBeHad:
    """The same of a solved hop: its plan with [reserve] tracked in two ways, and the tuned PD strategies, on legs within the problem's
    [uncertainty]. Raises UsageError for a leg that is not simulated, or a hop that is no bound on clearance."""
    wanted, _ = chosen_names(solution.design, None)
    names = [name for name in wanted if name in ("track", *TUNED_PD)]
    names.insert(1, "track_mpc")
    found = compare(solution.design, names, bound=solution, progress=say)
    names = chosen(found, seed, solution.design.uncertainty, processes, say)
    mismatch = spread(found, draws, seed, solution.design.uncertainty, processes, say, names)
    return four_numbers(found, mismatch, names, on_ideal_ground(solution, say))
