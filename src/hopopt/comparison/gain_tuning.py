"""How high the paper's PD strategies hop with the best gains: tuned by differential evolution on the simulator.

A hop counts with its clearance, less LIMIT_PENALTY for every limit of the problem that it does not keep: an end stop that is
hit softly is no reason to throw a hop away, but no reason to prefer it either. Among the first gains that are tried are
those of the strategy untuned: the problem's [control], or the printed ones scaled to the leg. Each is tried with every
kind of push and retraction, so the answer is never worse than they are.
"""

import itertools
import os
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any

import numpy as np
from joblib import Parallel, delayed
from scipy.optimize import differential_evolution
from scipy.stats import qmc

from hopopt.amounts import check
from hopopt.control.closed_loop import make_controller, simulate
from hopopt.control.paper_options import PaperOptions
from hopopt.control.similarity import Size, factors
from hopopt.control.strategies import BEST, BUILT_IN
from hopopt.design import Design, refuse_landed
from hopopt.errors import UsageError
from hopopt.extensions import carried
from hopopt.sim.hop_metrics import HopFigures

LIMIT_PENALTY = 0.05  # [m] on the paper's leg that a hop counts less for every limit it does not keep
GAINS = {
    "k_p": (100.0, 20000.0),
    "k_d": (1.0, 200.0),
    "k_s": (600.0, 6000.0),
}  # bounds on the paper's leg, scaled alike
STRATEGY_CHOICES = {  # what else each strategy may choose
    "force": {"retraction": ("reference", "tuck"), "stance": ("reference", "step")},
    "position": {"retraction": ("reference", "tuck")},
}
FACTOR = 1.5  # of a gain from one hop to the next about the untuned ones
POPULATION = 12  # trials in each generation
NEARBY_MOTORS = 0.02  # motors so much weaker or stronger show whether a clearance is a lucky one


@dataclass(frozen=True)
class GainTrial:
    """Options of a strategy and what its hop came to: clearance [m], limits not kept, and the penalty for each [m]."""

    options: dict[str, Any]
    clearance: float
    limits_exceeded: tuple[str, ...]
    price: float = LIMIT_PENALTY

    @property
    def penalised_clearance(self) -> float:
        """Clearance less a penalty for the limits that were not kept [m]."""
        return self.clearance - self.price * len(self.limits_exceeded)


@dataclass(frozen=True)
class Nearby:
    """A strategy's best trial of a few, beside that of the tuck it began from."""

    strategy: str
    best: GainTrial
    untuned: GainTrial
    evaluations: int

    @property
    def found(self) -> str:
        """What was found, in a sentence."""
        gains = ", ".join(f"{name} {self.best.options[name]:.4g}" for name in GAINS)
        return (
            f"{self.strategy}_tuned: {self.best.clearance:.3f} m with {gains}, best of {self.evaluations} hops from {self.strategy}_tuck, "
            f"{self.untuned.clearance:.3f} m; --tune 60 looks further"
        )


@dataclass(frozen=True)
class Tuned:
    """A strategy's best trial beside that of its untuned gains, and how many hops were simulated to find it.

    nearby is the clearance [m] of the best with motors NEARBY_MOTORS weaker and stronger than it believes: heights of these
    strategies jump where the leg swings once more in flight, and a search finds such heights first.
    """

    strategy: str
    best: GainTrial
    untuned: GainTrial
    nearby: tuple[float, float]
    evaluations: int

    @property
    def found(self) -> str:
        """What the search found, in a sentence."""
        start = f"untuned {self.untuned.clearance:.3f} m{_limits(self.untuned)}"
        if self.best.penalised_clearance <= self.untuned.penalised_clearance:
            return f"{self.strategy}: nothing better than the untuned gains in {self.evaluations} hops; {start}"
        gains = ", ".join(f"{k} {v:.4g}" if isinstance(v, float) else f"{k} {v}" for k, v in self.best.options.items())
        best = f"{self.best.clearance:.3f} m{_limits(self.best)} with {gains}"
        return f"{self.strategy}: {best} ({self.evaluations} hops tried); {start}"

    def as_dict(self) -> dict[str, Any]:
        """Everything in numbers, for ``--json``."""
        return {**asdict(self), "price_of_a_limit_m": self.best.price}


