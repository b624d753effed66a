"""What the command line shows of the certificate of first-order optimality and of the switching structure."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from hopopt.cli.screen.console import console, print_residuals

if TYPE_CHECKING:
    from hopopt.optimality.second_order import Curvature
    from hopopt.planner.answer.summary import Summary
    from hopopt.verify.check import Check

FIRST, FEW = 4, 4  # so many stretches of a long line are told before its last, where more than FEW are left out


def certificate_line(s: "Summary") -> list[str]:
    """One line for the answer: whether the first-order conditions hold along the whole hop, and how well."""
    checks = s.certificate
    if not checks:
        return []
    from hopopt.optimality.certificate import COSTATES, entry

    bad = [name.replace("_", " ") for name, c in checks.items() if not c.passed]
    if bad:
        return [f"first-order optimality NOT certified: {', '.join(bad)} (hopopt verify lists all conditions)"]
    costates = max(checks[entry(COSTATES, phase)].residual for phase in s.phases)
    gain = sum(c.residual for c in checks.values() if c.unit == "of the objective")
    return [
        f"first-order optimality certified: {len(checks)} conditions, costates within {costates:.0e}, what they leave "
        f"open is {gain:.0e} of the objective"
    ]


def certified_words(s: "Summary") -> str:
    """Whether the first-order conditions hold, to end a line."""
    checks = s.certificate
    bad = sum(not c.passed for c in checks.values())
    words = (
        f"NOT certified ({bad} of {len(checks)} conditions fail)" if bad else f"certified ({len(checks)} conditions)"
    )
    return f"; first-order optimality {words}" if checks else ""


def _shortened(parts: list[str]) -> list[str]:
    """Very many stretches, as of torques that chatter, by the first ones and the last."""
    left = len(parts) - FIRST - 1
    return parts if left <= FEW else [*parts[:FIRST], f"{left} more (--json tells all)", parts[-1]]


def second_order_line(found: "Curvature | None") -> list[str]:
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


def structure_lines(s: "Summary") -> list[str]:
    """The switching structure of stance, a line for each joint and whatever else has limits that act."""
    from hopopt.optimality.minimum_principle.switching_structure import THEN, by_subject

    found = s.structure
    lines = [f"{subject}: {THEN.join(_shortened(parts))}" for subject, parts in by_subject(found.stance).items()]
    if found.solved_again:
        times = ", ".join(f"{t:.5f} s" for t in (found.jumps_s or {}).get("stance", ()))
        lines.append(
            "solved again with free switching times: "
            + (f"torques jump at {times}; " if times else "")
            + f"the optimum is within {found.difference:.0e} of the one before"
        )
    elif found.solved_again is False:
        lines.append(f"not solved with free switching times: {found.note}")
    return lines


def print_certificate(conditions: "Sequence[Check]", second: "Curvature | None") -> None:
    """Every condition with its residual and tolerance, and whether all hold; and the second-order test."""
    out = console()
    if not conditions:
        out.print("no certificate: this result was stored without multipliers (solve it again for one)")
        return
    print_residuals("first-order optimality", "condition", conditions)
    bad, total = sum(not c.passed for c in conditions), len(conditions)
    out.print(f"first-order optimality {'NOT ' if bad else ''}certified: {total - bad} of {total} conditions hold")
    for line in second_order_line(second):
        out.print(line)
