"""How an entry of a summary is declared: with its meaning and unit, which the JSON schema repeats."""

from collections.abc import Mapping
from dataclasses import field, fields, is_dataclass
from math import inf
from typing import Annotated, Any, ClassVar

from pydantic import BeforeValidator, ConfigDict, WithJsonSchema

Real = Annotated[  # JSON knows no infinity: null stands for it
    float,
    BeforeValidator(lambda value: inf if value is None else value),
    WithJsonSchema({"anyOf": [{"type": "number"}, {"type": "null"}]}),
]


def stated(meaning: str, **more: Any) -> Any:
    """A field with its meaning and unit."""
    return field(metadata={"description": meaning, **more})


def if_any(meaning: str, default: Any = None, **more: Any) -> Any:
    """A field that is left out where it is its default: None, or an empty tuple."""
    return field(default=default, kw_only=True, metadata={"description": meaning, "if_any": True, **more})


class Strict:
    """A part of the summary: keys that it does not know are refused."""

    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(extra="forbid")


def as_data(value: Any) -> Any:
    """A summary, or a part of it, as JSON data."""
    if is_dataclass(value):
        named = {f.metadata.get("alias", f.name): (f, getattr(value, f.name)) for f in fields(value)}
        return {key: as_data(x) for key, (f, x) in named.items() if not (f.metadata.get("if_any") and x == f.default)}
    if isinstance(value, Mapping):
        return {key: as_data(x) for key, x in value.items()}
    return [as_data(x) for x in value] if isinstance(value, list | tuple) else value
