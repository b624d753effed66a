"""Is the plan true? Every claim checked by code the planner did not use: NumPy, SciPy and Pinocchio's C++.

What is checked is the plan's own table: times, positions, speeds, torques and contact forces at Chebyshev
points of every interval, as it lies in the result file. The leg model and the motor law are shared with the
planner, nothing else.
"""

from collections.abc import Iterator, Mapping, Sequence
from itertools import chain
from typing import Any

import numpy as np

from hopopt.design import Design, HopSettings
from hopopt.leg.robot import BASE, Robot, build_robot
from hopopt.leg.scales import Scale, weight
from hopopt.sim.machine import Machine
from hopopt.verify.check import BALANCE, EXACT, FIGURE_TOLERANCE, LIMIT, Check
from hopopt.verify.drives import drive_checks, drives_go_on
from hopopt.verify.hops.collision import collision_checks
from hopopt.verify.hops.heat import heat_checks
from hopopt.verify.hops.landing import landed_checks, landing, lift_off
from hopopt.verify.hops.periodic import SMALL, periodic_checks
from hopopt.verify.limits import limit_words, limits_of, windowed
from hopopt.verify.measures import MAY_BE_MORE, MEASURES, SMALLEST, joint_work
from hopopt.verify.replay import replay
from hopopt.verify.table import DESCENT, FLIGHT, LANDING, NORMALISED_TIMES, STANCE, Table, dense, quadrature

LEAST_FORCE_SCALE = 1.0  # [N] on the paper's leg: the least that forces and torques are relative to
BETWEEN = np.linspace(0.0, 1.0, 25)  # where limits are checked in every interval


def verify_plan(
    design: Design, tables: Mapping[str, Table], claims: Mapping[str, float], ends: str | None = None
) -> list[Check]:
    """All checks of a plan; ``claims`` holds what is to be printed: ``clearance_m``, and ``apex_m`` or one of MEASURES.

    ends: whether the foot must end within its "window", or the leg reach hop.clearance too ("required clearance"), or neither
    ("free"); by default as the claims imply.
    """
    ends = ends or (
        "free" if "apex_m" in claims else "required clearance" if claims.keys() & MEASURES.keys() else "window"
    )
    robot = build_robot(design.leg)
    machine = Machine(robot)
    checks = [
        *_ends(machine, design, tables),
        durations(design, tables),
        Check("lift-off", largest(lift_off(machine, tables[STANCE], tables[FLIGHT])), EXACT, "SI"),
        _clearance(machine, design, tables[FLIGHT], claims),
        *_measured(robot, design.hop, tables, claims),
    ]
    if ends == "required clearance":
        missing = float(design.hop.clearance or 0.0) - claims["clearance_m"]
        checks.append(Check("clearance asked for", max(missing, 0.0), EXACT, "m"))
    for name, table in tables.items():
        checks += phase_checks(machine, robot, design, name, table, windowed(design, name, ends))
    more = (drives_go_on(machine, design, tables), heat_checks(design, robot, tables), collision_checks(design, tables))
    return [*checks, *chain.from_iterable(more)]


def phase_checks(
    machine: Machine, robot: Robot, design: Design, name: str, table: Table, window: bool = False
) -> list[Check]:
    """That one phase obeys the equations of motion and every limit; window: whether the foot must end within its window."""
    return [
        _continuity(name, table),
        replay(machine, name, table),
        _inverse_dynamics(machine, name, table),
        _energy(machine, name, table),
        _impulse(machine, name, table),
        *drive_checks(robot, name, table),
        *_limits(machine, robot, design, name, table, window),
    ]


def _ends(machine: Machine, design: Design, tables: Mapping[str, Table]) -> Iterator[Check]:
    """How the hop begins, and how it lands if it does."""
    if design.hop.periodic:
        yield from periodic_checks(machine, design, tables)
        return
    yield _start(machine, design, tables[STANCE])
    if LANDING in tables:
        yield from landed_checks(machine, design, tables)
        return
    if DESCENT in tables:
        for name, parts in landing(machine, tables[FLIGHT], tables[DESCENT]):
            yield Check(name, largest(parts), EXACT, "SI")


def largest(differences: Sequence[Any]) -> float:
    """Largest absolute value of several arrays; not a number if any of it is not."""
    return float(np.max(np.concatenate([np.abs(np.ravel(d)) for d in differences]), initial=0.0))


def _start(machine: Machine, design: Design, stance: Table) -> Check:
    """At rest at time zero, the foot on the ground where the problem file puts it."""
    q, v, start = stance.q[0, 0], stance.v[0, 0], design.start
    points = machine.points(q)
    if start.joint_angles is not None:
        wrong = q[BASE:] - np.array(start.joint_angles)
    else:
        wrong = points["foot"] - q[:BASE] - np.array([start.foot_x, -float(start.hip_height or 0.0)])
    return Check("start", largest([wrong, points["foot"], v, stance.t[0, 0]]), EXACT, "SI")


