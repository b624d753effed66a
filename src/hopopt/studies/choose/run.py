"""Which motor and which gear: every pair of the catalogue on a leg, those that cannot clear dropped by a closed bound.

The rest are points of a map (studies/maps): solved on the first mesh, each from starts of its own, then once more from
pairs like it where that promises more; those that clear on a finer mesh too. The first that clear are solved and verified in
full, the others are preliminary.
"""

import os
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from hopopt.design import Design, refuse_landed
from hopopt.errors import ProblemFileError, UsageError
from hopopt.leg.robot import build_robot
from hopopt.nlp.deadline import NEVER, Deadline
from hopopt.ocp.guesses.feasibility import strength
from hopopt.problem.catalogue import Entry, catalogue
from hopopt.problem.load import changed
from hopopt.storage.folder import write_json
from hopopt.studies.choose import choice
from hopopt.studies.choose.bound import highest
from hopopt.studies.choose.choice import FILE, ORDERS, Candidate, Choice, first_to_verify, outcome_of
from hopopt.studies.choose.pairs import Drives, Pair, Tried, drives, keys_of, pairs
from hopopt.studies.choose.push import push
from hopopt.studies.maps.doubt import AROUND
from hopopt.studies.maps.pieces import neighbours
from hopopt.studies.maps.run import run_map
from hopopt.studies.maps.warm import MapPoint
from hopopt.studies.sweep.definition import Axis, Definition
from hopopt.studies.sweep.point_file import NOT_SOLVED

Say = Callable[[str], None]
HOPELESS = 0.7  # share of the torques that hold the start pose, below which no drive was seen to hop (benchmarks/choose_pairs.py)
NOT_BEGUN = "the time limit was reached before it"
TOO_MUCH_OFF = "leg.body.mass = {:g} kg is less than the {:.3g} kg of all legs' present drives, which it counts: give --present-mass"
NEARLY = 0.15  # share of the clearance by which a pair may miss it and be solved again from pairs like it


def choose(
    design: Design,
    clearance: float,
    *,
    joints: Sequence[str] | None = None,
    only: Sequence[str] | None = None,
    tried: Sequence[Tried] | None = None,
    legs: int = 1,
    by: str = "mass",
    verify: int = 3,
    present_mass: float | None = None,
    starts: int = 1,
    processes: int | None = None,
    scheduler: str | None = None,
    results: Path = Path("results"),
    resume: Path | None = None,
    progress: Say | None = None,
    opened: Callable[[Path], None] = lambda folder: None,
    listed: Callable[[Choice], None] = lambda found: None,
    entries: Mapping[str, Entry] | None = None,
    until: Deadline = NEVER,
) -> Choice:
    """Every pair of motor and gear that lifts the leg's lowest point by a clearance [m], sorted.

    only: patterns of the names of motors and gears (None: all); tried: pairs in place of all of these; joints: whose drives are chosen (None: all, with one pair); legs: of the robot, whose drives the body carries
    by: mass, price, energy or peak-power; verify: how many of the first are verified in full
    present_mass: of the present drives of one leg [kg]; entries: the catalogue, if it is another
    starts: of each that is verified, beside the hop that it has already
    listed: told the choice when all pairs are solved and some are still to be verified; until: when nothing more may be begun

    UsageError for what cannot be asked. The rest as of a map.
    """
    began, known = time.perf_counter(), catalogue() if entries is None else entries
    refuse_landed(design, "hopopt choose")
    if not 0 < clearance < 20:
        raise UsageError(f"--clearance {clearance:g}: it must be above 0 and below 20 m")
    if by not in ORDERS:
        raise UsageError(f"--by {by}: it is one of {', '.join(ORDERS)}")
    if verify < 0:
        raise UsageError(f"--verify {verify}: it must be at least 0")
    chosen = drives(design, joints, legs, present_mass, known)
    before = [_before(chosen, pair, clearance, known) for pair in (pairs(known, only) if tried is None else tried)]
    left = sorted((c for c in before if not c.outcome), key=lambda c: c.mass or 0.0)
    done = tuple(c for c in before if c.outcome)
    if not left:
        return Choice(chosen, clearance, by, done, None, time.perf_counter() - began)
    definition = _definition(chosen, [c.pair for c in left], known, starts, clearance)

    def kept(solved: Sequence[Candidate], folder: Path) -> Choice:
        found = Choice(chosen, clearance, by, (*solved, *done), folder, time.perf_counter() - began)
        write_json(found.as_dict(), folder / FILE)
        return found

    solved, folder = _solved(
        definition, left, clearance, by, verify, lambda solved, folder: listed(kept(solved, folder)),
        processes=processes or os.cpu_count() or 1, scheduler=scheduler, results=results, resume=resume, progress=progress,
        opened=opened, until=until,
    )  # fmt: skip
    return kept(solved, folder)


