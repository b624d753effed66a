"""What the command line shows of strategies that hop on and on."""

from collections.abc import Mapping, Sequence
from typing import Any

from rich.table import Table

from hopopt.cli.screen.console import console, print_table
from hopopt.cli.screen.ladder import print_ladder

SPEED = 0.05  # [m/s] by which a mean speed may differ from what is asked without a word
GAPS = ("push_m", "timing_m", "retraction_m")
ROOM = "a softer landing (hop.touchdown_loss) or a larger reserve.ground_force leaves it room (docs/periodic.md)"


def print_hops(data: Mapping[str, Any], where: str) -> None:
    """The bound, the table, who fell and why, and what limits were not kept."""
    out, rows = console(), data["strategies"]
    out.print(_headline(data))
    print_table(out, hops_table(rows, data["hops"]))
    out.print(
        f"kept: lowest clearance of the second half of {data['hops']} hops; push, timing, fold: where the centimetres to the "
        "bound are lost; multiplier: by which errors grow from hop to hop (Floquet), below 1 they die out"
    )
    for name, row in rows.items():
        if row["fell"]:
            hint = f"; {ROOM}" if name.startswith("track") else ""
            out.print(f"{name} fell after {row['hops']} hops: {row['fell']}{hint}")
        if row["limits_exceeded"]:
            out.print(f"{name} does not keep every limit of the problem: {', '.join(row['limits_exceeded'])}")
    for name, row in rows.items():
        if row["drawn"]:
            out.print(_drawn(name, row["drawn"]))
        if row["basin"]:
            out.print(_basin(name, row["basin"]))
        if row["mujoco_clearances_m"] is not None:
            out.print(_elsewhere(name, row["mujoco_clearances_m"]))
        if (speed := _speed(row)) is not None and abs(speed - data["speed_m_s"]) > SPEED:
            out.print(f"{name} moves at {speed:+.2f} m/s on average; the bound is for {data['speed_m_s']:g} m/s")
    print_ladder(out, data)
    if data["tracked_plan_m"]:
        doubt = "" if data["tracked_plan_verified"] else "; it was NOT verified"
        high = f"tracking begins {100 * data['start_offset_m']:g} cm above its apex"
        out.print(
            f"tracked: a plan of {data['tracked_plan_m']:.4f} m with the problem's [reserve] held back; {high}{doubt}"
        )
    for note in data["notes"]:
        out.print(note)
    out.print(f"results {where}")


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
    table = Table(box=None, padding=(0, 1, 0, 0), pad_edge=False)
    table.add_column("strategy", style="bold", no_wrap=True)
    heads = ("hops", "kept\nm", "of\nbound", "push\ncm", "timing\ncm", "fold\ncm", "period\ns", "drift\ncm/hop", "impact\nJ", "multi-\nplier")  # fmt: skip
    for head in heads:
        table.add_column(head, justify="right", no_wrap=True)
    for name, r in rows.items():
        done, gap = f"{min(r['hops'], asked)}/{asked}", r["gap"]
        if gap is None:
            table.add_row(name, done, *["-"] * (len(heads) - 1))
            continue
        share, stable = r["share_of_bound"], r["stability"]
        table.add_row(
            name, done, f"{r['kept_m']:.3f}", "-" if share is None else f"{share:.0%}",
            *(f"{round(100 * gap[key], 1) or 0:+.1f}" for key in GAPS),
            f"{r['period_s']:.3f}", f"{round(100 * r['drift_m_per_hop'], 1) or 0:+.1f}", f"{r['touchdown_loss_J']:.1f}",
            "-" if stable is None else f"{stable['largest_multiplier']:.2g}",
        )  # fmt: skip
    return table


def _drawn(name: str, d: Mapping[str, Any]) -> str:
    lowest = f", the lowest of them keeps up {d['lowest_kept_m']:.3f} m" if d["lowest_kept_m"] is not None else ""
    return f"{name}: {d['still_hop']} of {d['draws']} drawn legs still hop after {d['hops']} hops{lowest}"


def _speed(row: Mapping[str, Any]) -> float | None:
    return row["drift_m_per_hop"] / row["period_s"] if row["period_s"] else None


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
