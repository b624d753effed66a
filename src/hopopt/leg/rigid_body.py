"""Rigid-body dynamics in CasADi over a ``pin.Model``: the recursive Newton-Euler algorithm.

The tree comes from the model object; joints, masses, lengths and inertias from ``MovingBody``
records that may hold symbols. A joint that follows moves by the coordinate of another one. Featherstone, Rigid Body Dynamics Algorithms (2008), ch. 5, written with
3-vectors: w, alpha angular velocity and acceleration, a linear acceleration of the joint's origin, all in
the joint's own frame. Gravity enters as an upward acceleration of the world.
"""

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
import pinocchio as pin

from hopopt.leg.inertia import tensor
from hopopt.leg.robot import MovingBody


def joint_axis(body: MovingBody) -> np.ndarray:
    """Motion subspace (linear, angular) of the joint of one degree of freedom that carries a body, shape (6,)."""
    axis, still = np.array(body.joint.axis), np.zeros(3)
    return np.concatenate([axis, still] if body.joint.slides else [still, axis])


def rotation(axis: np.ndarray, angle: Any) -> ca.SX:
    """Rodrigues' formula: 3 x 3 rotation by ``angle`` [rad] about the unit vector ``axis``."""
    k = ca.DM(ca.skew(ca.DM(axis)))
    return ca.SX.eye(3) + ca.sin(angle) * k + (1 - ca.cos(angle)) * (k @ k)


@dataclass(frozen=True)
class Frames:
    """Pose of every joint in the world: rotations R (3 x 3) and origins o (3,), one for each joint."""

    R: list[ca.SX]
    o: list[ca.SX]


def _step(model: pin.Model, index: int, body: MovingBody, axis: np.ndarray, q: Any) -> tuple[ca.SX, ca.SX]:
    """Pose of joint ``index`` in its parent's frame."""
    fixed = ca.DM(model.jointPlacements[index].rotation)
    slide = ca.mtimes(fixed, ca.DM(axis[:3])) * q
    turn = rotation(axis[3:], q) if np.any(axis[3:]) else ca.SX.eye(3)
    return ca.mtimes(fixed, turn), ca.vertcat(*body.placement) + slide


def _place(body: MovingBody, q: ca.SX) -> Any:
    """Angle or travel of the joint of a body."""
    return body.joint.place(q[body.joint.coordinate])


def frames(model: pin.Model, bodies: list[MovingBody], q: ca.SX) -> Frames:
    """Forward kinematics: the pose of every joint."""
    poses = Frames([ca.SX.eye(3)], [ca.SX.zeros(3)])
    for k, body in enumerate(bodies):
        parent = model.parents[k + 1]
        R, o = _step(model, k + 1, body, joint_axis(body), _place(body, q))
        poses.R.append(ca.mtimes(poses.R[parent], R))
        poses.o.append(poses.o[parent] + ca.mtimes(poses.R[parent], o))
    return poses


def point_position(poses: Frames, point: tuple[int, tuple[Any, ...]]) -> ca.SX:
    """World position [m] of a point fixed to a joint's frame, shape (3,)."""
    index, offset = point
    return poses.o[index] + ca.mtimes(poses.R[index], ca.vertcat(*offset))


def com_position(poses: Frames, bodies: list[MovingBody]) -> ca.SX:
    """World position [m] of the centre of mass, shape (3,)."""
    total = sum(body.mass for body in bodies)
    return sum(body.mass * point_position(poses, (k + 1, body.com)) for k, body in enumerate(bodies)) / total


def rnea(model: pin.Model, bodies: list[MovingBody], q: ca.SX, v: ca.SX, a: ca.SX) -> ca.SX:
    """Generalised forces [N, N m] that produce accelerations ``a`` at (q, v): M a + nle, shape (nv,)."""
    axes = [joint_axis(body) for body in bodies]
    R, o, w, alpha, acc = [], [], [ca.SX.zeros(3)], [ca.SX.zeros(3)], [ca.SX(-ca.DM(model.gravity.linear))]
    force, moment = [], []
    for k, (body, axis) in enumerate(zip(bodies, axes, strict=True)):
        parent = model.parents[k + 1]
        R_k, o_k = _step(model, k + 1, body, axis, _place(body, q))
        v_j, a_j = (body.joint.ratio * rate[body.joint.coordinate] for rate in (v, a))
        slide, turn, back = ca.DM(axis[:3]), ca.DM(axis[3:]), R_k.T
        w_p, alpha_p = back @ w[parent], back @ alpha[parent]
        w_k = w_p + turn * v_j
        alpha_k = alpha_p + turn * a_j + ca.cross(w_p, turn * v_j)
        origin = acc[parent] + ca.cross(alpha[parent], o_k) + ca.cross(w[parent], ca.cross(w[parent], o_k))
        acc_k = back @ origin + slide * a_j + 2 * ca.cross(w_p, slide * v_j)
        com = ca.vertcat(*body.com)
        acc_com = acc_k + ca.cross(alpha_k, com) + ca.cross(w_k, ca.cross(w_k, com))
        inertia = ca.vertcat(*[ca.horzcat(*row) for row in tensor(body.inertia)])
        f = body.mass * acc_com
        R, o, w, alpha, acc = [*R, R_k], [*o, o_k], [*w, w_k], [*alpha, alpha_k], [*acc, acc_k]
        force.append(f)
        moment.append(inertia @ alpha_k + ca.cross(w_k, inertia @ w_k) + ca.cross(com, f))
    tau = [ca.SX(0)] * model.nv
    for k in reversed(range(len(bodies))):
        slide, turn = ca.DM(axes[k][:3]), ca.DM(axes[k][3:])
        at = bodies[k].joint
        given = at.ratio * (ca.dot(slide, force[k]) + ca.dot(turn, moment[k]))
        tau[at.coordinate] += given + bodies[k].armature * a[at.coordinate]
        parent = model.parents[k + 1] - 1
        if parent >= 0:
            f = R[k] @ force[k]
            force[parent] += f
            moment[parent] += R[k] @ moment[k] + ca.cross(o[k], f)
    return ca.vertcat(*tau)
