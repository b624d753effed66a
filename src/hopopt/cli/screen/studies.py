"""What the command line shows of studies: the table of a sweep, that of a front, that of motors and gears, and that of a co-design's free numbers."""

from collections.abc import Iterator
from pathlib import Path

from rich.table import Column

from hopopt.cli.screen.console import Shown, table
from hopopt.ocp.objectives.registry import find
from hopopt.planner.answer.extras import CoDesign, FreeEntry
from hopopt.planner.stopwatch import duration
from hopopt.studies.choose.choice import DROPPED, FILE, ORDERS, UNWEIGHED, WEAK, Candidate, Choice
from hopopt.studies.maps.found import Map
from hopopt.studies.pareto.front import Front
from hopopt.studies.sweep.point_file import Point
from hopopt.studies.sweep.run import Study

SHOWN = 60  # points; the rest is in the table's file
PAIRS = 30  # of those that clear, and of those that do not; the rest is in the choice's file
LISTED = 12  # the best designs of a map
ALL_DRIVES = "all drives kg"  # a column of a choice


def of_sweep(study: Study) -> Iterator[Shown]:
    """Every point with its outcome, the best, what failed and why, and where it lies."""
    goal, best, rows = find(study.definition.objective), study.best, list[list[str]]()
    other = [] if goal.figure == "clearance_m" else [f"{goal.name} {goal.unit}"]
    for p in study.points[:SHOWN]:
        height = "" if p.clearance_m is None else f"{p.clearance_m:.4f}"
        what = " best" if best is p else f": {p.sentence}" if p.sentence else ""
        value = [f"{p.objective_value:.5g}" if p.verified else ""] if other else []
        rows.append([*_values(study, p), *value, height, f"{p.outcome}{what}"])
    yield table([*(axis.entry for axis in study.definition.axes), *other, "clearance m", "outcome"], rows)
    if len(study.points) > SHOWN:
        yield f"… and {len(study.points) - SHOWN} more in {study.folder / 'table.csv'}"
    verified = sum(p.verified for p in study.points)
    corrected = f", {study.corrected} improved in later passes" if study.corrected else ""
    yield f"{verified} of {len(study.points)} points verified{corrected}, in {duration(study.seconds)}"
    if best:
        where = study.definition.words(best.values)
        edge = f"; {study.at_the_edge}" if study.at_the_edge else ""
        yield f"best: {where}: clearance {best.clearance_m:.4f} m{edge}"
    yield f"results {study.folder}"


def _values(study: Study, point: Point) -> list[str]:
    """A point's values of the varied entries."""
    return [x if isinstance(x, str) else f"{x:g}" for x in study.definition.stated(point.values).values()]


def of_map(found: Map) -> Iterator[Shown]:
    """The best designs, how far the first mesh was off where it was checked, which families are best, what was verified."""
    goal, solved = find(found.definition.objective), [p for p in found.preliminary if p.solved]
    checked = {s.preliminary.index: s.found for s in (*found.sampled, *found.best_verified)}
    ranked = sorted(solved, key=lambda p: -goal.signed_value(p.objective_value or 0.0))
    rows = []
    for p in ranked[:LISTED]:
        answer = checked.get(p.index)
        state = "preliminary" if answer is None else answer.outcome
        value = f"{answer.objective_value:.5g}" if answer is not None and answer.verified else ""
        rows.append([*_values(found, p), f"{p.objective_value:.5g}", value, str(p.family or "-"), state])
    of = f"{goal.name.replace('_', ' ')} {goal.unit}".removesuffix(" 1")
    heads = [*(a.entry for a in found.definition.axes), f"{of}, preliminary", f"{of}, verified", "family", ""]
    yield table(heads, rows, "the best designs: preliminary values are of the first mesh alone, and not verified")
    if len(ranked) > LISTED:
        yield f"… and {len(ranked) - LISTED} more in {found.folder / 'table.csv'}"
    pace = f", {found.rate:.3g} designs a second" if found.rate else ""
    yield f"{len(solved)} of {len(found.points)} designs have a preliminary hop{pace}; {duration(found.seconds)} in all"
    yield from (f"{count} {outcome}" for outcome, count in found.without_hop.items())
    yield from _families(found)
    yield from _checked(found)
    yield f"results {found.folder}"


