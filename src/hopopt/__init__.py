"""hopopt: how high can a leg possibly lift its foot in a hop with the motors it has.

import hopopt as ho
s = ho.solve(ho.load("paper"), objective="clearance")
s.plot()
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from hopopt.ocp.custom import constraint, objective
    from hopopt.planner.solution import Solution
    from hopopt.planner.solve import solve
    from hopopt.problem.load import load
    from hopopt.storage.solution import read, save
    from hopopt.studies.codesign import codesign
    from hopopt.studies.compare import Comparison
    from hopopt.studies.pareto import Front, front
    from hopopt.studies.sweep.run import Study, sweep

__all__ = [
    "Comparison",
    "Front",
    "Solution",
    "Study",
    "codesign",
    "constraint",
    "front",
    "load",
    "objective",
    "read",
    "save",
    "solve",
    "sweep",
]
_HOME = {
    "load": "problem.load", "solve": "planner.solve", "Solution": "planner.solution", "read": "storage.solution",
    "save": "storage.solution", "sweep": "studies.sweep.run", "Study": "studies.sweep.run",
    "Comparison": "studies.compare", "codesign": "studies.codesign", "front": "studies.pareto",
    "Front": "studies.pareto", "objective": "ocp.custom", "constraint": "ocp.custom",
}  # fmt: skip


def __dir__() -> list[str]:
    """What there is, imported or not: for tab completion."""
    return sorted({*__all__, *(name for name in globals() if name.startswith("__"))})


def __getattr__(name: str) -> Any:
    """Import on first use, so that ``hopopt --help`` answers at once."""
    if name not in _HOME:
        raise AttributeError(f"module 'hopopt' has no attribute {name!r}")
    from importlib import import_module

    value = getattr(import_module(f"hopopt.{_HOME[name]}"), name)
    globals()[name] = value
    return value
