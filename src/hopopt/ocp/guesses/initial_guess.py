"""Starting points that differ in what the leg does: where it leans, how deep it dips, how long it pushes.

Every start is a rough motion of the joints in stance and in flight; the planner makes it obey the dynamics.
The first is the paper's idea: a push straight up, the knee saturated and the body held on the plumb line. A leg
that this does not lift (or that has other than two joints) goes straight up as slowly as it may instead.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import PchipInterpolator
from scipy.optimize import least_squares

from hopopt.drivetrain.operating_region.region import operating_region
from hopopt.leg.dynamics import LegDynamics
from hopopt.leg.kinematics import (
    TwoJoints,
    contact_axes,
    foot_jacobian,
    foot_offset,
    joint_positions,
    start_angles,
    tucked,
    two_joints,
)
from hopopt.ocp.drives import with_drive_states
from hopopt.ocp.guesses.guess import Guess
from hopopt.ocp.heat import heated
from hopopt.ocp.hop import Hop
from hopopt.ocp.hops.collision import slack_of
from hopopt.ocp.hops.landing import landing_guess
from hopopt.ocp.hops.periodic import there_and_back
from hopopt.ocp.hops.to_rest import push_backwards
from hopopt.ocp.phases import DESCENT, FLIGHT, LANDING, ON_GROUND, STANCE

POINTS = 41  # of a guess, each phase
FOLDED_ANGLE = 0.5  # rad between two points of a guess; angles farther away are of a leg folded the other way
GUESS_SAMPLES = 201  # of a guess that is a motion already
GUESSED_FLIGHTS = (0.1, 0.6)  # [s] on the paper's leg: shortest and longest flight of a guess
PUSH_STEP = 0.01  # [s] on the paper's leg: longest step of the push that is simulated
PUSH_TOLERANCE = 1e-6  # [rad, and rad/s on the paper's leg] to which it is
POSE_WEIGHT = 1e-3  # [m/rad] on the paper's leg: weight of staying near a pose beside that of the foot's place


@dataclass(frozen=True)
class StartGuess:
    """A motion in words: hip ahead of the foot at mid-stance and at lift-off [share of the reach], depth of the
    dip [share of the start height], stance duration [share of the longest]."""

    name: str
    sway: float = 0.0
    lean: float = 0.0
    dip: float = 0.0
    duration: float = 0.5


NAMED_STARTS = (
    StartGuess("upright push", duration=1.0),
    StartGuess("straight push", duration=0.4),
    StartGuess("lean back, swing", sway=-0.35, lean=0.1, dip=0.1, duration=1.0),
    StartGuess("lean forward, swing", sway=0.5, lean=0.3, dip=0.1, duration=1.0),
    StartGuess("lean forward, push", sway=0.25, lean=0.25, duration=0.5),
    StartGuess("lean back, push", sway=-0.2, lean=-0.2, duration=0.5),
    StartGuess("dip and push", dip=0.3, duration=1.0),
)


def starts(count: int, seed: int, periodic: bool = False) -> list[StartGuess]:
    """The named starts, for a periodic hop the leaning ones first, then seeded Sobol points over the same directions."""
    extra, named = count - len(NAMED_STARTS), NAMED_STARTS
    if periodic:
        named = (*(s for s in NAMED_STARTS if s.lean), *(s for s in NAMED_STARTS if not s.lean))
    if extra <= 0:
        return list(named[:count])
    from scipy.stats import qmc  # slow to import, and most solves need no random starts

    sobol = qmc.Sobol(4, rng=seed).random(2 ** int(np.ceil(np.log2(extra))))[:extra]
    points = qmc.scale(sobol, [-0.5, -0.3, 0.0, 0.2], [0.6, 0.4, 0.4, 1.0])
    return [*named, *(StartGuess(f"drawn {k + 1}", *map(float, p)) for k, p in enumerate(points))]


def starts_of(hop: Hop, count: int) -> list[StartGuess]:
    """The first starts of a problem."""
    return starts(count, hop.design.solver.seed, hop.design.hop.periodic)


def make_guess(hop: Hop, start: StartGuess) -> dict[str, Guess]:
    """The start as guesses of the phases, by phase name."""
    simple = start == NAMED_STARTS[0] and two_joints(hop.leg) and not hop.loops and hop.leg.direct
    stance = (saturated_push(hop) if simple else None) or _stance_guess(hop, start)
    push = there_and_back(hop, stance) if hop.design.hop.periodic else stance
    return _all_phases(hop, _without_dependent(hop, push), _flight_guess(hop, stance))


def motion_guess(hop: Hop, phases: Mapping[str, Any]) -> dict[str, Guess]:
    """A hop towards another objective (anything with duration [s] and sample, by phase name) as guesses of the phases."""
    s = np.linspace(0, 1, GUESS_SAMPLES)
    found = {name: Guess(motion.duration, s, *motion.sample(s * motion.duration)) for name, motion in phases.items()}
    return _all_phases(hop, found[STANCE], found[FLIGHT], found.get(DESCENT), found.get(LANDING))


def stance_guess(hop: Hop, t: np.ndarray, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> dict[str, Guess]:
    """A motion of the joints in stance (t (m,) [s]; q, v, a (m, n) [rad, rad/s, rad/s^2]) as guesses of all phases."""
    stance = Guess(float(t[-1]), t / t[-1], np.hstack([q, v]), a)
    return _all_phases(hop, _without_dependent(hop, stance), _flight_guess(hop, stance))


def posture_guess(hop: Hop, phases: Mapping[str, Any], pose: np.ndarray) -> dict[str, Guess]:
    """A hop (as of ``motion_guess``) with another flight, to a pose (n,) [rad] of the joints, as guesses of the phases."""
    s, push = np.linspace(0, 1, GUESS_SAMPLES), phases[STANCE]
    x, u = push.sample(s * push.duration)
    stance = Guess(push.duration, s, x[:, : 2 * hop.n], u[:, : hop.n])
    return _all_phases(hop, stance, _flight_guess(hop, stance, pose))


def _all_phases(
    hop: Hop, stance: Guess, flight: Guess, down: Guess | None = None, landing: Guess | None = None
) -> dict[str, Guess]:
    """The guesses of the phases that the objective has, with its controls."""
    more, rises = sum(c.size for c in hop.objective.controls(hop)), 2 * len(heated(hop))
    stance, flight = _cold(hop, stance, 0), _cold(hop, flight, 2 * len(hop.falling))
    found = {STANCE: stance, FLIGHT: flight}
    found |= {
        DESCENT: _cold(hop, down or landing_guess(hop, flight), 2 * len(hop.falling)),
        LANDING: _cold(hop, landing or push_backwards(stance), 0),
    }
    of_leg = {name: with_drive_states(hop, guess, name in ON_GROUND) for name, guess in found.items()}
    return {phase.name: _widened(of_leg[phase.name], rises, more) for phase in hop.problem.phases}


def _cold(hop: Hop, guess: Guess, of_body: int) -> Guess:
    """The guess without the rises of its motors' temperatures, if it has any; of_body: states of the body in its phase."""
    others = of_body + 2 * hop.n + hop.drive_states.size
    return replace(guess, x=guess.x[:, :others])


