"""Many hops in one run: where one ends and the next begins, and each as a run of its own."""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from hopopt.leg.scales import Scale
from hopopt.sim.trace import SAME_INSTANT, Event, Trace

BOUNCED = 0.1  # [s] on the paper's leg; off the ground for less is no hop among several: free fall from 1 cm


def landings(trace: Trace, least: float = BOUNCED) -> list[float]:
    """When the foot landed after a flight of at least so long [s, on the paper's leg]; a run that begins in flight has flown long enough."""
    found, left, least = list[float](), -np.inf, least * Scale.of(trace.robot.leg).time
    for event in trace.events:
        if event.kind == "lift-off":
            left = event.t
        elif event.kind == "touchdown" and event.t - left >= least:
            found.append(event.t)
    return found


def before_landing(trace: Trace, t: float) -> int:
    """The last sample in the flight that ends with the landing at t [s]."""
    last = int(np.searchsorted(trace.t, t + SAME_INSTANT, side="right")) - 1
    return int(np.flatnonzero(~trace.contact[: last + 1])[-1])


def hops_of(trace: Trace) -> list[Trace]:
    """Every whole hop, from a landing (or from the start, if that is on the ground) to the next one."""
    cuts = [before_landing(trace, t) + 1 for t in landings(trace)]
    edges = [0, *cuts] if trace.contact[0] else cuts
    return [part(trace, begin, end) for begin, end in pairwise(edges)]


def part(trace: Trace, begin: int, end: int) -> Trace:
    """Samples begin to end - 1 as a run of their own: times and works count from its first sample, x from the foot there."""
    span = slice(begin, end)
    t, q, origin = trace.t[span], trace.q[span].copy(), trace.t[begin]
    if trace.contact[begin]:
        q[:, 0] -= trace.machine.points(trace.q[begin])["foot"][0]
    events = [
        Event(e.kind, e.t - origin, e.lost) for e in trace.events if origin + SAME_INSTANT < e.t <= t[-1] + SAME_INSTANT
    ]
    same = {name: getattr(trace, name)[span] for name in ("v", "command", "motor", "tau", "f", "contact")}
    work, outcome = trace.work[span] - trace.work[begin], "the next landing"
    return replace(trace, t=t - origin, q=q, work=work, events=tuple(events), outcome=outcome, **same)
