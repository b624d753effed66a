"""Memory of a process that solves many problems, one after the other."""

import gc
import sys
from pathlib import Path

import pytest

from hopopt.planner.solve import solve
from hopopt.problem.load import load

PAGE = 4096  # bytes


@pytest.mark.rarely
@pytest.mark.skipif(sys.platform != "linux", reason="the size of a process is read from /proc")
def test_memory_does_not_grow_with_the_number_of_solves() -> None:
    """The first dozen fills caches; after it a solve leaves less than 0.15 MB behind."""
    problem, sizes = load("paper", ["solver.refine=false"]), []
    for _ in range(2):
        for _ in range(12):
            solve(problem, starts=1, processes=1)
        gc.collect()
        sizes.append(int(Path("/proc/self/statm").read_text().split()[1]) * PAGE)
    assert sizes[1] - sizes[0] < 12 * 0.15e6