def _widened(guess: Guess, rises: int, more: int) -> Guess:
    """Zeros for the rises of motors' temperatures, and for the controls that an objective adds."""
    x, u = (np.hstack([old, np.zeros((len(old), added))]) for old, added in ((guess.x, rises), (guess.u, more)))
    return replace(guess, x=x, u=u)


def _without_dependent(hop: Hop, stance: Guess) -> Guess:
    """The guess with the controls that the problem has: on a closed loop not all accelerations, and no force yet."""
    if not hop.loops:
        return stance
    u = np.hstack([stance.u[:, hop.free], np.zeros((len(stance.u), len(hop.loops)))])
    return replace(stance, u=u)


def _stance_guess(hop: Hop, start: StartGuess) -> Guess:
    """Body path through start, dip and lift-off; joints by inverse kinematics."""
    shortest, longest = hop.design.hop.stance_duration
    T = shortest + start.duration * (longest - shortest)
    q0 = start_angles(hop.design)
    hip0 = -foot_offset(hop.leg, q0)
    high = 0.85 * hop.reach
    sway, lean = (start.sway * hop.reach, start.lean * hop.reach) if len(hop.falling) == 2 else (hip0[0], hip0[0])
    middle = np.array([sway, hip0[1] * (1 - start.dip) + 0.15 * (high - hip0[1])])
    end = np.array([lean, np.sqrt(high**2 - lean**2)])
    path = PchipInterpolator([0.0, 0.5, 1.0], np.stack([hip0, middle, end]))
    s = np.linspace(0, 1, POINTS)
    angles, q = [], q0
    for hip in path(s):
        q = inverse_kinematics(hop, -hip, q)
        angles.append(q)
    return _differentiate(T, s, np.array(angles))


