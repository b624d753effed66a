"""What a share of drawn legs reaches: draws within their spreads, and a promise that holds as often as it says."""

import json
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest
import xarray as xr
from scipy.stats import binom

from hopopt.cli.controllers.robust import shown
from hopopt.cli.main import run
from hopopt.cli.screen.console import show
from hopopt.comparison.robust.least_reserve import ENOUGH_WEIGHT, WEIGHT_SHARES, WITH_DRIVES, least_reserve
from hopopt.comparison.robust.robust_search import TRACKER, PlanSearch
from hopopt.comparison.robust.robustness import Reached, can_be_had, drawn, extremes, rank, reached
from hopopt.design import Design, Uncertainty
from hopopt.errors import NotSolvedError, UsageError
from hopopt.leg.robot import build_robot, link_bodies
from hopopt.nlp.deadline import NEVER, Deadline
from hopopt.ocp.hop import Hop
from hopopt.problem.load import load
from hopopt.sim.plant import PAST_APEX


def test_a_promise_is_broken_no_more_often_than_its_confidence_says() -> None:
    """2000 samples of a skewed distribution whose quantile is known: the order statistic is at most it, often enough."""
    rng, share, confidence, draws = np.random.default_rng(0), 0.9, 0.8, 40
    quantile = -np.log(share)  # of the exponential distribution: a share of all is above it
    samples = rng.exponential(size=(2000, draws))
    kept = float(np.mean([Reached(row, ()).promised(share, confidence) <= quantile for row in samples]))
    k = rank(draws, share, confidence)
    exact = 1 - sum(binom.pmf(j, draws, 1 - share) for j in range(k))
    assert exact >= confidence
    assert abs(kept - exact) < 4 * np.sqrt(exact * (1 - exact) / len(samples))


