"""What is said of an answer by a global method: numbers that hold the verdict, on legs where it was wrong once."""

import numpy as np
import pytest

import hopopt as ho
from hopopt.cli.screen.search import global_line, starts_lines
from hopopt.global_search import Rollout, left_out
from hopopt.nlp.deadline import NEVER
from hopopt.ocp.hop import Hop
from hopopt.planner.answer.extras import GlobalMethod
from hopopt.planner.checks.global_verdict import GRID_TOO_COARSE, LESS, MAY_EXIST, NOTHING, followed, highest, verdict
from hopopt.planner.search.first_mesh import rollout_starts
from hopopt.planner.search.multistart import STOPPED_NEAR_KNOWN
from hopopt.planner.solve import solve_from
from hopopt.problem.load import load
from second_program import Leg, best_hop

# Entry, the answer [m], what the grid promises and its best motion reaches with flights that fold the leg in no time [m].
RECORDED = [
    ("leg.motor.max_speed=250", 0.1556, -0.012, 0.2775),
    ("leg.motor.max_torque=0.4", 0.4671, 0.4213, 0.4930),
    ("leg.gear.ratio=400", 0.2535, 0.3571, 0.3657),
    ("leg.motor.max_torque=20", 2.6432, -0.2028, 2.6518),
    ("leg.gear.ratio=20", 0.9046, 0.6212, 0.8623),
    ("start.hip_height=0.735", 0.7526, 0.6960, 0.7217),
]
OF_THE_SECOND = 0.01  # relative error of the second program


@pytest.mark.parametrize(
    ("value", "motion", "solved", "said"),
    [
        (-0.2, 0.7, 0.8, NOTHING),
        (0.807, 0.7, 0.7, NOTHING),
        (0.7, 0.81, 0.8, MAY_EXIST),
        (0.7, None, 0.81, MAY_EXIST),
        (0.81, 0.79, 0.8, GRID_TOO_COARSE),
        (0.81, None, None, GRID_TOO_COARSE),
        (0.7, 0.79, 0.79, GRID_TOO_COARSE),
        (-0.2, None, None, GRID_TOO_COARSE),
    ],
)
def test_three_verdicts(value: float, motion: float | None, solved: float | None, said: str) -> None:
    assert verdict(value, highest(motion, solved), 0.8) == said


def test_a_method_that_leaves_something_out_says_nothing_by_promising_more() -> None:
    """Motions of a supply that never sags are no hops of one that does: those that were solved from them count."""
    sags, stiff = load("paper", {"supply.voltage": 48.0, "supply.internal_resistance": 0.05}), load("paper")
    assert left_out(stiff) is None
    said = verdict(0.9, 0.8, 0.8, left_out(sags))
    assert said is not None
    assert "supply sags" in said
    assert verdict(0.9, 0.81, 0.8, left_out(sags)) == MAY_EXIST
    assert verdict(0.805, 0.8, 0.8, left_out(sags)) == NOTHING
    found = GlobalMethod("grid", (15,) * 4, 0.9, False, solved_m=0.8, motion_m=0.88, left_out=left_out(sags))
    assert followed(found) == 0.8


def test_on_a_slider_the_line_says_that_folding_takes_no_time() -> None:
    """Its promise and its motions leave the flight out, so that neither is evidence of a better hop."""
    slider = load("paper", {"leg.guides": ("z",)})
    said = verdict(0.9, 0.8, 0.8, left_out(slider))
    assert said == "no verdict, for it leaves out how long the leg takes to fold on a vertical slider"
    fed = load("paper", {"leg.guides": ("z",), "supply.voltage": 48.0})
    assert left_out(fed) == "that the supply sags or has caps and how long the leg takes to fold on a vertical slider"


def test_an_answer_below_zero_is_compared_as_well() -> None:
    assert verdict(-0.3, -0.1, -0.1) == NOTHING
    assert verdict(-0.3, -0.05, -0.1) == MAY_EXIST
    assert verdict(-0.3, -0.2, -0.1) == GRID_TOO_COARSE
    assert verdict(None, None, 0.8) is None


@pytest.mark.parametrize(("entry", "answer", "value", "motion"), RECORDED)
def test_numbers_below_a_known_hop_are_no_evidence(entry: str, answer: float, value: float, motion: float) -> None:
    """What was said of these legs without the hops that motions lead to: never that nothing is better for less."""
    said = verdict(value, motion, answer)
    assert (said == NOTHING) <= (max(value, motion) >= (1 - LESS) * answer), entry


