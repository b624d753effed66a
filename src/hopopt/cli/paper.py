"""Commands about the paper: its motor identified from its figures, and its strategies with the best gains."""

from pathlib import Path
from typing import Annotated

from hopopt import amounts
from hopopt.cli.options import AsJson, Overrides, progress, repeated
from hopopt.errors import UsageError

Frees = Annotated[
    list[str] | None,
    repeated(
        "--free",
        "Free another value too: leg.motor.rotor_inertia=0:3e-5, k_p=100:9000, position.k_p=100:9000 (repeat).",
    ),
]


def calibrate(
    problem: str = "paper",
    *,
    set_: Overrides = None,
    free: Frees = None,
    write: bool = False,
    processes: int | None = None,
    json_: AsJson = False,
) -> int:
    """Identify the motor from the paper's jump heights and saturations, and say how well they determine it.

    Parameters
    ----------
    problem
        A problem file, or the name of a built-in one.
    write
        Put the values into the problem file; refused if they are not determined.
    processes
        How many simulations side by side (default: one for each core).
    """
    from hopopt.problem.load import load

    design = load(problem, set_ or ())
    amounts.check_processes(processes)
    if write and not Path(problem).is_file():
        raise UsageError(f"--write changes a problem file: give its path, not the name {problem}")
    if write and set_:
        raise UsageError("--write and --set do not go together: the file would not be the problem that was fitted")
    from hopopt.storage.folder import as_json
    from hopopt.studies.calibration import fit as calibrating
    from hopopt.studies.calibration.experiment import MOTOR, parse_free
    from hopopt.studies.calibration.problem_file import write_motor
    from hopopt.studies.calibration.result import text

    values = (*MOTOR, *(parse_free(words) for words in free or ()))
    with progress(quiet=json_) as say:
        found = calibrating.calibrate(design, free=values, processes=processes, progress=say)
    print(as_json({**found.as_dict(), "exit_code": 0}) if json_ else text(found))
    if write:
        write_motor(Path(problem), found)
    return 0


def tune(
    problem: str = "paper",
    *,
    set_: Overrides = None,
    strategy: str = "force,position",
    evaluations: int = 60,
    seed: int = 0,
    processes: int | None = None,
    json_: AsJson = False,
) -> int:
    """Tune the paper's PD strategies for the greatest clearance on the simulator.

    Every limit of the problem that a hop does not keep counts as 0.05 m less.

    Parameters
    ----------
    problem
        A problem file, or the name of a built-in one.
    strategy
        Which to tune, separated by commas: force, position.
    evaluations
        How many hops to simulate for each.
    seed
        Seed of the search; the same seed gives the same gains.
    processes
        How many simulations side by side (default: one for each core).
    """
    from hopopt.problem.load import load

    design = load(problem, set_ or ())
    amounts.check("evaluations", evaluations)
    amounts.check_processes(processes)
    from hopopt.storage.folder import as_json
    from hopopt.studies import gain_tuning as gain_study

    names = list(dict.fromkeys(name.strip() for name in strategy.split(",") if name.strip()))
    gain_study.check_search(design, names, evaluations, seed)  # all of them, before the first
    with progress(quiet=json_) as say:
        found = [
            gain_study.tune(design, name, evaluations=evaluations, seed=seed, processes=processes, progress=say)
            for name in names
        ]
    if json_:
        print(as_json({"problem": design.name, "seed": seed, "strategies": {t.strategy: t.as_dict() for t in found}}))
    else:
        print(gain_study.text(found))
    return 0


def reproduce(problem: str = "paper", *, set_: Overrides = None, json_: AsJson = False) -> int:
    """Print the figures of the paper's results beside the simulation's, as a Markdown table.

    Parameters
    ----------
    problem
        A problem file, or the name of a built-in one.
    """
    from hopopt.problem.load import load

    design = load(problem, set_ or ())
    from dataclasses import asdict

    from hopopt.control.closed_loop import simulate
    from hopopt.control.strategies import find
    from hopopt.storage.folder import as_json
    from hopopt.studies.paper_results import is_the_papers, markdown, paper_results

    force, *others = (simulate(design, find(name)).figures for name in ("force", "position", "position_soft"))
    names = ("position with force's k_p", "position_soft")
    columns = {name: paper_results(force, position) for name, position in zip(names, others, strict=True)}
    if json_:
        data = {name: [asdict(row) for row in rows] for name, rows in columns.items()}
        print(as_json({"problem": design.name, "the_papers_leg": is_the_papers(design.leg), "figures": data}))
    else:
        if not is_the_papers(design.leg):
            print(
                f"{design.name}: guides, body, links or joint axes are not the paper's, so its figures do not apply.\n"
            )
        print(markdown(columns))
    return 0
