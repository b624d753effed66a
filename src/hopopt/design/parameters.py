"""Numbers of the user's own in a problem: functions use them, studies vary them."""

from hopopt.design.leg import physical_parameters
from hopopt.design.problem import Design

PAUSE, AMBIENT = "hop.pause", "environment.temperature"  # what else decides how hot motors get


def own_entry(name: str) -> str:
    """The path of a number of the user's own in the problem file."""
    return f"parameters.{name}.value"


def own_numbers(design: Design) -> dict[str, float]:
    """The numbers of the user's own by their names [the unit of each]."""
    return {name: own.value for name, own in (design.parameters or {}).items()}


def variable_numbers(design: Design) -> dict[str, float]:
    """Every number of a problem that is a parameter of its program, by path: of the leg, what is beside it, the user's own."""
    return physical_parameters(design.leg) | numbers_beside_leg(design)


def numbers_beside_leg(design: Design) -> dict[str, float]:
    """The pause and the air's temperature where a winding has a limit and the problem states them, and the user's own, by path."""
    leg, found = design.leg, dict[str, float]()
    if any(leg.drive(joint, "motor", "winding_limit")[1] is not None for joint in leg.joints):
        stated = {PAUSE: design.hop.pause, AMBIENT: design.environment and design.environment.temperature}
        found = {path: value for path, value in stated.items() if value is not None}
    return found | {own_entry(name): value for name, value in own_numbers(design).items()}
