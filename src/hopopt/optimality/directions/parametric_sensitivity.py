"""How the optimum answers to the numbers of its problem: first derivatives from the multipliers.

At an optimum the objective's derivative by any number is the Lagrangian's partial derivative by it, for the rest
of the solution moves along directions that do not matter to first order (the envelope theorem; Fiacco,
Introduction to Sensitivity and Stability Analysis in Nonlinear Programming, 1983, theorem 3.4.1). It holds as long
as the same limits stay active; where they trade places, see optimality/directions/kinks.py.
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np
from scipy import sparse

from hopopt.nlp.layout import PhaseLayout
from hopopt.nlp.solver.ipopt import NlpSolution
from hopopt.nlp.transcription import Rows, Transcription
from hopopt.ocp.problem import split


@dataclass(frozen=True)
class Slopes:
    """d objective / d each number of a program, in the objective's unit over that number's.

    parameters: name -> (size,) of each fixed one. The bounds of variables, low_z and high_z, and of rows, low_g
    and high_g, are those in SI units; where both are equal, their sum is the derivative by the value they give.
    """

    solution: NlpSolution
    parameters: dict[str, np.ndarray]
    low_z: np.ndarray
    high_z: np.ndarray
    low_g: np.ndarray
    high_g: np.ndarray

    def of_rows(self, rows: Rows) -> tuple[np.ndarray, np.ndarray]:
        """By the lower and upper bounds of a constraint, (places, components) each."""
        where = slice(rows.start, rows.stop)
        low, high = (side[where].reshape(-1, len(rows.labels)) for side in (self.low_g, self.high_g))
        return low, high

    def of_state(self, phase: str, state: str) -> tuple[np.ndarray, np.ndarray]:
        """By the lower and upper bounds of a state, (nodes, components) each."""
        layout, where = self._layout(phase), self.solution.transcription.variables[phase].x
        names = [s.name for s in layout.phase.states for _ in range(s.size)]
        columns = [k for k, name in enumerate(names) if name == state]
        low, high = (side[where].reshape(layout.state_nodes, -1)[:, columns] for side in (self.low_z, self.high_z))
        return low, high

    def of_duration(self, phase: str) -> tuple[float, float]:
        """By the shortest and the longest duration of a phase."""
        t = self.solution.transcription
        rows = [self.of_rows(r) for r in t.rows if r.kind == "duration" and r.phase == phase]
        sums = [sum(float(pair[side].sum()) for pair in rows) for side in (0, 1)]
        arcs = t.variables[phase].durations
        if self._layout(phase).mesh.arcs == 1:  # else the shortest arc is the transcription's own
            sums[0] += float(self.low_z[arcs].sum())
        return sums[0], sums[1] + float(self.high_z[arcs].sum())

    def _layout(self, phase: str) -> PhaseLayout:
        return self.solution.transcription.layouts[phase]


def slopes(solution: NlpSolution, by_parameters: ca.Function | None = None) -> Slopes:
    """First derivatives of the optimal objective of a solved program; ``by_parameters``: its ``gradient_by_parameters``,
    if it is made already."""
    t, sign = solution.transcription, -solution.transcription.problem.objective.sign
    sides = []
    for lam, scale in ((solution.lam_x, t.scale), (solution.lam_g, t.row_scale)):
        sides += [-sign * np.minimum(lam, 0.0) / scale, -sign * np.maximum(lam, 0.0) / scale]
    gradient = (by_parameters or gradient_by_parameters(t))(solution.z, solution.p, solution.lam_g)
    return Slopes(solution, split(t.fixed, sign * np.array(gradient).ravel()), *sides)


def magnitudes(solution: NlpSolution) -> Slopes:
    """The same without signs, each row's part by itself: by how much derivatives change, relatively to it, with multipliers that
    change by a share of themselves."""
    t, nlp, by = solution.transcription, solution.transcription.nlp, slopes(solution)
    parts = ca.Function(
        "parts", [nlp["x"], nlp["p"]], [ca.jacobian(nlp["g"], nlp["p"]), ca.jacobian(nlp["f"], nlp["p"])]
    )
    of_rows, of_objective = parts(solution.z, solution.p)
    lam = sparse.diags(np.abs(solution.lam_g))
    total = np.abs(lam @ sparse.csr_matrix(of_rows.sparse())).sum(axis=0) + np.abs(np.array(of_objective))
    sides = (by.low_z, by.high_z, by.low_g, by.high_g)
    return Slopes(solution, split(t.fixed, np.asarray(total).ravel()), *map(np.abs, sides))


def gradient_by_parameters(t: Transcription) -> ca.Function:
    """(x, p, lam_g) -> partial derivative of f + lam_g' g by the fixed parameters p."""
    nlp = t.nlp
    lam = ca.MX.sym("lam", nlp["g"].numel())
    gradient = ca.gradient(nlp["f"] + ca.dot(lam, nlp["g"]), nlp["p"])
    return ca.Function("by_parameters", [nlp["x"], nlp["p"], lam], [gradient])
