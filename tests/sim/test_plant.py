"""The simulated leg against closed forms, conservation laws, the order of its integrator and a second formulation."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from drawn_legs import evaluate, legs_in_motion, symbols
from hopopt.control.closed_loop import make_plant
from hopopt.design import Design, Leg
from hopopt.drivetrain.drives import Drive
from hopopt.drivetrain.gear import Gear
from hopopt.drivetrain.operating_region.half_planes import HalfPlane, OperatingRegion
from hopopt.drivetrain.operating_region.region import operating_region
from hopopt.leg.dynamics import LegDynamics
from hopopt.leg.kinematics import start_angles
from hopopt.leg.robot import BASE, build_robot
from hopopt.problem.load import changed, load
from hopopt.sim.controller import Measurement
from hopopt.sim.encoder import Encoder
from hopopt.sim.hop_metrics import SIMULATED_SLACK, HopFigures
from hopopt.sim.machine import Machine
from hopopt.sim.plant import Plant
from hopopt.sim.state import State, Timing
from hopopt.sim.trace import Trace

PERIOD = 1 / 4000
quick = settings(max_examples=25, deadline=None)


# ---- what is simulated --------------------------------------------------------------------------------------


@dataclass
class Fixed:
    """The same torques whatever happens."""

    tau: np.ndarray

    def torque(self, now: Measurement) -> np.ndarray:
        return self.tau


@dataclass
class Spring:
    """Springs and dampers at the joints: as smooth as the leg's own motion."""

    at: np.ndarray
    k: float = 200.0
    d: float = 4.0

    def torque(self, now: Measurement) -> np.ndarray:
        return self.k * (self.at - now.q) - self.d * now.v


@dataclass
class Counting:
    """The number of the call, as a torque that hardly moves the leg; the first call is 1."""

    n: int
    calls: int = 0

    def torque(self, now: Measurement) -> np.ndarray:
        self.calls += 1
        return np.full(self.n, 1e-6 * self.calls)


def unlimited(n: int) -> Drive:
    """Drives that give whatever is asked."""
    return Drive([OperatingRegion((HalfPlane("+", 1e-9, 0.0), HalfPlane("-", -1e-9, 0.0)))] * n)


def plant_of(design: Design, **legs: Any) -> Plant:
    robot = build_robot(design.leg, legs)
    return Plant(robot, unlimited(len(robot.joints)))


def falling(plant: Plant, q_j: np.ndarray, height: float, velocity: tuple[float, float] = (0.0, 0.0)) -> State:
    """In flight with the foot at x = 0 and this height [m], every part at the same velocity [m/s]."""
    q = np.concatenate([np.zeros(BASE), q_j])
    q[:BASE] = np.array([0.0, height]) - plant.machine.foot_motion(q, 0 * q)[0]
    return State(q, np.concatenate([velocity, np.zeros(plant.n)]), contact=False, foot=0.0)


def gravity(plant: Plant) -> float:
    return -float(plant.machine.gravity[1])


def foot_velocity(trace: Trace, k: int) -> np.ndarray:
    return trace.machine.foot_motion(trace.q[k], trace.v[k])[1]


@pytest.fixture(scope="module")
def paper() -> Design:
    return load("paper")


@pytest.fixture(scope="module")
def smooth(paper: Design) -> dict[float, Trace]:
    """From a crouch by springs that throw the leg up, to the first landing, without hold, at two step lengths."""
    plant, spring = plant_of(paper), Spring(np.array([0.35, -0.7]))
    return {
        period: plant.run(start_angles(paper), spring, 1.0, timing=Timing(period, hold=False), landings=1)
        for period in (PERIOD, PERIOD / 2)
    }


# ---- stance: three formulations of one motion ----------------------------------------------------------------


