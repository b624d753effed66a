"""The leg as Pinocchio's C++ moves it: what verification and simulation stand on, apart from the planner's CasADi."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from hopopt.leg.kinematics import contact_axes
from hopopt.leg.robot import BASE, Robot


@dataclass(frozen=True)
class StanceTerms:
    """Stance at one state: q, v (BASE + n) with the foot at the origin, mass matrix M (BASE + n square), bias
    (BASE + n, what M a must be added to when only the joints accelerate), joint part of the foot Jacobian (2 x n),
    drift (2) of the foot [m/s^2], held: coordinates of the body that no guide lets move.

    With base_a = -jacobian a_j - drift eliminated, tau = mass_matrix a_j + joint_bias, less what a guide takes.
    """

    q: np.ndarray
    v: np.ndarray
    M: np.ndarray
    bias: np.ndarray
    jacobian: np.ndarray
    drift: np.ndarray
    held: Sequence[int] = ()

    @property
    def mass_matrix(self) -> np.ndarray:
        """(n, n) [kg m^2]."""
        return self._reduced(self._columns())

    @property
    def joint_bias(self) -> np.ndarray:
        """(n,) [N m]."""
        return self._reduced(self.bias)

    def acceleration(self, tau: np.ndarray) -> np.ndarray:
        """Joint accelerations [rad/s^2] under joint torques tau (n) [N m]."""
        return self._response(tau)[0]

    def force(self, a_j: np.ndarray) -> np.ndarray:
        """Force (x, z) [N] on the leg from outside at joint accelerations a_j: of the ground, and of guides that hold."""
        return self._columns()[:BASE] @ a_j + self.bias[:BASE]

    def contact_force(self, tau: np.ndarray) -> np.ndarray:
        """Force (x, z) [N] of the ground alone under joint torques tau (n) [N m]."""
        a_j, guides = self._response(tau)
        force = self.force(a_j)
        force[list(self.held)] -= guides
        return force

    def _response(self, tau: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Joint accelerations, and forces of the guides that hold the body (one for each) [N]."""
        M, b, n = self._reduced(self._columns()), tau - self._reduced(self.bias), len(tau)
        if not self.held:
            return np.linalg.solve(M, b), np.zeros(0)
        J = self.jacobian[list(self.held)]
        both = np.block([[M, J.T], [J, np.zeros((len(J), len(J)))]])
        found = np.linalg.solve(both, np.concatenate([b, -self.drift[list(self.held)]]))
        return found[:n], found[n:]

    def _columns(self) -> np.ndarray:
        """M times the motion that unit joint accelerations make, (BASE + n, n)."""
        return self.M[:, BASE:] - self.M[:, :BASE] @ self.jacobian

    def _reduced(self, forces: np.ndarray) -> np.ndarray:
        return forces[BASE:] - self.jacobian.T @ forces[:BASE]