def test_a_promise_of_the_better_of_several_strategies_is_kept_as_often_as_it_says(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Clearances of a known distribution, the same for all strategies, so that only luck chooses between them: 2000 times what
    95 % of legs reach with the better tracker and the better PD strategy, from 59 draws each."""
    names, trial = ["track", "track_mpc", "force_tuned", "position_tuned"], 0
    strategies = [SimpleNamespace(name=n, needs_plan=n.startswith("track"), options=None) for n in names]
    runs = {s.name: SimpleNamespace(strategy=s, figures=SimpleNamespace(clearance=1.0)) for s in strategies}
    bound = SimpleNamespace(design=SimpleNamespace(uncertainty=Uncertainty()), clearance=2.0, verified=True)

    def clearances(design: object, name: str, plan: object, legs: list[int], *rest: object) -> Reached:
        return Reached(np.random.default_rng((trial, names.index(name), legs[0])).exponential(size=len(legs)), ())

    for function, value in {
        "chosen_names": lambda design, asked: (names, {}),
        "compare": lambda *asked, **more: SimpleNamespace(
            solution=bound, plan=SimpleNamespace(clearance=1.0), runs=runs
        ),
        "reference_of": lambda plan: None,
        "on_ideal_ground": lambda solution, say: solution,
        "drawn": lambda design, uncertainty, draws, seed: [seed] * draws,
        "reached": clearances,
    }.items():
        monkeypatch.setattr(f"hopopt.comparison.robust.robustness.{function}", value)
    true, kept, confidence = -np.log(0.95), np.zeros(2), 0.0
    for trial in range(2000):  # noqa: B007  # clearances reads it
        had = can_be_had(bound, 59, seed=1)  # type: ignore[arg-type]
        assert had.tracked is not None
        assert had.pd is not None
        confidence = had.confidence
        kept += np.array([had.tracked.clearance_m, had.pd.clearance_m]) <= true
    assert confidence == pytest.approx(1 - 0.95**59)
    np.testing.assert_allclose(kept / 2000, confidence, rtol=0, atol=4 * np.sqrt(0.95 * 0.05 / 2000))


@pytest.mark.parametrize(("draws", "expected"), [(93, 2), (124, 3), (153, 4)])
def test_ranks_of_wilks(draws: int, expected: int) -> None:
    """95 % at 95 %: the least numbers of draws for these ranks, and 59 for the first (Wilks, 1941)."""
    assert (rank(draws, 0.95, 0.95), rank(draws - 1, 0.95, 0.95)) == (expected, expected - 1)
    assert rank(59, 0.95, 0.95) == 1
    with pytest.raises(UsageError, match="58 draws cannot promise"):
        rank(58, 0.95, 0.95)


def test_draws_stay_within_every_spread_and_share_masses() -> None:
    design = load("paper", {"contact.friction": 0.6, "simulation.gear_efficiency": 0.9})
    wide = Uncertainty(length=0.02, friction=0.2, start_angle=0.03, torque_delay=1e-3, gear_loss=0.1, speed_error=0.2)
    draws, plain = drawn(design, wide, 40, 5), drawn(design, Uncertainty(), 40, 5)
    assert [d.leg.leg.body.mass for d in draws] == [d.leg.leg.body.mass for d in plain]
    lengths = np.array([d.leg.leg.link["thigh"].length for d in draws]) / design.leg.link["thigh"].length - 1
    assert 0.01 < np.abs(lengths).max() <= 0.02
    friction = np.array([d.leg.contact.friction for d in draws], dtype=float)
    assert 0.1 < np.abs(friction / 0.6 - 1).max() <= 0.2
    errors = np.array([d.leg.simulation.speed_error for d in draws])
    assert -0.2 <= errors.min() < -0.15 < 0.15 < errors.max() <= 0.2
    delays = np.array([d.leg.simulation.torque_delay for d in draws])
    assert 0 <= delays.min() < 3e-4 < 7e-4 < delays.max() <= 1e-3
    kept = np.array([d.leg.leg.drive("knee", "gear", "efficiency")[1] for d in draws], dtype=float)
    assert 0.81 <= kept.min() < 0.85 < kept.max() <= 0.9
    starts = np.array([d.start for d in draws]) - plain[0].start
    assert 0.02 < np.abs(starts).max() <= 0.03


@pytest.mark.parametrize(
    "given", ["three_joint", "leg.thigh.inertia=0.0225", "leg.shank.inertia_tensor=[1e-2,1e-2,1e-4,0,0,0]"]
)
def test_inertias_that_are_given_go_with_the_mass(given: str) -> None:
    """As a rod's do that are not given: a URDF's, a number and a tensor, on drawn legs and on those at the ends."""
    believed = load(given) if given == "three_joint" else load("paper", [given])

    def by_mass(design: Design) -> np.ndarray:
        bodies = link_bodies(design.leg, build_robot(design.leg).parameters)[2:]
        return np.array([np.array(body.inertia, dtype=float) / body.mass for body in bodies])

    legs = [*drawn(believed, Uncertainty(), 5, 1), *extremes(believed, Uncertainty(), 1.0)]
    assert len({d.leg.leg.link[believed.leg.links[0]].mass for d in legs}) > 5
    for draw in legs:
        np.testing.assert_allclose(by_mass(draw.leg), by_mass(believed), rtol=1e-12)


def test_cranks_and_rods_weigh_more_or_less_each_by_itself() -> None:
    """Within the spread, inertias with their masses; what else is drawn stays, and heavy legs have heavy ones."""
    links = {"crank": 0.06, "rod": 0.38, "arm": 0.06, "ahead": False, "crank_mass": 0.1, "rod_mass": 0.2}
    design = load("paper", {"leg.knee.transmission.five_bar": links | {"rod_inertia": 0.004}})
    spread = Uncertainty(mass=0.1)
    legs, plain = (drawn(each, spread, 50, 3) for each in (design, load("paper")))
    found: list[Any] = [p.leg.leg.joint["knee"].transmission.five_bar for p in legs]  # type: ignore[union-attr]
    masses = np.array([(each.crank_mass / 0.1, each.rod_mass / 0.2, each.rod_inertia / 0.004) for each in found])
    np.testing.assert_allclose(masses[:, 1], masses[:, 2], rtol=1e-12)
    assert np.all(np.abs(masses - 1) <= 0.1)
    assert np.all(masses[:, :2].std(axis=0) > 0.04)
    assert abs(np.corrcoef(masses[:, :2].T)[0, 1]) < 0.5
    assert [p.leg.leg.body.mass for p in legs] == [p.leg.leg.body.mass for p in plain]
    heaviest, lightest = extremes(design, spread, 1.0)[:2]
    for leg, factor in ((heaviest, 1.1), (lightest, 0.9)):
        assert leg.leg.leg.joint["knee"].transmission.five_bar.rod_mass == pytest.approx(0.2 * factor)  # type: ignore[union-attr]


def test_a_rod_that_is_written_out_is_drawn_as_one_that_is_not() -> None:
    """Mass, length, centre of mass and inertia of every drawn link are the same."""
    rod: dict[str, object] = {"leg.thigh.com": 0.19, "leg.thigh.inertia": 1.87 * 0.38**2 / 12}
    rod["leg.shank.com_position"], moment = [0.0, 0.0, -0.1805], 0.8 * 0.361**2 / 12
    rod["leg.shank.inertia_tensor"] = [moment, moment, 0.0, 0.0, 0.0, 0.0]
    spread = Uncertainty(length=0.1)
    for plain, written in zip(drawn(load("paper"), spread, 5, 1), drawn(load("paper", rod), spread, 5, 1), strict=True):
        one, other = (link_bodies(d.leg.leg, build_robot(d.leg.leg).parameters)[2:] for d in (plain, written))
        for a, b in zip(one, other, strict=True):
            np.testing.assert_allclose(
                [*a.com, a.mass, a.inertia[1]], [*b.com, b.mass, b.inertia[1]], rtol=1e-12, atol=1e-15
            )


@pytest.mark.parametrize("legs", [lambda d: drawn(d, d.uncertainty, 20, 0), lambda d: extremes(d, d.uncertainty, 1.0)])
def test_a_leg_that_no_problem_may_have_is_said(legs: Callable[[Design], object]) -> None:
    with pytest.raises(UsageError, match=r"paper: \[uncertainty\] leads to leg.body.mass = 10\d\d.*: give less of it"):
        legs(load("paper", {"leg.body.mass": 1000.0}))


@pytest.mark.slow
def test_runs_on_draws_are_those_of_single_runs_and_falls_are_counted() -> None:
    """PD control on rough ground, in this process and by the workers; a leg without torque falls."""
    design = load("paper", {"contact.friction": 0.6})
    draws = drawn(design, Uncertainty(), 3, 1)
    found = reached(design, "force_tuck", None, draws, 1)
    assert found.fell == 0
    assert set(found.outcomes) == {PAST_APEX}
    assert np.all((found.clearances > 0.4) & (found.clearances < 0.7))
    weak = [type(d)(d.leg, 0.05 * d.torque_gain, d.start) for d in draws[:1]]
    fallen = reached(design, "force_tuck", None, weak, 1)
    assert fallen.fell == 1
    assert fallen.clearances[0] < 0.05


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--share", "1.5"], "share 1.5, confidence 0.95: both lie between 0 and 1"),
        (
            ["--draws", "20"],
            "20 draws cannot promise what 0.95 of the legs reach with confidence 0.95: give at least 59",
        ),
        (["--set", "uncertainty.mass=0", "--set", "uncertainty.torque_constant=0"], "[uncertainty] is zero throughout"),
        (["--set", "uncertainty.mass=-0.1"], "uncertainty.mass = -0.1"),
        (["--evaluations", "0"], "0 evaluations: at least 1 reserve must be tried"),
        (["--set", "hop.kind=periodic"], "the search for a reserve does not know the periodic hop yet"),
    ],
)
def test_what_cannot_be_promised_is_said_in_a_sentence(
    arguments: list[str], words: str, capsys: pytest.CaptureFixture[str], tmp_path: object
) -> None:
    assert run(["robust", "paper", "--results", str(tmp_path), *arguments]) == 2
    assert words in " ".join(capsys.readouterr().err.split())


def test_the_screen_says_who_reaches_what(capsys: pytest.CaptureFixture[str]) -> None:
    """Four numbers, the promise in words, and a table for the problem file."""
    numbers = {
        "clearance_m": 0.6,
        "lowest_m": 0.59,
        "median_m": 0.63,
        "plan_m": 0.64,
        "bound_m": None,
        "ideal_bound_m": 0.8,
    }
    counts = {"share": 0.95, "confidence": 0.9, "draws": 60, "rank": 1, "fell": 2, "evaluations": 3, "wall_s": 1.0}
    rest = {
        "tracker": "track",
        "reserve": {"torque": 0.1},
        "plan_verified": False,
        "against": None,
        "lowest_by_way_m": {"reserve": 0.55, "program": None},
        "feedback": {"k_p": [1000.0, 500.0], "k_d": [20.0, 10.0]},
        "pd": {"pd": 0.5},
        "pd_best": "pd",
        "pd_fell": {"pd": 0},
        "result_dir": "there",
    }
    show(shown({**numbers, **counts, **rest}))
    words = " ".join(capsys.readouterr().out.split())
    assert "bound, ideal ground 0.8000 m bound, this ground not verified" in words
    assert "track, 95 % of the legs 0.6000 m 2 pd, 95 % of the legs 0.5000 m 0" in words
    assert (
        "95 % of all legs within [uncertainty] reach this, with confidence 90 %: it is number 1 from below of 60"
        in words
    )
    assert "best of 3 that were tried; it was NOT verified" in words
    assert "by way: a reserve tuned on them 0.5500 m" in words
    assert "k_p = 1000, 500 N m/rad" in words
    assert "[reserve] torque = 0.1" in words
    assert "reaches more than any plan" not in words
    assert "no plan was found that all legs" not in words
    show(shown({**numbers, **counts, **rest, "pd": {"pd": 0.61}, "against": "under it 2 of 16 legs fold"}))
    words = " ".join(capsys.readouterr().out.split())
    assert "pd reaches more than any plan that was tracked" in words
    assert "no plan was found that all legs of the search keep: under it 2 of 16 legs fold" in words


def test_plans_under_which_legs_at_the_ends_fall_rank_last(monkeypatch: pytest.MonkeyPatch) -> None:
    """Below every plan under which none does; among themselves by how few fall. A leg that folds has fallen."""
    folds = "the leg folds at 0.020 s without a push"
    ends = iter([[0.6, 0.0, 0.0], [0.6, 0.6, 0.0], [0.4, 0.5, 0.4]])

    def reached_of(design: object, name: str, plan: object, legs: list[object], processes: int) -> Reached:
        heights = np.array(next(ends)) if len(legs) == 3 else np.full(len(legs), {0: 0.6, 1: 0.58, 2: 0.4}[found.count])
        return Reached(heights, tuple(folds if h == 0 else "past the apex" for h in heights))

    class Counted(PlanSearch):
        count = 0

    monkeypatch.setattr("hopopt.comparison.robust.robust_search.reached", reached_of)
    found = Counted(None, [None] * 4, [None] * 3, 1, lambda text: None)  # type: ignore[arg-type, list-item]
    reference = SimpleNamespace(clearance=0.6)
    for found.count in range(3):
        found.keep("reserve", None, None, reference, True)  # type: ignore[arg-type]
    most, fewer, none = (trial.score for trial in found.trials if trial is not None)
    assert most < fewer < none == 0.4
    assert found.best.lowest == 0.4
    assert Reached(np.zeros(2), (folds, "past the apex")).fell == 1


def test_plans_under_which_drawn_legs_fall_rank_below_all_others(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever the others reach; among themselves by how few fall, and how they fall is said."""
    folds, past = "the leg folds at 0.020 s without a push", "past the apex"
    heights = iter([[0.6, 0.0, 0.0, 0.6], [0.6, 0.6, 0.1, 0.6], [0.2, 0.2, 0.2, 0.2]])

    def reached_of(design: object, name: str, plan: object, legs: list[object], processes: int) -> Reached:
        found = np.array(next(heights)) if len(legs) == 4 else np.full(len(legs), 0.6)
        return Reached(found, tuple(folds if h < 0.15 else past for h in found))

    monkeypatch.setattr("hopopt.comparison.robust.robust_search.reached", reached_of)
    found = PlanSearch(None, [None] * 4, [None] * 3, 1, lambda text: None)  # type: ignore[arg-type, list-item]
    for clearance in (0.6, 0.6, 0.25):
        found.keep("reserve", None, None, SimpleNamespace(clearance=clearance), True)  # type: ignore[arg-type]
    two, one, none = (trial for trial in found.trials if trial is not None)
    assert two.score < one.score < 0 < none.score == found.best.score == 0.2
    assert two.against == f"under it 2 of 4 legs of the search fall, most like this: {folds}"
    assert none.against == ""


def test_the_problems_own_reserve_is_tried_as_it_is_and_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    """What it leaves out is a number in the plan's problem; where no plan is left, that is said."""
    room, design = "hopopt.comparison.robust.robust_search.", load("paper", {"reserve.torque": 0.07})
    plan = SimpleNamespace(clearance=0.7, verified=True)
    monkeypatch.setattr(room + "solved_from_known", lambda hop, known, until: plan)
    monkeypatch.setattr(room + "reference_of", lambda plan: plan)
    monkeypatch.setattr(
        room + "reached", lambda d, name, plan, legs, n: Reached(np.full(len(legs), 0.65), ("",) * len(legs))
    )
    found = PlanSearch(SimpleNamespace(design=design), [None] * 4, [None] * 2, 1, lambda text: None)  # type: ignore[arg-type, list-item]
    found.by_own_reserve()
    assert found.best.design.reserve.model_dump() == {
        "torque": 0.07, "speed": 0.0, "ground_force": 20.0, "height": 0.005, "angle": 0.02,
    }  # fmt: skip
    monkeypatch.setattr(room + "solved_from_known", Mock(side_effect=NotSolvedError("no start.", ["the knee pulls"])))
    found.by_own_reserve()
    assert found.against == "with the problem's own [reserve] held back: the knee pulls"


def test_a_program_that_hardly_clears_anything_is_no_plan() -> None:
    """Half of the bound at least: or what stands against it is said, and nothing is kept."""
    design = load("paper", {"contact.friction": 0.6})
    found = PlanSearch(SimpleNamespace(design=design, clearance=0.7), [], [], 1, lambda text: None)  # type: ignore[arg-type]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(PlanSearch, "_programs", lambda self, asked: iter([([], SimpleNamespace(clearance=0.03))]))
        found.by_program(1)
    assert found.trials == [None]
    assert found.against == "by one program for several legs: it clears no more than 0.030 m on all of its legs"


def test_without_a_plan_the_worst_constraint_is_said_once_and_in_time() -> None:
    """Every reserve fails in its own words: one sentence names what was held back and what stands against it."""

    class Hopeless(PlanSearch):
        tried = 0

        def _reserve(self, x: np.ndarray) -> float:
            self.tried += 1
            return super()._reserve(x)

    design = load("paper")
    bound = SimpleNamespace(design=design.model_copy(update={"name": "weak"}))
    for until, count in ((NEVER, 3), (Deadline(0.0), 0)):
        found = Hopeless(bound, [], [], 1, lambda text: None, until)  # type: ignore[arg-type]
        with pytest.MonkeyPatch.context() as patch:
            said = NotSolvedError(
                "no start.", ["Worst constraints of the closest start:", "the knee pulls at 0.1 s", "x"]
            )
            patch.setattr("hopopt.comparison.robust.robust_search.solved_from_known", Mock(side_effect=said))
            found.by_reserve(3)
        assert found.tried == count
        with pytest.raises(NotSolvedError) as error:
            found.best  # noqa: B018
        words = str(error.value)
        assert "\n" not in words
        assert ("before the time was up: give more seconds" in words) == (count == 0)
        assert ("held back: the knee pulls at 0.1 s)" in words) == (count > 0)


def test_the_least_reserve_is_the_first_with_which_no_drawn_leg_falls(monkeypatch: pytest.MonkeyPatch) -> None:
    """Plans of fewer and fewer centimetres; the third is tracked on all legs, and what it costs is said."""
    design, tried, room = load("paper"), list[float](), "hopopt.comparison.robust.least_reserve."

    def plan(hop: Hop, known: object, until: Deadline) -> SimpleNamespace:
        tried.append(hop.design.contact.least_force)
        return SimpleNamespace(clearance=0.8 - 0.01 * len(tried), verified=True)

    def runs(asked: Design, name: str, plan: object, legs: list[object], processes: int) -> Reached:
        return Reached(np.array([0.7, 0.7 if len(tried) > 2 else 0.1]), ())

    monkeypatch.setattr(room + "solved_from_known", plan)
    monkeypatch.setattr(room + "reference_of", lambda plan: None)
    monkeypatch.setattr(room + "reached", runs)
    bound = SimpleNamespace(design=design, clearance=0.8)
    found = least_reserve(bound, draws=2)  # type: ignore[arg-type]
    heavy = 9.81 * (5.6 + 1.87 + 0.8)
    assert tried == pytest.approx([share * heavy for share in WEIGHT_SHARES[:3]])
    assert (found.share, found.design.reserve.ground_force) == (
        WEIGHT_SHARES[2],
        pytest.approx(WEIGHT_SHARES[2] * heavy),
    )
    assert "10% of the weight" in found.words
    assert "2 drawn legs falls; the whole [reserve] costs 3.0 cm of the bound" in found.words
    monkeypatch.setattr(room + "reached", lambda *asked: Reached(np.array([0.7, 0.1]), ()))
    tried.clear()
    last = "100% of the weight and 16% of torque and speed held back, 1 of 2 drawn legs fall"
    with pytest.raises(NotSolvedError, match=last):
        least_reserve(bound, draws=2)  # type: ignore[arg-type]
    alone = [
        share for share in WEIGHT_SHARES if share <= ENOUGH_WEIGHT
    ]  # where half of the legs still fall, weight is not enough
    assert tried == pytest.approx([share * heavy for share in (*alone, *(share for share, _ in WITH_DRIVES))])


def test_where_weight_is_not_enough_torque_and_speed_are_held_back_too(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of what the problem holds back by itself no less is held; what is held is said."""
    room, design = "hopopt.comparison.robust.least_reserve.", load("paper", {"reserve.torque": 0.09})
    plan = SimpleNamespace(clearance=0.7, verified=True)

    def runs(asked: Design, name: str, plan: object, legs: list[object], processes: int) -> Reached:
        return Reached(np.array([0.7, 0.1 if asked.reserve.speed < 0.07 else 0.7]), ())

    monkeypatch.setattr(room + "solved_from_known", lambda hop, known, until: plan)
    monkeypatch.setattr(room + "reference_of", lambda plan: None)
    monkeypatch.setattr(room + "reached", runs)
    found = least_reserve(SimpleNamespace(design=design, clearance=0.8), draws=2)  # type: ignore[arg-type]
    assert (found.share, found.design.reserve.speed, found.design.reserve.torque) == (0.45, 0.08, 0.09)
    assert "45% of the weight and 8% of torque and speed, is the least" in found.words


@pytest.mark.rarely
def test_what_is_promised_of_simulated_legs_is_kept() -> None:
    """PD control, 20 promises of 5 legs each: they are above what half of 80 other legs reaches no more often than
    their confidence says."""
    design = load("paper", {"contact.friction": 0.6, "simulation.control_rate": 500.0, "simulation.encoder_bits": 0})
    share, confidence = 0.5, 0.8
    kept = [reached(design, "force_tuck", None, drawn(design, Uncertainty(), 5, seed), 1) for seed in range(20)]
    many = reached(design, "force_tuck", None, drawn(design, Uncertainty(), 80, 999), 1)
    true = float(np.quantile(many.clearances, 1 - share))
    broken = sum(each.promised(share, confidence) > true for each in kept)
    k = rank(5, share, confidence)
    chance = sum(binom.pmf(j, 5, 1 - share) for j in range(k))  # of one that is broken
    assert chance <= 1 - confidence
    assert broken <= binom.ppf(0.99, 20, chance)


@pytest.mark.slow
def test_the_command_prints_one_object(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Small budgets: the promise is below the plan, above PD, and the bounds are above all; its page says the same."""
    monkeypatch.setattr("hopopt.comparison.robust.robust.TUNING_DRAWS", 4)
    arguments = ["--set", "contact.friction=0.6", "--set", "hop.stance_duration=[0.03, 0.2]"]
    arguments += ["--set", "solver.stance_intervals=20", "--set", "simulation.control_rate=1000"]
    budget = ["--share", "0.8", "--confidence", "0.8", "--draws", "8", "--evaluations", "1", "--starts", "1"]
    assert run(["robust", "paper", *arguments, *budget, "--json", "--results", str(tmp_path)]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["fell"] == 0
    assert found["pd"]["force_tuck"] < found["clearance_m"] < found["bound_m"] <= found["ideal_bound_m"]
    assert (found["draws"], found["share"], found["confidence"]) == (8, 0.8, 0.8)
    assert found["reserve"]["torque"] >= 0
    assert found["tracker"] == TRACKER
    assert found["lowest_by_way_m"][found["way"]] == max(x for x in found["lowest_by_way_m"].values() if x is not None)
    assert (found["feedback"] is None) == (found["way"] == "reserve")
    with xr.open_dataset(Path(found["result_dir"]) / "runs.nc", group="plan", engine="h5netcdf") as plan:
        assert float(plan.t[-1]) > 0.2  # what is tracked, in the folder
    assert sorted(found["clearances_m"]["track"])[found["rank"] - 1] == found["clearance_m"]
    assert set(found["clearances_m"]) == {"track", *found["pd"]}
    page = tmp_path / "robust.html"
    assert run(["report", found["result_dir"], "-o", str(page)]) == 0
    assert f'<data value="{found["clearance_m"]}" data-key="clearance_m">' in page.read_text(encoding="utf-8")
