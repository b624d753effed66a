"""How long the commands of the docs take here: the table of docs/performance.md.

    python benchmarks/times.py [PART ...]

A row for each command, or for those whose words have one of the parts: wall time, and processor time of all its processes.
On a machine that does other work too the wall time is longer; the processor time tells what it would be.
"""

import os
import platform
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

COMMANDS = (
    "show paper",
    "solve --starts 1 --no-figures --no-control",
    "solve",
    "solve --set contact.friction=0.6",
    "simulate",
    "sensitivity --result RESULT",
    "report RESULT",
    "export RESULT --format csv",
    "compare",
    "sweep paper --vary leg.gear.ratio=90:110:3",
    "solve --hop periodic",
    "solve --hop landing",
    "transition --set contact.friction=0.6",
    "pareto --against peak_force --points 4 --starts 2",
    "robust --draws 60 --evaluations 4",
)
LONGEST = 1800  # s


def row(words: str, folder: Path) -> str:
    """Times of one command, in a folder of results."""
    found = sorted(path.parent for path in folder.glob("results/paper-????????/summary.json"))
    if "RESULT" in words and not found:
        return f"| `hopopt {words}` | no result | |"
    given = words.replace("RESULT", str(found[0]) if found else "")
    began, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
    command = [sys.executable, "-m", "hopopt", *given.split()]
    subprocess.run(command, cwd=folder, capture_output=True, timeout=LONGEST, check=True)
    wall, after = time.perf_counter() - began, resource.getrusage(resource.RUSAGE_CHILDREN)
    used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return f"| `hopopt {words}` | {wall:.0f} s | {used:.0f} s |"


def main(parts: list[str]) -> None:
    print(
        f"{os.cpu_count()} cores, {platform.machine()}, Python {platform.python_version()}, load {os.getloadavg()[0]:.1f}"
    )
    print("\n| command | wall | processor |\n|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        for words in COMMANDS:
            if not parts or any(part in words for part in parts):
                try:
                    print(row(words, Path(folder)), flush=True)
                except (subprocess.CalledProcessError, subprocess.TimeoutExpired) as error:
                    print(f"| `hopopt {words}` | {type(error).__name__} | |", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
