"""User-defined functions, checked on the plan's table: evaluated in numbers, with Pinocchio's points, between the nodes."""

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

import casadi as ca
import numpy as np

from hopopt.drivetrain.dynamics import added_states
from hopopt.leg.robot import Robot
from hopopt.ocp.custom import CUSTOM_PHASES, Custom, Moment, symbols
from hopopt.ocp.objectives.objective import HopObjective
from hopopt.sim.machine import Machine
from hopopt.verify.check import LIMIT, Check
from hopopt.verify.measures import SAMPLES_OF_INTERVAL, dense, integral, normalised_times_of
from hopopt.verify.table import Table

CLAIM = 1e-4  # relative
NO_NUMBERS: Mapping[str, float] = MappingProxyType({})
SAMPLE_STRIDE = 8  # of the fine normalised times, where a constraint is looked at


def custom_checks(
    robot: Robot, tables: Mapping[str, Table], goal: HopObjective, constraints: Sequence[Custom], claim: float | None,
    numbers: Mapping[str, float] = NO_NUMBERS,
) -> list[Check]:  # fmt: skip
    """The claimed value of a user-defined objective, and every user-defined constraint in its phases; ``numbers``: of the
    user's own, by name."""
    checks = []
    if goal.custom is not None and claim is not None:
        value = objective_of(robot, tables, goal.custom, numbers)
        wrong = abs(value - claim) / max(abs(claim), 1e-3 * goal.custom.terms.scale)
        checks.append(Check(f"claimed {goal.name}", wrong, CLAIM, "relative"))
    for c in constraints:
        for phase, table in tables.items():
            if kind(phase) in c.terms.phases:
                checks.append(_constraint(robot, phase, table, c, numbers))
    return checks


def _constraint(robot: Robot, phase: str, table: Table, c: Custom, numbers: Mapping[str, float]) -> Check:
    value = along(robot, phase, table, c, SAMPLES_OF_INTERVAL[::SAMPLE_STRIDE], numbers)
    low, high = c.terms.lower, c.terms.upper
    excess = np.maximum(low - value, value - high).max(axis=-1) / c.terms.scale
    k, i = np.unravel_index(int(np.argmax(excess)), excess.shape)
    t = table.t[k, 0] + SAMPLES_OF_INTERVAL[::SAMPLE_STRIDE][i] * (table.t[k, -1] - table.t[k, 0])
    return Check(f"{phase} {c.name}", float(max(excess[k, i], 0.0)), LIMIT, "of its range", f"at {t:.4f} s")


def objective_of(robot: Robot, tables: Mapping[str, Table], c: Custom, numbers: Mapping[str, float]) -> float:
    """What a user-defined objective is of a plan, by its table [the objective's unit]."""
    if c.terms.running:
        return sum(
            integral(t, along(robot, phase, t, c, SAMPLES_OF_INTERVAL, numbers)[..., 0]) for phase, t in tables.items()
        )
    stance, flight = (tables[phase] for phase in CUSTOM_PHASES)
    end = symbols(len(robot.joints), robot.point_names, True, numbers)
    assert end.lift_off is not None
    start = stance.t[0, 0]
    at_ends = [
        *_numbers(Machine(robot), flight.t[-1, -1] - start, flight.q[-1, -1], flight.v[-1, -1]),
        *_numbers(Machine(robot), stance.t[-1, -1] - start, stance.q[-1, -1], stance.v[-1, -1]),
    ]
    function = ca.Function("objective", [*_inputs(end), *_inputs(end.lift_off)], [c(end, 1)])
    return float(function(*at_ends))  # type: ignore[arg-type]


def along(
    robot: Robot,
    phase: str,
    table: Table,
    c: Custom,
    normalised_times: np.ndarray,
    numbers: Mapping[str, float] = NO_NUMBERS,
) -> np.ndarray:
    """The function's values (N, k, m) at the same normalised times of every interval."""
    changing = added_states(robot.leg, robot.parameters).steady == len(robot.joints)
    m = symbols(len(robot.joints), robot.point_names, False, numbers, kind(phase), table.f.shape[-1], changing)
    more, forces = [m.a, m.tau, m.f], [table.a, table.tau, table.f]
    if m.rates is not None:
        more, forces = [*more, m.rates.a, m.rates.tau, m.rates.f], [*forces, *map(table.rate, forces)]
    function = ca.Function("along", [*_inputs(m), *more], [ca.densify(c(m))])
    machine, at = Machine(robot), normalised_times_of(table)
    arrays = [dense(at, values, normalised_times) for values in (table.t, table.q, table.v, *forces)]
    t, q, v, *rest = (x.reshape(-1, *x.shape[2:]) for x in arrays)
    begin = table.t[0, 0]
    rows = [[*_numbers(machine, t[k] - begin, q[k], v[k]), *(x[k] for x in rest)] for k in range(len(t))]
    columns = [np.array(column).reshape(len(t), -1).T for column in zip(*rows, strict=True)]
    found = np.array(function.map(len(t))(*columns)).T
    return found.reshape(len(table.t), len(normalised_times), -1)


def kind(phase: str) -> str:
    """As what a user-defined function sees a phase: a descent is flight."""
    return "stance" if phase == "stance" else "flight"


def _inputs(m: Moment) -> list[Any]:
    return [m.t, m.q, m.v, *m.points.values(), m.com_v]


def _numbers(machine: Machine, t: float, q: np.ndarray, v: np.ndarray) -> list[Any]:
    """The same by Pinocchio."""
    points = machine.points(q)
    return [t, q, v, *(points[name] for name in (*machine.robot.point_names, "com")), machine.com_velocity(q, v)]