def tune(
    design: Design,
    strategy: str,
    *,
    evaluations: int = 60,
    seed: int = 0,
    processes: int | None = None,
    progress: Callable[[str], None] | None = None,
) -> Tuned:
    """The best options of ``force`` or ``position`` among about ``evaluations`` simulated hops, the same for the same
    seed. Raises UsageError as ``check_search`` does."""
    check_search(design, [strategy], evaluations, seed)
    search, say = GainSearch(design.model_dump(exclude_none=True), strategy), progress or (lambda line: None)
    say(f"{strategy}: simulating {evaluations} hops")
    with Parallel(n_jobs=processes or os.cpu_count() or 1, backend="loky") as run:

        def side_by_side(function: Any, places: Any) -> Any:
            return run(delayed(carried(function))(x) for x in places)

        found = differential_evolution(
            search.cost, search.bounds, init=search.first(seed), rng=seed, integrality=search.discrete,  # type: ignore
            maxiter=evaluations // POPULATION - 1, tol=0.0, polish=False, updating="deferred", workers=side_by_side,  # type: ignore
            callback=lambda intermediate_result: say(f"{strategy}: best so far counts {-intermediate_result.fun:.3f} m"),
        )  # fmt: skip
        gains = np.array([1 - NEARBY_MOTORS, 1 + NEARBY_MOTORS])
        best, untuned = search.options(found.x), search.options(search.untuned()[0])
        jobs = [(best, 1.0), (untuned, 1.0), *((best, gain) for gain in gains)]
        hops: Any = run(delayed(carried(search.trial))(*job) for job in jobs)
    return Tuned(strategy, hops[0], hops[1], (hops[2].clearance, hops[3].clearance), int(found.nfev))


def tuned_nearby(design: Design, strategy: str) -> Nearby:
    """The best of a few hops about the tuck's own gains: those of the paper's leg that were tuned there, scaled, then one gain after
    another by a factor, up or down. Never lower than the tuck, nor less within the limits. Raises UsageError as ``check_search``
    does."""
    check_search(design, [strategy], 2 * POPULATION, 0)
    search, tuck = GainSearch(design.model_dump(exclude_none=True), strategy), {"retraction": "tuck"}
    on_papers = PaperOptions.of(design, BEST[strategy])
    untuned = search.trial({**search.gains, **tuck})
    tried = [untuned, search.trial({**{name: getattr(on_papers, name) for name in GAINS}, **tuck})]
    best = max(tried, key=_within_limits_first)
    for name in GAINS:
        for factor in (FACTOR, 1 / FACTOR):
            tried.append(search.trial({**best.options, name: best.options[name] * factor}))
            if _within_limits_first(tried[-1]) > _within_limits_first(best):
                best = tried[-1]
                break
    return Nearby(strategy, best, untuned, len(tried))


def _within_limits_first(trial: GainTrial) -> tuple[bool, float]:
    return not trial.limits_exceeded and trial.clearance > 0, trial.clearance


def check_search(design: Design, strategies: Sequence[str], evaluations: int, seed: int) -> None:
    """UsageError for no strategy or one without gains to tune, too few evaluations, or a leg that they do not suit."""
    refuse_landed(design, "tuning of gains")
    for strategy in strategies or [""]:
        if strategy not in STRATEGY_CHOICES:
            raise UsageError(f"strategy {strategy!r} has no gains to tune: choose {' or '.join(STRATEGY_CHOICES)}")
    if evaluations < 2 * POPULATION:
        raise UsageError(f"tuning takes at least {2 * POPULATION} evaluations")
    check("seed", seed, 0)
    for strategy in strategies:
        make_controller(design, BUILT_IN[strategy])
        gains = GainSearch(design.model_dump(exclude_none=True), strategy).gains
        if nothing := [name for name, gain in gains.items() if gain <= 0]:
            raise UsageError(
                f"control.{nothing[0]} = 0: gains are tuned by factors, so give more than 0, or leave it out"
            )


