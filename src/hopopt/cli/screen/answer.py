"""What the command line shows of an answer first: what was reached, what holds it back, and why to believe it.

The whole account is in cli/screen/details.py.
"""

from collections.abc import Iterator, Sequence
from math import ceil, floor, isfinite, log10
from pathlib import Path

from rich.markup import escape

from hopopt.cli.screen.checks import certified_words, structure_lines
from hopopt.cli.screen.console import NamedLines, Shown, marked
from hopopt.cli.screen.motion import hop_lines
from hopopt.cli.screen.runs import OVERSHOOT
from hopopt.cli.screen.search import global_line, measure, measured, starts_lines
from hopopt.design import Body, Design, Leg
from hopopt.drivetrain.gear import lossy
from hopopt.leg.kinematics import reach
from hopopt.ocp.objectives.direction import sign
from hopopt.planner.answer.limit_names import AS_GOOD, INSENSITIVE
from hopopt.planner.answer.summary import Summary
from hopopt.planner.solution import Solution

MOST_LIMITS_NAMED = 4  # limits that are named
LITTLE_LOAD_FREE = 0.005  # share of stance that is no word worth
HARDLY = 0.01  # of the leg's length: a ballistic rise that is no hop


def short(solution: Solution) -> Iterator[Shown]:
    """The answer, short; of one that was late, before it was verified, only that."""
    s = solution.shown
    if s.late and not s.verified:
        return headed(s, results=_results(s))
    return headed(
        s,
        in_short=in_short(s, solution.design),
        hop=hop_lines(s, solution.design),
        control=control_lines(s),
        limits=_limits(s),
        structure=structure_lines(s) if s.structure.solved_again is not None else [],
        evidence=[checks_line(s), error_line(s), *starts_lines(s, certified_words(s)), *global_line(s)],
        notes=notes(s),
        results=_results(s),
    )


def headed(s: Summary, **parts: Sequence[str]) -> Iterator[Shown]:
    """Title and headline, and below them each part's lines under its name."""
    changed = " and ".join(s.overrides or ())
    which = f"{s.problem}{f' with {changed}' if changed else ''}, objective {s.objective}"
    which += f", limited by {' and '.join(limits)} too" if (limits := s.own_limits) else ""
    yield marked(f"[bold]{escape(s.title or s.problem)}[/bold]  ({escape(which)})")
    yield marked(_headline(s))
    yield from (NamedLines(name.replace("_", " "), lines) for name, lines in parts.items())


def _headline(s: Summary) -> str:
    if s.late and not s.verified:
        return (
            f"[bold red]Solved, but NOT verified[/bold red]: the time limit of {s.time_limit_s:g} s was reached; a larger one "
            "(--time-limit) may lead to an answer. The attempt is kept for inspection."
        )
    if not s.verified:
        return (
            "[bold red]Solved, but NOT verified[/bold red]: no answer is stated. "
            f"Failed: {', '.join(s.failed_checks)}. Refinement ended as {s.refinement_ended}. "
            "The attempt is kept for inspection."
        )
    reported = f"[bold green]{reached(s)}[/bold green], verified"
    if s.objective != "clearance":
        reported += f"; clearance then {s.clearance_m:.4f} m"
    reported += (
        "" if s.searched is not False else ", [bold]not searched[/bold]: one start, and other hops may be higher"
    )
    return reported + (
        ", on ground where the foot cannot slip" if s.friction is None else f", with friction {s.friction:g}"
    )


def reached(s: Summary) -> str:
    """What the hop was made for, and what came of it."""
    name = "body apex" if s.objective == "apex" else s.objective.replace("_", " ")
    value = measured(s, s.reached, 4)
    asked = s.clearance_asked_for_m
    return f"{name} {value}" if asked is None else f"least {name} {value} to clear {asked:g} m"


