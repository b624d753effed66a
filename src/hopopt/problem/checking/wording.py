"""What an entry of a problem may be, and what its author may have meant, in words made from the model."""

from collections.abc import Iterable, Iterator, Sequence
from difflib import get_close_matches
from inspect import isclass
from typing import Any, Literal, TypeGuard, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from hopopt.design import Design
from hopopt.design.fields import LOOKALIKES
from hopopt.problem.render import shown

Bounds = tuple[float | None, float | None]
SHARE = (0.5, 10.0)  # least and largest upper bound of what may be a share; less is a tolerance, more a ratio
NEAR_WHOLE = 0.02  # relative: 0.33 is taken for 1/3


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """The known word nearest to ``word`` as a question in brackets, empty if none is near."""
    close = get_close_matches(word, list(known), n=1)
    return f" (did you mean {close[0]}?)" if close else ""


def is_number(value: Any) -> TypeGuard[float]:
    """Whether a file's value is a number; true and false are not."""
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def entry_at(kind: Any, loc: Sequence[int | str]) -> tuple[Any, FieldInfo | None]:
    """What stands at pydantic's location ``loc`` in the model ``kind``: its type, and its field if it has one."""
    info = None
    for step in loc:
        if get_origin(kind) is dict:  # leg.joint and leg.link
            kind, info = get_args(kind)[1], None
        elif isinstance(step, str) and isclass(kind) and issubclass(kind, BaseModel) and step in kind.model_fields:
            info = kind.model_fields[step]
            kind = required_type(info.annotation)
        elif isinstance(step, str):
            return None, None
    return kind, info


def required_type(annotation: Any) -> Any:
    """X of X | None, else the type itself."""
    inner = [arg for arg in get_args(annotation) if arg is not type(None)]
    return inner[0] if len(inner) == 1 and type(None) in get_args(annotation) else annotation


def unit_of(info: FieldInfo | None) -> str:
    """Unit of an entry, empty if it has none or is a ratio."""
    return _extra(info, "unit").removesuffix("1")


def bounds_of(info: FieldInfo | None) -> Bounds:
    """Smallest and largest value of an entry, or of each number of a list."""
    found: dict[str, float] = {}
    for limit in _limits(info):
        found |= {name: getattr(limit, name) for name in ("ge", "le") if hasattr(limit, name)}
    return found.get("ge"), found.get("le")


def allowed(info: FieldInfo | None) -> str:
    """What an entry may be."""
    kind = required_type(info.annotation) if info else None
    words = _literals(kind)
    if reported := _extra(info, "allowed"):
        return reported
    if words:
        return ("a list of " if get_origin(kind) is tuple else "") + " or ".join(f'"{word}"' for word in words)
    if get_origin(kind) is tuple and str in get_args(kind):
        return 'a list of names, such as ["hip", "knee"],'
    if get_origin(kind) is tuple:
        return f"a list of {'numbers' if ... in get_args(kind) else 'two numbers'}, each{_within(info)},"
    if kind in (int, float):
        return ("a whole number" if kind is int else "a number") + _within(info)
    return "true or false" if kind is bool else "a table"


def hint(value: Any, info: FieldInfo | None, *, in_list: bool = False) -> str:
    """What the author of ``value`` (or of one ``in_list``) may have meant, to end a sentence; may be empty."""
    kind = required_type(info.annotation) if info else None
    if get_origin(kind) is tuple and isinstance(value, str) and not in_list:
        listed = value.startswith("[")  # --set takes what is no TOML value as text
        return "; write its names in quotes" if listed else "; write it in [ ]"
    if isinstance(value, str) and (close := get_close_matches(value, _literals(kind), n=1)):
        return f'; did you mean "{close[0]}"?'
    if isinstance(value, str) and kind in (int, float):
        return "; write the number alone, without quotes or unit"
    return lookalike(value, _extra(info, "unit"), bounds_of(info)) if is_number(value) else ""


def lookalike(value: float, unit: str, bounds: Bounds) -> str:
    """What ``value`` means if it was written in another unit and is plausible then; empty if it does not."""
    low, high = (-float("inf") if bounds[0] is None else bounds[0], float("inf") if bounds[1] is None else bounds[1])
    if not 1e-12 < abs(value) < 1e12 or low <= value <= high:
        return ""
    others = [(name, value * si) for name, si in LOOKALIKES.get(unit, ())]
    if unit == "1":
        others = _share_or_ratio(value, low, high)
    meant = [f"{name}: write {other:.6g}" for name, other in others if low <= other <= high]
    return f"; {shown(value)} looks like {', or like '.join(meant)}" if meant else ""


def _share_or_ratio(value: float, low: float, high: float) -> list[tuple[str, float]]:
    """A share that was written in per cent, or a ratio that the inverse of a whole number was written for."""
    if SHARE[0] <= high <= SHARE[1] and 2 <= value <= 100:
        return [("per cent", value / 100)]
    whole = round(1 / value)
    return [(f"1/{whole}", whole)] if low >= 1 and whole >= 2 and abs(whole * value - 1) < NEAR_WHOLE else []


def homes(key: str) -> list[str]:
    """The tables that have an entry called ``key``."""
    return [f"[{path}]" if path else "the top of the file" for path, name in _entries("", Design) if name == key]


def _entries(path: str, kind: Any) -> Iterator[tuple[str, str]]:
    for name, info in kind.model_fields.items():
        inner = required_type(info.annotation)
        if get_origin(inner) is dict:
            yield from _entries(f"{path}.<{name}>", get_args(inner)[1])
        elif isclass(inner) and issubclass(inner, BaseModel):
            yield from _entries(f"{path}.{name}" if path else name, inner)
        else:
            yield path, name


def _extra(info: FieldInfo | None, key: str) -> str:
    extra = info.json_schema_extra if info else None
    return str(extra.get(key, "")) if isinstance(extra, dict) else ""


def _limits(info: FieldInfo | None) -> list[Any]:
    """The limits of an entry, or those declared for the numbers of its list."""
    if info is None:
        return []
    inside = [note for arg in get_args(required_type(info.annotation)) for note in getattr(arg, "__metadata__", ())]
    return [*info.metadata, *(limit for note in inside for limit in note.metadata)]


def _literals(kind: Any) -> list[str]:
    """The words an entry, or each entry of a list, may be."""
    if get_origin(kind) is Literal:
        return list(get_args(kind))
    return [word for arg in get_args(kind) if get_origin(arg) is Literal for word in get_args(arg)]


def _within(info: FieldInfo | None) -> str:
    low, high = bounds_of(info)
    return f" from {low:.10g} to {high:.10g} {unit_of(info)}".rstrip() if low is not None and high is not None else ""
