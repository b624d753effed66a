"""What the live page says of a design beside what solving it says."""

from pathlib import Path

import pytest

from hopopt import load, solve
from hopopt.live.bench import IMPOSSIBLE, PRELIMINARY, Bench
from hopopt.live.desk import Desk
from hopopt.live.sliders import added_mass
from hopopt.problem.load import changed

pytestmark = pytest.mark.slow
ENTRIES = ["leg.gear.ratio", "leg.motor.max_torque", "leg.body.mass"]
CLOSE = 5e-3  # of the answer of a single solve


@pytest.fixture(scope="module")
def bench() -> Bench:
    made = Bench(load("paper"), "clearance", ENTRIES)
    sliders, found = made.begin(1)
    assert [s.entry for s in sliders] == ENTRIES
    assert found.outcome == PRELIMINARY
    return made


def test_after_a_change_the_hop_is_that_of_a_solve(bench: Bench, tmp_path: Path) -> None:
    """Of the same family within CLOSE; where the search of a solve finds a better one, the page learns it."""
    values, desk = (
        {s.entry: s.value for s in bench.sliders} | {"leg.gear.ratio": 80.0},
        Desk(load("paper"), "clearance", tmp_path),
    )
    answer = solve(changed(load("paper"), values), starts=2, processes=1)
    bench.learn(values, *desk.search(values))
    found = bench.at(values)
    verified = desk.verify(values, found)
    assert verified.verified
    assert verified.value == pytest.approx(answer.clearance, rel=1e-5)
    assert found.value == pytest.approx(answer.clearance, rel=CLOSE)
    assert found.error is not None
    assert found.value is not None
    assert abs(found.value - answer.clearance) < max(found.error, 1e-3)


def test_a_design_that_cannot_be_is_told(bench: Bench) -> None:
    low = Bench(load("paper"), "clearance", ["leg.shank.length"])
    low.begin(1)
    found = low.at({"leg.shank.length": 0.7})
    assert found.outcome == IMPOSSIBLE
    assert "start.hip_height" in found.sentence


def test_another_motor_brings_its_numbers(bench: Bench) -> None:
    """The hop with a motor of the catalogue is that of the problem with it, and the problem's own comes back."""
    own = {s.entry: s.value for s in bench.sliders}
    taken = {s.entry: s.value for s in bench.choose({"leg.motor": "maxon-ec45-250"})}
    assert taken["leg.motor.max_torque"] == load("paper", ["leg.motor=maxon-ec45-250"]).leg.motor.max_torque
    assert taken["leg.body.mass"] == pytest.approx(
        own["leg.body.mass"] + added_mass(load("paper"), {"leg.motor": "maxon-ec45-250"})
    )
    assert {s.entry: s.value for s in bench.choose({})} == own


def test_the_kinds_of_hop_that_a_search_finds_are_learnt_once(tmp_path: Path) -> None:
    """The paper's leg has two: both are followed from then on, the better is shown."""
    bench = Bench(load("paper"), "clearance", ENTRIES)
    bench.begin(1)
    values, desk = {s.entry: s.value for s in bench.sliders}, Desk(load("paper"), "clearance", tmp_path, 2)
    before, found = bench.at(values), desk.search(values)
    assert len(found[0]) > 1
    assert not bench.learn(values, *found).better
    assert bench.learn(values, *found).new == 0
    after = bench.at(values)
    assert after.value == pytest.approx(before.value, rel=3e-4)
    assert len({known for known in bench._known[-1].families if known}) == len(found[0])
