"""What the command line shows of checks: tables of residuals, the certificate, the switching structure, cross-checks."""

from collections.abc import Iterator, Sequence

from rich.table import Column

from hopopt.cli.screen.console import WIDE_SCREEN, Shown, console, table
from hopopt.optimality.certificate import COSTATES, entry
from hopopt.optimality.minimum_principle.switching_structure import THEN, by_subject
from hopopt.optimality.second_order import Curvature
from hopopt.planner.answer.extras import CrossCheck
from hopopt.planner.answer.summary import Summary
from hopopt.verify.check import Check

FIRST, FEW = 4, 4  # so many stretches of a long line are told before its last, where more than FEW are left out


def checks(title: str, made: Sequence[Check]) -> Iterator[Shown]:
    """Every check with its residual and tolerance, and how many passed."""
    yield from residuals(title, "check", made)
    bad, left_out = sum(not c.passed for c in made), [c for c in made if c.left_out]
    count = len(made) - len(left_out)
    yield f"{title}: {count - bad} of {count} checks passed"
    if left_out:
        yield f"left out: {', '.join(c.name for c in left_out)} ({left_out[0].left_out})"


def residuals(title: str, kind: str, made: Sequence[Check]) -> Iterator[Shown]:
    """A table of checks; where the worst is stands in it where there is room, else below it of those that failed."""
    room = console().width >= WIDE_SCREEN
    heads = (kind, "residual", "allowed", "unit", "", *(["worst"] if room else []))
    columns, rows = [Column(head, no_wrap=head == kind) for head in heads], list[list[str]]()
    for c in made:
        state = "left out" if c.left_out else "ok" if c.passed else "FAILED"
        residual = "" if c.left_out else f"{c.residual:.1e}"
        rows.append([c.name, residual, f"{c.tolerance:.0e}", c.unit, state, c.where][: len(columns)])
    yield table(columns, rows, title, between=(0, 2 if room else 1))
    yield from (f"FAILED {c.name}: {c.where}" for c in made if c.where and not c.passed and not room)


def certificate(conditions: Sequence[Check], second: Curvature | None) -> Iterator[Shown]:
    """Every condition with its residual and tolerance, and whether all hold; and the second-order test."""
    if not conditions:
        yield "no certificate: this result was stored without multipliers (solve it again for one)"
        return
    yield from residuals("first-order optimality", "condition", conditions)
    bad, total = sum(not c.passed for c in conditions), len(conditions)
    yield f"first-order optimality {'NOT ' if bad else ''}certified: {total - bad} of {total} conditions hold"
    yield from second_order_line(second)


def certificate_line(s: Summary) -> list[str]:
    """One line for the answer: whether the first-order conditions hold along the whole hop, and how well."""
    if not (made := s.certificate):
        return []
    bad = [name.replace("_", " ") for name, c in made.items() if not c.passed]
    if bad:
        return [f"first-order optimality NOT certified: {', '.join(bad)} (hopopt verify lists all conditions)"]
    costates = max(made[entry(COSTATES, phase)].residual for phase in s.phases)
    gain = sum(c.residual for c in made.values() if c.unit == "of the objective")
    return [
        f"first-order optimality certified: {len(made)} conditions, costates within {costates:.0e}, what they leave "
        f"open is {gain:.0e} of the objective"
    ]


def certified_words(s: Summary) -> str:
    """Whether the first-order conditions hold, to end a line."""
    if not (made := s.certificate):
        return ""
    bad = sum(not c.passed for c in made.values())
    words = f"NOT certified ({bad} of {len(made)} conditions fail)" if bad else f"certified ({len(made)} conditions)"
    return f"; first-order optimality {words}"


def second_order_line(found: Curvature | None) -> list[str]:
    """One line of the second-order test."""
    if found is None:
        return []
    total = found.worse + found.flat + found.better
    verdict = "no direction makes the hop better"
    if found.better:
        verdict = f"{found.better} gain, but limits on which the hop lies forbid that"
    if found.saddle:
        verdict = f"{found.saddle} make the hop BETTER"
    return [f"second order, on the last mesh: of {total} directions {found.flat} are flat, {verdict}"]


def structure_lines(s: Summary) -> list[str]:
    """The switching structure of stance, a line for each joint and whatever else has limits that act."""
    found = s.structure
    lines = [f"{subject}: {THEN.join(_shortened(parts))}" for subject, parts in by_subject(found.stance).items()]
    if found.solved_again:
        times = ", ".join(f"{t:.5f} s" for t in (found.jumps_s or {}).get("stance", ()))
        jumps = f"torques jump at {times}; " if times else ""
        again = f"{jumps}the optimum is within {found.difference:.0e} of the one before"
        lines.append(f"solved again with free switching times: {again}")
    elif found.solved_again is False:
        lines.append(f"not solved with free switching times: {found.note}")
    return lines


def _shortened(parts: list[str]) -> list[str]:
    """Very many stretches, as of torques that chatter, by the first ones and the last."""
    left = len(parts) - FIRST - 1
    return parts if left <= FEW else [*parts[:FIRST], f"{left} more (--json tells all)", parts[-1]]


def cross_check_lines(s: Summary) -> list[str]:
    """A line for each cross-check: solver and scheme, what it found, how far from the answer; one that failed or disagrees
    is named as such."""
    return [f"{o.name}: {_cross_check(o, s.objective_unit)} ({o.seconds:.0f} s)" for o in s.second_opinions]


def _cross_check(o: CrossCheck, unit: str) -> str:
    if o.objective is None:
        return f"FAILED, {o.reason}"
    found, difference = f"{o.objective:.5f} {unit.replace('1', '')}".strip(), o.difference or 0.0
    if o.agrees:
        return f"{found}, differs by {abs(difference):.0e}"
    how = f"{'better' if difference > 0 else 'worse'} by {abs(difference):.0e}"
    return f"DISAGREES: {found}, {how} (allowed {o.allowed:.0e}){f'; {o.reason}' if o.reason else ''}"
