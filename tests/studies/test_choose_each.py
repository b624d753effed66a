"""A pair of its own for each joint."""

from pathlib import Path

import pytest

from hopopt.errors import UsageError
from hopopt.problem.catalogue import catalogue
from hopopt.problem.load import changed, load
from hopopt.studies.choose.choice import CLEARS
from hopopt.studies.choose.each import choose_each
from hopopt.studies.choose.pairs import Combination, drives, keys_of, pairs
from hopopt.studies.choose.run import choose, written

NAMES = ("maxon-ec60-flat-100", "maxon-ec45-flat-50", "apex-af042-20", "csf-17-50")


def test_a_combination_is_a_leg_whose_joints_have_their_own_drives() -> None:
    """By names, and by numbers alone as a map has them: the same leg."""
    design, known = load("paper"), catalogue()
    first, second = pairs(known, ["mini-cheetah", "csf-25-50"])
    both = Combination.of({"hip": first, "knee": second})
    assert both.name == "hip: mini-cheetah, knee: mini-cheetah with csf-25-50"
    chosen = drives(design, None, 4, 3.0, known)
    assert first.mass is not None
    assert second.mass is not None
    assert chosen.added(both) == pytest.approx(4 * (first.mass + second.mass - 3.0))
    named = changed(design, chosen.named(both))
    assert [named.leg.drive(j, "gear", "catalogue")[1] for j in ("hip", "knee")] == ["mini-cheetah", "csf-25-50"]
    numbers = changed(design, chosen.base(both, known, keys_of([both], known, design.leg)))
    for joint in ("hip", "knee"):
        assert (
            numbers.leg.drive(joint, "motor", "rotor_inertia")[1] == named.leg.drive(joint, "motor", "rotor_inertia")[1]
        )
        assert numbers.leg.drive(joint, "gear", "ratio")[1] == named.leg.drive(joint, "gear", "ratio")[1]
    assert numbers.leg.body.mass == named.leg.body.mass


def test_one_joint_or_a_resumed_folder_is_refused_in_a_sentence(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="--each is for two joints or more"):
        choose_each(load("paper"), 0.5, joints=["knee"])
    with pytest.raises(UsageError, match="--each cannot go on with --resume"):
        choose_each(load("paper"), 0.5, resume=tmp_path)


@pytest.mark.rarely
def test_a_combination_that_clears_is_lighter_than_the_best_pair_for_all_joints(tmp_path: Path) -> None:
    entries = {name: catalogue()[name] for name in NAMES}
    settings = {"verify": 0, "processes": 1, "results": tmp_path, "entries": entries}
    one = choose(load("paper"), 0.55, **settings).clearing[0]
    found = choose_each(load("paper"), 0.55, **settings)
    best = found.clearing[0]
    assert best.outcome == CLEARS
    assert isinstance(best.pair, Combination)
    assert (best.mass or 0.0) < (one.mass or 0.0)
    hip, knee = (pair for _, pair in best.pair.at)
    assert hip != knee
    leg = written(found, best).leg
    assert [leg.drive(j, "motor", "catalogue")[1] for j in ("hip", "knee")] == [hip.motor, knee.motor]
