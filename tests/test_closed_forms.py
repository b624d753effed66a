"""Hops whose best height is known in closed form, or by an integration that shares no code with hopopt."""

from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from hopopt.drivetrain.operating_region.region import operating_region
from hopopt.leg.dynamics import LegDynamics
from hopopt.leg.robot import build_robot
from hopopt.nlp.mesh import uniform
from hopopt.nlp.schemes import Scheme, radau
from hopopt.nlp.solver.ipopt import NlpSolution, NlpSolver
from hopopt.nlp.transcription import Guess, Transcription
from hopopt.ocp.hop import Hop
from hopopt.ocp.phases import FLIGHT
from hopopt.ocp.problem import Control, Objective, Parameter, PathConstraint, Phase, Problem, State, linkage
from hopopt.planner.motion import PlanEvaluator
from hopopt.problem.load import load
from known_problems import G, lift_off_of_hopper, push

RELATIVE = 1e-6
HASTE = 0.1  # m/s, weight of the push's duration: full force is both the highest and the fastest, waiting is neither


def solve(problem: Problem, guess: dict[str, Guess], intervals: int, scheme: Scheme | None = None) -> NlpSolution:
    meshes = {phase.name: uniform(intervals) for phase in problem.phases}
    solution = NlpSolver(Transcription(problem, scheme or radau(3), meshes))(guess)
    assert solution.success, solution.status
    return solution


def line(duration: float, first: list[float], last: list[float], *u: float) -> Guess:
    return Guess(duration, np.array([0.0, 1.0]), np.array([first, last]), np.tile(u, (2, 1)).reshape(2, -1))


# ---- one dimension ----------------------------------------------------------------------------------------

# mass [kg], force at standstill [N], speed without force [m/s], stroke [m]
HOPPERS = [(8.27, 500.0, 6.0, 0.2), (1.0, 100.0, 3.0, 0.1), (40.0, 900.0, 10.0, 0.5), (5.6, 400.0, 2.0, 0.3)]


@pytest.mark.parametrize("scheme", [radau(3), radau(4), radau(5)], ids=lambda s: s.name)
@pytest.mark.parametrize("hopper", HOPPERS, ids=lambda h: f"{h[0]:g} kg")
def test_hopper_of_one_dimension(hopper: tuple[float, float, float, float], scheme: Scheme) -> None:
    """Full force throughout, in one push that never descends; rise = v_lo^2 / (2 g)."""
    _, F0, v0, s = hopper
    T, v_lo = lift_off_of_hopper(*hopper)
    goal = Objective("rise", lambda e: e.final["push"].v ** 2 / (2 * G) - HASTE * e.duration["push"], maximize=True)
    guess = {"push": line(1.3 * T, [0.0, 0.0], [s, 0.7 * v_lo], 0.5 * F0)}
    solution = solve(Problem("hopper", (push(*hopper),), goal), guess, 30, scheme)
    trajectory = solution.phases["push"]
    assert abs((trajectory.x_end[1] / v_lo) ** 2 - 1) < RELATIVE
    assert abs(trajectory.duration / T - 1) < RELATIVE
    _, x, F = trajectory.everywhere(np.array(scheme.control_c))
    np.testing.assert_allclose(F[..., 0], F0 * (1 - x[..., 1] / v0), rtol=1e-5)


@pytest.mark.parametrize("hopper", HOPPERS, ids=lambda h: f"{h[0]:g} kg")
def test_hopper_with_its_flight(hopper: tuple[float, float, float, float]) -> None:
    """Handed over to a flight of free duration: its end is the apex, v_lo / g after lift-off."""
    *_, s = hopper
    T, v_lo = lift_off_of_hopper(*hopper)
    flight = Phase("flight", (State("x"), State("v")), (), lambda i: {"x": i.v, "v": ca.SX(-G)}, (1e-3, 5.0))
    problem = Problem(
        "hopper",
        (push(*hopper), flight),
        Objective("apex", lambda e: e.final["flight"].x - HASTE * e.duration["push"], maximize=True),
        (),
        (
            linkage("place", lambda e: e.initial["flight"].x - e.final["push"].x),
            linkage("speed", lambda e: e.initial["flight"].v - e.final["push"].v),
        ),
    )
    guess = {
        "push": line(1.3 * T, [0, 0], [s, 0.7 * v_lo], 0.5 * hopper[1]),
        "flight": line(0.1, [s, v_lo], [s + 0.1, 0.0]),
    }
    solution = solve(problem, guess, 30)
    rise = solution.phases["flight"].x_end[0] - s
    assert abs(rise / (v_lo**2 / (2 * G)) - 1) < RELATIVE
    assert abs(solution.phases["flight"].duration / (v_lo / G) - 1) < 1e-4  # the apex is flat in time
    assert abs(solution.phases["flight"].x_end[1]) < 1e-4 * v_lo


