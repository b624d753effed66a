"""The tuned PD strategies: never worse than the untuned gains, the same for the same seed, and truly simulated."""

from typing import Any

import numpy as np
import pytest

from hopopt.comparison.gain_tuning import (
    GAINS,
    LIMIT_PENALTY,
    POPULATION,
    STRATEGY_CHOICES,
    GainSearch,
    GainTrial,
    Tuned,
    text,
    tune,
    tuned_nearby,
)
from hopopt.control.closed_loop import simulate
from hopopt.control.paper_options import PaperOptions
from hopopt.control.strategies import BUILT_IN
from hopopt.errors import UsageError
from hopopt.problem.load import load
from refusals import refusal

QUICK = {"simulation.control_rate": 500.0, "simulation.encoder_bits": 0}  # eight times as fast
DESIGN = load("paper", QUICK)


@pytest.fixture(scope="module")
def tuned() -> Tuned:
    return tune(DESIGN, "position", evaluations=24, seed=3, processes=1)


@pytest.mark.slow
def test_the_best_is_not_worse_than_the_untuned_gains(tuned: Tuned) -> None:
    assert tuned.best.penalised_clearance >= tuned.untuned.penalised_clearance
    assert tuned.evaluations == 24
    for name, (lower, upper) in GAINS.items():
        assert lower * (1 - 1e-9) <= tuned.best.options[name] <= upper * (1 + 1e-9)


@pytest.mark.slow
def test_on_the_papers_leg_the_untuned_gains_are_the_papers(tuned: Tuned) -> None:
    assert tuned.untuned.options == pytest.approx({"k_p": 5424.0, "k_d": 9.0, "k_s": 1700.0, "retraction": "reference"})
    assert tuned.untuned.clearance == pytest.approx(simulate(DESIGN, BUILT_IN["position"]).figures.clearance, abs=1e-6)


@pytest.mark.slow
def test_the_best_is_what_the_simulator_says(tuned: Tuned) -> None:
    """As a user would hop it; and with motors weaker than believed, it hops lower or higher as stated."""
    hop = simulate(DESIGN, BUILT_IN["position"], options=tuned.best.options)
    assert tuned.best.clearance == hop.figures.clearance
    assert tuned.best.limits_exceeded == tuple(hop.figures.limits_exceeded)
    weak = simulate(DESIGN, BUILT_IN["position"], options=tuned.best.options, torque_gain=np.full(2, 0.98))
    assert tuned.nearby[0] == weak.figures.clearance


@pytest.mark.slow
def test_the_same_seed_gives_the_same_answer(tuned: Tuned) -> None:
    assert tune(DESIGN, "position", evaluations=24, seed=3, processes=1) == tuned


def test_a_gain_of_zero_has_no_factors() -> None:
    """Its logarithm is no number, and the search would have no bounds."""
    with pytest.raises(UsageError, match=r"control\.k_d = 0: gains are tuned by factors, so give more than 0"):
        tune(load("paper", {"control.k_d": 0.0}), "force", evaluations=24, processes=1)


@pytest.mark.parametrize("strategy", STRATEGY_CHOICES)
def test_the_first_generation_holds_the_untuned_gains_in_every_form(strategy: str) -> None:
    search = GainSearch(DESIGN.model_dump(exclude_none=True), strategy)
    first = search.first(seed=1)
    assert first.shape == (POPULATION, len(search.bounds))
    lower, upper = np.array(search.bounds).T
    assert np.all((first >= lower) & (first <= upper))
    assert np.array_equal(first, search.first(seed=1))
    assert not np.array_equal(first, search.first(seed=2))
    printed: dict[str, Any] = {name: getattr(PaperOptions(), name) for name in (*GAINS, *search.kinds)}
    forms = [search.options(x) for x in search.untuned()]
    assert forms[0] == pytest.approx(printed)
    kinds = {tuple(form[name] for name in search.kinds) for form in forms}
    assert len(kinds) == np.prod([len(c) for c in search.kinds.values()]) == len(forms)
    assert all(form[name] == pytest.approx(printed[name]) for form in forms for name in GAINS)


