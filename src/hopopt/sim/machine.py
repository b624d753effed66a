"""The leg as Pinocchio's C++ moves it: what verification and simulation stand on, apart from the planner's CasADi."""

import numpy as np
import pinocchio as pin

from hopopt.leg.robot import BASE, Robot


class Machine:
    """Pinocchio's view of the leg: dynamics with and without the foot on the ground."""

    def __init__(self, robot: Robot):
        self.model, self.data, self.n = robot.model, robot.model.createData(), len(robot.joints)
        self.frames = {name: self.model.getFrameId(f"point_{name}") for name in robot.points}
        self.foot = self.frames["foot"]
        self.mass = float(sum(i.mass for i in self.model.inertias))
        self.gravity = np.array(self.model.gravity.linear)[[0, 2]]

    def foot_jacobian(self, q: np.ndarray) -> np.ndarray:
        """(2, 2 + n), world x and z."""
        pin.computeJointJacobians(self.model, self.data, q)
        return pin.getFrameJacobian(self.model, self.data, self.foot, pin.LOCAL_WORLD_ALIGNED)[[0, 2]]

    def acceleration(self, q: np.ndarray, v: np.ndarray, tau: np.ndarray, contact: bool) -> np.ndarray:
        """Forward dynamics [rad/s^2, m/s^2]; in contact the foot's acceleration is held at zero."""
        forces = np.concatenate([np.zeros(BASE), tau])
        if not contact:
            return pin.aba(self.model, self.data, q, v, forces)
        M = pin.crba(self.model, self.data, q)
        M = np.triu(M) + np.triu(M, 1).T
        bias = pin.nonLinearEffects(self.model, self.data, q, v)
        J = self.foot_jacobian(q)
        pin.forwardKinematics(self.model, self.data, q, v, np.zeros_like(v))
        drift = pin.getFrameClassicalAcceleration(self.model, self.data, self.foot, pin.LOCAL_WORLD_ALIGNED).linear[
            [0, 2]
        ]
        matrix = np.block([[M, -J.T], [J, np.zeros((2, 2))]])
        return np.linalg.solve(matrix, np.concatenate([forces - bias, -drift]))[: len(v)]

    def points(self, q: np.ndarray) -> dict[str, np.ndarray]:
        """World x, z [m] of joints, foot and centre of mass."""
        pin.framesForwardKinematics(self.model, self.data, q)
        points = {name: self.data.oMf[f].translation[[0, 2]].copy() for name, f in self.frames.items()}
        return {**points, "com": pin.centerOfMass(self.model, self.data, q)[[0, 2]].copy()}

    def com_velocity(self, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """World x', z' [m/s] of the centre of mass."""
        pin.centerOfMass(self.model, self.data, q, v)
        return self.data.vcom[0][[0, 2]].copy()

    def energy(self, q: np.ndarray, v: np.ndarray) -> float:
        """Kinetic (with the rotors') and potential energy [J]."""
        rotors = 0.5 * float(np.sum(self.model.armature * v**2))
        kinetic = pin.computeKineticEnergy(self.model, self.data, q, v)
        return kinetic + rotors + pin.computePotentialEnergy(self.model, self.data, q)
