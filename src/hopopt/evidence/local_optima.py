"""Global evidence: where many different starting points lead, kept start by start, and gathered into families.

A family is a local optimum on the first mesh: the starts that end at the same height. What it does is told by how the
body moves over the foot. The best family's optimum is refined and verified like any other.

<results>/<problem>-evidence-<hash8>/
    evidence.json, problem.toml     what is asked for, written first
    starts/NNNN.json                how start N ended; NNNN.traceback.txt: where a fault of hopopt ended it
    summary.json                    everything together, at the end
"""

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, fields
from functools import lru_cache
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter

from hopopt.design import Design
from hopopt.errors import ResultError
from hopopt.files import remove_abandoned, write_whole
from hopopt.nlp.solver.ipopt import NlpSolver
from hopopt.ocp.hop import Hop
from hopopt.ocp.objectives.direction import Directed
from hopopt.ocp.objectives.registry import find
from hopopt.planner.motion import Motion
from hopopt.planner.search.families import motion, words
from hopopt.planner.search.multistart import first_solver, grouped, run_chunk, solution_of
from hopopt.problem.load import design_hash, load, resolved_toml
from hopopt.storage.folder import as_json, new_folder, write_json, writing
from hopopt.studies.faults import Fault, side_by_side

HOW_TO_RESUME = "what has ended is kept: make room, then --resume goes on"

Say = Callable[[str], None]


@dataclass(frozen=True)
class Ended:
    """How one start ended on the first mesh: objective in its unit, and the motion as planner/search/families.py tells it."""

    index: int
    name: str
    success: bool
    status: str
    objective: float
    iterations: int
    seconds: float
    stance: float = 0.0
    sway: float = 0.0
    lean: float = 0.0
    dip: float = 0.0
    drift: float = 0.0
    swing: float = 0.0
    knee: float = 1.0


@dataclass(frozen=True)
class StartFamily:
    """Starts that end in the same local optimum: the best of them, how many, and what it does in words."""

    best: Ended
    count: int
    words: str

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {**asdict(self.best), "count": self.count, "words": self.words}


def open_study(design: Design, objective: str, results: Path) -> Path:
    """A new folder for a study of a problem's starts."""
    with writing(f"{results}: the study", "choose another folder"):
        folder = new_folder(results / f"{design.name}-evidence-{design_hash(design)}")
        (folder / "starts").mkdir()
        write_whole(folder / "problem.toml", resolved_toml(design).encode())
        write_json({"objective": objective, "hash": design_hash(design)}, folder / "evidence.json")
    return folder


def reopen_study(folder: Path) -> tuple[Design, str]:
    """Problem and objective of a study that was begun; ResultError if the folder is none."""
    try:
        asked = json.loads((folder / "evidence.json").read_text(encoding="utf-8"))
        design, objective, begun = load(folder / "problem.toml"), str(asked["objective"]), asked["hash"]
    except (OSError, ValueError, KeyError, TypeError):
        raise ResultError(
            f"{folder} is not a folder that hopopt evidence began: give one, or leave out --resume"
        ) from None
    if begun != design_hash(design):
        raise ResultError(f"{folder / 'problem.toml'} was changed since the study began: begin a new one with it")
    return design, objective


def finished(folder: Path) -> list[Ended]:
    """The starts that have ended so far, by number; ResultError if a file was changed."""
    found, entries, known = list[Ended](), TypeAdapter(Ended), {f.name for f in fields(Ended)}
    for path in sorted((folder / "starts").glob("*.json")):
        try:
            told: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
            told |= {name: float("nan") for name, x in told.items() if x is None}  # of no number, as JSON has it
            if told.keys() - known:
                raise ValueError
            ended = entries.validate_json(json.dumps(told), strict=True)
            if ended.index != int(path.stem):
                raise ValueError
        except (OSError, ValueError, TypeError, AttributeError):
            raise ResultError(f"{path} is not what hopopt wrote: remove it, and it is computed again") from None
        found.append(ended)
    return found


def run_starts(folder: Path, count: int, processes: int, say: Say) -> list[Ended]:
    """The first ``count`` starts of a study's problem; those that have ended before are kept."""
    remove_abandoned(folder / "starts")
    done = {e.index: e for e in finished(folder)}
    missing = [k for k in range(count) if k not in done]
    say(f"{len(done)} of {count} starts")
    design, objective = reopen_study(folder)
    goal = find(objective)
    for k, ended in side_by_side(_ended, {k: (design, objective, k) for k in missing}, processes):
        if isinstance(ended, Fault):
            with writing(f"{folder}: start {k + 1}", HOW_TO_RESUME):
                ended.keep(folder / "starts", f"{k:04d}")
            say(f"start {k + 1}: {ended.sentence}")
            continue
        done[ended.index] = ended
        with writing(f"{folder}: start {ended.index + 1}", HOW_TO_RESUME):
            write_whole(folder / "starts" / f"{ended.index:04d}.json", as_json(asdict(ended)).encode())
        best = max((e.objective for e in done.values() if e.success), key=goal.signed_value, default=None)
        say(f"{len(done)} of {count} starts" + ("" if best is None else f", best {best:.4f}"))
    return [done[k] for k in sorted(done) if k < count]


@lru_cache(maxsize=1)
def _program(design: Design, objective: str) -> tuple[Hop, NlpSolver]:
    """The program of the first mesh, built once in each process."""
    hop = Hop(design, objective)
    return hop, first_solver(hop)


def _ended(design: Design, objective: str, index: int) -> Ended:
    hop, solver = _program(design, objective)
    (outcome,) = run_chunk(hop, [index], solver)
    figures = motion(hop, Motion(hop.design, hop.objective.name, solution_of(outcome, solver.transcription).phases))
    return Ended(
        index, outcome.name, outcome.success, outcome.status, outcome.objective, outcome.iterations, outcome.seconds,
        **(figures if outcome.success else {}),
    )  # fmt: skip


def families(ended: Sequence[Ended], goal: Directed) -> list[StartFamily]:
    """The local optima that were found, best first."""
    ranked = sorted((e for e in ended if e.success), key=lambda e: goal.signed_value(e.objective), reverse=True)
    return [StartFamily(group[0], len(group), words(asdict(group[0]))) for group in grouped(ranked)]
