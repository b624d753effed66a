"""Several legs under one controller: the law holds for each, alike legs need none, and true drives are those of the plant."""

import numpy as np
import pinocchio as pin
import pytest

from hopopt.design import Design
from hopopt.drivetrain.drives import Drive
from hopopt.drivetrain.gear import Gear
from hopopt.drivetrain.operating_region.region import operating_region
from hopopt.drivetrain.supply import winding_heat
from hopopt.errors import UsageError
from hopopt.leg.kinematics import start_angles
from hopopt.leg.robot import BASE, build_robot
from hopopt.ocp.hop import Hop
from hopopt.ocp.hops.shared_control import (
    CLEARANCE,
    TrueLeg,
    highest_gains,
    under_one_controller,
    with_torque_constants,
)
from hopopt.planner.motion import Motion
from hopopt.planner.search.beside import Beside
from hopopt.planner.search.multistart import first_transcription, run_starts, solution_of
from hopopt.planner.shared_plan import of_leg, shared_plan, true_legs
from hopopt.problem.load import load
from once import solved_once

SHORT = [
    "hop.stance_duration=[0.03, 0.2]",
    "contact.friction=0.6",
    "contact.least_force=20",
    "solver.stance_intervals=24",
]


@pytest.fixture(scope="module")
def design() -> Design:
    return load("paper", SHORT)


@pytest.mark.slow
def test_alike_legs_hop_as_one_leg_does(design: Design) -> None:
    """Two legs that are the believed one reach its own optimum on the same mesh."""
    plan = solved_once([*SHORT, "solver.refine=false"])
    one, ones, start = Hop(design), np.ones(2), start_angles(design)
    found = shared_plan(true_legs(design, [(design, ones, start)], start), plan)
    first = first_transcription(one)
    best = solution_of(max(run_starts(one, 1, Beside(one, 0), lambda text: None), key=lambda o: o.signed_value), first)
    assert found.clearance == pytest.approx(float(best.parameters[CLEARANCE].item()), abs=5e-4)


@pytest.mark.slow
def test_every_leg_follows_the_law_and_its_own_equations_of_motion(design: Design) -> None:
    """At the program's nodes, torques from Pinocchio's inverse dynamics of each leg; both reach the same clearance."""
    data = design.model_dump(exclude_none=True)
    for name in ("body", *design.leg.links):
        data["leg"][name]["mass"] *= 1.03
    heavy, gain, start = Design.model_validate(data), np.array([0.95, 1.04]), start_angles(design)
    plan = solved_once([*SHORT, "solver.refine=false"])
    legs = true_legs(design, [(heavy, gain, start)], start)
    found = shared_plan(legs, plan)
    n, s = 2, found.solution
    for phase, trajectory in s.phases.items():
        nodes = np.array(trajectory.scheme.control_c)
        samples = []
        for leg in legs:
            own = {name: of_leg(t, leg.number, len(legs)) for name, t in s.phases.items()}
            rows = Motion(leg.hop.design, "clearance", own).everywhere(phase, nodes)
            samples.append(rows)
            model = build_robot(leg.hop.design.leg).model
            tau = np.array(
                [pin.rnea(model, model.createData(), *row) for row in zip(rows.q, rows.v, rows.a, strict=True)]
            )
            if phase == "flight":
                np.testing.assert_allclose(tau[:, BASE:], rows.tau, atol=1e-6)
                np.testing.assert_allclose(tau[:, :BASE], 0.0, atol=1e-6)
        believed, other = samples
        error = np.hstack([other.q[:, -n:] - believed.q[:, -n:], other.v[:, -n:] - believed.v[:, -n:]])
        asked = gain * (believed.tau - error @ found.feedback.T)
        np.testing.assert_allclose(other.tau, asked, atol=1e-3)
        assert np.abs(error[:, :n]).max() > 1e-4  # they do differ
    for leg in legs:
        own = {name: of_leg(t, leg.number, len(legs)) for name, t in s.phases.items()}
        assert Motion(leg.hop.design, "clearance", own).claims()["clearance_m"] >= found.clearance - 1e-6
    assert found.clearance < plan.clearance


