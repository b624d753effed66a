"""summary.json read back as a summary, or refused in one sentence."""

import json
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from hopopt.errors import ResultError
from hopopt.planner.answer.summary import OLDEST, VERSION, Summary
from hopopt.record import adapter, as_data
from hopopt.storage.folder import finite


def read_summary(path: Path) -> tuple[Summary, list[str]]:
    """The summary in a file, and what in it contradicts itself, a sentence each; ResultError if it is none, naming the key
    at fault and what to do."""
    content = path.read_bytes()
    try:
        summary: Summary = adapter(Summary).validate_json(content, strict=True)
    except ValidationError as error:
        raise ResultError(f"{path}: {_fault(error.errors()[0])}: solve it again") from error
    data, again = json.loads(content), finite(as_data(summary))  # what follows from other entries was computed anew
    wrong = [name for name in {**data, **again} if data.get(name) != again.get(name)]
    return summary, [*summary.contradictions(), *(f"{name} is not what its own entries say" for name in wrong)]


def _fault(error: Any) -> str:
    """The first fault of a summary, in words."""
    key, kind, given = ".".join(map(str, error["loc"])), error["type"], error["input"]
    if kind in ("json_invalid", "dataclass_type") and not key:
        return "it is damaged, not a JSON object"
    if key == "version":
        found = "no version" if kind == "missing" else f"version {given!s:.20}"
        return f"it has {found}, and this hopopt reads versions {OLDEST} to {VERSION}"
    if kind == "missing":
        return f"it is damaged or of an earlier version (an entry is missing: {key})"
    if kind == "unexpected_keyword_argument":
        return f"it has an entry that no summary has: {key}"
    return f"its entry {key} is {given!s:.40}, which is no such entry ({error['msg'].lower()})"


def summary_schema() -> dict[str, Any]:
    """The JSON schema of summary.json, as JSON data."""
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema"}
    return {**head, **adapter(Summary).json_schema(mode="serialization"), "title": "hopopt summary"}
