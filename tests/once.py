"""What costs a solve is made once in a run of the tests, by the process that needs it first, and read by the others."""

import fcntl
import os
import pickle
from collections.abc import Callable, Mapping, Sequence
from hashlib import sha256
from pathlib import Path
from typing import Any, TypeVar

from hopopt.control.closed_loop import Run, simulate
from hopopt.control.strategies import BUILT_IN, Strategy
from hopopt.design import Design
from hopopt.planner.reserve import reserved
from hopopt.planner.solution import Solution
from hopopt.planner.solve import solve
from hopopt.problem.load import load
from hopopt.storage.netcdf import Group, to_bytes

FOLDER = "HOPOPT_TESTS_ONCE"  # environment variable: the folder of this run, or of runs of the same sources
T = TypeVar("T")


def once(name: str, make: Callable[[], T]) -> T:
    """What ``make`` gives, pickled under a name: a copy for each call."""
    file = Path(os.environ[FOLDER], sha256(name.encode()).hexdigest())
    with file.with_suffix(".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # let go when the file is closed, or its process ends
        if not file.exists():
            content = pickle.dumps(make())
            file.write_bytes(content)
    return pickle.loads(file.read_bytes())


def solved_once(
    overrides: Mapping[str, Any] | Sequence[str] = (), objective: str = "clearance", problem: str = "paper"
) -> Solution:
    """A built-in problem with entries changed, solved from one start."""
    design = load(problem, overrides)
    return once(f"{objective} {design.model_dump_json()}", lambda: solve(design, objective, starts=1, processes=1))


def plan_with_reserve(overrides: Mapping[str, Any] | Sequence[str] = ()) -> Solution:
    """What a controller tracks on the paper's leg: its reserve is kept from every limit. From one start."""
    design = reserved(load("paper", overrides))
    return once(f"plan {design.model_dump_json()}", lambda: solve(design, starts=1, processes=1))


def simulated_once(design: Design, strategy: Strategy, **more: Any) -> Run:
    """A built-in PD strategy's hop, as ``simulate`` simulates it; every other strategy is simulated at each call."""
    if BUILT_IN.get(strategy.name) is not strategy or strategy.needs_plan or more.get("controller") is not None:
        return simulate(design, strategy, **more)
    given = sha256(pickle.dumps(sorted(more.items()))).hexdigest()
    return once(f"{strategy.name} {design.model_dump_json()} {given}", lambda: simulate(design, strategy, **more))


def file_once(groups: Mapping[str, Group]) -> bytes:
    """A result's file, as ``to_bytes`` makes it: 0.3 s of each of many tests that store the same hop."""
    return once(f"file {sha256(pickle.dumps(groups)).hexdigest()}", lambda: to_bytes(groups))
