"""This version beside another in one run: processor times of the commands that people wait for, as ratios.

    python benchmarks/all.py [COMMIT] [ROUNDS] [PART ...]

COMMIT: the other version (17d0fc6 unless told), taken from this repository; its dependencies are those installed here.
Commands whose words have one of the parts, or all, are run in turns, each version with a cache of its own. The first round
only fills the caches; of the others (2 unless told) the least time counts, for other work on the machine only adds.
Prints the state of the machine, and a row for each command: user and system time of all its processes, and their ratio.
"""

import os
import platform
import resource
import subprocess
import sys
import tempfile
from importlib.metadata import version
from pathlib import Path

HERE = Path(__file__).parents[1]
PACKAGES = ("casadi", "pin", "numpy", "scipy", "numba")
LEGS = ("three_joint", "a1_leg", "b1_leg", "go1_leg", "go2_leg", "hyq_leg", "solo12_leg", "paper_four_quadrant")
COMMANDS = (
    "-c 'import casadi, pinocchio'",
    "-m hopopt show paper",
    "-m hopopt solve --objective clearance",
    "-m hopopt solve --starts 1 --no-figures --no-control",
    *(f"-m hopopt solve {leg} --no-figures --no-control" for leg in LEGS),
    "-m hopopt sweep paper --vary leg.gear.ratio=90:110:3 --no-figures",
)
LONGEST = 1800  # s


def processor_time(words: str, tree: Path, folder: Path) -> float:
    """User and system time [s] of a Python command with the sources of ``tree``, in a folder of its own."""
    own = {"PYTHONPATH": str(tree / "src"), "OMP_NUM_THREADS": "1", "HOPOPT_CACHE": str(folder / "cache")}
    own["PYTHONDONTWRITEBYTECODE"] = ""  # else each command compiles all sources again
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(
        f"'{sys.executable}' {words}", shell=True, cwd=folder, env={**os.environ, **own}, capture_output=True,
        timeout=LONGEST, check=True,
    )  # fmt: skip
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def least(words: str, trees: list[Path], folders: list[Path], rounds: int) -> list[float]:
    """Least time [s] of each version, in turns, after a round that does not count."""
    each = [[processor_time(words, *at) for at in zip(trees, folders, strict=True)] for _ in range(rounds + 1)]
    return [min(times) for times in zip(*each[1:], strict=True)]


def row(words: str, trees: list[Path], folders: list[Path], rounds: int) -> str:
    """A command's row of the table; where a version does not end well, its exit code."""
    said = words.removeprefix("-m ")
    try:
        old, new = least(words, trees, folders, rounds)
    except subprocess.CalledProcessError as error:
        return f"| `{said}` | ended with code {error.returncode} | | |"
    return f"| `{said}` | {old:.2f} s | {new:.2f} s | {new / old:.2f} |"


def commit_of(tree: Path) -> str:
    """The commit of a tree, marked if it has changes."""
    command = ["git", "describe", "--always", "--dirty", "--exclude", "*"]
    return subprocess.run(command, cwd=tree, capture_output=True, text=True, check=True).stdout.strip()


def state() -> str:
    """Of the machine: cores, load, Python and packages."""
    packages = ", ".join(f"{name} {version(name)}" for name in PACKAGES)
    cores, load = os.cpu_count(), os.getloadavg()[0]
    return f"{cores} cores, {platform.machine()}, load {load:.1f}, Python {platform.python_version()}, {packages}"


def main(commit: str = "17d0fc6", rounds: str = "2", *parts: str) -> None:
    """Measure and print."""
    with tempfile.TemporaryDirectory() as place:
        other, folders = Path(place) / "other", [Path(place) / name for name in ("old", "new")]
        for folder in folders:
            folder.mkdir()
        subprocess.run(["git", "worktree", "add", "-q", "--detach", str(other), commit], cwd=HERE, check=True)
        try:
            print(f"{state()}\n\n| command | {commit} | {commit_of(HERE)} | ratio |\n|---|---|---|---|", flush=True)
            for words in COMMANDS:
                if not parts or any(part in words for part in parts):
                    print(row(words, [other, HERE], folders, int(rounds)), flush=True)
            print(f"\n{state()}")
        finally:
            subprocess.run(["git", "worktree", "remove", "--force", str(other)], cwd=HERE, check=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
