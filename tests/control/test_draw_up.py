"""Legs drawn up in flight: what is expected at lift-off is what the plant then shows, within every limit."""

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from hopopt.control.closed_loop import Run, make_controller, simulate
from hopopt.control.flight.braking import BRAKING, SPARED, Braking
from hopopt.control.flight.draw_up import LiftOff
from hopopt.control.paper_pd import PaperStrategy
from hopopt.control.setting import Setting
from hopopt.control.strategies import find
from hopopt.errors import ProblemFileError
from hopopt.leg.robot import BASE
from hopopt.problem.load import load

QUICK = {"simulation.control_rate": 1000.0, "simulation.encoder_bits": 0, "simulation.speed_window": 1}


def hop(name: str, strategy: str) -> Run:
    return simulate(load(name, QUICK), find(strategy), past_apex=True)


@pytest.mark.parametrize("name", ["hyq_leg", pytest.param("solo12_leg", marks=pytest.mark.slow), "paper"])
def test_a_tuck_keeps_the_limits_clears_more_and_comes_as_high_as_it_expects(name: str) -> None:
    """The servo of HyQ's knee once overran its drive, Solo's clearance came long before the apex.

    The flights are computed in CasADi with long steps, the plant is Pinocchio's: they agree to 2 % of the leg's length."""
    plain, tuck = hop(name, "force"), hop(name, "force_tuck")
    controller, f = tuck.controller, tuck.figures
    assert isinstance(controller, PaperStrategy)
    assert controller.aim is not None
    assert f.limits_exceeded == []
    assert f.clearance > plain.figures.clearance + 0.05 * f.design.leg.length
    assert f.clearance == pytest.approx(controller.aim.height, abs=0.02 * f.design.leg.length)
    assert tuck.limited_by.startswith("pushes 0.")
    assert "drawn up until" in tuck.limited_by
    assert plain.limited_by.endswith("in flight it follows its reference")


@pytest.mark.parametrize(("name", "slower"), [("go2_leg", 0.35), ("hyq_leg", 0.4)])
def test_slow_drives_do_not_overrun_where_the_clearance_comes_before_the_apex(name: str, slower: float) -> None:
    """Turned back while the leg still rose, both once turned faster than their drives may."""
    leg = load(name).leg
    speeds = {
        f"leg.{joint}.motor.max_speed": slower * leg.drive(joint, "motor", "max_speed")[1] for joint in leg.joints
    }
    tuck = simulate(load(name, {**speeds, "contact.friction": 0.7}), find("force_tuck"), past_apex=True)
    assert tuck.figures.limits_exceeded == []
    assert tuck.figures.clearance > 0.05 * leg.length


def test_no_pose_near_the_chosen_one_is_worth_more() -> None:
    """By flights computed anew, at both sides of every joint's angle."""
    controller = make_controller(load("go2_leg"), find("force_tuck"))
    assert isinstance(controller, PaperStrategy)
    drawing = controller.drawing_up
    assert drawing is not None
    off = LiftOff(np.array([0.64, -1.28]), np.array([-7.5, 15.0]), 1.8)
    best = drawing.aim(off)
    assert best is not None
    sides = np.vstack([0.1 * np.eye(2), -0.1 * np.eye(2)])
    poses = np.clip(best.pose + sides, drawing.lower + 0.03, drawing.upper - 0.03)
    worth, _ = drawing.heights(off, poses, best.fastest)
    assert worth.max() <= best.height + 1e-3
    slower = drawing.aim(LiftOff(off.q, off.v / 2, 1.2))
    assert slower is not None
    assert slower.height < best.height


def test_the_servo_asks_no_drive_for_more_than_braking_allows() -> None:
    """It slows down towards the pose: at twice the speed from which the drive stops in time it brakes."""
    controller = make_controller(load("paper"), find("force_tuck"))
    assert isinstance(controller, PaperStrategy)
    drawing = controller.drawing_up
    assert drawing is not None
    pose = np.array([0.5, -1.5])
    assert drawing.torque(pose - 0.2, np.zeros(2), pose, 0.85)[0] > 0
    assert drawing.torque(pose - [0.01, 0.0], np.array([10.0, 0.0]), pose, 0.85)[0] < 0


@pytest.mark.slow
@pytest.mark.parametrize("name", ["go1", "go2"])
def test_a_knee_with_little_room_is_braked_before_its_end_stop(name: str, tmp_path: Path) -> None:
    """Public legs whose knee turns at 15 to 17 rad/s, 0.16 rad before its limit, as the foot leaves; speeds are measured late."""
    file = tmp_path / f"{name}.toml"
    file.write_text(
        f'name = "{name}"\n[leg]\nurdf = "example-robot-data/{name}_description/urdf/{name}.urdf"\nbody.legs = 4\n'
        'joints = ["FL_thigh_joint", "FL_calf_joint"]\nfoot_frame = "FL_foot"\n'
        "[start]\njoint_angles = [0.8, -1.6]\n[contact]\nfriction = 0.7\n"
    )
    try:
        design = load(file)
    except ProblemFileError:
        pytest.skip("example-robot-data is not installed")
    found, plain = (simulate(design, find(s), past_apex=True).figures for s in ("force_tuck", "force"))
    assert found.limits_exceeded == []
    assert found.cut_short == ""
    assert found.clearance > 1.5 * plain.clearance


def test_ways_to_rest_are_those_of_an_integrated_brake() -> None:
    """A knee that its drive brakes with all it has, integrated by SciPy; its inertia that of the mass matrix."""
    setting = Setting(load("go2_leg"), 1e-9)
    stretched = np.array([0.4, -0.85])
    inertia = setting.machine().mass_matrix(np.concatenate([np.zeros(BASE), stretched]))[-1, -1]
    drive, speed, free = setting.drive(), 9.0, 0.7

    def braked(t: float, x: np.ndarray) -> np.ndarray:
        return np.array([x[1], drive.clamp(np.array([0.0, x[1]]), np.array([0.0, -1e9]))[1] / inertia])

    def stands(t: float, x: np.ndarray) -> float:
        return x[1]

    stands.terminal = True  # type: ignore[attr-defined]
    way = solve_ivp(braked, (0.0, 1.0), [0.0, speed], events=stands, rtol=1e-9, atol=1e-12).y[0, -1]
    braking = Braking(setting, stretched)
    q = np.array([0.4, braking.upper[1] - free])
    spared = SPARED * (braking.upper - braking.lower)[1]
    assert braking.rests_at(q, np.array([0.0, speed]))[1] == pytest.approx(
        free - spared - way / BRAKING, abs=0.01 * way
    )
    assert np.isinf(braking.rests_at(q, np.zeros(2))).all()
    assert braking.too_fast(braking.upper - 0.01, np.array([0.0, speed]))