def test_true_drives_are_those_of_the_plant(design: Design) -> None:
    """The bounds of a leg of the program are what the plant's drive lets through with that torque constant."""
    gain = np.array([0.9, 1.1])
    other = with_torque_constants(design, gain)
    believed = [operating_region(design.leg, j, build_robot(design.leg).parameters) for j in design.leg.joints]
    regions = [operating_region(other.leg, j, build_robot(other.leg).parameters) for j in design.leg.joints]
    drive = Drive(believed, torque_gain=gain)
    for speed in np.linspace(-12.0, 12.0, 25):
        w = np.array([speed, -0.7 * speed])
        for command in (np.full(2, 1e6), np.full(2, -1e6)):
            given = [float(r.clamp(x, c)) for r, x, c in zip(regions, w, command, strict=True)]
            np.testing.assert_allclose(drive.torque(w, command)[0], given, atol=1e-9)


SUPPLIED = {"supply.voltage": 48.0, "supply.internal_resistance": 0.2}
WINDING = {"leg.motor.winding_resistance": 0.9, "leg.motor.torque_constant": 0.04, "leg.motor.current_cap": 40.0}


@pytest.mark.parametrize(
    "entries", [SUPPLIED, {**SUPPLIED, **WINDING}, {**SUPPLIED, **WINDING, "leg.motor.voltage": 40.0}]
)
def test_true_drives_on_a_supply_draw_what_those_of_the_plant_draw(entries: dict[str, float]) -> None:
    """A torque constant of G times the believed one: as much torque from G^-2 of the heat, so the bus sags as much."""
    gain, design, far = np.array([0.9, 1.1]), load("paper", entries), np.full(2, 1e6)
    other = with_torque_constants(design, gain)
    p, q = (build_robot(x.leg).parameters for x in (design, other))
    plant = Drive.of(design.leg, p, np.zeros(2), Gear(), torque_gain=gain)
    planned = Drive.of(other.leg, q, np.zeros(2), Gear())
    heats = [np.array([winding_heat(x.leg, j, v) for j in design.leg.joints]) for x, v in ((design, p), (other, q))]
    np.testing.assert_allclose(heats[1], heats[0] / gain**2, rtol=1e-12)
    for speed in (-6.0, 0.0, 3.0):
        w = np.array([speed, -0.7 * speed])
        np.testing.assert_allclose(plant.torque(w, far)[0], planned.torque(w, far)[0], rtol=1e-9)


def test_a_drive_beyond_all_problems_is_said(design: Design) -> None:
    strong = load("paper", {"leg.motor.max_torque": 990.0})
    with pytest.raises(UsageError, match=r"leg.knee.motor.max_torque = 1089"):
        with_torque_constants(strong, np.array([1.0, 1.1]))


def test_gains_are_those_of_sampled_motors(design: Design) -> None:
    """A joint alone, sampled, with the highest gains: its errors die out."""
    k_p, k_d = highest_gains(design)
    period = 1 / design.simulation.control_rate
    model = build_robot(design.leg).model
    q = np.concatenate([np.zeros(BASE), start_angles(design)])
    inertia = 1 / np.diag(pin.computeMinverse(model, model.createData(), q))[BASE:]
    for p, d, shown in zip(k_p, k_d, inertia, strict=True):
        late, fast = period / (2 * shown), period / shown
        held = np.array([[1 - period * late * p, period - period * late * d], [-fast * p, 1 - fast * d]])
        assert np.abs(np.linalg.eigvals(held)).max() < 1


def test_a_hop_that_lands_has_no_shared_controller() -> None:
    design = load("paper", ["hop.kind=periodic"])
    with pytest.raises(UsageError, match="a hop from rest to its apex"):
        under_one_controller([TrueLeg(0, design, np.ones(2), start_angles(design))])