@dataclass(frozen=True)
class GainSearch:
    """The search space of a strategy: logarithms of the gains, then a number for each kind of push and retraction."""

    problem: dict[str, Any]
    strategy: str

    @property
    def kinds(self) -> dict[str, tuple[str, ...]]:
        """Choices by option."""
        return STRATEGY_CHOICES[self.strategy]

    @cached_property
    def design(self) -> Design:
        """The problem."""
        return Design.model_validate(self.problem)

    @cached_property
    def gains(self) -> dict[str, float]:
        """The untuned gains of this leg."""
        own = PaperOptions.of(self.design, {})
        return {name: getattr(own, name) for name in GAINS}

    @cached_property
    def bounds(self) -> list[tuple[float, float]]:
        """Of every coordinate; gains that the problem gives lie within them."""
        found, by = [], factors(Size.of(self.design))
        for name, (lower, upper) in GAINS.items():
            lower, upper, own = by[name] * lower, by[name] * upper, self.gains[name]
            found.append((float(np.log(min(lower, own))), float(np.log(max(upper, own)))))
        return [*found, *((0, len(c) - 1) for c in self.kinds.values())]

    @property
    def discrete(self) -> np.ndarray:
        """Which coordinates are whole numbers."""
        return np.array([False] * len(GAINS) + [True] * len(self.kinds))

    def options(self, x: np.ndarray) -> dict[str, Any]:
        """The strategy's options at a point."""
        gains = dict(zip(GAINS, np.exp(x[: len(GAINS)]).tolist(), strict=True))
        choices = zip(self.kinds.items(), x[len(GAINS) :], strict=True)
        return gains | {name: among[round(k)] for (name, among), k in choices}

    def untuned(self) -> np.ndarray:
        """The untuned gains with every combination of kinds, the paper's own first; a row each."""
        gains = [np.log(self.gains[name]) for name in GAINS]
        return np.array([[*gains, *kind] for kind in itertools.product(*(range(len(c)) for c in self.kinds.values()))])

    def first(self, seed: int) -> np.ndarray:
        """The first generation: the untuned gains, and others spread out evenly."""
        untuned, (lower, upper) = self.untuned(), np.array(self.bounds).T
        spread = qmc.LatinHypercube(len(lower), rng=seed).random(POPULATION - len(untuned))
        return np.vstack([untuned, lower + spread * (upper - lower)])

    def trial(self, options: dict[str, Any], torque_gain: float = 1.0) -> GainTrial:
        """A hop with these options, its motors as strong as believed times torque_gain."""
        design = self.design
        gains = np.full(len(design.leg.joints), torque_gain)
        hop: HopFigures = simulate(
            design, BUILT_IN[self.strategy], options=options, torque_gain=gains, past_apex=True
        ).figures
        clearance = 0.0 if hop.no_hop else hop.clearance
        return GainTrial(options, clearance, tuple(hop.limits_exceeded), LIMIT_PENALTY * hop.scale.length)

    def cost(self, x: np.ndarray) -> float:
        """What the search makes small: minus the clearance less its penalties [m]."""
        return -self.trial(self.options(x)).penalised_clearance


def text(tuned: Sequence[Tuned]) -> str:
    """What the screen shows, in plain lines."""
    lines = []
    for t in tuned:
        around = f"{t.nearby[0]:.3f} and {t.nearby[1]:.3f} m"
        lines += [t.found, f"  the best with motors {NEARBY_MOTORS:.0%} weaker and stronger: {around}"]
    return "\n".join([*lines, f"every limit not kept counted as {tuned[0].best.price:g} m less"])


def _limits(trial: GainTrial) -> str:
    return f" ({'; '.join(trial.limits_exceeded)})" if trial.limits_exceeded else ""
