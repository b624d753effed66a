"""Limits that never act: how much of each a plan uses, and to what it could be tightened without effect on the plan."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from decimal import ROUND_CEILING, ROUND_FLOOR, Context

import numpy as np

from hopopt.drivetrain.dynamics import TORQUE_RATE, added_states
from hopopt.drivetrain.heat import LIMIT
from hopopt.drivetrain.operating_region.limits import CAPS
from hopopt.leg.limit_id import Kind
from hopopt.leg.robot import BASE
from hopopt.leg.scales import force_range
from hopopt.ocp.objectives.registry import find
from hopopt.ocp.phases import DESCENT, FLIGHT, ON_GROUND, duration_entry
from hopopt.ocp.rules import steepness
from hopopt.planner.motion import Motion, Samples
from hopopt.record import Strict, stated
from hopopt.verify.hops.heat import motor_heat
from hopopt.verify.limits import windowed

MOST_IDLE_USE = 0.999  # largest share of a limit that may be used if it is to count as idle
LOADED_SHARE = 1e-3  # of the force's range: a foot with less is not loaded
SIGNIFICANT_DIGITS = 4  # significant ones of a value that would do


@dataclass(frozen=True)
class IdleLimit(Strict):
    """A limit that never acts."""

    used: float = stated("largest share of its range that the plan uses")
    entry: str = stated("its entry of the problem file; empty for a limit that no entry sets")
    limit: float = stated("its value [the entry's unit]")
    enough: float = stated("a value that would do [the entry's unit]")


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
    def entry(self) -> str:
        """The entry as it is set on the command line."""
        return self.path if self.index is None else f"{self.path}[{self.index}]"

    @property
    def key(self) -> tuple[str, ...]:
        """What uses of one entry have in common; a limit that no entry sets has its place to itself."""
        return (self.entry,) if self.path else (self.what, *self.places)


def idle_limits(plan: Motion, fine: Mapping[str, Samples]) -> dict[str, IdleLimit]:
    """Limits that no instant of the plan touches, by name, the least used first, durations last. An entry that several
    joints or phases share is one limit.

    fine: the plan's samples by phase. The plan stays what it is if such a limit is dropped or tightened to ``enough``.
    """
    together: dict[tuple[str, ...], list[Use]] = {}
    shares = plan.objective == "saturation"  # the share of its region that a drive uses is the objective there
    for use in (
        *_joints(plan, fine),
        *(() if shares else _regions(plan, fine)),
        *_heat(plan),
        *_rates(plan),
        *_whole(plan, fine),
    ):
        together.setdefault(use.key, []).append(use)
    largest = [(max(uses, key=lambda use: use.used), uses) for uses in together.values()]
    idle = sorted(
        (pair for pair in largest if pair[0].used < MOST_IDLE_USE), key=lambda p: (p[0].index is not None, p[0].used)
    )
    return {_name(uses): IdleLimit(use.used, use.entry, use.limit, _rounded(use)) for use, uses in idle}


def _name(uses: list[Use]) -> str:
    """What a limit is called, with all places that share its entry."""
    return uses[0].what.format(" and ".join(dict.fromkeys(place for use in uses for place in use.places)))


def _rounded(use: Use) -> float:
    """``enough`` with few figures, away from the plan and no further than the limit."""
    context = Context(prec=SIGNIFICANT_DIGITS, rounding=ROUND_FLOOR if use.least else ROUND_CEILING)
    value = float(context.create_decimal_from_float(use.enough))
    return max(value, use.limit) if use.least else min(value, use.limit)


def _joints(plan: Motion, fine: Mapping[str, Samples]) -> Iterator[Use]:
    """Angles, over all phases."""
    leg, q = plan.design.leg, np.concatenate([s.q[:, BASE:] for s in fine.values()])
    for k, joint in enumerate(plan.robot.joints):
        (low, high), (least, most) = (leg.joint[joint].lower, leg.joint[joint].upper), (q[:, k].min(), q[:, k].max())
        shares = float((high - least) / (high - low)), float((most - low) / (high - low))
        place = leg.units(joint).place
        yield Use(f"{{}} lower {place}", (joint,), f"leg.{joint}.lower", low, shares[0], float(least), least=True)
        yield Use(f"{{}} upper {place}", (joint,), f"leg.{joint}.upper", high, shares[1], float(most))


def _regions(plan: Motion, fine: Mapping[str, Samples]) -> Iterator[Use]:
    """Operating regions, over all phases."""
    leg, w = plan.design.leg, np.concatenate([s.w for s in fine.values()])
    tau = np.concatenate([s.command for s in fine.values()])
    rate = np.concatenate([s.command_rate for s in fine.values()])
    parts = [share for s in fine.values() if (share := plan.voltage(s)) is not None]
    voltage = np.concatenate(parts) if parts else None
    for k, joint in enumerate(plan.robot.joints):
        region, used = plan.region(joint), dict[str, float]()
        for plane, use in zip(region.planes, region.use(w[:, k], tau[:, k], voltage, rate[:, k]), strict=True):
            used[plane.line] = max(used.get(plane.line, 0.0), float(np.max(use)))
        if region.power is not None:
            (path, cap), most = leg.drive(joint, "motor", "power_cap"), float(np.abs(w[:, k] * tau[:, k]).max())
            yield Use(f"{{}} {Kind.MOTOR_POWER.value}", (joint,), path, cap, most / cap, most)
        for name, share in used.items():
            if name in CAPS:
                path, cap = leg.drive(joint, *CAPS[name][0])
                yield Use(f"{{}} {name}", (joint,), path, cap, share, share * cap)
            else:
                yield Use(f"{{}} {name}", (joint,), "", 1.0, share, share)


def _rates(plan: Motion) -> Iterator[Use]:
    """Limits of how fast motors' torques and the ground force change."""
    if (most := plan.design.contact.force_rate) is not None:
        rates = [np.abs(plan.tables[phase].force_rate[..., -1]).max() for phase in plan.tables if phase in ON_GROUND]
        used = float(max(rates)) / most
        yield Use(Kind.FORCE_RATE.value, (), "contact.force_rate", most, used, used * most)
    leg = plan.design.leg
    for k, most in added_states(leg, plan.robot.parameters).limited.items():
        joint = plan.robot.joints[k]
        used = max(float(np.abs(table.asked_rate[..., k]).max()) for table in plan.tables.values()) / most
        path, limit = leg.drive(joint, "motor", TORQUE_RATE)
        if limit is None:
            continue  # what the voltage leaves is a line of the region
        yield Use(f"{{}} {Kind.TORQUE_RATE.value}", (joint,), path, limit, used, used * limit)


def _heat(plan: Motion) -> Iterator[Use]:
    """Limits of windings' temperatures."""
    for joint in plan.robot.joints:
        path, limit = plan.design.leg.drive(joint, "motor", LIMIT)
        if limit is not None and (hot := motor_heat(plan.design, plan.robot, plan.tables, joint)) is not None:
            ambient = plan.design.ambient
            used = hot.highest / (limit - ambient)
            yield Use(f"{{}} {Kind.TEMPERATURE.value}", (joint,), path, limit, used, ambient + hot.highest)


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
        loaded = f[:, -1] >= LOADED_SHARE * force_range(plan.robot.model)
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