@quick
@given(legs_in_motion(plane=True), st.floats(-200, 200))
def test_stance_by_joints_is_constrained_dynamics_and_the_planners(
    case: tuple[Leg, np.ndarray, np.ndarray, np.ndarray], push: float
) -> None:
    """Minimal coordinates, a held foot with its constraint force, and the planner's inverse dynamics agree."""
    leg, q, v, _ = case
    robot, n = build_robot(leg), len(leg.joints)
    machine, tau = Machine(robot), np.linspace(push, -push, n)
    s = machine.stance_terms(q[BASE:], v[BASE:])
    a_j = s.acceleration(tau)
    size = float((np.abs(s.mass_matrix) @ np.abs(a_j) + np.abs(s.joint_bias) + np.abs(tau)).max())
    size = max(
        size, float(np.abs(s.M[:BASE] @ np.concatenate([np.zeros(BASE), a_j])).max()), float(np.abs(s.bias).max())
    )

    whole = machine.acceleration(s.q, s.v, tau, contact=True)
    np.testing.assert_allclose(s.mass_matrix @ (whole[BASE:] - a_j), 0, atol=1e-9 * size)
    place, velocity = machine.foot_motion(s.q, s.v)
    reach = 1 + np.abs(v[BASE:]).sum()
    np.testing.assert_allclose([*place, *velocity], 0, atol=1e-11 * reach)
    needed = pin.rnea(robot.model, robot.model.createData(), s.q, s.v, whole)
    np.testing.assert_allclose(s.force(whole[BASE:]), needed[:BASE], rtol=0, atol=1e-9 * size)

    inputs = symbols(n)
    m = LegDynamics(robot, robot.parameters).stance(*inputs)
    base, tau_planned, force = evaluate([m.q, m.tau, m.f], inputs, [q[BASE:], v[BASE:], a_j])
    np.testing.assert_allclose(base, s.q, atol=1e-11 * reach)
    np.testing.assert_allclose(tau_planned, tau, rtol=0, atol=1e-9 * size)
    np.testing.assert_allclose(force, s.force(a_j), rtol=0, atol=1e-9 * size)


# ---- flight and landing --------------------------------------------------------------------------------------


@pytest.mark.parametrize(("height", "upwards"), [(0.05, 0.0), (0.5, 0.0), (0.2, 1.7), (0.3, -1.0)])
def test_a_falling_leg_lands_when_and_as_fast_as_galilei_says(paper: Design, height: float, upwards: float) -> None:
    """No torque: all parts fall alike, z = h + v t - g t^2/2, whatever the pose."""
    plant = plant_of(paper)
    g = gravity(plant)
    trace = plant.run(falling(plant, start_angles(paper), height, (0.3, upwards)), Fixed(np.zeros(2)), 2.0, landings=1)
    expected = (upwards + np.sqrt(upwards**2 + 2 * g * height)) / g
    (event,) = trace.events
    assert event.kind == "touchdown"
    assert event.t == pytest.approx(expected, abs=1e-8)
    k = int(np.searchsorted(trace.t, event.t))
    assert (trace.contact[k], trace.contact[k + 1]) == (False, True)
    np.testing.assert_allclose(foot_velocity(trace, k), [0.3, upwards - g * expected], atol=1e-8)
    np.testing.assert_allclose(trace.points["foot"][k], [0.3 * expected, 0.0], atol=1e-8)
    assert trace.outcome == "landing 1"


