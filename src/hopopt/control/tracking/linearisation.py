"""How a leg answers to joint torques near a plan: by compiled equations of motion, or by Pinocchio where they do not take it."""

import numpy as np

from hopopt.leg.kinematics import can_slip
from hopopt.leg.robot import BASE
from hopopt.leg.scales import Scale
from hopopt.sim.ground import pinned
from hopopt.sim.machine import Machine

STEP = 1e-5  # [rad, rad/s, N m] on the paper's leg, of the central differences that linearise the dynamics


class Linearisation:
    """Accelerations (n) [rad/s^2] of the joints, then the force (x, z) [N] on the foot, by z = (q, v, tau) of the joints (3 n).

    The foot is held still in contact; in flight the body may do whatever it does.
    """

    def __init__(self, machine: Machine):
        self.machine = machine
        scale, n = Scale.of(machine.leg), len(machine.robot.joints)
        self._steps = STEP * np.repeat([1.0, 1 / scale.time, scale.force * scale.length], n)
        self._leg = pinned.free_leg(machine.robot) if can_slip(machine.leg) else None

    def answers(self, z: np.ndarray, contact: bool) -> np.ndarray:
        """At k places z (k, 3 n), (k, n + 2)."""
        if self._leg is not None:
            return pinned.answers(self._leg, z, contact)
        return np.array([self._by_pinocchio(row, contact) for row in z])

    def slopes(self, z: np.ndarray, contact: bool) -> np.ndarray:
        """How they change with each entry at k places z (k, 3 n), (k, n + 2, 3 n)."""
        if self._leg is not None:
            return pinned.slopes(self._leg, z, contact, self._steps)
        columns = [self.answers(z + d, contact) - self.answers(z - d, contact) for d in np.diag(self._steps)]
        return np.stack(columns, axis=2) / (2 * self._steps)

    def _by_pinocchio(self, z: np.ndarray, contact: bool) -> np.ndarray:
        q, v, tau = np.split(z, 3)
        if contact:
            terms = self.machine.stance_terms(q, v)
            return np.concatenate([terms.acceleration(tau), terms.contact_force(tau)])
        q, v = (np.concatenate([np.zeros(BASE), x]) for x in (q, v))
        return np.concatenate([self.machine.acceleration(q, v, tau, False)[BASE:], np.zeros(BASE)])
