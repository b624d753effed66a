"""What a release says of itself: one version, and a citation that fits it; the source distribution has what is needed."""

import tomllib
from pathlib import Path

import yaml

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


def test_the_citation_is_of_this_version_and_names_the_paper() -> None:
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert cited["version"] == PROJECT["project"]["version"]
    assert cited["license"] == PROJECT["project"]["license"]
    (paper,) = cited["references"]
    assert paper["url"] == PROJECT["project"]["urls"]["Paper"]
    assert len(paper["authors"]) == 8


def test_the_source_distribution_has_documents_and_problems() -> None:
    included = PROJECT["tool"]["hatch"]["build"]["targets"]["sdist"]["include"]
    assert {"src", "problems", "docs", "notebooks", "CITATION.cff", "LICENSE"} <= set(included)
    assert all((ROOT / name).exists() for name in included)
