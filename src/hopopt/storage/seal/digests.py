"""Digests of a result's files and of their entries, so that what was changed after it was written is told.

They tell mistakes and damage, not malice: whoever changes a file can change its digest too. Only what writes a file writes
its digest: nothing that reads or checks a result renews one.

manifest.json
    sha256      of every file; its own: of all its entries but that
    entries     of the entries of every file, to name those that were changed
"""

import hashlib
import json
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from hopopt.files import write_whole
from hopopt.storage.netcdf import read as read_netcdf

DATA = ("solution.nc", "summary.json", "problem.toml")  # what a result is read from; figures are drawn from it
MANIFEST = "manifest.json"
DIGEST_DIGITS = 16  # hexadecimal digits of an entry's digest


def digest(content: bytes) -> str:
    """SHA-256 of a file's content, in hexadecimal digits."""
    return hashlib.sha256(content).hexdigest()


def digests(folder: Path, names: Sequence[str] = DATA) -> dict[str, str]:
    """Digest of each of the files of a folder that are there, by name."""
    return {name: digest((folder / name).read_bytes()) for name in names if (folder / name).is_file()}


def changed_entries(folder: Path, names: Sequence[str] = DATA) -> dict[str, list[str] | None]:
    """Files of a folder that are not as its manifest.json has them, and the names of their entries that are not: none if
    only spaces or digests are, None if the manifest does not say. KeyError if it holds no digests."""
    manifest = manifest_of(folder)
    files = _table(manifest, "sha256")
    if files is None:
        raise KeyError("sha256")
    found, known = digests(folder, names), _table(manifest, "entries")
    if known is not None or MANIFEST in files:  # results stored by earlier versions have neither
        found[MANIFEST] = _own(manifest)
    wrong = [name for name in (*names, MANIFEST) if files.get(name) != found.get(name)]
    return {name: _differing(folder / name, (known or {}).get(name)) for name in wrong}


def changed(folder: Path, names: Sequence[str] = DATA) -> list[str]:
    """A sentence for every file that is not as its manifest.json has it; or that the manifest has no digests."""
    try:
        wrong = changed_entries(folder, names)
    except KeyError:
        return [f"{MANIFEST} holds no digests of the files"]
    return [_sentence(folder, name, parts) for name, parts in wrong.items()]


def _sentence(folder: Path, name: str, parts: list[str] | None) -> str:
    if not (folder / name).is_file():
        return f"{name} is gone, or was never there ({MANIFEST} has its digest)"
    which = f": {', '.join(parts)}" if parts else ""
    return f"{name} was changed after it was written{which} (its digest differs from {MANIFEST})"


def manifest_of(folder: Path) -> dict[str, Any]:
    """What manifest.json holds; empty if it cannot be read."""
    try:
        data = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    return data if isinstance(data, dict) else {}


def seal(folder: Path, names: Sequence[str] = DATA, more: Mapping[str, Any] | None = None) -> None:
    """Write the digests of files that were just written into the folder's manifest.json, with ``more`` entries; the rest
    of it is kept."""
    data = {**manifest_of(folder), **(more or {})}
    known = {name: parts for name in names if (parts := _parts(folder / name)) is not None}
    data["entries"] = {**(_table(data, "entries") or {}), **known, MANIFEST: _digests(_rest(data))}
    files = {**(_table(data, "sha256") or {}), **digests(folder, names)}
    data["sha256"] = {**files, MANIFEST: _own({**data, "sha256": files})}
    write_whole(folder / MANIFEST, (json.dumps(data, indent=2) + "\n").encode())


def _table(manifest: Mapping[str, Any], name: str) -> dict[str, Any] | None:
    found = manifest.get(name)
    return found if isinstance(found, dict) else None


def _own(manifest: Mapping[str, Any]) -> str:
    """Digest of a manifest's entries but itself."""
    files = {name: x for name, x in (_table(manifest, "sha256") or {}).items() if name != MANIFEST}
    return digest(_canonical({**manifest, "sha256": files}))


def _rest(manifest: Mapping[str, Any]) -> dict[str, Any]:
    """A manifest's entries that are no digests."""
    return {name: x for name, x in manifest.items() if name not in ("sha256", "entries")}


def _differing(path: Path, known: Any) -> list[str] | None:
    """Names of the entries of a file that are not as they were."""
    found = _parts(path)
    if found is None or not isinstance(known, Mapping):
        return None
    return [name for name in {**known, **found} if known.get(name) != found.get(name)]


def _parts(path: Path) -> dict[str, str] | None:
    """Digest of each entry of a file by its name; None of a file that has no entries or cannot be read."""
    try:
        if path.suffix == ".json":
            data = json.loads(path.read_text(encoding="utf-8"))
            return _digests(_rest(data) if path.name == MANIFEST else data)
        if path.suffix == ".toml":
            return _digests(tomllib.loads(path.read_text(encoding="utf-8")))
        return dict(_arrays(path)) if path.suffix == ".nc" else None
    except (OSError, ValueError, TypeError, AttributeError, KeyError, RuntimeError):
        return None


def _digests(data: Mapping[str, Any]) -> dict[str, str]:
    return {name: digest(_canonical(x))[:DIGEST_DIGITS] for name, x in data.items()}


def _canonical(data: Any) -> bytes:
    return json.dumps(data, sort_keys=True, default=str).encode()


def _arrays(path: Path) -> Iterator[tuple[str, str]]:
    """Digests of a netCDF file's variables and attributes."""
    for group, content in read_netcdf(path).items():
        for name, (dimensions, values, _) in content.variables.items():
            words = f"{dimensions} {values.dtype} {values.shape}".encode()
            yield f"{group}/{name}", digest(words + values.tobytes())[:DIGEST_DIGITS]
        for name, value in content.attributes.items():
            if not name.startswith("_"):  # HDF5's own
                yield f"{group}@{name}", digest(str(value).encode())[:DIGEST_DIGITS]
