"""The command that identifies the paper's motor from its figures: calibrate."""

from pathlib import Path
from typing import Annotated

from hopopt import amounts
from hopopt.cli.options import AsJson, Overrides, Problem, ended, repeated
from hopopt.cli.screen.console import as_is, progress
from hopopt.errors import UsageError
from hopopt.paper import fit as calibrating
from hopopt.paper.experiment import MOTOR, parse_free
from hopopt.paper.problem_file import write_motor
from hopopt.paper.result import text
from hopopt.problem.load import load

Frees = Annotated[
    list[str] | None,
    repeated(
        "--free",
        "Free another value too: leg.motor.rotor_inertia=0:3e-5, k_p=100:9000, position.k_p=100:9000 (repeat).",
    ),
]


def calibrate(
    problem: Problem = "paper",
    *,
    set_: Overrides = None,
    free: Frees = None,
    write: bool = False,
    processes: int | None = None,
    json_: AsJson = False,
) -> int:
    """Find the motor from the jump heights that the paper reports.

    And from its saturations; with how well they determine the motor.

    Parameters
    ----------
    write
        Put the values into the problem file; refused if they are not determined.
    processes
        How many simulations side by side (default: one for each core).
    """
    design = load(problem, set_ or ())
    amounts.check_processes(processes)
    if write and not Path(problem).is_file():
        raise UsageError(f"--write changes a problem file: give its path, not the name {problem}")
    if write and set_:
        raise UsageError("--write and --set do not go together: the file would not be the problem that was fitted")
    values = (*MOTOR, *(parse_free(words) for words in free or ()))
    with progress(quiet=json_) as say:
        found = calibrating.calibrate(design, free=values, processes=processes, progress=say)
    code = ended({**found.as_dict(), "exit_code": 0}, json_, [as_is(text(found))])
    if write:
        write_motor(Path(problem), found)
    return code
