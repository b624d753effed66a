"""The switching structure of an optimum in words: which limit acts on what, from when to when.

Told are the limits that act somewhere, by their multipliers (optimality/minimum_principle/arcs.py), and when they are met. A stretch
shorter than SHORTEST_SPAN of its phase is the trace of a switch between two nodes, not an arc: its neighbours meet in its middle.
"""

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, Protocol

import numpy as np

from hopopt.drivetrain.operating_region.limits import BACKWARD, FORWARD, Line
from hopopt.leg.limit_id import JointWay, Kind, LimitId, kind_of
from hopopt.nlp.solver.ipopt import NlpSolution
from hopopt.ocp.problem import Component
from hopopt.ocp.rules import LEFT, RIGHT
from hopopt.optimality.minimum_principle.arcs import Activity, activity
from hopopt.record import Strict, stated

SHORTEST_SPAN = 2e-3  # share of the phase
SWITCHING_GAP = 0.015  # share of the phase: a drive that is free for less between two lines is switching
THEN = ", then "  # between stretches
SHORT_CONTACT = 0.01  # share of the phase: shorter contacts are called so
WORDS = {
    Kind.GROUND_FORCE: ("ground", "carries nothing"),
    Kind.DESCENT: ("body", "does not descend"),
    Kind.PEAK_FORCE: ("ground", "at the peak force"),
}
SLIPS = {FORWARD: BACKWARD, BACKWARD: FORWARD, LEFT: "to the right", RIGHT: "to the left"}  # against the ground's push
COUNTED = (Kind.POWER,)  # how an objective counts a drive's power: nothing that holds the leg
POWER = "drawn"  # the control that it is counted with


@dataclass(frozen=True)
class Acting:
    """What acts on a subject.

    words: what is shown.
    switches: whether it has a direction, so that a short free stretch before the other one is a switch.
    line: of a drive's operating region, with its direction; None for anything else.
    """

    words: str
    switches: bool = False
    line: tuple[Hashable, str] | None = None


FREE = Acting("free")
ON_THE_GROUND, TOUCHING = Acting("on the ground"), Acting("touching the ground")
_SPEED, _BRAKE = Line.TORQUE_SPEED, Line.BRAKING
CORNERS = {  # where two lines of the paper's law meet
    ((_SPEED, FORWARD), (_BRAKE, FORWARD)): Acting("full torque forward at standstill"),
    ((_SPEED, BACKWARD), (_BRAKE, BACKWARD)): Acting("full torque backward at standstill"),
    ((_SPEED, FORWARD), (_BRAKE, BACKWARD)): Acting("at its greatest speed forward", switches=True),
    ((_SPEED, BACKWARD), (_BRAKE, FORWARD)): Acting("at its greatest speed backward", switches=True),
}


@dataclass(frozen=True)
class ActiveSpan:
    """From begin to end [s] ``limit`` acts: anything that can be compared."""

    limit: Any
    begin: float
    end: float


@dataclass(frozen=True)
class Stretch(Strict):
    """A stretch of time in which one limit acts."""

    subject: str = stated("on what")
    limit: str = stated('which; "free" where none does')
    begin: float = stated("since the phase began [s]")
    end: float = stated("since the phase began [s]")


def described(limit: Component, side: str) -> tuple[str, Acting]:
    """Subject of one side of a limit, and what acts on it."""
    part = limit.label
    if not isinstance(limit.of, LimitId):
        return (str(part), Acting(f"at its {side} angle")) if limit.of == "q" else (str(limit), _side(side))
    kind = limit.of.kind
    if kind is Kind.REGION:
        way = FORWARD if side == "upper" else BACKWARD
        return limit.of.joint, Acting(f"{part} {way}", switches=True, line=(part, way))
    if kind is Kind.MOTOR_POWER:
        return limit.of.joint, Acting(f"at its power cap, {'driving' if side == 'upper' else 'braking'}")
    if kind is Kind.SHARE:
        return limit.of.joint, Acting("at the peak share of its operating region")
    if kind is Kind.HEIGHT:
        return str(part), ON_THE_GROUND
    if isinstance(part, JointWay):
        return part.joint, Acting(f"at the peak torque {part.way}", switches=True)
    if kind is Kind.FRICTION and side == "lower":
        return "foot", Acting(f"about to slip {SLIPS[str(part)]}", switches=part in (FORWARD, BACKWARD))
    if kind in WORDS and side == "lower":
        subject, words = WORDS[kind]
        return subject, Acting(words)
    return str(limit), _side(side)


def _side(side: str) -> Acting:
    return Acting(f"at its {side} limit")