def _before(chosen: Drives, pair: Tried, wish: float, entries: Mapping[str, Entry]) -> Candidate:
    """A pair with what is known of it before it is solved; its outcome is empty if it is to be solved."""
    count = len(chosen.joints) * chosen.legs
    ratio = float(entries[pair.gear].parts["gear"]["ratio"]) if isinstance(pair, Pair) else None
    price = None if pair.price is None else count * pair.price
    if pair.mass is None:
        return Candidate(pair, choice.UNWEIGHED, None, price, ratio=ratio)
    found = Candidate(pair, "", count * pair.mass, price, chosen.design.leg.body.mass + chosen.added(pair), ratio=ratio)
    if (found.body_mass or 0.0) <= 0:
        return replace(
            found,
            body_mass=None,
            outcome=choice.NOT_SOLVED,
            sentence=TOO_MUCH_OFF.format(chosen.design.leg.body.mass, chosen.legs * chosen.present),
        )
    try:
        design = changed(chosen.design, chosen.named(pair))
    except ProblemFileError as error:
        return replace(found, outcome=choice.NOT_SOLVED, sentence=error.problems[0].removeprefix("override "))
    most = highest(design)
    if most < wish:
        return replace(found, bound=most, outcome=choice.DROPPED, lacks="power or speed")
    leg = design.leg  # where springs or changing ratios help, a weak drive may fall into a pose in which it hops
    weak = leg.direct and not leg.spring and strength(design, build_robot(leg)) < HOPELESS
    return replace(found, bound=most, outcome=choice.WEAK if weak else "", lacks="torque" if weak else "")


def _definition(
    chosen: Drives, left: Sequence[Tried], entries: Mapping[str, Entry], starts: int, wish: float
) -> Definition:
    """The map of these pairs: each a point, entries in which they differ its axes."""
    keys = keys_of(left, entries, chosen.design.leg)
    rows = [chosen.numbers(pair, entries, keys) for pair in left]
    base = changed(chosen.design, chosen.base(left[0], entries, keys))
    table = {entry: np.array([row[entry] for row in rows]) for entry in rows[0]}
    varied = {entry: column for entry, column in table.items() if np.ptp(column) > 0} or {
        "leg.body.mass": table["leg.body.mass"]
    }
    axes = tuple(Axis(entry, (), float(column.min()), float(column.max())) for entry, column in varied.items())
    points = tuple(tuple(float(column[k]) for column in varied.values()) for k in range(len(rows)))
    hot = tuple(chosen.heat(pair, entries, keys["motor"]) for pair in left)
    return Definition(
        base, "clearance", axes, starts=starts, preliminary=True, listed=points, wish=wish, full=hot if any(hot) else ()
    )