def _differentiate(T: float, s: np.ndarray, q: np.ndarray) -> Guess:
    v = np.gradient(q, s * T, axis=0)
    v[0] = 0.0
    return Guess(T, s, np.hstack([q, v]), np.gradient(v, s * T, axis=0))


def inverse_kinematics(hop: Hop, foot: np.ndarray, near: np.ndarray) -> np.ndarray:
    """Joint angles [rad] within the limits that bring the foot closest to ``foot`` (x, z) [m] from the body; a leg that
    leaves the plane keeps its foot beside the body where it starts."""
    exact = _exact_angles(hop, foot, near) if two_joints(hop.leg) else None
    return _fitted_angles(hop, foot, near) if exact is None else exact


def _exact_angles(hop: Hop, foot: np.ndarray, near: np.ndarray) -> np.ndarray | None:
    """Of a leg of two joints in the plane: those within the limits that bring the foot to ``foot``; None if none are near."""
    lower, upper = hop.limits
    found = TwoJoints.of(hop.leg).angles(foot)
    best = min(found, key=lambda q: np.abs(q - near).max(), default=None)
    reached = (
        best is not None and np.abs(best - near).max() <= FOLDED_ANGLE and np.all((lower <= best) & (best <= upper))
    )
    return best if reached else None


def _fitted_angles(hop: Hop, foot: np.ndarray, near: np.ndarray) -> np.ndarray:
    """Of any leg, also where the foot is out of reach."""
    lower, upper = hop.limits
    inner = np.clip(near, lower + 1e-6, upper - 1e-6)
    axes, beside = list(contact_axes(hop.leg)), joint_positions(hop.leg, start_angles(hop.design))[-1, 1]
    wanted = np.array([foot[0], beside, foot[1]])[axes]

    size = hop.scale.length

    def residual(q: np.ndarray) -> np.ndarray:
        return np.concatenate([(joint_positions(hop.leg, q)[-1, axes] - wanted) / size, POSE_WEIGHT * (q - near)])

    def slopes(q: np.ndarray) -> np.ndarray:
        return np.vstack([foot_jacobian(hop.leg, q)[axes] / size, POSE_WEIGHT * np.eye(hop.n)])

    return least_squares(residual, inner, slopes, bounds=(lower, upper), xtol=1e-8, ftol=1e-8).x  # type: ignore[arg-type]


def _flight_guess(hop: Hop, stance: Guess, pose: np.ndarray | None = None) -> Guess:
    """Ballistic flight from the end of stance; joints go smoothly to a pose (n,) [rad], by default that with the foot highest."""
    n, s = hop.n, np.linspace(0, 1, POINTS)
    com, com_v = _com_at(hop, stance.x[-1, :n], stance.x[-1, n:])
    fall = np.array(hop.robot.model.gravity.linear)[[0, 2]]
    shortest, longest = hop.design.hop.flight_duration
    least, most = (hop.scale.time * bound for bound in GUESSED_FLIGHTS)
    T = float(np.clip(-com_v[1] / fall[1], max(shortest, least), min(longest, most)))
    t = s * T
    blend = (s * s * (3 - 2 * s))[:, None]
    if pose is None:
        pose = hop.problem.once("tucked", lambda: tucked(hop.leg, hop.design.hop.foot_window, slack_of(hop)))
    q = stance.x[-1, :n] + (pose - stance.x[-1, :n]) * blend
    v = np.gradient(q, t, axis=0)
    place, speed = com + t[:, None] * com_v + 0.5 * t[:, None] ** 2 * fall, com_v + t[:, None] * fall
    x = np.hstack([place[:, hop.falling], speed[:, hop.falling], q, v])
    return Guess(T, s, x, np.gradient(v, t, axis=0))


