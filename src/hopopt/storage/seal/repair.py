"""A stored result whose files were changed, written anew: what can be computed is computed again, the rest must be as it was.

What only the search knew cannot be computed from the motion: its starts, families, global method, cross-checks, earlier
meshes, times; and the motion itself. Where such an entry was changed, nothing is written.
"""

from collections.abc import Sequence

from hopopt.errors import ResultError
from hopopt.nlp.refinement.mesh_step import change_of
from hopopt.planner.answer.program_figures import FigureSource, figures
from hopopt.planner.answer.summary import VERSION
from hopopt.planner.checks.judge import judge, with_sharper_gears
from hopopt.planner.refine_and_verify import stated_figure
from hopopt.planner.solution import Solution, own_functions
from hopopt.storage.folder import fitting
from hopopt.storage.phases import TABLE_ARRAYS
from hopopt.storage.seal.digests import changed_entries
from hopopt.storage.seal.recheck import co_design_checks, recheck, stored_program
from hopopt.storage.solution import Figures, save


def repaired(solution: Solution, figures_of: Figures | None = None) -> Solution:
    """The solution in a new folder beside its own, which stays as it is: entries that were changed are as computed again.

    figures_of: draws its figures. ResultError if there is nothing to repair, if an entry was changed that nobody can
    compute again, or if what comes out is not verified.
    """
    folder = solution.result_dir
    assert folder is not None
    if not solution.doubts:
        raise ResultError(f"{folder}: no file was changed after it was written: there is nothing to repair")
    try:
        changed = changed_entries(folder)
    except KeyError:
        raise ResultError(f"{folder}: manifest.json does not say what was changed: solve it again") from None
    with fitting(folder):
        again, computed = _computed_again(solution)
        _refuse(solution, changed, computed)
        if bad := recheck(again).failed_checks:
            raise ResultError(f"{folder}: computed again it is not verified ({', '.join(bad)}): solve it again")
    note = f"repaired: {'; '.join(solution.doubts)}; computed again from {folder}, which was left as it is"
    return save(again.with_summary(notes=(*again.summary.notes, note)), folder.parent, figures_of)


def _computed_again(solution: Solution) -> tuple[Solution, set[str]]:
    """The solution with all that follows from its motion and program computed again, and the names of what that is."""
    s, (goal, constraints) = solution.summary, own_functions(solution)
    hop, nlp, program, errors = stored_program(solution)
    plan = solution.noted(doubts=(), stated=stated_figure(hop, nlp))
    plan.__dict__["tables"] = {name: plan.fresh_table(name) for name in plan.phases}
    searched = s.structure.solved_again is not None  # free switches too are what only the search knew
    change = change_of([(m.intervals, m.objective, m.drawn_in) for m in s.mesh], program.least)
    change = s.check("change of the objective").residual if searched else change
    verdict = judge(plan, program, goal, constraints, {**plan.claims(), **plan.stated}, errors, change)
    verdict = with_sharper_gears(plan, verdict).with_checks(co_design_checks(goal, program.value, s.codesign))
    entries = figures(FigureSource(hop, plan, program, verdict))
    for name in ("structure", "exit_code", *(["verification"] if searched else [])):
        del entries[name]
    known = {f"summary.json: {name}" for name in entries}
    known |= {f"solution.nc: {phase}/{name}" for phase in plan.phases for name in TABLE_ARRAYS}
    known |= {f"solution.nc: certificate/{group}/{name}" for group, x in verdict.multipliers.items() for name in x}
    return plan.with_summary(**entries, version=VERSION).noted(multipliers=dict(verdict.multipliers)), known


def _refuse(solution: Solution, changed: dict[str, list[str] | None], computed: set[str]) -> None:
    """ResultError if something was changed that cannot be computed again, or nobody knows what."""
    lost: Sequence[str] = [f"{file}: {part}" for file, parts in changed.items() for part in parts or ()]
    lost = [name for name in lost if name not in computed] + [file for file, parts in changed.items() if parts is None]
    if lost:
        words = "only the solve knew what stood there: solve it again"
        raise ResultError(f"{solution.result_dir}: cannot be repaired ({', '.join(lost)}): {words}")