def in_short(s: Summary, design: Design) -> list[str]:
    """What the hop is worth in lengths of the leg; what its motion needs of the ground, which another may not; and what it
    leans on: what it would lose by less of it."""
    found, lengths = s.leans_on, s.clearance_m / reach(design.leg)
    if not s.verified:
        return []
    grip = f"friction of at least {found.friction_needed:.2f}"
    if not isfinite(found.friction_needed):
        grip = "ground that holds the foot sideways without load, which no friction does"
    free = f"{found.load_free_share:.0%} of stance without load on the foot"
    rise, little = s.parts.ballistic_rise_m, HARDLY * reach(design.leg)
    grounded = [f"the leg does not leave the ground in any useful sense (ballistic rise {rise:.4f} m): it is drawn up"]
    if rise < -little:
        grounded = [f"too weak to hop: the body only falls (ballistic rise {rise:.4f} m) while the leg is drawn up"]
    needs = [grip, *([free] if found.load_free_share > LITTLE_LOAD_FREE else [])]
    cleared = f"the {s.lowest_point} clears {lengths:.2f} leg lengths; this motion needs {'; '.join(needs)}"
    costs = {
        name: s.gains[name]
        for name in ("longest stance", "friction cone")
        if s.gains.get(name, 0.0) > s.objective_error.either_way
    }
    lean = ", ".join(f"the {name} (1 % less of it costs {loss(s, cost)})" for name, cost in costs.items())
    asked = s.result_dir and bound_line(0.0, s.objective)  # heights alone
    more = [f"what the best motion without these loses: hopopt diagnose {s.result_dir} --worth"] if asked else []
    return [
        *carried(design.leg.body),
        *(grounded if rise < little else []),
        cleared,
        *([f"it rests on {rests}"] if (rests := assumed(design.leg)) else []),
        *([f"it leans on {lean}"] if lean else []),
        *more,
    ]


def carried(body: Body) -> list[str]:
    """Of a leg whose problem tells it: how many share the body."""
    if body.legs is None:
        return []
    if body.legs == 1:
        return [
            f"one leg carries the whole robot, a body of {body.mass:.4g} kg: leg.body.legs = 4 would share it among four"
        ]
    return [
        f"one of {body.legs:g} legs that push together and mirror each other: each carries {body.mass:.4g} kg of the body"
    ]


def notes(s: Summary) -> list[str]:
    """The notes; all to which the objective is insensitive in one line."""
    alike = [words for words in s.notes if words.startswith(INSENSITIVE)]
    others = [words for words in s.notes if words not in alike]
    of_each = [words.removeprefix(INSENSITIVE).removesuffix(AS_GOOD) for words in alike]
    return [*others, *([f"{INSENSITIVE}{', nor on '.join(of_each)}{AS_GOOD}"] if alike else [])]


def assumed(leg: Leg) -> str:
    """What a plan takes to be better than any robot has it."""
    bare = [name for name in leg.joints if not (leg.linear(name) or leg.drive(name, "motor", "rotor_inertia")[1])]
    ideal = [name for name in leg.joints if not lossy(leg, name)]
    things = []
    if ideal:
        things.append(
            "gears without losses" + ("" if len(ideal) == len(leg.joints) else f" at the {' and '.join(ideal)}")
        )
    if leg.supply is None:
        things.append("a supply that never sags")
    if bare:
        things.append(f"no rotor inertia at the {' and '.join(bare)}, which a motor has")
    return ", and on ".join(things)


def loss(s: Summary, amount: float) -> str:
    """What is lost of the objective: lengths in cm."""
    return f"{100 * amount:.2g} cm" if s.objective_unit == "m" else measure(s, amount, ".2g")


def control_lines(s: Summary) -> list[str]:
    """What controllers reach: the paper's on this leg, and others on a share of drawn legs."""
    return [*_paper_lines(s), *_had_lines(s)]


def _had_lines(s: Summary) -> list[str]:
    if (found := s.can_be_had) is None:
        return []
    ways = [f"{way.clearance_m:.3f} m with {way.strategy}" for way in (found.tracked, found.pd) if way]
    line = (
        f"what can be had: {found.share:.0%} of all legs within [uncertainty] reach {' and '.join(ways)} "
        f"(simulated, {found.draws} draws, each with confidence {found.confidence:.0%})"
    )
    if found.ideal_bound_m:
        line += f"; on ground that grips without limit the bound is {found.ideal_bound_m:.3f} m"
    if found.tracked and found.pd and found.tracked.clearance_m < found.pd.clearance_m:
        return [line, "the plan's [reserve] is too small for such legs: hopopt robust finds a better one"]
    return [line]


