"""The documentation site: its reference pages say what the code says, and it builds offline without a warning."""

import os
import re
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

from hopopt.cli.main import COMMANDS, app
from hopopt.problem.load import builtin_names, load
from hopopt.problem.render import rows
from scripts import script

DOCS = Path(__file__).parents[2] / "docs"


@pytest.fixture(scope="module")
def builder() -> ModuleType:
    return script("build_site")


def test_every_entry_of_every_built_in_problem_is_in_the_reference(builder: ModuleType) -> None:
    """And the other way round, but for what no built-in problem says: those are keys of the model."""
    known = {entry[0] for entry in builder.entries()}
    assert len(known) > 100
    for name in builtin_names():
        leg = load(name).leg
        for row in rows(load(name)):
            path = re.sub(rf"^leg\.({'|'.join(leg.joints)})\b", "leg.JOINT", row.path.partition("[")[0])
            path = re.sub(rf"^leg\.({'|'.join(leg.links)})\b", "leg.LINK", path)
            inside = (key for key in known if key.startswith(f"{path}."))  # of a table that is not set
            assert path in known or any(inside), row.path
    page = builder.key_page()
    assert all(f"| `{key}` |" in page for key in known)
    assert "| `hop.speed` | m/s | `0.0` | -20 to 20 | mean forward speed of a periodic hop; 0: in place |" in page


def test_every_command_and_option_is_in_the_reference(builder: ModuleType) -> None:
    page = builder.command_page()
    commands = [name for name in app.resolved_commands() if not name.startswith("-")]
    assert {"solve", "compare", "identify", "robust"} <= set(commands)
    for name in commands:
        assert re.search(rf"^#+ .*\b{name}\b", page, re.M), name
    assert "--why" in page
    grouped = [
        line for title, names in COMMANDS.items() for line in (f"## {title}", *(f"### hopopt {n}" for n in names))
    ]
    assert [line for line in page.splitlines() if line in grouped] == grouped


def test_every_page_has_its_place(builder: ModuleType) -> None:
    """On the site, and in the order in which to read them."""
    placed = {name for names in builder.PARTS.values() for name in names}
    pages = {path.stem for path in DOCS.glob("*.md")} - {"index"}
    assert pages <= placed
    assert placed - pages == {"notebooks/*", "keys", "commands", "reference/*"}
    order = (DOCS / "index.md").read_text(encoding="utf-8")
    assert all(f"({name}.md)" in order for name in pages)


@pytest.mark.slow
def test_it_builds_offline_and_its_pages_fetch_nothing(tmp_path: Path) -> None:
    """No proxy leads anywhere; scripts, styles, fonts and pictures are its own; notebooks show their figures."""
    nowhere = {name: "http://127.0.0.1:9" for name in ("http_proxy", "https_proxy", "HTTP_PROXY", "HTTPS_PROXY")}
    command = [sys.executable, str(DOCS / "build_site.py"), str(tmp_path / "site")]
    done = subprocess.run(command, env={**os.environ, **nowhere}, capture_output=True, text=True, timeout=300)
    assert (done.returncode, done.stderr) == (0, "")
    pages = {path.relative_to(tmp_path / "site"): path.read_text(encoding="utf-8") for path in tmp_path.rglob("*.html")}
    assert len(pages) > 25
    for name, text in pages.items():
        assert not re.search(r"<(?:script|img|iframe)[^>]+src=\"(?:https?:)?//", text), name
        assert not re.search(r"<link[^>]+href=\"(?:https?:)?//", text), name
    styles = "".join(path.read_text(encoding="utf-8") for path in (tmp_path / "site").rglob("*.css"))
    assert not re.search(r"url\([\"']?(?:https?:)?//|@import", styles)
    for name, text in pages.items():
        if name.parent.name == "notebooks":
            assert len(re.findall(r"<img [^>]*_images/", text)) >= 3, name