def durations(design: Design, tables: Mapping[str, Table]) -> Check:
    """Every phase lasts as long as it may, and no interval runs backwards."""
    over = []
    for name, table in tables.items():
        low, high = getattr(design.hop, f"{name}_duration")
        lasted = table.t[-1, -1] - table.t[0, 0]
        over += [np.maximum(low - lasted, lasted - high), -np.diff(table.t, axis=1).min()]
    return Check("durations", float(np.maximum(np.max(over), 0.0)), EXACT, "s")


def _clearance(machine: Machine, design: Design, flight: Table, claims: Mapping[str, float]) -> Check:
    """Height of the lowest point at the end, by Pinocchio's forward kinematics, against the claim."""
    points = machine.points(flight.q[-1, -1])
    lowest = min(points[name][1] for name in machine.robot.point_names)
    wrong = [lowest - claims["clearance_m"]]
    if "apex_m" in claims:
        wrong.append(flight.q[-1, -1, 1] - claims["apex_m"])
    return Check("claimed height", largest(wrong), EXACT, "m")


def _measured(
    robot: Robot, hop: HopSettings, tables: Mapping[str, Table], claims: Mapping[str, float]
) -> Iterator[Check]:
    """Work, time or peaks of the table against the claim, relative to it."""
    smallest = {name: size * Scale.of(robot.leg).unit("J") for name, size in SMALLEST.items()}
    for name in claims.keys() & MEASURES.keys():
        value, claim = MEASURES[name](robot, tables, hop), claims[name]
        wrong = max(claim - value, 0.0) if name in MAY_BE_MORE else abs(value - claim)
        yield Check(f"claimed {name}", wrong / max(abs(claim), smallest.get(name, 1e-9)), FIGURE_TOLERANCE, "relative")


def _continuity(phase: str, table: Table) -> Check:
    """Each interval begins where the one before it ends."""
    jumps = [x[1:, 0] - x[:-1, -1] for x in (table.q, table.v, table.t)]
    return Check(f"{phase} continuity", largest(jumps), EXACT, "SI")


def _inverse_dynamics(machine: Machine, phase: str, table: Table) -> Check:
    """Pinocchio's inverse dynamics against the plan's torques and contact forces, relative to the largest."""
    wrong = []
    for q, v, a, tau, f in zip(*table.flat("q", "v", "a", "tau", "f"), strict=True):
        given = np.concatenate([np.zeros(BASE), tau]) + machine.foot_jacobian(q).T @ f
        missing = machine.inverse_dynamics(q, v, a) - given
        missing[machine.held] = 0.0  # what a guide holds
        wrong.append(np.abs(missing).max())
    size = max(LEAST_FORCE_SCALE * Scale.of(machine.leg).force, np.abs(table.tau).max(), np.abs(table.f).max())
    at = table.t.ravel()[int(np.argmax(wrong))]
    return Check(f"{phase} inverse dynamics", float(np.max(wrong) / size), 1e-9, "relative", f"at {at:.4f} s")


def _energy(machine: Machine, phase: str, table: Table) -> Check:
    """Work of the joints = change of kinetic and potential energy, relative to the work done."""
    work, size = joint_work(table)
    gained = machine.energy(table.q[-1, -1], table.v[-1, -1]) - machine.energy(table.q[0, 0], table.v[0, 0])
    return Check(
        f"{phase} energy balance",
        abs(gained - work) / max(size, SMALL * Scale.of(machine.leg).unit("J")),
        BALANCE,
        "relative",
    )


def _impulse(machine: Machine, phase: str, table: Table) -> Check:
    """Impulse of ground force and weight = change of momentum, relative to the weight's impulse, where no guide holds."""
    h, force = table.t[:, -1] - table.t[:, 0], table.f[..., [0, -1]]
    impulse = np.einsum("i,k,ikx->x", h, quadrature(), force) + machine.mass * machine.gravity * h.sum()
    momentum = [machine.mass * machine.com_velocity(table.q[i, i], table.v[i, i]) for i in (-1, 0)]
    size = weight(machine.model) * h.sum()
    free = [k for k in range(BASE) if k not in machine.held]
    wrong = float(np.abs(momentum[0] - momentum[1] - impulse)[free].max() / size)
    return Check(f"{phase} impulse balance", wrong, BALANCE, "relative")


def _limits(machine: Machine, robot: Robot, design: Design, phase: str, table: Table, window: bool) -> Iterator[Check]:
    """Every limit at 25 normalised times of every interval, its excess as a share of the limit's range."""
    between = {
        name: dense(NORMALISED_TIMES, getattr(table, name), BETWEEN)
        for name in ("t", "q", "v", "asked", "f", "asked_rate", "force_rate")
    }
    t, *motion, of_torque, of_force = (x.reshape(-1, *x.shape[2:]) for x in between.values())
    own = None if table.drive is None else dense(NORMALISED_TIMES, table.drive, BETWEEN).reshape(len(t), -1)
    rates = of_torque, of_force
    for limit, excess in limits_of(machine, robot, design, phase, tuple(motion), window, rates, own).items():
        at = int(np.argmax(excess))
        where = f"at {t[at] if len(excess) == len(t) else t[-1]:.4f} s"
        yield Check(limit_words(phase, limit), float(max(excess[at], 0.0)), LIMIT, "of its range", where)
