"""Problem files: TOML in, a checked ``Design`` out, and every fault of a file reported at once."""

import os
import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from hopopt.design import Design
from hopopt.drivetrain.motor import IMPLIES
from hopopt.errors import ProblemFileError, UsageError
from hopopt.extensions import absent
from hopopt.problem.catalogue import Entry, catalogue, problems_folder
from hopopt.problem.catalogue_files import read_own
from hopopt.problem.checking.check import check
from hopopt.problem.checking.faults import OVERRIDE, Report
from hopopt.problem.checking.wording import did_you_mean
from hopopt.problem.named_parts import gives, named, with_numbers
from hopopt.problem.reading import MAX_DEPTH, beside, read_tables, too_deep
from hopopt.problem.render import Row, as_json, design_hash, place, resolved_toml, rows, shown, shown_path, values_of
from hopopt.problem.urdf.leg import ENTRIES, located, with_leg

__all__ = ["Row", "as_json", "builtin_names", "design_hash", "load", "resolved_toml", "rows", "template"]

BARE_NAME = re.compile(r"[A-Za-z0-9_-][A-Za-z0-9._-]{0,99}")  # no separators, no drive letters, no leading dot
EXCLUSIVE = (("hip_height", "joint_angles"), ("joint_angles", "hip_height"))  # the later layer's start counts


def load(
    source: str | Path = "paper", overrides: Mapping[str, Any] | Sequence[str] = (), *, without_modules: bool = False
) -> Design:
    """The problem in a file, with entries changed.

    source: a built-in name, or the path of a .toml file
    overrides: laid over the file: texts such as "leg.gear.ratio=80", or a mapping of paths or nested tables to values; None
        takes an entry out
    without_modules: names of modules that are not here are no faults

    Raises ProblemFileError with one sentence for each fault.
    """
    report = Report(str(source))
    data, own = dict[str, Any](), dict[str, Entry]()
    for label, layer in _layers(source, report):
        own |= _own_entries(layer.pop("catalogue", None), report)
        _lay_over(data, with_numbers(_in_leg(_plain(layer)), data, own, label, report), label, report)
    _lay_overrides(data, overrides, own, report)
    return _checked(data if report.unreadable else with_leg(data, report), report, without_modules)


def catalogue_of(source: str | Path = "paper", overrides: Mapping[str, Any] | Sequence[str] = ()) -> dict[str, Entry]:
    """The motors and gears that a problem can name: the built-in ones, and those of its own catalogues and of the overrides'.
    ProblemFileError."""
    report, own = Report(str(source)), dict[str, Entry]()
    for layer in (*(table for _, table in _layers(source, report)), *_override_layers(overrides, report)):
        own |= _own_entries(layer.get("catalogue"), report)
    if report.sentences:
        raise ProblemFileError(report.source, report.sentences)
    return {**catalogue(), **own}


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


def changed(design: Design, entries: Mapping[str, Any], own: Mapping[str, Entry] | None = None) -> Design:
    """The design with entries (paths to values) replaced; ``own``: motors and gears that they may name beside the built-in
    ones. ProblemFileError with one sentence for each fault."""
    report = Report(design.name, design.name)
    data = design.model_dump(exclude_none=True)
    _lay_overrides(data, _whole_lists(design, entries), own or {}, report)
    return _checked(data, report, without_modules=bool(absent(design.needs or ())))


def _whole_lists(design: Design, entries: Mapping[str, Any]) -> dict[str, Any]:
    """The entries with whole lists in place of single values of them, such as hop.stance_duration[1]."""
    found = dict[str, Any]()
    for entry, value in entries.items():
        path, index = place(entry)
        listed = None if index is None else found.get(path, values_of(design).get(path))
        if index is not None and isinstance(listed, (tuple, list)) and index < len(listed):
            found[path] = [value if k == index else x for k, x in enumerate(listed)]
        else:
            found[entry] = value
    return found


def _checked(data: dict[str, Any], report: Report, without_modules: bool = False) -> Design:
    design = None if report.unreadable else check(data, report, without_modules)
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
        data = read_tables(path, report, partial(_absent, path))
        base = data.pop("extends", None)
        if "catalogue" in data:
            data["catalogue"] = _catalogue_file(data["catalogue"], path, report)
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


def _absent(path: Path) -> str:
    """What to say where a problem file is missing."""
    siblings, names = [p.name for p in path.parent.glob("*.toml")], builtin_names()
    if path.stem in names:
        return f"; the built-in problem is called {path.stem}, without .toml"
    return did_you_mean(path.name, siblings) or f"; built in: {', '.join(names)}"


def _catalogue_file(name: Any, problem: Path, report: Report) -> Path | None:
    """The file that ``catalogue = name`` in a problem file means: beside it, or below."""
    where = f"{shown_path(_called(problem))}: catalogue = {shown(name)}"
    return beside(name, problem.parent, where, "catalogue", _no_catalogue, report)


def _no_catalogue(found: Path) -> str:
    there = [p.name for p in found.parent.glob("*.*") if p.suffix.lower() in (".toml", ".csv")]
    return f"there is no such file beside the problem{did_you_mean(found.name, there)}"


def _own_entries(file: Any, report: Report) -> dict[str, Entry]:
    """The entries of a user's catalogue; None names none."""
    if file is not None and not isinstance(file, (str, Path)):
        report.unusable(f"override catalogue = {shown(file)} is not the path of a file")
    return read_own(Path(file), report) if isinstance(file, (str, Path)) else {}


# ---- overrides and layers -------------------------------------------------------------------------------------


def _lay_overrides(
    data: dict[str, Any], overrides: Mapping[str, Any] | Sequence[str], own: Mapping[str, Entry], report: Report
) -> None:
    """Lay overrides over ``data``: names of motors and gears first, then motors' voltages, so that numbers count over them in
    any order.

    ``own``: entries of the problem's catalogue; the overrides may name one more, whose path counts from where we are.
    """
    layers, known = [_in_leg(_plain(layer)) for layer in _override_layers(overrides, report)], dict(own)
    for layer in layers:
        known |= _own_entries(layer.pop("catalogue", None), report)
    for layer in sorted(layers, key=lambda layer: (named(layer), gives(layer, "motor", "voltage")), reverse=True):
        _lay_over(data, with_numbers(layer, data, known, OVERRIDE, report), OVERRIDE, report)


def _override_layers(overrides: Mapping[str, Any] | Sequence[str], report: Report) -> Iterator[dict[str, Any]]:
    """Each override as nested tables."""
    if isinstance(overrides, Mapping):
        pairs = [(str(path), value) for path, value in overrides.items()]
    else:
        texts = [overrides] if isinstance(overrides, str) else overrides
        pairs = [pair for text in texts if (pair := _override_pair(str(text), report))]
    for path, value in pairs:
        keys = path.split(".")
        if not all(keys) or len(keys) > MAX_DEPTH or too_deep([value]):
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
    """Merge ``layer`` into ``base``, table by table, and note where each entry came from. A layer that is the first to give a
    motor's voltage takes out the torque and speed that its datasheet implies."""
    began = "voltage" in base
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
    if path.endswith(".motor") and "voltage" in layer and not began:
        for dropped in set(IMPLIES) - layer.keys():
            base.pop(dropped, None)
    for given, dropped in EXCLUSIVE if path == "start" else ():
        if given in layer and dropped not in layer:
            base.pop(dropped, None)
