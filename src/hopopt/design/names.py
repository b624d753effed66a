"""Which entries of a problem are names of registries, such as drive laws (extensions.py)."""

from collections.abc import Iterator
from typing import NamedTuple

from pydantic import BaseModel

from hopopt.design.problem import Design


class NamedEntry(NamedTuple):
    """A name in a problem: where it stands, as pydantic counts, of which registry it is, and what it is."""

    at: tuple[str | int, ...]
    kind: str
    name: str


def names_in(design: Design) -> Iterator[NamedEntry]:
    """Every name of a registry that a problem has, in the order of the file."""
    return _names((), design)


def _names(at: tuple[str | int, ...], section: BaseModel) -> Iterator[NamedEntry]:
    for entry, info in type(section).model_fields.items():
        value, extra = getattr(section, entry), info.json_schema_extra
        if isinstance(value, BaseModel):
            yield from _names((*at, entry), value)
        elif isinstance(value, dict):
            for key, item in value.items():
                yield from _names((*at, entry, key), item)
        elif isinstance(extra, dict) and "registry" in extra and value is not None:
            listed = isinstance(value, tuple)
            for k, name in enumerate(value if listed else (value,)):
                yield NamedEntry((*at, entry, k) if listed else (*at, entry), str(extra["registry"]), name)
