"""The JSON schema of problem files, made from the model: editors complete and check TOML files by it.

Draft 7, which editors understand. What a file may leave out depends on what it begins with: nothing is required of one
that extends another, and no links of one with a URDF or an MJCF.
"""

from collections.abc import Iterator, Mapping
from typing import Any

from hopopt.design import Design, Leg
from hopopt.design.fields import CATALOGUE_NAME
from hopopt.problem.catalogue import names
from hopopt.problem.catalogue_facts import CATALOGUE_PARTS
from hopopt.problem.checking.entries import raw_schema
from hopopt.problem.urdf.leg import ENTRIES, FURTHEST_POINT, KINDS

DRAFT = "http://json-schema.org/draft-07/schema#"
WRITTEN_ANEW = (
    "unit",
    "physical",
    "listed",
    "allowed",
    "title",
    "default",
    "description",
    "registry",
    "words",
)  # keywords that are written anew
OWN_CATALOGUE = "a .toml or .csv file of motors and gears of your own, beside this file or below"
EXTENDS = "a built-in problem, or a file in the same folder, whose entries count where this file has none"
URDF_ENTRIES = {
    "urdf": "robot description that the leg is read from: beside this file or below, or example-robot-data/...",
    "mjcf": "the same in MuJoCo's format, in place of a URDF: beside this file or below",
    "foot_frame": "link of the URDF, or body or site of the MJCF, whose origin touches the ground",
}
FOOT_POINT = "point of the foot that touches the ground, in the frame of foot_frame (default: its origin) [m]"
GEOMETRY = "whether the solids that the URDF states for collisions are the shapes of body and links (default: false)"
LOCKED = "joints of the URDF that do not move, each at its angle [rad]"
NAMED_PART = "a joint or a link of the leg, by its name"
Schema = dict[str, Any]


def problem_schema() -> Schema:
    """The schema of a problem file, as JSON data."""
    found = _plain(raw_schema())
    tables: dict[str, Schema] = found["definitions"]
    for table in (found, *tables.values()):
        table.pop("required", None)
    for part in CATALOGUE_PARTS:
        for table in (part.capitalize(), f"{part.capitalize()}Overrides"):
            tables[table]["properties"]["model"] = _named(part)
        tables[f"Named{part.capitalize()}"] = _catalogue(part)
    _open(tables["Leg"])
    _named_parts(tables)
    found["properties"]["catalogue"] = {"type": "string", "description": OWN_CATALOGUE}
    found["properties"]["extends"] = {"type": "string", "description": EXTENDS}
    head = {"$schema": DRAFT, "title": "hopopt problem", "description": (Design.__doc__ or "").split("\n")[0]}
    return {**head, **found, "allOf": [_complete(), _of_nobody_else()]}


def _plain(value: Any) -> Any:
    """Pydantic's schema in the words of draft 7."""
    if isinstance(value, list):
        return [_plain(x) for x in value]
    return dict(_keywords(value)) if isinstance(value, Mapping) else value


def _keywords(value: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    words = {"$defs": "definitions", "prefixItems": "items"}
    if isinstance(value.get("description"), str):
        unit = value.get("unit") or ""
        yield "description", f"{value['description']} [{unit}]" if unit not in ("", "1") else value["description"]
    if value.get("default") is not None and not isinstance(value["default"], Mapping):
        yield "default", value["default"]
    if "registry" in value:
        value = _with_names(value)
    for key, inner in value.items():
        if key in ("properties", "$defs"):
            yield words.get(key, key), {name: _plain(schema) for name, schema in inner.items()}
        elif key == "$ref":
            yield key, inner.replace("#/$defs/", "#/definitions/")
        elif key not in WRITTEN_ANEW:
            yield words.get(key, key), _plain(inner)


def _with_names(value: Mapping[str, Any]) -> dict[str, Any]:
    """One or several names of a registry, of which an editor completes those that are built in."""
    name = value.get("items", value)
    words = {"enum": value["words"]}
    either = {"anyOf": [*([words] if value["words"] else []), {"type": "string", "pattern": name["pattern"]}]}
    if "items" in value:
        return {**value, "items": either}
    return {k: x for k, x in value.items() if k not in ("type", "pattern")} | either


def _catalogue(part: str) -> Schema:
    """A name that an editor completes, or one of a user's own catalogue."""
    either = [{"enum": names(part)}, {"type": "string", "pattern": CATALOGUE_NAME}]
    return {"anyOf": either, "description": f"a {part} of the catalogue, beside whose numbers the others count"}


def _named(part: str) -> Schema:
    return {"$ref": f"#/definitions/Named{part.capitalize()}"}


def _named_parts(tables: dict[str, Schema]) -> None:
    """``motor = "name"`` in place of a table."""
    for owner in ("Leg", "Joint"):
        for part in CATALOGUE_PARTS:
            table = tables[owner]["properties"][part]
            tables[owner]["properties"][part] = {"anyOf": [_named(part), {"$ref": table["$ref"]}]}


def _open(leg: Schema) -> None:
    """[leg] as files have it: tables of joints and links by name, and a URDF."""
    for name in ("joint", "link"):
        del leg["properties"][name]
    leg["properties"] |= {name: {"type": "string", "description": words} for name, words in URDF_ENTRIES.items()}
    number = {"type": "number", "minimum": -FURTHEST_POINT, "maximum": FURTHEST_POINT}
    leg["properties"]["foot_point"] = {
        "type": "array", "items": number, "minItems": 3, "maxItems": 3, "description": FOOT_POINT,
    }  # fmt: skip
    leg["properties"]["geometry"] = {"type": "boolean", "description": GEOMETRY}
    leg["properties"]["locked"] = {
        "type": "object", "additionalProperties": {"type": "number"}, "description": LOCKED,
    }  # fmt: skip
    either = [{"$ref": "#/definitions/Joint"}, {"$ref": "#/definitions/Link"}]
    leg["additionalProperties"] = {"anyOf": either, "description": NAMED_PART}


def _of_nobody_else() -> Schema:
    """Names of a file that says it ``needs`` no module: they are built in, and an editor tells when one is misspelt."""
    tables = raw_schema()["$defs"]
    laws, scheme = tables["Motor"]["properties"]["laws"]["words"], tables["Solver"]["properties"]["scheme"]["words"]
    motor = {"properties": {"laws": {"items": {"enum": laws}}}}
    then = {"leg": {"properties": {"motor": motor}}, "solver": {"properties": {"scheme": {"enum": scheme}}}}
    return {"if": {"not": {"required": ["needs"]}}, "then": {"properties": then}}


def _complete() -> Schema:
    """What a file needs that extends no other, and a leg without a URDF."""
    required = {name: table.get("required", []) for name, table in raw_schema()["$defs"].items()}
    unnamed = {"type": "object", "not": {"required": ["model"]}}
    tables = {
        name: {"if": unnamed, "then": {"required": required[name.capitalize()]}} for name in ("body", "motor", "gear")
    }
    stated = {name: tables.get(name, {}) for name in [*Leg.model_fields, *ENTRIES]}
    either = {"anyOf": [{"required": required[kind]} for kind in ("Joint", "Link")]}
    needed = [name for name in required["Leg"] if name not in ("joint", "link")]
    leg = {
        "if": {"not": {"anyOf": [{"required": [kind]} for kind in KINDS]}},
        "then": {"required": needed, "properties": stated, "additionalProperties": either},
    }
    then = {"required": raw_schema()["required"], "properties": {"leg": leg}}
    return {"if": {"not": {"required": ["extends"]}}, "then": then}
