"""The objective over one slider's entry or two, filled in cell by cell, those near the design that is shown first."""

from collections.abc import Mapping, Sequence
from itertools import product
from typing import Any

import numpy as np

from hopopt.errors import UsageError
from hopopt.live.sliders import Slider

CURVE, MAP = 25, 9  # values of an entry in a map of one, and of each in a map of two
Cell = tuple[int, ...]  # its place along each axis


class LiveMap:
    """A map over the entries of one slider or two; UsageError for others.

    entries: of the axes; axes: their values; values: by cell that is filled, the objective [its unit], None without a hop
    """

    def __init__(self, sliders: Sequence[Slider], entries: Sequence[str]):
        known = {s.entry: s for s in sliders}
        if len(set(entries)) != len(entries) or len(entries) not in (1, 2) or not set(entries) <= known.keys():
            raise UsageError("a map is over one slider's entry, or over two")
        self.entries = list(entries)
        self.axes = [known[entry].places(CURVE if len(entries) == 1 else MAP) for entry in entries]
        self.values = dict[Cell, float | None]()
        self._cells = list(product(*(range(len(axis)) for axis in self.axes)))
        self._due = set(self._cells)

    def fill(self, cell: Cell, value: float | None) -> None:
        """What a cell has [the objective's unit]."""
        self.values[cell] = value
        self._due.discard(cell)

    def refresh(self) -> None:
        """Fill every cell again; until then it shows what it has."""
        self._due = set(self._cells)

    @property
    def left(self) -> int:
        """How many cells are still to be filled."""
        return len(self._due)

    def missing(self, here: Mapping[str, float]) -> Cell | None:
        """The cell to be filled next; ``here``: values of the design that is shown."""
        near = [
            int(np.argmin(np.abs(np.array(axis) - here[e]))) for e, axis in zip(self.entries, self.axes, strict=True)
        ]
        left = (cell for cell in self._cells if cell in self._due)
        return min(left, key=lambda cell: sum(abs(a - b) for a, b in zip(cell, near, strict=True)), default=None)

    def at(self, cell: Cell) -> dict[str, float]:
        """The entries' values at a cell."""
        return {e: axis[k] for e, axis, k in zip(self.entries, self.axes, cell, strict=True)}

    def as_dict(self) -> dict[str, Any]:
        """For the page."""
        cells = [{"at": list(cell), "value": x} for cell, x in self.values.items()]
        return {"entries": self.entries, "axes": self.axes, "cells": cells, "of": len(self._cells), "left": self.left}
