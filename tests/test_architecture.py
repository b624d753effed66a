"""What may import what: leg <- ocp <- nlp <- planner, one way, and verification on its own."""

import ast
import subprocess
import sys
from collections.abc import Iterator
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

import hopopt

SOURCE = Path(hopopt.__file__).parent
FILES = {path.relative_to(SOURCE).as_posix(): path for path in sorted(SOURCE.rglob("*.py"))}
TREES = {name: ast.parse(path.read_text(encoding="utf-8")) for name, path in FILES.items()}

# what the modules of a folder (or a file) may import of hopopt
ALLOWED = {
    "leg/": ("hopopt.errors", "hopopt.fields", "hopopt.design", "hopopt.leg"),
    "ocp/": ("hopopt.errors", "hopopt.design", "hopopt.leg", "hopopt.ocp", "hopopt.user_code"),
    "nlp/": ("hopopt.errors", "hopopt.nlp", "hopopt.ocp.problem", "hopopt.ocp.guess"),
    "sim/machine.py": (
        "hopopt.design",
        "hopopt.leg",
    ),
    "verify/plan.py": (
        "hopopt.errors",
        "hopopt.design",
        "hopopt.leg",
        "hopopt.sim.machine",
        "hopopt.verify.measures",
        "hopopt.verify.landing",
        "hopopt.verify.limits",
    ),
    "verify/landing.py": ("hopopt.sim.machine",),
    "verify/limits.py": ("hopopt.design", "hopopt.leg", "hopopt.sim.machine"),
    "verify/whole_hop.py": (
        "hopopt.design",
        "hopopt.leg",
        "hopopt.sim.machine",
        "hopopt.verify.measures",
        "hopopt.verify.plan",
        "hopopt.verify.limits",
    ),
    "verify/measures.py": ("hopopt.design", "hopopt.leg", "hopopt.sim.machine"),
    "errors.py": (),
    "user_code.py": ("hopopt.errors",),
}
FORBIDDEN = {
    "sim/": ("hopopt.ocp", "hopopt.nlp"),
    "control/": ("hopopt.ocp", "hopopt.nlp"),
    "problem/": ("hopopt.ocp", "hopopt.nlp", "hopopt.planner.solve", "hopopt.planner.solution", "hopopt.verify.plan"),
    "planner/solution.py": ("hopopt.planner.solve", "hopopt.storage.solution", "hopopt.cli.main"),
    "planner/solve.py": ("hopopt.storage.solution", "hopopt.cli.main", "hopopt.plots.hop"),
    "planner/refine_and_verify.py": (
        "hopopt.planner.solve",
        "hopopt.storage.solution",
        "hopopt.cli.main",
        "hopopt.plots.hop",
    ),
}
ONLY = {  # libraries with one home
    "matplotlib": (
        "plots/hop.py",
        "plots/stick.py",
        "plots/style.py",
        "plots/runs.py",
        "plots/runs_stick.py",
        "plots/runs_budget.py",
        "plots/sweep.py",
        "plots/sensitivity.py",
        "plots/pareto.py",
    ),
    "xarray": ("storage/runs.py", "studies/sweep/store.py"),
    "h5netcdf": ("storage/netcdf.py",),
    "h5py": ("storage/netcdf.py",),
}
SLOW = ("matplotlib", "pandas", "xarray", "scipy.stats", "dask", "joblib")  # to import, and seldom needed
UNSAFE_MODULES = ("pickle", "cPickle", "dill", "cloudpickle", "marshal", "shelve")
UNSAFE_CALLS = ("eval", "exec", "compile", "__import__")


def type_checking(node: ast.AST) -> bool:
    """Whether the node is ``if TYPE_CHECKING:``, which never runs."""
    return isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING"


def walk(node: ast.AST, inside_functions: bool) -> Iterator[ast.AST]:
    """All nodes that can run, those of functions if wanted."""
    for child in ast.iter_child_nodes(node):
        if type_checking(child):
            continue
        if not inside_functions and isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda):
            continue
        yield child
        yield from walk(child, inside_functions)


