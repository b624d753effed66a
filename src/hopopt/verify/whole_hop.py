"""Whole-hop rollout of a plan: the whole hop simulated in one piece, torques clamped to the drives' limits.

Replay (verify/replay.py) begins every interval at the plan's own state. Here nothing is put back. Pinocchio's leg moves
from the plan's first state to its last instant by the plan's torques and a feedback towards the plan. Their sum is
clamped exactly to the operating region at the actual speed. So the drives can do this hop. It may pass limits of the
state and of the ground: by how much is stated.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from hopopt.design import Design, HopSettings, physical_parameters
from hopopt.drivetrain.dynamics import added_states
from hopopt.leg.kinematics import loop_axes, reach
from hopopt.leg.limit_id import Kind
from hopopt.leg.robot import Robot, build_robot
from hopopt.leg.scales import Scale
from hopopt.record import Real, if_any
from hopopt.sim.machine import Machine
from hopopt.verify.check import LIMIT, Check
from hopopt.verify.drives import Drives
from hopopt.verify.hops.one_piece import LegState, simulated_hop, state_of
from hopopt.verify.hops.periodic import closure, joints_at
from hopopt.verify.limits import limit_words, limits_of, windowed
from hopopt.verify.measures import MEASURES, Measures
from hopopt.verify.table import FLIGHT, STANCE, Table

MOST_SHORT_OF_CLAIM = 1e-4  # relative: what the simulated hop may fall short of the claim
# rad, and m, rad/s, m/s on the paper's leg: a hop that strayed further is another one and says nothing about the plan's value
FOLLOWED = 1e-2
SHARPER = 10.0  # times as sharply change gears that lose something, for what their smooth law may be worth
VALUE = Check("simulated in one piece", float("nan"), MOST_SHORT_OF_CLAIM, "relative")  # of nothing as yet
LIMITS = Check("limits when simulated in one piece", float("nan"), 2 * LIMIT, "of its range")


@dataclass(frozen=True)
class Simulated(Measures):
    """The whole hop simulated in one piece, torques clamped to the drives' limits."""

    clearance_m: float | None = if_any("height of the lowest point when flight ends [m]")
    followed: bool | None = if_any("whether it stayed on the plan")
    short_by: Real | None = if_any("by how much the rollout value is less than the claim [the objective's unit]")
    strayed: Real | None = if_any("largest distance from the plan [rad; m, m/s, rad/s on the paper's leg]")
    passed: Real | None = if_any("largest share of its range by which a limit was passed")
    limit: str | None = if_any("that limit")
    sharper_gears_m: float | None = if_any(
        f"clearance of the same torques where lossy gears change sides {SHARPER:g} times as sharply [m]"
    )
    note: str | None = if_any("why it says nothing about the plan")


@dataclass(frozen=True)
class WholeHopRollout:
    """The simulated hop; infinite numbers if the simulation failed.

    values: rollout values by name: ``clearance_m``, ``apex_m`` and what the hop was made for [its unit]
    strayed: how far it strayed from the plan [rad; m, m/s, rad/s on the paper's leg, a similar leg's in its own units]
    passed: the largest share of its range by which it passed a limit
    limit: which limit that was
    """

    values: Mapping[str, float]
    strayed: float
    passed: float
    limit: str

    @property
    def followed(self) -> bool:
        """Whether it is the plan's hop: drives at their limits cannot bring a leg back that is unstable there."""
        return bool(self.strayed <= FOLLOWED)

    @property
    def note(self) -> str:
        """Why it says nothing about the plan; empty if it does."""
        if not np.isfinite(self.strayed):
            return "the simulation did not reach the end"
        if not self.followed:
            return "the simulated leg left the plan: its drives, at their limits, could not bring it back"
        return ""

    def short(self, figure: str, claim: float, sign: float) -> float:
        """By how much the rollout value is less than the claim, if it is [the figure's unit]; 0 for a figure that it has not.

        sign: 1 where more is better, -1 where less is.
        """
        return max((claim - self.values.get(figure, claim)) * sign, 0.0)

    def checks(self, figure: str, claim: float, sign: float, size: float) -> list[Check]:
        """That the rollout value is what is claimed of the plan, and passes no limit by more than twice what the plan may.

        ``size``: what the difference is relative to [the figure's unit]. Left out for a hop that did not follow the plan.
        """
        if self.note:
            return left_out(self.note)
        limits = replace(LIMITS, residual=self.passed, where=self.limit)
        if self.values and figure not in self.values:
            return [limits]  # a user-defined function
        return [replace(VALUE, residual=self.short(figure, claim, sign) / size), limits]

    def beside(self, figure: str, claim: float, sign: float) -> Simulated:
        """What is stated of it beside a claim; arguments as those of ``short``."""
        if not np.isfinite(self.strayed):
            return Simulated(followed=False, note=self.note)
        reported = {"strayed": self.strayed, "passed": self.passed, "limit": self.limit, "note": self.note or None}
        return Simulated(**self.values, **reported, followed=self.followed, short_by=self.short(figure, claim, sign))


