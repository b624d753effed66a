"""The phases that a hop is made of: the leg on the ground and in the air, to be listed in any order.

Controls are the joint accelerations; the drives enter as path constraints on the torque they would need.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from hopopt.leg.limit_id import Kind, kind_of
from hopopt.leg.scales import radians
from hopopt.ocp.drives import reversing_speeds, with_drives
from hopopt.ocp.guesses.motion import FLIGHT as FLIGHT
from hopopt.ocp.guesses.motion import STANCE as STANCE
from hopopt.ocp.guesses.motion import MotionAt, MovingLeg
from hopopt.ocp.heat import with_heat
from hopopt.ocp.problem import INF, Control, Ends, Instant, Numbers, PathConstraint, Phase, State
from hopopt.ocp.rules import LEAST_HEIGHT, path_constraints

DESCENT, LANDING = "descent", "landing"  # flight ends at the apex, descent at touchdown, a landing at rest
ON_GROUND = (STANCE, LANDING)  # phases in which the foot stands
# Scales on the paper's leg: of joint speed [rad/s] and acceleration [rad/s^2], of the body's speed [m/s], of lengths [m] and times [s]
SPEED, ACCELERATION, BODY_SPEED, LENGTH, LONGEST = 10.0, 300.0, 3.0, 1.0, 1.0
GRAZE = 1e-5  # share of the reach by which the foot may be below the ground before it has landed
Given = Numbers | tuple[Numbers, Numbers] | None  # of a state at the beginning: free, a value, or (lower, upper)


def duration_entry(phase: str) -> str:
    """The entry of the problem file that bounds how long a phase lasts: the descent has that of flight."""
    return f"hop.{FLIGHT if phase == DESCENT else phase}_duration"


@dataclass(frozen=True)
class LegPhase:
    """A phase of a leg.

    kind: what the leg does in it, "stance" or "flight".
    motion: the whole leg at an instant of it.
    """

    phase: Phase
    kind: str
    motion: MotionAt

    def with_more(
        self, controls: Sequence[Control], path: Sequence[PathConstraint],
        integrands: Mapping[str, Callable[[Instant], ca.SX]],
    ) -> Phase:  # fmt: skip
        """The phase with further controls, path constraints and integrands."""
        p = self.phase
        more = {**p.integrands, **integrands}
        return replace(p, controls=(*p.controls, *controls), path=(*p.path, *path), integrands=more)


def joint_speed(leg: MovingLeg) -> np.ndarray:
    """Scale of joint speeds (n) [rad/s]."""
    return SPEED / leg.scale.time * radians(leg.leg)


def joint_scales(leg: MovingLeg) -> np.ndarray:
    """Scales of angles and speeds of the joints (2 n) [rad, rad/s]."""
    return np.concatenate([radians(leg.leg), joint_speed(leg)])


def body_speed(leg: MovingLeg) -> float:
    """Scale of the body's speed [m/s]."""
    return BODY_SPEED * leg.scale.speed


def length(leg: MovingLeg) -> float:
    """Scale of places and heights [m]."""
    return LENGTH * leg.scale.length


def _acceleration(leg: MovingLeg, joints: Sequence[int]) -> np.ndarray:
    """Scale of accelerations of these joints [rad/s^2]."""
    return ACCELERATION * leg.scale.gravity / leg.scale.length * radians(leg.leg)[list(joints)]


def stance(leg: MovingLeg, q: Given = None, v: Given = None) -> LegPhase:
    """The foot on the ground; q and v: joint angles [rad] and speeds [rad/s] with which it begins."""
    names, (lower, upper) = leg.leg.joints, leg.limits
    states = (
        State("q", leg.n, lower, upper, radians(leg.leg), "rad", names, initial=q),
        State("v", leg.n, scale=joint_speed(leg), unit="rad/s", labels=names, initial=v, sharp=reversing_speeds(leg)),
    )
    return _phase(
        leg, STANCE, states, _stance_controls(leg), lambda s: {"q": s.v, "v": leg.joint_acceleration(s)},
        leg.design.hop.stance_duration,
    )  # fmt: skip


