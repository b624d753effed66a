"""A foot that sticks and slips: blocks, rods, impacts, Pinocchio, MuJoCo and the energy balance."""

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq

from drawn_legs import legs_in_motion, quick
from hopopt.control.closed_loop import Run, clearance_in_mujoco, longest, make_controller, make_plant, simulate
from hopopt.control.strategies import find
from hopopt.design import Leg
from hopopt.drivetrain.drives import Drive
from hopopt.drivetrain.gear import Gear, gears_of, motor_torque
from hopopt.drivetrain.operating_region.half_planes import HalfPlane, OperatingRegion
from hopopt.errors import UsageError
from hopopt.leg.kinematics import start_angles
from hopopt.leg.robot import BASE, build_robot
from hopopt.problem.load import load
from hopopt.sim.controller import Measurement
from hopopt.sim.encoder import Encoder
from hopopt.sim.ground import contact, loads, planar
from hopopt.sim.ground.rough_ground import RoughGround
from hopopt.sim.hop_metrics import HopFigures
from hopopt.sim.machine import Machine
from hopopt.sim.plant import Plant
from hopopt.sim.state import State, Timing

G = 9.81
OTHER_COUNTS = st.sampled_from([1, 3])  # joints; all is compiled anew for each number, for one below in any case
LIMITLESS = OperatingRegion((HalfPlane("+", 1e-9, 0.0), HalfPlane("-", -1e-9, 0.0)))


@dataclass
class Fixed:
    """The same torques whatever happens."""

    tau: np.ndarray

    def torque(self, now: Measurement) -> np.ndarray:
        return self.tau


def rod(body: float, link: float, length: float = 1.0) -> Leg:
    """A uniform link below a point mass, on one joint."""
    tables = {"joints": ("hip",), "links": ("rod",), "body": {"mass": body}, "gear": {"ratio": 1.0}}
    motor = {"max_torque": 2.0, "max_speed": 100.0}
    joint = {"lower": -3.0, "upper": 3.0}
    return Leg.model_validate({**tables, "motor": motor, "hip": joint, "rod": {"length": length, "mass": link}})


def on_ground(leg: Leg, friction: float, slope: float = 0.0, gear: Gear | None = None) -> RoughGround:
    """The leg without torque limits, no joint watched, on ground that falls towards +x at an angle [rad]."""
    robot = build_robot(leg)
    robot.model.gravity.linear = G * np.array([np.sin(slope), 0.0, -np.cos(slope)])
    return RoughGround(robot, Drive([LIMITLESS] * len(leg.joints), gear), friction, ["foot"])


def standing(plant: RoughGround, q_j: np.ndarray, slip: int = 0, speed: float = 0.0) -> State:
    """The foot at the origin; it slips with the whole leg at a speed [m/s]."""
    s = plant.stance_start(q_j)
    return State(s.q, np.array([speed, *[0.0] * (len(s.v) - 1)]), contact=True, foot=0.0, slip=slip)


@quick
@given(legs_in_motion(st.just(2), plane=True))
def test_compiled_dynamics_are_pinocchios(case: tuple[Leg, np.ndarray, np.ndarray, np.ndarray]) -> None:
    """Acceleration in flight and with the foot held, for any leg of two joints in the plane."""
    dynamics_are_pinocchios(*case)