# ---- two massless links under a point body ------------------------------------------------------------------

KNEE = (-2.3, -1.6)  # rad, start and lift-off


def knee_push(l1: float, l2: float, m: float, stall: float, no_load: float) -> tuple[float, float]:
    """Lift-off speed [m/s] and time [s] with the knee at its limit, foot under the hip.

    y^2 = l1^2 + l2^2 + 2 l1 l2 cos(knee), the lever arm is dy/dknee, and the force tau over the lever arm.
    """

    def height(knee: float) -> float:
        return np.sqrt(l1**2 + l2**2 + 2 * l1 * l2 * np.cos(knee))

    def push_of(y: float, speed: float) -> float:
        knee = -np.arccos((y**2 - l1**2 - l2**2) / (2 * l1 * l2))
        lever = -l1 * l2 * np.sin(knee) / y
        return stall * (1 - speed / lever / no_load) / lever

    def rates(_: float, s: np.ndarray) -> list[float]:
        return [s[1], push_of(*s) / m - G]

    def stretched(_: float, s: np.ndarray) -> float:
        return s[0] - height(KNEE[1])

    stretched.terminal = True  # type: ignore[attr-defined]
    start = [height(KNEE[0]), 0.0]
    run = solve_ivp(rates, (0, 5), start, "DOP853", events=stretched, rtol=1e-12, atol=1e-13)
    assert run.status == 1
    assert min(push_of(*s) for s in run.y.T) > 0  # the motor pushes to the end: it is nowhere too fast for its torque
    return float(run.y_events[0][0, 1]), float(run.t_events[0][0])


LENGTHS = ["leg.thigh.length=0.3", "leg.shank.length=0.45"]
OTHER = [*LENGTHS, "leg.knee.gear.ratio=60", "leg.hip.upper=2", "leg.knee.lower=-3"]


@pytest.mark.parametrize("own", [[], OTHER], ids=["paper", "other"])
def test_massless_leg_with_the_foot_under_the_hip(own: list[str]) -> None:
    """The leg's own stance dynamics and drive on the one motion that keeps the hip over the foot."""
    leg = load("paper", own).leg
    robot = build_robot(leg)
    p = {
        path: 0.0 if path.endswith(("rotor_inertia", "thigh.mass", "shank.mass")) else value
        for path, value in robot.parameters.items()
    }
    region = operating_region(leg, "knee", p)
    l1, l2, m = (p[f"leg.{name}"] for name in ("thigh.length", "shank.length", "body.mass"))

    # angles, speeds and accelerations of both joints from those of the knee
    k, w, a = (ca.SX.sym(name) for name in "kwa")
    q = ca.vertcat(-ca.atan2(l2 * ca.sin(k), l1 + l2 * ca.cos(k)), k)
    v = ca.jacobian(q, k) * w
    joints = [q, v, ca.jacobian(v, k) * w + ca.jacobian(v, w) * a]
    free = [ca.SX.sym(name, 2) for name in "qva"]
    stance = LegDynamics(robot, p).stance(*free)
    whole = ca.Function("whole", free, [stance.q, stance.v, stance.a, stance.tau, stance.f])
    values = ca.Function("values", [k, w, a], whole(*joints))

    def motion(s: Any) -> Any:
        return s.once("motion", lambda: values(s.k, s.w, s.a))

    def body(s: Any) -> ca.SX:
        return ca.vertcat(*(part[0] for part in motion(s)[:3]))

    path = (
        PathConstraint("knee", lambda s: ca.vertcat(*region.use(motion(s)[1][3], motion(s)[3][1])), upper=1.0),
        PathConstraint("ground force", lambda s: motion(s)[4][1], lower=0.0, scale=500.0),
        PathConstraint("hip torque", lambda s: motion(s)[3][0]),  # these two without bounds, to be looked at
        PathConstraint("body beside the plumb line", body),
    )
    states = (State("k", lower=KNEE[0], initial=KNEE[0], final=KNEE[1]), State("w", lower=0.0, scale=10.0, initial=0.0))
    phase = Phase("push", states, (Control("a", scale=300.0),), lambda s: {"k": s.w, "w": s.a}, (1e-2, 1.0), path)

    def rise(e: Any) -> Any:
        return values(e.final["push"].k, e.final["push"].w, 0)[1][1] ** 2 / (2 * G) - HASTE * e.duration["push"]

    guess = {"push": line(0.2, [KNEE[0], 0.0], [KNEE[1], 8.0], 50.0)}
    solution = solve(Problem("knee", (phase,), Objective("rise", rise, maximize=True)), guess, 40, radau(4))
    gear, motor = leg.drive("knee", "gear", "ratio")[1], leg.motor
    v_lo, T = knee_push(l1, l2, m, gear * motor.max_torque, motor.max_speed / gear)
    trajectory = solution.phases["push"]
    speed = float(values(*trajectory.x_end, 0)[1][1])
    assert abs((speed / v_lo) ** 2 - 1) < RELATIVE
    assert abs(trajectory.duration / T - 1) < RELATIVE
    rows = {r.name: solution.g[r.start : r.stop] for r in solution.transcription.rows}
    np.testing.assert_allclose(rows["hip torque"], 0, atol=1e-9)  # a massless leg is a strut
    np.testing.assert_allclose(rows["body beside the plumb line"], 0, atol=1e-9)