class Machine:
    """Pinocchio's view of the leg: dynamics with and without the foot on the ground."""

    def __init__(self, robot: Robot):
        self.robot, self.model, self.data, self.n = robot, robot.model, robot.model.createData(), len(robot.joints)
        self.leg, self.turning, self.chains = robot.leg, robot.turning, robot.chains
        self._plain = (
            self.turning is None and not robot.leg.follows
        )  # else Pinocchio's forward dynamics does not know it
        self.contact = list(contact_axes(robot.leg))
        self.held = [] if "x" in robot.leg.guides else [0]  # coordinates of the body that no guide lets move
        self.frames = {name: self.model.getFrameId(f"point_{name}") for name in robot.points}
        self.foot = self.frames["foot"]
        self._lower = np.tril_indices(self.model.nv, -1)
        self._axes = slice(0, 3, 1 if 1 in self.contact else 2)  # of the world, those of the contact force
        self._nothing, self._along_guides = np.zeros(self.model.nv), np.zeros(BASE)
        self._held_rows = np.eye(self.model.nv)[self.held]
        self.mass = float(sum(i.mass for i in self.model.inertias))
        self.gravity = np.array(self.model.gravity.linear)[[0, 2]]

    def __reduce__(self) -> tuple[type["Machine"], tuple[Robot]]:
        """Made anew in another process: Pinocchio's data are scratch, and its oldest supported release cannot read them back."""
        return Machine, (self.robot,)

    def foot_jacobian(self, q: np.ndarray) -> np.ndarray:
        """Along the axes of the contact force: world x and z, (2, 2 + n); x, y and z where the leg leaves the plane."""
        pin.computeJointJacobians(self.model, self.data, q)
        return pin.getFrameJacobian(self.model, self.data, self.foot, pin.LOCAL_WORLD_ALIGNED)[self._axes]

    def mass_matrix(self, q: np.ndarray) -> np.ndarray:
        """(BASE + n square), with the rotors' inertia; Pinocchio fills the upper triangle."""
        if self.chains:
            M = self.chains.mass_matrix(q)
        else:
            M = pin.crba(self.model, self.data, q)
            M[self._lower] = M.T[self._lower]
        if self.turning:
            M[BASE:, BASE:] += self.turning.inertia(q[BASE:])
        return M

    def bias(self, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Forces (BASE + n) that keep the leg from accelerating: Coriolis, centrifugal, gravity, and of rotors."""
        if self.chains:
            forces = self.chains.inverse_dynamics(q, v, self._nothing)
        else:
            forces = pin.nonLinearEffects(self.model, self.data, q, v)
        return forces + self._of_rotors(q, v, self._nothing) if self.turning else forces

    def _of_rotors(self, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        """What rotors ask (BASE + n) where drives do not turn as joints do."""
        assert self.turning is not None
        return np.concatenate([self._along_guides, self.turning.force(q[BASE:], v[BASE:], a[BASE:])])

    def acceleration(self, q: np.ndarray, v: np.ndarray, tau: np.ndarray, contact: bool) -> np.ndarray:
        """Forward dynamics [rad/s^2, m/s^2]; in contact the foot's acceleration is held at zero."""
        forces = self._forces(q, tau)
        if not contact and not self.held and self._plain:
            return pin.aba(self.model, self.data, q, v, forces)
        return self._constrained(q, v, forces, *self._held_still(q, v, contact))[0]

    def _constrained(
        self, q: np.ndarray, v: np.ndarray, forces: np.ndarray, rows: np.ndarray, drift: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Accelerations under forces where rows @ a + drift = 0, and the forces along these rows."""
        if self._plain:
            a = pin.forwardDynamics(self.model, self.data, forces, rows, drift)
            return a, self.data.lambda_c.copy()
        M, rows = self.mass_matrix(q), rows.copy()
        both = np.block([[M, rows.T], [rows, np.zeros((len(rows), len(rows)))]])
        found = np.linalg.solve(both, np.concatenate([forces - self.bias(q, v), -drift]))
        return found[: len(M)], -found[len(M) :]

    def inverse_dynamics(self, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        """Generalised forces (BASE + n) [N, N m] of drives, guides and ground under which the leg moves so."""
        dynamics = self.chains.inverse_dynamics if self.chains else self._open_chain
        forces = dynamics(q, v, a)
        if self.turning:
            forces += self._of_rotors(q, v, a)
        return forces - self.robot.spring_forces(q) if self.robot.springs else forces

    def _open_chain(self, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        return pin.rnea(self.model, self.data, q, v, a).copy()

    def _forces(self, q: np.ndarray, tau: np.ndarray) -> np.ndarray:
        """Generalised forces (BASE + n) [N, N m] of joint torques (n) [N m] and of the springs."""
        forces = np.concatenate([self._along_guides, tau])
        return forces + self.robot.spring_forces(q) if self.robot.springs else forces

    def _held_still(self, q: np.ndarray, v: np.ndarray, contact: bool) -> tuple[np.ndarray, np.ndarray]:
        """Rows of what must not accelerate, in contact the foot's along the contact force, then what no guide lets move;
        and their accelerations [m/s^2] if no coordinate accelerates. The equations of motion are ready in ``data``."""
        pin.forwardKinematics(self.model, self.data, q, v, self._nothing)
        if self._plain:
            pin.computeAllTerms(self.model, self.data, q, v)
        if not contact:
            return self._held_rows, np.zeros(len(self.held))
        if not self._plain:
            pin.computeJointJacobians(self.model, self.data, q)
        J = pin.getFrameJacobian(self.model, self.data, self.foot, pin.LOCAL_WORLD_ALIGNED)[self._axes]
        foot = pin.getFrameClassicalAcceleration(self.model, self.data, self.foot, pin.LOCAL_WORLD_ALIGNED)
        drift = foot.linear[self._axes]
        if self.held:
            return np.vstack([J, self._held_rows]), np.concatenate([drift, np.zeros(len(self.held))])
        return J, drift

    def pinned(self, q_j: np.ndarray, v_j: np.ndarray, tau: np.ndarray) -> tuple[np.ndarray, ...]:
        """q, v, a (BASE + n) of the leg and contact force (2) [N] with the foot held at the origin, for joint angles,
        speeds and torques; on two guides, in the plane. Where the body is and how fast it moves changes nothing else."""
        q, v = np.concatenate([self._along_guides, q_j]), np.concatenate([self._along_guides, v_j])
        J, drift = self._held_still(q, v, True)
        a, force = self._constrained(q, v, self._forces(q, tau), J, drift)
        q[:BASE] = -pin.updateFramePlacement(self.model, self.data, self.foot).translation[self._axes]
        v[:BASE] = -J[:, BASE:] @ v_j
        return q, v, a, force

    def stance_terms(self, q_j: np.ndarray, v_j: np.ndarray) -> "StanceTerms":
        """The equations of motion with the foot pinned at the origin, in the joints alone."""
        q, v = np.concatenate([np.zeros(BASE), q_j]), np.concatenate([np.zeros(BASE), v_j])
        pin.forwardKinematics(self.model, self.data, q, v, np.zeros_like(v))
        pin.updateFramePlacement(self.model, self.data, self.foot)
        q[:BASE] = -self.data.oMf[self.foot].translation[[0, 2]]
        drift = pin.getFrameClassicalAcceleration(self.model, self.data, self.foot, pin.LOCAL_WORLD_ALIGNED).linear
        jacobian = pin.computeFrameJacobian(self.model, self.data, q, self.foot, pin.LOCAL_WORLD_ALIGNED)[[0, 2], BASE:]
        v[:BASE] = -jacobian @ v_j
        M = self.mass_matrix(q)
        bias = self.bias(q, v) - M[:, :BASE] @ drift[[0, 2]]
        if self.robot.springs:
            bias = bias - self.robot.spring_forces(q)
        return StanceTerms(q, v, M, bias, jacobian, drift[[0, 2]], self.held)

    def on_guides(self, q_j: np.ndarray, v_j: np.ndarray, foot: float, body: float) -> tuple[np.ndarray, np.ndarray]:
        """Angles and speeds of the joints, brought back to where a slider at x = ``body`` and a foot at x = ``foot`` [m] let
        them be; on two guides as they are."""
        if not self.held:
            return q_j, v_j
        terms = self.stance_terms(q_j, v_j)
        J = terms.jacobian[:1]
        back = np.linalg.pinv(J)
        return q_j + back @ np.array([terms.q[0] + foot - body]), v_j - back @ (J @ v_j)

    def touch_down(self, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Speeds just after the foot has hit the ground and stays, as ``impact`` gives them."""
        return self.impact(q, v)[0]

    def impact(self, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Speeds just after the foot has hit the ground and stays (plastic impact; Featherstone, RBDA, 11.7), and what
        the ground, then the guides, give to the leg [N s]."""
        M = self.mass_matrix(q)
        J = np.vstack([self.foot_jacobian(q), np.eye(len(v))[self.held]])  # a guide holds in an impact too
        step = np.linalg.solve(M, J.T)
        impulse = -np.linalg.solve(J @ step, J @ v)
        return v + step @ impulse, impulse

    def foot_beside(self, q: np.ndarray) -> float:
        """Place of the foot across the plane, y [m]."""
        pin.forwardKinematics(self.model, self.data, q)
        return float(pin.updateFramePlacement(self.model, self.data, self.foot).translation[1])

    def foot_motion(self, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Position [m] and velocity [m/s] of the foot, (2,) each."""
        pin.forwardKinematics(self.model, self.data, q, v)
        pin.updateFramePlacement(self.model, self.data, self.foot)
        velocity = pin.getFrameVelocity(self.model, self.data, self.foot, pin.LOCAL_WORLD_ALIGNED).linear
        return self.data.oMf[self.foot].translation[[0, 2]].copy(), velocity[[0, 2]].copy()

    def foot_acceleration(self, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        """Acceleration [m/s^2] of the foot, (2,)."""
        pin.forwardKinematics(self.model, self.data, q, v, a)
        pin.updateFramePlacement(self.model, self.data, self.foot)
        reference = pin.LOCAL_WORLD_ALIGNED
        return pin.getFrameClassicalAcceleration(self.model, self.data, self.foot, reference).linear[[0, 2]]

    def points(self, q: np.ndarray) -> dict[str, np.ndarray]:
        """World x, z [m] of joints, foot and centre of mass."""
        return {name: path[0] for name, path in {**self.paths(q[None]), "com": self.com_path(q[None])}.items()}

    def paths(self, q: np.ndarray) -> dict[str, np.ndarray]:
        """World x, z [m] of joints and foot, and of all else of ``Robot.point_names``, name -> (k, 2), at k poses q (k, BASE + n)."""
        positions = np.empty((len(self.frames), len(q), 3))
        for k, row in enumerate(q):
            pin.framesForwardKinematics(self.model, self.data, row)
            for place, frame in zip(positions, self.frames.values(), strict=True):
                place[k] = self.data.oMf[frame].translation
        found = {name: place[:, [0, 2]] for name, place in zip(self.frames, positions, strict=True)}
        if self.chains:
            ends = [self.chains.crank_ends(row) for row in q]
            found |= {name: np.array([end[name] for end in ends]) for name in ends[0]}
        return found

    def com_path(self, q: np.ndarray) -> np.ndarray:
        """World x, z [m] of the centre of mass at k poses q (k, BASE + n), (k, 2)."""
        if self.chains:
            return np.array([self.chains.com(row, self._nothing)[0] for row in q])
        return np.array([pin.centerOfMass(self.model, self.data, row) for row in q])[:, [0, 2]]

    def com_velocity(self, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """World x', z' [m/s] of the centre of mass."""
        if self.chains:
            return self.chains.com(q, v)[1]
        pin.centerOfMass(self.model, self.data, q, v)
        return self.data.vcom[0][[0, 2]].copy()

    def energy(self, q: np.ndarray, v: np.ndarray) -> float:
        """Kinetic (with the rotors') and potential energy (with the springs') [J]."""
        rotors = 0.5 * float(np.sum(self.robot.rotors * self.robot.rotor_speeds(q, v) ** 2))
        stored = self.robot.springs.energy(list(q[BASE:]))
        return self._links_energy(q, v) + rotors + float(stored)

    def _links_energy(self, q: np.ndarray, v: np.ndarray) -> float:
        """Kinetic and potential energy of body and links [J]."""
        if self.chains:
            return sum(self.chains.energies(q, v))
        if self.leg.follows or self.leg.sliding:  # Pinocchio has no energy of the one, and rotors in that of the other
            self.com_velocity(q, v)
            bodies = zip(self.model.inertias[1:], self.data.v[1:], strict=True)
            fall = self.model.gravity.linear @ self.data.com[0]
            return sum(body.vtiv(speed) for body, speed in bodies) / 2 - self.mass * float(fall)
        kinetic = pin.computeKineticEnergy(self.model, self.data, q, v)
        return kinetic + pin.computePotentialEnergy(self.model, self.data, q)
