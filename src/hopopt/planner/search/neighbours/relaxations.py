"""Relaxed problems as starts: the optimum of an easier problem, tightened to what was asked,
from its point and its multipliers.

A relaxation is the same program within wider bounds or with other numbers, so nothing is built again. Its optimum often
lies near a better hop than the guessed starts do: without the friction cone, say, the leg lies down before it pushes.
"""

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hopopt.design.fields import TRUNK
from hopopt.drivetrain.gear import lossless_entries
from hopopt.drivetrain.supply import stiffer_entries
from hopopt.leg.limit_id import Kind, LimitId
from hopopt.nlp.deadline import NEVER, Deadline
from hopopt.nlp.solver.ipopt import CARRIED, Bounds, NlpSolver
from hopopt.nlp.transcription import Rows, Transcription
from hopopt.ocp.guesses.initial_guess import make_guess, starts_of
from hopopt.ocp.hop import Hop
from hopopt.planner.search.multistart import (
    KnownOptima,
    StartOutcome,
    first_options,
    first_solver,
    first_transcription,
    known_optima,
    noted,
    outcome_of,
    remember,
)

Widen = Callable[[Transcription, Bounds], None]  # writes into the bounds
Numbers = Callable[[Transcription], Mapping[str, float]]  # parameters of the program by name
BEGUN_FROM = (0, 1)  # starts that each relaxed problem is solved from
DEEPER = 0.3  # of the leg's length, by which joints may pass through the ground
WIDER = 0.4  # rad by which each joint may pass its limits
STRONGER = 1.3  # times the drives' range
LONGER = 1.5  # times the longest stance


@dataclass(frozen=True)
class Relaxation:
    """A problem with wider limits, or with numbers that ask less.

    name: in words
    limits: kinds of limits without which it is no relaxation of the problem
    widen: writes the wider bounds
    numbers: of the program, that differ; if there is such a function and it gives none, it is no relaxation either
    """

    name: str
    limits: tuple[Kind, ...] = ()
    widen: Widen = lambda t, bounds: None
    numbers: Numbers | None = None

    def suits(self, t: Transcription) -> bool:
        """Whether the problem has what this relaxes."""
        if not all(any(rows_of(t, kind)) for kind in self.limits):
            return False
        if self.numbers is not None:
            return bool(self.numbers(t))
        own, bounds = own_bounds(t), wider(t, self)
        return any(not np.array_equal(getattr(own, side), getattr(bounds, side)) for side in vars(own))


def rows_of(t: Transcription, kind: Kind) -> Iterator[Rows]:
    """The rows of all limits of a kind."""
    return (r for r in t.rows if isinstance(r.name, LimitId) and r.name.kind is kind)


def labelled(r: Rows, wanted: Callable[[str], bool]) -> np.ndarray:
    """Which of these rows are of components with a wanted label."""
    return np.tile([wanted(str(component.label)) for component in r.labels], max(1, len(r.interval)))


def friction_cone(t: Transcription, b: Bounds) -> None:
    """Without the friction cone."""
    for r in rows_of(t, Kind.FRICTION):
        b.low_g[r.start : r.stop] = -np.inf


def joints_below_ground(t: Transcription, b: Bounds) -> None:
    """Joints, but not the foot, may pass through the ground."""
    for r in rows_of(t, Kind.HEIGHT):
        b.low_g[r.start : r.stop] -= DEEPER * labelled(r, lambda point: point != "foot")


def trunk_through_obstacle(t: Transcription, b: Bounds) -> None:
    """The trunk, but no link, may pass through the obstacle."""
    for r in rows_of(t, Kind.OBSTACLE):
        trunk = labelled(r, lambda shape: shape.split(" ")[0] == TRUNK)  # ahead of it, or behind
        b.low_g[r.start : r.stop][trunk] = -np.inf


def joint_range(t: Transcription, b: Bounds) -> None:
    """Joints may pass their limits, but at the start."""
    for phase in t.problem.phases:
        first = 1 if phase is t.problem.phases[0] else 0
        for side, sign in ((b.low_z, -1), (b.high_z, 1)):
            nodes, scale = t.nodes_of(phase.name, "q", side)
            nodes[first:] += sign * WIDER / scale


def drives(t: Transcription, b: Bounds) -> None:
    """Drives with a larger operating region."""
    for r in rows_of(t, Kind.REGION):
        b.low_g[r.start : r.stop] *= STRONGER
        b.high_g[r.start : r.stop] *= STRONGER


