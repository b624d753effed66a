"""A hop as a page shows it: the leg, its operating points, heights and ground force at some instants."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from hopopt.design import Leg
from hopopt.leg.closed_chains import chain_lines
from hopopt.leg.robot import BASE, Robot
from hopopt.leg.scales import Scale
from hopopt.planner.motion import Samples
from hopopt.planner.solution import Solution
from hopopt.sim.trace import Trace

SHOWN_INTERVAL = 0.002  # [s] on the paper's leg, between two instants: a fourth as fast a screen shows no steps


@dataclass(frozen=True)
class ShownHop:
    """One hop at k instants.

    name: what the page calls it
    t: since the hop began [s], (k,)
    chain: x, z of every joint and the foot, (k, n + 1, 2) [m]
    bars: x, z of pivot, crank's end and rod's end of every five-bar, (k, five-bars, 3, 2) [m]
    com: x, z of the centre of mass, (k, 2) [m]
    lowest: height of the lowest point, trunk and links with shapes too, (k,) [m]
    v, tau: speeds [rad/s] and torques [N m] of the drives behind their gears, (k, n)
    force: on the foot, along x and up, (k, 2) [N]
    lift_off: when the foot leaves [s]
    clearance: what the hop reaches [m]; None where it is not verified
    ends: why it goes no further, in words
    """

    name: str
    t: np.ndarray
    chain: np.ndarray
    bars: np.ndarray
    com: np.ndarray
    lowest: np.ndarray
    v: np.ndarray
    tau: np.ndarray
    force: np.ndarray
    lift_off: float
    clearance: float | None
    ends: str = ""


PLAN_ENDS = "the plan ends"  # what is shown of a plan whose foot does not come down again


def chain(points: Mapping[str, np.ndarray], robot: Robot) -> np.ndarray:
    """x, z of every joint and the foot, (k, n + 1, 2) [m], of points by name."""
    return np.stack([points[name] for name in robot.leg.chain], axis=1)


def bars(chain: np.ndarray, q: np.ndarray, leg: Leg) -> np.ndarray:
    """``ShownHop.bars`` of a chain and q (k, 2 + n) of the whole leg."""
    if not leg.five_bars:
        return np.zeros((len(q), 0, 3, 2))
    return np.array([chain_lines(leg, pose[BASE:]) for pose in q]) + chain[:, None, :1]


def planned(solution: Solution, name: str) -> ShownHop:
    """The hop of a solution."""
    interval = SHOWN_INTERVAL * Scale.of(solution.design.leg).time
    even = np.linspace(0.0, solution.end, max(2, round(solution.end / interval)))
    s = solution.sample(np.union1d(even, [solution.lift_off, solution.duration]))
    clearance = solution.clearance if solution.verified else None
    force = s.f[:, [0, -1]]
    ends = f"{solution.end_of_flight}: {PLAN_ENDS}" if solution.end <= solution.duration else ""
    return _shown(name, solution.robot, s, s.command, force, solution.lift_off, clearance, ends)


def simulated(trace: Trace, name: str, clearance: float | None) -> ShownHop:
    """A simulated hop; its torques are those behind the drives' limits."""
    even = np.arange(trace.t[0], trace.t[-1], SHOWN_INTERVAL * Scale.of(trace.robot.leg).time)
    rows = np.unique([*np.searchsorted(trace.t, even), len(trace.t) - 1])
    arrays = ("t", "q", "v", "command", "motor", "tau", "f", "contact", "work")
    few = replace(trace, **{array: getattr(trace, array)[rows] for array in arrays})
    lift_off = next(iter(trace.times_of("lift-off")), float(trace.t[-1]))
    return _shown(name, trace.robot, few, few.motor, few.f, lift_off, clearance)


def _shown(
    name: str, robot: Robot, s: Samples | Trace, tau: np.ndarray, force: np.ndarray, lift_off: float,
    clearance: float | None, ends: str = "",
) -> ShownHop:  # fmt: skip
    """A hop by its samples; the others as its fields."""
    legs = chain(s.points, robot)
    places = legs, bars(legs, s.q, robot.leg), s.points["com"], s.lowest
    return ShownHop(name, s.t, *places, s.w, tau, force, lift_off, clearance, ends)
