"""What is tried again: in its order, where it may help, and what of it is taken."""

import pytest

from hopopt.nlp.deadline import NEVER, Deadline
from hopopt.nlp.refinement.mesh_refinement import MET, UNSOLVED
from hopopt.ocp.hop import Hop
from hopopt.planner.attempts import (
    CALMED,
    CALMER,
    CLOSER_AIM,
    CLOSER_AIM_FURTHER,
    CODESIGN,
    FURTHER,
    HOP,
    POINT,
    PRICE_TOLERANCE,
    REFINEMENT,
    RESOLVED,
    RESTARTED,
    SEVERAL_HOPS,
    TOLERANCE,
    WORK,
    Attempt,
    AttemptOutcome,
    tried_again,
    with_tighter_tolerances,
)
from hopopt.problem.load import changed, load

SOUND, OPEN = AttemptOutcome(True, True, MET, 0.5), AttemptOutcome(True, False, MET, 0.5)  # certified, and not
FAILED, STOPPED = AttemptOutcome(False, False, MET, 0.5), AttemptOutcome(False, False, UNSOLVED, 0.5)


def walked(
    found: AttemptOutcome,
    attempts: tuple[Attempt, ...],
    led_to: dict[str, AttemptOutcome | None],
    until: Deadline = NEVER,
) -> tuple[Hop, AttemptOutcome, list[str]]:
    """Where attempts lead, from what each of them (by its sentence) comes to, and what was said."""
    said, problems = list[str](), list[Hop]()

    def run(attempt: Attempt, other: Hop) -> AttemptOutcome | None:
        problems.append(other)
        return led_to[attempt.said]

    hop, best = tried_again(Hop(load("paper")), found, attempts, run, lambda trial: trial, said.append, until)
    assert len(problems) == len(said)
    return hop, best, said


@pytest.mark.parametrize(
    ("found", "attempts", "again"),
    [
        (SOUND, REFINEMENT, []),
        (OPEN, REFINEMENT, [RESOLVED, FURTHER]),
        (FAILED, REFINEMENT, [CLOSER_AIM_FURTHER, CLOSER_AIM]),
        (STOPPED, REFINEMENT, []),
        (OPEN, HOP, []),
        (FAILED, HOP, [CALMED]),
        (STOPPED, HOP, [CALMED, RESTARTED]),
        (STOPPED, POINT, [CALMED, RESTARTED]),
        (FAILED, CODESIGN, [CALMED, RESTARTED]),
        (OPEN, SEVERAL_HOPS, [SEVERAL_HOPS[0]]),
        (FAILED, SEVERAL_HOPS, [SEVERAL_HOPS[0]]),
    ],
)
def test_what_may_help_is_tried_in_its_order(
    found: AttemptOutcome, attempts: tuple[Attempt, ...], again: list[Attempt]
) -> None:
    nothing: dict[str, AttemptOutcome | None] = {attempt.said: None for attempt in attempts}
    hop, best, said = walked(found, attempts, nothing)
    assert best is found
    assert hop.design == load("paper")
    assert said == [attempt.said.format(tie_break=CALMER * hop.design.solver.tie_break) for attempt in again]
    assert walked(found, attempts, nothing, NEVER.within(0.0))[2] == []


@pytest.mark.parametrize(
    ("found", "attempts", "again", "taken"),
    [
        (OPEN, REFINEMENT, SOUND, True),
        (OPEN, REFINEMENT, OPEN, False),  # no better
        (OPEN, REFINEMENT, FAILED, False),
        (FAILED, REFINEMENT, OPEN, True),
        (FAILED, REFINEMENT, FAILED, False),
        (FAILED, HOP, AttemptOutcome(True, False, MET, 0.509), True),
        (FAILED, HOP, AttemptOutcome(True, True, MET, 0.52), False),  # another optimum
        (FAILED, WORK, AttemptOutcome(True, True, MET, 0.58), True),  # what is not verified was far too low
        (FAILED, POINT, AttemptOutcome(True, True, MET, 0.501), True),
        (FAILED, POINT, AttemptOutcome(True, True, MET, 0.509), False),
        (FAILED, CODESIGN, AttemptOutcome(True, True, MET, 0.6), True),
        (FAILED, SEVERAL_HOPS, OPEN, True),
        (OPEN, SEVERAL_HOPS, OPEN, False),
    ],
)
def test_what_is_better_is_taken(
    found: AttemptOutcome, attempts: tuple[Attempt, ...], again: AttemptOutcome, taken: bool
) -> None:
    only = tuple(attempt for attempt in attempts if not attempt.anyhow)
    _, best, said = walked(found, only, {attempt.said: again for attempt in only})
    helpful = [attempt for attempt in only if attempt.may_help(found)]
    assert len(said) == (1 if taken else len(helpful))  # the first that is better ends it
    assert best is (again if taken else found)


def test_restarts_are_the_last_word() -> None:
    """They take what comes of them, with the problem as it was asked."""
    hop, best, said = walked(STOPPED, HOP, {CALMED.said: STOPPED, RESTARTED.said: FAILED})
    assert len(said) == 2
    assert best is FAILED
    assert hop.design == load("paper")


def test_a_calmed_hop_comes_with_its_problem() -> None:
    calm = AttemptOutcome(True, True, MET, 0.5)
    hop, best, _ = walked(STOPPED, HOP, {CALMED.said: calm})
    assert best is calm
    assert hop.design.solver.tie_break == CALMER * load("paper").solver.tie_break


def test_defaults_become_smaller_and_nothing_else_changes() -> None:
    design = load("paper")
    fine = with_tighter_tolerances(design)
    assert (fine.solver.tolerance, fine.solver.price_tolerance) == (TOLERANCE, PRICE_TOLERANCE)
    assert fine.solver.tolerance < design.solver.tolerance
    assert fine.solver.price_tolerance < design.solver.price_tolerance
    again = {"solver.tolerance": design.solver.tolerance, "solver.price_tolerance": design.solver.price_tolerance}
    assert changed(fine, again) == design
    assert with_tighter_tolerances(fine) == fine


@pytest.mark.parametrize("entry", ["tolerance", "price_tolerance"])
def test_what_is_smaller_stays(entry: str) -> None:
    design = load("paper", {f"solver.{entry}": 3e-7})
    assert getattr(with_tighter_tolerances(design).solver, entry) == 3e-7
