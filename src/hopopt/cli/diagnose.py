"""The command that says what a stored hop leaves open."""

from pathlib import Path

from hopopt.cli.options import AsJson, Constraints, progress


def diagnose(
    result: Path, *, objective: str | None = None, constraint: Constraints = None, json_: AsJson = False
) -> int:
    """Say what a stored hop leaves open: motions and durations the objective does not depend on, limits that never act.

    Parameters
    ----------
    result
        A folder that hopopt solve wrote.
    objective
        The function of your own that it was found with, if it was: module:function.
    """
    from hopopt.storage.folder import as_json, fitting
    from hopopt.storage.recheck import with_functions
    from hopopt.storage.solution import read
    from hopopt.studies import diagnosis

    with fitting(result), progress(quiet=json_) as say:
        say("moving the durations, all else solved anew")
        found = diagnosis.diagnose(with_functions(read(result), objective, constraint or ()))
    if json_:
        print(as_json(found))
        return 0
    from hopopt.cli.screen.console import console

    for line in found["words"]:
        console().print(line)
    return 0