def _solved(
    definition: Definition, left: Sequence[Candidate], wish: float, by: str, verify: int,
    listed: Callable[[Sequence[Candidate], Path], None], opened: Callable[[Path], None], **settings: Any,
) -> tuple[list[Candidate], Path]:  # fmt: skip
    """The candidates as the map leaves them."""
    known, folder = (
        {k: replace(c, outcome=choice.NOT_SOLVED, sentence=NOT_BEGUN) for k, c in enumerate(left)},
        list[Path](),
    )

    def told(place: Path) -> None:
        folder.append(place)
        opened(place)

    def to_verify(points: Mapping[int, MapPoint], hops: Mapping[int, np.ndarray]) -> list[int]:
        for k, p in points.items():
            known[k] = _mapped(definition, left[k], p, hops.get(k), wish)
        chosen = first_to_verify(known, by, verify)
        if chosen:
            listed([known[k] for k in range(len(left))], folder[0])
        return chosen

    found = run_map(
        definition, checked=0, doubts=lambda points: _nearly(definition, points, wish), finer=lambda points: _clear(points, wish),
        to_verify=to_verify,
        so_far=lambda points: _so_far(left, points, wish), opened=told, **settings,
    )  # fmt: skip
    for k, p in ((p.index, p) for p in found.points):
        if p.verified and p.clearance_m is not None:
            outcome = outcome_of(p.clearance_m, wish, True)
            lacks = "" if outcome == choice.CLEARS else known[k].lacks or "mass"
            known[k] = replace(known[k], verified=p.clearance_m, outcome=outcome, lacks=lacks)
        elif not isinstance(p, MapPoint):
            outcome = choice.NOT_SOLVED if p.outcome == NOT_SOLVED else known[k].outcome
            known[k] = replace(known[k], outcome=outcome, sentence=f"{p.outcome}: {p.sentence}")
    return [known[k] for k in range(len(left))], found.folder


def _so_far(left: Sequence[Candidate], points: Mapping[int, MapPoint], wish: float) -> str:
    """How many clear as yet, and the lightest of them."""
    clear = [left[k] for k, p in points.items() if (p.objective_value or 0.0) >= wish]
    if not clear:
        return "none clears yet"
    best = min(clear, key=lambda c: c.mass or 0.0)
    return f"{len(clear)} clear so far, the lightest {best.pair.name} ({best.mass:.3g} kg)"


def _clear(points: Mapping[int, MapPoint], wish: float) -> list[int]:
    """Points that clear, or may."""
    return [k for k, p in sorted(points.items()) if outcome_of(p.objective_value or 0.0, wish, False) == choice.CLEARS]


def _nearly(definition: Definition, points: Mapping[int, MapPoint], wish: float) -> list[int]:
    """Points that all but clear, and those without a hop beside points that do."""
    values = {k: p.objective_value or 0.0 for k, p in points.items() if p.solved}
    near = {k for k, value in values.items() if value >= wish * (1 - NEARLY)}
    around = neighbours(definition, sorted(values)) if values else {}
    failed = (k for k in sorted(points) if k not in values and near.intersection(around.get(k, ())[:AROUND]))
    return [*(k for k in sorted(near) if values[k] < wish), *failed]


def _mapped(definition: Definition, c: Candidate, p: MapPoint, x: np.ndarray | None, wish: float) -> Candidate:
    """A candidate with its preliminary hop."""
    if not p.solved or p.objective_value is None or x is None:
        return replace(c, outcome=choice.NOT_SOLVED, sentence=p.sentence)
    seen = push(definition, p, x.astype(float))
    outcome = outcome_of(p.objective_value, wish, False)
    lacks = ("heat" if seen.too_hot else "") if outcome == choice.CLEARS else seen.exhausted or "mass"
    return replace(
        c, outcome=outcome, preliminary=p.objective_value, energy=seen.energy, peak_power=seen.peak_power, lacks=lacks
    )


def written(found: Choice, candidate: Candidate) -> Design:
    """The problem with a candidate's motor and gear by their names, and the body that carries them."""
    return changed(found.drives.design, found.drives.named(candidate.pair))