@pytest.mark.parametrize("pose", [(1.1, -2.3), (0.2, -0.6), (-0.4, -1.0)])
def test_impact_stops_the_foot_by_an_impulse_at_the_foot_alone(paper: Design, pose: tuple[float, float]) -> None:
    """M (v+ - v-) = J' p, p the change of momentum of the whole; the energy lost is what the event says."""
    plant = plant_of(paper)
    trace = plant.run(falling(plant, np.array(pose), 0.3, (0.5, 0.0)), Fixed(np.zeros(2)), 1.0, landings=1)
    event = trace.events[0]
    k = int(np.searchsorted(trace.t, event.t))
    machine, q, jump = trace.machine, trace.q[k], trace.v[k + 1] - trace.v[k]
    np.testing.assert_allclose(foot_velocity(trace, k + 1), 0, atol=1e-12)
    p = machine.mass * (trace.com_v[k + 1] - trace.com_v[k])
    np.testing.assert_allclose(machine.mass_matrix(q) @ jump, machine.foot_jacobian(q).T @ p, atol=1e-9)
    assert p[1] > 0
    assert event.lost == pytest.approx(machine.energy(q, trace.v[k]) - machine.energy(q, trace.v[k + 1]), rel=1e-12)
    assert event.lost == pytest.approx(-(p @ foot_velocity(trace, k)) / 2, rel=1e-9)  # of a plastic impact
    assert trace.energy_error < 1e-9


def test_a_straight_leg_loses_all_its_energy_of_motion() -> None:
    plant = plant_of(load("paper", {"leg.knee.upper": 0.5}))
    trace = plant.run(falling(plant, np.zeros(2), 0.4), Fixed(np.zeros(2)), 1.0, landings=1)
    assert trace.events[0].lost == pytest.approx(plant.machine.mass * gravity(plant) * 0.4, rel=1e-8)


def test_a_foot_on_massless_links_loses_only_its_own(paper: Design) -> None:
    """Two point masses and light links, the knee bent: the foot stops, the body flies on."""
    light = {"leg.thigh.mass": 1e-6, "leg.shank.mass": 0.8, "leg.shank.com": 0.361, "leg.shank.inertia": 1e-9}
    plant = plant_of(paper, **light, **{"leg.motor.rotor_inertia": 0.0})
    trace = plant.run(falling(plant, start_angles(paper), 0.4), Fixed(np.zeros(2)), 1.0, landings=1)
    assert trace.events[0].lost == pytest.approx(0.8 * gravity(plant) * 0.4, rel=1e-4)
    k = int(np.searchsorted(trace.t, trace.events[0].t))
    np.testing.assert_allclose(trace.v[k + 1, :BASE], trace.v[k, :BASE], atol=1e-4)


def test_centre_of_mass_falls_freely_whatever_the_joints_do(smooth: dict[float, Trace]) -> None:
    """Its horizontal speed and vertical acceleration in flight, the joints moving."""
    trace = smooth[PERIOD]
    inside = np.flatnonzero(~trace.contact)
    t, com = trace.t[inside] - trace.t[inside[0]], trace.com_v[inside]
    assert np.ptp(trace.q[inside, -1]) > 0.1
    np.testing.assert_allclose(com[:, 0], com[0, 0], atol=1e-9)
    np.testing.assert_allclose(com[:, 1], com[0, 1] - gravity(plant_of(load("paper"))) * t, atol=1e-9)


# ---- events and order ------------------------------------------------------------------------------------------


def test_events_do_not_depend_on_the_step(smooth: dict[float, Trace]) -> None:
    coarse, fine = (smooth[period].events for period in (PERIOD, PERIOD / 2))
    assert [e.kind for e in coarse] == ["lift-off", "touchdown"]
    np.testing.assert_allclose([e.t for e in coarse], [e.t for e in fine], rtol=0, atol=1e-8)
    assert coarse[1].lost == pytest.approx(fine[1].lost, rel=1e-6)


@pytest.mark.parametrize("contact", [True, False])
def test_halving_the_step_divides_the_error_by_sixteen(paper: Design, contact: bool) -> None:
    """Classical Runge-Kutta, fourth order, in stance and in flight."""
    plant, spring = plant_of(paper), Spring(np.array([0.9, -1.8]))
    start = plant.stance_start(start_angles(paper)) if contact else falling(plant, np.array([0.5, -1.5]), 1.0)

    def end(steps: int) -> np.ndarray:
        s = start
        for _ in range(steps):
            s = plant.step(s, lambda t, q, v: spring.torque(Measurement(t, q, v, contact, t, 0)), 0.064 / steps)
        return np.concatenate([s.q, s.v, s.work])

    exact = end(512)
    errors = [float(np.abs(end(steps) - exact).max()) for steps in (8, 16, 32)]
    ratios = np.divide(errors[:-1], errors[1:])
    assert np.all((ratios > 12) & (ratios < 21)), (errors, ratios)
    assert np.abs(exact - np.concatenate([start.q, start.v, start.work])).max() > 0.1


