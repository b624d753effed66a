"""The command that says what to change first: sensitivity."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter
from rich.table import Column, Table

from hopopt import amounts
from hopopt.cli.expected_time import ExpectedTime
from hopopt.cli.options import AsJson, Figure, Overrides, Results, Starts, ended
from hopopt.cli.screen.console import Shown, named, progress, table
from hopopt.cli.screen.console import figures as columns
from hopopt.errors import UsageError
from hopopt.planner import solve as planning
from hopopt.planner.solution import Solution
from hopopt.plots.studies.sensitivity import save_all
from hopopt.problem.load import load
from hopopt.storage.folder import fitting, prepare
from hopopt.storage.runs import save_runs
from hopopt.storage.seal.recheck import recheck
from hopopt.storage.solution import read
from hopopt.studies import sensitivity as study
from hopopt.studies.finite_differences import LEADING, chosen, confirmed
from hopopt.studies.influence import Influence

TABLE_ROWS = 16  # of the table
LEAST_SHOWN = 5e-6  # [m], or share of another objective, per per cent, below which an entry is left out of it
CM = 100.0  # [cm/m]
Confirm = Annotated[
    list[str] | None,
    Parameter(
        name="--confirm",
        negative=(),
        consume_multiple=True,
        help="Solve again with the leading five a little larger and smaller; or with all, or with the entries named "
        "(default: those for which more and less differ).",
    ),
]


def sensitivity(
    problem: str | None = None,
    *,
    result: Path | None = None,
    objective: str = "clearance",
    set_: Overrides = None,
    starts: Starts = None,
    confirm: Confirm = None,
    results: Results = Path("results"),
    figures: Figure = True,
    json_: AsJson = False,
) -> int:
    """Say what to change first: what 1 % more of each value brings.

    Exit code: 0 reported for a verified optimum, 1 not solved, 2 wrong usage, 3 not verified: nothing is reported.

    Parameters
    ----------
    problem
        A problem file, or the name of a built-in one (default: paper).
    result
        A folder that hopopt solve wrote, in place of a problem: its optimum is verified again, not solved again.
    objective
        What the hop is made for, as of hopopt solve: clearance, apex, energy, ...
    """
    if result is not None and (problem, set_, starts, objective) != (None, None, None, "clearance"):
        raise UsageError("--result names an optimum that is there: leave out the problem, --set, --objective, --starts")
    if problem is not None and (Path(problem) / "summary.json").is_file():
        raise UsageError(f"{problem} is a result, not a problem: hopopt sensitivity --result {problem}")
    amounts.check("starts", starts)
    prepare(results)
    expected = None
    if result is None:
        parts = {"solve": 1.0, "difference": 2.0 * len(confirm or ())}
        expected = ExpectedTime("sensitivity", load(problem or "paper", set_ or ()), parts)
    with fitting(result) if result else nullcontext(), progress(json_, expected) as say:
        solution, failed = _optimum(problem or "paper", result, objective, set_ or [], starts, say)
        influences = [] if failed else _confirmed(solution, study.sensitivity(solution), confirm, say)
        data: dict[str, Any] = study.as_dict(solution, influences, failed)
        if not failed:
            draw = (lambda folder: save_all(solution, influences, folder)) if figures else None
            data["result_dir"] = str(save_runs("sensitivity", solution.design, data, {}, results, draw))
    return ended(data, json_, shown(data, influences), data["exit_code"])


def _optimum(
    problem: str,
    folder: Path | None,
    objective: str,
    overrides: list[str],
    starts: int | None,
    say: Callable[[str], None],
) -> tuple[Solution, list[str]]:
    """The optimum, stored or solved for, and the checks that it fails."""
    if folder is not None:
        say("verifying")
        solution = read(folder)
        return solution, [*solution.doubts, *recheck(solution).failed_checks]
    solution = planning.solve(load(problem, overrides), objective, starts=starts, progress=say)
    return solution, list(solution.summary.failed_checks)


def _confirmed(
    solution: Solution, influences: list[Influence], wanted: list[str] | None, say: Callable[[str], None]
) -> list[Influence]:
    """The influences, those that are wanted with their finite differences: unless others are named, those at a kink."""
    kinked = [i.name for i in influences if i.kinked and i.part_of is None]
    if wanted is None and not kinked:
        return influences
    names, found = kinked[:LEADING] if wanted is None else chosen(influences, wanted), []
    for i in influences:
        if i.name in names:
            say(f"solving again with a little more and a little less of {i.name}")
        found.append(confirmed(solution, i) if i.name in names else i)
    return found


def shown(data: Mapping[str, Any], influences: Sequence[Influence]) -> Iterator[Shown]:
    """The optimum, the leading entries, what to change first, and how well the figures are known."""
    if data["failed_checks"]:
        yield f"{data['problem']}: the optimum was NOT verified, so nothing is reported about what it depends on."
        yield f"Failed: {', '.join(data['failed_checks'])}"
        return
    least, unit = least_shown(data), data["objective_unit"]
    what, reached = (
        "body apex" if data["objective"] == "apex" else data["objective"].replace("_", " "),
        data["objective_value"],
    )
    value = f"{reached:.4f} m" if unit == "m" else f"{reached:.5g} {unit}"
    yield f"{data['problem']}: {what} {value}, verified. What 1 % more of the value of an entry would change:"
    rows = _in_the_table(influences, least)
    yield _table(influences, rows)
    if at := next((i for i in influences if i.kinked), None):
        yield f"Limits trade places at this optimum, so that more and less of an entry differ: {'; '.join(at.between)}."
    if any(i.part_of for i in rows):
        yield "Indented: what one joint has of an entry that the whole leg shares."
    yield from left_out(influences, least)
    if data["lengths_left_out"]:
        yield "Lengths are left out: shapes of links are numbers here, and do not follow them. Sweep a length to see what it is worth."
    yield from sentences(influences, least)
    zero = [i for i in influences if not i.value and abs(i.per_unit) > 1e-6]  # there is no per cent of it
    if zero:
        each = ", ".join(f"{i.name} {i.per_unit:+.3g} {unit} per {i.unit}" for i in zero)
        yield f"At 0 now, so by the unit: {each}"
    yield (
        f"From the multipliers of the optimum, as long as the same limits stay active. The {what} depends on the mesh "
        f"within {data['settled_within']:.0e} {unit}, on the tie-break within {data['tie_break_bias']:.0e} {unit}; "
        "what its mesh makes of each derivative is estimated behind it (--confirm solves again)."
    )
    yield f"results {data['result_dir']}"


def _table(influences: Sequence[Influence], rows: Sequence[Influence]) -> Table:
    again, kinked = any(i.difference for i in influences), any(i.kinked for i in influences)
    sides = ["1 % more gives", *(["1 % less gives"] if kinked else []), f"{influences[0].objective_unit} per unit"]
    heads = [Column(head, justify="right") for head in (*sides, *(["solved again"] if again else []))]
    cells = []
    for i in rows:
        row = [f"  {i.name}" if i.part_of else i.name, f"{i.value:g} {i.unit}".removesuffix(" 1")]
        row += [_amount(i, i.per_percent, "+"), *([_amount(i, i.per_percent_less, "+")] if kinked else [])]
        row += [f"{i.per_unit:+.4g}" + (f", {i.less_per_unit:+.4g}" if i.kinked else "")]
        row[-1] += f" ± {i.error_per_unit:.1g}" if i.error_per_unit else ""
        if again:
            d = i.difference
            found = "" if d is None or d.fault or i.kinked else f"{d.central:+.4g}"
            row += [found, "" if d is None else d.verdict(i.per_unit, i.less_per_unit)]
        cells.append(row)
    return table([named("entry"), *columns("value"), *heads, *([""] if again else [])], cells)


def _amount(i: Influence, change: float, sign: str = "") -> str:
    """A change of the objective, of a height in centimetres."""
    return f"{CM * change:{sign}.3f} cm" if i.objective_unit == "m" else f"{change:{sign}.3g} {i.objective_unit}"


def least_shown(data: Mapping[str, Any]) -> float:
    """What an entry has to change per per cent to be shown [the objective's unit]."""
    return LEAST_SHOWN * (1.0 if data["objective_unit"] == "m" else abs(data["objective_value"]))


def _in_the_table(influences: Sequence[Influence], least: float) -> list[Influence]:
    return [i for k, i in enumerate(influences) if (k < TABLE_ROWS and i.most >= least) or i.difference]


def left_out(influences: Sequence[Influence], least: float = LEAST_SHOWN) -> list[str]:
    """How many entries that matter have no row."""
    shown = _in_the_table(influences, least)
    count = sum(i.most >= least and i not in shown for i in influences)
    return [f"({count} more that matter less: --json)"] if count > 0 else []


def sentences(influences: Sequence[Influence], least: float = LEAST_SHOWN) -> list[str]:
    """What to change first: of the leg, of the joints apart, and of what the hop is asked to be."""
    gains = [i for i in influences if i.best >= least]
    if any(i.kinked for i in influences):  # they are ranked by their larger side, which may be a loss
        gains.sort(key=lambda i: -i.best)
    first = next((i for i in gains if i.of_leg), None)
    if first is None:
        return ["No entry of the leg makes it better to first order."]
    lines = [f"What to change first: {_advice(first)}."]
    for whole in influences:
        parts = [i for i in gains if i.part_of == whole.name]
        if len({_up(i) for i in parts}) > 1:
            lines.append(f"{whole.name} pulls both ways, give the joints their own: {'; '.join(map(_advice, parts))}.")
    asked = next((i for i in gains if not i.of_leg), None)
    return lines + ([f"Of what the hop is asked to be: {_advice(asked)}."] if asked else [])


def _up(i: Influence) -> bool:
    """Whether more of it is the better way."""
    return (i.per_percent >= i.per_percent_less) == i.maximize


def _advice(i: Influence) -> str:
    """leg.gear.ratio 1 % down, from 100 to 99, gains 0.24 cm"""
    up = _up(i)
    to = i.value * (1.01 if up else 0.99)
    unit = "" if i.unit == "1" else f" {i.unit}"
    size = "1 % more" if up else "1 % less"
    gains = (
        f"gains {CM * i.best:.2f} cm"
        if i.objective_unit == "m"
        else f"{'gains' if i.maximize else 'saves'} {_amount(i, i.best)}"
    )
    return f"{i.name} {size}, from {i.value:g} to {to:.4g}{unit}, {gains}"
