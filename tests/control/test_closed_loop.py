"""The loop as a whole: its energy balances or it is refused, and contact that chatters ends a run."""

import numpy as np
import pytest

from hopopt.control import closed_loop
from hopopt.control.strategies import find
from hopopt.errors import HopoptError
from hopopt.leg.kinematics import start_angles
from hopopt.problem.load import load
from hopopt.sim.controller import Measurement
from hopopt.sim.state import BOUNCE, Timing

RUBBING = {"simulation.gear_friction": 40.0, "simulation.gear_efficiency": 0.6}


@pytest.mark.parametrize("ground", [pytest.param({}, marks=pytest.mark.slow), {"contact.friction": 0.6}])
def test_gears_that_rub_hard_balance_their_energy(ground: dict[str, float]) -> None:
    """Friction so stiff that Runge-Kutta steps of a control period would ring."""
    run = closed_loop.simulate(load("paper", ground | RUBBING), find("force_tuck"), past_apex=True)
    assert run.trace.work[-1, 1] > 20
    assert run.trace.energy_error < 1e-6


@pytest.mark.slow
def test_finer_steps_balance_better() -> None:
    """A knee that runs into its end stop: stiff, and only two times continuous."""
    design = load("paper")
    errors = [
        closed_loop.make_plant(design, finer=finer)
        .run(start_angles(design), closed_loop.make_controller(design, find("position_tuned")), 0.5)
        .energy_error
        for finer in (1, 4)
    ]
    assert errors[1] < 0.2 * errors[0]


def test_a_run_whose_energy_does_not_balance_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """Less than rounding allows is asked for: no step is fine enough."""
    monkeypatch.setattr(closed_loop, "BALANCED", 1e-16)
    monkeypatch.setattr(closed_loop, "FINER", (1, 2))
    design = load("paper", {"contact.friction": 0.6, "hop.stance_duration": [0.03, 0.05]})
    with pytest.raises(
        HopoptError, match=r"strategy force: the simulation's energy balance is off by .*, more than 1e-16"
    ):
        closed_loop.simulate(design, find("force"))


class Stamping:
    """Pushes and pulls the foot in turns, a hundred times as often as a foot can hop."""

    pushes = False

    def torque(self, now: Measurement) -> np.ndarray:
        self.pushes = not self.pushes
        return np.array([-10.0, 150.0] if self.pushes else [40.0, -60.0])


@pytest.mark.parametrize("ground", [{}, {"contact.friction": 0.8}])
def test_chattering_contact_ends_the_run(ground: dict[str, float]) -> None:
    design = load("paper", ground)
    plant = closed_loop.make_plant(design)
    trace = plant.run(start_angles(design), Stamping(), 0.5, timing=Timing(1 / 20000))
    assert trace.outcome == "the contact chatters"
    left = trace.times_of("lift-off")
    assert left[-1] - left[-40] <= BOUNCE
    assert trace.t[-1] < left[-1] + 1 / 20000 + 1e-9
    assert trace.energy_error < 1e-4
