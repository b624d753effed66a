"""The notebooks: pairs that say the same, with outputs, on the public interface alone; and every one runs."""

import ast
import base64
import json
import re
import time
from pathlib import Path

import jupytext
import nbformat
import pytest
from nbmake.nb_run import NotebookRun

NOTEBOOKS = sorted((Path(__file__).parents[1] / "notebooks").glob("*.ipynb"))
HANGS = 1200  # [s]; what they really take is printed, as no test
LARGEST = 400_000  # bytes
PNG = b"\x89PNG"
SMALLER = {  # sizes for a test: the same cells on fewer legs, hops and orders
    "draws=60, evaluations=1, starts=2": "draws=4, evaluations=1, starts=1, share=0.5, confidence=0.5",
    ".why()": ".why(orders=1)", "hops=12": "hops=3", "starts=2": "starts=1", "starts=3": "starts=1",
    '"60,80,98,100,102,120,140"': '"80,98,100,102"', "(0.4, 0.8, 1.2, 1.6)": "(0.8, 1.6)",
}  # fmt: skip


def cells(notebook: nbformat.NotebookNode) -> list[tuple[str, str]]:
    return [(cell.cell_type, cell.source) for cell in notebook.cells]


def test_every_notebook_has_its_pair() -> None:
    folder = Path(__file__).parents[1] / "notebooks"
    assert [path.stem for path in NOTEBOOKS] == sorted(path.stem for path in folder.glob("*.py"))
    assert len(NOTEBOOKS) >= 3


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_pairs_say_the_same(path: Path) -> None:
    """After a change of one: python docs/run_notebooks.py"""
    stored, script = nbformat.read(path, 4), jupytext.read(path.with_suffix(".py"))
    assert cells(stored) == cells(script)
    assert stored.metadata.kernelspec.name == script.metadata.kernelspec.name == "python3"
    nbformat.validate(stored)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_outputs_are_kept_and_small(path: Path) -> None:
    """Every cell was run, in order and without a fault; what is kept names no folder of a computer."""
    code = [cell for cell in nbformat.read(path, 4).cells if cell.cell_type == "code"]
    assert [cell.execution_count for cell in code] == list(range(1, len(code) + 1))
    outputs = [output for cell in code for output in cell.outputs]
    assert not [o for o in outputs if o.output_type == "error" or o.get("name") == "stderr"]
    assert sum("image/png" in o.get("data", {}) for o in outputs) >= 3
    assert not re.search(r"/(tmp|home|root)/", "".join(o.get("text", "") for o in outputs))
    assert path.stat().st_size < LARGEST


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_only_the_public_interface_is_used(path: Path) -> None:
    tree = ast.parse(path.with_suffix(".py").read_text(encoding="utf-8"))
    from_imports = [node.module or "" for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
    assert not [module for module in from_imports if module.startswith("hopopt")]
    attributes = [node for node in ast.walk(tree) if isinstance(node, ast.Attribute)]
    assert not [node.attr for node in attributes if node.attr.startswith("_")]
    assert "import hopopt as ho" in path.with_suffix(".py").read_text(encoding="utf-8")


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_what_a_notebook_names_exists(path: Path) -> None:
    """Notebooks and pages it points to."""
    text = path.with_suffix(".py").read_text(encoding="utf-8")
    for name in re.findall(r"`(\d\d_\w+)`", text):
        assert name in {other.stem for other in NOTEBOOKS}, name
    for name in re.findall(r"`(docs/\w+\.md)`", text):
        assert (path.parents[1] / name).is_file(), name


STUDIES = (
    "02",
    "03",
    "04",
    "05",
    "06",
    "07",
    "08",
    "09",
    "10",
)  # what they run is tried by the tests of comparisons, sweeps, co-design, hops after each other and robust plans
RUNS = [  # the longest first, beside the others
    pytest.param(path, marks=[pytest.mark.rarely] if path.stem[:2] in STUDIES else [], id=path.stem)
    for path in NOTEBOOKS[::-1]
]


@pytest.mark.slow
@pytest.mark.filterwarnings("default")  # of the kernel's client, not of hopopt
@pytest.mark.parametrize("path", RUNS)
def test_it_runs(path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    began, text = time.perf_counter(), path.read_text(encoding="utf-8")
    for size, less in SMALLER.items():
        text = text.replace(json.dumps(size)[1:-1], json.dumps(less)[1:-1])
    (tmp_path / path.name).write_text(text, encoding="utf-8")
    result = NotebookRun(tmp_path / path.name, default_timeout=HANGS).execute()
    seconds = time.perf_counter() - began
    assert result.error is None, result.error
    outputs = [output for cell in result.nb.cells for output in cell.get("outputs", ())]
    pictures = [output.data["image/png"] for output in outputs if "image/png" in output.get("data", {})]
    assert len(pictures) >= 3
    assert all(base64.b64decode(picture).startswith(PNG) for picture in pictures)
    warned = [output.text for output in outputs if output.get("name") == "stderr"]
    assert not warned, warned
    print(f"{path.stem}: {seconds:.0f} s, {len(pictures)} figures")