def _families(found: Map) -> Iterator[Shown]:
    """What the hops of each family do, and where it is the best."""
    for family, words in enumerate(found.families, 1):
        yield f"family {family}, best at {found.best_in.get(family, 0)}: {words}"
    if restarted := found.best_in.get(0):
        yield f"no family led to a hop at {restarted}, but another start"
    if found.switches:
        yield f"another family than before is the best at {found.switches} designs"


def _checked(found: Map) -> Iterator[Shown]:
    """How far the first mesh was off where it was drawn to be verified, and the best of what was verified."""
    off, drawn = found.differences, len(found.sampled)
    if off:
        middle = sorted(off)[len(off) // 2]
        yield (
            f"{drawn} designs drawn, {len(off)} verified: there the first mesh is off by {min(off):+.2%} to {max(off):+.2%} "
            f"of the verified value, median {middle:+.2%}"
        )
    if found.missed:
        yield f"at {found.missed} of these a search of its own finds a better hop than the families of the map: expect that elsewhere too"
    for s in (s for s in (*found.sampled, *found.best_verified) if not s.found.verified):
        yield f"number {s.preliminary.index + 1} was to be verified: {s.found.outcome}: {s.found.sentence}"
    if found.best:
        where = found.definition.words(found.best.values)
        edge = f"; {found.at_the_edge}" if found.at_the_edge else ""
        yield f"best that is verified: {where}: {found.best.objective_value:.5g} {find(found.definition.objective).unit}{edge}"


def of_front(found: Front) -> Iterator[Shown]:
    """A line for each point, by clearance, and where they are kept."""
    name, rows = found.against.words, list[list[str]]()
    for p in sorted(found.points, key=lambda p: p.asked_m):
        figures = [f"{x:.4f}" if x is not None else "-" for x in (p.clearance_m or p.asked_m, p.value)]
        kind, state = p.kind if p.least else f"{p.kind} (not the least)", "verified" if p.verified else p.sentence
        rows.append([kind, *figures, state, (p.result_dir or "").split("/")[-1]])
    heads = ("point", "clearance [m]", found.against.label, "", "folder")
    title = f"{found.design.title or found.design.name}: clearance against {name}"
    yield table([Column(head, no_wrap=True) for head in heads], rows, title)
    whole = "" if found.complete else ", not complete"
    yield f"{len(found.verified_points)} of {len(found.points)} points verified{whole}; {found.folder}"


def codesign(found: CoDesign) -> Iterator[Shown]:
    """A line for each free entry, and the couplings."""
    heads = ("entry", "was", "optimal", "lowest", "highest", "unit", "")
    rows = []
    for p in found.parameters:
        numbers = [f"{x:.5g}" for x in (p.was, p.optimal, p.lower, p.upper)]
        rows.append([p.entry, *numbers, p.unit, f"at its {p.at_bound} bound" if p.at_bound else ""])
    yield table([Column(head, no_wrap=True) for head in heads], rows, "free design parameters")
    for p in found.parameters:
        yield from _between(p)
    for c in found.couplings:
        yield f"{c.coupling}   ({'active' if c.active else 'not active'})"
        if c.coupling.startswith("catalogue"):
            yield f"  that is {c.equation}"
    for part, law in found.mass_laws.items():
        yield (
            f"  law of {law.entries} {part}s from {law.lowest:.3g} to {law.highest:.3g} N m, "
            f"typically off by a factor of {law.scatter:.2g}: hopopt actuators --fit"
        )


def _between(p: FreeEntry) -> list[str]:
    """The limits that an entry sits between, and what it would be without each."""
    if (at := p.between) is None:
        return []
    lines = [f"{p.entry} = {p.optimal:.5g} sits where limits trade places: {' and '.join(at.limits)}"]
    for k, w in enumerate(at.without):
        which = " (the lesser)" if k == 0 and len(at.without) > 1 else ""
        lines.append(
            f"  without the {w.limit}{which}: {w.objective_value:.5g} at {w.optimal:.5g} {p.unit}".removesuffix(" 1")
        )
    return lines


def of_preliminary_choice(found: Choice) -> Iterator[Shown]:
    """Pairs that clear on coarse meshes, while the first of them are verified."""
    yield from _clearing(found)
    yield f"so it is on coarse meshes; the first are verified now, which may be interrupted: {found.folder} keeps this list"


def of_choice(found: Choice, file: Path | None = None) -> Iterator[Shown]:
    """Pairs that clear, the first the best, what the others lack, and what the numbers rest on; ``file``: the leg written."""
    yield from _clearing(found)
    yield from _not_clearing(found)
    d = found.drives
    yield (
        f"the body's {d.design.leg.body.mass:g} kg count {d.present:.3g} kg of present drives, {d.assumed}; new drives take their place "
        "at the body"
    )
    solved = [c for c in found.candidates if c.clearance is not None]
    preliminary = sum(c.verified is None for c in solved)
    pairs = f"{len(found.candidates)} pair{'s' * (len(found.candidates) != 1)}"
    yield f"{pairs}: {len(solved)} solved, {preliminary} of them preliminary (coarse meshes alone, not verified)"
    unsure = {key for c in found.clearing for key in c.pair.unverified}
    if unsure:
        yield f"those marked rest on numbers that no source confirms ({', '.join(sorted(unsure))}): hopopt actuators"
    if file is not None and found.clearing:
        yield f"{file} written: {found.clearing[0].pair.name}; hopopt solve {file}"
    elif file is not None:
        yield f"{file} is not written: no pair clears {found.wish:g} m"
    yield f"results {found.folder}" if found.folder else "nothing was solved"


def _clearing(found: Choice) -> Iterator[Shown]:
    """Those that clear, the best first."""
    heads = ("motor and gear", ALL_DRIVES, "body kg", "EUR", "push J", "peak W", "clearance m", "")
    rows = [
        [
            c.pair.name, *_figures(c.mass, c.body_mass), _figure(c.price), *_figures(c.energy, c.peak_power),
            _figure(c.clearance, 4), ", ".join(filter(None, _marks(c))),
        ]
        for c in found.clearing
    ]  # fmt: skip
    d = found.drives
    title = f"clear {found.wish:g} m, by {found.by}: drives of {', '.join(d.joints)}{f' of {d.legs} legs' if d.legs > 1 else ''}"
    yield table(heads, rows[:PAIRS], title)
    if (count := len(d.joints) * d.legs) > 1:
        yield f"mass and price are of all {count} motors with their gears: {len(d.joints)} on a leg, {d.legs} leg{'s' * (d.legs > 1)}"
    if rows and all(ORDERS[found.by](c) is None for c in found.clearing):
        yield f"of none of these the {found.by} is stated: the highest comes first"
    if not rows:
        yield f"no pair clears {found.wish:g} m"
    if len(rows) > PAIRS:
        yield _more(found, len(rows) - PAIRS)


def _marks(c: Candidate) -> tuple[str, ...]:
    """What is to be known of the clearance of a pair that clears."""
    return c.state, "too hot in that hop" if c.lacks else "", "unverified numbers" if c.pair.unverified else ""


def _not_clearing(found: Choice) -> Iterator[Shown]:
    """What the others lack, the nearest first."""
    heads = ("motor and gear", ALL_DRIVES, "clearance m", "at most m", "lacks")
    rows = [[c.pair.name, *_figures(c.mass), _figure(c.clearance, 4), _figure(c.bound), _why(c)] for c in found.others]
    if rows:
        yield table(heads, rows[:PAIRS], f"do not clear {found.wish:g} m, the nearest first")
    if len(rows) > PAIRS:
        yield _more(found, len(rows) - PAIRS)


def _more(found: Choice, count: int) -> str:
    return f"… and {count} more{f' in {found.folder / FILE}' if found.folder else ''}"


def _why(c: Candidate) -> str:
    """Why a pair does not clear."""
    if c.outcome == UNWEIGHED:
        return f"{c.outcome}: a catalogue of your own may give it"
    if c.outcome == WEAK:
        return c.outcome
    if c.outcome == DROPPED:
        return f"{c.outcome}: power over the longest stance, or speed, lifts it no higher"
    return c.sentence or f"{c.lacks}, {c.state}"


def _figures(*values: float | None) -> list[str]:
    return [_figure(value) for value in values]


def _figure(value: float | None, digits: int = 3) -> str:
    return "-" if value is None else f"{value:.{digits}g}"
