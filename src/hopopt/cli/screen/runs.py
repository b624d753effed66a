"""What the command line shows of simulated strategies: one table, the gaps, and what was not kept."""

import itertools
from collections.abc import Mapping, Sequence
from typing import Any

from rich.markup import escape
from rich.table import Table

from hopopt.cli.screen.console import console, print_table
from hopopt.cli.screen.ladder import cm, print_ladder

ROOM = "; a larger [reserve], of speed above all, leaves it room (docs/simulation.md)"
RESTLESS = 0.05  # of stall torque from one sample to the next, above which a line says so
HALF = 0.5  # of the bound, below which a line says what is in the way
OVERSHOOT = 0.01  # of the clearance, from which on it is worth a line
BRAKED = "force_braked"
GAPS = {"push": "push_m", "timing": "timing_m", "fold": "retraction_m"}
PARTS = ("com_height_at_lift_off_m", "ballistic_rise_m", "com_height_over_lowest_point_m")


def print_comparison(comparison: Mapping[str, Any], where: str) -> None:
    """The bound, the table, the paper's figures, and warnings."""
    rows, out = comparison["strategies"], console()
    out.print(_headline(comparison))
    print_table(out, run_table(rows))
    out.print(
        "push, timing, fold: where the centimetres to the bound are lost (+) or gained (-): height and speed at lift-off, not "
        "at the apex, leg not drawn up as far; C_avg: mean saturation of each joint in stance; ground: largest force"
    )
    for name, row in rows.items():
        if row["no_hop"]:
            out.print(f"{name} does not hop: {row['no_hop']}")
        elif row["share_of_bound"] is not None and row["share_of_bound"] < HALF:
            part, key = max(GAPS.items(), key=lambda item: row["gap"][item[1]])
            lost = f"it loses most by {part}, {100 * row['gap'][key]:.1f} cm"
            out.print(f"{name} clears less than half of the bound: {lost}")
        if (short := row["overshoot_m"]) is not None and short > OVERSHOOT * row["clearance_m"]:
            out.print(f"{name}: {_overshoot(short)}; {BRAKED} follows it without")
    for name, row in rows.items():
        if "paper" in row:
            out.print(_paper(name, row))
    for name, row in rows.items():
        if row["limits_exceeded"]:
            out.print(f"{name} does not keep every limit of the problem: {', '.join(row['limits_exceeded'])}")
        if row["left_early"]:
            out.print(f"{name}: {row['left_early']}; a larger reserve.ground_force keeps it there (docs/simulation.md)")
        if words := _restless(row["feedback_moves"]):
            out.print(f"{name}: {words}")
        if row["cut_short"]:
            out.print(f"{name}: {row['cut_short']}{ROOM if name.startswith('track') else ''}")
    for name, spread in comparison.get("mismatch", {}).items():
        out.print(_spread(name, spread))
    if "four_numbers" in comparison:
        print_table(out, _four(comparison["four_numbers"]))
    print_ladder(out, comparison)
    elsewhere = {name: row["mujoco_clearance_m"] for name, row in rows.items() if "mujoco_clearance_m" in row}
    if elsewhere:
        out.print("in MuJoCo: " + ", ".join(f"{name} {clearance:.3f} m" for name, clearance in elsewhere.items()))
    if comparison["tracked_plan_m"]:
        doubt = "" if comparison["tracked_plan_verified"] else "; it was NOT verified"
        plan = f"a plan of {comparison['tracked_plan_m']:.4f} m, which holds the problem's [reserve] back"
        out.print(f"tracked: {plan}{doubt}")
    for note in comparison["notes"]:
        out.print(note)
    out.print(f"results {where}")


def print_run(row: Mapping[str, Any], where: str) -> None:
    """One strategy's hop."""
    out = console()
    p, lift = row["parts"], row["lift_off"]
    out.print(f"[bold]{escape(row['strategy'])}[/bold]: {escape(row['meaning'])}", markup=True)
    if not row["lift_offs"]:
        out.print(f"  the foot never left the ground; the run ended: {row['outcome']}\n  results {where}")
        return
    out.print(
        f"  clearance {row['clearance_m']:.4f} m = COM height at lift-off {p[PARTS[0]]:.4f} + ballistic rise {p[PARTS[1]]:.4f} "
        f"- COM height over the lowest point {-p[PARTS[2]]:.4f} m; foot at most {row['foot_height_m']:.3f} m"
    )
    out.print(
        f"  lift-off at {lift['time_s']:.4f} s, body at {lift['body_height_m']:.3f} m, {lift['vertical_m_s']:.2f} m/s up and "
        f"{lift['horizontal_m_s']:+.2f} m/s along"
    )
    means = ", ".join(f"{joint} {mean:.0%}" for joint, mean in row["saturation_mean"].items())
    e = row["energy"]
    out.print(
        f"  mean saturation in stance: {means}; work of the motors {e['motors_J']:.1f} J, gained {e['gained_J']:.1f} J, "
        f"gears {e['gears_J']:.1f} J, end stops {e['stops_J']:.1f} J, friction {e['ground_friction_J']:.1f} J (balance closes to {row['energy_error']:.0e})"
    )
    out.print(f"  peak ground force {row['peaks']['ground_force_N']:.0f} N; the run ended: {row['outcome']}")
    if row["no_hop"]:
        out.print(f"  no hop: {row['no_hop']}")
    if (short := row["overshoot_m"]) is not None and short > OVERSHOOT * row["clearance_m"]:
        out.print(f"  {_overshoot(short)}; the strategy {BRAKED} follows it without")
    if row["limits_exceeded"]:
        out.print(f"  limits of the problem not kept: {', '.join(row['limits_exceeded'])}")
    if words := _restless(row["feedback_moves"]):
        out.print(f"  {words}")
    if row["cut_short"]:
        out.print(f"  {row['cut_short']}")
    if row.get("hops", 1) > 1:
        out.print(f"  hops: {_hops(row['touchdowns'])}")
    out.print(f"  results {where}")


