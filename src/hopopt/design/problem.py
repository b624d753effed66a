"""A whole problem, of all its tables."""

from collections.abc import Mapping
from typing import Any

from pydantic import ValidationError, model_validator

from hopopt.design.control import ControlSettings, Reserve
from hopopt.design.fields import ModuleName, Section, choice
from hopopt.design.hop import Contact, Environment, HopSettings, StartPose
from hopopt.design.leg import PAPERS_LENGTH, Leg
from hopopt.design.simulation import Simulation, Uncertainty
from hopopt.design.solver import Solver
from hopopt.errors import UsageError


class OwnParameter(Section):
    """A number of the user's own, which functions of the user's use."""

    value: float = choice("its value", ge=-1e12, le=1e12, allow_inf_nan=False)
    lower: float | None = choice("least value that it may have", None, ge=-1e12, le=1e12, allow_inf_nan=False)
    upper: float | None = choice("greatest value that it may have", None, ge=-1e12, le=1e12, allow_inf_nan=False)
    unit: str = choice(
        "of its values", "", pattern=r"^[^\x00-\x1f\x7f]{0,30}$", allowed="text of at most 30 characters"
    )
    meaning: str = choice("one line", "", pattern=r"^[^\x00-\x1f\x7f]{0,200}$", allowed="one line of text")


class Design(Section):
    """A whole problem: the leg, the ground, where the hop starts, what it may do and how it is solved."""

    name: str = choice(
        "short name, used for the results folder",
        pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]{0,63}$",
        allowed="text of 1 to 64 letters, digits, _ or -, the first a letter or digit,",
    )
    title: str = choice(
        "one line for tables and figures",
        "",
        pattern=r"^[^\x00-\x1f\x7f]{0,200}$",
        allowed="one line of text of at most 200 characters",
    )
    leg: Leg
    contact: Contact = Contact()
    start: StartPose
    hop: HopSettings = HopSettings()
    solver: Solver = Solver()
    environment: Environment | None = choice("what surrounds the leg (default: air of 25 degC)", None, listed=False)
    simulation: Simulation = Simulation()
    reserve: Reserve = Reserve()
    control: ControlSettings = ControlSettings()
    uncertainty: Uncertainty = Uncertainty()
    needs: tuple[ModuleName, ...] | None = choice(
        "modules of your own that names in it come from, which no file loads (--with)", None, listed=False,
        allowed='a list of modules, such as ["my_module"],',
    )  # fmt: skip

    parameters: dict[str, OwnParameter] | None = choice(
        "numbers of your own, by name, that functions of your own use (docs/objectives.md)", None, listed=False
    )

    def __hash__(self) -> int:
        """Of every entry, so that what is made of a problem can be kept for it."""
        return hash(super().__repr__())

    def __repr__(self) -> str:
        joints = f"{len(self.leg.joints)} joint{'s' if len(self.leg.joints) > 1 else ''}"
        return f"<Design {self.name}: {joints}, {self.hop.kind} hop; hopopt show prints every entry>"

    @property
    def surroundings(self) -> Environment:
        """What surrounds the leg, whether the problem says so or not."""
        return self.environment or Environment()

    @property
    def ambient(self) -> float:
        """Temperature around the leg [degC]."""
        return self.surroundings.temperature

    def of_kind(self, kind: str) -> "Design":
        """The same problem of another kind of hop (``hop.kind``)."""
        return self.model_copy(update={"hop": self.hop.model_copy(update={"kind": kind})})

    @model_validator(mode="after")
    def _whole_hop(self) -> "Design":
        """What the hop leaves out as it suits the leg's size; the leg is where its problem says."""
        around = self.surroundings
        hop = self.hop.with_defaults(self.leg.length / PAPERS_LENGTH, around.gravity)
        object.__setattr__(self, "hop", hop)  # frozen, but not yet anyone's
        object.__setattr__(self, "leg", self.leg.falling(around.fall))
        return self


def as_changed(data: Mapping[str, Any], cause: str, remedy: str) -> Design:
    """The problem that changed data describe; UsageError that names the ``cause``, the first entry that no problem may have,
    and the ``remedy``."""
    try:
        return Design.model_validate(data)
    except ValidationError as error:
        first = error.errors()[0]
        named = (str(part) for part in first["loc"] if part not in ("joint", "link"))  # as problem files name it
        entry = ".".join(named)
        sentence = f"{cause} {entry} = {first['input']!r}, which no problem may have: {remedy}"
        raise UsageError(f"{data['name']}: {sentence}") from None


def refuse_landed(design: Design, what: str) -> None:
    """UsageError for ``what`` knows the hop from rest to the apex alone, if the problem asks for another."""
    if design.hop.lands:
        which = {"periodic": "the periodic hop", "landing": "the hop that lands"}[design.hop.kind]
        raise UsageError(f'{what} does not know {which} yet: set hop.kind = "single"')