def landing_stance(leg: MovingLeg) -> LegPhase:
    """Stance again, after touchdown: the body may descend. The foot is the origin, as in every stance."""
    again = stance(leg)
    path = tuple(c for c in again.phase.path if kind_of(c.name) is not Kind.DESCENT)
    down = replace(again.phase, name=LANDING, path=path, duration=leg.design.hop.landing_duration)
    return replace(again, phase=down)


def _phase(
    leg: MovingLeg, kind: str, states: tuple[State, ...], controls: tuple[Control, ...],
    rates: Callable[[Instant], Mapping[str, ca.SX]], duration: tuple[float, float],
) -> LegPhase:  # fmt: skip
    """A phase in which the rules of its kind hold."""
    motion = leg.motion_in(kind)
    long = LONGEST * leg.scale.time
    phase = Phase(kind, states, controls, rates, duration, path_constraints(leg, kind), long=long)
    return LegPhase(with_heat(leg, with_drives(leg, phase), motion), kind, motion)


def _stance_controls(leg: MovingLeg) -> tuple[Control, ...]:
    """Accelerations of the joints that no closed loop moves, and the contact force along the loop's axes."""
    labels = tuple(leg.leg.joints[k] for k in leg.free)
    controls = (
        (Control("a", len(labels), scale=_acceleration(leg, leg.free), unit="rad/s^2", labels=labels),)
        if labels
        else ()
    )
    if not leg.loops:
        return controls
    axes = tuple("xyz"[axis] for axis in leg.loops)
    return (*controls, Control("loop_force", len(axes), scale=leg.weight, unit="N", labels=axes))


def flight(leg: MovingLeg) -> LegPhase:
    """The leg in the air, rising: it ends at the apex, or before."""
    (lower, upper), names = leg.limits, leg.leg.joints
    plane, m = tuple("xz"[k] for k in leg.falling), len(leg.falling)
    rises = ([-INF, 0.0][-m:], [INF] * m)
    states = (
        State("com", m, scale=length(leg), unit="m", labels=plane),
        State("com_v", m, scale=body_speed(leg), unit="m/s", labels=plane, initial=rises),
        State("q", leg.n, lower, upper, radians(leg.leg), "rad", names),
        State("v", leg.n, scale=joint_speed(leg), unit="rad/s", labels=names),  # torques hardly matter: none is sharp
    )
    free = [k for k in range(leg.n) if k not in leg.drive_states.at]
    prompt, scale = tuple(names[k] for k in free), _acceleration(leg, free)
    controls = (Control("a", len(prompt), scale=scale, unit="rad/s^2", labels=prompt),) if prompt else ()
    return _phase(
        leg, FLIGHT, states, controls,
        lambda s: {
            "com": s.com_v, "com_v": leg.dynamics(s).fall[leg.falling], "q": s.v, "v": leg.flight_acceleration(s),
        },
        leg.design.hop.flight_duration,
    )  # fmt: skip


def descent(leg: MovingLeg) -> LegPhase:
    """Flight again, but downwards; the last instant, where the foot is on the ground, would hold that limit twice."""
    up = flight(leg)
    states = tuple(replace(s, initial=None) for s in up.phase.states)
    path = tuple(_grazing(c, GRAZE * leg.reach) for c in up.phase.path)
    down = replace(up.phase, name=DESCENT, states=states, path=path, duration=leg.design.hop.descent_duration)
    return replace(up, phase=down)


def _grazing(c: PathConstraint, by: float) -> PathConstraint:
    """A limit of heights, the foot's lower by that much [m]; any other as it is."""
    if c.name != LEAST_HEIGHT:
        return c
    low = np.array(c.lower, dtype=float)
    low[[label == "foot" for label in c.labels]] -= by
    return replace(c, lower=low)


def points_at_apex(leg: MovingLeg, e: Ends) -> dict[str, ca.SX]:
    """World (x, z) [m] of the leg's points at the end of flight."""
    return leg.flight_points(e.final[FLIGHT])
