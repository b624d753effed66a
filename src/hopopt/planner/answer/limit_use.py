"""Limits that never act: how much of each a plan uses, and to what it could be tightened without effect on the plan."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from decimal import ROUND_CEILING, ROUND_FLOOR, Context
from typing import Any

import numpy as np

from hopopt.drivetrain.limits import CAPS
from hopopt.leg.robot import BASE
from hopopt.leg.scales import force_range
from hopopt.ocp.objectives.registry import find
from hopopt.ocp.phases import DESCENT, FLIGHT, ON_GROUND, duration_entry
from hopopt.ocp.rules import steepness
from hopopt.planner.solution import Motion, Samples
from hopopt.verify.limits import windowed

IDLE = 0.999  # largest share of a limit that may be used if it is to count as idle
LOADED = 1e-3  # of the force's range: a foot with less is not loaded
FIGURES = 4  # significant ones of a value that would do


@dataclass(frozen=True)
class Use:
    """A limit's use.

    what: words for it, {} where its places (joints or phases) stand.
    places: in which of them the same entry holds.
    path: the entry of the problem file that sets it, "" if none does; index: which number of that entry.
    limit, enough: the entry's value, and one that would do [the entry's unit]; used: share of it.
    least: the entry is a lower bound.
    """

    what: str
    places: tuple[str, ...]
    path: str
    limit: float
    used: float
    enough: float
    least: bool = False
    index: int | None = None

    @property
    def name(self) -> str:
        """What is shown."""
        return self.what.format(" and ".join(self.places))

    @property
    def entry(self) -> str:
        """The entry as it is set on the command line."""
        return self.path if self.index is None else f"{self.path}[{self.index}]"

    @property
    def key(self) -> tuple[str, str]:
        """What uses of one entry have in common; a limit that no entry sets has its place to itself."""
        return self.entry, "" if self.path else self.name

    def as_dict(self) -> dict[str, Any]:
        """For the summary."""
        return {"used": self.used, "entry": self.entry, "limit": self.limit, "enough": self.rounded()}

    def rounded(self) -> float:
        """``enough`` with few figures, away from the plan and no further than the limit."""
        context = Context(prec=FIGURES, rounding=ROUND_FLOOR if self.least else ROUND_CEILING)
        value = float(context.create_decimal_from_float(self.enough))
        return max(value, self.limit) if self.least else min(value, self.limit)


def idle_uses(plan: Motion, fine: Mapping[str, Samples]) -> list[Use]:
    """Limits that no instant of the plan touches, the least used first, durations last. An entry that several joints or
    phases share is one limit.

    fine: the plan's samples by phase. The plan stays what it is if such a limit is dropped or tightened to ``enough``.
    """
    together: dict[tuple[str, str], list[Use]] = {}
    shares = plan.objective == "saturation"  # the share of its region that a drive uses is the objective there
    for use in (*_joints(plan, fine), *(() if shares else _regions(plan, fine)), *_whole(plan, fine)):
        together.setdefault(use.key, []).append(use)
    found = [_of_entry(uses) for uses in together.values()]
    return sorted((use for use in found if use.used < IDLE), key=lambda use: (use.index is not None, use.used))


def as_dict(uses: Sequence[Use]) -> dict[str, dict[str, Any]]:
    """For the summary, by name."""
    return {use.name: use.as_dict() for use in uses}


def _of_entry(uses: list[Use]) -> Use:
    """The largest use of an entry, with all places that share it."""
    places = tuple(dict.fromkeys(place for use in uses for place in use.places))
    return replace(max(uses, key=lambda use: use.used), what=uses[0].what, places=places)


def _joints(plan: Motion, fine: Mapping[str, Samples]) -> Iterator[Use]:
    """Angles, over all phases."""
    leg, q = plan.design.leg, np.concatenate([s.q[:, BASE:] for s in fine.values()])
    for k, joint in enumerate(plan.robot.joints):
        (low, high), (least, most) = (leg.joint[joint].lower, leg.joint[joint].upper), (q[:, k].min(), q[:, k].max())
        shares = float((high - least) / (high - low)), float((most - low) / (high - low))
        yield Use("{} lower angle", (joint,), f"leg.{joint}.lower", low, shares[0], float(least), least=True)
        yield Use("{} upper angle", (joint,), f"leg.{joint}.upper", high, shares[1], float(most))


def _regions(plan: Motion, fine: Mapping[str, Samples]) -> Iterator[Use]:
    """Operating regions, over all phases."""
    leg, v = plan.design.leg, np.concatenate([s.v[:, BASE:] for s in fine.values()])
    tau = np.concatenate([s.tau for s in fine.values()])
    for k, joint in enumerate(plan.robot.joints):
        region, used = plan.region(joint), dict[str, float]()
        for plane, use in zip(region.planes, region.use(v[:, k], tau[:, k]), strict=True):
            used[plane.line] = max(used.get(plane.line, 0.0), float(np.max(use)))
        for name, share in used.items():
            if name in CAPS:
                path, cap = leg.drive(joint, *CAPS[name][0])
                yield Use(f"{{}} {name}", (joint,), path, cap, share, share * cap)
            else:
                yield Use(f"{{}} {name}", (joint,), "", 1.0, share, share)


def _whole(plan: Motion, fine: Mapping[str, Samples]) -> Iterator[Use]:
    """Durations, friction, and the window of the foot at the apex and at touchdown."""
    hop, goal = plan.design.hop, plan.own[0] or find(plan.objective)
    for phase in fine:
        (shortest, longest), lasted = getattr(hop, f"{phase}_duration"), plan.phases[phase].duration
        entry = duration_entry(phase)
        yield Use("shortest {}", (phase,), entry, shortest, shortest / lasted, lasted, least=True, index=0)
        yield Use("longest {}", (phase,), entry, longest, lasted / longest, lasted, index=1)
    friction = plan.design.contact.friction
    f = np.concatenate([s.f for phase, s in fine.items() if phase in ON_GROUND])
    if friction:
        loaded = f[:, -1] >= LOADED * force_range(plan.robot.model)
        needed = float((np.abs(f[loaded, :-1]).max(axis=1) / f[loaded, -1]).max(initial=0.0) / steepness(f.shape[1]))
        yield Use("friction cone", (), "contact.friction", friction, needed / friction, needed)
    if goal.ends != "free":
        ends = [
            plan.sample_phase(p, np.array([plan.phases[p].duration]))
            for p in (FLIGHT, DESCENT)
            if p in plan.phases and windowed(plan.design, p, goal.ends)
        ]
        off = max(float(abs(s.points["foot"][0, 0] - s.points[plan.robot.joints[0]][0, 0])) for s in ends)
        yield Use("foot window", (), "hop.foot_window", hop.foot_window, off / hop.foot_window, off)
