"""What the command line shows of strategies that hop on and on."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from rich.table import Table

from hopopt.cli.screen.console import Shown, figures, named, table
from hopopt.cli.screen.runs import cm, ladder, not_kept, results

SPEED_DIFFERENCE = 0.05  # [m/s] by which a mean speed may differ from what is asked without a word
LOSS_FIGURES = ("push_m", "timing_m", "retraction_m")
LANDING_ADVICE = (
    "a softer landing (hop.touchdown_loss) or a larger reserve.ground_force leaves it room (docs/periodic.md)"
)


def hops(found: Mapping[str, Any]) -> Iterator[Shown]:
    """The bound, the table, who fell and why, and what limits were not kept."""
    rows = found["strategies"]
    yield _headline(found)
    yield hops_table(rows, found["hops"])
    yield (
        f"kept: lowest clearance of the second half of {found['hops']} hops; push, timing, fold: where the centimetres to the "
        "bound are lost; multiplier: by which errors grow from hop to hop (Floquet), below 1 they die out"
    )
    for name, row in rows.items():
        if row["fell"]:
            hint = f"; {LANDING_ADVICE}" if name.startswith("track") else ""
            yield f"{name} fell after {row['hops']} hops: {row['fell']}{hint}"
        yield from not_kept(name, row)
    for name, row in rows.items():
        if row["drawn"]:
            yield _drawn(name, row["drawn"])
        if row["basin"]:
            yield _basin(name, row["basin"])
        if row["mujoco_clearances_m"] is not None:
            yield _elsewhere(name, row["mujoco_clearances_m"])
        speed, asked = row["drift_m_per_hop"] / row["period_s"] if row["period_s"] else None, found["speed_m_s"]
        if speed is not None and abs(speed - asked) > SPEED_DIFFERENCE:
            yield f"{name} moves at {speed:+.2f} m/s on average; the bound is for {asked:g} m/s"
    yield from ladder(found)
    if found["tracked_plan_m"]:
        doubt = "" if found["tracked_plan_verified"] else "; it was NOT verified"
        high = f"tracking begins {100 * found['start_offset_m']:g} cm above its apex"
        yield f"tracked: a plan of {found['tracked_plan_m']:.4f} m with the problem's [reserve] held back; {high}{doubt}"
    yield from found["notes"]
    yield results(found)


def _headline(data: Mapping[str, Any]) -> str:
    if not data["verified"]:
        return "The periodic optimum was NOT verified: no bound is stated, and no shares of it count."
    if data["beaten_by"]:
        return f"The bound of {data['bound_m']:.4f} m is WRONG: {', '.join(data['beaten_by'])} keeps up more."
    return (
        f"{data['problem']}, hop after hop: the bound is {data['bound_m']:.4f} m every {data['period_s']:.3f} s, the highest "
        "periodic hop found, verified"
    )


def hops_table(rows: Mapping[str, Any], asked: int) -> Table:
    """A row for each strategy."""
    heads = ("hops", "kept\nm", "of\nbound", "push\ncm", "timing\ncm", "fold\ncm", "period\ns", "drift\ncm/hop", "impact\nJ", "multi-\nplier")  # fmt: skip
    cells = []
    for name, r in rows.items():
        done, gap = f"{min(r['hops'], asked)}/{asked}", r["gap"]
        if gap is None:
            cells.append([name, done, *["-"] * (len(heads) - 1)])
            continue
        share, stable = r["share_of_bound"], r["stability"]
        cells.append([
            name, done, f"{r['kept_m']:.3f}", "-" if share is None else f"{share:.0%}", *(cm(gap[key]) for key in LOSS_FIGURES),
            f"{r['period_s']:.3f}", cm(r["drift_m_per_hop"]), f"{r['touchdown_loss_J']:.1f}",
            "-" if stable is None else f"{stable['largest_multiplier']:.2g}",
        ])  # fmt: skip
    return table([named("strategy"), *figures(*heads)], cells, between=(0, 1))


def _drawn(name: str, d: Mapping[str, Any]) -> str:
    lowest = f", the lowest of them keeps up {d['lowest_kept_m']:.3f} m" if d["lowest_kept_m"] is not None else ""
    return f"{name}: {d['still_hop']} of {d['draws']} drawn legs still hop after {d['hops']} hops{lowest}"


def _elsewhere(name: str, heights: Sequence[float]) -> str:
    if not heights:
        return f"{name} does not hop in MuJoCo"
    return f"{name} in MuJoCo, {len(heights)} hops: {min(heights):.3f} to {max(heights):.3f} m"


def _basin(name: str, b: Mapping[str, Any]) -> str:
    tried = [x for row in b["hops"] for x in row]
    heights, speeds = b["higher_m"], b["faster_m_s"]
    return (
        f"{name}: comes back from {sum(tried)} of {len(tried)} starts, {100 * heights[0]:+.0f} to {100 * heights[-1]:+.0f} cm "
        f"high and {speeds[0]:+.1f} to {speeds[-1]:+.1f} m/s fast"
    )