def test_a_limit_not_kept_costs_its_price() -> None:
    assert GainTrial({}, 0.5, ()).penalised_clearance == 0.5
    assert GainTrial(
        {}, 0.5, ("knee 0.020 rad into its end stop", "stance of 0.500 s")
    ).penalised_clearance == pytest.approx(0.5 - 2 * LIMIT_PENALTY)


@pytest.mark.parametrize(("strategy", "evaluations"), [("track", 60), ("force", POPULATION)])
def test_what_cannot_be_tuned_is_refused(strategy: str, evaluations: int) -> None:
    with pytest.raises(UsageError):
        tune(DESIGN, strategy, evaluations=evaluations)


def test_on_another_leg_the_search_is_about_its_own_gains() -> None:
    """Scaled bounds hold the scaled gains; gains that the problem gives are where it begins, even beyond the bounds."""
    small = GainSearch(load("solo12_leg", QUICK).model_dump(exclude_none=True), "force")
    given = GainSearch(load("solo12_leg", {**QUICK, "control.k_p": 9e4}).model_dump(exclude_none=True), "force")
    paper = GainSearch(DESIGN.model_dump(exclude_none=True), "force")
    for name, (lower, upper), (low, high) in zip(GAINS, small.bounds, paper.bounds, strict=False):
        assert upper - lower == pytest.approx(high - low)
        assert np.exp(lower) < small.gains[name] < np.exp(upper)
    assert given.gains["k_p"] == 9e4
    assert np.exp(given.bounds[0][1]) == pytest.approx(9e4)


def test_the_text_names_gains_and_limits() -> None:
    best, untuned = (
        GainTrial({"k_p": 4000.0, "retraction": "tuck"}, 0.6, ()),
        GainTrial({}, 0.5, ("stance of 0.500 s",)),
    )
    lines = text([Tuned("force", best, untuned, (0.59, 0.605), 60)])
    assert "force: 0.600 m with k_p 4000, retraction tuck (60 hops tried)" in lines
    assert "untuned 0.500 m (stance of 0.500 s)" in lines
    assert "0.590 and 0.605 m" in lines
    nothing = Tuned("force", untuned, untuned, (0.5, 0.5), 60)
    assert nothing.found.startswith("force: nothing better than the untuned gains in 60 hops; untuned 0.500 m")


@pytest.mark.parametrize("strategies", [",", "force,bogus"])
def test_what_cannot_be_tuned_is_said_before_the_first_is(
    strategies: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(
        "hopopt.comparison.gain_tuning.differential_evolution", lambda *given, **more: pytest.fail("tuned")
    )
    assert "has no gains to tune" in refusal(["tune", "--strategy", strategies, "--processes", "1"], capsys)


@pytest.mark.parametrize("best_k_s", [0.1, 1.0, 1.4, 30.0])
def test_a_few_hops_about_the_tuck_are_never_below_it(best_k_s: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever the height does with a gain; hops beyond a limit come last, however high they are."""
    search = GainSearch(DESIGN.model_dump(exclude_none=True), "force")

    def trial(self: GainSearch, options: dict[str, Any]) -> GainTrial:
        off = abs(np.log(options["k_s"] / (best_k_s * self.gains["k_s"])))
        stiff = options["k_p"] > 1.2 * self.gains["k_p"]
        return GainTrial(options, 1.0 - 0.1 * off + stiff, ("knee into its end stop",) if stiff else ())

    monkeypatch.setattr(GainSearch, "trial", trial)
    near = tuned_nearby(DESIGN, "force")
    untuned = trial(search, {**search.gains, "retraction": "tuck"})
    assert near.untuned == untuned
    assert near.best.clearance >= untuned.clearance
    assert not near.best.limits_exceeded
    assert (near.best.clearance > untuned.clearance) == (best_k_s != 1.0)
    assert 5 <= near.evaluations <= 8
    assert near.found.startswith("force_tuned: ")