def _com_at(hop: Hop, q_j: np.ndarray, v_j: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Centre of mass (x, z) [m] and its speed [m/s] in stance."""
    place, speed = hop.problem.once("com in stance", lambda: _com_in_stance(hop))(q_j, v_j)
    return np.array(place).ravel(), np.array(speed).ravel()


def _com_in_stance(hop: Hop) -> ca.Function:
    q, v = ca.SX.sym("q", hop.n), ca.SX.sym("v", hop.n)
    dynamics = LegDynamics(hop.robot, hop.robot.parameters)
    com = dynamics.points(dynamics.stance_pose(q, v)[0])["com"]
    return ca.Function("com", [q, v], [com, ca.jtimes(com, q, v)])


def saturated_push(hop: Hop) -> Guess | None:
    """The knee at its operating limit, the hip keeping the body on the plumb line through the foot.

    For legs of two joints, the knee folded to either side. A simple simulation up to the stretched leg or the
    moment the ground would have to pull; None if the leg does not rise.
    """
    n, p = hop.n, hop.robot.parameters
    q0 = start_angles(hop.design)
    geometry = TwoJoints.of(hop.leg)
    side = -1 if geometry.bend(q0[1]) < 0 else 1
    straight = (
        max(min(side * geometry.bend(limit[1]) for limit in hop.limits), 0.0) + 0.1
    )  # [rad], how far it stretches
    a, q, v = (ca.SX.sym(name, n) for name in "aqv")
    m = LegDynamics(hop.robot, p).stance(q, v, a)
    # tau, base x'' and f_z are affine in a: tau = B a + c and so on
    rows = ca.vertcat(m.tau, m.a[0], m.f[1])
    affine = ca.Function("affine", [q, v], [ca.jacobian(rows, a), ca.substitute(rows, a, ca.SX.zeros(n))])
    knee = operating_region(hop.leg, hop.leg.joints[1], p)

    def acceleration(x: np.ndarray) -> tuple[np.ndarray, float]:
        B, c = (np.array(r) for r in affine(x[:n], x[n:]))
        tau = knee.torque_bounds(x[n + 1])[0 if side * geometry.signs[1] > 0 else 1]
        A = np.stack([B[1], B[n]])
        result = np.linalg.solve(A, np.array([tau - c[1, 0], -c[n, 0]]))
        return result, float((B[n + 1] @ result + c[n + 1])[0])

    def stretched(_: float, x: np.ndarray) -> float:
        return min(side * geometry.bend(x[1]) - straight, acceleration(x)[1])

    stretched.terminal = True  # type: ignore[attr-defined]
    x0, (shortest, longest) = np.concatenate([q0, np.zeros(n)]), hop.design.hop.stance_duration
    time = hop.scale.time
    settings: dict[str, Any] = {
        "max_step": PUSH_STEP * time,
        "atol": np.repeat([PUSH_TOLERANCE, PUSH_TOLERANCE / time], n),
    }
    try:
        run = solve_ivp(
            lambda _, x: np.concatenate([x[n:], acceleration(x)[0]]), (0, longest), x0, events=stretched, **settings
        )
    except np.linalg.LinAlgError:
        return None
    if not run.success or run.t[-1] < shortest or side * geometry.bend(run.y[1, -1]) > side * geometry.bend(x0[1]):
        return None
    x = run.y.T
    u = np.array([acceleration(row)[0] for row in x])
    return Guess(float(run.t[-1]), run.t / run.t[-1], x, u)
