"""What README and the pages of docs name is there; the pictures are those of today; sentences are short."""

import re
from pathlib import Path

import pytest
import yaml

from scripts import script

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", ROOT / "CHANGELOG.md", ROOT / "CONTRIBUTING.md", *sorted(DOCS.glob("*.md"))]
COMING = {"extending.md"}  # pages that are linked and need not be there yet
HOMES = (ROOT, ROOT / "src" / "hopopt", DOCS)  # what paths may be relative to
LONGEST = 30  # words of a sentence
LARGEST = 120_000  # bytes of a picture
MOST_WORDS = 1500  # of a page, the glossary aside
NO_TASK = {
    "glossary",
    "model",
    "limits",
    "architecture",
    "extending",
}  # pages that are looked up, or are for developers
ids = [page.name for page in PAGES]


def text_of(page: Path) -> str:
    return page.read_text(encoding="utf-8")


def paragraphs(text: str) -> list[str]:
    """Of a page, its items and headings among them; without code, formulas and tables."""
    text = re.sub(r"```.*?```", "", text, flags=re.S)
    parts = re.split(r"\n\s*\n|\n\s*(?=[-*#] |#|\d+\. )", text)
    return [
        " ".join(p.split()) for p in parts if not p.strip("\n").startswith("    ") and p.strip()[:1] not in ("|", "!")
    ]


def sentences(text: str) -> list[str]:
    return [s for p in paragraphs(text) for s in re.split(r"(?<=[.?!])[)\"*`\]]*\s+", p)]


@pytest.mark.parametrize("page", PAGES, ids=ids)
def test_every_path_that_is_named_exists(page: Path) -> None:
    named = re.findall(
        r"(?<![\w/.])((?:[\w-]+/)+[\w-]+\.(?:py|toml|md|png|svg))", re.sub(r"https?://\S+", "", text_of(page))
    )
    kept = [n for n in named if not n.startswith(("figures/", "results/")) and Path(n).name not in COMING]
    assert not [n for n in kept if not any((home / n).exists() for home in HOMES)]


@pytest.mark.parametrize("page", PAGES, ids=ids)
def test_every_link_leads_somewhere(page: Path) -> None:
    links = [link.partition("#")[0] for link in re.findall(r"\]\(([^)]+)\)", text_of(page)) if "://" not in link]
    assert not [n for n in links if Path(n).name not in COMING and not (page.parent / n).exists()]


@pytest.mark.parametrize("page", PAGES, ids=ids)
def test_sentences_are_short(page: Path) -> None:
    assert not [s for s in sentences(text_of(page)) if len(s.split()) > LONGEST]


@pytest.mark.parametrize("page", [*DOCS.glob("*.md"), ROOT / "README.md"], ids=lambda page: page.stem)
def test_a_page_is_short(page: Path) -> None:
    assert page.stem == "glossary" or len(text_of(page).split()) <= MOST_WORDS


@pytest.mark.parametrize(
    "page", [page for page in DOCS.glob("*.md") if page.stem not in NO_TASK], ids=lambda page: page.stem
)
def test_a_page_begins_with_what_the_reader_can_do(page: Path) -> None:
    """Commands, a file or code stand before its first part."""
    assert "\n```" in text_of(page).partition("\n## ")[0]


@pytest.mark.parametrize("page", PAGES[3:], ids=ids[3:])
def test_measured_figures_carry_their_date_and_commit(page: Path) -> None:
    """Those in metres with three decimals and more, unless tests/docs/test_numbers.py repeats all of the page."""
    text = re.sub(r"```.*?```", "", text_of(page), flags=re.S)
    if re.search(r"\b\d\.\d{3,} m\b", text) and page.stem != "glossary":
        assert re.search(r"\bcommit [0-9a-f]{7}\b", text)
        assert re.search(r"\b\d{1,2} [A-Z][a-z]+ 20\d\d\b", text)


def test_the_index_has_every_page() -> None:
    linked = set(re.findall(r"\]\((\w+\.md)\)", text_of(DOCS / "index.md")))
    assert linked - COMING == {page.name for page in DOCS.glob("*.md")} - {"index.md"} - COMING


def test_readme_is_short() -> None:
    assert len(text_of(ROOT / "README.md").splitlines()) <= 100


def test_readme_lists_the_legs_that_are_built_in() -> None:
    """As the help of hopopt solve says."""
    text = text_of(ROOT / "README.md")
    assert not [path.stem for path in (ROOT / "problems").glob("*.toml") if f"`{path.stem}`" not in text]


def test_values_that_the_page_of_motors_calls_unverified_are_marked_so() -> None:
    for name in ("maxon-ec45-150", "maxon-ec45-250"):
        text = text_of(ROOT / "problems" / "actuators" / f"{name}.toml").partition("[motor]")[2]
        entries = re.split(r"\n(?=\w+ = )", text.strip())
        assert len(entries) == 7
        assert all("[U]" in entry for entry in entries)


def test_the_model_is_on_one_page() -> None:
    assert len(text_of(DOCS / "model.md").splitlines()) <= 60


def test_before_a_commit_runs_what_ci_runs_of_lint_and_types() -> None:
    """Every hook of the pre-commit configuration is a line of .ci/run; ruff there takes the whole tree."""
    hooks = yaml.safe_load(text_of(ROOT / ".pre-commit-config.yaml"))["repos"][0]["hooks"]
    ci = [line.strip(" ").removesuffix(" .") for line in text_of(ROOT / ".ci" / "run").splitlines()]
    assert {hook["entry"] for hook in hooks} == {line for line in ci if re.match(r"\.venv/bin/(ruff|pyright)", line)}


def test_pictures_are_small() -> None:
    assert not [p.name for p in (DOCS / "images").iterdir() if p.stat().st_size > LARGEST]


def test_the_picture_of_the_packages_is_that_of_today() -> None:
    """After a change of imports: python docs/draw_packages.py"""
    module = script("draw_packages")
    assert text_of(module.PICTURE) == module.drawn()


def test_ten_steps_name_modules() -> None:
    """Each step of a problem's way names a module that is there."""
    way = text_of(DOCS / "architecture.md").partition("to answer")[2].partition("\n## ")[0]
    steps = re.split(r"\n\d+\. ", way)[1:]
    assert len(steps) == 10
    for step in steps:
        modules = re.findall(r"`([\w/]+\.py)`", step)
        assert modules
        assert all((ROOT / "src" / "hopopt" / module).is_file() for module in modules), step
