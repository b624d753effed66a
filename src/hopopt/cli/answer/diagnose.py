"""The command that says what a stored hop leaves open."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from hopopt.cli.options import AsJson, Constraints, progress


def diagnose(
    result: Path,
    *,
    worth: Annotated[bool, Parameter(negative=())] = False,
    objective: str | None = None,
    constraint: Constraints = None,
    json_: AsJson = False,
) -> int:
    """Say what in a stored hop does not matter: times, motions, limits.

    Those are motions and durations that the objective does not depend on, and limits that never act.

    Parameters
    ----------
    result
        A folder that hopopt solve wrote.
    worth
        Solve again without each thing that the hop leans on and no robot has, such as a foot held without load.
    objective
        The function of your own that it was found with, if it was: module:function.
    """
    from hopopt.evidence import diagnosis
    from hopopt.storage.folder import as_json, fitting
    from hopopt.storage.seal.recheck import with_functions
    from hopopt.storage.solution import read

    with fitting(result), progress(quiet=json_) as say:
        say("moving the durations, all else solved anew")
        solution = with_functions(read(result), objective, constraint or ())
        found = diagnosis.diagnose(solution)
        if worth:
            from hopopt.evidence.worth import worths

            leaning, unit = worths(solution, say), solution.summary.objective_unit
            found["leans_on"] = [w.as_dict() for w in leaning]
            found["words"] += [w.words(unit) for w in leaning]
            if not any(w.leans for w in leaning):
                found["words"].append("leans on nothing that a robot does not have")
    if json_:
        print(as_json(found))
        return 0
    from hopopt.cli.screen.console import console

    for line in found["words"]:
        console().print(line)
    return 0
