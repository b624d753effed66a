"""What a leg is made of: the body, and links, each with its mass and its shapes, and springs beside its drives."""

from typing import Literal

from hopopt.design.fields import (
    DOWN,
    FORWARD,
    MOST_POINTS,
    EntryName,
    Number,
    Section,
    Vector,
    choice,
    points_fault,
    quantity,
)
from hopopt.design.geometry.shape import Shape

Shapes = dict[str, Shape]  # by name
MOST_SPRINGS = 8  # of a leg
LEAST_INERTIA = 1e-8  # [kg m^2] of a link: what a point mass is given


class Body(Section):
    mass: float = quantity("mass of the body with both motors, as this leg carries it", "kg", 1e-3, 1000, physical=True)
    legs: float | None = quantity(
        "equal legs that carry the body, push together and mirror each other; from a URDF its mass is shared among them",
        "1", 1, 100, None,
    )  # fmt: skip
    shapes: Shapes | None = choice(
        "solids of the body by name: [leg.body.shapes.trunk] (docs/body.md)", None, listed=False
    )


class Follows(Section):
    """A joint without a drive, which rods or belts turn as another joint of the leg turns (a URDF's mimic)."""

    joint: EntryName = choice("joint of leg.joints that it follows")
    ratio: float = quantity("its angle for each radian of that joint", "1", -100, 100)
    offset: float = quantity("its angle where that joint is at zero", "rad", -20, 20, 0.0)
    axis: Vector = choice("its axis, all joint angles zero (x, y, z); default: positive swings forward", FORWARD)


class Link(Section):
    length: float = quantity("from its joint to the next joint, or to the foot", "m", 0.01, 3, physical=True)
    mass: float = quantity("mass of the link", "kg", 1e-4, 200, physical=True)
    com: float | None = quantity(
        "centre of mass from its joint, along the link (default: half the length)", "m", 0.0, 3, None, physical=True
    )
    inertia: float | None = quantity(
        "moment of inertia about its centre of mass (default: slender rod, mass length^2 / 12)",
        "kg m^2", LEAST_INERTIA, 50, None, physical=True,
    )  # fmt: skip
    direction: Vector = choice("which way the link points from its joint, all joint angles zero (x, y, z)", DOWN)
    com_position: Vector | None = choice(
        "centre of mass from its joint, all joint angles zero (x, y, z), in place of com", None, unit="m"
    )
    inertia_tensor: tuple[Number, Number, Number, Number, Number, Number] | None = choice(
        "moments xx, yy, zz and products xy, xz, yz of inertia about the centre of mass, all joint angles zero, "
        "in place of inertia", None, unit="kg m^2",
    )  # fmt: skip
    follows: Follows | None = choice(
        'its joint has no drive and follows another one: {joint = "knee", ratio = -1}', None, listed=False
    )
    radius: float | None = quantity(
        "of the link, round about the line from its joint to the next", "m", 1e-4, 1, None, listed=False
    )
    shapes: Shapes | None = choice("solids of the link by name, as of the body", None, listed=False)


class SpringTable(Section):
    """Torque of a spring by its angle, straight between points and beyond them, its corners rounded."""

    angle: tuple[Number, ...] = choice("of the spring, rising", unit="rad", min_length=2, max_length=MOST_POINTS)
    torque: tuple[Number, ...] = choice(
        "on its joint at these angles, positive where it turns the joint to larger angles",
        unit="N m", min_length=2, max_length=MOST_POINTS,
    )  # fmt: skip

    def fault(self) -> str:
        """What is wrong with the table, in words that follow its path; empty if nothing is."""
        return points_fault(self.angle, self.torque, "angles", "torques", "torque for each angle")


class Spring(Section):
    """A spring beside the drives, at a joint or between joints, without mass and without loss."""

    stiffness: float | None = quantity(
        "torque on its joint for each radian from its rest angle", "N m/rad", 0, 1e5, None, physical=True
    )
    rest_angle: float | None = quantity("at which it gives no torque", "rad", -20, 20, None, physical=True)
    acts: Literal["everywhere", "above", "below"] = choice(
        "where it acts: everywhere, or only above or below its rest angle, as a slack spring or an elastic end does",
        "everywhere",
    )
    joints: tuple[EntryName, ...] | None = choice(
        "joints whose angles make its angle (default: the joint it is named by)", None, min_length=1, max_length=8
    )
    coefficients: tuple[Number, ...] | None = choice(
        "one for each of these joints: its angle is the sum of coefficient times joint angle (default: 1)", None
    )
    table: SpringTable | None = choice(
        "torque by angle, in place of stiffness and rest_angle: {angle = [...], torque = [...]}", None
    )

    def fault(self) -> str:
        """What is wrong with the spring by itself, in words that follow its path; empty if nothing is."""
        given = [name for name in ("stiffness", "rest_angle") if getattr(self, name) is not None]
        if self.table is not None and (given or self.acts != "everywhere"):
            return f"has a table beside {given[0] if given else 'acts'}: the table says all of its torque, remove one"
        if self.table is None and len(given) < 2:
            return "needs stiffness and rest_angle, or a table of its torque by angle"
        if self.joints is None and self.coefficients is not None:
            return "has coefficients and no joints: name the joints that they belong to"
        if self.coefficients is not None and len(self.coefficients) != len(self.joints or ()):
            few = f"has {len(self.joints or ())} joints and {len(self.coefficients)} coefficients"
            return f"{few}: give one coefficient for each joint"
        if self.coefficients is not None and not all(self.coefficients):
            return "has a coefficient of 0: leave that joint out"
        return ""
