"""What the command line shows of simulated strategies: one table, the gaps, and what was not kept."""

import itertools
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from rich.markup import escape
from rich.table import Column, Table

from hopopt.cli.screen.console import Shown, figures, marked, named, table

RESERVE_ADVICE = "; a larger [reserve], of speed above all, leaves it room (docs/robust.md)"
RESTLESS = 0.05  # of stall torque from one sample to the next, above which a line says so
LOW_SHARE = 0.5  # of the bound, below which a line says what is in the way
OVERSHOOT = 0.01  # of the clearance, from which on it is worth a line
BRAKED = "force_braked"
LOSS_FIGURES = {"push": "push_m", "timing": "timing_m", "fold": "retraction_m"}
HEIGHT_PARTS = ("com_height_at_lift_off_m", "ballistic_rise_m", "com_height_over_lowest_point_m")


def comparison(found: Mapping[str, Any]) -> Iterator[Shown]:
    """The bound, the table, the paper's figures, and warnings."""
    rows = found["strategies"]
    yield _headline(found)
    yield run_table(rows)
    yield (
        "push, timing, fold: where the centimetres to the bound are lost (+) or gained (-): height and speed at lift-off, not "
        "at the apex, leg not drawn up as far; C_avg: mean saturation of each joint in stance; ground: largest force"
    )
    for name, row in rows.items():
        yield from _in_the_way(name, row)
    yield from (_paper(name, row) for name, row in rows.items() if "paper" in row)
    for name, row in rows.items():
        yield from not_kept(name, row)
        if row["left_early"]:
            yield f"{name}: {row['left_early']}; a larger reserve.ground_force keeps it there (docs/robust.md)"
        if words := _restless(row["feedback_moves"]):
            yield f"{name}: {words}"
        if row["cut_short"]:
            yield f"{name}: {row['cut_short']}{RESERVE_ADVICE if name.startswith('track') else ''}"
    yield from (_spread(name, spread) for name, spread in found.get("mismatch", {}).items())
    if "four_numbers" in found:
        yield _four(found["four_numbers"])
    yield from _gap_steps(found)
    yield from ladder(found)
    elsewhere = {name: row["mujoco_clearance_m"] for name, row in rows.items() if "mujoco_clearance_m" in row}
    if elsewhere:
        yield "in MuJoCo: " + ", ".join(f"{name} {clearance:.3f} m" for name, clearance in elsewhere.items())
    if found["tracked_plan_m"]:
        doubt = "" if found["tracked_plan_verified"] else "; it was NOT verified"
        yield f"tracked: a plan of {found['tracked_plan_m']:.4f} m, which holds the problem's [reserve] back{doubt}"
    yield from found["notes"]
    yield results(found)


def not_kept(name: str, row: Mapping[str, Any]) -> Iterator[Shown]:
    """Which limits of the problem a strategy does not keep."""
    if row["limits_exceeded"]:
        yield f"{name} does not keep every limit of the problem: {', '.join(row['limits_exceeded'])}"


def results(found: Mapping[str, Any]) -> str:
    """Where it all lies, and how long it took."""
    took = f"   ({found['wall_s']:.1f} s)" if "wall_s" in found else ""
    return f"results {found['result_dir']}{took}"


