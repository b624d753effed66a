"""hopopt: how high can a leg possibly lift its foot in a hop with the motors it has.

import hopopt as ho
s = ho.solve("paper", objective="clearance")
s.plot()
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from hopopt.api import *  # noqa: F403

_LIGHT = {"load": "problem.load", "objective": "ocp.custom", "constraint": "ocp.custom"}  # these need not all of it


def __dir__() -> list[str]:
    """What there is, imported or not: for tab completion."""
    return sorted(__getattr__("__all__"))


def __getattr__(name: str) -> Any:
    """Import on first use, so that ``hopopt --help`` answers at once; hopopt.api has the one list of names."""
    from importlib import import_module
    from importlib.util import find_spec

    if find_spec(f"hopopt.{name}") is None:  # ``from hopopt import amounts`` asks here before it looks for the module
        module = import_module(f"hopopt.{_LIGHT.get(name, 'api')}")
        if name in (*_LIGHT, "__all__", *getattr(module, "__all__", ())):
            value = globals()[name] = getattr(module, name)
            return value
    raise AttributeError(f"module 'hopopt' has no attribute {name!r}")