def test_a_push_that_ends_lets_the_foot_go_at_that_very_instant(paper: Design) -> None:
    """A torque that pulls the foot up from a control instant on: lift-off is that instant, not one later."""
    plant, turn = plant_of(paper), 40 * PERIOD

    class Turning:
        def torque(self, now: Measurement) -> np.ndarray:
            return np.array([-10.0, 150.0] if now.t < turn - 1e-9 else [40.0, -60.0])

    trace = plant.run(start_angles(paper), Turning(), 0.02)
    assert trace.times_of("lift-off") == [pytest.approx(turn, abs=1e-12)]
    k = int(np.searchsorted(trace.t, turn - 1e-9))
    assert (trace.contact[k], trace.contact[k + 1]) == (True, False)
    np.testing.assert_array_equal(trace.command[k : k + 2], [[-10.0, 150.0], [40.0, -60.0]])
    assert trace.f[trace.contact, 1].min() > 0
    assert trace.points["foot"][-1, 1] > 1e-4


def test_lift_off_is_where_the_ground_has_nothing_left_to_give(smooth: dict[float, Trace], paper: Design) -> None:
    """Just before, it pushes or the foot would sink if let go; at lift-off neither, and the foot rises ever after."""
    trace = smooth[PERIOD / 2]
    k = int(np.argmin(trace.contact)) - 1
    assert trace.t[k] == trace.t[k + 1] == trace.times_of("lift-off")[0]
    before = [max(float(trace.f[j, 1]), -rise_if_free(trace, j)) for j in range(k)]
    assert min(before) > 0
    assert abs(max(float(trace.f[k, 1]), -rise_if_free(trace, k))) < 1e-3
    np.testing.assert_array_equal(trace.q[k], trace.q[k + 1])
    assert trace.points["foot"][k + 2 : k + 200, 1].min() > 0


def rise_if_free(trace: Trace, k: int) -> float:
    """Vertical acceleration [m/s^2] of the foot if the ground let it go."""
    m, tau = trace.machine, np.concatenate([np.zeros(BASE), trace.tau[k]])
    a = pin.aba(m.model, m.data, trace.q[k], trace.v[k], tau)
    return float(m.foot_acceleration(trace.q[k], trace.v[k], a)[1])


# ---- energy ------------------------------------------------------------------------------------------------------


def test_work_is_energy_gained_and_lost(smooth: dict[float, Trace]) -> None:
    """Motors' work, kinetic and potential energy, impact; and the work is the integral of torque over angle."""
    for trace in smooth.values():
        assert trace.energy_error < 1e-8
        until = int(np.argmin(trace.contact))
        q, tau = trace.q[:until, BASE:], trace.motor[:until]
        by_hand = float(np.sum((tau[1:] + tau[:-1]) / 2 * np.diff(q, axis=0)))
        assert by_hand == pytest.approx(trace.work[until - 1, 0], rel=1e-4)


def test_an_error_of_the_energy_is_seen(smooth: dict[float, Trace]) -> None:
    trace = smooth[PERIOD]
    assert replace(trace, work=1.001 * trace.work).energy_error > 5e-4
    impact = [replace(e, lost=0.0) for e in trace.events]
    assert replace(trace, events=impact).energy_error > 1e-2