def run(row: Mapping[str, Any]) -> Iterator[Shown]:
    """One strategy's hop."""
    p, lift = row["parts"], row["lift_off"]
    yield marked(f"[bold]{escape(row['strategy'])}[/bold]: {escape(row['meaning'])}")
    if not row["lift_offs"]:
        yield f"  the foot never left the ground; the run ended: {row['outcome']}\n  results {row['result_dir']}"
        return
    yield (
        f"  clearance {row['clearance_m']:.4f} m = COM height at lift-off {p[HEIGHT_PARTS[0]]:.4f} + ballistic rise {p[HEIGHT_PARTS[1]]:.4f} "
        f"- COM height over the lowest point {-p[HEIGHT_PARTS[2]]:.4f} m; foot at most {row['foot_height_m']:.3f} m"
    )
    yield (
        f"  lift-off at {lift['time_s']:.4f} s, body at {lift['body_height_m']:.3f} m, {lift['vertical_m_s']:.2f} m/s up and "
        f"{lift['horizontal_m_s']:+.2f} m/s along"
    )
    means, e = ", ".join(f"{joint} {mean:.0%}" for joint, mean in row["saturation_mean"].items()), row["energy"]
    yield (
        f"  mean saturation in stance: {means}; work of the motors {e['motors_J']:.1f} J, gained {e['gained_J']:.1f} J, "
        f"gears {e['gears_J']:.1f} J, end stops {e['stops_J']:.1f} J, friction {e['ground_friction_J']:.1f} J (balance closes to {row['energy_error']:.0e})"
    )
    yield f"  peak ground force {row['peaks']['ground_force_N']:.0f} N; the run ended: {row['outcome']}"
    if row["no_hop"]:
        yield f"  no hop: {row['no_hop']}"
    if (short := row["overshoot_m"]) is not None and short > OVERSHOOT * row["clearance_m"]:
        yield f"  {_overshoot(short)}; the strategy {BRAKED} follows it without"
    if words := row.get("limited_by"):
        yield f"  {words}"
    if row["limits_exceeded"]:
        yield f"  limits of the problem not kept: {', '.join(row['limits_exceeded'])}"
    if words := _restless(row["feedback_moves"]):
        yield f"  {words}"
    if row["cut_short"]:
        yield f"  {row['cut_short']}"
    if row.get("hops", 1) > 1:
        yield f"  hops: {_hops(row['touchdowns'])}"
    yield f"  results {row['result_dir']}"


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


def _in_the_way(name: str, row: Mapping[str, Any]) -> Iterator[Shown]:
    """Why a strategy does not hop, or clears little; and by how much its servo overshoots."""
    if row["no_hop"]:
        yield f"{name} does not hop: {row['no_hop']}"
    elif row["share_of_bound"] is not None and row["share_of_bound"] < LOW_SHARE:
        part, key = max(LOSS_FIGURES.items(), key=lambda item: row["gap"][item[1]])
        yield f"{name} clears less than half of the bound: it loses most by {part}, {100 * row['gap'][key]:.1f} cm"
    if (short := row["overshoot_m"]) is not None and short > OVERSHOOT * row["clearance_m"]:
        yield f"{name}: {_overshoot(short)}; {BRAKED} follows it without"
    if words := row.get("limited_by"):
        yield f"{name}: {words}"


def run_table(rows: Mapping[str, Any]) -> Table:
    """A row for each strategy: its clearance, what it misses of the bound and by what, and how it pushed."""
    heads = (
        "clears\nm",
        "of\nbound",
        *(f"{part}\ncm" for part in LOSS_FIGURES),
        "C_avg",
        "left\ns",
        "at\nm/s",
        "ground\nN",
    )
    cells = []
    for name, r in rows.items():
        lift, share = None if r["no_hop"] else r["lift_off"], r["share_of_bound"]
        cells.append([
            name,
            f"{r['clearance_m']:.3f}",
            "-" if share is None else f"{share:.0%}",
            *(cm(r["gap"][key]) if lift else "-" for key in LOSS_FIGURES.values()),
            " ".join(f"{mean:.2f}" for mean in r["saturation_mean"].values()),
            f"{lift['time_s']:.3f}" if lift else "-",
            f"{lift['vertical_m_s']:.2f}" if lift else "-",
            f"{r['peaks']['ground_force_N']:.0f}",
        ])  # fmt: skip
    return table([named("strategy"), *figures(*heads)], cells, between=(0, 1))


