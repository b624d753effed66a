"""The switching structure of an optimum in words: which limit acts on what, from when to when.

Told are the limits that act somewhere, by their multipliers (optimality/arcs.py), and when they are met. A stretch
shorter than SHORTEST of its phase is the trace of a switch between two nodes, not an arc: its neighbours meet in its middle.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from hopopt.nlp.ipopt import NlpSolution
from hopopt.optimality.arcs import Activity, activity

SHORTEST = 2e-3  # share of the phase
GAP = 0.015  # share of the phase: a drive that is free for less between two lines is switching
TOUCH = 0.01  # share of the phase: shorter contacts are called so
REGION = " operating region"
GROUND = "on the ground"
CORNERS = {  # where two lines of the paper's law meet
    ("torque-speed line forward", "braking line forward"): "full torque forward at standstill",
    ("torque-speed line backward", "braking line backward"): "full torque backward at standstill",
    ("torque-speed line forward", "braking line backward"): "at its greatest speed forward",
    ("torque-speed line backward", "braking line forward"): "at its greatest speed backward",
}
WORDS = {
    ("ground force", "lower"): ("ground", "carries nothing"),
    ("body never descends", "lower"): ("body", "does not descend"),
    ("friction cone[forward]", "lower"): ("foot", "about to slip backward"),  # the ground pushes it forward
    ("friction cone[backward]", "lower"): ("foot", "about to slip forward"),
    ("friction cone[left]", "lower"): ("foot", "about to slip to the right"),
    ("friction cone[right]", "lower"): ("foot", "about to slip to the left"),
    ("peak ground force", "lower"): ("ground", "at the peak force"),
}
SHARE = "share used by the "
COUNTED = ("drawn", "power drawn")  # how an objective counts a drive's power: nothing that holds the leg


@dataclass(frozen=True)
class Stretch:
    """From begin to end [s] since the phase began, ``limit`` acts on ``subject``; "free" where none does."""

    subject: str
    limit: str
    begin: float
    end: float


def described(limit: str, side: str) -> tuple[str, str]:
    """Subject and words of one side of a limit."""
    if (limit, side) in WORDS:
        return WORDS[limit, side]
    name, _, part = limit.partition("[")
    part = part.removesuffix("]")
    if name == "peak torque":
        joint, _, way = part.rpartition(" ")
        return joint, f"at the peak torque {way}"
    if name.startswith(SHARE):
        return name.removeprefix(SHARE), "at the peak share of its operating region"
    if name.endswith(REGION):
        way = "forward" if side == "upper" else "backward"
        return name.removesuffix(REGION), f"{part} {way}"
    if name == "height above ground":
        return part, GROUND
    if name == "q":
        return part, f"at its {side} angle"
    return limit, f"at its {side} limit"


def stretches(act: Activity, ends: tuple[float, float]) -> list[Stretch]:
    """What every subject that some limit acts on meets, subject by subject in the order of time."""
    t, m, found = act.t.ravel(), len(act.limits), list[Stretch]()
    sides = act.met.reshape(len(t), -1)
    subjects: dict[str, list[tuple[int, str]]] = {}
    for k in np.flatnonzero(act.sides.any(axis=(0, 1))).tolist():
        limit = act.limits[k % m]
        if limit.partition("[")[0] in COUNTED:
            continue
        subject, words = described(limit, "upper" if k < m else "lower")
        subjects.setdefault(subject, []).append((k, words))
    for subject, columns in subjects.items():
        says = [_told([w for k, w in columns if row[k]]) for row in sides]
        own = _touches(_closed(runs(says, t, ends), GAP * (ends[1] - ends[0])), TOUCH * (ends[1] - ends[0]))
        if any(run.limit != "free" for run in own):
            found += [Stretch(subject, run.limit, run.begin, run.end) for run in own]
    return found


def _told(acting: list[str]) -> str:
    """What acts, in words; corners of an operating region by what they mean."""
    for pair, words in CORNERS.items():
        if set(pair) <= set(acting):
            acting = [words, *(a for a in acting if a not in pair)]
    return " and ".join(dict.fromkeys(acting)) or "free"


def _closed(found: list[Stretch], gap: float) -> list[Stretch]:
    """Short free stretches between two lines of a drive taken as their switch, between two of the same limit as its."""
    kept: list[Stretch] = []
    for k, s in enumerate(found):
        inside = 0 < k < len(found) - 1 and s.limit == "free" and s.end - s.begin < gap
        beside = [found[k + side].limit for side in (-1, 1)] if inside else []
        if beside and (beside[0] == beside[1] or all(b.endswith(("forward", "backward")) for b in beside)):
            middle = (s.begin + s.end) / 2
            kept[-1] = replace(kept[-1], end=middle)
            found[k + 1] = replace(found[k + 1], begin=middle)
        else:
            kept.append(found[k])
    return _joined(kept)


def _touches(found: list[Stretch], longest: float) -> list[Stretch]:
    """Short contacts with the ground called by their name."""
    return [
        replace(s, limit="touching the ground") if s.limit == GROUND and s.end - s.begin < longest else s for s in found
    ]


def runs(says: Sequence[str], t: np.ndarray, ends: tuple[float, float], shortest: float = SHORTEST) -> list[Stretch]:
    """What is said at times t (k,), equal neighbours joined; what is shorter than that share of the time between the
    ends is left out, and its neighbours meet in its middle."""
    edges = np.concatenate([[ends[0]], (t[1:] + t[:-1]) / 2, [ends[1]]])
    whole = _joined([Stretch("", what, float(edges[k]), float(edges[k + 1])) for k, what in enumerate(says)])
    least = shortest * (ends[1] - ends[0])
    kept = [run for run in whole if run.end - run.begin >= least] or whole[:1]
    middle = [(a.end + b.begin) / 2 for a, b in pairwise(kept)]
    begin, end = [ends[0], *middle], [*middle, ends[1]]
    return _joined([Stretch("", run.limit, b, e) for run, b, e in zip(kept, begin, end, strict=True)])


def _joined(runs: Sequence[Stretch]) -> list[Stretch]:
    found: list[Stretch] = []
    for run in runs:
        if found and found[-1].limit == run.limit:
            found[-1] = Stretch(run.subject, run.limit, found[-1].begin, run.end)
        else:
            found.append(run)
    return found


def structure(solution: NlpSolution) -> dict[str, list[Stretch]]:
    """The stretches of every phase."""
    return {name: stretches(activity(solution, name), (0.0, p.duration)) for name, p in solution.phases.items()}


def sentences(found: dict[str, list[Stretch]]) -> list[str]:
    """One sentence for each subject of each phase: "hip: torque-speed line forward until 0.143 s, then ..."."""
    lines = []
    for phase, parts in found.items():
        for subject in dict.fromkeys(s.subject for s in parts):
            own = [s for s in parts if s.subject == subject]
            whole = [f"{s.limit} until {s.end:.3f} s" for s in own[:-1]]
            lines.append(f"{phase}, {subject}: {', then '.join([*whole, own[-1].limit])}")
    return lines


def as_dict(found: dict[str, list[Stretch]]) -> dict[str, Any]:
    """For the summary: words and, by phase, the stretches [s since the phase began]."""
    return {"words": sentences(found), **{phase: [asdict(s) for s in parts] for phase, parts in found.items()}}
