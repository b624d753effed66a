"""What the command line shows of an answer first: what was reached, what holds it back, and why to believe it.

The whole account is in cli/screen/details.py.
"""

from collections.abc import Mapping, Sequence
from math import ceil, floor, isfinite, log10
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.markup import escape

from hopopt.cli.screen.certificate import certified_words, structure_lines
from hopopt.cli.screen.console import console, print_lines
from hopopt.ocp.direction import sign
from hopopt.planner.solution import at_apex

if TYPE_CHECKING:
    from hopopt.planner.solution import Solution

MOST = 4  # limits that are named


def print_answer(solution: "Solution") -> None:
    """The answer, short."""
    s = solution.summary
    print_parts(
        s,
        hop=hop_lines(s),
        control=control_lines(s),
        limits=_limits(s),
        structure=structure_lines(s) if "solved_again" in s.get("structure", {}) else [],
        evidence=_evidence(s),
        notes=list(s.get("notes", ())),
        results=_results(s),
    )


def print_parts(s: dict[str, Any], **parts: Sequence[str]) -> None:
    """Title and headline, and below them each part's lines under its name."""
    head, out, changed = _headline(s), console(), " and ".join(s.get("overrides", ()))
    which = f"{s['problem']}{f' with {changed}' if changed else ''}, objective {s['objective']}"
    out.print(f"[bold]{escape(s['title'] or s['problem'])}[/bold]  ({escape(which)})", markup=True)
    out.print(head, markup=True)
    for name, lines in parts.items():
        print_lines(out, name, lines)


def _headline(s: dict[str, Any]) -> str:
    if not s["verified"]:
        return (
            "[bold red]Solved, but NOT verified[/bold red]: no answer is stated. "
            f"Failed: {', '.join(s['failed_checks'])}. Refinement ended as {s['refinement_ended']}. "
            "The attempt is kept for inspection."
        )
    told = f"[bold green]clearance {s['clearance_m']:.4f} m[/bold green], verified"
    if s["objective"] != "clearance":
        told = f"[bold green]{_stated(s)}[/bold green], verified; clearance then {s['clearance_m']:.4f} m"
    return told + (
        ", on ground where the foot cannot slip" if s["friction"] is None else f", with friction {s['friction']:g}"
    )


def _stated(s: dict[str, Any]) -> str:
    """What the hop was made for, and what came of it."""
    name = "body apex" if s["objective"] == "apex" else s["objective"].replace("_", " ")
    value = measure(s, s[s["objective_figure"]], ".4f")
    asked = s.get("clearance_asked_for_m")
    return f"{name} {value}" if asked is None else f"least {name} {value} to clear {asked:g} m"


def hop_lines(s: dict[str, Any]) -> list[str]:
    """Where the clearance comes from; durations, speeds at lift-off and the greatest ground force."""
    p, stance, flight, lift = s["parts"], s["phases"]["stance"], s["phases"]["flight"], s["lift_off"]
    lands = f", descent {s['phases']['descent']['duration_s']:.3f} s" if "descent" in s["phases"] else ""
    end, flown = s.get("vertical_at_end_of_flight_m_s", 0.0), f"{flight['duration_s']:.3f} s"  # 0: an earlier version's
    way = "rising" if end > 0 else "falling"
    flown = f"to the apex {flown}" if at_apex(end) else f"{flown} (then {way} at {abs(end):.2f} m/s)"
    parts = (
        f"clearance = COM height at lift-off {p['com_height_at_lift_off_m']:.4f} + ballistic rise "
        f"{p['ballistic_rise_m']:.4f} - COM height over the {s['lowest_point']} {-p['com_height_over_lowest_point_m']:.4f} m"
    )
    return [
        *([parts] if s["verified"] else []),
        f"stance {stance['duration_s']:.3f} s, flight {flown}{lands}, lift-off at "
        f"{lift['vertical_m_s']:.2f} m/s up and {lift['horizontal_m_s']:+.2f} m/s along, peak ground force "
        f"{s['peak_ground_force_N']:.0f} N",
    ]


def control_lines(s: dict[str, Any]) -> list[str]:
    """What the paper's PD strategy reaches."""
    if (found := s.get("paper_strategy")) is None:
        return []
    if found["fault"]:
        reached = f"no hop within this leg's limits ({found['fault']})"
    else:
        reached = f"{found['clearance_m']:.3f} m, {found['share_of_bound']:.0%} of the optimum"
    wrong = ["it passes the optimum within every limit: that is not the highest hop"] if found["beyond_bound"] else []
    return [
        f"the paper's PD control (force control, clamped to the drives) in simulation: {reached}",
        *wrong,
        f"hopopt compare --bound {s['result_dir']} has other controllers and tunes gains",
    ]


