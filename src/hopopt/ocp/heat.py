"""What a limit on the temperature of motors' windings adds to a phase: the rises of winding and housing as states."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np

from hopopt.design.parameters import AMBIENT, PAUSE
from hopopt.drivetrain.heat import TwoBodies, limited
from hopopt.drivetrain.supply import winding_heat
from hopopt.errors import UsageError
from hopopt.leg.limit_id import winding_temperature
from hopopt.ocp.drives import asked
from hopopt.ocp.guesses.motion import MotionAt, MovingLeg
from hopopt.ocp.problem import INF, BoundaryConstraint, Ends, Instant, PathConstraint, Phase, State, linkage

COLDEST = -0.01  # of the range: a cycle that repeats where heat grows without end has rises far below ambient
RISES = "rises"  # the state that is added: of winding and housing of each limited joint, one after the other


def heated(leg: MovingLeg) -> list[str]:
    """The joints whose windings have a limit."""
    return [joint for joint in leg.leg.joints if limited(leg.leg, joint)]


def refuse_heat(leg: MovingLeg, what: str) -> None:
    """UsageError where a winding has a limit, for a program that does not hand heat on from phase to phase."""
    if joints := heated(leg):
        path = winding_temperature(leg.leg, joints[0]).key
        raise UsageError(f"{what} does not follow how hot motors get: leave out {path}")


def range_of(leg: MovingLeg, joint: str) -> float:
    """From ambient to the limit of a joint's winding [K]."""
    return leg.robot.parameters[winding_temperature(leg.leg, joint).key] - leg.design.ambient


def _ambient(leg: MovingLeg, p: Mapping[str, Any]) -> Any:
    """Temperature of the air [degC]: a parameter of the program where the problem states it."""
    return p.get(AMBIENT, leg.design.ambient)


def with_heat(leg: MovingLeg, phase: Phase, motion: MotionAt) -> Phase:
    """The phase with the rises of its motors [K], and the limits of their windings; as it is where none has one."""
    joints = heated(leg)
    if not joints:
        return phase
    scales = np.repeat([range_of(leg, joint) for joint in joints], 2)
    labels = tuple(f"{joint} {body}" for joint in joints for body in ("winding", "housing"))
    own = State(RISES, len(labels), lower=COLDEST * scales, scale=scales, unit="K", labels=labels)
    torques = [asked(leg, joint, motion) for joint in joints]

    def rates(s: Instant) -> Mapping[str, ca.SX]:
        found: list[ca.SX] = []
        for k, (joint, torque) in enumerate(zip(joints, torques, strict=True)):
            bodies = TwoBodies.of(leg.leg, joint, s.p, _ambient(leg, s.p))
            assert bodies is not None
            heat = winding_heat(leg.leg, joint, s.p) * torque(s) ** 2
            found += bodies.rates(s.rises[2 * k], s.rises[2 * k + 1], heat)
        return {**phase.dynamics(s), RISES: ca.vertcat(*found)}

    path = tuple(_limit(leg, joint, 2 * k) for k, joint in enumerate(joints))
    return replace(phase, states=(*phase.states, own), dynamics=rates, path=(*phase.path, *path))


def _limit(leg: MovingLeg, joint: str, at: int) -> PathConstraint:
    """What is left of the range of a winding [K]."""
    name = winding_temperature(leg.leg, joint)

    def left(s: Instant) -> ca.SX:
        return s.p[name.key] - _ambient(leg, s.p) - s.rises[at]

    return PathConstraint(name, left, 0.0, INF, range_of(leg, joint), "K")


def heat_goes_on(leg: MovingLeg, phases: Sequence[str]) -> tuple[BoundaryConstraint, ...]:
    """The rises go on from each phase to the next. The first begins cold, or as the pause after the last leaves them."""
    joints = heated(leg)
    if not joints:
        return ()
    scales, pause = np.repeat([range_of(leg, joint) for joint in joints], 2), leg.design.hop.between
    found = [_handed_on(before, after, scales) for before, after in pairwise(phases)]

    def begins(e: Ends) -> ca.SX:
        first = e.initial[phases[0]].rises
        if pause is None:
            return first
        left = ca.diagcat(*[_cooling(leg, joint, e, e.p.get(PAUSE, pause)) for joint in joints])
        return first - left @ e.final[phases[-1]].rises

    return (*found, linkage("heat of the motors at the start", begins, scales.tolist(), unit="K"))


def _handed_on(before: str, after: str, scales: np.ndarray) -> BoundaryConstraint:
    def miss(e: Ends) -> ca.SX:
        return e.initial[after].rises - e.final[before].rises

    return linkage(f"heat of the motors, {before} to {after}", miss, scales.tolist(), unit="K")


def _cooling(leg: MovingLeg, joint: str, e: Ends, pause: Any) -> ca.SX:
    """``TwoBodies.cooling`` of symbols: exp(A t) = exp(m t) (cosh(d t) I + sinh(d t) / d (A - m I)), m +- d the eigenvalues."""
    bodies = TwoBodies.of(leg.leg, joint, e.p, _ambient(leg, e.p))
    assert bodies is not None
    A = ca.horzcat(*[ca.vertcat(*bodies.rates(*unit, 0.0)) for unit in ((1.0, 0.0), (0.0, 1.0))])
    m = (A[0, 0] + A[1, 1]) / 2
    d = ca.sqrt(m**2 - (A[0, 0] * A[1, 1] - A[0, 1] * A[1, 0]))
    slow, fast = ca.exp((m + d) * pause), ca.exp((m - d) * pause)
    return (slow + fast) / 2 * ca.SX.eye(2) + (slow - fast) / (2 * d) * (A - m * ca.SX.eye(2))
