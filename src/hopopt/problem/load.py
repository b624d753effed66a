"""Problem files: TOML in, a checked ``Design`` out, and every fault of a file reported at once."""

import os
import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from hopopt.design import Design
from hopopt.errors import ProblemFileError, UsageError
from hopopt.files import read_regular
from hopopt.problem.catalogue import named, problems_folder, with_numbers
from hopopt.problem.checking.check import check
from hopopt.problem.checking.faults import OVERRIDE, Report
from hopopt.problem.checking.wording import did_you_mean
from hopopt.problem.render import Row, as_json, design_hash, resolved_toml, rows, shown, shown_path
from hopopt.problem.urdf import ENTRIES, located, with_leg

__all__ = ["Row", "as_json", "builtin_names", "design_hash", "load", "resolved_toml", "rows", "template"]

BARE_NAME = re.compile(r"[A-Za-z0-9_-][A-Za-z0-9._-]{0,99}")  # no separators, no drive letters, no leading dot
MAX_BYTES = 1_000_000  # of a file; a problem has a few thousand
MAX_DEPTH = 12  # of nested tables and lists; a problem needs 4
EXCLUSIVE = (("hip_height", "joint_angles"), ("joint_angles", "hip_height"))  # the later layer's start counts


class _NotAProblem(Exception):
    """What a file is instead, in words that follow its name."""


def load(source: str | Path = "paper", overrides: Mapping[str, Any] | Sequence[str] = ()) -> Design:
    """The problem called ``source``: a built-in name, or the path of a .toml file.

    ``overrides`` are laid over the file: texts such as "leg.gear.ratio=80", or a mapping of paths or nested
    tables to values (None takes an entry out). Raises ProblemFileError with one sentence for each fault.
    """
    report = Report(str(source))
    data: dict[str, Any] = {}
    for label, layer in _layers(source, report):
        _lay_over(data, with_numbers(_in_leg(_plain(layer)), data, label, report), label, report)
    _lay_overrides(data, overrides, report)
    return _checked(data if report.unreadable else with_leg(data, report), report)


def urdf_of(source: str | Path) -> Mapping[str, Any] | None:
    """Of a problem with a URDF its leg.urdf (the path from here), leg.foot_frame and leg.locked; None of one without.

    A design holds numbers only; this is for who wants more of the URDF, such as its meshes. Raises ProblemFileError.
    """
    report, data = Report(str(source)), dict[str, Any]()
    for label, layer in _layers(source, report):
        _lay_over(data, _plain(layer), label, report)
    if report.sentences:
        raise ProblemFileError(report.source, report.sentences)
    leg = data.get("leg", {})
    return {name: leg[name] for name in ENTRIES if name in leg} if "urdf" in leg else None


def as_design(problem: Any) -> Design:
    """A problem that may be given by its name or file; UsageError for what is none of these."""
    if isinstance(problem, str | Path):
        return load(problem)
    if not isinstance(problem, Design):
        raise UsageError(f"a problem is needed, not {problem!r:.80}: give its name or file, or ho.load('paper')")
    return problem


def changed(design: Design, entries: Mapping[str, Any]) -> Design:
    """The design with entries (paths to values) replaced; ProblemFileError with one sentence for each fault."""
    report = Report(design.name, design.name)
    data = design.model_dump(exclude_none=True)
    _lay_overrides(data, entries, report)
    return _checked(data, report)


def _checked(data: dict[str, Any], report: Report) -> Design:
    design = None if report.unreadable else check(data, report)
    if design is None or report.sentences:
        raise ProblemFileError(report.source, report.sentences)
    return design


def builtin_names() -> list[str]:
    """Names of the problems that come with hopopt."""
    return sorted(path.stem for path in problems_folder().glob("*.toml"))


def template(name: str) -> str:
    """Text of a new problem file called ``name``: the paper's leg, every entry explained.

    Raises ProblemFileError if ``name`` cannot name a problem.
    """
    text = (problems_folder() / "paper.toml").read_text(encoding="utf-8")
    try:
        load("paper", {"name": name})
    except ProblemFileError as error:
        raise ProblemFileError(name, [words.removeprefix("override ") for words in error.problems]) from None
    text = re.sub(r'^name = "paper" *', f'name = "{name}"'.ljust(34), text, count=1, flags=re.MULTILINE)
    return re.sub(r"^title = \"[^\"]*\" *", f'title = "{name}"'.ljust(34), text, count=1, flags=re.MULTILINE)