def gains(s: dict[str, Any]) -> dict[str, str]:
    """What 1 % more of a limit's range would give, the greatest gain first."""
    found = s["gain_per_percent_m"] if "gain_per_percent_m" in s else s["gain_per_percent"]
    return {name: _gain(s, gain) for name, gain in list(found.items())[:MOST]}


def _limits(s: dict[str, Any]) -> list[str]:
    if not (found := gains(s)):
        return ["none whose range would give more"]
    (most, gain), *others = found.items()
    rest = "; then " + ", ".join(map(" ".join, others)) if others else ""
    return [f"{most} holds the hop back most: 1 % more of its range would give {gain}{rest}"]


def _evidence(s: dict[str, Any]) -> list[str]:
    return [
        checks_line(s),
        f"{error_line(s)}{simulated_words(s)}",
        f"{starts_line(s)}{certified_words(s)}",
        *bound_line(s),
    ]


def _results(s: dict[str, Any]) -> list[str]:
    where = s["result_dir"]
    drawn = "figures inside, " if (Path(where) / "figures").is_dir() else ""
    return [
        f"{where}   ({drawn}{s['wall_s']:.1f} s)",
        f"hopopt show {where} tells limits, switching structure, all evidence",
    ]


def _gain(s: dict[str, Any], gain: float) -> str:
    if s["objective_unit"] == "m":
        return f"+{1000 * gain:.1f} mm"
    return measure(s, sign(s["maximized"]) * gain, "+.2g")


def measure(s: dict[str, Any], value: float, form: str) -> str:
    """A value of the objective with its unit."""
    return f"{value:{form}} {s['objective_unit'].replace('1', '')}".strip()


def checks_line(s: dict[str, Any]) -> str:
    """How many checks passed, and the two that matter most."""
    checks = {c["name"]: c for c in s["verification"]}
    replay = max(checks[f"{phase} replay"]["residual"] for phase in s["phases"])
    made = [c["passed"] for c in checks.values() if not c.get("left_out")]  # results of earlier versions do not hold it
    left_out = f", {len(checks) - len(made)} left out" if len(made) < len(checks) else ""
    return (
        f"{sum(made)} of {len(made)} checks passed{left_out}; replay in Pinocchio within "
        f"{replay:.0e}, limits between nodes within {s['mesh'][-1]['excess']:.0e} of their range"
    )


def starts_line(s: dict[str, Any]) -> str:
    """Where the starts ended on the first mesh."""
    starts = s["starts"]
    ends = ", ".join(f"{o['count']} at {measure(s, o['objective'], '.3f')}" for o in starts["optima"])
    gentle = (
        ", what prefers gentle torques counted in" if s["tie_break_weighs"] > 1e-3 * abs(s["objective_value"]) else ""
    )
    failed = f", {len(starts['failed'])} failed" if starts["failed"] else ""
    return f"{starts_in_words([each['name'] for each in starts['each']])} on the first mesh: {ends}{gentle}{failed}"


def starts_in_words(names: Sequence[str]) -> str:
    """How many there were; the highest hop, from which economical objectives begin as well, is named apart."""
    from hopopt.planner.required_clearance import HIGHEST

    own = len(names) - (HIGHEST in names)
    return f"{own} start{'' if own == 1 else 's'}{f' and {HIGHEST}' if HIGHEST in names else ''}"


def error_line(s: dict[str, Any]) -> str:
    """How far the claim may be too high."""
    if (e := s.get("objective_error")) is None or e["too_high_by"] is None:  # None: a result of an earlier version
        return "its error could not be told"
    most = measure(s, upwards(e["too_high_by"]), ".0e")
    side = "above" if sign(s["maximized"]) > 0 else "below"
    return f"{measure(s, s[s['objective_figure']], '.6g')}, by estimate at most {most} {side} the optimum"


def simulated_words(s: dict[str, Any]) -> str:
    """The claim from below, in brackets: what a simulation in one piece with clamped torques reaches, or why it says nothing."""
    if (e := s.get("objective_error")) is None or e["too_high_by"] is None:
        return ""
    if note := e["simulated"].get("note"):
        return f" ({note})"
    reached = e["simulated"].get(s["objective_figure"])
    return "" if reached is None else f" (simulated in one piece, torques clamped: {measure(s, reached, '.6g')})"


def bound_line(s: Mapping[str, Any]) -> list[str]:
    """What nothing can pass, of heights."""
    bound = s.get("upper_bound", {}).get("clearance_m")
    if bound is None or s["objective"] not in ("clearance", "apex"):
        return []
    return [
        f"no controller can pass {bound:.2f} m: a crude bound, by the drives' speed and their power in the longest "
        "stance alone (docs/bound.md)"
    ]


def upwards(value: float) -> float:
    """To one digit, never down."""
    if value <= 0 or not isfinite(value):
        return value
    unit = 10.0 ** floor(log10(value))
    return ceil(value / unit) * unit
