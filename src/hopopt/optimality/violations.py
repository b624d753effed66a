"""Why a problem was not solved: the worst constraints of the last iterate, in words."""

import numpy as np

from hopopt.nlp.solver.ipopt import NlpSolution
from hopopt.nlp.transcription import Rows
from hopopt.ocp.problem import Component

MET_VIOLATION = 1e-6  # scaled violation below which a row counts as met


def violations(solution: NlpSolution, most: int = 3) -> list[str]:
    """One sentence for each of the worst violated constraints: which, in which phase, when and by how much."""
    t, found = solution.transcription, []
    over = np.maximum(np.maximum(solution.bounds.low_g - solution.g, solution.g - solution.bounds.high_g), 0.0)
    for rows in t.rows:
        block = over[rows.start : rows.stop].reshape(-1, len(rows.labels))
        for k, label in enumerate(rows.labels):
            worst = int(block[:, k].argmax())
            if block[worst, k] > MET_VIOLATION:
                found.append((float(block[worst, k]), _sentence(solution, rows, label, k, worst, block[worst, k])))
    return [sentence for _, sentence in sorted(found, key=lambda pair: -pair[0])[:most]]


def _sentence(solution: NlpSolution, rows: Rows, label: Component, component: int, worst: int, amount: float) -> str:
    unit, name = rows.unit, str(label)
    if rows.kind == "defect":
        states = solution.transcription.problem.phase(rows.phase).states
        unit = next(s.unit for s in states if label in s.components())
        name = f"the motion of {label} (its state at the end of an interval)"
    text = f"{name} is missed by {amount * rows.scale[component]:.3g} {unit}".rstrip()
    if not len(rows.interval):
        return f"{text} between the phases or at the end"
    trajectory = solution.phases[rows.phase]
    k = int(rows.interval[worst])
    when = trajectory.edges[k] + rows.place[worst] * trajectory.lengths[k]
    return f"{text} in {rows.phase}, {when:.3f} s after it began"
