"""What the command line shows of a stored answer: all that cli/screen/answer.py leaves out."""

from collections.abc import Iterator, Mapping

from hopopt.cli.screen.answer import (
    bound_line,
    checks_line,
    control_lines,
    error_line,
    gains,
    headed,
    in_short,
    notes,
    short,
    upwards,
)
from hopopt.cli.screen.checks import certificate_line, cross_check_lines, second_order_line, structure_lines
from hopopt.cli.screen.console import NamedLines, Shown
from hopopt.cli.screen.motion import hop_lines
from hopopt.cli.screen.search import global_line, measure, starts_lines
from hopopt.cli.screen.studies import codesign
from hopopt.planner.answer.limit_use import IdleLimit
from hopopt.planner.answer.summary import Summary
from hopopt.planner.solution import Solution


def answer(solution: Solution, all_of_it: bool = False) -> Iterator[Shown]:
    """An answer, short or ``all_of_it``; one that is not verified is never short, but where the time was up."""
    s = solution.summary
    yield from short(solution) if not all_of_it and (s.verified or s.late) else whole(solution)
    if s.codesign:
        yield from codesign(s.codesign)
    yield NamedLines("cross-check", cross_check_lines(s))


def whole(solution: Solution) -> Iterator[Shown]:
    """The whole account of an answer."""
    s = solution.shown
    folder = str(solution.result_dir or s.result_dir)
    return headed(
        s,
        in_short=in_short(s, solution.design),
        hop=[*hop_lines(s, solution.design), _ground(s)],
        effort=_effort(s),
        limits=_limits(s),
        control=control_lines(s),
        structure=structure_lines(s),
        evidence=_evidence(s),
        notes=notes(s),
        results=[f"{folder}, as it was stored: hopopt verify {folder} checks it again"],
    )


def _ground(s: Summary) -> str:
    if s.friction is not None:
        return "the friction cone is held"
    if (grip := s.grip_without_load_N) < 0.5:
        return "the foot is pinned, but never held along the ground without load"
    return f"the foot is pinned: without load it is held along the ground by up to {grip:.0f} N (contact.friction limits that)"


def _effort(s: Summary) -> list[str]:
    means = ", ".join(f"{joint} {mean:.0%}" for joint, mean in s.saturation_mean.items())
    e = s.energy
    return [
        f"mean saturation in stance: {means}; work in stance {e['stance_positive_J']:.0f} J in, {e['stance_net_J']:.0f} J net; "
        f"peak vertical ground force {s.peak_vertical_force_N:.0f} N"
    ]


def _limits(s: Summary) -> list[str]:
    active = ", ".join(f"{name} {share:.0%}" for name, share in list(s.active_limits.items())[:5]) or "none"
    return [
        f"active in stance: {active}",
        f"1 % more of its range would give: {', '.join(map(' '.join, gains(s).items())) or 'nothing'}",
        *_idle(s.idle_limits),
    ]


def _idle(found: Mapping[str, IdleLimit], most: int = 4) -> list[str]:
    """The least used limits in one line; none if every limit acts."""
    named = [f"{name} ({use.used:.0%} used)" for name, use in list(found.items())[:most]]
    rest = f" and {len(found) - most} more (hopopt diagnose names them)" if len(found) > most else ""
    return [f"never act: {', '.join(named)}{rest}"] if named else []


def _evidence(s: Summary) -> list[str]:
    mesh, change = s.mesh[-1], s.check("change of the objective").residual
    sizes = " + ".join(str(n) for n in mesh.intervals.values())
    settled = f"objective settled to {change:.0e}" if change < float("inf") else "no second mesh to compare with"
    bias = f"tie-break bias below {measure(s, s.bias, '.0e')}"
    if s.tie_break_weighs > 1e-3 * abs(s.objective_value):
        bias = "insensitive to torques: gentle ones are preferred"
    return [
        *([f"{error_line(s)}{_beaten(s)}"] if s.verified else []),
        *starts_lines(s),
        *global_line(s),
        f"{len(s.mesh)} mesh{'es' if len(s.mesh) > 1 else ''}, last {sizes} intervals ({s.scheme}); {settled}, {bias}",
        checks_line(s),
        *([] if s.certified else bound_line(s.upper_bound.clearance_m, s.objective)),  # else hopopt evidence has it
        *_failed(s),
        *certificate_line(s),
        *second_order_line(s.second_order),
    ]


def _beaten(s: Summary) -> str:
    """What limits enforced between the nodes cost, and what neighbouring hops may gain at most."""
    e = s.objective_error
    reported = f"; limits enforced between the nodes cost {measure(s, e.relaxed.gains, '.0e')}"
    if e.could_be_beaten_by is not None:
        reported += f"; to first order hops beside it gain at most {measure(s, upwards(e.could_be_beaten_by), '.0e')}"
    return reported


def _failed(s: Summary) -> list[str]:
    """The checks that failed, with their residuals; of an answer whose time was up only how many."""
    if s.late and not s.verified:
        return [f"{len(s.failed_checks)} checks fail, as refinement was cut short: hopopt verify lists them"]
    return [
        f"FAILED {c.name}: {c.residual:.1e} {c.unit} (allowed {c.tolerance:.0e}){f', {c.where}' if c.where else ''}"
        for c in s.verification
        if not c.passed
    ]
