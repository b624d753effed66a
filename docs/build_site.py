"""The documentation as a site: python docs/build_site.py [FOLDER] (default: site). Offline; a warning is an error.

Sphinx with furo and myst-nb: it shows the pages of this folder as they are, and stored notebooks with their figures, and
its pages fetch nothing from a network. Pages on the keys of a problem file and on the commands are written here from the
code; those on the Python interface by docs/write_reference.py.
"""

import json
import re
import shutil
import sys
import tempfile
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
PARTS = {  # of the site, in the order in which they are read
    "Begin": ("start", "model", "glossary", "limits", "performance"),
    "Your own leg": (
        "own_leg",
        "body",
        "actuators",
        "drives",
        "rates",
        "transmissions",
        "five_bar",
        "springs",
        "environment",
        "objectives",
        "periodic",
        "landing",
        "obstacle",
        "stored_results",
        "report",
    ),
    "Controllers": ("controllers", "own_controller", "why_pd", "robust", "tracking", "hop_after_hop"),
    "A robot": ("to_robot", "logs"),
    "Studies": ("sensitivity", "studies", "explore", "choose", "codesign", "families"),
    "Gallery": ("notebooks/*",),
    "Why to believe it": (
        "method",
        "error",
        "certificate",
        "structure",
        "evidence",
        "landed_search",
        "diagnose",
        "bound",
    ),
    "The paper": ("paper", "paper_equations"),
    "Reference": ("python", "keys", "commands", "reference/*"),
    "To change hopopt": ("architecture", "extending", "costs", "peers", "tried"),
}
CONFIG = f"""
project, release = "hopopt", "{version("hopopt")}"
extensions = ["myst_nb"]
html_theme, html_title = "furo", "hopopt"
nb_execution_mode = "off"
myst_heading_anchors = 4
suppress_warnings = ["myst.header", "misc.highlighting_failure"]
html_show_sphinx = html_show_copyright = html_show_sourcelink = False
"""
Schema = dict[str, Any]


def build(folder: Path) -> int:
    """Build the site into a folder that may not exist; Sphinx's exit code."""
    from sphinx.cmd.build import main

    with tempfile.TemporaryDirectory() as place:
        source = Path(place) / "source"
        write_source(source)
        return main(["-W", "--keep-going", "-q", "-b", "html", "-d", f"{place}/trees", str(source), str(folder)])


def write_source(source: Path) -> None:
    """All pages, those written from the code too."""
    shutil.copytree(ROOT / "docs", source, ignore=shutil.ignore_patterns("*.py", "__pycache__"))
    shutil.copytree(
        ROOT / "notebooks", source / "notebooks", ignore=shutil.ignore_patterns("*.py", ".ipynb_checkpoints")
    )
    pages = {"keys": key_page(), "commands": command_page(), "index": index_page(source)}
    for name, text in pages.items():
        (source / f"{name}.md").write_text(text, encoding="utf-8")
    for page in source.glob("*.md"):
        page.write_text(_within(page.read_text(encoding="utf-8")), encoding="utf-8")
    (source / "conf.py").write_text(CONFIG, encoding="utf-8")


def _within(text: str) -> str:
    """Links to files of the project that are no pages become their names."""
    text = re.sub(r"\]\(\.\./README\.md\)", "](start.md)", text)
    return re.sub(r"\[([^\]]*)\]\(\.\./([^)]*)\)", r"\1 (`\2`)", text)


def index_page(source: Path) -> str:
    """The first page: the README's beginning, which has the picture, the two commands and an answer; then all pages."""
    head = (ROOT / "README.md").read_text(encoding="utf-8").partition("\n## ")[0]
    lines = [re.sub(r"\]\(docs/", "](", head).strip(), ""]
    for part, names in PARTS.items():
        entries = [entry for name in names for entry in _entries(source, name)]
        lines += ["```{toctree}", ":maxdepth: 1", f":caption: {part}", "", *entries, "```", ""]
    return "\n".join(lines)


def _entries(source: Path, name: str) -> list[str]:
    """The pages that a name of PARTS stands for."""
    found = [str(path.relative_to(source).with_suffix("")) for path in sorted(source.glob(name)) if path.is_file()]
    return found or [name]


def key_page() -> str:
    """Every key of a problem file, from its schema."""
    lines = ["# Every key of a problem file", "", "From the model that checks files. `hopopt schema problem` prints the same",
             "for editors. JOINT and LINK stand for the names that a leg gives its joints and links.", ""]  # fmt: skip
    sections: dict[str, list[str]] = {}
    for key, entry in entries():
        section = key.rpartition(".")[0] or "the file"
        text = re.sub(r" \[[^\]]*\]$", "", entry.get("description", ""))
        cells = (f"`{key}`", _unit(entry), _default(entry), _allowed(entry), text)
        sections.setdefault(section, []).append("| " + " | ".join(c.replace("|", "\\|") for c in cells) + " |")
    for section, rows in sections.items():
        lines += [
            f"## {section}",
            "",
            "| key | unit | default | allowed | meaning |",
            "|---|---|---|---|---|",
            *rows,
            "",
        ]
    return "\n".join(lines)


def entries() -> Iterator[tuple[str, Schema]]:
    """Paths and schemas of all entries of a problem file."""
    schema = json.loads((ROOT / "src/hopopt/schemas/problem.json").read_text(encoding="utf-8"))
    yield from _keys_of(schema, schema["definitions"], "")


def _keys_of(table: Schema, tables: dict[str, Schema], path: str) -> Iterator[tuple[str, Schema]]:
    for name, entry in table.get("properties", {}).items():
        here = f"{path}.{name}".lstrip(".")
        inner = list(_tables_of(entry))
        for name in inner:
            yield from _keys_of(tables[name], tables, here)
        if not inner:
            yield here, entry
    for name in _tables_of(table.get("additionalProperties")):
        yield from _keys_of(tables[name], tables, f"{path}.{name.upper()}")


def _tables_of(entry: Any) -> Iterator[str]:
    """Names of the tables that an entry may be."""
    if isinstance(entry, dict):
        for part in (entry, *(x for kind in ("anyOf", "oneOf", "allOf") for x in entry.get(kind, ()))):
            if "$ref" in part:
                yield part["$ref"].rpartition("/")[2]


def _unit(entry: Schema) -> str:
    found = re.search(r" \[([^\]]*)\]$", entry.get("description", ""))
    return found[1] if found else ""


def _default(entry: Schema) -> str:
    return f"`{json.dumps(entry['default'])}`" if "default" in entry else ""


def _allowed(entry: Schema) -> str:
    if "enum" in entry or "const" in entry:
        return ", ".join(f"`{x}`" for x in entry.get("enum", [entry.get("const")]))
    low, high = entry.get("minimum"), entry.get("maximum")
    if low is None and high is None:
        return str(entry.get("type", ""))
    return f"{'' if low is None else f'{low:g}'} to {'' if high is None else f'{high:g}'}"


def command_page() -> str:
    """Every command with its options, from the command line itself and in its groups."""
    from hopopt.cli.main import COMMANDS, app

    text = app.generate_docs(output_format="markdown", heading_level=2).replace("## hopopt", "# Every command", 1)
    text = re.sub(r"#+ Table of Contents\n.*?(?=\*\*)", "", text, flags=re.S)
    for title, commands in COMMANDS.items():
        first = f"\n### hopopt {next(iter(commands))}\n"
        text = text.replace(first, f"\n## {title}\n{first}")
    return text


if __name__ == "__main__":
    sys.exit(build(Path(sys.argv[1] if len(sys.argv) > 1 else "site")))
