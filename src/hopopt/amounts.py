"""How much may be asked for: more than here fills a computer's memory, or its disk, or takes years."""

import os
from math import inf

from hopopt.errors import UsageError

MOST_AMOUNTS = {
    "verify-best": 1000,
    "starts": 1000,  # as solver.starts
    "draws": 10_000,  # 4603 promise what 99.9 % of legs reach with confidence 0.99
    "hops": 1000,  # one after the other: a megabyte each
    "evaluations": 10_000,
    "tune": 10_000,
    "seed": 2**32 - 1,  # as solver.seed
}
PROCESS = 2.5e8  # bytes of a process that solves
USABLE = 0.8  # of the computer's memory


def check(name: str, number: int | None, least: int = 1) -> None:
    """UsageError if so many of ``name`` may not be asked for; None is left to the program."""
    if number is not None and not least <= number <= MOST_AMOUNTS[name]:
        raise UsageError(f"--{name} must be at least {least} and at most {MOST_AMOUNTS[name]}, not {number}")


def check_processes(number: int | None) -> None:
    """UsageError if so many processes have no room in memory; None is left to the program."""
    if number is not None and number < 1:
        raise UsageError("--processes must be at least 1")
    room = USABLE * memory() / PROCESS
    check_memory(f"--processes {number}", PROCESS * (number or 0), f"ask for {room:.0f} at most")


def check_memory(what: str, size: float, remedy: str) -> None:
    """UsageError, with the estimate, if ``what`` needs more bytes than this computer has for it."""
    if size > USABLE * memory():
        raise UsageError(
            f"{what} would take about {_gb(size)} of memory, and this computer has {_gb(memory())}: {remedy}"
        )


def memory() -> float:
    """Of this computer [bytes]; infinite where it does not say."""
    try:
        return float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    except (AttributeError, ValueError, OSError):
        return inf


def _gb(size: float) -> str:
    return f"{size / 1e9:.2g} GB"
