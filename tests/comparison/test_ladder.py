"""Why PD is lower, freedom by freedom: what is withheld, and rungs that add up."""

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import casadi as ca
import numpy as np
import pytest

from hopopt.cli.main import run
from hopopt.cli.screen.runs import ladder as ladder_lines
from hopopt.comparison import losses
from hopopt.comparison.compare import Comparison, compare
from hopopt.comparison.ladder import CONTROL, Ladder, Rung, ladder, withheld
from hopopt.comparison.losses import Lifted, beyond_the_bound, lifted_in_turn
from hopopt.control.strategies import find
from hopopt.design import physical_parameters
from hopopt.drivetrain.gear import gears_of
from hopopt.errors import NotSolvedError, UsageError
from hopopt.ocp.custom import Moment
from hopopt.planner.solution import Solution
from hopopt.planner.solve import solve
from hopopt.plots.controllers.ladder import staircase
from hopopt.problem.load import load
from hopopt.problem.own import named_apart
from hopopt.sim.hop_metrics import HopFigures
from hopopt.storage.solution import save
from once import plan_with_reserve, simulated_once


@pytest.fixture(scope="module")
def pd() -> HopFigures:
    return simulated_once(load("paper"), find("force_tuck")).figures


def test_the_simulated_hop_keeps_all_that_is_withheld(pd: HopFigures) -> None:
    """So PD's own hop is one of those that the first rung chooses from."""
    freedoms = {f.allows: f for f in withheld(pd)}
    assert len(freedoms) == 5
    shortest, longest = freedoms["a longer stance"].entries["hop.stance_duration"]
    assert shortest < pd.lift_off["time_s"] < longest
    assert pd.trace.v[pd.stance, 1].min() > -0.05
    assert freedoms["more grip"].entries["contact.friction"] == pytest.approx(pd.slip_ratio)
    points, end = pd.trace.points, (pd.highest or 0) + 1
    for f, span in (
        ("the body off the plumb line", pd.stance),
        ("the leg drawn up fully", slice(pd.flight.start, end)),
    ):
        (limit,) = freedoms[f].constraints
        for k in range(len(pd.trace.t))[span]:
            at = {name: ca.DM(p[k]) for name, p in points.items()}
            value = float(ca.DM(limit.function(Moment(0.0, "stance", None, None, at, None))))
            assert limit.terms.lower <= value <= limit.terms.upper


def test_what_a_rung_withholds_is_told_apart(pd: HopFigures) -> None:
    """Two constraints that differ by their names alone were once refused as one."""
    own = [c for freedom in withheld(pd) for c in freedom.constraints]
    assert len(own) == 2
    assert named_apart(pd.design, own) == (pd.design, own)
    with pytest.raises(UsageError, match="two different constraints are called ladder:plumb line"):
        named_apart(pd.design, [own[0], replace(own[0], function=own[1].function)])


@pytest.mark.rarely
@pytest.mark.parametrize("orders", [1, 2])
def test_the_rungs_rise_to_the_bound_in_every_order(hop: Solution, orders: int) -> None:
    """Each is a verified optimum, and the gains of every order sum to the whole gap."""
    comparison = compare(hop.design, ["force_tuck"], bound=hop)
    found = ladder(comparison, orders=orders)
    gap = comparison.bound - comparison.figures["force_tuck"].clearance
    assert found.verified
    assert found.rungs[0].allows == CONTROL
    assert found.rungs[-1].clearance_m == comparison.bound
    heights = [found.from_m, *(rung.clearance_m for rung in found.rungs)]
    assert np.diff(heights).min() > -1e-5
    assert len(found.orders) == len(set(found.orders)) == orders
    for order, gains in zip(found.orders, found.gains, strict=True):
        assert sorted(order) == sorted(rung.allows for rung in found.rungs[1:])
        assert sum(gains) == pytest.approx(gap, abs=1e-4)
        assert min(gains) > -1e-5
    for rung in found.rungs:
        assert rung.least_gain_m <= rung.gain_m <= rung.most_gain_m


