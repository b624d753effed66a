"""The one entry of the package: the best stance of a problem by dynamic programming."""

import time
from collections.abc import Callable
from dataclasses import replace

from hopopt.amounts import check_memory
from hopopt.design import Design
from hopopt.errors import UsageError
from hopopt.global_search.applicability import applies
from hopopt.global_search.result import GlobalSearch
from hopopt.nlp.deadline import NEVER, Deadline

SMALLEST, LARGEST = 7, 81  # nodes on an axis
NODE = 160  # bytes of a node: its value in every layer, its second differences, three states that follow, whether it matters


def search(
    design: Design, size: int = 15, rollouts: int = 6, threads: int = 2, progress: Callable[[str], None] | None = None,
    until: Deadline = NEVER,
) -> GlobalSearch:  # fmt: skip
    """The value on a grid of ``size`` nodes on each axis and at most ``rollouts`` stances that differ, best first;
    UsageError if the method does not apply, TimeoutError if it has not ended by ``until``. The same for any number of
    threads."""
    if reason := applies(design):
        raise UsageError(f"{design.name}: no global search: {reason}")
    check_size(size)
    if until.passed:
        raise TimeoutError
    began = time.perf_counter()
    if "x" in design.leg.guides:  # imported here: the compiler of these modules takes a third of a second
        from hopopt.global_search.equations.four_states import search_stance as on_grid
    else:
        from hopopt.global_search.equations.slider import search_slider as on_grid
    found = on_grid(design, size, rollouts, max(threads, 1), progress, until)
    return replace(found, seconds=time.perf_counter() - began)


def check_size(size: int) -> None:
    """UsageError if a grid of so many nodes on each of the four axes cannot be, or does not fit into memory."""
    if not SMALLEST <= size <= LARGEST:
        raise UsageError(f"a grid of {size} nodes on each axis: a size from {SMALLEST} to {LARGEST} is needed")
    check_memory(f"a grid of {size} nodes on each axis", NODE * size**4, "choose fewer")
