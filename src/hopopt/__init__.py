"""hopopt: how high can a leg possibly lift its foot in a hop with the motors it has.

import hopopt as ho
s = ho.solve(ho.load("paper"), objective="clearance")
s.plot()
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from hopopt.codesign_run import codesign
    from hopopt.compare import Comparison
    from hopopt.ocp.custom import constraint, objective
    from hopopt.pareto import Front, front
    from hopopt.planner import solve
    from hopopt.problem_file import load
    from hopopt.solution import Solution
    from hopopt.storage import read, save
    from hopopt.sweep_run import Study, sweep

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
    "load": "problem_file", "solve": "planner", "Solution": "solution", "read": "storage", "save": "storage",
    "sweep": "sweep_run", "Study": "sweep_run", "Comparison": "compare", "codesign": "codesign_run", "front": "pareto",
    "Front": "pareto", "objective": "ocp.custom", "constraint": "ocp.custom",
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
