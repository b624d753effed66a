"""What follows from a leg's entries, against closed forms and virtual work."""

import numpy as np
import pinocchio as pin
import pytest

from hopopt.design import Design
from hopopt.drivetrain.motor import rated
from hopopt.leg.derived import derived
from hopopt.leg.kinematics import start_angles
from hopopt.leg.robot import BASE, build_robot
from hopopt.problem.load import builtin_names, load

G = 9.81


def test_figures_of_the_papers_leg_by_hand() -> None:
    design = load("paper")
    leg, found = design.leg, derived(design)
    hip, knee = found.joints
    assert found.mass == pytest.approx(5.6 + leg.link["thigh"].mass + leg.link["shank"].mass)
    assert found.weight == pytest.approx(G * found.mass)
    assert found.reach == pytest.approx(0.38 + 0.361)
    assert found.time == pytest.approx((found.reach / G) ** 0.5)
    assert (hip.name, knee.name) == ("hip", "knee")
    torque, speed = rated(leg, "hip")
    for joint in found.joints:
        assert joint.stall_torque == pytest.approx(100 * torque)
        assert joint.no_load_speed == pytest.approx(speed / 100)
        assert joint.peak_power == pytest.approx(joint.stall_torque * joint.no_load_speed / 4)  # of the paper's law
        assert joint.rotor_inertia == pytest.approx(100**2 * leg.motor.rotor_inertia)
    shank = leg.link["shank"]
    assert knee.link_inertia == pytest.approx(shank.mass * shank.length**2 / 3)  # a rod about its end


def test_the_push_is_what_the_knee_holds_over_its_arm() -> None:
    """The foot is below the hip: the knee's arm is its distance from the plumb line, by the law of cosines."""
    design, height = load("paper"), 0.28
    thigh, shank = 0.38, 0.361
    along = (thigh**2 + height**2 - shank**2) / (2 * height)
    arm = (thigh**2 - along**2) ** 0.5
    found = derived(design)
    assert found.push == pytest.approx(200 / arm / found.weight)


@pytest.mark.parametrize("entries", [[], ["leg.gear.torque_cap=107", "leg.gear.speed_cap=680"]])
def test_power_is_the_most_within_the_region(entries: list[str]) -> None:
    """Against a search over speeds."""
    from hopopt.drivetrain.operating_region.region import operating_region

    design = load("paper_four_quadrant", entries)
    robot = build_robot(design.leg)
    for joint in derived(design).joints:
        w = np.linspace(0, joint.no_load_speed, 20001)
        tau = operating_region(robot.leg, joint.name, robot.parameters).torque_bounds(w)[1]
        assert joint.peak_power == pytest.approx(float((w * tau).max()), rel=1e-4)


@pytest.mark.parametrize("name", ["paper", "three_joint"])
def test_holding_torques_are_those_of_virtual_work(name: str) -> None:
    """Per radian of a joint, the foot on the ground, the weight rises by so much."""
    design = load(name)
    robot, q = build_robot(design.leg), start_angles(design)
    found, step = derived(design), 1e-6
    foot = robot.model.getFrameId("point_foot")

    def rise(angles: np.ndarray) -> float:
        data = robot.model.createData()
        com = pin.centerOfMass(robot.model, data, np.concatenate([np.zeros(BASE), angles]))[2]
        pin.updateFramePlacements(robot.model, data)
        return float(com - data.oMf[foot].translation[2])

    for k, joint in enumerate(found.joints):
        e = step * np.eye(len(q))[k]
        assert joint.holding_torque == pytest.approx(found.weight * (rise(q + e) - rise(q - e)) / (2 * step), abs=1e-5)


@pytest.mark.parametrize("name", builtin_names())
def test_rotors_and_links_make_up_the_mass_matrix(name: str) -> None:
    design = load(name)
    robot = build_robot(design.leg)
    q = np.concatenate([np.zeros(BASE), start_angles(design)])
    M = np.diag(pin.crba(robot.model, robot.model.createData(), q))[BASE:]
    found = derived(design)
    np.testing.assert_allclose([j.rotor_inertia + j.link_inertia for j in found.joints], M)


def test_legs_that_differ_in_size_alone_have_the_same_numbers_without_dimension() -> None:
    """Lengths k, masses k^3, torques k^4, speeds k^-1/2, rotors k^5."""

    def shares(design: Design) -> list[float | None]:
        d = derived(design)
        by_joint = [
            (j.no_load_speed * d.time, j.rotor_inertia / j.link_inertia, j.stall_torque / j.holding_torque)
            for j in d.joints
        ]
        return [d.push, *np.ravel(by_joint).tolist()]

    k, leg = 0.3, load("paper").leg
    parts = {f"leg.{n}.mass": leg.link[n].mass * k**3 for n in leg.links}
    parts |= {f"leg.{n}.length": leg.link[n].length * k for n in leg.links}
    parts |= {"leg.body.mass": leg.body.mass * k**3, "start.hip_height": 0.28 * k, "leg.motor.max_torque": 2 * k**4}
    parts |= {"leg.motor.max_speed": leg.motor.max_speed * k**-0.5, "leg.motor.rotor_inertia": 1.19e-5 * k**5}
    assert shares(load("paper", parts)) == pytest.approx(shares(load("paper")), rel=1e-3)