# ---- reading ------------------------------------------------------------------------------------------------


def _layers(source: str | Path, report: Report) -> list[tuple[str, dict[str, Any]]]:
    """(file name, table) of the file and of all it extends, the furthest base first."""
    layers: list[tuple[str, dict[str, Any]]] = []
    path, visited = _find(source, report), []
    while path is not None:
        report.file = report.file or _called(path)
        visited.append(path.absolute())
        data = _read(path, report)
        base = data.pop("extends", None)
        layers.insert(0, (_called(path), located(data, path.parent, _called(path), report)))
        path = None if base is None else _find_base(base, path, visited, report)
    return layers


def _called(path: Path) -> str:
    """A file in a message: as the user gave it, and a built-in one by its name."""
    return path.name if path.parent == problems_folder() else str(path)


def _find(source: str | Path, report: Report) -> Path | None:
    """The file ``source`` means."""
    text, names = str(source), builtin_names()
    if text in names:
        return problems_folder() / f"{text}.toml"
    if BARE_NAME.fullmatch(text) and "." not in text and not os.path.exists(text):
        own = f"{text}.toml"
        nearest = f" (did you mean {own}, which lies here?)" if os.path.isfile(own) else did_you_mean(text, names)
        return report.unusable(
            f"there is no built-in problem {shown(text)}{nearest}; built in: {', '.join(names)}; "
            "a file of your own is given by its path, ending in .toml"
        )
    return Path(source)


def _find_base(base: Any, path: Path, visited: list[Path], report: Report) -> Path | None:
    """The file that ``extends = base`` in ``path`` means: a built-in one, or one in the same folder."""
    known = f"a built-in name ({', '.join(builtin_names())}) or the name of a file in the same folder"
    where = f"{shown_path(_called(path))}: extends = {shown(base)}"
    if not isinstance(base, str) or not BARE_NAME.fullmatch(base) or ".." in base:
        return report.unusable(f"{where} is not allowed: write {known}, without any folder")
    folder = problems_folder() if base in builtin_names() else path.parent
    found = folder / f"{base.removesuffix('.toml')}.toml"
    if found.absolute() in visited:
        circle = " -> ".join([*(p.name for p in visited), found.name])
        return report.unusable(f"{where} goes in a circle ({circle}): remove one of these extends")
    if not os.path.exists(found):
        return report.unusable(f"{where}: there is no such problem; write {known}")
    return found


def _read(path: Path, report: Report) -> dict[str, Any]:
    """The table in a file; empty, and reported, if it cannot be had."""
    try:
        if os.path.isdir(path):
            inside = ", ".join(sorted(p.name for p in path.glob("*.toml"))) or "it holds none"
            raise _NotAProblem(f"is a folder: give the path of a .toml file ({inside})")
        raw = read_regular(path, MAX_BYTES + 1)
        if len(raw) > MAX_BYTES:
            raise _NotAProblem(f"has more than {MAX_BYTES} bytes: this is not a problem file")
        return _parse(raw)
    except FileNotFoundError:
        siblings, names = [p.name for p in path.parent.glob("*.toml")], builtin_names()
        hint = did_you_mean(path.name, siblings) or f"; built in: {', '.join(names)}"
        if path.stem in names:
            hint = f"; the built-in problem is called {path.stem}, without .toml"
        report.unusable(f"{shown_path(str(path))}: there is no such file{hint}")
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else str(error)
        report.unusable(f"{shown_path(str(path))} cannot be read: {reason}")
    except _NotAProblem as error:
        report.unusable(f"{shown_path(str(path))} {error}")
    return {}


def _parse(raw: bytes) -> dict[str, Any]:
    """The table in the bytes of a TOML file."""
    try:
        text = raw.decode("utf-8-sig")  # editors on Windows put a byte-order mark in front
    except UnicodeDecodeError as error:
        line = raw.count(b"\n", 0, error.start) + 1
        raise _NotAProblem(f"is not text (line {line} is not UTF-8): a problem file is a TOML text file") from None
    if text.lstrip().startswith("<"):
        raise _NotAProblem("is XML (a URDF?), not a problem file in TOML: `hopopt new my_leg` writes one to start from")
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise _NotAProblem(_syntax_fault(str(error), text)) from None
    except (ValueError, RecursionError):  # numbers of thousands of digits, thousands of brackets
        raise _NotAProblem("is not a problem file: a number is too long or brackets are nested too deeply") from None
    if any(depth > MAX_DEPTH for depth in _depths(data)):
        raise _NotAProblem(f"is not a problem file: tables are nested more than {MAX_DEPTH} deep")
    return data


