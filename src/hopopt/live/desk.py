"""What takes seconds of a design that rests: verification, controllers, the report, the problem file."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from hopopt.comparison.paper_control import paper_hop
from hopopt.comparison.robust.robustness import can_be_had
from hopopt.design import Design
from hopopt.errors import UsageError
from hopopt.files import write_whole
from hopopt.live.bench import Found
from hopopt.live.picture import picture
from hopopt.nlp.deadline import NEVER
from hopopt.nlp.solver.ipopt import CARRIED, NlpSolver
from hopopt.ocp.hop import Hop
from hopopt.planner.search.first_mesh import search_first_mesh
from hopopt.planner.search.multistart import distinct, first_transcription, outcome_of
from hopopt.planner.search.required_clearance import from_highest
from hopopt.planner.solution import Solution
from hopopt.planner.solve import TIME_LIMIT, settled, solve_from
from hopopt.planner.stopwatch import Stopwatch
from hopopt.problem.load import changed, resolved_toml
from hopopt.report.content import of_solutions
from hopopt.report.page import page
from hopopt.storage.folder import new_folder
from hopopt.storage.solution import read, save
from hopopt.studies.maps.search import families_of
from hopopt.studies.maps.warm import Carried

EXPLORED = "explored"  # name of the start from which a design is refined
DRAWS = 100  # legs, of which 95 % reach what is told


@dataclass(frozen=True)
class Verified:
    """What verification says of a design.

    verified: whether every check passed; failed: those that did not
    value: the objective [its unit]; None where it is not verified
    figures, picture: as of ``Found``; folder: where the result is kept
    """

    verified: bool
    failed: tuple[str, ...]
    value: float | None
    figures: Mapping[str, float | None]
    picture: Mapping[str, Any] = field(repr=False)
    folder: str = ""


class Desk:
    """Where one design after another is looked at closely; results and files go to a folder."""

    def __init__(
        self, design: Design, objective: str, folder: Path, starts: int | None = None,
        say: Callable[[str], None] = lambda text: None,
    ):  # fmt: skip
        self._design, self._objective, self._folder, self._say = design, objective, folder, say
        self._starts = starts or design.solver.starts

    def verify(self, entries: Mapping[str, Any], found: Found) -> Verified:
        """The hop of a design, refined from the first mesh's and verified."""
        hop, until = Hop(changed(self._design, entries), self._objective), NEVER.within(TIME_LIMIT)
        t, carried = first_transcription(hop), found.carried
        if carried is None or len(carried.x) != len(t.scale):
            raise UsageError("this design has no hop that could be verified")
        solver = NlpSolver(t, CARRIED, until=until)
        s = solver.from_vector(carried.x / t.scale, (carried.lam_g, carried.lam_x))
        outcome = outcome_of(EXPLORED, s, 0.0)
        first = solve_from(hop, [outcome], [outcome], self._say, until)
        _, best, _ = settled(hop, [first], [outcome], self._say, Stopwatch(), until)
        best = save(best, self._folder)
        value = best.summary.objective_value if best.verified else None
        failed = tuple(best.summary.failed_checks)
        shown = picture(best)
        return Verified(best.verified, failed, value, shown.figures, shown.drawn, str(best.result_dir))

    def search(self, entries: Mapping[str, Any]) -> tuple[dict[int, Carried], tuple[str, ...]]:
        """The kinds of hop that the search of a single solve finds of a design, the best first, and what they do."""
        hop, until = Hop(changed(self._design, entries), self._objective), NEVER.within(TIME_LIMIT)
        besides = from_highest(hop, self._starts, self._say, until=until)
        found = distinct(search_first_mesh(hop, self._starts, 1, self._say, besides, until).outcomes)
        return families_of(hop, found, np.zeros(0)) if found else ({}, ())

    def pd(self, folder: str) -> dict[str, Any]:
        """What the paper's force control clears on a verified design's leg [m]; None, and why, where it does not hop."""
        if (hop := paper_hop(self._read(folder).design)) is None:
            raise UsageError("the paper's force control is for legs of two joints, and cannot be simulated on this one")
        return {"clearance": hop.clearance, "why": hop.fault}

    def reached(self, folder: str) -> dict[str, float | None]:
        """What a share of drawn legs reach of a verified design, tracking a plan and by PD control [m]."""
        had = can_be_had(self._read(folder), DRAWS, say=self._say)
        return {
            "share": had.share,
            "tracked": had.tracked and had.tracked.clearance_m,
            "pd": had.pd and had.pd.clearance_m,
        }

    def report(self, folder: str) -> str:
        """Write the page of a verified design into its folder; returns the file."""
        text, file = page(of_solutions([self._read(folder)])), Path(folder) / "report.html"
        if not file.exists():
            write_whole(file, text.encode())
        return str(file)

    def write(self, entries: Mapping[str, Any]) -> str:
        """Write a design as a problem file of its own; returns the file."""
        text = resolved_toml(changed(self._design, entries))
        file = new_folder(self._folder / f"{self._design.name}-design") / f"{self._design.name}.toml"
        write_whole(file, text.encode())
        return str(file)

    def _read(self, folder: str) -> Solution:
        found = read(folder)
        if not found.verified:
            raise UsageError("this design is not verified")
        return found