@pytest.mark.slow
@pytest.mark.parametrize("gear", [Gear(efficiency=0.7), Gear(damping=1.5), Gear(0.8, 2.0, 0.5)])
def test_gears_only_take_energy_and_the_balance_still_closes(paper: Design, gear: Gear) -> None:
    robot = build_robot(paper.leg)
    plant = Plant(robot, Drive([OperatingRegion((HalfPlane("+", 1e-9, 0), HalfPlane("-", -1e-9, 0)))] * 2, gear))
    trace = plant.run(start_angles(paper), Spring(np.array([0.35, -0.7])), 0.05, timing=Timing(PERIOD, hold=False))
    assert trace.energy_error < 1e-6
    assert np.all(np.diff(trace.work[:, 1]) >= -1e-12)
    assert trace.work[-1, 1] > 0.1


@settings(deadline=None)  # the first call compiles
@given(st.floats(0.05, 1), st.floats(0, 10), st.floats(0, 5), st.floats(-20, 20), st.floats(-300, 300))
def test_gear_losses_oppose_the_motion(
    efficiency: float, friction: float, damping: float, w: float, tau: float
) -> None:
    """Power lost is never negative; at speed friction comes off first, and of the rest the efficiency's share passes on."""
    unbounded = OperatingRegion((HalfPlane("+", 1e-9, 0), HalfPlane("-", -1e-9, 0)))
    motor, joint = Drive([unbounded], Gear(efficiency, friction, damping)).torque(np.array([w]), np.array([tau]))
    loss = float(motor[0] - joint[0])
    assert loss * w >= -1e-12
    teeth = tau - friction * np.sign(w) - damping * w
    if abs(w) > 2 and abs(teeth) > 100 * Gear().sharp:
        passed = teeth * efficiency if teeth * w > 0 else teeth / efficiency
        assert loss == pytest.approx(tau - passed, rel=1e-3, abs=1e-3 * abs(passed))


def test_end_stops_push_back_and_keep_no_more_than_they_are_given(paper: Design) -> None:
    """A knee driven into its stop: it is turned back, and the stop has gained energy, never given."""
    plant = plant_of(paper)
    trace = plant.run(falling(plant, np.array([0.3, -0.6]), 2.0, (0.0, 3.0)), Fixed(np.array([0.0, 30.0])), 0.3)
    upper = paper.leg.joint["knee"].upper
    knee = trace.q[:, BASE + 1]
    assert knee.max() > upper  # soft, so it yields a little
    assert knee.max() < upper + 0.05
    assert trace.energy_error < 1e-6
    assert trace.work[-1, 2] > 0
    kept = plant.stops.energy(trace.q[:, BASE:])
    assert np.all(trace.work[:, 2] - kept >= -1e-6)


def test_a_slow_controller_does_not_make_a_coarse_simulation(paper: Design) -> None:
    """Torques held for 10 ms: the same motion whether the steps between are asked for or not."""
    tau, plant = np.array([-10.0, 120.0]), plant_of(paper)
    slow, fast = (plant.run(start_angles(paper), Fixed(tau), 0.06, timing=Timing(p)) for p in (0.01, PERIOD))
    assert slow.energy_error < 1e-9
    np.testing.assert_allclose(slow.q[-1], fast.q[-1], rtol=0, atol=1e-9)


# ---- drives and encoders -----------------------------------------------------------------------------------------


@st.composite
def regions(draw: st.DrawFn) -> OperatingRegion:
    """Half-planes about the origin, at least one that bounds the torque each way."""
    number = st.floats(1e-3, 1.0)
    planes = [
        HalfPlane("+", draw(number), draw(st.floats(-1, 1))),
        HalfPlane("-", -draw(number), draw(st.floats(-1, 1))),
    ]
    more = draw(st.lists(st.tuples(st.floats(-1, 1), st.floats(-1, 1)), max_size=5))
    return OperatingRegion((*planes, *(HalfPlane("more", a, b) for a, b in more if a == 0 or abs(a) > 1e-3)))


