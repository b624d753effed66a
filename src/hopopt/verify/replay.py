"""The plan's torques played into Pinocchio's C++, interval by interval."""

from collections.abc import Callable

import numpy as np
from scipy.integrate import solve_ivp

from hopopt.leg.scales import Scale
from hopopt.sim.machine import Machine
from hopopt.verify.check import STATE, Check
from hopopt.verify.table import POWERS, STANDING, TO_POWERS, Table


def replay(machine: Machine, phase: str, table: Table) -> Check:
    """The plan's torques played into Pinocchio, interval by interval, from the plan's own state."""
    worst, at = 0.0, 0.0
    units = np.concatenate(Scale.of(machine.leg).states(machine.leg))
    for k in range(len(table.t)):
        motion = (getattr(table, s)[k] for s in ("t", "q", "v", "tau"))
        wrong = float(np.abs(_replay_interval(machine, phase in STANDING, *motion) / units).max())
        if not wrong <= worst:  # also if it is not a number
            worst, at = wrong, float(table.t[k, 0])
    return Check(f"{phase} replay", worst, STATE, "SI", f"interval from {at:.4f} s")


def _replay_interval(
    machine: Machine, contact: bool, t: np.ndarray, q: np.ndarray, v: np.ndarray, tau: np.ndarray
) -> np.ndarray:
    m = q.shape[1]
    torque, h = TO_POWERS @ tau, t[-1] - t[0]

    def rates(s: float, x: np.ndarray) -> np.ndarray:
        given = (2 * s - 1) ** POWERS @ torque
        return h * np.concatenate([x[m:], machine.acceleration(x[:m], x[m:], given, contact)])

    return missed(rates, *(np.concatenate([q[k], v[k]]) for k in (0, -1)))


def missed(rates: Callable[[float, np.ndarray], np.ndarray], begin: np.ndarray, end: np.ndarray) -> np.ndarray:
    """What states at the end of an interval differ by from those that their rates, by normalised time, lead to; infinite where
    that cannot be integrated."""
    with np.errstate(over="ignore", invalid="ignore"):  # what runs away has failed
        run = solve_ivp(rates, (0.0, 1.0), begin, method="DOP853", rtol=1e-10, atol=1e-11, first_step=1.0)
    return run.y[:, -1] - end if run.success else np.full(len(end), np.inf)
