"""Whether a limit that a hop keeps anyway changes what is found, and a tighter one ever raises it: random legs that hop on and on.

    python benchmarks/limits_as_used.py [LEGS] [SEED] [FILE]

Takes the random legs of random_legs.py (30 unless told) with hops that repeat. Each is solved without a limit of the touchdown, on
the first mesh from the default starts. Then one limit is added, of loss, impulse, foot speed, gear torque and stance in turn: as
large as the answer uses it, and TIGHTER times that. Prints a line for each leg. FILE keeps the lines, and what it has is not solved
again. Exit code 1 if a limit as it is used changes the answer by over 1e-4, or a tighter one raises it by as much.
"""

import json
import sys
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from random_legs import feasible_legs

import hopopt as ho
from hopopt.errors import HopoptError, one_line
from hopopt.ocp.hop import Hop
from hopopt.planner.answer.touchdown import orbit
from hopopt.planner.motion import Motion
from hopopt.planner.search.first_mesh import search_first_mesh
from hopopt.planner.search.multistart import distinct, first_transcription, solution_of
from hopopt.studies.consistency import CONTRADICTING_GAIN

STANCE = "hop.stance_duration"
LIMITS = {
    "hop.touchdown_loss": "impact_loss_J",
    "hop.touchdown_impulse": "impulse_Ns",
    "hop.touchdown_speed": "foot_speed_m_s",
    "hop.touchdown_gear_torque": "gear_impact_torque_Nm",
    STANCE: "",
}
TIGHTER = 0.7
ROUNDING = 1e-6  # share by which the limit as it is used is larger, so that rounding does not forbid the answer


@dataclass(frozen=True)
class Outcome:
    """A leg's clearances [m] without the limit, with it as it is used, and with TIGHTER times that.

    leg: its number; limit: the entry; used: its value in the answer [its unit]; ended: "" or what went wrong; seconds: processor time
    """

    leg: int
    limit: str
    used: float = np.nan
    free: float = np.nan
    same: float = np.nan
    tighter: float = np.nan
    ended: str = ""
    seconds: float = 0.0

    @property
    def contradiction(self) -> str:
        """What contradicts what, in words; "" if nothing does."""
        off = CONTRADICTING_GAIN * self.free
        words = [
            (f"the limit as it is used changes the answer by {self.same - self.free:+.1e} m")
            if not abs(self.same - self.free) <= off
            else "",
            (f"a tighter one raises it by {self.tighter - self.free:.1e} m") if self.tighter - self.free > off else "",
            (f"a tighter one raises that of the looser by {self.tighter - self.same:.1e} m")
            if self.tighter - self.same > off
            else "",
        ]
        return "" if self.ended else "; ".join(filter(None, words))


def best(entries: dict[str, Any]) -> tuple[float, Motion | None]:
    """Clearance [m] of the best hop on the first mesh, and that hop; nan and None if none is found."""
    hop = Hop(ho.load("paper", entries))
    found = distinct(search_first_mesh(hop, hop.design.solver.starts, 1, lambda text: None).outcomes)
    if not found:
        return np.nan, None
    phases = solution_of(found[0], first_transcription(hop)).phases
    return found[0].value, Motion(hop.design, hop.objective.name, phases)


def limited(entries: dict[str, Any], limit: str, value: float) -> dict[str, Any]:
    """The leg's entries with one more limit."""
    if limit == STANCE:
        shortest = entries[STANCE][0]
        return entries | {STANCE: [shortest, max(value, shortest)]}
    return entries | {limit: value}


def looked_at(leg: int, entries: dict[str, Any]) -> Outcome:
    """One leg with its limit."""
    began, limit = time.process_time(), list(LIMITS)[leg % len(LIMITS)]
    try:
        free, motion = best(entries)
        if motion is None:
            return Outcome(leg, limit, ended="no hop was found", seconds=time.process_time() - began)
        cycle = orbit(motion)
        used = motion.phases["stance"].duration if limit == STANCE else getattr(cycle, LIMITS[limit])
        same, tighter = (best(limited(entries, limit, share * used))[0] for share in (1 + ROUNDING, TIGHTER))
    except HopoptError as error:
        return Outcome(leg, limit, ended=one_line(error), seconds=time.process_time() - began)
    return Outcome(leg, limit, used, free, same, tighter, seconds=time.process_time() - began)


def outcomes(legs: list[dict[str, Any]], seed: int, file: Path | None) -> Iterator[Outcome]:
    """Each leg's clearances: those of the file, the others as they end."""
    lines = map(json.loads, file.read_text().splitlines()) if file is not None and file.exists() else ()
    known = {line["outcome"]["leg"]: Outcome(**line["outcome"]) for line in lines if line["seed"] == seed}
    for k, entries in enumerate(legs):
        if k not in known:
            known[k] = looked_at(k, entries)
            if file is not None:
                with file.open("a") as stream:
                    stream.write(json.dumps({"seed": seed, "outcome": asdict(known[k])}) + "\n")
        yield known[k]


def main() -> int:
    """Solve, and print; 1 if anything contradicts."""
    count, seed = (int(x) for x in (sys.argv[1:3] + ["30", "0"][len(sys.argv[1:3]) :]))
    file = Path(sys.argv[3]) if len(sys.argv) > 3 else None
    legs, wrong, seconds = [leg | {"hop.kind": "periodic"} for leg in feasible_legs(count, seed)], 0, 0.0
    for found in outcomes(legs, seed, file):
        heights = f"{found.free:.6f} {found.same:.6f} {found.tighter:.6f} m"
        said = found.ended or found.contradiction or "consistent"
        print(f"{found.leg:3d} {found.limit} {found.used:.4g}: {heights}, {found.seconds:.0f} s; {said}", flush=True)
        wrong, seconds = wrong + bool(found.contradiction), seconds + found.seconds
    print(f"{wrong} of {count} contradict (seed {seed}), {seconds / count:.0f} s a leg")
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
