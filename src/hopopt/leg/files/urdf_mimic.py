"""Joints of a URDF that mimic others: which of them a leg moves along, by which joint of its own, and in which proportion."""

from collections.abc import Sequence
from dataclasses import dataclass

from hopopt.leg.files.urdf_xml import MOVING, Tree, UrdfError, numbers, quoted


@dataclass(frozen=True)
class Mimic:
    """A joint's angle is ratio times that of another ``joint``, plus offset [rad]."""

    joint: str
    ratio: float
    offset: float

    def range(self, lower: float, upper: float) -> tuple[float, float]:
        """Between which angles of the other joint this one is from lower to upper [rad]; nan where these are."""
        ends = (lower - self.offset) / self.ratio, (upper - self.offset) / self.ratio
        return (ends[1], ends[0]) if self.ratio < 0 else ends


def moving_chain(tree: Tree, foot: str, joints: Sequence[str]) -> dict[str, Mimic | None]:
    """All that moves from the body to the link ``foot``: the ``joints`` of the leg, None each, and what follows them. UrdfError
    where the names do not fit the file, or what mimics cannot."""
    tree.chain_to(foot, joints)
    on_the_way = tree.on_the_way(foot)
    found: dict[str, Mimic | None] = dict.fromkeys(joints)
    found |= _followers(tree, joints, on_the_way)
    return {name: found[name] for name in on_the_way if name in found}


def _followers(tree: Tree, joints: Sequence[str], on_the_way: Sequence[str]) -> dict[str, Mimic]:
    """What follows a joint of the leg, by name: only joints on the way to the foot may."""
    found = dict[str, Mimic]()
    for name, joint in tree.joints.items():
        if joint.find("mimic") is None:
            continue
        if name not in (*joints, *on_the_way):
            _refuse_elsewhere(tree, name, joints)
            continue
        mimic = _resolved(tree, name)
        if name in joints and mimic.joint in joints:
            raise UrdfError(
                f"joint {quoted(name)} mimics {quoted(mimic.joint)}: leave it out of leg.joints, it follows by itself"
            )
        if name in joints:
            raise UrdfError(
                f"joint {quoted(name)} mimics {quoted(mimic.joint)}, which leg.joints does not have: leave it out, or its <mimic>"
            )
        if mimic.joint in joints:
            found[name] = mimic
    return found


def _refuse_elsewhere(tree: Tree, name: str, joints: Sequence[str]) -> None:
    """UrdfError for a joint beside the way to the foot that mimics one of the leg."""
    mimic = tree.joints[name].find("mimic")
    other = "" if mimic is None else mimic.get("joint", "")
    if other in joints:
        raise UrdfError(
            f"joint {quoted(name)} mimics {quoted(other)} of the leg, but would be locked: leave {quoted(other)} out"
        )


def _resolved(tree: Tree, name: str) -> Mimic:
    """The joint at the end of a chain of those that mimic each other."""
    at, ratio, offset, passed = name, 1.0, 0.0, [name]
    while (mimic := tree.joints[at].find("mimic")) is not None:
        where = f"joint {quoted(at)}"
        other = mimic.get("joint", "")
        if other not in tree.joints:
            raise UrdfError(f"{where} mimics {quoted(other)}, which the file does not have")
        if other in passed:
            raise UrdfError(
                f"joint {quoted(name)} mimics in a loop ({', '.join([*passed, other])}): let one of them move by itself"
            )
        by = next(iter(numbers(tree.joints[at], "mimic", "multiplier", 1, where)), 1.0)
        plus = next(iter(numbers(tree.joints[at], "mimic", "offset", 1, where)), 0.0)
        if not by:
            raise UrdfError(
                f"{where} mimics {quoted(other)} with multiplier 0, which moves nothing: take that out of the file, and it is locked"
            )
        ratio, offset, at = ratio * by, offset + ratio * plus, other
        passed.append(at)
    if not all(tree.joints[each].get("type") in MOVING for each in (name, at)):
        raise UrdfError(
            f"joint {quoted(name)} mimics {quoted(at)}: hopopt reads <mimic> where both turn, {' or '.join(MOVING)}"
        )
    return Mimic(at, ratio, offset)
