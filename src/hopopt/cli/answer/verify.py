"""The commands that check what is stored again: verify, and repair of what was changed."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING

from hopopt.cli.options import AsJson, Constraints
from hopopt.errors import UsageError

if TYPE_CHECKING:
    from hopopt.planner.checks.verdict import Verdict
    from hopopt.planner.solution import Solution


def verify(result: Path, *, objective: str | None = None, constraint: Constraints = None, json_: AsJson = False) -> int:
    """Check a stored result again, from its files alone.

    Exit code: 0 verified, 2 wrong usage, 3 not verified.

    The checks of the hop are those that hopopt solve made; those of the file say that its parts belong together and are as they
    were written. What was changed is named, and nothing is written: hopopt repair does that. The certificate of first-order
    optimality (docs/certificate.md) is recomputed too, and said to hold or not. Of a study every solved point is refined and
    checked again.

    Parameters
    ----------
    result
        A folder that hopopt solve or hopopt sweep wrote.
    objective
        The function of your own that it was found with, if it was: module:function.
    """
    if (result / "sweep.json").is_file():
        from hopopt.cli.studies.sweep import verify_study

        if objective or constraint:
            raise UsageError("a study takes no user-defined functions: leave out --objective and --constraint")
        return verify_study(result, json_)
    from hopopt.comparison.control_recheck import control_check
    from hopopt.storage.seal.recheck import recheck, with_functions
    from hopopt.storage.solution import read

    solution = with_functions(read(result), objective, constraint or ())
    for words in solution.doubts:
        print(f"hopopt: {words}", file=sys.stderr)
    verdict = recheck(solution)
    verdict = verdict.with_checks((), control_check(solution))
    if json_:
        _print_json(verdict)
    else:
        _print(solution, verdict)
    return 0 if verdict.verified else 3


def _print_json(verdict: "Verdict") -> None:
    from hopopt.optimality.certificate import by_entry
    from hopopt.record import as_data
    from hopopt.storage.folder import as_json
    from hopopt.verify.check import Condition

    made = bool(verdict.conditions)
    print(
        as_json(
            {
                "verified": verdict.verified,
                "exit_code": 0 if verdict.verified else 3,
                "checks": [as_data(c) for c in verdict.checks],
                "checks_of_the_file": [as_data(c) for c in verdict.of_file],
                "certified": verdict.certified if made else None,
                "certificate": {name: as_data(c, Condition) for name, c in by_entry(verdict.conditions).items()}
                if made
                else None,
                "second_order": as_data(verdict.second_order),
            }
        )
    )


def _print(solution: "Solution", verdict: "Verdict") -> None:
    from hopopt.cli.screen.answer import reached
    from hopopt.cli.screen.certificate import print_certificate
    from hopopt.cli.screen.console import print_checks

    print_checks("the hop, as hopopt solve checks it", verdict.checks)
    print_checks("the file", verdict.of_file)
    print_certificate(verdict.conditions, verdict.second_order)
    if verdict.verified:
        print(f"{solution.result_dir}: verified, {reached(solution.summary)}")
        return
    wrong = [f"{c.name}{f' ({c.where})' if c.where else ''}" for c in verdict.failed]
    stands = all(c.passed for c in verdict.checks) and not [c for c in verdict.of_file[1:] if not c.passed]
    more = "; all that can be computed again is as stated, what only the search knew cannot be" if stands else ""
    print(f"{solution.result_dir}: NOT verified: {'; '.join(wrong)}{more}")


def repair(result: Path, *, objective: str | None = None, constraint: Constraints = None) -> int:
    """Recompute a result whose files were changed, in a new folder.

    It is written beside the old one; what can be computed is computed again.

    What only the search knew must be as it was written: starts, families, the global method, earlier meshes, and the motion.
    Exit code 2 if that is not so, or if what comes out is not verified. (Of a study, remove the file of a point to have it
    solved again; hopopt sweep --resume FOLDER does, and writes the tables.)

    Parameters
    ----------
    result
        A folder that hopopt solve wrote.
    objective
        The function of your own that it was found with, if it was: module:function.
    """
    from hopopt.plots.hop import save_all
    from hopopt.storage.seal.recheck import with_functions
    from hopopt.storage.seal.repair import repaired
    from hopopt.storage.solution import read

    found = repaired(with_functions(read(result), objective, constraint or ()), save_all)
    print(f"{found.result_dir}: {found.summary.notes[-1]}")
    return 0
