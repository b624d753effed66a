"""What may import what: packages from the ground up, one way, and no circle of modules."""

import ast
import subprocess
import sys
from collections import Counter
from collections.abc import Iterable, Iterator
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

import hopopt

SOURCE = Path(hopopt.__file__).parent
FILES = {path.relative_to(SOURCE).as_posix(): path for path in sorted(SOURCE.rglob("*.py"))}

PACKAGES = {  # one row each, from the ground up: what of hopopt it may import, besides itself
    "errors": (),
    "amounts": ("errors",),
    "files": (),
    "record": (),
    "user_code": ("errors",),
    "extensions": ("errors", "record", "user_code"),
    "design": ("errors",),
    "compiled": ("files",),
    "drivetrain": ("errors", "extensions", "design", "compiled"),
    "leg": ("errors", "design", "drivetrain"),
    "problem": ("extensions", "user_code", "files", "errors", "record", "design", "drivetrain", "leg"),
    "ocp": ("extensions", "errors", "user_code", "design", "drivetrain", "leg"),
    "sim": ("files", "errors", "compiled", "design", "drivetrain", "leg"),
    "nlp": ("extensions", "files", "errors", "record", "ocp.problem", "ocp.guesses.guess"),
    "control": ("extensions", "errors", "compiled", "user_code", "design", "drivetrain", "leg", "problem.load", "sim"),
    "verify": ("errors", "record", "design", "drivetrain", "leg", "sim.machine"),
    "global_search": ("amounts", "errors", "compiled", "design", "drivetrain", "leg", "sim", "ocp.guesses.guess", "nlp.deadline"),
    "optimality": ("errors", "record", "design", "drivetrain", "leg", "ocp", "nlp", "verify"),
    "planner": (
        "extensions", "amounts", "errors", "record", "user_code", "design", "drivetrain", "leg", "problem", "ocp", "sim", "nlp", "control", "verify", "global_search",
        "optimality",
    ),
    "storage": (
        "extensions", "files", "errors", "record", "design", "drivetrain", "leg", "problem", "ocp", "sim", "nlp", "control", "verify", "optimality", "planner",
    ),
    "studies": (
        "extensions", "files", "amounts", "errors", "record", "user_code", "design", "drivetrain", "leg", "problem", "ocp", "sim", "nlp", "control", "verify",
        "global_search", "optimality", "planner", "storage",
    ),
    "paper": ("files", "errors", "design", "drivetrain", "leg", "problem", "sim", "control"),
    "comparison": (
        "extensions", "files", "amounts", "errors", "record", "user_code", "design", "drivetrain", "leg", "problem", "ocp", "sim", "nlp", "control", "verify",
        "global_search", "optimality", "planner", "storage", "paper",
    ),
    "evidence": (
        "files", "errors", "record", "design", "drivetrain", "leg", "problem", "ocp", "nlp", "global_search", "optimality", "planner", "storage",
        "studies",
    ),
    "robot_data": ("errors", "design", "drivetrain", "leg", "problem", "sim", "planner", "comparison"),
    "export": ("errors", "design", "drivetrain", "leg", "ocp.phases", "control", "verify", "planner"),
    "report": ("errors", "record", "design", "drivetrain", "leg", "problem", "ocp.objectives", "sim", "planner", "storage", "studies.sweep"),
    "plots": (
        "errors", "design", "drivetrain", "leg", "problem", "ocp", "sim", "nlp", "control", "verify", "optimality", "planner",
        "storage", "studies", "paper", "comparison", "evidence", "report",
    ),
    "live": ("extensions", "files", "errors", "design", "drivetrain", "leg", "problem", "ocp", "nlp", "optimality", "planner", "storage", "studies", "comparison", "report"),
    "api": (
        "extensions", "errors", "design", "leg", "problem", "ocp", "nlp", "control", "planner", "storage", "studies", "comparison", "robot_data", "plots", "live",
    ),
    "cli": (
        "extensions", "files", "amounts", "errors", "record", "user_code", "design", "drivetrain", "leg", "problem", "ocp", "sim", "nlp", "control", "verify", "global_search",
        "optimality", "planner", "storage", "studies", "paper", "comparison", "evidence", "robot_data", "export", "report", "plots", "live",
    ),
    "__main__": ("cli",),
    "__init__": ("api",),
}  # fmt: skip
COMING: set[str] = set()  # packages with a row that need not be there
LATE = {  # where hopopt is imported inside functions: what it costs (python -X importtime) where it is not used
    "__init__.py": "what is used first decides what is imported: all of it takes 1 s",
    "api/": "figures need matplotlib (0.4 s), a robot's data scipy.stats (0.3 s)",
    "cli/answer/show.py": "a problem needs nothing of what a stored answer is made of: 0.4 s",
    "cli/answer/solve.py": "what is drawn, simulated or reported when the answer is there, and co-design: 1 s together",
    "cli/main.py": "the words of an OSError, and modules of a user's own, need numpy and pydantic (0.3 s); hopopt --help needs neither",
    "cli/share/export.py": "a figure needs matplotlib (0.4 s), and most plans are written without",
    "comparison/compare.py": "tuning needs joblib (0.07 s)",
    "compiled/kernel.py": "the compiler, numba, takes 0.3 s, and most commands compile nothing",
    "global_search/search.py": "the compiler of its loops takes 0.2 s",
}
MOST = 9  # files that lie in hopopt itself; and modules in a package
ONLY = {  # libraries with one home
    "matplotlib": ("plots/", "api/"),
    "xarray": ("studies/sweep/store.py", "api/"),
    "h5netcdf": ("storage/netcdf.py",),
    "h5py": ("storage/netcdf.py",),
}
SLOW = ("matplotlib", "pandas", "xarray", "scipy.stats", "dask", "joblib", "numba")  # to import, and seldom needed
UNSAFE_MODULES = ("pickle", "cPickle", "dill", "cloudpickle", "marshal", "shelve")
UNSAFE_CALLS = ("eval", "exec", "compile", "__import__")


