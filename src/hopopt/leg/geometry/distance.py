"""How near the leg comes to itself and to the body, by coal: the truth that plans are measured by."""

from collections.abc import Sequence
from itertools import combinations
from typing import Any

import numpy as np
import pinocchio as pin

from hopopt.design import Design, Leg
from hopopt.leg.geometry.hulls import rounded
from hopopt.leg.geometry.solids import BODY, Solid, colliding
from hopopt.leg.kinematics import link_ends, reach, start_angles
from hopopt.leg.robot import BASE, build_robot

KEPT = 4  # legs of this process
MARGIN = 0.005  # of the leg's reach: what is kept between solids
ANGLES = 161  # of a joint at which its neighbours are looked at


class Distances:
    """Signed distances between the solids of a leg that move against each other.

    Left out are solids of neighbours, body and first link or two links at a joint, that touch where the hop starts: they
    touch around their joint, and the limits of its angle stand for them.

    pairs: the solids, each pair with that nearer to the foot second
    beside: those of neighbours that turn beside each other within MARGIN, and that no angle of their joint brings together
    """

    def __init__(self, leg: Leg, start: np.ndarray):
        self.solids = colliding(leg)
        self._robot = build_robot(leg)
        self._model = pin.GeometryModel()
        for solid in self.solids:
            self._model.addGeometryObject(_geometry(solid))
        order = range(len(self.solids))
        self.pairs = [(i, j) for i, j in combinations(order, 2) if self.solids[i].joint != self.solids[j].joint]
        touches = [
            distance <= 0 and abs(self.solids[i].joint - self.solids[j].joint) == 1
            for (i, j), distance in zip(self.pairs, self.all(start[None])[0], strict=True)
        ]
        self.left_out = [pair for pair, left in zip(self.pairs, touches, strict=True) if left]
        self.pairs = [pair for pair, left in zip(self.pairs, touches, strict=True) if not left]
        self.beside = [pair for k in range(len(start)) for pair in self._beside(leg, start, k)]

    def _beside(self, leg: Leg, start: np.ndarray, k: int) -> list[tuple[int, int]]:
        """Of ``beside`` those at joint number k."""
        joint, most = leg.joint[leg.joints[k]], MARGIN * reach(leg)
        pairs = [(i, j) for i, j in self.pairs if (self.solids[i].joint, self.solids[j].joint) == (k - 1, k)]
        pairs = [pair for pair, distance in zip(pairs, self.all(start[None], pairs)[0], strict=True) if distance < most]
        poses = np.tile(start, (ANGLES, 1))
        poses[:, k] = np.linspace(joint.lower, joint.upper, ANGLES)
        distances = self.all(poses, pairs).T if pairs else ()
        return [p for p, at in zip(pairs, distances, strict=True) if at.min() > 0 and at.max() < most]

    def between(self, joint: int, other: int) -> list[tuple[int, int]]:
        """The pairs of what a joint moves with what the ``other`` moves, nearer to the body, or BODY, but for those that need
        not be kept apart (``beside``)."""
        pairs = [(i, j) for i, j in self.pairs if (self.solids[i].joint, self.solids[j].joint) == (other, joint)]
        return [pair for pair in pairs if pair not in self.beside]

    def names(self, pair: tuple[int, int]) -> tuple[str, str]:
        """What the two solids of a pair are called, that nearer to the foot first."""
        body, leg = (self.solids[k].name for k in pair)
        return leg, body

    def all(self, q_j: np.ndarray, pairs: Sequence[tuple[int, int]] | None = None) -> np.ndarray:
        """Signed distances (m, pairs) [m] at joint angles q_j (m, n) [rad], of all pairs or of these."""
        pairs = self.pairs if pairs is None else pairs
        model, data, solids = self._robot.model, self._robot.model.createData(), self._model.copy()
        for pair in pairs:
            solids.addCollisionPair(pin.CollisionPair(*pair))
        geometry = pin.GeometryData(solids)
        found = np.empty((len(q_j), len(pairs)))
        place = np.zeros(model.nq)
        for row, q in zip(found, q_j, strict=True):
            place[BASE:] = q
            pin.computeDistances(model, data, solids, geometry, place)
            row[:] = [result.min_distance for result in geometry.distanceResults]
        return found


_made: dict[str, Distances] = {}


def distances_of(design: Design) -> Distances:
    """Of a problem's leg, whose hop starts where it says; made once in a process."""
    start = start_angles(design)
    key = key_of(design.leg, start)
    if key not in _made:
        while len(_made) >= KEPT:
            del _made[next(iter(_made))]
        _made[key] = Distances(design.leg, start)
    return _made[key]


def key_of(leg: Leg, start: np.ndarray) -> str:
    """All that the distances of a leg depend on, and where its hop starts (n) [rad]."""
    joints = leg.link_joints, [(joint.lower, joint.upper) for joint in leg.joint.values()]
    ends = link_ends(leg)
    shapes = [(s.name, s.joint, s.radius, s.points.tobytes()) for s in colliding(leg)]
    return repr((joints, ends.tobytes(), start.tobytes(), shapes))


def _geometry(solid: Solid) -> Any:
    """A solid for Pinocchio, fixed to the joint that moves it."""
    joint = BASE + 1 + solid.joint if solid.joint != BODY else BASE
    shape, place = rounded(solid.points, solid.radius)
    return pin.GeometryObject(f"{solid.joint} {solid.name}", joint, 0, place, shape)
