"""Generalised momenta of a leg at the samples of a log, as functions of its masses and its rotors' inertia.

p = dT/dv, F = d(T - V)/dq and the linear momentum P of ``identification_rows``: T is the kinetic energy and V the potential
energy of the leg in the joints alone, springs beside the drives counted.
"""

from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np

from hopopt.design import Design
from hopopt.leg.dynamics import LegDynamics
from hopopt.leg.robot import BASE, build_robot, link_bodies
from hopopt.robot_data.log_windows import LogSamples


class LegMomenta:
    """p (n), F (n) and P (2) of a leg at samples, its bodies' masses scaled and its rotors' inertia at the joints free."""

    def __init__(self, design: Design):
        self.robot = build_robot(design.leg)
        self.n = len(self.robot.joints)
        self.masses = np.array([body.mass for body in link_bodies(design.leg, self.robot.parameters)[1:]])
        self.gravity = np.array(self.robot.model.gravity.linear[[0, 2]])
        self._functions = {contact: self._functions_in(contact) for contact in (True, False)}

    def _functions_in(self, contact: bool) -> tuple[ca.Function, ca.Function]:
        """(y, dy/dscales) and (dy/dq, dy/dv) of y = (p, F, P), from q, v and scales (2 n + 1)."""
        n, leg = self.n, LegDynamics(self.robot, self.robot.parameters)
        q, v, scales = ca.SX.sym("q", n), ca.SX.sym("v", n), ca.SX.sym("s", 2 * n + 1)
        leg.bodies = [leg.bodies[0]] + [
            replace(
                body,
                mass=scales[k] * body.mass,
                inertia=tuple(scales[k] * x for x in body.inertia),
                armature=scales[n + k] if k else 0.0,
            )
            for k, body in enumerate(leg.bodies[1:])
        ]
        still = ca.SX.zeros(n + BASE)
        whole, speed, _ = leg.stance_pose(q, v) if contact else leg.flight_pose(still[:BASE], still[:BASE], q, v)
        momentum = leg.inverse_dynamics(whole, still, speed) - leg.inverse_dynamics(whole, still, still)
        energy = 0.5 * ca.dot(speed, momentum)
        if contact:
            energy += sum(body.mass for body in leg.bodies) * ca.dot(self.gravity, leg.points(whole)["com"])
        force = ca.gradient(energy, q) + ca.vertcat(*leg.springs.torques(ca.vertsplit(q)))
        y = ca.vertcat(ca.gradient(energy, v), force, momentum[:BASE])
        values = ca.Function("y", [q, v, scales], [y, ca.densify(ca.jacobian(y, scales))])
        motion = ca.Function("dy", [q, v, scales], [ca.densify(ca.jacobian(y, x)) for x in (q, v)])
        return values, motion

    def at(self, s: LogSamples, scales: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """y (k, 2 n + 2), and its derivatives by the scales (k, 2 n + 2, 2 n + 1), for scales (2 n + 1) of the body's and the
        links' masses [1] and rotor inertia at the joints [kg m^2]."""
        y, by_scales = self._mapped(0, s, scales, (1, 2 * self.n + 1))
        return y[:, :, 0], by_scales

    def by_motion(self, s: LogSamples, scales: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of y by q and by v, (k, 2 n + 2, n) each."""
        by_q, by_v = self._mapped(1, s, scales, (self.n, self.n))
        return by_q, by_v

    def _mapped(self, which: int, s: LogSamples, scales: np.ndarray, widths: tuple[int, int]) -> list[np.ndarray]:
        k, height = len(s.t), 2 * self.n + BASE
        found = [np.zeros((k, height, width)) for width in widths]
        for contact, functions in self._functions.items():
            here = np.flatnonzero(s.contact == contact)
            values: Any = functions[which].map(len(here))(s.q[here].T, s.v[here].T, scales) if len(here) else ()
            for array, value, width in zip(found, values, widths, strict=False):
                array[here] = np.asarray(value).reshape(height, len(here), width).transpose(1, 0, 2)
        return found