@pytest.mark.slow
@settings(deadline=None)  # the first call compiles
@given(
    st.lists(
        st.tuples(regions(), st.floats(-30, 30), st.floats(-500, 500), st.floats(0.5, 1.5)), min_size=1, max_size=4
    )
)
def test_drive_gives_what_the_operating_regions_allow(
    joints: list[tuple[OperatingRegion, float, float, float]],
) -> None:
    """Drive.clamp is OperatingRegion.clamp, joint by joint; a true torque constant that is greater by a gain
    gives more torque for the same current and, as back-EMF, less speed."""
    own, w, tau, gain = (list(x) for x in zip(*joints, strict=True))
    drive = Drive(own, torque_gain=np.array(gain))
    expected = np.array([float(r.clamp(*x)) for r, *x in zip(own, w, tau, strict=True)])
    np.testing.assert_allclose(drive.clamp(np.array(w), np.array(tau)), expected, rtol=1e-12, atol=1e-12)
    motor, joint = drive.torque(np.array(w), np.array(tau))
    slower = np.array([float(r.clamp(g * x, y)) for r, g, x, y in zip(own, gain, w, tau, strict=True)])
    np.testing.assert_allclose(motor, np.array(gain) * slower, rtol=1e-12, atol=1e-12)
    np.testing.assert_array_equal(joint, motor)


def test_no_law_or_cap_of_a_drive_has_the_plant_compiled_anew(paper: Design) -> None:
    """Lines of torque that never bound fill up the arrays: compiled functions meet one shape."""
    designs = [paper, load("paper", {"leg.gear.torque_cap": 107.0, "leg.motor.torque_cap": 1.5})]
    drives = [make_plant(design).drive for design in designs]
    shapes = [{name: np.shape(value) for name, value in drive.numbers.items()} for drive in drives]
    assert shapes[0] == shapes[1]
    assert drives[0].upper.shape != drives[1].upper.shape


@pytest.mark.parametrize("changes", [{}, {"leg.motor.laws": ["four-quadrant"]}, {"leg.gear.torque_cap": 107.0}])
def test_motor_torque_stays_in_the_operating_region(changes: dict[str, Any]) -> None:
    """At every sample of a push that asks for far too much."""
    design = load("paper", changes)
    robot = build_robot(design.leg)
    own = [operating_region(design.leg, joint, robot.parameters) for joint in robot.joints]
    plant = Plant(robot, Drive(own))
    trace = plant.run(start_angles(design), Spring(np.array([0.3, -0.6]), 5000.0, 9.0), 0.25)
    assert np.abs(trace.command).max() > 500
    for k, region in enumerate(own):
        low, high = region.torque_bounds(trace.v[:, BASE + k])
        assert np.all(trace.motor[:, k] <= high + 1e-9)
        assert np.all(trace.motor[:, k] >= low - 1e-9)
        assert np.any(np.isclose(trace.motor[:, k], high) | np.isclose(trace.motor[:, k], low))


@pytest.mark.parametrize("periods", [0.0, 0.3, 1.0, 2.6, 7.0])
def test_a_command_acts_exactly_its_delay_later(paper: Design, periods: float) -> None:
    """The k-th call's torque acts from k period + delay to (k + 1) period + delay; before that there is none."""
    plant, period = plant_of(paper), PERIOD
    controller = Counting(plant.n)
    trace = plant.run(start_angles(paper), controller, 20 * period, timing=Timing(period, periods * period))
    assert controller.calls == 20
    acting = np.maximum(np.floor(trace.t[:-1] / period - periods + 1e-6) + 1, 0)
    np.testing.assert_allclose(trace.command[:-1, 0], 1e-6 * acting, rtol=0, atol=1e-12)
    assert set(np.round(np.mod(trace.t, period) / period, 6)) <= {0.0, 1.0, round(periods % 1, 6)}