@pytest.mark.slow
def test_where_no_pd_strategy_hops_the_comparison_stays(
    hop: Solution, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The ladder is left out with a sentence; all else was found and is kept."""
    monkeypatch.setattr("hopopt.comparison.compare.plan_to_track", lambda design, *rest: plan_with_reserve())
    words = ["compare", "paper", "--strategies", "track", "--why", "--no-figures", "--json", "--results", str(tmp_path)]
    assert run([*words, "--bound", str(save(hop, tmp_path).result_dir)]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert "ladder" not in answer
    assert "why PD is lower: no PD strategy of this comparison hops within every limit" in answer["notes"]
    assert answer["strategies"]["track"]["clearance_m"] > 0


def test_the_staircase_is_drawn(tmp_path: Path) -> None:
    """A step for each rung, named beside it."""
    rungs = (Rung(CONTROL, 0.6, 0.02, 0.02, 0.02, True), Rung("more grip", 0.7, 0.1, 0.05, 0.15, False))
    beyond = (Lifted("drives without friction", 0.61, 0.03, 0.75, 0.05, True),)
    figure = staircase(Ladder("force", 0.58, rungs, (("more grip",),), ((0.02, 0.1),), beyond), "A leg")
    figure.savefig(tmp_path / "why.png")
    (ax,) = figure.axes
    named = ["force, simulated", CONTROL, "more grip", "drives without friction"]
    assert [label.get_text() for label in ax.get_yticklabels()] == named
    assert any("bound +5.0 cm, force +3.0 cm" in text.get_text() for text in ax.texts)
    assert any("not verified" in text.get_text() for text in ax.texts)


def test_nothing_is_said_of_a_bound_that_was_not_verified(hop: Solution) -> None:
    comparison = Comparison(hop.with_summary(verified=False), None, {})
    with pytest.raises(Exception, match="the bound is not verified"):
        ladder(comparison)


def test_what_holds_both_down_is_lifted_in_turn_and_only_where_it_counts() -> None:
    lossy = load("paper", {"leg.gear.efficiency": 0.8, "leg.knee.gear.friction": 3.0, "supply.voltage": 48.0})
    words, designs = zip(*lifted_in_turn(lossy), strict=True)
    assert words == ("gears that pass on all torque", "drives without friction", "a supply that never sags")
    teeth, friction, fed = (gears_of(d.leg, physical_parameters(d.leg)) for d in designs)
    assert teeth.friction == pytest.approx([0.0, 3.0])
    assert friction.ideal
    assert fed.ideal
    assert designs[1].leg.supply is not None
    assert designs[2].leg.supply is None
    assert not list(lifted_in_turn(designs[2]))
    assert not list(lifted_in_turn(load("paper")))
    machine = load("paper", {"simulation.gear_efficiency": 0.9})
    assert [(w, d.simulation.gear_efficiency) for w, d in lifted_in_turn(machine)] == [(words[0], 1.0)]


TABLE = {"speed": [0.0, 10.0], "efficiency": [0.6, 0.8]}


@pytest.mark.parametrize(
    "entries",
    [
        {"leg.gear.efficiency_table": TABLE},
        {"leg.gear.efficiency": 0.8, "leg.knee.gear.efficiency_table": TABLE},
        {"leg.gear.efficiency_table": TABLE, "leg.knee.gear.efficiency": 0.8},
    ],
)
def test_gears_whose_efficiency_is_a_table_lose_nothing_either(entries: dict[str, object]) -> None:
    ((words, design),) = lifted_in_turn(load("paper", entries))
    assert words == "gears that pass on all torque"
    gears = gears_of(design.leg, physical_parameters(design.leg))
    assert gears.ideal
    assert not gears.tabled


def test_shapes_that_nothing_comes_near_cost_nothing(tmp_path: Path) -> None:
    (tmp_path / "far.toml").write_text(
        'extends = "paper"\nname = "far"\n[leg.body.shapes.ball]\npoints = [[0.0, 0.0, 0.5]]\nradius = 0.02\n'
        "[leg.shank]\nradius = 0.02\n"
    )
    assert not list(lifted_in_turn(load(tmp_path / "far.toml")))


def test_a_rung_whose_optimum_is_not_found_is_named(
    hop: Solution, pd: HopFigures, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And no gap is told as if nothing were left to lift, nor a bound in doubt as if it were sure."""

    def never(design: object, known: Solution, say: object) -> Solution:
        raise NotSolvedError("no motion found")

    lossy = load("paper", {"leg.gear.efficiency": 0.8, "leg.gear.friction": 3.0})
    strategy: Any = SimpleNamespace(figures=pd, strategy=find("force_tuck"))
    comparison = Comparison(hop, None, {"force_tuck": strategy})
    monkeypatch.setattr(losses, "lifted_in_turn", lambda design: iter([("gears that pass on all torque", lossy)]))
    monkeypatch.setattr(losses, "_bound", never)
    found, missing = beyond_the_bound(comparison, "force_tuck", lambda text: None)
    assert (found, missing) == ((), "gears that pass on all torque")
    lifted = Lifted("links that may collide", 0.6, 0.0, 0.75, 0.05, False, ("the foot slips 2 mm in stance",))
    shown = Ladder("force_tuck", 0.58, (), (), (), (lifted,), missing).as_dict()
    *_, slips, gap, last = map(str, ladder_lines(shown))
    assert slips.endswith("with links that may collide does not keep every limit: the foot slips 2 mm in stance")
    assert gap.endswith("without these the gap is 15.0 cm, to a bound that is not verified")
    assert f"no optimum was found with {missing}" in last


@pytest.mark.rarely
def test_losses_cost_what_the_lossless_leg_has_more(hop: Solution, pd: HopFigures) -> None:
    """Of PD control and of the bound, each against its own hop with gears that lose nothing."""
    lossy = load("paper", {"leg.gear.efficiency": 0.7})
    comparison = compare(lossy, ["force_tuck"], bound=solve(lossy, starts=1))
    (lifted,), _ = beyond_the_bound(comparison, "force_tuck", lambda text: None)
    assert lifted.verified
    assert lifted.bound_m == pytest.approx(hop.clearance, abs=1e-4)
    assert lifted.bound_gains_m == pytest.approx(hop.clearance - comparison.bound, abs=1e-4)
    assert lifted.strategy_m == pytest.approx(pd.clearance, abs=1e-9)
    assert lifted.strategy_gains_m == pytest.approx(pd.clearance - comparison.figures["force_tuck"].clearance, abs=1e-9)
    assert lifted.strategy_gains_m > 0.01


@pytest.mark.rarely
def test_a_bound_whose_links_may_collide_is_that_without_shapes(hop: Solution, tmp_path: Path) -> None:
    """A ball on the body, which counts for nothing else, where the foot is at the clearance."""
    points = hop.sample(np.array([hop.end])).points
    x, z = (points["foot"] - points["hip"])[0]
    (tmp_path / "ball.toml").write_text(
        'extends = "paper"\nname = "ball"\n[leg.shank]\nradius = 0.02\n[leg.body.shapes.ball]\n'
        f"points = [[{x}, 0.0, {z}]]\nradius = 0.02\ncounts = false\n"
    )
    design = load(tmp_path / "ball.toml", {"hop.above_ground": ["hip", "knee", "foot"], "leg.lowest": "joints"})
    comparison = compare(design, ["force_tuck"], bound=solve(design, starts=1))
    (lifted,), _ = beyond_the_bound(comparison, "force_tuck", lambda text: None)
    assert lifted.verified
    assert lifted.lifts == "links that may collide"
    assert lifted.bound_m == pytest.approx(hop.clearance, abs=1e-4)
    assert lifted.bound_gains_m > 1e-3
    assert lifted.strategy_gains_m == 0.0
