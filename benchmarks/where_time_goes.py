"""Where the time of one verified answer goes, as shares of the whole process.

    python benchmarks/where_time_goes.py [PROBLEM]

Runs `hopopt solve PROBLEM --starts 1 --no-figures --no-control --json` as a user would who has no compiled derivatives yet, and,
for comparison, the bare import of casadi and pinocchio and `hopopt --help`.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from typing import Any


def wall(*command: str, cwd: str) -> tuple[float, str]:
    """Wall time [s] and standard output of a command."""
    began, cold = time.perf_counter(), {**os.environ, "HOPOPT_CACHE": "off"}
    done = subprocess.run([sys.executable, *command], cwd=cwd, env=cold, capture_output=True, text=True, check=True)
    return time.perf_counter() - began, done.stdout


def stages(s: dict[str, Any], imports: float, total: float) -> dict[str, float]:
    """Seconds by stage of a run with one start, from its summary ``s``."""
    timings, solving = s["timings_s"], s["starts"]["each"][0]["seconds"]
    first, *steps = s["mesh"]
    found = {"imports": imports, "model": timings["model"], "graph: solve 1": timings["starts"] - solving}
    found[f"NLP of solve 1 ({_size(first)}, {first['iterations']} iterations)"] = solving
    for k, step in enumerate(steps, start=2):
        found[f"graph: solve {k}"] = step["build_seconds"]
        found[f"NLP of solve {k} ({_size(step)}, {step['iterations']} iterations)"] = step["solve_seconds"]
    inside = sum(m["build_seconds"] + m["solve_seconds"] for m in steps)
    found["errors measured between the solves"] = timings["refinement"] - inside
    found["verification"] = timings["verification"]
    found["reading, writing, figures of the summary"] = total - imports - sum(timings.values())
    return found


def _size(step: dict[str, Any]) -> str:
    return " + ".join(str(n) for n in step["intervals"].values()) + " intervals"


def main() -> None:
    """Measure and print."""
    problem = sys.argv[1] if len(sys.argv) > 1 else "paper"
    with tempfile.TemporaryDirectory() as folder:
        bare = wall("-c", "import casadi, pinocchio", cwd=folder)[0]
        imports = wall("-c", "import hopopt.cli.main, hopopt.planner.solve, hopopt.storage.solution", cwd=folder)[0]
        help_time = wall("-m", "hopopt.cli.main", "--help", cwd=folder)[0]
        arguments = ["solve", problem, "--objective", "clearance", "--starts", "1", "--no-figures", "--no-control"]
        total, out = wall("-m", "hopopt.cli.main", *arguments, "--json", cwd=folder)
    s = json.loads(out)
    print(f"{problem}: {total:.1f} s for a {s['status']} answer")
    for name, seconds in stages(s, imports, total).items():
        print(f"  {name:60s} {seconds:7.2f} s {seconds / total:6.1%}")
    print(f"for comparison: import casadi and pinocchio {bare:.2f} s, hopopt --help {help_time:.2f} s")


if __name__ == "__main__":
    main()
