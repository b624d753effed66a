"""What the command line shows of studies: the table of a sweep, and that of a front."""

from collections.abc import Iterator

from rich.table import Column

from hopopt.cli.screen.console import Shown, table
from hopopt.ocp.objectives.registry import find
from hopopt.planner.stopwatch import duration
from hopopt.studies.pareto import Front
from hopopt.studies.sweep.run import Study

SHOWN = 60  # points; the rest is in the table's file


def of_sweep(study: Study) -> Iterator[Shown]:
    """Every point with its outcome, the best, what failed and why, and where it lies."""
    goal, best, rows = find(study.definition.objective), study.best, list[list[str]]()
    other = [] if goal.figure == "clearance_m" else [f"{goal.name} {goal.unit}"]
    for p in study.points[:SHOWN]:
        height = "" if p.clearance_m is None else f"{p.clearance_m:.4f}"
        what = " best" if best is p else f": {p.sentence}" if p.sentence else ""
        value = [f"{p.objective_value:.5g}" if p.verified else ""] if other else []
        rows.append([*(f"{x:g}" for x in p.values.values()), *value, height, f"{p.outcome}{what}"])
    yield table([*(axis.entry for axis in study.definition.axes), *other, "clearance m", "outcome"], rows)
    if len(study.points) > SHOWN:
        yield f"… and {len(study.points) - SHOWN} more in {study.folder / 'table.csv'}"
    verified = sum(p.verified for p in study.points)
    corrected = f", {study.corrected} improved from other neighbours" if study.corrected else ""
    yield f"{verified} of {len(study.points)} points verified{corrected}, in {duration(study.seconds)}"
    if best:
        where = ", ".join(f"{entry} = {x:g}" for entry, x in best.values.items())
        edge = f"; {study.at_the_edge}" if study.at_the_edge else ""
        yield f"best: {where}: clearance {best.clearance_m:.4f} m{edge}"
    yield f"results {study.folder}"


def of_front(found: Front) -> Iterator[Shown]:
    """A line for each point, by clearance, and where they are kept."""
    name, unit, rows = found.against.name.replace("_", " "), found.against.unit, list[list[str]]()
    for p in sorted(found.points, key=lambda p: p.asked_m):
        figures = [f"{x:.4f}" if x is not None else "-" for x in (p.clearance_m or p.asked_m, p.value)]
        kind, state = p.kind if p.least else f"{p.kind} (not the least)", "verified" if p.verified else p.sentence
        rows.append([kind, *figures, state, (p.result_dir or "").split("/")[-1]])
    heads = ("point", "clearance [m]", f"{name} [{unit}]" if unit != "1" else name, "", "folder")
    title = f"{found.design.title or found.design.name}: clearance against {name}"
    yield table([Column(head, no_wrap=True) for head in heads], rows, title)
    whole = "" if found.complete else ", not complete"
    yield f"{len(found.verified_points)} of {len(found.points)} points verified{whole}; {found.folder}"
