"""A strategy that hops on and on, on the believed leg, on drawn ones and in MuJoCo.

Strategies that track begin in flight at the apex of their plan, a little too high; the others from rest, as the paper's robot
does. Each hop is measured as the hop from rest is.
"""

from collections.abc import Sequence
from copy import deepcopy
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from hopopt.comparison.hops.return_map import Fallen, Multipliers, ReturnMap, multipliers, state_at_landing
from hopopt.comparison.robust.robustness import Draw
from hopopt.control.closed_loop import Run, highest_in, in_mujoco, make_controller, make_plant, simulate
from hopopt.control.reference import PlanReference
from hopopt.control.strategies import find
from hopopt.design import Design
from hopopt.errors import UsageError
from hopopt.leg.kinematics import start_angles
from hopopt.leg.scales import Scale
from hopopt.ocp.phases import FLIGHT
from hopopt.planner.solution import Solution
from hopopt.sim.controller import Controller
from hopopt.sim.hop_metrics import HopFigures
from hopopt.sim.hop_sequence import BOUNCED, hops_of, landings
from hopopt.sim.mujoco import library
from hopopt.sim.state import State

MOST_HOPS = 50  # of a run
DRAWN_HOPS = 20  # on drawn legs


@dataclass(frozen=True)
class Hops:
    """Many hops of a strategy on one leg.

    run: as it was simulated
    asked: how many hops
    stable: multipliers of its orbit; None where there is none
    """

    run: Run
    asked: int
    stable: Multipliers | None = None

    @cached_property
    def each(self) -> tuple[HopFigures, ...]:
        """The figures of every whole hop, from landing to landing."""
        hops = hops_of(self.run.trace)[: self.asked]
        return tuple(HopFigures(self.run.design, hop, BOUNCED, self.run.gain) for hop in hops)

    @cached_property
    def clearances(self) -> np.ndarray:
        """Of every whole hop (k,) [m]."""
        return np.array([hop.clearance for hop in self.each])

    @property
    def fell(self) -> str:
        """How the run ended before all hops were done, in words; else empty."""
        return "" if len(self.each) >= self.asked else self.run.trace.outcome

    @property
    def settled(self) -> tuple[HopFigures, ...]:
        """The second half of the hops that were asked for; none if the leg fell."""
        return () if self.fell else self.each[self.asked // 2 :]

    @property
    def kept(self) -> float:
        """The clearance that is kept up [m]: the lowest of the settled hops; 0 if the leg fell."""
        return min((hop.clearance for hop in self.settled), default=0.0)

    @property
    def typical(self) -> HopFigures | None:
        """The settled hop of median clearance."""
        ordered = sorted(self.settled, key=lambda hop: hop.clearance)
        return ordered[len(ordered) // 2] if ordered else None

    @property
    def drift(self) -> float:
        """How far the body moves along the ground in a hop, on average [m]."""
        x = self.run.trace.q[:, 0]
        return float(x[-1] - x[0]) / max(len(self.each), 1)

    @property
    def limits_exceeded(self) -> list[str]:
        """Limits that the typical hop does not keep, in words."""
        return self.typical.limits_exceeded if self.typical else []

    def as_dict(self) -> dict[str, Any]:
        """For ``--json``."""
        typical = self.typical
        return {
            "hops": len(self.each),
            "fell": self.fell,
            "clearances_m": self.clearances.tolist(),
            "kept_m": self.kept,
            "median_m": typical.clearance if typical else 0.0,
            "period_s": float(typical.trace.t[-1]) if typical else None,
            "touchdown_loss_J": _lost(typical) if typical else None,
            "drift_m_per_hop": self.drift,
            "limits_exceeded": self.limits_exceeded,
            "stability": self.stable.as_dict() if self.stable else None,
        }


def _lost(hop: HopFigures) -> float:
    """Energy [J] that the impacts of a hop take."""
    return float(sum(event.lost for event in hop.trace.events))


@dataclass(frozen=True)
class HopsTrial:
    """A strategy and what it is tried on.

    design: the believed leg
    strategy: its name
    reference: the plan that it follows, if any
    apex: of that plan
    """

    design: Design
    strategy: str
    reference: PlanReference | None = None
    apex: State | None = None

    @property
    def start(self) -> State:
        """The plan's apex, or at rest."""
        return self.apex or make_plant(self.design).stance_start(start_angles(self.design))

    def hop(self, hops: int, start: State, draw: Draw | None = None, fresh: Controller | None = None) -> Run:
        """So many whole hops from a state, on the believed leg or on a drawn one; bounces are no hops."""
        first = landings_needed = hops + (not start.contact)
        while True:
            run = simulate(
                self.design,
                find(self.strategy),
                plan=self.reference,
                plant=draw.leg if draw else None,
                torque_gain=draw.torque_gain if draw else None,
                hops=landings_needed,
                controller=deepcopy(fresh),
                start=start,
            )
            bounced = first - len(landings(run.trace))
            if bounced <= 0 or not run.trace.outcome.startswith("landing") or landings_needed > 2 * first:
                return run
            landings_needed += bounced


def apex_of(plan: Solution) -> State:
    """Where a plan's flight ends."""
    table = plan.tables[FLIGHT]
    return State(table.q[-1, -1], table.v[-1, -1], False, 0.0, since=-float(table.t[-1, -1] - table.t[0, 0]))


def reached_apex(hop: HopFigures) -> State:
    """Where the centre of mass of a simulated hop is highest."""
    t, span = hop.trace.t, hop.flight
    k = span.start + int(np.argmax(hop.trace.points["com"][span, 1]))
    return State(hop.trace.q[k], hop.trace.v[k], False, 0.0, since=-float(t[k] - t[span.start]))


def moved(apex: State, higher: float = 0.0, faster: float = 0.0) -> State:
    """A state in flight, higher by so much [m], and faster forward [m/s]."""
    q, v = apex.q.copy(), apex.v.copy()
    q[1] += higher
    v[0] += faster
    return replace(apex, q=q, v=v)


def hop_on(trial: HopsTrial, hops: int, offset: float) -> Hops:
    """So many hops of a strategy that begins too high by so much [m], and the multipliers of what it settles on."""
    start = moved(trial.start, offset) if trial.apex else trial.start
    found = Hops(trial.hop(hops, start), hops)
    controller = found.run.controller
    if found.fell or controller is None:
        return found
    try:
        on = ReturnMap(trial.design, controller)
        orbit = multipliers(on, state_at_landing(found.run.trace), units=on.units)
    except Fallen:
        orbit = None
    return replace(found, stable=orbit)


def in_another_plant(design: Design) -> None:
    """Raises MissingExtraError without MuJoCo, UsageError for what runs there do not know."""
    library()
    if design.contact.friction is None:
        raise UsageError("hop after hop in MuJoCo needs ground with friction: give --set contact.friction=0.6")
    if design.simulation.torque_delay:
        raise UsageError("runs in MuJoCo have no delay: leave out --mujoco, or set simulation.torque_delay=0")


def hops_in_mujoco(trial: HopsTrial, hops: int) -> list[float]:
    """Clearances [m] of so many hops of a strategy in MuJoCo, from the same start; fewer if the leg falls."""
    fresh = make_controller(trial.design, find(trial.strategy), trial.reference)
    run = in_mujoco(trial.design, fresh, trial.start, hops + (trial.apex is not None), BOUNCED)
    edges = np.flatnonzero(np.diff(run.contact.astype(int))) + 1  # no flight before the first landing counts
    flights = [span for span in pairwise([*edges, len(run.t)]) if not run.contact[span[0]]]
    least = BOUNCED * Scale.of(trial.design.leg).time
    whole = [(a, b) for a, b in flights if run.t[b - 1] - run.t[a] > least]
    each = np.arange(len(run.t))
    return [highest_in(trial.design, run, (each >= a) & (each < b)) for a, b in whole]


def hops_on_draws(trial: HopsTrial, draws: Sequence[Draw], hops: int = DRAWN_HOPS) -> list[tuple[int, float]]:
    """For each drawn leg: how many hops of so many it does, and the clearance [m] that it keeps up."""
    fresh, found = make_controller(trial.design, find(trial.strategy), trial.reference), []
    for draw in draws:
        start = trial.apex or make_plant(draw.leg).stance_start(draw.start)
        on = Hops(trial.hop(hops, start, draw, fresh), hops)
        found.append((len(on.each), on.kept))
    return found
