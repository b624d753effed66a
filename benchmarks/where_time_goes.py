"""Where the time of one verified answer goes, as shares of the whole process.

    python benchmarks/where_time_goes.py [PROBLEM]

Runs `hopopt solve PROBLEM --starts 1 --no-figures --json` as a user would, and in the same run the bare import of
casadi and pinocchio, `hopopt --help` and an empty interpreter, for comparison.
"""

import json
import subprocess
import sys
import tempfile
import time


def wall(*command: str, cwd: str) -> tuple[float, str]:
    """Wall time [s] and standard output of a command."""
    began = time.perf_counter()
    done = subprocess.run([sys.executable, *command], cwd=cwd, capture_output=True, text=True, check=True)
    return time.perf_counter() - began, done.stdout


def main() -> None:
    """Measure and print."""
    problem = sys.argv[1] if len(sys.argv) > 1 else "paper"
    with tempfile.TemporaryDirectory() as folder:
        empty = wall("-c", "pass", cwd=folder)[0]
        bare = wall("-c", "import casadi, pinocchio", cwd=folder)[0]
        help_time = wall("-m", "hopopt.cli", "--help", cwd=folder)[0]
        arguments = ["solve", problem, "--starts", "1", "--no-figures", "--json"]
        total, out = wall("-m", "hopopt.cli", *arguments, cwd=folder)
    s = json.loads(out)
    meshes = s["mesh"]
    stages = {
        "interpreter, imports, reading, writing": total - s["wall_s"],
        "model": s["timings_s"]["model"],
        "first mesh: graph, NLP, start": s["timings_s"]["starts"],
        "refinement: graphs and NLPs built, errors measured": sum(m["seconds"] - m["solve_seconds"] for m in meshes),
        **{f"refinement: NLP of mesh {k + 1}": m["solve_seconds"] for k, m in enumerate(meshes)},
        "verification": s["timings_s"]["verification"],
    }
    print(
        f"{problem}: {total:.1f} s for a {s['status']} answer, {total / bare:.0f} times importing casadi and pinocchio"
    )
    for name, seconds in stages.items():
        print(f"  {name:52s} {seconds:7.2f} s {seconds / total:6.1%}")
    print(f"  {'(not listed)':52s} {total - sum(stages.values()):7.2f} s")
    print(
        f"for comparison: python {empty:.2f} s, import casadi and pinocchio {bare:.2f} s, hopopt --help {help_time:.2f} s"
    )


if __name__ == "__main__":
    main()
