"""hopopt: how high can a leg possibly lift its foot in a hop with the motors it has.

import hopopt as ho
s = ho.solve("paper", objective="clearance")
s.plot()
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from hopopt.api import (
        Comparison,
        Front,
        Solution,
        Study,
        codesign,
        constraint,
        front,
        identify,
        load,
        objective,
        read,
        robust,
        save,
        simulate,
        solve,
        sweep,
    )

__all__ = [
    "Comparison",
    "Front",
    "Solution",
    "Study",
    "codesign",
    "constraint",
    "front",
    "identify",
    "load",
    "objective",
    "read",
    "robust",
    "save",
    "simulate",
    "solve",
    "sweep",
]
_LIGHT = {"load": "problem.load", "objective": "ocp.custom", "constraint": "ocp.custom"}  # these need not all of it


def __dir__() -> list[str]:
    """What there is, imported or not: for tab completion."""
    return sorted(__all__)


def __getattr__(name: str) -> Any:
    """Import on first use, so that ``hopopt --help`` answers at once."""
    if name not in __all__:
        raise AttributeError(f"module 'hopopt' has no attribute {name!r}")
    from importlib import import_module

    value = getattr(import_module(f"hopopt.{_LIGHT.get(name, 'api')}"), name)
    globals()[name] = value
    return value