@cache
def tree(name: str) -> ast.Module:
    """A file as Python reads it; not while tests are collected, which every worker does."""
    return ast.parse(FILES[name].read_text(encoding="utf-8"))


@cache
def imports(name: str, at: str = "anywhere") -> set[str]:
    """Dotted names a file imports, also under TYPE_CHECKING; ``from a import b`` counts as a.b. ``at``: "anywhere", or
    only "the top" or inside "functions"."""
    found = set()
    for node, inside in walk(tree(name)):
        if at != "anywhere" and inside != (at == "functions"):
            continue
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{name} has a relative import"
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
    return found


def walk(node: ast.AST, inside: bool = False) -> Iterator[tuple[ast.AST, bool]]:
    """All nodes, and whether each is inside a function."""
    for child in ast.iter_child_nodes(node):
        yield child, inside
        yield from walk(child, inside or isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda))


def within(imported: str, homes: Iterable[str]) -> bool:
    return any(imported == home or imported.startswith(f"{home}.") for home in homes)


def files_of(package: str) -> list[str]:
    return [name for name in FILES if name.startswith(f"{package}/") or name == f"{package}.py"]


def module_of(name: str) -> str:
    """A file's dotted name."""
    return f"hopopt.{name[:-3].replace('/', '.')}".removesuffix(".__init__")


MODULES = {module_of(name): name for name in FILES}


def modules_imported(name: str) -> set[str]:
    """The modules of hopopt that a file imports."""

    def module(imported: str) -> str | None:
        return next((m for m in (imported, imported.rpartition(".")[0]) if m in MODULES), None)

    return {m for i in imports(name) if within(i, ["hopopt"]) and (m := module(i))}