@given(st.integers(4, 24), st.integers(1, 20), st.floats(-3, 3), st.floats(-15, 15), st.sampled_from([0.0, 0.25]))
def test_encoder_has_its_resolution_and_the_slope_over_its_window(
    bits: int, window: int, angle: float, speed: float, error: float
) -> None:
    """Uniform motion: angles to half a step, speed to a step over the window's time; none at the first reading. A speed
    error comes on top."""
    encoder = Encoder(bits, window, PERIOD, error)
    assert encoder.step == pytest.approx(2 * np.pi / 2**bits)
    for k in range(2 * window + 1):
        true = np.array([angle + speed * k * PERIOD])
        q, v = encoder.read(true, np.array([speed]))
        assert abs(q[0] - true[0]) <= encoder.step / 2 * (1 + 1e-9)
        assert abs(q[0] / encoder.step - round(q[0] / encoder.step)) < 1e-6
        if k == 0:
            assert v[0] == error
        else:
            assert abs(v[0] - speed - error) <= encoder.step / (min(k, window) * PERIOD) * (1 + 1e-9)


def test_perfect_encoders_are_perfect() -> None:
    q, v = np.array([0.123456789]), np.array([1.23456789])
    encoder = Encoder(0, 8, PERIOD)
    for _ in range(3):
        assert encoder.read(q, v) == (q, v)


# ---- what a ground has to be ---------------------------------------------------------------------------------------


def test_friction_that_a_hop_needs(smooth: dict[float, Trace], paper: Design) -> None:
    """Largest |f_x| / f_z of stance; a ground with less is named, one with more is not."""
    trace = smooth[PERIOD]
    f = np.stack([-0.37 * np.abs(trace.f[:, 1]), np.abs(trace.f[:, 1])], axis=1)
    slanted = replace(trace, f=f)
    assert HopFigures(paper, slanted).slip_ratio == pytest.approx(0.37)
    for friction, faults in ((0.36, ["needs friction 0.37, the ground has 0.36"]), (0.4, [])):
        figures = HopFigures(load("paper", {"contact.friction": friction}), slanted)
        assert [x for x in figures.limits_exceeded if "friction" in x] == faults
    assert not [x for x in HopFigures(paper, slanted).limits_exceeded if "friction" in x]


def test_a_foot_that_is_gone_at_once_has_figures(smooth: dict[float, Trace], paper: Design) -> None:
    """No stance: no push, no effort, but nothing that cannot be said."""
    trace = smooth[PERIOD]
    figures = HopFigures(paper, replace(trace, contact=np.zeros_like(trace.contact), events=()))
    row = figures.as_dict()
    assert figures.lift_off["time_s"] == 0.0
    assert figures.energy["stance_net_J"] == 0.0
    assert set(figures.saturation_mean.values()) == {0.0}
    assert sum(figures.parts.values()) == pytest.approx(row["clearance_m"])


def test_a_joint_that_reaches_its_stop_cuts_the_clearance_short_and_is_named(smooth: dict[float, Trace]) -> None:
    """The same run of a knee whose limit it passes on the way to the highest point: nothing later counts."""
    trace, wide = smooth[PERIOD], {"hop.foot_window": 0.5}
    free = HopFigures(load("paper", wide), trace)
    assert free.cut_short == ""
    assert free.highest is not None
    knee = trace.q[free.flight.start : free.highest, 3]
    first = int(np.argmax(knee > knee[0] + 0.5))
    assert first > 0
    cut = HopFigures(load("paper", wide | {"leg.knee.upper": float(knee[first]) - 2 * SIMULATED_SLACK}), trace)
    assert cut.highest is not None
    assert cut.clearance < free.clearance
    at = cut.highest + 1
    assert free.flight.start < at <= free.flight.start + first
    assert cut.cut_short == (
        f"the knee came to its end stop at {trace.t[at]:.3f} s: the clearance of {cut.clearance:.3f} m is of the time before, "
        f"and the {free.clearance:.3f} m that the leg reaches afterwards do not count"
    )