def _hops(times: Sequence[float]) -> str:
    periods = [b - a for a, b in itertools.pairwise(times)]
    span = f", {min(periods):.3f} to {max(periods):.3f} s apart" if periods else ""
    return f"{len(times)} landings{span}"


def _headline(c: Mapping[str, Any]) -> str:
    if not c["verified"]:
        return "The optimum was NOT verified: no bound is stated, and no shares of it count."
    if c["beaten_by"]:
        return (
            f"The bound of {c['bound_m']:.4f} m is WRONG: {', '.join(c['beaten_by'])} passed it within the same limits."
        )
    return f"{c['problem']}: the bound is {c['bound_m']:.4f} m, the highest hop found, verified"


def run_table(rows: Mapping[str, Any]) -> Table:
    """A row for each strategy: its clearance, what it misses of the bound and by what, and how it pushed."""
    table = Table(box=None, padding=(0, 1, 0, 0), pad_edge=False)
    table.add_column("strategy", style="bold", no_wrap=True)
    for head in (
        "clears\nm",
        "of\nbound",
        *(f"{part}\ncm" for part in GAPS),
        "C_avg",
        "left\ns",
        "at\nm/s",
        "ground\nN",
    ):
        table.add_column(head, justify="right", no_wrap=True)
    for name, r in rows.items():
        hops, share = not r["no_hop"], r["share_of_bound"]
        table.add_row(
            name,
            f"{r['clearance_m']:.3f}",
            "-" if share is None else f"{share:.0%}",
            *(cm(r["gap"][key]) if hops else "-" for key in GAPS.values()),
            " ".join(f"{mean:.2f}" for mean in r["saturation_mean"].values()),
            f"{r['lift_off']['time_s']:.3f}" if hops else "-",
            f"{r['lift_off']['vertical_m_s']:.2f}" if hops else "-",
            f"{r['peaks']['ground_force_N']:.0f}",
        )
    return table


def _four(found: Mapping[str, Any]) -> Table:
    """What can be had of the optimum."""
    table = Table(box=None, padding=(0, 1, 0, 0), pad_edge=False)
    table.add_column("what can be had", style="bold")
    table.add_column("m", justify="right")
    legs = f"{found['share']:.0%} of the drawn legs (confidence {found['confidence']:.0%})"
    for words, height in (("bound, ideal ground", "ideal_bound_m"), ("bound, this ground", "bound_m")):
        table.add_row(words, "not verified" if found[height] is None else f"{found[height]:.3f}")
    for best in (found["tracked"], found["pd"]):
        if best is not None:
            table.add_row(f"{best['strategy']}, {legs}", f"{best['clearance_m']:.3f}")
    return table


def _overshoot(short: float) -> str:
    return f"its servo overshoots: at the clearance the leg is {100 * short:.1f} cm shorter than its reference y_f"


def _restless(moves: float | None) -> str:
    """What is said of feedback that moves torques by more than a motor should have to follow; empty where it does not."""
    if moves is None or moves <= RESTLESS:
        return ""
    return (
        f"feedback moves a torque by up to {moves:.0%} of stall torque from one sample to the next, more than {RESTLESS:.0%}: "
        "a finer encoder or a larger effort of the tracker moves it less"
    )


def _paper(name: str, r: Mapping[str, Any]) -> str:
    (simulated, measured), (c_simulated, c_measured) = r["paper"]["foot_height_m"], r["paper"]["knee_saturation"]
    knee = list(r["saturation_mean"].values())[1]
    return (
        f"paper, {name}: foot {simulated:.2f} m simulated, {measured:.2f} m measured (here {r['foot_height_m']:.2f}); "
        f"knee C_avg {c_simulated:g} simulated, {c_measured:g} measured (here {knee:.2f})"
    )


def _spread(name: str, s: Mapping[str, Any]) -> str:
    return (
        f"{name}, {s['draws']} legs with masses within {s['mass']:.0%} and torque constants within {s['torque']:.0%}: "
        f"clearance {s['median_m']:.3f} m median, {s['lowest_m']:.3f} to {s['highest_m']:.3f}; {s['failed']} failed{ROOM if s['failed'] else ''}"
    )