def test_there_is_something_to_check() -> None:
    assert all(files_of(package) for package in PACKAGES.keys() - COMING)
    assert "hopopt.design.Leg" in imports("leg/robot.py")
    assert "hopopt.plots.hop.figures_of" in imports("api/solution.py", "functions")
    assert "hopopt.plots.hop.figures_of" not in imports("api/solution.py", "the top")
    assert "hopopt.studies.pareto.front.Front" in imports("plots/studies/pareto.py")  # under TYPE_CHECKING
    assert "hopopt.planner.solve" in modules_imported("comparison/compare.py")


def test_every_file_is_in_a_package_with_a_row() -> None:
    assert {name.partition("/")[0].removesuffix(".py") for name in FILES} <= PACKAGES.keys()
    assert len([name for name in FILES if "/" not in name]) <= MOST


def test_packages_are_small() -> None:
    homes = Counter(name.rpartition("/")[0] for name in FILES if "__init__" not in name)
    assert not {home: count for home, count in homes.items() if count > MOST}


def test_rows_allow_only_what_stands_above_them() -> None:
    rows = list(PACKAGES)
    for package, allowed in PACKAGES.items():
        assert {a.partition(".")[0] for a in allowed} <= set(rows[: rows.index(package)]), package


@pytest.mark.parametrize("package", PACKAGES)
def test_a_package_imports_only_what_lies_below_it(package: str) -> None:
    allowed = [f"hopopt.{home}" for home in (package, *PACKAGES[package])]
    own = {name: sorted(i for i in imports(name) if within(i, ["hopopt"])) for name in files_of(package)}
    wrong = {name: [i for i in found if not within(i, allowed)] for name, found in own.items()}
    assert not any(wrong.values()), wrong


def test_modules_import_each_other_in_no_circle() -> None:
    """Nor by an import inside a function or under TYPE_CHECKING; graphlib raises CycleError on a circle."""
    graph = {module: modules_imported(name) for module, name in MODULES.items()}
    assert len(list(TopologicalSorter(graph).static_order())) == len(MODULES)


def test_imports_inside_functions_stand_where_a_command_starts() -> None:
    late = {name for name in FILES if any(within(i, ["hopopt"]) for i in imports(name, "functions"))}
    assert not [name for name in late if not name.startswith(tuple(LATE))]


@pytest.mark.parametrize("library", ONLY)
def test_a_library_has_one_home(library: str) -> None:
    users = {name for name in FILES if any(within(i, (library,)) for i in imports(name))}
    assert not [name for name in users if not name.startswith(ONLY[library])], users


def test_pinocchio_models_are_made_in_one_place() -> None:
    makers = {
        name
        for name in FILES
        for node in ast.walk(tree(name))
        if isinstance(node, ast.Call) and ast.unparse(node.func) == "pin.Model"
    }
    assert makers == {"leg/robot.py"}


@pytest.mark.parametrize("name", FILES)
def test_nothing_runs_what_it_reads(name: str) -> None:
    """No pickle, no eval: a problem file or a result is data."""
    assert not [i for i in imports(name) if within(i, UNSAFE_MODULES)]
    for node in ast.walk(tree(name)):
        if isinstance(node, ast.Call):
            assert not (isinstance(node.func, ast.Name) and node.func.id in UNSAFE_CALLS), ast.unparse(node)
            assert not [k for k in node.keywords if k.arg == "allow_pickle" and ast.unparse(k.value) != "False"]


def test_what_every_solve_needs_imports_nothing_slow() -> None:
    modules = "hopopt.cli.main, hopopt.planner.solve, hopopt.storage.solution, hopopt.ocp.guesses.initial_guess, "
    modules += "hopopt.planner.search.multistart, hopopt.api"
    words = f"import sys, {modules}; print([name for name in {SLOW} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", words], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_solvers_are_made_in_one_place_which_heeds_ctrl_c() -> None:
    makers = ("ca.nlpsol", "ca.rootfinder", "ca.integrator")  # of CasADi's, those that let signal handlers run
    callers = {
        name
        for name in FILES
        for node in ast.walk(tree(name))
        if isinstance(node, ast.Call) and ast.unparse(node.func) in makers
    }
    assert callers == {"nlp/solver/casadi_solver.py"}