def imports(name: str, inside_functions: bool = True) -> set[str]:
    """Dotted names a file imports; ``from a import b`` counts as a.b."""
    found = set()
    for node in walk(TREES[name], inside_functions):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{name} has a relative import"
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
    return found


def within(imported: str, homes: tuple[str, ...]) -> bool:
    return any(imported == home or imported.startswith(f"{home}.") for home in homes)


def files_of(prefix: str) -> list[str]:
    return [name for name in FILES if name.startswith(prefix)]


def test_there_is_something_to_check() -> None:
    for prefix in (*ALLOWED, "problem/", "planner/solution.py", "planner/solve.py", "planner/refine_and_verify.py"):
        assert files_of(prefix), prefix
    assert "hopopt.design.Leg" in imports("leg/robot.py")
    assert "matplotlib" in {i.split(".")[0] for i in imports("plots/hop.py")}


@pytest.mark.parametrize("prefix", ALLOWED)
def test_layers_import_only_what_lies_below_them(prefix: str) -> None:
    own = {name: {i for i in imports(name) if within(i, ("hopopt",))} for name in files_of(prefix)}
    wrong = {name: sorted(i for i in found if not within(i, ALLOWED[prefix])) for name, found in own.items()}
    assert not any(wrong.values()), wrong


@pytest.mark.parametrize("prefix", FORBIDDEN)
def test_modules_keep_away_from_what_uses_them(prefix: str) -> None:
    found = {name: sorted(i for i in imports(name) if within(i, FORBIDDEN[prefix])) for name in files_of(prefix)}
    assert not any(found.values()), found


@pytest.mark.parametrize("library", ONLY)
def test_a_library_has_one_home(library: str) -> None:
    users = {name for name in FILES if any(within(i, (library,)) for i in imports(name))}
    assert users <= set(ONLY[library]), users


def test_pinocchio_models_are_made_in_one_place() -> None:
    makers = {
        name
        for name, tree in TREES.items()
        for node in ast.walk(tree)
        if isinstance(node, ast.Call) and ast.unparse(node.func) == "pin.Model"
    }
    assert makers == {"leg/robot.py"}


@pytest.mark.parametrize("name", FILES)
def test_nothing_runs_what_it_reads(name: str) -> None:
    """No pickle, no eval: a problem file or a result is data."""
    assert not [i for i in imports(name) if within(i, UNSAFE_MODULES)]
    for node in ast.walk(TREES[name]):
        if isinstance(node, ast.Call):
            assert not (isinstance(node.func, ast.Name) and node.func.id in UNSAFE_CALLS), ast.unparse(node)
            assert not [k for k in node.keywords if k.arg == "allow_pickle" and ast.unparse(k.value) != "False"]


def test_modules_import_each_other_in_no_circle() -> None:
    """At import time; graphlib raises CycleError on a circle."""
    modules = {f"hopopt.{name[:-3].replace('/', '.')}".removesuffix(".__init__"): name for name in FILES}

    def module(imported: str) -> str | None:
        return next((m for m in (imported, imported.rpartition(".")[0]) if m in modules and m != "hopopt"), None)

    graph = {m: {module(i) for i in imports(name, inside_functions=False)} - {None, m} for m, name in modules.items()}
    assert len(list(TopologicalSorter(graph).static_order())) >= len(modules)


@pytest.mark.parametrize(
    "modules",
    [
        "hopopt.cli.main, hopopt.planner.solve, hopopt.storage.solution",
        "hopopt.ocp.initial_guess, hopopt.planner.multistart",
    ],
)
def test_what_every_solve_needs_imports_nothing_slow(modules: str) -> None:
    words = f"import sys, {modules}; print([name for name in {SLOW} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", words], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_what_is_imported_on_first_use_is_listed() -> None:
    assert set(hopopt.__all__) <= set(dir(hopopt))
