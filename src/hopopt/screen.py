"""What the command line shows a person: answer, tables, progress."""

import sys
import textwrap
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from math import ceil, floor, isfinite, log10
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.table import Table

if TYPE_CHECKING:
    from hopopt.problem_file import Row
    from hopopt.solution import Solution
    from hopopt.verify import Check


def console() -> Console:
    """Standard output; wide enough for whole lines when piped."""
    return Console(highlight=False, soft_wrap=True)


def wide_console() -> Console:
    """Standard output for tables: as wide as the screen, and wide enough for whole lines when piped."""
    return Console(highlight=False, markup=False, width=None if sys.stdout.isatty() else 180)


@contextmanager
def progress(quiet: bool) -> Iterator[Callable[[str], None]]:
    """A function that shows one line of progress on standard error; silent when piped or ``quiet``."""
    if quiet or not sys.stderr.isatty():
        yield lambda text: None
        return
    screen = Console(stderr=True, highlight=False)
    with screen.status("starting") as status:
        yield lambda text: status.update(textwrap.shorten(text, max(screen.width - 4, 20), placeholder=" …"))


def print_answer(solution: "Solution") -> None:
    """The answer, short: what was reached, how it comes about, what holds it back, and why to believe it."""
    from hopopt.screen_certificate import certificate_line, structure_lines

    s, out = solution.summary, console()
    out.print(f"[bold]{s['title'] or s['problem']}[/bold]  ({s['problem']}, objective {s['objective']})", markup=True)
    out.print(_headline(s), markup=True)
    for name, lines in (
        ("hop", _hop(s)),
        ("effort", _effort(s)),
        ("limits", _limits(s)),
        ("control", _control(s)),
        ("structure", structure_lines(s)),
        ("evidence", _evidence(s) + certificate_line(s)),
        ("notes", list(s.get("notes", ()))),
        ("results", [f"{s['result_dir']}   ({s['wall_s']:.1f} s)"]),
    ):
        print_lines(out, name, lines)


def print_lines(out: Console, name: str, lines: Sequence[str]) -> None:
    """Lines under one name; broken on a screen, where each goes on below its own beginning, but not when piped."""
    for k, line in enumerate(lines):
        head = f"  {name if k == 0 else '':9s} "
        if out.is_terminal:
            below = " " * (len(head) + 2)
            head = textwrap.fill(
                line, max(out.width, 40), initial_indent=head, subsequent_indent=below,
                break_long_words=False, break_on_hyphens=False,
            )  # fmt: skip
            line = ""
        out.print(f"{head}{line}", markup=False)


def _headline(s: dict[str, Any]) -> str:
    if not s["verified"]:
        return (
            "[bold red]Solved, but NOT verified[/bold red]: no answer is stated. "
            f"Failed: {', '.join(s['failed_checks'])}. Refinement ended as {s['refinement_ended']}. "
            "The attempt is kept for inspection."
        )
    p = s["parts"]
    lines = f"[bold green]clearance {s['clearance_m']:.4f} m[/bold green], verified"
    if s["objective"] != "clearance":
        lines = f"[bold green]{_stated(s)}[/bold green], verified; clearance then {s['clearance_m']:.4f} m"
    lines += ", on ground where the foot cannot slip" if s["friction"] is None else f", with friction {s['friction']:g}"
    return (
        f"{lines}\n  = COM height at lift-off {p['com_height_at_lift_off_m']:.4f} + ballistic rise {p['ballistic_rise_m']:.4f} "
        f"- COM height over the {s['lowest_point']} {-p['com_height_over_lowest_point_m']:.4f} m"
    )


def _stated(s: dict[str, Any]) -> str:
    """What the hop was made for, and what came of it."""
    name = "body apex" if s["objective"] == "apex" else s["objective"].replace("_", " ")
    value = _measure(s, s[s["objective_figure"]], ".4f")
    asked = s.get("clearance_asked_for_m")
    return f"{name} {value}" if asked is None else f"least {name} {value} to clear {asked:g} m"


