"""Every entry of a problem as pydantic's JSON schema describes it: kind, range, unit, meaning."""

from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from typing import Any

from pydantic.json_schema import GenerateJsonSchema

from hopopt import extensions
from hopopt.design import Design

Entry = Mapping[str, Any]  # of pydantic's schema, a reference resolved


class _WithoutNulls(GenerateJsonSchema):
    """What may be left out has the schema of what may be written: TOML has no null."""

    def nullable_schema(self, schema: Any) -> dict[str, Any]:
        return self.generate_inner(schema["schema"])


@cache
def raw_schema() -> dict[str, Any]:
    """Pydantic's schema of a problem, tables of joints and links under ``joint`` and ``link``."""
    return Design.model_json_schema(schema_generator=_WithoutNulls)


def entry_at(loc: Sequence[int | str]) -> Entry | None:
    """The entry or table at pydantic's location ``loc``, for a place in a list the list; None if there is none."""
    found = raw_schema()
    for step in loc:
        if isinstance(step, str):
            inner = found.get("properties", {}).get(step) or found.get("additionalProperties")
            if not inner:
                return None
            found = _resolved(inner)
    return found


def unit_of(entry: Entry | None) -> str:
    """Unit of an entry, empty if it has none or is a ratio."""
    return (entry or {}).get("unit", "").removesuffix("1")


def bounds_of(entry: Entry) -> tuple[float, float]:
    """Smallest and largest value of an entry, or of each number of a list; infinite where there is none."""
    number = entry if "minimum" in entry else _item(entry)
    return number.get("minimum", -float("inf")), number.get("maximum", float("inf"))


def words_of(entry: Entry) -> Sequence[str]:
    """The words that an entry, or each entry of a list, may be."""
    if "registry" in entry:
        return list(dict.fromkeys([*entry["words"], *extensions.names(entry["registry"])]))
    return entry.get("enum") or _item(entry).get("enum", ())


def homes(key: str) -> list[str]:
    """The tables that have an entry called ``key``."""
    return [f"[{path}]" if path else "the top of the file" for path, name in _entries("", raw_schema()) if name == key]


def _item(entry: Entry) -> Entry:
    """What a list holds; nothing for an entry that is no list."""
    return entry.get("items") or next(iter(entry.get("prefixItems", ())), {})


def _entries(path: str, table: Entry) -> Iterator[tuple[str, str]]:
    """(path of its table, name) of every entry; ``leg.<joint>`` stands for the tables of all joints."""
    for name, entry in table["properties"].items():
        inner = _resolved(entry)
        if "properties" in inner:
            yield from _entries(f"{path}.{name}" if path else name, inner)
        elif inner.get("additionalProperties"):
            yield from _entries(f"{path}.<{name}>", _resolved(inner["additionalProperties"]))
        else:
            yield path, name


def _resolved(entry: Entry) -> dict[str, Any]:
    if "$ref" not in entry:
        return dict(entry)
    return {**raw_schema()["$defs"][entry["$ref"].rpartition("/")[2]], "description": "", **entry}
