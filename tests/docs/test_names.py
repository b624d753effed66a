"""What README, docs, notebooks and docstrings name is there: names of the API, methods, dotted names, commands, options."""

import ast
import importlib
import re
from collections.abc import Iterator
from functools import cache
from inspect import signature
from pathlib import Path
from typing import Any, get_args

import pytest

import hopopt as ho
from hopopt import api
from hopopt.cli.main import WITH, app

ROOT = Path(__file__).parents[2]
SOURCES = sorted((ROOT / "src" / "hopopt").rglob("*.py"))
PAGES = [
    ROOT / "README.md",
    ROOT / "CHANGELOG.md",
    *sorted((ROOT / "docs").glob("*.md")),
    *sorted((ROOT / "notebooks").glob("*.py")),
]
SPAN = r"(`{1,2})((?:(?!\1).)+)\1"  # inline code, of pages and of docstrings
RETURNED = {"Identification": "hopopt.robot_data.identification"}  # annotated without import
OF_OTHERS = ("--shell", "--help", "--nthreads")  # options of all commands, and of dask
MEMBER = re.compile(r"\b([A-Z][A-Za-z]+)\.([a-z_]+)\b(?!\.(?:py|md|toml))")


def docstrings(source: Path) -> Iterator[str]:
    for node in ast.walk(ast.parse(source.read_text(encoding="utf-8"))):
        if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef)):
            yield ast.get_docstring(node) or ""


def package_of(source: Path) -> str:
    return str(source.parent.relative_to(ROOT / "src"))


WHERE = dict.fromkeys(
    [*(str(page.relative_to(ROOT)) for page in PAGES), *map(package_of, SOURCES)]
)  # names of all texts


@cache
def texts() -> dict[str, str]:
    """Every page, and all docstrings of every package, by name."""
    found = {str(page.relative_to(ROOT)): page.read_text(encoding="utf-8") for page in PAGES}
    for source in SOURCES:
        package = package_of(source)
        found[package] = "\n\n".join([found.get(package, ""), *docstrings(source)])
    return found


def inline(text: str) -> list[str]:
    """Code in sentences, its lines joined."""
    without = re.sub(r"```.*?```", "", text, flags=re.S)
    return [" ".join(code.split()) for _, code in re.findall(SPAN, without, re.S)]


def shown(text: str) -> str:
    """All code of a text."""
    return "\n".join([*re.findall(r"```python\n(.*?)```", text, re.S), *inline(text)])


def api_names(text: str) -> set[tuple[str, str]]:
    """(name, member) of every ho.name and ho.Name.member."""
    return set(re.findall(r"\bho\.([A-Za-z_]+)(?:\.([a-z_]+))?", text))


@cache
def classes() -> dict[str, list[type]]:
    """The package's classes by name."""
    found: dict[str, list[type]] = {}
    for source in SOURCES:
        for node in ast.parse(source.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.ClassDef):
                name = ".".join(source.relative_to(ROOT / "src").with_suffix("").parts)
                found.setdefault(node.name, []).append(getattr(importlib.import_module(name), node.name))
    return found


def has(kind: Any, member: str) -> bool:
    """Whether objects of a class, or of one of several, have it: a method, a field, or what its first lines set."""
    if several := get_args(kind):
        return any(has(one, member) for one in several)
    fields = {**getattr(kind, "__dataclass_fields__", {}), **getattr(kind, "model_fields", {})}
    return (
        hasattr(kind, member)
        or member in fields
        or any(member in getattr(b, "__annotations__", {}) for b in kind.mro())
    )


def returned(name: str) -> type:
    """What a function of the API returns."""
    kind: Any = signature(getattr(ho, name)).return_annotation
    kind = kind.strip('"') if isinstance(kind, str) else kind
    return getattr(importlib.import_module(RETURNED[kind]), kind) if isinstance(kind, str) else kind


@pytest.mark.parametrize("where", WHERE)
def test_every_name_of_the_api_is_there(where: str) -> None:
    for name, member in api_names(texts()[where]):
        found = getattr(ho, name)
        assert not member or not isinstance(found, type) or has(found, member), f"ho.{name}.{member}"


@pytest.mark.parametrize("where", WHERE)
def test_every_method_of_what_the_api_returns_is_there(where: str) -> None:
    """In code that assigns it: s = ho.solve(...), then s.plot()."""
    code = shown(texts()[where])
    for variable, name in re.findall(r"\b(\w+) = ho\.([a-z_]+)\(", code):
        for member in re.findall(rf"(?<![\w.]){variable}\.([a-z_]+)\(", code):
            assert has(returned(name), member), f"{variable}.{member}() of ho.{name}()"


@pytest.mark.parametrize("where", WHERE)
def test_every_member_of_a_class_is_there(where: str) -> None:
    """In sentences: Solution.sample."""
    for name, member in (found for code in inline(texts()[where]) for found in MEMBER.findall(code)):
        if kinds := classes().get(name):
            assert any(has(kind, member) for kind in kinds), f"{name}.{member}"


@pytest.mark.parametrize("where", WHERE)
def test_every_dotted_name_is_there(where: str) -> None:
    for name in set(re.findall(r"\bhopopt(?:\.[a-z_]+)+\b", texts()[where])) - {"hopopt.strategies"}:  # an entry point
        module, _, member = name.rpartition(".")
        try:
            importlib.import_module(name)
        except ModuleNotFoundError:
            assert hasattr(importlib.import_module(module), member), name


def commands() -> set[str]:
    return {name for name in app if not name.startswith("-")}


@cache
def options() -> set[str]:
    """Of all commands."""
    arguments = (argument for name in commands() for argument in app[name].assemble_argument_collection())
    return {name for argument in arguments for name in argument.names} | {"--version", "--install-completion", WITH}


@pytest.mark.parametrize("where", WHERE)
def test_every_command_and_option_in_a_sentence_is_one(where: str) -> None:
    for code in inline(texts()[where]):
        if (words := code.split())[:1] == ["hopopt"] and len(words) > 1:
            assert words[1].strip(",.;:") in {*commands(), "--help", "--version", "--install-completion", "COMMAND"}, (
                code
            )
        if code.startswith(("hopopt ", "--")):
            named = {word.partition("=")[0].strip(",.;:)") for word in words if word.startswith("--")}
            assert named - set(OF_OTHERS) <= options(), code


def test_there_is_one_list_of_names() -> None:
    assert dir(ho) == sorted(api.__all__)
    for name in api.__all__:
        assert getattr(ho, name) is getattr(api, name)
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        getattr(ho, "nothing")  # noqa: B009
