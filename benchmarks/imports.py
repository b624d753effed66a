"""What a command imports, by package: self times as shares of what CasADi and Pinocchio alone take.

    python benchmarks/imports.py [COMMAND WORDS ...]

Runs `hopopt solve --starts 1 --no-figures --no-control`, or the command given, with `python -X importtime`, which makes
each import slower by about a half; so only shares are printed. A package of hopopt that a command has no use for shows here.
"""

import subprocess
import sys
import tempfile
from collections import Counter

DEFAULT = ("solve", "--starts", "1", "--no-figures", "--no-control")
BARE = ("casadi", "pinocchio")
LEAST = 0.01  # of CasADi and Pinocchio: what is printed by itself
LONGEST = 300  # s


def self_times(*words: str) -> Counter[str]:
    """Self time [us] of imports by package; of hopopt by its own packages."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-X", "importtime", *words]
        said = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=LONGEST, check=False).stderr
    found = Counter[str]()
    for line in said.splitlines():
        if line.startswith("import time:") and "|" in line and "self" not in line:
            own, _, name = line.removeprefix("import time:").split("|")
            parts = name.strip().split(".")
            found[".".join(parts[:2]) if parts[0] == "hopopt" else parts[0]] += int(own)
    return found


def main() -> None:
    """Print the table."""
    bare = sum(self_times("-c", f"import {', '.join(BARE)}").values())
    found = self_times("-m", "hopopt", *(sys.argv[1:] or DEFAULT))
    print(f"of what importing {' and '.join(BARE)} takes:")
    for name, own in found.most_common():
        if own > LEAST * bare:
            print(f"{own / bare:7.2f}  {name}")
    print(f"{sum(found.values()) / bare:7.2f}  in all")


if __name__ == "__main__":
    main()
