"""What a test adds to hopopt's registries is gone after it."""

from collections.abc import Iterator
from contextlib import contextmanager

from hopopt import extensions


@contextmanager
def clean_registries() -> Iterator[None]:
    """All registries as they were, and no module asked for, when this ends."""
    mutable = [part for r in extensions._registries.values() for part in (r, r.origins)]
    mutable += [extensions._loaded, extensions._functions]  # type: ignore[list-item]
    kept, needed = [dict(part) for part in mutable], list(extensions._needed)
    try:
        yield
    finally:
        for part, before in zip(mutable, kept, strict=True):
            part.clear()
            part.update(before)
        extensions._needed[:] = needed