def stretches(act: Activity, ends: tuple[float, float]) -> list[Stretch]:
    """What every subject that some limit acts on meets, subject by subject in the order of time."""
    t, m, found = act.t.ravel(), len(act.limits), list[Stretch]()
    sides, whole = act.met.reshape(len(t), -1), ends[1] - ends[0]
    subjects: dict[str, list[tuple[int, Acting]]] = {}
    for k in np.flatnonzero(act.sides.any(axis=(0, 1))).tolist():
        limit = act.limits[k % m]
        if kind_of(limit.of) in COUNTED or limit.of == POWER:
            continue
        subject, acting = described(limit, "upper" if k < m else "lower")
        subjects.setdefault(subject, []).append((k, acting))
    for subject, columns in subjects.items():
        acts = [_together([a for k, a in columns if row[k]]) for row in sides]
        own = _touches(_closed(runs(acts, t, ends), SWITCHING_GAP * whole), SHORT_CONTACT * whole)
        if any(run.limit != FREE for run in own):
            found += [Stretch(subject, run.limit.words, run.begin, run.end) for run in own]
    return found


def _together(acting: list[Acting]) -> Acting:
    """All that acts at once; corners of an operating region by what they mean."""
    for pair, corner in CORNERS.items():
        if set(pair) <= {a.line for a in acting}:
            acting = [corner, *(a for a in acting if a.line not in pair)]
    if not acting:
        return FREE
    if len(acting) == 1:
        return replace(acting[0], line=None)
    return Acting(" and ".join(dict.fromkeys(a.words for a in acting)), acting[-1].switches)


def _closed(found: list[ActiveSpan], gap: float) -> list[ActiveSpan]:
    """Short free stretches between two lines of a drive taken as their switch, between two of the same limit as its."""
    kept: list[ActiveSpan] = []
    for k, s in enumerate(found):
        inside = 0 < k < len(found) - 1 and s.limit == FREE and s.end - s.begin < gap
        beside = [found[k + side].limit for side in (-1, 1)] if inside else []
        if beside and (beside[0] == beside[1] or all(b.switches for b in beside)):
            middle = (s.begin + s.end) / 2
            kept[-1] = replace(kept[-1], end=middle)
            found[k + 1] = replace(found[k + 1], begin=middle)
        else:
            kept.append(found[k])
    return _joined(kept)


def _touches(found: list[ActiveSpan], longest: float) -> list[ActiveSpan]:
    """Short contacts with the ground called by their name."""
    return [replace(s, limit=TOUCHING) if s.limit == ON_THE_GROUND and s.end - s.begin < longest else s for s in found]


def runs(
    acts: Sequence[Any], t: np.ndarray, ends: tuple[float, float], shortest: float = SHORTEST_SPAN
) -> list[ActiveSpan]:
    """What acts at times t (k,), equal neighbours joined; what is shorter than that share of the time between the
    ends is left out, and its neighbours meet in its middle."""
    edges = np.concatenate([[ends[0]], (t[1:] + t[:-1]) / 2, [ends[1]]])
    whole = _joined([ActiveSpan(what, float(edges[k]), float(edges[k + 1])) for k, what in enumerate(acts)])
    least = shortest * (ends[1] - ends[0])
    kept = [run for run in whole if run.end - run.begin >= least] or whole[:1]
    middle = [(a.end + b.begin) / 2 for a, b in pairwise(kept)]
    begin, end = [ends[0], *middle], [*middle, ends[1]]
    return _joined([ActiveSpan(run.limit, b, e) for run, b, e in zip(kept, begin, end, strict=True)])


def _joined(runs: Sequence[ActiveSpan]) -> list[ActiveSpan]:
    found: list[ActiveSpan] = []
    for run in runs:
        if found and found[-1].limit == run.limit:
            found[-1] = replace(found[-1], end=run.end)
        else:
            found.append(run)
    return found


def structure(solution: NlpSolution) -> dict[str, list[Stretch]]:
    """The stretches of every phase."""
    return {name: stretches(activity(solution, name), (0.0, p.duration)) for name, p in solution.phases.items()}


class Told(Protocol):
    """What a stretch says of itself, here or in a stored summary."""

    @property
    def subject(self) -> str: ...
    @property
    def limit(self) -> str: ...
    @property
    def end(self) -> float: ...


def by_subject(parts: Sequence[Told]) -> dict[str, list[str]]:
    """What every subject of a phase meets, a few words for each stretch: "torque-speed line forward until 0.143 s"."""
    found: dict[str, list[str]] = {}
    for subject in dict.fromkeys(s.subject for s in parts):
        own = [s for s in parts if s.subject == subject]
        found[subject] = [*(f"{s.limit} until {s.end:.3f} s" for s in own[:-1]), own[-1].limit]
    return found


def sentences(found: dict[str, list[Stretch]]) -> list[str]:
    """One sentence for each subject of each phase: "hip: torque-speed line forward until 0.143 s, then ..."."""
    return [
        f"{phase}, {subject}: {THEN.join(words)}"
        for phase, parts in found.items()
        for subject, words in by_subject(parts).items()
    ]
