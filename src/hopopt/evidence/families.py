"""Families of hops over an entry: every local optimum followed to the neighbouring values until no new one appears.

A family is a chain of local optima at neighbouring values that lead to each other; optima of one value that do the same
and are nearly as high count as one, told by the best of them. Clearances are those of the first mesh;
the best family at each value, and what is too close to it to tell, is refined and verified.

<results>/<problem>-families-<hash8>/
    problem.toml     the problem, written first
    families.json    what is known so far; whole at the end
    *.traceback.txt  where a fault of hopopt ended a part
    families.png     the picture
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from hopopt.errors import UsageError
from hopopt.evidence.family_chains import Node, Step, chains, letter
from hopopt.evidence.family_optima import LocalOptimum, Refined
from hopopt.files import write_whole
from hopopt.problem.render import design_hash, resolved_toml
from hopopt.storage.folder import as_json, new_folder, writing
from hopopt.studies.consistency import contradicted
from hopopt.studies.faults import Fault
from hopopt.studies.sweep.definition import Definition


@dataclass(frozen=True)
class Family:
    """A local optimum followed over the values of an entry.

    name: A, B, ..., best first
    words: what the leg does, at a typical value
    found_by: names of the starts that led to it
    clearance: at each value [m], None where it is not found
    verified: at each value, None where it was not refined and the clearance is the first mesh's
    poses: joints and foot (poses, points, 2) [m] at each value, None where it is not found
    """

    name: str
    words: str
    found_by: tuple[str, ...]
    clearance: tuple[float | None, ...]
    verified: tuple[bool | None, ...]
    poses: tuple[np.ndarray | None, ...] = field(repr=False)


@dataclass
class FamilyStudy:
    """The families of a problem, as far as they are known.

    definition: the problem, and the entry with its values in rising order, or no entry
    optima: at each value; steps: where followed optima end; refined: optima after refinement
    faults: of hopopt, that ended a part, by what that was
    """

    definition: Definition
    optima: list[list[LocalOptimum]]
    steps: set[Step] = field(default_factory=set)
    refined: dict[Node, Refined] = field(default_factory=dict)
    faults: dict[str, Fault] = field(default_factory=dict)

    @property
    def entry(self) -> str | None:
        """The entry that is varied."""
        return self.definition.axes[0].entry if self.definition.axes else None

    @property
    def values(self) -> list[float]:
        """Of the entry [its unit], rising; none without an entry."""
        return list(self.definition.axes[0].values) if self.definition.axes else []

    def clearance(self, node: Node) -> float:
        """Refined, or else of the first mesh [m]."""
        known = self.refined.get(node)
        return known.clearance if known else self.optima[node[0]][node[1]].clearance

    def best_at(self, k: int) -> Node | None:
        """The best optimum at a value: of the verified ones if there are any."""
        nodes = [(k, i) for i in range(len(self.optima[k]))]
        known = self.refined.keys() & set(nodes)
        return max(known or nodes, key=lambda n: (bool(known and self.refined[n].verified), self.clearance(n)), default=None)  # fmt: skip

    @property
    def _best(self) -> list[Node | None]:
        """The best optimum at each value."""
        return [self.best_at(k) for k in range(len(self.optima))]

    def families(self) -> list[Family]:
        """Every family, those first that are the best at most values, then the highest."""
        return [self._family(letter(k), row) for k, row in enumerate(self._rows())]

    def _rows(self) -> list[list[Node]]:
        best = set(self._best)
        found = chains([len(each) for each in self.optima], self.steps)
        return sorted(found, key=lambda row: (-len(best & set(row)), -max(map(self.clearance, row))))

    def _family(self, name: str, row: Sequence[Node]) -> Family:
        at, typical = dict(row), row[len(row) // 2]
        found_by = dict.fromkeys(name for k, i in row for name in self.optima[k][i].found_by)
        every = range(len(self.optima))
        return Family(
            name, self.optima[typical[0]][typical[1]].words, tuple(found_by),
            tuple(self.clearance((k, at[k])) if k in at else None for k in every),
            tuple(self.refined[k, at[k]].verified if k in at and (k, at[k]) in self.refined else None for k in every),
            tuple(self.optima[k][at[k]].poses if k in at else None for k in every),
        )  # fmt: skip

    def best(self) -> list[str | None]:
        """Name of the best family at each value, None where no hop was found."""
        names = {node: letter(k) for k, row in enumerate(self._rows()) for node in row}
        return [None if node is None else names[node] for node in self._best]

    def as_dict(self) -> dict[str, Any]:
        """Everything that is printed, as one object."""
        families, best = self.families(), self.best()
        verified = [f.verified[k] for k, name in enumerate(best) for f in families if f.name == name]
        wrong = self.contradictions()
        return {
            "problem": self.definition.design.name, "entry": self.entry, "values": self.values,
            "families": [
                {"name": f.name, "words": f.words, "found_by": list(f.found_by), "clearance_m": list(f.clearance),
                 "verified": list(f.verified)} for f in families
            ],
            "best": best, "crossings": crossings(self.values, best), "contradictions": wrong,
            "faults": {where: fault.sentence for where, fault in self.faults.items()},
            "exit_code": 3 if wrong or False in verified or self.faults else 0,
        }  # fmt: skip

    def contradictions(self) -> list[dict[str, Any]]:
        """Values where the best is lower than at a value that only limits more: there a better hop was missed."""
        if self.entry is None:
            return []
        heights = np.array([np.nan if node is None else self.clearance(node) for node in self._best])
        found = contradicted([self.entry], np.array(self.values)[:, None], heights)
        return [
            {"at": self.values[k], "clearance_m": float(heights[k]), "better_at": self.values[better[0]],
             "better_clearance_m": float(heights[better[0]])} for k, better in found.items()
        ]  # fmt: skip


def crossings(values: Sequence[float], best: Sequence[str | None]) -> list[dict[str, Any]]:
    """Between which values the best family changes."""
    known = [(value, name) for value, name in zip(values, best, strict=False) if name]
    pairs = pairwise(known)
    return [{"between": [a, b], "from": one, "to": other} for (a, one), (b, other) in pairs if one != other]


def one_entry(definition: Definition) -> Definition:
    """The definition with its values in rising order; UsageError if more than one entry is varied, or if a value makes no
    problem."""
    if len(definition.axes) > 1:
        raise UsageError("families are followed over one entry: give --vary once")
    if any(axis.names for axis in definition.axes):
        raise UsageError("families are followed over numbers: give --vary leg.gear.ratio=60:160:9, say")
    axes = tuple(replace(axis, values=tuple(sorted(axis.values))) for axis in definition.axes)
    found = replace(definition, axes=axes)
    for k in range(len(found.points)):
        found.design_at(k)
    return found


def open_folder(definition: Definition, results: Path) -> Path:
    """A new folder with the problem; ResultError if it cannot be written."""
    design = definition.design
    with writing(f"{results}: the study", "choose another folder"):
        folder = new_folder(results / f"{design.name}-families-{design_hash(design)}")
        write_whole(folder / "problem.toml", resolved_toml(design).encode())
    return folder


def save(study: FamilyStudy, folder: Path, finished: bool) -> dict[str, Any]:
    """What is known, written to families.json whole, and returned."""
    data = {**study.as_dict(), "result_dir": str(folder), "finished": finished}
    with writing(f"{folder}: families.json", "what it holds is whole, of before: make room and run again"):
        for where, fault in study.faults.items():
            fault.keep(folder, where.replace(" ", "-"))
        write_whole(folder / "families.json", as_json(data).encode())
    return data
