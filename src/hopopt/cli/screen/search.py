"""What the command line shows of the search: how what was tried ended, which hops it found, what a global method says."""

from hopopt.planner.answer.extras import HopFamily
from hopopt.planner.answer.summary import Summary
from hopopt.planner.checks.global_verdict import followed, highest, verdict
from hopopt.planner.search.multistart import STOPPED_NEAR_KNOWN

FAMILIES = 3  # different hops that are listed


def measure(s: Summary, value: float, form: str) -> str:
    """A value of the objective with its unit."""
    return f"{value:{form}} {s.objective_unit.replace('1', '')}".strip()


def measured(s: Summary, value: float, digits: int) -> str:
    """A value of the objective with its unit to so many places, or to as many digits where those would be zeros."""
    return measure(s, value, f".{digits}f" if abs(value) >= 10.0**-digits else f".{digits}g")


def starts_lines(s: Summary, more: str = "") -> list[str]:
    """How all that was tried on the first mesh ended; the different hops that were found, with what found them, and ``more``."""
    starts = s.starts
    if s.families is None:  # a result of one start
        ends = ", ".join(f"{o.count} at {measured(s, o.objective, 3)}" for o in starts.optima)
        return [f"{starts.count} start{'' if starts.count == 1 else 's'} on the first mesh: {ends}{more}"]
    stopped = sum(o.status == STOPPED_NEAR_KNOWN for o in starts.each)
    ended, asked = starts.count - stopped - len(starts.failed), starts.count if starts.asked is None else starts.asked
    tried = f"{starts.count} tried" + (f", {asked} of them starts" if asked < starts.count else "")
    ends = f"{ended} ended at a hop, {stopped} stopped near one, {len(starts.failed)} failed"
    found = [_family(s, f) for f in s.families]
    shown = ", ".join(found[:FAMILIES]) + (f" and {len(found) - FAMILIES} lower" if len(found) > FAMILIES else "")
    counted = f"{len(found)} different hops" if len(found) > 1 else "one hop"
    if starts.apart is not None and ended > 1:
        counted += f" (what differs by less than {measure(s, starts.apart, '.0e')} counts as one)"
    return [f"{tried}: {ends}", f"{counted}: {shown}{more}"]


def _family(s: Summary, f: HopFamily) -> str:
    """The value of a kind of hop, marked where only the first mesh tells it, and what found it."""
    rough = "" if f.refined else "first mesh, "
    first, *others = f.found_by
    more = f" and {len(others)} more" if others else ""
    return f"{measured(s, f.objective_value, 4)} ({rough}by {first}{more})"


def global_line(s: Summary) -> list[str]:
    """What the global method says of the answer: the number, its parts, the verdict; or why it was not used, where the search
    was more than one start."""
    found = s.global_
    if found is not None and found.reason and s.searched:
        return [f"no global method was used: {found.reason}"]
    if found is None or found.grid is None or (most := highest(found.value_m, followed(found))) is None:
        return []
    parts = {"promised": found.value_m, "by its motions": found.motion_m, "by hops solved from them": found.solved_m}
    told = ", ".join(f"{x:.3f} {name}" for name, x in parts.items() if x is not None)
    judged = None
    if s.objective == "clearance":
        judged = verdict(found.value_m, followed(found), s.clearance_m, found.left_out)
    said = judged or "no verdict, for it knows clearances alone"
    grid = " x ".join(map(str, found.grid))
    return [f"a global method ({found.method}) on {grid} states reaches {most:.3f} m ({told}): {said}"]
