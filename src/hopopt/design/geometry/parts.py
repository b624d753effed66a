"""What a leg is made of: the body, and links, each with its mass and its shapes."""

from hopopt.design.fields import DOWN, Number, Section, Vector, choice, quantity
from hopopt.design.geometry.shape import Shape

Shapes = dict[str, Shape]  # by name
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
    radius: float | None = quantity(
        "of the link, round about the line from its joint to the next", "m", 1e-4, 1, None, listed=False
    )
    shapes: Shapes | None = choice("solids of the link by name, as of the body", None, listed=False)
