"""How near the leg comes to itself and to the body, by coal: the truth that plans are measured by."""

from collections.abc import Sequence
from itertools import combinations
from typing import Any

import numpy as np
import pinocchio as pin

from hopopt.design import Leg
from hopopt.leg.geometry.hulls import rounded
from hopopt.leg.geometry.solids import BODY, Solid, colliding
from hopopt.leg.robot import BASE, build_robot


class Distances:
    """Signed distances between the solids of a leg that move against each other.

    Left out are solids of neighbours, body and first link or two links at a joint, that touch where the hop starts: they
    touch around their joint, and the limits of its angle stand for them.

    pairs: the solids, each pair with that nearer to the foot second
    """

    def __init__(self, leg: Leg, start: np.ndarray):
        self.solids = colliding(leg)
        self._robot = build_robot(leg)
        self._model = pin.GeometryModel()
        for solid in self.solids:
            self._model.addGeometryObject(_geometry(solid))
        order = range(len(self.solids))
        self.pairs = [(i, j) for i, j in combinations(order, 2) if self.solids[i].joint != self.solids[j].joint]
        self.left_out: list[tuple[int, int]] = []
        at_start = self.all(start[None])[0]
        for pair, distance in zip(self.pairs, at_start, strict=True):
            if distance <= 0 and abs(self.solids[pair[0]].joint - self.solids[pair[1]].joint) == 1:
                self.left_out.append(pair)
        self.pairs = [pair for pair in self.pairs if pair not in self.left_out]

    def names(self, pair: tuple[int, int]) -> tuple[str, str]:
        """What the two solids of a pair are called, that nearer to the foot first."""
        body, leg = (self.solids[k].name for k in pair)
        return leg, body

    def all(self, q_j: np.ndarray, pairs: Sequence[tuple[int, int]] | None = None) -> np.ndarray:
        """Signed distances (m, pairs) [m] at joint angles q_j (m, n) [rad], of all pairs or of these."""
        pairs = self.pairs if pairs is None else pairs
        model, data = self._robot.model, self._robot.model.createData()
        self._model.removeAllCollisionPairs()
        for pair in pairs:
            self._model.addCollisionPair(pin.CollisionPair(*pair))
        geometry = pin.GeometryData(self._model)
        found = np.empty((len(q_j), len(pairs)))
        place = np.zeros(model.nq)
        for row, q in zip(found, q_j, strict=True):
            place[BASE:] = q
            pin.computeDistances(model, data, self._model, geometry, place)
            row[:] = [result.min_distance for result in geometry.distanceResults]
        return found


def _geometry(solid: Solid) -> Any:
    """A solid for Pinocchio, fixed to the joint that moves it."""
    joint = BASE + 1 + solid.joint if solid.joint != BODY else BASE
    shape, place = rounded(solid.points, solid.radius)
    return pin.GeometryObject(f"{solid.joint} {solid.name}", joint, 0, place, shape)
