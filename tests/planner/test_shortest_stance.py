"""Of hops that are equal in value, the one with the shortest stance."""

import pytest

from hopopt.cli.screen.answer import in_short
from hopopt.nlp.deadline import NEVER
from hopopt.ocp.hop import Hop
from hopopt.planner.search.shortest_stance import with_shortest_stance
from hopopt.planner.solution import Solution
from hopopt.planner.solve import solve
from hopopt.planner.stopwatch import Stopwatch
from hopopt.problem.load import load

SMALL = {  # a leg of 2.55 kg that jumps 0.4889 m in 0.30 s, and no higher in any longer stance
    "leg.body.mass": 1.8, "leg.thigh.length": 0.18, "leg.thigh.mass": 0.6, "leg.shank.length": 0.17, "leg.shank.mass": 0.15,
    "leg.hip.lower": -1.0, "leg.hip.upper": 1.5, "leg.knee.lower": -2.4, "leg.knee.upper": -0.2, "leg.motor.max_torque": 1.5,
    "leg.motor.max_speed": 264.0, "leg.motor.rotor_inertia": 2.4e-5, "leg.gear.ratio": 6.0, "start.hip_height": 0.22,
    "hop.stance_duration": [0.03, 0.36],
}  # fmt: skip


@pytest.mark.slow
def test_a_longer_stance_that_gives_nothing_is_not_used() -> None:
    """The highest hop in 0.28 s of stance is 0.4861 m, in 0.30 s 0.4889 m, as in 0.36 and 0.8 s."""
    found = solve(load("paper", SMALL), starts=1, processes=1)
    assert found.verified
    assert found.summary.certified
    assert found.clearance == pytest.approx(0.48890, abs=1e-5)
    assert 0.28 < found.lift_off < 0.31
    assert found.summary.leans_on.stance_at_its_limit is None
    assert found.summary.families
    family = found.summary.families[0]
    assert (family.clearance_m, family.words[-13:]) == (found.clearance, f"stance {found.lift_off:.2f} s")
    assert not [line for line in in_short(found.summary, found.design) if "longest stance" in line]


def test_a_stance_that_is_worth_something_stays(hop: Solution) -> None:
    """The paper's leg loses 1.3 mm by 1 % of it: nothing is solved again."""
    assert with_shortest_stance(Hop(hop.design), hop, (), lambda text: None, Stopwatch(), NEVER) is hop
