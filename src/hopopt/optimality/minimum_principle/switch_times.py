"""Which switches of the drives may be moved, and which limits hold between them: what a re-solve begins from.

A drive that saturates sits on a line of its operating region; where it changes from one to another its torque jumps
(or, where the lines meet at standstill, has a kink). Such a time may be a decision of the program, with the line
held as an equation on either side. Not so where a height or an angle rides on its limit nearby: there the torques
follow from that limit, and a time that is free is used to pass it between the nodes.
"""

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hopopt.leg.limit_id import Kind, kind_of
from hopopt.ocp.problem import Component
from hopopt.optimality.minimum_principle.arcs import Activity
from hopopt.optimality.minimum_principle.switching_structure import SWITCHING_GAP, ActiveSpan, runs

SAME_SWITCH = 0.005  # share of the phase: switches of several drives that are closer are one
DISTANCE_FROM_LIMITS = 0.03  # share of the phase: how far a moving switch keeps from limits of heights and angles
GAIN = 1e-3  # of the objective: what one range of a line must gain to be held


@dataclass(frozen=True)
class Pin:
    """A line of a drive (limit and side) that is held from begin to end [s]."""

    limit: Component
    side: str
    begin: float
    end: float


@dataclass(frozen=True)
class SwitchPlan:
    """Times [s] of the switches of a phase, which of them may move, and the lines enforced between them."""

    switches: tuple[float, ...]
    free: tuple[bool, ...]
    pins: tuple[Pin, ...]


def plan(act: Activity, duration: float, objective: float) -> SwitchPlan:
    """What is to be re-solved of a phase that lasts ``duration`` [s]."""
    lines = [stretch for name in _drives(act.limits) for stretch in _lines(act, name, duration)]
    lines = [s for s in lines if _gain(act, s) > GAIN * abs(objective)]
    times = sorted({t for s in lines for t in (s.begin, s.end) if 0 < t < duration})
    merged = _merged(times, SAME_SWITCH * duration)
    near = {t: min(merged, key=lambda m: abs(m - t)) for t in times} | {0.0: 0.0, duration: duration}
    pins = [Pin(limit, side, near[s.begin], near[s.end]) for s in lines for limit, side in s.limit]
    corners = {near[t] for s in lines if len(s.limit) > 1 for t in (s.begin, s.end)}
    held = _state_limits(act)
    free = [m not in corners and bool((np.abs(held - m) > DISTANCE_FROM_LIMITS * duration).all()) for m in merged]
    return SwitchPlan(tuple(merged), tuple(free), tuple(pins))


def _drives(limits: Sequence[Component]) -> list[Hashable]:
    """The operating regions among the limits."""
    return list(dict.fromkeys(limit.of for limit in limits if kind_of(limit.of) is Kind.REGION))


def _lines(act: Activity, drive: Hashable, duration: float) -> list[ActiveSpan]:
    """When a drive is on which line(s), as pairs of limit and side; short free stretches between two are closed."""
    m, t = len(act.limits), act.t.ravel()
    sides = act.sides.reshape(len(t), -1)
    own = [k for k in range(2 * m) if act.limits[k % m].of == drive]
    says = [tuple((act.limits[k % m], "upper" if k < m else "lower") for k in own if row[k]) for row in sides]
    found = [s for s in runs(says, t, (0.0, duration)) if s.limit]
    for k in range(1, len(found)):
        a, b = found[k - 1], found[k]
        if b.begin - a.end < SWITCHING_GAP * duration:
            middle = (a.end + b.begin) / 2
            found[k - 1], found[k] = replace(a, end=middle), replace(b, begin=middle)
    return found


def _gain(act: Activity, s: ActiveSpan) -> float:
    """What one range of the line(s) gains over a stretch, by the multipliers."""
    m, inside = len(act.limits), (act.t > s.begin) & (act.t < s.end)
    columns = [act.limits.index(limit) + m * (side == "lower") for limit, side in s.limit]
    return float(act.push[inside][:, columns].sum())


def _merged(times: Sequence[float], gap: float) -> list[float]:
    """Times closer than ``gap`` as one, their mean."""
    groups: list[list[float]] = []
    for t in times:
        if groups and t - groups[-1][-1] < gap:
            groups[-1].append(t)
        else:
            groups.append([t])
    return [float(np.mean(group)) for group in groups]


def _state_limits(act: Activity) -> np.ndarray:
    """Times at which a limit of the state alone acts (heights, angles), but for the phase's end."""
    t, alone = act.t.ravel(), ~np.tile(act.on_controls, 2)
    acting = np.asarray(act.sides.reshape(len(t), -1)[:, alone].any(axis=1))
    acting[-1] = False
    return t[acting]
