"""hopopt beside other packages for optimal control: the same problems, meshes and tolerances, one process at a time.

    python benchmarks/peers.py [--problems effort,arm,...] [--peers yapss,...] [--repeats 3] [--json FILE]
                               [--environments FOLDER]

Every package but hopopt is installed from the package index into an environment of its own below FOLDER (a temporary
one unless given; one that is there already is used as it is). Problems and their known optima are in peers/posed.py,
how each package is told of them in peers/in_<package>.py. A package that cannot be installed or does not solve is
listed with its reason. Times are the best of the repeats (short solves are repeated for 3 s, long ones for at most a minute), from starting Python to the end of the imports apart.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
import venv
from collections.abc import Callable
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent / "peers"
INDEX = {"yapss": "yapss", "rockit": "rockit-meco", "maptor": "maptor", "asset": "asset_asrl", "dymos": "dymos"}
PROBLEMS = ("effort", "denham", "arm", "jump", "rail", "hop")
LONGEST = 400  # [s] for one package and problem
Answer = dict[str, Any]


def last_line(text: str) -> str:
    """What a program said last."""
    return (text.strip().splitlines() or ["it said nothing"])[-1][:160]


def command(python: str, *arguments: str, cwd: Path | str | None = None) -> tuple[str, str]:
    """Standard output of a program, and the reason if it failed."""
    environment = {
        **os.environ,
        "OMP_NUM_THREADS": "1",
        "MPLBACKEND": "agg",
        "OPENMDAO_REPORTS": "0",
        "HOPOPT_CACHE": "off",
    }
    try:
        done = subprocess.run(
            [python, *arguments], capture_output=True, text=True, timeout=LONGEST, env=environment, cwd=cwd
        )
    except subprocess.TimeoutExpired:
        return "", f"not finished after {LONGEST} s"
    return done.stdout, last_line(done.stderr) if done.returncode else ""


def environment(folder: Path, peer: str) -> tuple[str, str]:
    """The Python that has the package, made if it is not there, and the reason if that failed."""
    home = folder / INDEX[peer]
    python = str(home / "bin" / "python")
    if Path(python).exists():
        return python, ""
    venv.create(home, with_pip=True)
    return python, command(python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", INDEX[peer])[1]


def answer(python: str, peer: str, problem: str, folder: Path, repeats: int) -> Answer:
    """What the package's script printed, or the reason why there is nothing."""
    out, failed = command(
        python, str(HERE.absolute() / f"in_{peer}.py"), problem, str(folder), str(repeats), str(time.time()), cwd=folder
    )
    return {"failed": failed} if failed else json.loads(last_line_of_json(out))


def last_line_of_json(out: str) -> str:
    """The line that the script printed, whatever the package printed around it."""
    return next(line for line in reversed(out.splitlines()) if line.startswith("{"))


def optimum(problem: str, folder: Path) -> float:
    """The known optimum."""
    sys.path.insert(0, str(HERE))
    from posed import posed  # pyright: ignore[reportMissingImports]

    return posed(problem, folder).optimum


def table(problem: str, known: float, found: dict[str, Answer]) -> str:
    """One problem's answers side by side, times as multiples of hopopt's."""
    head = f"| {problem}: {known:.7g} | build s | solve s | total s | x hopopt | iterations | error |"
    lines, own = [head, "|---" * 7 + "|"], found["hopopt"].get("total")
    for peer, a in found.items():
        if "failed" in a:
            lines.append(f"| {peer} | - | - | - | - | - | {a['failed']} |")
            continue
        ratio = f"{a['total'] / own:.1f}" if own else "-"
        error = f"{a['objective'] / known - 1:+.1e}" + ("" if solved(a) else f" {a['status']}")
        times = " | ".join(f"{a[what]:.3f}" for what in ("build", "solve", "total"))
        lines.append(f"| {peer} | {times} | {ratio} | {a['iterations']} | {error} |")
    return "\n".join(lines)


def solved(a: Answer) -> bool:
    """Whether the package says that it has solved the problem."""
    return a["status"].lower().rstrip(".") in (
        "solve_succeeded",
        "optimal solution found",
        "converged",
        "ipopt succeeded",
    )


def packages(found: dict[str, dict[str, Answer]]) -> str:
    """Versions, what each package's transcription is, and how long its imports take."""
    lines = ["| package | version | imports s | transcription |", "|---" * 4 + "|"]
    for peer in next(iter(found.values())):
        given = [answers[peer] for answers in found.values() if "failed" not in answers[peer]]
        if given:
            imports = min(a["imports"] for a in given)
            lines.append(f"| {peer} | {given[0]['version']} | {imports:.2f} | {given[0]['note']} |")
    return "\n".join(lines)


def measure(problems: list[str], peers: list[str], repeats: int, environments: Path, say: Callable[[str], None]) -> Any:
    """All answers, by problem and package."""
    pythons = {"hopopt": (sys.executable, ""), **{peer: environment(environments, peer) for peer in peers}}
    found: dict[str, dict[str, Answer]] = {}
    with tempfile.TemporaryDirectory() as folder:
        if "hop" in problems:
            command(sys.executable, str(HERE / "store_hop.py"), folder)
        for problem in problems:
            found[problem] = {
                peer: {"failed": failed} if failed else answer(python, peer, problem, Path(folder), repeats)
                for peer, (python, failed) in pythons.items()
            }
            say(table(problem, optimum(problem, Path(folder)), found[problem]) + "\n")
    return found


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--problems", default=",".join(PROBLEMS))
    parser.add_argument("--peers", default=",".join(INDEX))
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--environments", type=Path)
    parser.add_argument("--json", type=Path)
    given = parser.parse_args()
    problems, peers = given.problems.split(","), [p for p in given.peers.split(",") if p]
    with tempfile.TemporaryDirectory() as folder:
        environments = given.environments or Path(folder)
        found = measure(problems, peers, given.repeats, environments.absolute(), lambda text: print(text, flush=True))
    print(packages(found))
    if given.json:
        given.json.write_text(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
