"""Digests of a result's files, so that what was changed after it was written is not restated as verified.

They tell mistakes and damage, not malice: whoever changes a file can change its digest too. ``hopopt verify`` recomputes
every check and then writes them anew.
"""

import hashlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from hopopt.files import write_whole

DATA = ("solution.nc", "summary.json", "problem.toml")  # what a result is read from; figures are drawn from it


def digest(content: bytes) -> str:
    """SHA-256 of a file's content, in hexadecimal digits."""
    return hashlib.sha256(content).hexdigest()


def digests(folder: Path, names: Sequence[str] = DATA) -> dict[str, str]:
    """Digest of each of the files of a folder that are there, by name."""
    return {name: digest((folder / name).read_bytes()) for name in names if (folder / name).is_file()}


def changed(folder: Path, names: Sequence[str] = DATA) -> list[str]:
    """A sentence for every file that is not as its manifest.json has it; or that the manifest has no digests."""
    known = manifest_of(folder).get("sha256")
    if not isinstance(known, Mapping):
        return ["manifest.json holds no digests of the files"]
    return [
        f"{name} was changed after it was written (its digest differs from manifest.json)"
        for name, found in digests(folder, names).items()
        if known.get(name) != found
    ]


def manifest_of(folder: Path) -> dict[str, Any]:
    """What manifest.json holds; empty if it cannot be read."""
    try:
        data = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return data if isinstance(data, dict) else {}


def seal(folder: Path, names: Sequence[str] = DATA, more: Mapping[str, Any] | None = None) -> None:
    """Write the digests of a folder's files into its manifest.json, with ``more`` entries; the rest of it is kept."""
    data = {**manifest_of(folder), **(more or {}), "sha256": digests(folder, names)}
    write_whole(folder / "manifest.json", (json.dumps(data, indent=2) + "\n").encode())
