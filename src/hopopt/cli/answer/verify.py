"""The commands that check what is stored again: verify, and repair of what was changed."""

from collections.abc import Iterator
from pathlib import Path

from hopopt import extensions
from hopopt.cli.options import AsJson, Constraints, Own, Solved, ended, note
from hopopt.cli.screen.answer import reached
from hopopt.cli.screen.checks import certificate, checks
from hopopt.cli.screen.console import Shown, as_is
from hopopt.cli.studies.sweep import verify_study
from hopopt.comparison.control_recheck import control_check
from hopopt.errors import UsageError
from hopopt.optimality.certificate import by_entry
from hopopt.planner.checks.verdict import Verdict
from hopopt.planner.solution import Solution
from hopopt.plots.hop import save_all
from hopopt.record import as_data
from hopopt.storage.seal.recheck import recheck, with_functions
from hopopt.storage.seal.repair import repaired
from hopopt.storage.solution import read
from hopopt.verify.check import Condition


def verify(result: Path, *, objective: Own = None, constraint: Constraints = None, json_: AsJson = False) -> int:
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
    """
    if (result / "sweep.json").is_file():
        if objective or constraint:
            raise UsageError("a study takes no user-defined functions: leave out --objective and --constraint")
        return verify_study(result, json_)
    solution = with_functions(read(result), objective, constraint or ())
    verdict = recheck(solution)
    for words in (*solution.doubts, *extensions.doubts(solution.summary.extensions)):
        note(words)
    verdict = verdict.with_checks((), control_check(solution))
    made, code = bool(verdict.conditions), 0 if verdict.verified else 3
    data = {
        "verified": verdict.verified,
        "exit_code": code,
        "checks": [as_data(c) for c in verdict.checks],
        "checks_of_the_file": [as_data(c) for c in verdict.of_file],
        "certified": verdict.certified if made else None,
        "certificate": {name: as_data(c, Condition) for name, c in by_entry(verdict.conditions).items()}
        if made
        else None,
        "second_order": as_data(verdict.second_order),
    }
    return ended(data, json_, shown(solution, verdict), code)


def shown(solution: Solution, verdict: Verdict) -> Iterator[Shown]:
    """All checks, those of the file, the certificate, and what comes of them."""
    yield from checks("the hop, as hopopt solve checks it", verdict.checks)
    yield from checks("the file", verdict.of_file)
    yield from certificate(verdict.conditions, verdict.second_order)
    if verdict.verified:
        yield as_is(f"{solution.result_dir}: verified, {reached(solution.summary)}")
        return
    wrong = [f"{c.name}{f' ({c.where})' if c.where else ''}" for c in verdict.failed]
    stands = all(c.passed for c in verdict.checks) and not [c for c in verdict.of_file[1:] if not c.passed]
    more = "; all that can be computed again is as stated, what only the search knew cannot be" if stands else ""
    yield as_is(f"{solution.result_dir}: NOT verified: {'; '.join(wrong)}{more}")


def repair(result: Solved, *, objective: Own = None, constraint: Constraints = None) -> int:
    """Recompute a result whose files were changed, in a new folder.

    It is written beside the old one; what can be computed is computed again.

    What only the search knew must be as it was written: starts, families, the global method, earlier meshes, and the motion.
    Exit code 2 if that is not so, or if what comes out is not verified. (Of a study, remove the file of a point to have it
    solved again; hopopt sweep --resume FOLDER does, and writes the tables.)
    """
    found = repaired(with_functions(read(result), objective, constraint or ()), save_all)
    print(f"{found.result_dir}: {found.summary.notes[-1]}")
    return 0
