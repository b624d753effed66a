"""How a figure of a result is declared: with its meaning and unit, and by what it is computed.

A record is a frozen dataclass whose fields are made here. Pydantic writes it as JSON, reads it back, and describes it by a
schema (``adapter``); the schema repeats meanings and units.
"""

from collections.abc import Callable
from dataclasses import MISSING, field, fields
from functools import cache
from math import inf
from typing import Annotated, Any, ClassVar

from pydantic import BeforeValidator, ConfigDict, TypeAdapter, WithJsonSchema

Real = Annotated[  # JSON knows no infinity: null stands for it
    float,
    BeforeValidator(lambda value: inf if value is None else value),
    WithJsonSchema({"anyOf": [{"type": "number"}, {"type": "null"}]}),
]


def stated(meaning: str, by: Callable[[Any], Any] | None = None, default: Any = MISSING, **more: Any) -> Any:
    """A field with its meaning and unit.

    by: what computes it from a source (``computed``); None for one that is given
    more: what pydantic's Field takes
    """
    return field(default=default, metadata={"description": meaning, "by": by, **more})


def if_any(meaning: str, by: Callable[[Any], Any] | None = None, default: Any = None, **more: Any) -> Any:
    """A field that is left out of the JSON where it is its default: None, or an empty tuple."""
    more = {"exclude_if": lambda value: value == default, **more}
    return field(default=default, kw_only=True, metadata={"description": meaning, "by": by, **more})


class Strict:
    """A record that refuses keys which it does not know."""

    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(extra="forbid")


class Derived:
    """A record with entries that follow from others (pydantic's computed_field): they are written, and computed anew when
    it is read."""

    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(
        extra="ignore",
        json_schema_extra={"additionalProperties": False},
        json_schema_serialization_defaults_required=True,
    )


def computed(kind: type, source: Any) -> dict[str, Any]:
    """The fields of a record that say by what they are computed, from a source, by name."""
    return {f.name: by(source) for f in fields(kind) if (by := f.metadata.get("by"))}


@cache
def adapter(kind: type) -> TypeAdapter[Any]:
    """What writes, reads and describes a record; made when it is first needed, for a large one takes a tenth of a second."""
    return TypeAdapter(kind)


def as_data(record: Any, kind: type | None = None) -> Any:
    """A record as JSON data; ``kind``: as what it is written, such as a record that it extends (default: its own)."""
    return adapter(kind or type(record)).dump_python(record, mode="json", by_alias=True)
