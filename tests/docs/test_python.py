"""The page on the Python interface: every block runs, in order, and every verb and method has its line."""

import inspect
import re
import warnings
from pathlib import Path

import pytest

import hopopt as ho

DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "python.md").read_text(encoding="utf-8")
SHORT = (
    "solver.starts=1",
    "hop.stance_duration=[0.03, 0.2]",
    "simulation.control_rate=1000",
)  # few intervals and periods
QUICK = '\\1", ' + ", ".join(f'"{entry}"' for entry in SHORT) + "]"  # after an entry that a block changes
BLOCKS = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
ROWS = "\n".join(line for line in PAGE.splitlines() if line.startswith("|"))
OF_ALL = {"as_dict", "folder", "verified", "with_methods"}  # said of all results at once, or for hopopt itself


def test_the_page_is_short_and_has_examples() -> None:
    assert len(PAGE.split()) <= 1500
    assert len(BLOCKS) >= 8


def test_every_verb_has_a_line() -> None:
    verbs = {name for name in ho.__all__ if not inspect.isclass(getattr(ho, name))}
    assert verbs == set(re.findall(r"ho\.(\w+)\(", ROWS))


def test_every_method_has_a_line() -> None:
    """Those that the interface adds, in the reference; what the table here says is there."""
    reference = "".join(page.read_text(encoding="utf-8") for page in (DOCS / "reference").glob("*.md"))
    for kind in (getattr(ho, name) for name in ho.__all__ if name != "Design" and inspect.isclass(getattr(ho, name))):
        own = (
            {name for name in vars(kind) if not name.startswith("_")} - OF_ALL - {*getattr(kind, "__annotations__", ())}
        )
        part = reference.partition(f"## ho.{kind.__name__}\n")[2].partition("\n## ")[0]
        assert own <= set(re.findall(r"^(?:\| )?`(\w+)", part, re.M)), kind.__name__
        told = set(re.findall(rf"`{kind.__name__}\.(\w+)`", ROWS))
        assert all(hasattr(kind, name) or name in kind.__dataclass_fields__ for name in told), kind.__name__


@pytest.mark.rarely
def test_every_block_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In one program, in an empty folder; no old name is in it, for a warning is a fault here."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    monkeypatch.setattr("hopopt.comparison.robust.robust.TUNING_DRAWS", 4)
    found = dict[str, object]()
    with warnings.catch_warnings(action="error", category=DeprecationWarning):
        for block in BLOCKS:
            exec(re.sub(r'(=\w+)"\]', QUICK, block), found)
    assert (tmp_path / "heights.png").stat().st_size > 1000