@pytest.mark.parametrize("mode", [contact.FLIGHT, contact.STICK, contact.FORWARD])
def test_gears_pass_on_what_their_law_says_where_they_turn_from_driving_to_braking(mode: int) -> None:
    """Where the efficiency falls with the torque, and steps of Newton's method go to and fro: in Pinocchio the leg speeds up so
    that the motors' torques, with what rotors and gears take, are those that were given."""
    table = "leg.gear.efficiency_table"
    entries = {
        f"{table}.speed": [52.4, 104.7, 209.4, 366.5], f"{table}.efficiency": [0.76, 0.71, 0.64, 0.57],
        f"{table}.torque": [5.0, 20.0, 60.0, 100.0], f"{table}.factor": [0.5, 0.8, 0.97, 1.0], "leg.gear.friction": 2.15,
    }  # fmt: skip
    leg = load("paper", entries).leg
    gear = gears_of(leg, build_robot(leg).parameters)
    plant = on_ground(leg, 0.5, gear=gear)
    machine, c = Machine(plant.robot), planar.planar_leg(plant.robot, plant.drive, plant.stops, set(), 0.5)
    q, v = np.array([0.0, 0.6, 0.4, -1.2]), np.array([0.0, 0.3, -5.862, 9.779])
    for command in np.stack(np.meshgrid(np.linspace(-30, 30, 16), np.linspace(-30, 30, 16)), -1).reshape(-1, 2):
        X, at_foot, G, _, _, motor, tau = loads.loads(c, mode, q, v, command)
        force = np.array(contact.contact_force(mode, 0.5, at_foot, G))
        J = machine.foot_jacobian(q)
        free = machine.acceleration(q, v, tau, contact=False)
        a = free + np.linalg.solve(machine.mass_matrix(q), J.T @ force)
        np.testing.assert_allclose(X @ [1.0, *force], a, atol=1e-8 * np.abs(a).max())
        np.testing.assert_allclose(motor_torque(gear, tau, v[2:], a[2:], plant.robot.rotors), motor, atol=1e-8)


@pytest.mark.rarely
@quick
@given(legs_in_motion(OTHER_COUNTS, plane=True))
def test_compiled_dynamics_of_any_leg(case: tuple[Leg, np.ndarray, np.ndarray, np.ndarray]) -> None:
    dynamics_are_pinocchios(*case)


def dynamics_are_pinocchios(leg: Leg, q: np.ndarray, v: np.ndarray, tau: np.ndarray) -> None:
    plant, tau = on_ground(leg, 0.5), tau[BASE:]
    machine = Machine(plant.robot)
    c = planar.planar_leg(plant.robot, plant.drive, plant.stops, set(), 0.5)
    c["stiffness"][:] = 0.0  # no end stops
    joints, centres, drift = planar.chain(c, q, v)
    M, M_other = planar.mass_matrix(c, q, joints, centres), machine.mass_matrix(q)
    np.testing.assert_allclose(M, M_other, rtol=0, atol=1e-11 * np.abs(M_other).max())
    np.testing.assert_allclose(joints[-1], machine.foot_motion(q, v)[0], atol=1e-12)
    np.testing.assert_allclose(planar.foot_jacobian(c, joints), machine.foot_jacobian(q), atol=1e-12)
    for mode in (contact.FLIGHT, contact.STICK):
        a = machine.acceleration(q, v, tau, contact=mode == contact.STICK)
        mine, _ = loads.rates(c, mode, q, v, tau)
        forces = np.abs(M_other) @ np.abs(a) + np.abs(planar.bias(c, q, v, joints, centres, drift)) + np.abs(tau).max()
        np.testing.assert_allclose(M_other @ (mine - a), 0, atol=1e-7 * forces.max())


# ---- closed forms: legs of one joint, for which all is compiled anew -------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(("friction", "slope", "speed"), [(0.4, 0.0, 2.0), (0.3, 0.6, 0.0), (0.5, 0.2, 1.0)])
def test_a_block_slides_down_a_slope(friction: float, slope: float, speed: float) -> None:
    """x'' = g (sin a - mu cos a); the joint's torque holds the leg upright against friction and inertia."""
    plant = on_ground(rod(3.0, 2.0), friction, slope)
    a = G * (np.sin(slope) - friction * np.cos(slope))
    normal = 5.0 * G * np.cos(slope)
    tau = friction * normal * 1.0 + 2.0 * (a - G * np.sin(slope)) * 0.5
    end = 0.9 * speed / -a if a < 0 else 0.3
    trace = plant.run(standing(plant, np.zeros(1), slip=1, speed=speed), Fixed(np.array([tau])), end)
    np.testing.assert_allclose(trace.q[:, 0], speed * trace.t + a * trace.t**2 / 2, rtol=0, atol=1e-9)
    np.testing.assert_allclose(trace.f, [[-friction * normal, normal]] * len(trace.t), rtol=1e-9)
    assert trace.work[-1, 3] == pytest.approx(friction * normal * trace.q[-1, 0], rel=1e-9)
    assert trace.energy_error < 1e-9