def _four(found: Mapping[str, Any]) -> Table:
    """What can be had of the optimum."""
    legs = f"{found['share']:.0%} of the drawn legs (confidence {found['confidence']:.0%})"
    rows = []
    for words, key in (("bound, ideal ground", "ideal_bound_m"), ("bound, this ground", "bound_m")):
        rows.append((words, "not verified" if found[key] is None else f"{found[key]:.3f}"))
    for best in (found["tracked"], found["pd"]):
        if best is not None:
            rows.append((f"{best['strategy']}, {legs}", f"{best['clearance_m']:.3f}"))
    columns = [Column("what can be had", style="bold"), Column("m", justify="right")]
    return table(columns, rows, between=(0, 1))


def _gap_steps(found: Mapping[str, Any]) -> Iterator[Shown]:
    """What feedback takes of the gap and what the reference takes, in a line, if they can be told apart."""
    if steps := found.get("gap_steps"):
        parts = [f"{s['gives_up']} {cm(-s['costs_m'])} cm ({s['reaches']} {s['clearance_m']:.3f} m)" for s in steps]
        yield f"from the bound of {found['bound_m']:.3f} m down: {', '.join(parts)}"


def ladder(found: Mapping[str, Any]) -> Iterator[Shown]:
    """Why PD control is lower, one freedom a row, if the comparison has it."""
    if "ladder" not in found:
        return
    start = found["ladder_from"]
    rows = [[f"{start['strategy']}, simulated", f"{start['clearance_m']:.3f}", "", "", ""]]
    for rung in found["ladder"]:
        span = f"{cm(rung['least_gain_m'])} to {cm(rung['most_gain_m'])}"
        doubt = "" if rung["verified"] else "not verified"
        rows.append([rung["allows"], f"{rung['clearance_m']:.3f}", cm(rung["gain_m"]), span, doubt])
    heads = ("clears\nm", "gain\ncm", "orders\ncm", "")
    yield table([named("why PD is lower"), *figures(*heads)], rows, between=(0, 1))
    yield (
        f"orders: the least and the most that a freedom gains in {len(found['ladder_orders'])} orders of lifting "
        "them; the gains of each sum to the whole gap"
    )
    if beyond := found.get("ladder_beyond"):
        yield from _beyond(start, beyond)
    if missing := found.get("ladder_missing"):
        yield f"beyond the bound: no optimum was found with {missing}, so what that costs, and what comes after it, is not told"


def _beyond(start: Mapping[str, Any], beyond: Sequence[Mapping[str, Any]]) -> Iterator[Shown]:
    """What holds down PD control and the bound alike, each lifted with those before it, and the gap without these."""
    name, rows = start["strategy"], []
    for lifted in beyond:
        doubt = "" if lifted["verified"] else "not verified"
        bound = f"{lifted['bound_m']:.3f}", cm(lifted["bound_gains_m"])
        rows.append([lifted["lifts"], *bound, f"{lifted['strategy_m']:.3f}", cm(lifted["strategy_gains_m"]), doubt])
    heads = ("bound\nm", "gain\ncm", f"{name}\nm", "gain\ncm", "")
    yield table([named("beyond the bound"), *figures(*heads)], rows, between=(0, 1))
    for lifted in beyond:
        if lifted.get("no_hop"):
            yield f"{name} with {lifted['lifts']} does not hop: {lifted['no_hop']}"
        if lifted.get("limits_exceeded"):
            yield f"{name} with {lifted['lifts']} does not keep every limit: {', '.join(lifted['limits_exceeded'])}"
    gap = beyond[-1]["bound_m"] - beyond[-1]["strategy_m"]
    doubt = "" if beyond[-1]["verified"] else ", to a bound that is not verified"
    left = "" if beyond[-1].get("no_hop") else f"; without these the gap is {100 * gap:.1f} cm{doubt}"
    yield f"what holds down both, each lifted with those above it{left}"


def cm(gap: float) -> str:
    """A difference [m] in centimetres, signed."""
    return f"{round(100 * gap, 1) or 0:+.1f}"


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
        f"clearance {s['median_m']:.3f} m median, {s['lowest_m']:.3f} to {s['highest_m']:.3f}; {s['failed']} failed{RESERVE_ADVICE if s['failed'] else ''}"
    )