def _hop(s: dict[str, Any]) -> list[str]:
    stance, flight, lift = s["phases"]["stance"], s["phases"]["flight"], s["lift_off"]
    lands = f", descent {s['phases']['descent']['duration_s']:.3f} s" if "descent" in s["phases"] else ""
    return [
        f"stance {stance['duration_s']:.3f} s, flight to the apex {flight['duration_s']:.3f} s{lands}, lift-off at "
        f"{lift['vertical_m_s']:.2f} m/s up and {lift['horizontal_m_s']:+.2f} m/s along, peak ground force "
        f"{s['peak_ground_force_N']:.0f} N ({s['peak_vertical_force_N']:.0f} N vertical)",
        _ground(s),
    ]


def _ground(s: dict[str, Any]) -> str:
    if s["friction"] is not None:
        return "the friction cone is held"
    grip = s["grip_without_load_N"]
    if grip < 0.5:
        return "the foot is pinned, but never held along the ground without load"
    return f"the foot is pinned: without load it is held along the ground by up to {grip:.0f} N (contact.friction limits that)"


def _effort(s: dict[str, Any]) -> list[str]:
    means = ", ".join(f"{joint} {mean:.0%}" for joint, mean in s["saturation_mean"].items())
    e = s["energy"]
    return [
        f"mean saturation in stance: {means}; work in stance {e['stance_positive_J']:.0f} J in, {e['stance_net_J']:.0f} J net"
    ]


def _limits(s: dict[str, Any]) -> list[str]:
    active = ", ".join(f"{name} {share:.0%}" for name, share in list(s["active_limits"].items())[:5]) or "none"
    found = s["gain_per_percent_m"] if "gain_per_percent_m" in s else s["gain_per_percent"]
    gains = ", ".join(f"{name} {_gain(s, gain)}" for name, gain in list(found.items())[:4]) or "none"
    return [
        f"active in stance: {active}",
        f"1 % more of its range would give: {gains}",
        *idle_line(s.get("idle_limits", {})),
    ]


def _control(s: dict[str, Any]) -> list[str]:
    """What the paper's PD strategy reaches."""
    if (found := s.get("paper_strategy")) is None:
        return []
    if found["fault"]:
        reached = f"no hop within this leg's limits ({found['fault']})"
    else:
        reached = f"{found['clearance_m']:.3f} m, {found['share_of_bound']:.0%} of the optimum"
    wrong = ["it passes the optimum within every limit: that is not the highest hop"] if found["beyond_bound"] else []
    return [
        f"the paper's force control (PD clamped to the drives, gains for the paper's leg) in simulation: {reached}; hopopt "
        f"compare --bound {s['result_dir']} has other strategies and tunes gains",
        *wrong,
    ]


def idle_line(found: dict[str, dict[str, Any]], most: int = 4) -> list[str]:
    """The least used limits in one line; none if every limit acts."""
    named = [f"{name} ({use['used']:.0%} used)" for name, use in list(found.items())[:most]]
    rest = f" and {len(found) - most} more (hopopt diagnose names them)" if len(found) > most else ""
    return [f"never act: {', '.join(named)}{rest}"] if named else []


def _gain(s: dict[str, Any], gain: float) -> str:
    if s["objective_unit"] == "m":
        return f"+{1000 * gain:.1f} mm"
    return _measure(s, gain if s["maximized"] else -gain, "+.2g")


def _measure(s: dict[str, Any], value: float, form: str) -> str:
    """A value of the objective with its unit."""
    return f"{value:{form}} {s['objective_unit'].replace('1', '')}".strip()