def _paper_lines(s: Summary) -> list[str]:
    if (found := s.paper_strategy) is None:
        return []
    if found.fault:
        reached = f"no hop within this leg's limits ({found.fault})"
    else:
        over = found.overshoot_m or 0.0
        counts = over > OVERSHOOT * (found.clearance_m or 0.0)
        fold = f", {100 * over:.1f} cm of it by a servo that overshoots its reference" if counts else ""
        reached = f"{found.clearance_m:.3f} m, {found.share_of_bound:.0%} of the optimum{fold}"
    wrong = ["it passes the optimum within every limit: that is not the highest hop"] if found.beyond_bound else []
    return [
        f"the paper's PD control (force control, clamped to the drives) in simulation: {reached}",
        *wrong,
        f"hopopt compare --bound {s.result_dir} has other controllers and tunes gains",
    ]


def gains(s: Summary) -> dict[str, str]:
    """What 1 % more of a limit's range would give, the greatest gain first."""
    return {name: _gain(s, gain) for name, gain in list(s.gains.items())[:MOST_LIMITS_NAMED]}


def _limits(s: Summary) -> list[str]:
    if not (found := gains(s)):
        return ["none whose range would give more"]
    (most, gain), *others = found.items()
    rest = "; then " + ", ".join(map(" ".join, others)) if others else ""
    return [f"limiting constraint: {most}; 1 % more of its range would give {gain}{rest}"]


def _results(s: Summary) -> list[str]:
    where = s.result_dir or ""
    drawn = "figures inside, " if (Path(where) / "figures").is_dir() else ""
    return [
        f"{where}   ({drawn}{s.wall_s:.1f} s)",
        f"hopopt show {where} shows limits, switching structure, all evidence",
    ]


def _gain(s: Summary, gain: float) -> str:
    if s.objective_unit == "m":
        return f"+{1000 * gain:.1f} mm"
    return measure(s, sign(s.maximized) * gain, "+.2g")


def checks_line(s: Summary) -> str:
    """How many checks passed, and the two that matter most."""
    replay = max(s.check(f"{phase} replay").residual for phase in s.phases)
    made, checks = [c.passed for c in s.verification if not c.left_out], s.verification
    left_out = f", {len(checks) - len(made)} left out" if len(made) < len(checks) else ""
    return (
        f"{sum(made)} of {len(made)} checks passed{left_out}; replay in Pinocchio within "
        f"{replay:.0e}, limits between nodes within {s.mesh[-1].excess:.0e} of their range"
    )


def error_line(s: Summary) -> str:
    """How far the claim may be too high; and from below, in brackets, what a simulation in one piece with clamped torques
    reaches, or why it says nothing."""
    if not isfinite((e := s.objective_error).too_high_by):
        return "its error could not be computed"
    most = measure(s, upwards(e.too_high_by), ".0e")
    side = "above" if sign(s.maximized) > 0 else "below"
    claim = f"{measure(s, s.reached, '.6g')}, by estimate at most {most} {side} the optimum{_gentle(s)}"
    if note := e.simulated.note:
        return f"{claim} ({note})"
    simulated = getattr(e.simulated, s.objective_figure)
    if simulated is None:
        return claim
    return f"{claim} (simulated in one piece, torques clamped: {measure(s, simulated, '.6g')})"


def _gentle(s: Summary) -> str:
    """What the preference of gentle torques may have cost, where that is more than a thousandth."""
    if s.tie_break_weighs <= 1e-3 * abs(s.objective_value):
        return ""
    side = "below" if sign(s.maximized) > 0 else "above"
    whole = s.maximized or s.functions.objective is not None  # else nothing is less than 0
    most = s.tie_break_weighs if whole else min(s.tie_break_weighs, s.reached)
    return f" and, as gentle torques are preferred, at most {measure(s, upwards(most), '.0e')} {side} it"


def bound_line(bound: float, objective: str) -> list[str]:
    """What nothing can pass [m], of heights."""
    if not isfinite(bound) or objective not in ("clearance", "apex"):
        return []
    return [
        f"no hop that keeps the drives' limits and the longest stance can pass {bound:.2f} m: a crude bound, by speed and "
        "power alone (docs/bound.md)"
    ]


def upwards(value: float) -> float:
    """To one digit, never down."""
    if value <= 0 or not isfinite(value):
        return value
    unit = 10.0 ** floor(log10(value))
    return ceil(value / unit) * unit