@pytest.mark.slow
def test_a_block_stops_after_its_braking_distance_and_stays() -> None:
    """v^2 / (2 mu g), then it sticks: on a slope below the angle of friction it stays."""
    friction, speed = 0.5, 1.0
    plant = on_ground(rod(3.0, 2.0), friction)
    tau = friction * 5.0 * G - 2.0 * friction * G * 0.5

    class Upright:
        def torque(self, now: Measurement) -> np.ndarray:
            return np.array([tau if now.t < speed / (friction * G) - 1e-3 else 0.0]) - 500 * now.q - 20 * now.v

    trace = plant.run(standing(plant, np.zeros(1), slip=1, speed=speed), Upright(), 0.4)
    assert trace.events[0].kind == "stick"
    foot = trace.points["foot"][:, 0]
    assert foot[-1] == pytest.approx(speed**2 / (2 * friction * G), abs=1e-4)
    after = trace.t > trace.events[-1].t + 1e-9
    assert np.ptp(foot[after]) < 1e-12
    assert trace.energy_error < 1e-8
    steep = on_ground(rod(3.0, 2.0), friction, np.arctan(friction) - 0.01)
    hold = 2.0 * G * np.sin(np.arctan(friction) - 0.01) * 0.5
    rest = steep.run(standing(steep, np.zeros(1)), Fixed(np.array([5 * hold - hold])), 0.1)
    assert not rest.events
    np.testing.assert_allclose(rest.q[-1], rest.q[0], atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("friction", [0.2, 0.36])
def test_a_falling_rod_begins_to_slip_where_the_textbook_says(friction: float) -> None:
    """theta'^2 = 3 g / L (cos theta_0 - cos theta); the foot slips backward where f_x = mu f_z."""
    first, L = 0.1, 1.0

    def forces(angle: float) -> tuple[float, float]:
        w2, w1 = 3 * G / L * (np.cos(first) - np.cos(angle)), 1.5 * G / L * np.sin(angle)
        x = L / 2 * (np.cos(angle) * w1 - np.sin(angle) * w2)
        z = -L / 2 * (np.sin(angle) * w1 + np.cos(angle) * w2)
        return x, G + z

    expected = brentq(lambda angle: forces(angle)[0] - friction * forces(angle)[1], first, 0.6)
    plant = on_ground(rod(0.01, 200.0), friction)
    trace = plant.run(standing(plant, np.array([-first])), Fixed(np.zeros(1)), 0.7)
    (slip, *_) = trace.events
    assert slip.kind == "slip"
    k = int(np.searchsorted(trace.t, slip.t))
    assert -trace.q[k, BASE] == pytest.approx(expected, rel=2e-4)  # the body weighs a little
    assert trace.points["foot"][k + 20, 0] < 0
    assert trace.energy_error < 1e-8


@pytest.mark.slow
def test_a_rod_on_ice_falls_straight() -> None:
    """No friction: the centre of mass stays above its place, and energy gives theta'."""
    plant = on_ground(rod(0.01, 200.0), 0.0)
    trace = plant.run(standing(plant, np.array([-0.3])), Fixed(np.zeros(1)), 0.5)
    com = trace.points["com"]
    np.testing.assert_allclose(com[:, 0], com[0, 0], atol=1e-9)
    angle = -trace.q[-1, BASE]
    speed = np.sqrt(G * (np.cos(0.3) - np.cos(angle)) / (1 / 12 / 1.0 + np.sin(angle) ** 2 / 4))
    assert -trace.v[-1, BASE] == pytest.approx(speed, rel=2e-4)
    assert angle > 0.8


# ---- impacts ----------------------------------------------------------------------------------------------


@quick
@given(legs_in_motion(st.just(2), plane=True), st.floats(0.0, 2.0))
def test_an_impact_keeps_to_the_cone_and_takes_energy(
    case: tuple[Leg, np.ndarray, np.ndarray, np.ndarray], friction: float
) -> None:
    """An impulse at the foot alone, upwards and within the cone; it opposes what slips; the foot does not sink."""
    keeps_to_the_cone_and_takes_energy(*case[:3], friction)


@pytest.mark.slow
@quick
@given(legs_in_motion(OTHER_COUNTS, plane=True), st.floats(0.0, 2.0))
def test_an_impact_of_any_leg(case: tuple[Leg, np.ndarray, np.ndarray, np.ndarray], friction: float) -> None:
    keeps_to_the_cone_and_takes_energy(*case[:3], friction)


def keeps_to_the_cone_and_takes_energy(leg: Leg, q: np.ndarray, v: np.ndarray, friction: float) -> None:
    plant = on_ground(leg, friction)
    machine = plant.machine
    if machine.foot_motion(q, v)[1][1] > -1e-3:
        return
    after, lost, mode = contact.impact(plant.leg, q, v)
    M, J = machine.mass_matrix(q), machine.foot_jacobian(q)
    p = (M @ (after - v))[:BASE]
    size = float(np.abs(M @ (after - v)).max()) + 1e-12
    np.testing.assert_allclose(M @ (after - v), J.T @ p, atol=1e-8 * size)
    x, z = machine.foot_motion(q, after)[1]
    assert abs(z) < 1e-8 * (1 + np.abs(v).max())
    assert p[1] > 0
    assert abs(p[0]) <= friction * p[1] + 1e-8 * size
    if mode == contact.STICK:
        assert abs(x) < 1e-8 * (1 + np.abs(v).max())
    else:
        assert mode * x >= -1e-9
        assert p[0] == pytest.approx(-mode * friction * p[1], abs=1e-8 * size)
    before, later = float(v @ M @ v / 2), float(after @ M @ after / 2)
    assert lost == pytest.approx(before - later, abs=1e-9 * before)
    assert lost > -1e-9 * before


# ---- hops -------------------------------------------------------------------------------------------------


def hop(strategy: str, friction: float | None, **more: object) -> Run:
    changes = {name.replace("__", "."): value for name, value in more.items()}
    if friction is not None:
        changes["contact.friction"] = friction
    return simulate(load("paper", changes), find(strategy), past_apex=True)


@pytest.mark.slow
def test_ground_that_grips_enough_is_ideal_ground() -> None:
    """Two formulations and two codes: minimal coordinates in Pinocchio, and forces of contact compiled."""
    rough, force = hop("force", 6.0), find("force")
    design, s = load("paper"), rough.design.simulation
    plant, period = make_plant(design), 1 / s.control_rate
    by_pinocchio = Plant(plant.robot, plant.drive, plant.above_ground).run(
        start_angles(design), make_controller(design, force), longest(design), landings=1,
        timing=Timing(period), encoder=Encoder(s.encoder_bits, s.speed_window, period),
    )  # fmt: skip
    ideal = HopFigures(design, by_pinocchio)
    assert ideal.slip_ratio > 5
    assert rough.figures.slip_distance == pytest.approx(0.0, abs=1e-9)
    for run in (rough, hop("force", None)):
        assert run.figures.clearance == pytest.approx(ideal.clearance, abs=1e-9)
        assert run.trace.times_of("lift-off") == pytest.approx(by_pinocchio.times_of("lift-off"), abs=1e-8)


@pytest.mark.slow
def test_compiled_ideal_ground_is_the_same_plant() -> None:
    """With landings, some of which bounce."""
    design = load("paper")
    start, compiled = np.array([1.1, -2.3]), make_plant(design)
    assert isinstance(compiled, RoughGround)
    by_pinocchio = Plant(compiled.robot, compiled.drive, compiled.above_ground)
    for tau in ([-10.0, 120.0], [-60.0, 60.0], [20.0, -20.0]):
        plain, fast = (plant.run(start, Fixed(np.array(tau)), 0.25) for plant in (by_pinocchio, compiled))
        assert fast.outcome == plain.outcome
        assert [(e.kind, round(e.t, 5)) for e in fast.events] == [(e.kind, round(e.t, 5)) for e in plain.events]
        end = min(fast.t[-1], plain.t[-1]) - 1e-9
        a, b = (trace.q[np.searchsorted(trace.t, end) - 1] for trace in (fast, plain))
        np.testing.assert_allclose(a, b, atol=1e-6)


CASES = (
    ("force", 0.6),
    ("force_tuck", 0.3),
    ("position_tuck", 0.1),
    *(pytest.param(*case, marks=pytest.mark.slow) for case in (("force_tuck", 0.6), ("position_tuck", 0.3))),
)


@pytest.mark.parametrize(("strategy", "friction"), CASES)
def test_slipping_hops_balance_their_energy_and_agree_with_mujoco(strategy: str, friction: float) -> None:
    """Within 1 % in clearance, forces within the cone, friction's work counted."""
    pytest.importorskip("mujoco")
    run = hop(strategy, friction)
    f, trace = run.figures, run.trace
    loaded = trace.f[trace.contact]
    assert np.all(np.abs(loaded[:, 0]) <= friction * loaded[:, 1] * (1 + 1e-6) + 1e-6)
    assert [e for e in trace.events if e.kind == "slip" and e.t < f.lift_off["time_s"]]
    assert np.all(np.diff(trace.work[:, 3]) >= -1e-9)  # a foot turns round within rounding of an event
    assert trace.energy_error < 1e-6
    assert clearance_in_mujoco(run.design, run.strategy, None) == pytest.approx(f.clearance, rel=0.01)


def test_a_foot_that_slips_far_is_named() -> None:
    f = hop("position_tuck", 0.1).figures
    assert f.slip_distance > 2e-3
    assert "the foot slips 3 mm in stance" in f.limits_exceeded
    assert f.as_dict()["slip_distance_m"] == f.slip_distance


def test_a_knee_that_strikes_the_ground_ends_the_run_at_that_instant() -> None:
    """A leg that collapses without torque: an event, and the outcome."""
    plant = make_plant(load("paper", {"contact.friction": 0.8}))
    trace = plant.run(np.array([1.1, -2.3]), Fixed(np.zeros(2)), 0.6)
    assert trace.outcome == "the knee hit the ground"
    assert trace.events[-1].kind == "knee strikes"
    assert trace.events[-1].t == trace.t[-1] < 0.6
    assert trace.points["knee"][-1, 1] == pytest.approx(0.0, abs=1e-9)
    assert trace.points["knee"][:-1, 1].min() >= -1e-9


def test_landings_that_slide_and_bounce_balance_their_energy() -> None:
    """Dropped with a forward speed on ice: the impulse along the ground is friction's share, and the foot slides on.
    Torques that throw the leg up again and again: some landings come at once after a lift-off."""
    plant = make_plant(load("paper", {"contact.friction": 0.05}))
    q = plant.stance_start(np.array([0.6, -1.2])).q + np.array([0.0, 0.1, 0.0, 0.0])
    s = State(q, np.array([3.0, 0.0, 0.0, 0.0]), contact=False, foot=0.0)
    trace = plant.run(s, Fixed(np.zeros(2)), 0.2)
    k = int(np.searchsorted(trace.t, trace.times_of("touchdown")[0]))
    jump = plant.machine.mass * (trace.com_v[k + 1] - trace.com_v[k])
    assert jump[0] == pytest.approx(-0.05 * jump[1], rel=1e-9)
    assert trace.machine.foot_motion(trace.q[k + 1], trace.v[k + 1])[1][0] > 0.5
    assert trace.energy_error < 1e-6
    plant = make_plant(load("paper", {"contact.friction": 0.8}))
    for tau in ([-60.0, 60.0], [20.0, -20.0]):
        bouncing = plant.run(np.array([1.1, -2.3]), Fixed(np.array(tau)), 0.3)
        assert len(bouncing.times_of("touchdown")) >= 1
        assert bouncing.energy_error < 1e-6


def test_legs_that_the_plane_does_not_hold_are_refused() -> None:
    leg = load("paper", {"leg.guides": ["z"]}).leg
    with pytest.raises(UsageError, match="on x and z guides"):
        on_ground(leg, 0.5)
