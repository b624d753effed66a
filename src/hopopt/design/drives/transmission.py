"""What lies between a joint and its drive: the tables [leg.<joint>.transmission]."""

from typing import Annotated

from pydantic import Field

from hopopt.design.fields import Section, choice, points_fault, quantity

MOST_RATIOS = 12  # points of a table of ratios
Angle = Annotated[float, Field(ge=-7, le=7, allow_inf_nan=False)]
Ratio = Annotated[float, Field(ge=-1e3, le=1e3, allow_inf_nan=False)]


class Linear(Section):
    """A ratio that changes in proportion to the joint's angle: gear.ratio (1 + slope (q - at))."""

    slope: float = quantity("relative change of the ratio by the joint's angle", "1/rad", -100, 100, physical=True)
    at: float = quantity("angle of the joint at which gear.ratio holds", "rad", -7, 7, 0.0, physical=True)


class Rod(Section):
    """A linear actuator between a pivot on the link before the joint and one on the link behind it."""

    base: float = quantity("from the joint to the pivot before it", "m", 1e-3, 10, physical=True)
    arm: float = quantity("from the joint to the pivot behind it", "m", 1e-3, 10, physical=True)
    folded: float = quantity(
        "angle of the joint at which both pivots lie in one direction", "rad", -7, 7, physical=True
    )
    travel: float = quantity("of the rod for each radian that its drive turns", "m/rad", 1e-6, 1, physical=True)


class FourBar(Section):
    """A crank that a drive turns, and a rod from it to the link behind the joint."""

    ground: float = quantity("from the crank's pivot to the joint", "m", 1e-3, 10, physical=True)
    crank: float = quantity("length of the crank", "m", 1e-3, 10, physical=True)
    rod: float = quantity("length of the rod", "m", 1e-3, 10, physical=True)
    arm: float = quantity("from the joint to the rod's end on its link", "m", 1e-3, 10, physical=True)
    stretched: float = quantity(
        "angle of the joint at which the arm points away from the crank's pivot", "rad", -7, 7, physical=True
    )
    ahead: bool = choice(
        "whether the crank is ahead of the line from its pivot to the rod's end, as angles count; else behind it", True
    )


class FiveBar(Section):
    """A crank beside the link before the joint, which a drive on what carries that link turns, and a rod from it to the link
    behind the joint: with both links a closed chain, whose crank and rod weigh."""

    crank: float = quantity("length of the crank", "m", 1e-3, 10, physical=True)
    rod: float = quantity("length of the rod", "m", 1e-3, 10, physical=True)
    arm: float = quantity("from the joint to the rod's end on the link behind it", "m", 1e-3, 10, physical=True)
    turned: float = quantity("of the arm forward from its link's direction", "rad", -7, 7, 0.0, physical=True)
    pivot_x: float = quantity(
        "of the crank from the joint before, all angles zero, forward", "m", -10, 10, 0.0, physical=True
    )
    pivot_z: float = quantity(
        "of the crank from the joint before, all angles zero, up", "m", -10, 10, 0.0, physical=True
    )
    ahead: bool = choice(
        "whether the crank is turned forward from the line from its pivot to the rod's end; else backward", True
    )
    crank_mass: float = quantity("of the crank", "kg", 0, 1e3, 0.0, physical=True)
    rod_mass: float = quantity("of the rod", "kg", 0, 1e3, 0.0, physical=True)
    crank_com: float | None = quantity(
        "from the crank's pivot to its centre of mass (default: half its length)", "m", -10, 10, None, physical=True
    )
    rod_com: float | None = quantity(
        "from the crank's end to the rod's centre of mass (default: half its length)", "m", -10, 10, None, physical=True
    )
    crank_inertia: float | None = quantity(
        "about its centre of mass (default: a thin rod's)", "kg m^2", 0, 1e3, None, physical=True
    )
    rod_inertia: float | None = quantity(
        "about its centre of mass (default: a thin rod's)", "kg m^2", 0, 1e3, None, physical=True
    )


class RatioTable(Section):
    """A ratio by the joint's angle, by a monotone cubic spline through points, level before and behind them."""

    angle: tuple[Angle, ...] = choice("of the joint, rising", unit="rad", min_length=2, max_length=MOST_RATIOS)
    ratio: tuple[Ratio, ...] = choice(
        "at these angles, over gear.ratio", unit="1", physical=True, min_length=2, max_length=MOST_RATIOS
    )

    def fault(self) -> str:
        """What is wrong with the table, in words that follow its path; empty if nothing is."""
        words = "angles", "ratios", "ratio for each angle", "the angle"
        return points_fault(self.angle, self.ratio, *words)


class Coupled(Section):
    """Another joint that turns a drive too, through a belt, parallel rods or a differential."""

    ratio: float = quantity("turns of the drive, behind its gear, for one of that joint", "1", -100, 100, physical=True)


class Transmission(Section):
    """How joints turn the drive of a joint, behind its gear: by one law of its own angle, and by other joints' angles."""

    linear: Linear | None = choice("a ratio that changes in proportion to the angle", None, listed=False)
    rod: Rod | None = choice("a linear actuator", None, listed=False)
    four_bar: FourBar | None = choice("a crank and a rod", None, listed=False)
    table: RatioTable | None = choice("a ratio by angle", None, listed=False)
    five_bar: FiveBar | None = choice("a second crank and a rod that weigh", None, listed=False)
    coupling: dict[str, Coupled] | None = choice(
        "other joints that turn the drive too: of a belt whose motor sits on the body, {hip = {ratio = 1}}",
        None,
        listed=False,
    )
    motor_on: str | None = choice(
        "name of the link on which the motor sits, so that what spins in it rides on that link (default: body)",
        None,
        listed=False,
    )
    reversed: bool = choice("whether the motor spins against its drive, as behind two outer gear wheels", False)

    @property
    def law(self) -> str | None:
        """Name of the law of its joint's own angle; None where the drive turns as the joint does."""
        return next((name for name in ("linear", "rod", "four_bar", "table") if getattr(self, name) is not None), None)