def without(kind: Kind) -> Widen:
    """Without the limits of a kind."""

    def widen(t: Transcription, b: Bounds) -> None:
        for r in rows_of(t, kind):
            b.low_g[r.start : r.stop], b.high_g[r.start : r.stop] = -np.inf, np.inf

    return widen


def stance_time(t: Transcription, b: Bounds) -> None:
    """A longer stance."""
    b.high_z[t.variables[t.problem.phases[0].name].durations] *= LONGER


def no_losses(t: Transcription) -> Mapping[str, float]:
    """Gears that lose nothing, and a supply that hardly sags."""
    p = {q.name: float(np.ravel(q.value)[0]) for q in t.fixed}
    return {**lossless_entries(p), **stiffer_entries(p)}


def together(*each: Widen) -> Widen:
    """Several at once."""

    def widen(t: Transcription, b: Bounds) -> None:
        for one in each:
            one(t, b)

    return widen


NO_FRICTION_LIMIT = Relaxation("no friction limit", (Kind.FRICTION,), friction_cone)
QUICK = (
    NO_FRICTION_LIMIT,
    Relaxation("wider joint range", (), joint_range),
    Relaxation("no ground for joints", (Kind.HEIGHT,), together(friction_cone, joints_below_ground, joint_range)),
    Relaxation("no obstacle for the trunk", (Kind.OBSTACLE,), trunk_through_obstacle),
    Relaxation("no losses", numbers=no_losses),
    Relaxation("no cap on power", (Kind.MOTOR_POWER,), without(Kind.MOTOR_POWER)),
    Relaxation("no limit of heat", (Kind.TEMPERATURE,), without(Kind.TEMPERATURE)),
)
THOROUGH = (
    *QUICK,
    Relaxation("stronger drives", (), drives),
    Relaxation("longer stance", (), stance_time),
    Relaxation("joints below the ground", (Kind.HEIGHT,), joints_below_ground),
)


def suiting(hop: Hop, chosen: Sequence[Relaxation]) -> list[Relaxation]:
    """Of these relaxations those that the problem has limits for."""
    return [r for r in chosen if r.suits(first_transcription(hop))]


def relaxed_starts(
    hop: Hop, relaxation: Relaxation, known: Sequence[StartOutcome] = (), begun_from: Sequence[int] = BEGUN_FROM,
    until: Deadline = NEVER,
) -> list[StartOutcome]:  # fmt: skip
    """What a relaxed problem leads to once it is tightened, on the first mesh, as far as there is time for it.

    known: hops to which none need be followed again; begun_from: numbers of the starts that it is solved from.
    """
    watch, outcomes = known_optima(hop, known), list[StartOutcome]()
    asked = asked_from(hop, watch, until)
    relaxed = first_solver(hop, True, known_optima(hop), until)
    for k in begun_from:
        if until.passed:
            break
        outcome = _tightened(hop, asked, relaxed, relaxation, k)
        if outcome is not None:
            outcomes.append(outcome)
            remember(watch, outcome)
    return outcomes


def _tightened(hop: Hop, asked: NlpSolver, relaxed: NlpSolver, relaxation: Relaxation, k: int) -> StartOutcome | None:
    """The relaxed problem from start k and, from its optimum and multipliers, what is asked; None if the relaxed optimum
    was known already."""
    began, start, t = time.perf_counter(), starts_of(hop, k + 1)[k], asked.transcription
    s = relaxed(make_guess(hop, start), relaxation.numbers and relaxation.numbers(t), bounds=wider(t, relaxation))
    if relaxed.stopped:
        return None
    if s.success and relaxed.known is not None:
        remember(relaxed.known, outcome_of(relaxation.name, s, 0.0))
        s = asked.again(replace(s, p=t.parameter_values()), own_bounds(t))
    name = relaxation.name if k == 0 else f"{relaxation.name}, from {start.name}"
    outcome = outcome_of(name, s, time.perf_counter() - began)
    return noted(asked, outcome) if asked.stopped else outcome


def asked_from(hop: Hop, watch: KnownOptima | None, until: Deadline) -> NlpSolver:
    """The program that was asked, to be solved from the optimum of a changed one and its multipliers."""
    return NlpSolver(first_transcription(hop), first_options(hop, True) | CARRIED, watch, until)


def own_bounds(t: Transcription) -> Bounds:
    """The program's own bounds, as copies."""
    low, high = t.bounds({})
    return Bounds(low, high, np.array(t.lbg, dtype=float), np.array(t.ubg, dtype=float))


def wider(t: Transcription, relaxation: Relaxation) -> Bounds:
    """The program's bounds, widened by a relaxation."""
    bounds = own_bounds(t)
    relaxation.widen(t, bounds)
    return bounds
