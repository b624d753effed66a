"""What a stored summary states, against the same computed again from the stored motion, program and verdict.

What only the search knew cannot be computed again without it: starts, families, the global method, cross-checks, earlier
meshes, times. Digests alone guard those (storage/seal/digests.py).
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, replace
from math import isfinite, isnan
from typing import Any

from hopopt.nlp.refinement.interval_errors import IntervalErrors
from hopopt.nlp.refinement.mesh_step import change_of
from hopopt.nlp.solver.ipopt import NlpSolution
from hopopt.ocp.hop import Hop
from hopopt.planner.answer.motion_figures import MotionFigures, Sampled
from hopopt.planner.answer.program_figures import FigureSource, figures
from hopopt.planner.answer.summary import FORMER, VERSION
from hopopt.planner.checks.verdict import Verdict, Verification
from hopopt.planner.solution import Solution
from hopopt.record import as_data, computed
from hopopt.verify.check import Check

FIGURES_AGREE = 1e-6  # relative, of figures
LEAST_FIGURE = 1e-3  # what figures that are smaller are relative to [their unit]: some are zero but for rounding
RESIDUALS = 0.01  # relative, of what is measured: faults of 1e-8 are known to few digits
ROUNDING = 1e-3  # share of what is allowed, that smaller residuals are relative to
OF_THE_OBJECTIVE = 1e-8  # relative to the objective: the same for its error
MOST_FIGURES_NAMED = 4  # figures that are named
REDEFINED = (
    "objective_value",
    "tie_break_weighs",
    "leans_on",
)  # version 1 counted the tie-break, and friction of no force

COMPARED_AS_RESIDUALS = (
    "objective_error",
    "certificate",
    *(f.name for f in fields(Verification)),
)  # compared as residuals are

Pair = tuple[str, Any, Any]  # path of an entry, what is stated, what was computed


def stated_checks(
    solution: Solution, hop: Hop, nlp: NlpSolution, errors: Mapping[str, IntervalErrors], found: Verdict
) -> list[Check]:
    """That the summary's figures, residuals and error of the objective are those computed again.

    hop, nlp: the solution's question and program, as stored
    errors: local errors of every interval, by phase
    found: the verdict, computed again
    """
    entries = figures(FigureSource(hop, solution, nlp, found))
    s, again = as_data(solution.summary), as_data(replace(solution.summary, **entries))
    fresh = {name: again.get(name) for name in entries if name not in COMPARED_AS_RESIDUALS}
    error = again["objective_error"]
    fresh["structure"] = {**s["structure"], **fresh["structure"]}  # of free switches it says more
    fresh["mesh"] = [*s["mesh"][:-1], s["mesh"][-1] | _last_mesh(nlp)]
    if solution.summary.version < VERSION:
        error["could_be_beaten_by"] = s["objective_error"]["could_be_beaten_by"]  # without the tie-break then
    size = OF_THE_OBJECTIVE * nlp.magnitude
    off = [(name, difference(a, b, size)) for name, a, b in _pairs(s["objective_error"], error, "objective_error")]
    return [
        _figures_check(solution, fresh),
        _check("residuals of the summary as computed", list(_residuals(s, again, errors, nlp)), RESIDUALS),
        _check("error of the objective as stated", off, RESIDUALS),
    ]


def motion_check(solution: Solution) -> Check:
    """The same of a result without multipliers: what the summary says of the motion alone."""
    entries = computed(MotionFigures, Sampled(solution))
    again = as_data(replace(solution.summary, **entries))
    return _figures_check(solution, {name: again.get(name) for name in entries})


def _figures_check(solution: Solution, fresh: Mapping[str, Any]) -> Check:
    """That the entries of the summary which were computed are as stated, and none contradicts another."""
    s = as_data(solution.summary)
    former = REDEFINED if solution.summary.version < VERSION else ()
    fresh = {name: s[name] if name in former else figure for name, figure in fresh.items()}
    pairs = _pairs(_only(s, fresh), fresh)
    wrong = [(name, difference(a, b)) for name, a, b in pairs]
    wrong += [(words, float("inf")) for words in solution.summary.contradictions()]
    return _check("figures of the summary as computed", wrong, FIGURES_AGREE)


def difference(stated: Any, computed: Any, least: float = LEAST_FIGURE) -> float:
    """Difference of two pieces of JSON data, of numbers relative to the computed one, or to ``least`` if that is larger;
    infinite if anything else differs."""
    numbers = [isinstance(x, int | float) and not isinstance(x, bool) for x in (stated, computed)]
    if stated == computed or not all(numbers):
        return 0.0 if stated == computed else float("inf")
    off = abs(stated - computed) / max(abs(computed), least)
    if isnan(off):  # one of them at least is no number, or infinite: JSON has null for both
        return float("inf") if isfinite(stated) or isfinite(computed) else 0.0
    return off


def _last_mesh(nlp: NlpSolution) -> dict[str, Any]:
    return {"intervals": {name: m.intervals for name, m in nlp.transcription.mesh.items()}, "objective": nlp.objective}


def _residuals(
    s: Mapping[str, Any], checks: Mapping[str, Any], errors: Mapping[str, IntervalErrors], nlp: NlpSolution
) -> Iterator[tuple[str, float]]:
    """Differences of what was measured, by name: the checks, the certificate's conditions, and the last mesh.

    s, checks: the summary as it is stored, and as it is computed again
    """
    for key in ("verified", "failed_checks"):
        yield key, difference(s[key], checks[key])
    told, again = ({c["name"]: c for c in v} for v in (s["verification"], checks["verification"]))
    if s["structure"].get("solved_again") is not True:  # whose first mesh is that of another program
        again["change of the objective"]["residual"] = change_of(
            [(m["intervals"], m["objective"], m["drawn_in"]) for m in s["mesh"]], nlp.least
        )
    for name in told.keys() - again.keys() - set(FORMER.values()):
        yield f"verification.{name}", float("inf")
    again = {name: c for name, c in again.items() if name in told}  # earlier versions made fewer
    certificates = (s["certificate"], checks["certificate"], "certificate")
    for stated, fresh, where in ((told, again, "verification"), certificates):
        for name, a, b in _pairs(_only(stated, fresh), fresh, where):
            check = name.split(".")[1]
            if name.endswith(".where"):  # of several places that are as bad, rounding chooses one
                continue
            yield name, difference(a, b, ROUNDING * fresh[check]["tolerance"] if check in fresh else 0.0)
    for name, part in (("local_error", "local"), ("excess", "excess")):
        worst = max(float(getattr(e, part).max()) for e in errors.values())
        yield f"mesh.{name}", difference(s["mesh"][-1][name], worst, ROUNDING * LEAST_FIGURE)


def _pairs(stated: Any, computed: Any, path: str = "") -> Iterator[Pair]:
    """Every value of two pieces of JSON data of the same form; of others the whole."""
    if isinstance(stated, Mapping) and isinstance(computed, Mapping):
        for key in {**stated, **computed}:
            yield from _pairs(stated.get(key), computed.get(key), f"{path}.{key}" if path else key)
    elif isinstance(stated, Sequence) and isinstance(computed, Sequence) and not isinstance(stated, str):
        for k in range(max(len(stated), len(computed))):
            a, b = (part[k] if k < len(part) else None for part in (stated, computed))
            yield from _pairs(a, b, f"{path}.{k}")
    else:
        yield path, stated, computed


def _only(stated: Mapping[str, Any], computed: Mapping[str, Any]) -> dict[str, Any]:
    """The stated entries that were computed."""
    return {key: stated.get(key) for key in computed}


def _check(name: str, wrong: Sequence[tuple[str, float]], allowed: float) -> Check:
    """A check that names what is wrong, the worst first."""
    ranked = sorted(wrong, key=lambda pair: -pair[1])
    named = [path for path, amount in ranked if amount > allowed][:MOST_FIGURES_NAMED] or [ranked[0][0]]
    return Check(name, ranked[0][1], allowed, "relative", ", ".join(named))