def test_a_ground_that_would_have_to_pull_is_named(smooth: dict[float, Trace], paper: Design) -> None:
    trace = smooth[PERIOD]
    pulled = replace(trace, f=np.where(trace.contact[:, None], [0.0, -25.0], 0.0))
    assert any(
        "would have to pull with 25 N (without contact.friction" in f for f in HopFigures(paper, pulled).limits_exceeded
    )
    rough = changed(paper, {"contact.friction": 0.6})
    assert "the ground would have to pull with 25 N" in HopFigures(rough, pulled).limits_exceeded


# ---- a vertical slider ---------------------------------------------------------------------------------------


@quick
@given(legs_in_motion(plane=True), st.floats(-200, 200))
def test_stance_on_a_slider_is_constrained_dynamics(
    case: tuple[Leg, np.ndarray, np.ndarray, np.ndarray], push: float
) -> None:
    """Joints whose motion the guide allows accelerate as Pinocchio's leg with foot and guide held by forces."""
    leg, q, v, _ = case
    slider = leg.model_copy(update={"guides": ("z",)})
    machine, tau = Machine(build_robot(slider)), np.linspace(push, -push, len(leg.joints))
    J = machine.stance_terms(q[BASE:], v[BASE:]).jacobian[:1]
    assume(np.linalg.norm(J) > 1e-2)
    q_j, v_j = machine.on_guides(q[BASE:], v[BASE:], 0.0, float(machine.stance_terms(q[BASE:], v[BASE:]).q[0]))
    s = machine.stance_terms(q_j, v_j)
    assert abs(s.v[0]) < 1e-9 * (1 + np.abs(v_j).sum())
    whole, a_j = machine.acceleration(s.q, s.v, tau, contact=True), s.acceleration(tau)
    forces = pin.rnea(machine.model, machine.data, s.q, s.v, whole)
    size = float(np.abs(forces).max() + np.abs(tau).max() + np.abs(s.bias).max())
    np.testing.assert_allclose(s.mass_matrix @ (whole[BASE:] - a_j), 0, atol=1e-8 * size)
    ground = s.contact_force(tau)
    np.testing.assert_allclose(forces[BASE:] - s.jacobian.T @ ground, tau, atol=1e-8 * size)


def test_a_leg_on_a_slider_keeps_its_guide_and_its_energy() -> None:
    """Thrown up by springs from a foot ahead of the hip: the body stays at its x, and no energy is lost."""
    design = load("paper", {"leg.guides": ("z",), "start.hip_height": 0.4, "start.foot_x": 0.05})
    plant, start, spring = plant_of(design), start_angles(design), Spring(np.array([0.35, -0.7]), d=0.0)
    trace = plant.run(start, spring, 0.5, timing=Timing(PERIOD, hold=False))
    assert [e.kind for e in trace.events][:1] == ["lift-off"]
    np.testing.assert_allclose(trace.q[:, 0], trace.q[0, 0], atol=1e-9)
    stance = trace.contact
    feet = [plant.machine.foot_motion(q, v)[0] for q, v in zip(trace.q[stance], trace.v[stance], strict=True)]
    np.testing.assert_allclose(feet, np.zeros_like(feet), atol=1e-8)
    stored = [
        plant.machine.energy(q, v) + 0.5 * spring.k * float(np.sum((q[BASE:] - spring.at) ** 2))
        for q, v in zip(trace.q, trace.v, strict=True)
    ]
    lower, upper = plant.stops.lower, plant.stops.upper
    touched = ((trace.q[:, BASE:] < lower) | (trace.q[:, BASE:] > upper)).any(axis=1)
    before = int(np.argmax(touched)) if touched.any() else len(stored)
    assert trace.t[before - 1] > trace.events[0].t  # the leg is in the air before a joint meets its end stop
    np.testing.assert_allclose(stored[:before], stored[0], rtol=1e-6)
