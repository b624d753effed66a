"""A point of a map from starts of its problem: of a list every point, for those next to it may be unlike it; else where no
family of hops leads to one."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from hopopt.nlp.deadline import Deadline
from hopopt.nlp.solver.ipopt import GENTLE_OPTIONS, NlpSolution, NlpSolver
from hopopt.nlp.solver.known_optima import Known, KnownOptima
from hopopt.nlp.solver.patience import Patience
from hopopt.ocp.guesses.feasibility import strength
from hopopt.ocp.guesses.initial_guess import make_guess, starts_of
from hopopt.ocp.hop import Hop
from hopopt.problem.load import changed
from hopopt.studies.sweep.definition import Definition
from hopopt.studies.sweep.first_program import first_program
from hopopt.studies.sweep.point_file import Point

TOLERANCE = 1e-6  # of Ipopt: values within 3e-4 of those of the tightest, in half the iterations
ITERATIONS = 200  # at most, from a start
SETTLED = {  # an optimum that is approached so slowly is settled, within 1e-3 of the objective
    "ipopt.acceptable_iter": 8,
    "ipopt.acceptable_tol": 1e-2,
    "ipopt.acceptable_constr_viol_tol": 1e-6,
    "ipopt.acceptable_compl_inf_tol": 1e-3,
    "ipopt.acceptable_obj_change_tol": 5e-5,
}
# Of a drive that cannot lift the leg each step of Ipopt's restoration takes half a second; hops were found within fewer.
HOPELESS = GENTLE_OPTIONS | {"ipopt.max_resto_iter": 15}
COLD = HOPELESS | SETTLED | {"ipopt.tol": TOLERANCE, "ipopt.max_iter": ITERATIONS}
STARTS = 2  # of the problem
FINER = 2  # times as many intervals: of a map most is off by what they smear, in stance or in flight
FAR = 0.75  # share of the value that a list asks for: where the first start ends below it no other is tried


def cold_program(definition: Definition, hop: Hop, point: Point, until: Deadline) -> NlpSolver:
    """The first mesh's program of a point, to be solved from anywhere; it knows no hop yet."""
    watching = Patience if definition.listed else KnownOptima
    solver = first_program(definition, hop, point.values, until, COLD, watching)[1]
    if solver.known is not None:
        solver.known.known.clear()
    return solver


def settled(solver: NlpSolver, s: NlpSolution) -> NlpSolution:
    """How a solve ended; of one of a list that did not settle its best iterate."""
    return solver.known.settled(s) if isinstance(solver.known, Patience) else s


def from_starts(hop: Hop, solver: NlpSolver, wish: float = 0.0) -> Iterator[NlpSolution]:
    """The hops that its starts lead to; one that runs into a hop found before it is given up. A leg that cannot hold its start
    pose, or ends far below the wish, is seldom helped by another start than the first."""
    weak = strength(hop.design, hop.robot) < 1
    for start in starts_of(hop, STARTS):
        s = settled(solver, solver(make_guess(hop, start)))
        if s.success:
            if solver.known is not None:
                solver.known.known.append(Known(s.z, -hop.objective.signed_value(s.objective)))
            yield s
        if weak or (s.success and hop.objective.signed_value(s.value) < FAR * wish):
            return


def finer_value(definition: Definition, point: Point, x: np.ndarray, until: Deadline) -> float | None:
    """The objective of a point's hop, of its variables x [SI] on the first mesh, on a finer one that all points share; None
    where that leads nowhere."""
    s = definition.design.solver
    settings = {
        "solver.stance_intervals": FINER * s.stance_intervals,
        "solver.flight_intervals": FINER * s.flight_intervals,
    }
    finer = replace(definition, design=changed(definition.design, settings))
    t = cold_program(
        definition, Hop(definition.design_at(point.index), definition.objective), point, until
    ).transcription
    solver = cold_program(finer, Hop(finer.design_at(point.index), finer.objective), point, until)
    found = settled(solver, solver(solver.transcription.guess_from(t.unpack(x / t.scale, t.parameter_values())[0])))
    return found.value if found.success else None
