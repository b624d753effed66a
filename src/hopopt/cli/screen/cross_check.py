"""What the command line shows of cross-checks: a line each."""

from typing import TYPE_CHECKING

from hopopt.cli.screen.console import console, print_lines

if TYPE_CHECKING:
    from hopopt.planner.answer.extras import CrossCheck
    from hopopt.planner.answer.summary import Summary


def print_cross_checks(summary: "Summary") -> None:
    """Every cross-check: which solver and scheme, what it found, how far from the answer."""
    print_lines(console(), "cross-check", cross_check_lines(summary))


def cross_check_lines(summary: "Summary") -> list[str]:
    """A line for each cross-check; one that failed or disagrees is named as such."""
    unit = summary.objective_unit.replace("1", "")
    return [_line(o, unit) for o in summary.second_opinions]


def _line(o: "CrossCheck", unit: str) -> str:
    if o.objective is None:
        return f"{o.name}: FAILED, {o.reason} ({o.seconds:.0f} s)"
    found, difference = f"{o.objective:.5f} {unit}".strip(), abs(o.difference or 0.0)
    if o.agrees:
        return f"{o.name}: {found}, differs by {difference:.0e} ({o.seconds:.0f} s)"
    how = "better" if (o.difference or 0.0) > 0 else "worse"
    reported = f"DISAGREES: {found}, {how} by {difference:.0e} (allowed {o.allowed:.0e})"
    short = f"; {o.reason}" if o.reason else ""
    return f"{o.name}: {reported}{short} ({o.seconds:.0f} s)"
