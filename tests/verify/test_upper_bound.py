"""The bound by energy and speed: its parts against brute force, and hops that never cross it."""

from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, reject, settings
from hypothesis import strategies as st

from hopopt import load, solve
from hopopt.cli.screen.answer import bound_line
from hopopt.control.closed_loop import simulate
from hopopt.control.strategies import BUILT_IN
from hopopt.design import Design, physical_parameters
from hopopt.drivetrain.operating_region.half_planes import HalfPlane, OperatingRegion
from hopopt.drivetrain.operating_region.region import operating_region
from hopopt.errors import NotSolvedError, ProblemFileError
from hopopt.leg.robot import BASE
from hopopt.sim.machine import Machine
from hopopt.verify.upper_bound import most_power, most_speed, upper_bound
from once import solved_once

LAWS = (("paper",), ("four-quadrant",), ("paper", "four-quadrant"), ())


@st.composite
def regions(draw: st.DrawFn) -> OperatingRegion:
    """The region of the paper's knee with laws and caps drawn."""

    def maybe(low: float, high: float) -> float | None:
        return draw(st.none() | st.floats(low, high))

    laws = draw(st.sampled_from(LAWS))
    torque, speed = (0.5, 3.0) if laws else (draw(st.floats(0.5, 3.0)),) * 2, (300.0, 2000.0)
    entries = {
        "leg.motor.laws": list(laws),
        "leg.motor.torque_cap": torque[0] if not laws else maybe(*torque),
        "leg.gear.torque_cap": maybe(20.0, 300.0),
        "leg.gear.speed_cap": draw(st.floats(*speed)) if not laws else maybe(*speed),
    }
    leg = load("paper", {name: value for name, value in entries.items() if value is not None}).leg
    return operating_region(leg, "knee", physical_parameters(leg))


@settings(max_examples=40, deadline=None)
@given(regions())
def test_most_power_is_that_of_a_fine_grid(region: OperatingRegion) -> None:
    w = np.linspace(-40, 40, 4001)
    lower, upper = region.torque_bounds(w)
    top = most_speed(region)
    power = np.maximum(upper * w, lower * w)[np.abs(w) <= top]
    assert most_power(region) >= power.max() - 1e-9
    assert most_power(region) == pytest.approx(power.max(), rel=2e-2)


@settings(max_examples=40, deadline=None)
@given(regions())
def test_no_torque_is_left_beyond_the_largest_speed(region: OperatingRegion) -> None:
    top = most_speed(region)
    tau = np.linspace(-500, 500, 20001)
    if np.isfinite(top):
        assert np.max(np.array(region.use(1.001 * top, tau)), axis=0).min() > 1
        assert np.max(np.array(region.use(0.999 * top, tau)), axis=0).min() < 1
    else:
        assert np.max(np.array(region.use(1e4, tau * 1e3)), axis=0).min() < 1


def test_what_nothing_bounds_is_infinite() -> None:
    cap = OperatingRegion((HalfPlane("cap", 0.1, 0.0), HalfPlane("cap", -0.1, 0.0)))
    assert most_power(cap) == most_speed(cap) == np.inf


def test_paper_by_hand() -> None:
    """Power of each drive tau_max omega_max / 4; speeds by the lengths; 8.27 kg from the start pose."""
    bound, w = upper_bound(load("paper")), 1256.637 / 100
    assert bound.power_W == pytest.approx(2 * 2.0 * 1256.637 / 4)
    body = 0.361 * 2 * w + 0.38 * w
    thigh, shank = 0.361 * 2 * w + 0.19 * w, 0.1805 * 2 * w
    assert bound.lift_off_speed_m_s == pytest.approx((5.6 * body + 1.87 * thigh + 0.8 * shank) / 8.27)
    rise = 0.4 * bound.power_W / (8.27 * 9.81)
    assert bound.by_energy_m - rise == pytest.approx(
        upper_bound(load("paper", ["leg.motor.max_torque=1"])).by_energy_m - rise / 2
    )
    assert bound.clearance_m == min(bound.by_energy_m, bound.by_speed_m)  # every link's centre of mass lies on its line