def _syntax_fault(message: str, text: str) -> str:
    found, lines = re.search(r" \(at line (\d+), column \d+\)$", message), text.splitlines()
    number = int(found[1]) if found else max(len(lines), 1)
    line = lines[number - 1].strip() if number <= len(lines) else ""
    return (
        f"line {number} is not valid TOML: {message[: found.start()] if found else message}. It reads {shown(line)}; "
        'write key = value, text in "quotes", tables as [leg.gear], comments after #'
    )


def _depths(data: Any) -> Iterator[int]:
    """Depth of everything in ``data``, without recursion; stops soon after MAX_DEPTH."""
    level, depth = [data], 0
    while level and depth <= MAX_DEPTH:
        depth += 1
        inner = [list(item.values()) if isinstance(item, Mapping) else item for item in level]
        level = [x for items in inner for x in items if isinstance(x, (Mapping, list, tuple))]
        yield depth


# ---- overrides and layers -------------------------------------------------------------------------------------


def _lay_overrides(data: dict[str, Any], overrides: Mapping[str, Any] | Sequence[str], report: Report) -> None:
    """Lay overrides over ``data``: names of motors and gears first, so that numbers count over them in any order."""
    layers = [_in_leg(_plain(layer)) for layer in _override_layers(overrides, report)]
    for layer in sorted(layers, key=named, reverse=True):
        _lay_over(data, with_numbers(layer, data, OVERRIDE, report), OVERRIDE, report)


def _override_layers(overrides: Mapping[str, Any] | Sequence[str], report: Report) -> Iterator[dict[str, Any]]:
    """Each override as nested tables."""
    if isinstance(overrides, Mapping):
        pairs = [(str(path), value) for path, value in overrides.items()]
    else:
        texts = [overrides] if isinstance(overrides, str) else overrides
        pairs = [pair for text in texts if (pair := _override_pair(str(text), report))]
    for path, value in pairs:
        keys = path.split(".")
        if not all(keys) or len(keys) > MAX_DEPTH or any(depth > MAX_DEPTH for depth in _depths([value])):
            report.fault(f"override {shown(path)} is not the path of an entry: write one such as leg.gear.ratio=80")
            continue
        for key in reversed(keys):
            value = {key: value}
        yield value


def _override_pair(text: str, report: Report) -> tuple[str, Any] | None:
    """("leg.gear.ratio", 80) from "leg.gear.ratio=80"; what is no TOML value is taken as text."""
    path, equals, value = text.partition("=")
    if not equals:
        return report.fault(f"override {shown(text)} has no '=': write path=value, such as leg.gear.ratio=80")
    try:
        parsed = tomllib.loads(f"value = {value}")
    except (ValueError, RecursionError):
        parsed = {}
    return path.strip(), parsed["value"] if len(parsed) == 1 else value.strip()


def _in_leg(layer: dict[str, Any]) -> dict[str, Any]:
    """A layer whose table [supply] is the leg's, as what feeds its motors belongs to it."""
    if "supply" not in layer:
        return layer
    rest, leg = {key: value for key, value in layer.items() if key != "supply"}, layer.get("leg", {})
    if not isinstance(leg, dict):
        return layer
    return {**rest, "leg": {**leg, "supply": layer["supply"]}}


def _plain(value: Any) -> Any:
    """Lists as tuples, NumPy numbers as Python's own: what strict models accept."""
    value = value.tolist() if hasattr(value, "tolist") else value
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    return tuple(_plain(item) for item in value) if isinstance(value, (list, tuple)) else value


def _lay_over(base: dict[str, Any], layer: dict[str, Any], label: str, report: Report, path: str = "") -> None:
    """Merge ``layer`` into ``base``, table by table, and note where each entry came from."""
    for key, value in layer.items():
        here = f"{path}.{key}" if path else key
        if isinstance(value, dict):
            if not isinstance(base.get(key), dict):
                report.origins[here], base[key] = label, {}
            _lay_over(base[key], value, label, report, here)
        elif value is None:
            base.pop(key, None)
        else:
            report.origins[here], base[key] = label, value
    for given, dropped in EXCLUSIVE if path == "start" else ():
        if given in layer and dropped not in layer:
            base.pop(dropped, None)
