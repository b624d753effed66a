"""Every kind of result with a constraint of the user's own, stored: verified in another process with its module, not without."""

from pathlib import Path

import pytest

import hopopt as ho
from hopopt import extensions
from registries import clean_registries
from scripts import python

MODULE = """
import hopopt as ho


@ho.constraint(unit="N", scale=400.0, phases=("stance",))
def soft(now):
    return 400.0 - now.f[-1]
"""
READ = "import hopopt as ho; v = ho.verify({!r}); print(v.verified, *v.faults)"
WITHOUT = """import sys, hopopt as ho
from hopopt.errors import UsageError
try:
    ho.verify({!r})
except UsageError as error:
    sys.exit(str(error))
"""
SHORT = {"hop.stance_duration": [0.03, 0.2], "solver.stance_intervals": 20}
FRICTION = {"contact.friction": 0.6}
PROBLEMS = {
    "landing": {"hop.kind": "landing", "solver.stance_intervals": 20},
    "periodic": {"hop.kind": "periodic", "solver.stance_intervals": 20},
    "transition": {"hop.kind": "periodic", "hop.touchdown_loss": 3.0, "solver.stance_intervals": 20, **FRICTION},
    "robust": {**SHORT, **FRICTION, "simulation.control_rate": 1000},
}


def stored(kind: str, results: Path) -> "ho.Solution | ho.Transition | ho.RobustHop":
    """The result of that kind, from one start, whose stance is soft."""
    design, more = ho.load("paper", PROBLEMS[kind]), {"starts": 1, "processes": 1, "results": results}
    soft = [extensions.function("ours_kept:soft")]
    if kind == "transition":
        return ho.transition(design, constraints=soft, **more)
    if kind == "robust":
        small = {"share": 0.8, "confidence": 0.8, "draws": 12, "evaluations": 1}
        return ho.robust(design, constraints=soft, **small, **more)
    return ho.solve(design, constraints=soft, **more)


@pytest.mark.rarely
@pytest.mark.parametrize("kind", PROBLEMS)
def test_a_stored_result_is_verified_where_its_module_is(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "ours_kept.py").write_text(MODULE)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr("hopopt.comparison.robust.robust.TUNING_DRAWS", 4)
    with clean_registries():
        extensions.load("ours_kept")
        found = stored(kind, tmp_path / "results")
    assert found.verified
    folder = str(found.folder)
    again = python("import ours_kept; " + READ.format(folder), tmp_path)
    assert again.stdout.split() == ["True"], again.stderr
    (tmp_path / "ours_kept.py").rename(tmp_path / "elsewhere.txt")
    without = python(WITHOUT.format(folder), tmp_path)
    assert without.returncode == 1
    (said,) = without.stderr.splitlines()
    assert "needs ours_kept: add --with ours_kept, or import ours_kept in Python" in said