@pytest.mark.rarely
@pytest.mark.parametrize(("entry", "answer"), [row[:2] for row in RECORDED])
def test_nothing_better_on_all_these_legs(entry: str, answer: float) -> None:
    s = ho.solve(ho.load("paper", [entry]), processes=1)
    assert s.clearance == pytest.approx(answer, abs=1e-4)
    (line,) = global_line(s.summary)
    assert line.endswith(NOTHING)
    assert s.summary.global_ is not None
    assert s.summary.global_.verdict == NOTHING
    assert f"reaches {highest(s.summary.global_.value_m, followed(s.summary.global_)):.3f} m" in line


@pytest.mark.rarely
def test_values_are_those_of_refined_hops_and_counts_add_up() -> None:
    """Once the line named 0.738 m, of a first mesh, beside an answer of 0.7351 m."""
    changes = ["start.hip_height=0.735", "hop.stance_duration=[0.03,1.0]", "contact.friction=0.4"]
    s = ho.solve(ho.load("paper", changes), processes=1).summary
    assert s.families is not None
    assert s.families[0].refined
    assert s.families[0].clearance_m == s.clearance_m
    assert (
        s.starts.count
        == len(s.starts.each)
        == sum(len(f.found_by) + len(f.stopped) for f in s.families) + len(s.starts.failed)
    )
    assert s.starts.stopped == tuple(e.name for e in s.starts.each if e.status == STOPPED_NEAR_KNOWN)
    for shown, f in zip(starts_lines(s)[1].split("m (")[1:], s.families, strict=False):
        assert shown.startswith("by" if f.refined else "first mesh, by")


@pytest.mark.rarely
def test_two_hops_that_differ_by_more_than_their_errors_are_two() -> None:
    s = ho.solve(ho.load("paper", ["contact.friction=0.15"]), processes=1).summary
    assert s.families is not None
    assert s.starts.apart is not None
    assert [f.objective_value for f in s.families[:2]] == pytest.approx([0.62150, 0.62122], abs=3e-5)
    assert s.starts.apart < s.families[0].objective_value - s.families[1].objective_value


def drawn_legs(count: int, seed: int) -> list[list[str]]:
    """The paper's leg with other sizes, drives, ground and time, some weak, some slow, some high-geared."""
    rng, legs = np.random.default_rng(seed), list[list[str]]()
    for _ in range(count):
        thigh, shank = rng.uniform(0.25, 0.5, 2)
        entries = {
            "leg.thigh.length": thigh, "leg.shank.length": shank, "leg.body.mass": rng.uniform(3, 9),
            "leg.motor.max_torque": np.exp(rng.uniform(*np.log([1.0, 3.0]))),
            "leg.motor.max_speed": np.exp(rng.uniform(*np.log([500, 1500]))),
            "leg.gear.ratio": np.exp(rng.uniform(*np.log([60, 200]))), "leg.hip.lower": -rng.uniform(0.4, 1),
            "start.hip_height": rng.uniform(0.45, 0.9) * (thigh + shank), "hop.foot_window": rng.uniform(0.05, 0.2),
        }  # fmt: skip
        said = [f"{name}={value:.5g}" for name, value in entries.items()]
        said += [f"hop.stance_duration=[0.03,{rng.uniform(0.2, 0.5):.3f}]"]
        legs.append(said + ([f"contact.friction={rng.uniform(0.4, 1):.3f}"] if rng.random() < 0.5 else []))
    return legs


@pytest.mark.rarely
@pytest.mark.parametrize("leg", range(20))
def test_a_second_program_finds_nothing_better(leg: int) -> None:
    """From 24 random starts: not within its own error, nor solved from its motion by hopopt. And there is neither a false
    alarm nor a "nothing better" by less than the answer."""
    design = ho.load("paper", drawn_legs(20, 7)[leg])
    s = ho.solve(design, processes=1)
    assert s.verified
    best = best_hop(Leg.of(design.model_dump(exclude_none=True)), 24, leg)
    assert best is not None
    height, stance = best
    assert height < (1 + OF_THE_SECOND) * s.clearance
    ended = rollout_starts(Hop(design), [Rollout(*stance, height)])
    if ended[0].success:
        assert solve_from(Hop(design), ended, ended, until=NEVER.within(60)).clearance < 1.001 * s.clearance
    said = s.summary.global_
    assert said is not None
    assert said.verdict != MAY_EXIST
    assert said.verdict == GRID_TOO_COARSE or (highest(said.value_m, followed(said)) or 0.0) >= (1 - LESS) * s.clearance
