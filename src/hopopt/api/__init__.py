"""The Python interface: its verbs, and the classes of what they return, with their methods.

The packages below compute, and know nothing of figures, tables and notebooks. Here each of their results has a class
that inherits it and adds methods, so that an editor knows them. ``with_methods`` makes one from a value of the package
below; of a class with no hops in it, ``asked.as_class`` does.
"""

# the old names are not in __all__: nobody need find them any more
from hopopt.api.keeping import save
from hopopt.api.notebook.live import LivePage, explore
from hopopt.api.old_names import codesign as codesign  # pyright: ignore[reportDeprecated]
from hopopt.api.old_names import front as front  # pyright: ignore[reportDeprecated]
from hopopt.api.program import Program, ProgramSolution
from hopopt.api.reading import Verification, read, verify
from hopopt.api.results import Choice, Front, Map, RobustHop, Run, Study, Transition
from hopopt.api.solution import Comparison, HopsComparison, Ladder, Solution
from hopopt.api.studies import choose, pareto, robust, sweep, transition
from hopopt.api.verbs import identify, program, simulate, solve
from hopopt.design import Design
from hopopt.ocp.custom import constraint, objective
from hopopt.problem.load import load

__all__ = [
    "Choice",
    "Comparison",
    "Design",
    "Front",
    "HopsComparison",
    "Ladder",
    "LivePage",
    "Map",
    "Program",
    "ProgramSolution",
    "RobustHop",
    "Run",
    "Solution",
    "Study",
    "Transition",
    "Verification",
    "choose",
    "constraint",
    "explore",
    "identify",
    "load",
    "objective",
    "pareto",
    "program",
    "read",
    "robust",
    "save",
    "simulate",
    "solve",
    "sweep",
    "transition",
    "verify",
]
