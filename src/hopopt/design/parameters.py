"""Numbers of the user's own in a problem: functions use them, studies vary them."""

from hopopt.design.leg import physical_parameters
from hopopt.design.problem import Design


def own_entry(name: str) -> str:
    """The path of a number of the user's own in the problem file."""
    return f"parameters.{name}.value"


def own_numbers(design: Design) -> dict[str, float]:
    """The numbers of the user's own by their names [the unit of each]."""
    return {name: own.value for name, own in (design.parameters or {}).items()}


def variable_numbers(design: Design) -> dict[str, float]:
    """Every number of a problem that is a parameter of its program: those of the leg, and the user's own, by path."""
    own = {own_entry(name): value for name, value in own_numbers(design).items()}
    return physical_parameters(design.leg) | own