def _evidence(s: dict[str, Any]) -> list[str]:
    starts, mesh, checks = s["starts"], s["mesh"][-1], {c["name"]: c for c in s["verification"]}
    ends = ", ".join(f"{o['count']} at {_measure(s, o['objective'], '.3f')}" for o in starts["optima"])
    failed = f", {len(starts['failed'])} failed" if starts["failed"] else ""
    sizes = " + ".join(str(n) for n in mesh["intervals"].values())
    replay = max(checks[f"{phase} replay"]["residual"] for phase in s["phases"])
    change = checks["change of the objective"]["residual"]
    settled = f"objective settled to {change:.0e}" if change < float("inf") else "no second mesh to compare with"
    bias = f"tie-break bias below {_measure(s, s['tie_break_bias_m' if s['objective_unit'] == 'm' else 'tie_break_bias'], '.0e')}"
    if s["tie_break_weighs"] > 1e-3 * abs(s["objective_value"]):
        bias = f"flat: gentle torques are preferred, which weighs {_measure(s, s['tie_break_weighs'], '.2g')}"
    lines = [
        *(_error(s) if s["verified"] else []),
        f"{starts_in_words([each['name'] for each in starts['each']])} on the first mesh: {ends}{failed}",
        f"{len(s['mesh'])} mesh{'es' if len(s['mesh']) > 1 else ''}, last {sizes} intervals ({s['scheme']}); {settled}, "
        f"{bias}",
        f"{sum(c['passed'] for c in checks.values())} of {len(checks)} checks passed; replay in Pinocchio within {replay:.0e}, "
        f"limits between nodes within {mesh['excess']:.0e} of their range",
    ]
    bound = s.get("upper_bound", {}).get("clearance_m")
    if bound is not None and s["objective"] in ("clearance", "apex"):
        lines.append(
            f"no controller can pass {bound:.2f} m: a crude bound, by the drives' speed and their power in the longest "
            "stance alone (docs/bound.md)"
        )
    return lines + [f"FAILED {_check_line(c)}" for c in s["verification"] if not c["passed"]]


def starts_in_words(names: Sequence[str]) -> str:
    """How many there were; the highest hop, from which economical objectives begin as well, is named apart."""
    from hopopt.highest import HIGHEST

    own = len(names) - (HIGHEST in names)
    return f"{own} start{'' if own == 1 else 's'}{f' and {HIGHEST}' if HIGHEST in names else ''}"


def _error(s: dict[str, Any]) -> list[str]:
    """How far the claim may be off, either way."""
    if (e := s.get("objective_error")) is None:  # a result of an earlier version
        return []
    figure, side = s["objective_figure"], "above" if s["maximized"] else "below"
    if e["too_high_by"] is None:
        return ["its error could not be told"]
    most = _measure(s, _upwards(e["too_high_by"]), ".0e")
    told = f"{_measure(s, s[figure], '.6g')}, by estimate at most {most} {side} the optimum"
    if note := e["simulated"].get("note"):
        told += f" ({note})"
    elif figure in e["simulated"]:
        told += f" (simulated in one piece, torques clamped: {_measure(s, e['simulated'][figure], '.6g')})"
    if "relaxed" in e:
        told += f"; limits held between the nodes cost {_measure(s, e['relaxed']['gains'], '.0e')}"
    if e["could_be_beaten_by"] is not None:
        told += f"; to first order hops beside it gain at most {_measure(s, _upwards(e['could_be_beaten_by']), '.0e')}"
    return [told]


def _upwards(value: float) -> float:
    """To one digit, never down."""
    if value <= 0 or not isfinite(value):
        return value
    unit = 10.0 ** floor(log10(value))
    return ceil(value / unit) * unit


def _check_line(c: dict[str, Any]) -> str:
    where = f", {c['where']}" if c["where"] else ""
    return f"{c['name']}: {c['residual']:.1e} {c['unit']} (allowed {c['tolerance']:.0e}){where}"


def print_rows(title: str, rows: "Sequence[Row]") -> None:
    """Every entry of a problem with value, unit and meaning."""
    table = Table(title=title, title_justify="left", box=None, pad_edge=False)
    for column, style in (("entry", "bold"), ("value", ""), ("unit", "dim"), ("meaning", "")):
        table.add_column(column, style=style, overflow="fold")
    for row in rows:
        value = "not set" if row.value is None else _plain(row.value)
        table.add_row(row.path, value, row.unit, row.meaning)
    out = wide_console()
    out.print(table)


def _plain(value: Any) -> str:
    return ", ".join(map(_plain, value)) or "none" if isinstance(value, (list, tuple)) else str(value)


def print_checks(title: str, checks: "Sequence[Check]") -> None:
    """Every check with its residual and tolerance."""
    table = Table(title=title, title_justify="left", box=None, pad_edge=False)
    for column in ("check", "residual", "allowed", "unit", "", "worst"):
        table.add_column(column)
    for c in checks:
        table.add_row(
            c.name, f"{c.residual:.1e}", f"{c.tolerance:.0e}", c.unit, "ok" if c.passed else "FAILED", c.where
        )
    out = wide_console()
    out.print(table)
    bad = sum(not c.passed for c in checks)
    out.print(f"{'verified' if not bad else 'NOT verified'}: {len(checks) - bad} of {len(checks)} checks passed")