# ---- flight -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("speed", [(0.0, 2.5), (0.7, 3.0), (-1.2, 1.1)])
def test_flight_of_the_leg_is_ballistic(speed: tuple[float, float]) -> None:
    """The hop's own flight phase, thrown with a moving leg: rise v^2 / (2 g) at v / g, whatever the joints do.

    The body's height, the joints' speeds and the torques in between obey work and energy.
    """
    hop = Hop(load("paper"))
    phase, com = hop.problem.phase(FLIGHT), np.array([0.1, 0.9])
    q, v = np.array([0.6, -0.9]), np.array([2.0, -4.0])
    given = {"com": com, "com_v": np.array(speed), "q": q, "v": v}
    phase = replace(phase, states=tuple(replace(s, initial=given[s.name]) for s in phase.states))
    effort = 1e-4  # decides what the joints do, on which the centre of mass does not depend
    goal = Objective("apex", lambda e: e.final[FLIGHT].com[1] - effort * e.integral[FLIGHT]["effort"], maximize=True)
    parameters = tuple(Parameter(path, value=value) for path, value in hop.robot.parameters.items())
    T = speed[1] / G
    x0, x1 = np.concatenate([com, speed, q, v]), np.array([0.1, 1.1, speed[0], 0, *q, 0, 0])
    solution = solve(Problem("flight", (phase,), goal, parameters), {FLIGHT: line(0.2, [*x0], [*x1], 0.0, 0.0)}, 16)
    trajectory = solution.phases[FLIGHT]
    end = trajectory.x_end
    assert abs((end[1] - com[1]) / (speed[1] ** 2 / (2 * G)) - 1) < RELATIVE
    assert abs(trajectory.duration / T - 1) < 1e-3  # the apex is flat in time, and the joints' effort costs a little
    t, x, _ = (a.reshape(-1, a.shape[-1]) for a in (e[..., None] if e.ndim == 2 else e for e in trajectory.everywhere(np.linspace(0, 1, 5))))  # fmt: skip
    expected = com + t * np.array(speed) + 0.5 * t**2 * np.array([0, -G])
    np.testing.assert_allclose(x[:, :2], expected, atol=1e-9)

    nodes, weights = np.polynomial.legendre.leggauss(8)
    t, x, u = trajectory.everywhere((nodes + 1) / 2)
    samples = PlanEvaluator(hop.design, hop.robot)(FLIGHT, t.ravel(), x.reshape(t.size, -1), u.reshape(t.size, -1))
    power = np.sum(samples.tau * samples.v[:, 2:], axis=1).reshape(t.shape)
    work = float(trajectory.lengths @ power @ weights / 2)
    gained = leg_energy(hop, end) - leg_energy(hop, x0)
    assert abs(gained - work) < 1e-4 * max(abs(work), 1.0)


def leg_energy(hop: Hop, state: np.ndarray) -> float:
    """Energy [J] of two uniform rods with rotors under a point body, written out; flight state (8,)."""
    leg = hop.leg
    thigh, shank = leg.link["thigh"], leg.link["shank"]
    masses = np.array([leg.body.mass, thigh.mass, shank.mass])
    angle, rate = np.cumsum(state[4:6]), np.cumsum(state[6:8])
    arms = np.array([[0, 0], [thigh.length / 2, 0], [thigh.length, shank.length / 2]])  # of each centre, by angle
    place = np.stack([arms @ np.sin(angle), -arms @ np.cos(angle)], axis=1)
    speed = np.stack([arms @ (np.cos(angle) * rate), arms @ (np.sin(angle) * rate)], axis=1)
    place += state[:2] - masses @ place / masses.sum()
    speed += state[2:4] - masses @ speed / masses.sum()
    rotor = leg.motor.rotor_inertia * leg.gear.ratio**2
    turning = sum(link.mass * link.length**2 / 12 * w**2 for link, w in zip((thigh, shank), rate, strict=True))
    kinetic = 0.5 * (masses @ (speed**2).sum(axis=1) + turning + rotor * (state[6:8] ** 2).sum())
    return float(kinetic + G * masses @ place[:, 1])