def test_time_and_power_count_in_proportion() -> None:
    base, longer = (upper_bound(load("paper", {"hop.stance_duration": [0.03, T]})) for T in (0.2, 0.4))
    rise = 0.2 * base.power_W / (8.27 * 9.81)
    assert longer.by_energy_m - base.by_energy_m == pytest.approx(rise)
    assert longer.by_speed_m == base.by_speed_m


@st.composite
def problems(draw: st.DrawFn) -> Design:
    """The paper's leg with its numbers drawn, solved on one coarse mesh."""
    entries = {
        "leg.thigh.length": (0.25, 0.5), "leg.shank.length": (0.25, 0.5), "leg.body.mass": (2.0, 9.0),
        "leg.gear.ratio": (50.0, 160.0), "leg.motor.max_torque": (1.5, 4.0), "hop.stance_duration[1]": (0.1, 0.5),
    }  # fmt: skip
    drawn: dict[str, Any] = {name: draw(st.floats(*limits)) for name, limits in entries.items()}
    drawn["hop.stance_duration"] = [0.03, drawn.pop("hop.stance_duration[1]")]
    drawn["start.hip_height"] = 0.6 * (drawn["leg.thigh.length"] + drawn["leg.shank.length"])
    mesh = {"solver.refine": False, "solver.stance_intervals": 12, "solver.flight_intervals": 5, "solver.starts": 1}
    try:
        return load("paper", drawn | mesh)
    except ProblemFileError:  # such lengths cannot stand that high within the joint limits
        reject()


@pytest.mark.slow
@settings(max_examples=6, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow])
@given(problems())
def test_no_hop_of_a_random_leg_crosses_it(design: Design) -> None:
    try:
        solution = solve(design, processes=1)
    except NotSolvedError:
        return
    bound = upper_bound(design)
    assert solution.clearance < bound.clearance_m
    assert solution.summary.upper_bound.clearance_m == pytest.approx(bound.clearance_m)


@pytest.mark.slow
def test_the_steps_of_the_proof_hold_along_a_verified_hop() -> None:
    """At every instant the power, the energy so far, the energy of the centre of mass, and its speed at lift-off."""
    solution = solved_once(["hop.stance_duration=[0.03,0.2]"])
    assert solution.verified
    bound, machine, stance = upper_bound(solution.design), Machine(solution.robot), solution.tables["stance"]
    t, q, v = (x.reshape(-1, *x.shape[2:]) for x in (stance.t, stance.q, stance.v))
    energy = np.array([machine.energy(*state) for state in zip(q, v, strict=True)])
    power = np.sum(stance.tau * stance.v[..., BASE:], axis=-1)
    assert power.max() <= bound.power_W * (1 + 1e-3)
    assert np.all(energy - energy[0] <= bound.power_W * t * (1 + 1e-3) + 1e-6)
    com, speed = machine.points(q[-1])["com"], np.linalg.norm(machine.com_velocity(q[-1], v[-1]))
    of_com = machine.mass * (9.81 * com[1] + 0.5 * speed**2)
    assert of_com <= energy[-1] + 1e-6
    assert speed <= bound.lift_off_speed_m_s


@pytest.mark.parametrize("name", [pytest.param("force", marks=pytest.mark.slow), "position"])
def test_a_controller_that_pushes_longer_passes_the_bound_and_is_said_to(name: str) -> None:
    """The bound speaks of hops within the limits: the words beside it say so, and the run's own say what it did not keep."""
    design = load("paper", {"hop.stance_duration": [0.01, 0.015]})
    bound = upper_bound(design).clearance_m
    run = simulate(design, BUILT_IN[name]).figures
    assert run.clearance > bound
    assert [words for words in run.limits_exceeded if words.startswith("stance of 0.1")]
    said = " ".join(bound_line(bound, "clearance"))
    assert said.startswith("no hop that keeps the drives' limits and the longest stance can pass 0.47 m")
