"""Run the notebooks and keep their outputs: python docs/run_notebooks.py [NAME ...]

The text comes of the .py beside each. Run this after a change of one, or of what they show.
"""

import base64
import io
import os
import sys
import tempfile
from pathlib import Path

import jupytext
import nbformat
from nbclient import NotebookClient
from PIL import Image

NOTEBOOKS = Path(__file__).parents[1] / "notebooks"
LONGEST = 1200  # s, of a cell
WIDEST, COLOURS = 900, 48  # pixels and colours of a picture: a notebook stays below 400 kB
KEPT = ("text/plain", "text/html", "image/png")


def smaller(png: str) -> str:
    """A picture in base64 with no more pixels and colours than needed."""
    picture = Image.open(io.BytesIO(base64.b64decode(png))).convert("RGB")
    picture.thumbnail((WIDEST, WIDEST))
    buffer = io.BytesIO()
    picture.quantize(COLOURS).save(buffer, "PNG", optimize=True)
    return base64.b64encode(buffer.getvalue()).decode() + "\n"


def run(path: Path) -> None:
    """Run a notebook in a folder that is gone afterwards, and write it whole, with outputs and without times."""
    notebook = jupytext.read(path.with_suffix(".py"))
    with tempfile.TemporaryDirectory() as folder:
        NotebookClient(
            notebook, timeout=LONGEST, kernel_name="python3", resources={"metadata": {"path": folder}}
        ).execute()
        inside = folder
    for cell in notebook.cells:
        cell.metadata.pop("execution", None)
        for output in cell.get("outputs", ()):
            if "data" in output:
                output["data"] = {kind: data for kind, data in output["data"].items() if kind in KEPT}
                if "image/png" in output["data"]:
                    output["data"]["image/png"] = smaller(output["data"]["image/png"])
            if "text" in output:
                output["text"] = output["text"].replace(inside, ".")
    stored = nbformat.read(
        path if path.exists() else NOTEBOOKS / "01_first_hop.ipynb", 4
    )  # a new one is like the first
    notebook.metadata, notebook.nbformat_minor = stored.metadata, stored.nbformat_minor
    for cell, before in zip(notebook.cells, stored.cells, strict=False):
        cell["id"] = before.get("id", cell.get("id"))
    temporary = path.with_suffix(".writing")
    nbformat.write(notebook, temporary)
    os.replace(temporary, path)


if __name__ == "__main__":
    for name in sys.argv[1:] or sorted(path.stem for path in NOTEBOOKS.glob("*.ipynb")):
        run(NOTEBOOKS / f"{name}.ipynb")
        print(name)
