"""Which entries can be dragged, and how far."""

import pytest

from hopopt import load
from hopopt.errors import UsageError
from hopopt.live.bench import Bench
from hopopt.live.sliders import COUNT, SUPPLY, added_mass, most_rewarding, named, places_of_parts
from hopopt.problem.catalogue import catalogue


def test_a_range_goes_from_half_to_twice_the_value_or_as_it_is_given() -> None:
    ratio, angle, friction, intervals = named(
        load("paper"), ["leg.gear.ratio", "leg.knee.lower", "contact.friction=0.3:0.9", "solver.stance_intervals=20:60"]
    )
    assert (ratio.low, ratio.value, ratio.high) == (50.0, 100.0, 200.0)
    assert (angle.low, angle.high) == (-4.8, -1.2)
    assert friction.value == friction.high == 0.9  # it is not set, so it begins where it limits least
    assert intervals.whole
    assert intervals.checked(20.4) == 20


def test_a_value_of_a_list_begins_where_the_problem_has_it() -> None:
    table = {"angle": [-2.4, -1.3, -0.15], "ratio": [1.2, 1.0, 0.8]}
    design, path = load("paper", {"leg.knee.transmission.table": table}), "leg.knee.transmission.table.ratio"
    middle, last = named(design, [f"{path}[1]=0.9:1.1", f"{path}[2]"])
    assert (middle.low, middle.value, middle.high) == (0.9, 1.0, 1.1)
    assert (last.low, last.value, last.high) == (0.4, 0.8, 1.6)
    assert middle.unit == "1"
    assert Bench(design, "clearance", [f"{path}[1]=0.9:1.1"]).design == design


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        (["leg.gear.rato"], "did you mean"),
        (["leg.gear.ratio", "leg.gear.ratio=1:2"], "given twice"),
        (["contact.friction"], "give its range"),
        (["start.foot_x"], "it is 0, so give its range"),
        (["leg.gear.ratio=2:1"], "the lower first"),
        (["hop.stance_duration[2]"], "no such value"),
        (["hop.stance_duration[a]"], "write a value of a list"),
        (["title"], "cannot be varied"),
        (["leg.gear.ratio=a:b"], "not a number"),
    ],
)
def test_what_can_have_no_slider_is_told(asked: list[str], words: str) -> None:
    with pytest.raises(UsageError, match=words):
        named(load("paper"), asked)


@pytest.mark.parametrize("value", [float("nan"), 1e9, 10**400, "80", True, None])
def test_a_value_outside_its_range_is_refused(value: object) -> None:
    with pytest.raises(UsageError, match=r"leg\.gear\.ratio"):
        named(load("paper"), ["leg.gear.ratio"])[0].checked(value)


def test_the_most_rewarding_come_first() -> None:
    found = most_rewarding(
        load("paper"), {"leg.gear.ratio": 1e-3, "leg.body.mass": -1.0, "start.foot_x": 9.0, "leg.thigh.mass": 0.0}
    )
    assert [s.entry for s in found] == ["leg.body.mass", "leg.gear.ratio"]
    assert len(found) <= COUNT


def test_a_supply_that_the_problem_states_has_sliders() -> None:
    design = load("paper", ["leg.supply.voltage=48", "leg.supply.internal_resistance=0.1"])
    found = most_rewarding(design, {"leg.body.mass": -1.0})
    assert [s.entry for s in found] == ["leg.body.mass", *SUPPLY]


def test_joints_with_drives_of_their_own_have_choices_of_their_own() -> None:
    assert places_of_parts(load("paper").leg) == ["leg.motor", "leg.gear"]
    own = load("paper", ["leg.knee.motor=maxon-ec45-250"])
    assert places_of_parts(own.leg) == ["leg.motor", "leg.gear", "leg.knee.motor"]


def test_the_body_carries_what_the_chosen_drives_of_all_its_legs_weigh_more() -> None:
    """From one drive that the catalogue states to another: both joints of two legs, their masses from the catalogue."""
    ours, theirs = "cubemars-ak70-10", "cubemars-ak80-9"
    design = load("paper", [f"leg.motor={ours}", f"leg.gear={ours}", "leg.body.legs=2"])
    lighter, heavier = (catalogue()[name] for name in (ours, theirs))
    mass = [e.module_mass or sum(e.masses.values()) for e in (lighter, heavier)]
    more = added_mass(design, {"leg.motor": theirs, "leg.gear": theirs})
    assert more == pytest.approx(2 * 2 * (mass[1] - mass[0]))
    assert more != 0
    assert added_mass(design, {}) == 0
