"""How far `hopopt choose` is from solving every pair by itself, and whether it misses one that clears.

    python benchmarks/choose_pairs.py [CLEARANCE] [MOTORS] [GEARS] [SEED] [SECONDS] [STARTS]

Draws so many motors (3 unless told) and gears (4) of the catalogue and chooses among all their pairs on the paper's leg
(clearance 0.5 m, seed 0). Then it solves the written problem of each pair by itself, those that were dropped too, in a drawn
order and as long as there is time (600 s, 90 s for a pair), from six starts unless told. Prints a line for each; what a
solve leaves unverified decides nothing, and is counted apart. 1 if a pair clears that was not listed, if a preliminary
clearance that is listed is off by more than 0.2 per cent, or a verified one by more than 1e-5.
"""

import random
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

from hopopt.errors import HopoptError, one_line
from hopopt.planner.solve import solve
from hopopt.problem.catalogue import catalogue, with_part
from hopopt.problem.load import load
from hopopt.studies.choose.choice import CLEARS, UNWEIGHED, Candidate, Choice
from hopopt.studies.choose.run import choose, written

PRELIMINARY, VERIFIED = 2e-3, 1e-5  # shares of the clearance by which it may be off
EACH = 90.0  # s for the solve of a pair


def compared(found: Choice, c: Candidate, starts: int) -> tuple[bool | None, str]:
    """Whether a pair is as a solve of its written problem has it (None: that decides nothing), and a line that says how far
    it is off."""
    began = time.monotonic()
    try:
        answer = solve(written(found, c), processes=1, starts=starts, time_limit=EACH)
    except HopoptError as error:
        late = time.monotonic() - began > 0.8 * EACH
        return None if late else c.outcome != CLEARS, f"{c.clearance}, a solve finds no hop: {one_line(error)[:80]}"
    if not answer.verified:
        return None, f"{c.state} {c.clearance}, a solve is not verified: {answer.clearance:.5f}"
    reached = answer.clearance
    if c.clearance is None:
        return not reached >= found.wish, f"a solve clears {reached:.4f}"
    off, most = c.clearance / reached - 1, PRELIMINARY if c.verified is None else VERIFIED
    fine = abs(off) <= most if c.outcome == CLEARS else not reached >= found.wish
    return fine, f"{c.state} {c.clearance:.5f}, a solve {reached:.5f}, off by {off:+.3%}"


def main() -> int:
    """Choose, solve, print."""
    given = [float(x) for x in sys.argv[1:]]
    wish, motors, gears, seed, seconds, count = given + [0.5, 3, 4, 0, 600, 0][len(given) :]
    starts = int(count) or 6
    known, rng = catalogue(), random.Random(int(seed))
    sold = {
        part: [n for n, e in with_part(part, known).items() if part in e.masses and len(e.stated) == 1]
        for part in ("motor", "gear")
    }
    drawn = [*rng.sample(sold["motor"], int(motors)), *rng.sample(sold["gear"], int(gears))]
    found = choose(
        load("paper"), wish, verify=2, processes=1, starts=starts, results=Path(tempfile.mkdtemp()),
        entries={name: known[name] for name in drawn},
    )  # fmt: skip
    print(
        f"{len(found.candidates)} pairs in {found.seconds:.0f} s: {dict(Counter(c.outcome for c in found.candidates))}"
    )
    tried = [c for c in found.candidates if c.outcome != UNWEIGHED]
    rng.shuffle(tried)
    began, told = time.monotonic(), Counter[bool | None]()
    for c in tried:
        if time.monotonic() - began > seconds:
            break
        fine, words = compared(found, c, starts)
        told[fine] += 1
        print(f"{c.pair.name}: {c.outcome}; {words}{'   <-- not as it should be' if fine is False else ''}", flush=True)
    print(f"{told.total()} of {len(tried)} tried, {told[False]} not as they should be, {told[None]} undecided")
    return int(told[False] > 0)


if __name__ == "__main__":
    raise SystemExit(main())
