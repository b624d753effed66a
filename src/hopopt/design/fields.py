"""How an entry of a problem file is declared: with its unit, its meaning and the magnitudes it may have."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field

# What a value far out of range was probably written in: SI unit -> ((other unit, SI value of one), ...).
LOOKALIKES = {
    "m": (("millimetres", 1e-3), ("centimetres", 1e-2)),
    "kg": (("grams", 1e-3),),
    "kg m^2": (("g cm^2", 1e-7), ("kg cm^2", 1e-4)),
    "N m": (("mN m", 1e-3),),
    "rad": (("degrees", 0.017453292519943295),),
    "rad/s": (("rpm", 0.10471975511965977),),
    "s": (("milliseconds", 1e-3),),
}
RESERVED = (
    "joints",
    "links",
    "guides",
    "joint",
    "link",
    "body",
    "motor",
    "gear",
    "supply",
    "spring",
    "urdf",
    "mjcf",
    "foot_frame",
    "foot_point",
    "locked",
    "geometry",
    "lowest",
)
TRUNK = "trunk"  # the lowest point of a body with shapes
RESERVED_JOINTS = (*RESERVED, "foot", "com", TRUNK, "x", "z")  # points and guides of every leg have these names
CATALOGUE = "catalogue entry these values began with; what it leaves open, a joint does not take from the leg's"
CATALOGUE_NAME = r"^[a-z0-9][a-z0-9-]{0,49}$"


def quantity(
    meaning: str,
    unit: str,
    low: float,
    high: float,
    default: Any = ...,
    *,
    physical: bool = False,
    listed: bool = True,
) -> Any:
    """Declare a number in ``unit`` between ``low`` and ``high``; ``physical`` makes it a design parameter; ``listed``: whether a
    list of all entries has it where it is not set."""
    extra = {"unit": unit, "physical": physical, "listed": listed}
    return Field(default, ge=low, le=high, allow_inf_nan=False, description=meaning, json_schema_extra=extra)


def named(meaning: str, default: Any, kind: str, *built_in: str) -> Any:
    """Declare one or several names of a registry of this ``kind`` (extensions.py), of which these are built in."""
    extra = {"unit": "", "physical": False, "allowed": "", "registry": kind, "words": list(built_in)}
    return Field(default, description=meaning, json_schema_extra=extra)


def choice(
    meaning: str,
    default: Any = ...,
    *,
    unit: str = "",
    allowed: str = "",
    physical: bool = False,
    listed: bool = True,
    **bounds: Any,
) -> Any:
    """Declare an entry that is not a single physical number: the unit of a list, what is ``allowed`` in words; ``physical`` makes
    each number of a list a design parameter; ``listed`` as of a quantity."""
    extra = {"unit": unit, "physical": physical, "allowed": allowed, "listed": listed}
    return Field(default, description=meaning, json_schema_extra=extra, **bounds)


class Section(BaseModel):
    """A table of the problem file: no unknown keys, no silent conversions, immutable."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


def points_fault(at: Sequence[float], of: Sequence[float], ats: str, ofs: str, one_of: str, monotone: str = "") -> str:
    """What is wrong with a table of values ``of`` at points ``at``, in words that follow its path; empty if nothing is.

    ats, ofs: what both are called; one_of: one value and one point, such as "efficiency for each speed"; monotone: in what the
    values only fall or only rise, empty if they need not
    """
    if len(at) != len(of):
        return f"has {len(at)} {ats} and {len(of)} {ofs}: give one {one_of}"
    if any(b <= a for a, b in pairwise(at)):
        return f"has {ats} that do not rise: list them in rising order, each once"
    steps = [b - a for a, b in pairwise(of)]
    if monotone and min(steps) < 0 < max(steps):
        return f"is not monotone in {monotone}: give {ofs} that only fall, or only rise"
    return ""


EntryName = Annotated[str, Field(pattern=r"^[^\x00-\x1f\x7f]{1,200}$")]  # in a registry
ModuleName = Annotated[str, Field(pattern=r"^[A-Za-z_][A-Za-z0-9_.]{0,199}$")]
Number = Annotated[float, Field(ge=-1e3, le=1e3, allow_inf_nan=False)]
Speed = Annotated[float, Field(ge=0, le=6000, allow_inf_nan=False)]
LEAST_EFFICIENCY = 0.05
Share = Annotated[float, Field(ge=LEAST_EFFICIENCY, le=1, allow_inf_nan=False)]
Torque = Annotated[float, Field(ge=0, le=1e4, allow_inf_nan=False)]
MOST_POINTS = 8  # of a table
Vector = tuple[Number, Number, Number]
DOWN, FORWARD = (0.0, 0.0, -1.0), (0.0, -1.0, 0.0)  # a positive turn about FORWARD swings a hanging link to +x
