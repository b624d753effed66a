"""A finished map: its points, how far they were off where they were verified, and which families of hops are best where."""

from collections import Counter
from dataclasses import dataclass
from typing import Any

import numpy as np

from hopopt.ocp.objectives.registry import find
from hopopt.studies.maps.warm import MapPoint
from hopopt.studies.sweep.point_file import ENDED, NOT_VERIFIED, PRELIMINARY, Point
from hopopt.studies.sweep.run import Study

ANOTHER_HOP = (
    5e-3  # share by which the first mesh is seldom off: beyond it the search of a single solve found another hop
)
HOW_TO_READ = "preliminary values are of the first mesh alone and not verified"


@dataclass(frozen=True)
class Verified:
    """A point of a map beside the same point solved and verified in full.

    preliminary: the point of the map
    found: the verified one, or how it ended
    """

    preliminary: MapPoint
    found: Point

    @property
    def difference(self) -> float | None:
        """By which share of the verified objective the preliminary one is larger; None if it is not verified."""
        a, b = self.preliminary.objective_value, self.found.objective_value
        return a / b - 1 if self.found.verified and a is not None and b else None


@dataclass(frozen=True, repr=False)
class Map(Study):
    """A map; ``points`` are the verified ones where there are some, else the preliminary ones.

    preliminary: every point as the first mesh has it
    families: what the hops of each family do, in words, from family 1 on
    sampled: points drawn at random and verified
    best_verified: the best points of the first mesh, as many as were asked for, and verified
    mapping_s: seconds of this run that went into the preliminary points
    solved_now: how many points this run solved in them
    """

    preliminary: tuple[MapPoint, ...] = ()
    families: tuple[str, ...] = ()
    sampled: tuple[Verified, ...] = ()
    best_verified: tuple[Verified, ...] = ()
    mapping_s: float = 0.0
    solved_now: int = 0

    def __repr__(self) -> str:
        entries = ", ".join(axis.entry for axis in self.definition.axes)
        solved, verified = sum(p.solved for p in self.preliminary), sum(p.verified for p in self.points)
        return (
            f"<Map of {self.definition.design.name} over {entries}: "
            f"{solved} of {len(self.points)} preliminary, {verified} verified>"
        )

    @property
    def best_preliminary(self) -> MapPoint | None:
        """The point with the best objective on the first mesh."""
        signed_value = find(self.definition.objective).signed_value
        solved = [p for p in self.preliminary if p.solved]
        return max(solved, key=lambda p: signed_value(p.objective_value or 0.0), default=None)

    @property
    def differences(self) -> list[float]:
        """Of the sampled points that were verified: by which share the first mesh claims more."""
        return [d for s in self.sampled if (d := s.difference) is not None]

    @property
    def missed(self) -> int:
        """At how many of the sampled points a search of their own finds a better hop than the families of the map."""
        sign = find(self.definition.objective).sign
        return sum(sign * d < -ANOTHER_HOP for d in self.differences)

    @property
    def switches(self) -> int:
        """Points at which another family is the best than at the point that they began from."""
        return sum(p.switched for p in self.preliminary)

    @property
    def best_in(self) -> dict[int, int]:
        """By family, the number of points at which it is the best; 0: what restarts found."""
        return dict(sorted(Counter(p.family for p in self.preliminary if p.solved).items()))

    @property
    def rate(self) -> float:
        """Designs a second of this run, the first search among them; 0 if it solved none."""
        return self.solved_now / self.mapping_s if self.mapping_s and self.solved_now else 0.0

    @property
    def exit_code(self) -> int:
        """0 every point decided, 1 none has a hop, 3 points that a fault ended, or that fail the verification."""
        if any(p.outcome in (NOT_VERIFIED, ENDED) for p in self.points):
            return 3
        return 0 if any(p.solved for p in self.preliminary) else 1

    @property
    def failures(self) -> list[Point]:
        """The points without a hop, and those that fail the verification."""
        return [p for p in self.points if not p.verified and p.outcome != PRELIMINARY]

    @property
    def without_hop(self) -> dict[str, int]:
        """By outcome, the number of points without a preliminary hop."""
        return dict(Counter(p.outcome for p in self.preliminary if not p.solved))

    def as_dict(self) -> dict[str, Any]:
        """What ``--json`` prints."""
        best, off = self.best_preliminary, self.differences
        return super().as_dict() | {
            "preliminary": True,
            "note": HOW_TO_READ,
            "best_preliminary": None if best is None else best.index,
            "families": [
                {"family": k, "words": w, "best_at": self.best_in.get(k, 0)} for k, w in enumerate(self.families, 1)
            ],
            "family_switches": self.switches,
            "sample": [_as_dict(s) for s in self.sampled],
            "best_verified": [_as_dict(s) for s in self.best_verified],
            "difference_of_sample": None
            if not off
            else {"least": min(off), "median": float(np.median(off)), "most": max(off)},
            "another_hop_in_sample": self.missed,
            "designs_per_second": self.rate,
        }


def _as_dict(s: Verified) -> dict[str, Any]:
    return {
        "index": s.preliminary.index, "preliminary": s.preliminary.objective_value,
        "verified": s.found.objective_value if s.found.verified else None, "outcome": s.found.outcome,
        "difference": s.difference,
    }  # fmt: skip