def left_out(why: str) -> list[Check]:
    """The checks of a hop that cannot be made."""
    return [replace(check, left_out=why) for check in (VALUE, LIMITS)]


def not_simulated(design: Design) -> str:
    """Why a leg's hop cannot be simulated in one piece; empty if it can."""
    if loop_axes(design.leg):
        return "a leg that closes a loop with its guides is not simulated in one piece"
    added = added_states(design.leg, physical_parameters(design.leg))
    if added.steady < len(added.of):
        return "a leg whose drives have states of their own is not simulated in one piece"
    return ""


def whole_hop_rollout(
    design: Design,
    tables: Mapping[str, Table],
    figure: str = "clearance_m",
    ends: str = "window",
) -> WholeHopRollout:
    """Simulate the whole hop of a plan that was made for ``figure``; ``ends`` as in ``verify_plan``."""
    robot = build_robot(design.leg)
    machine = Machine(robot)
    drives = Drives.of(robot)
    if (hop := _from_its_start(machine, drives, tables)) is None:
        return WholeHopRollout({}, np.inf, np.inf, "the simulation failed")
    found, state = hop
    scale = Scale.of(design.leg)
    units = scale.states(robot.leg)
    strayed = max(
        float(np.abs((getattr(found[name], part) - getattr(table, part)) / unit).max())
        for name, table in tables.items()
        for part, unit in zip("qv", units, strict=True)
    )
    if design.hop.periodic:
        strayed = max(strayed, closure(machine, joints_at(tables[STANCE], 0), *state[:2], rate=1 / scale.time))
    values = _values(machine, robot, design.hop, found, figure)
    shares = {
        limit_words(name, limit): float(excess.max())
        for name, table in found.items()
        for limit, excess in limits_of(
            machine,
            robot,
            design,
            name,
            tuple(table.flat("q", "v", "asked", "f")),
            windowed(design, name, ends),
            drive=None if table.drive is None else table.flat("drive")[0],
        ).items()
        if limit.kind is not Kind.REGION  # kept by clamping
    }
    if ends == "required clearance":
        shares["clearance asked for"] = float((design.hop.clearance or 0.0) - values["clearance_m"]) / reach(design.leg)
    limit = max(shares, key=lambda key: shares[key])
    return WholeHopRollout(values, strayed, max(shares[limit], 0.0), limit)


def sharper_gears_clearance(design: Design, tables: Mapping[str, Table]) -> float | None:
    """Clearance [m] of the hop with gears that change from driving to braking, and from one way to the other, SHARPER times as
    sharply: by how much it differs is what the hop owes to their smooth law. None where they lose nothing, or that fails."""
    robot = build_robot(design.leg)
    machine, drives = Machine(robot), Drives.of(robot)
    if drives.gear is None or drives.states.sprung:
        return None
    gear = replace(drives.gear, slow=drives.gear.slow / SHARPER, sharp=drives.gear.sharp / SHARPER)
    hop = _from_its_start(machine, replace(drives, gear=gear), tables)
    return None if hop is None else _clearance(machine, hop[0][FLIGHT].q[-1, -1])


def _from_its_start(
    machine: Machine, drives: Drives, tables: Mapping[str, Table]
) -> tuple[dict[str, Table], LegState] | None:
    """``simulated_hop`` from the plan's first state; None if that fails."""
    try:
        return simulated_hop(machine, drives, tables, state_of(tables[STANCE]))
    except (ArithmeticError, ValueError, np.linalg.LinAlgError):
        return None


def _values(
    machine: Machine, robot: Robot, hop: HopSettings, tables: Mapping[str, Table], figure: str
) -> dict[str, float]:
    """Clearance and height of the body [m] when flight ends, and the measure asked for."""
    end = tables[FLIGHT].q[-1, -1]
    values = {"clearance_m": _clearance(machine, end), "apex_m": float(end[1])}
    return values | {name: MEASURES[name](robot, tables, hop) for name in MEASURES.keys() & {figure}}


def _clearance(machine: Machine, q: np.ndarray) -> float:
    """Height of the lowest of joints and foot [m] at q (2 + n)."""
    heights = machine.points(q)
    return min(float(heights[name][1]) for name in machine.robot.point_names)
