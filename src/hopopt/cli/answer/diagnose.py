"""The command that says what a stored hop leaves open: diagnose."""

from typing import Annotated

from hopopt.cli.options import AsJson, Constraints, Flag, Own, Solved, ended
from hopopt.cli.screen.console import progress
from hopopt.evidence import diagnosis
from hopopt.evidence.worth import worths
from hopopt.storage.folder import fitting
from hopopt.storage.seal.recheck import with_functions
from hopopt.storage.solution import read


def diagnose(
    result: Solved,
    *,
    worth: Annotated[bool, Flag] = False,
    objective: Own = None,
    constraint: Constraints = None,
    json_: AsJson = False,
) -> int:
    """Say what in a stored hop does not matter: times, motions, limits.

    Those are motions and durations that the objective does not depend on, and limits that never act.

    Parameters
    ----------
    worth
        Solve again without each thing that the hop leans on and no robot has, such as a foot held without load.
    """
    with fitting(result), progress(quiet=json_) as say:
        say("moving the durations, all else solved anew")
        solution = with_functions(read(result), objective, constraint or ())
        found = diagnosis.diagnose(solution)
        if worth:
            leaning, unit = worths(solution, say), solution.summary.objective_unit
            found["leans_on"] = [w.as_dict() for w in leaning]
            found["words"] += [w.words(unit) for w in leaning]
            if not any(w.leans for w in leaning):
                found["words"].append("leans on nothing that a robot does not have")
    return ended(found, json_, found["words"])
