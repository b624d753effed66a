"""How the optimum of a hop that lands answers to the numbers of its touchdown (ocp/hops/touchdown_impact.py), from the multipliers."""

from collections.abc import Iterator

import numpy as np

from hopopt.design import Design
from hopopt.nlp.transcription import Rows
from hopopt.ocp.hops.periodic import STEP_CONSTRAINT
from hopopt.ocp.hops.touchdown_impact import FOOT_SPEED, GEAR_IMPACT, IMPACT_FRICTION, IMPACT_LOSS, IMPACT_PUSH, IMPULSE
from hopopt.optimality.directions.parametric_sensitivity import Slopes


def touchdown_slopes(design: Design, by: Slopes) -> Iterator[tuple[str, float]]:
    """Paths of entries and derivatives of the objective [its unit per unit], to be summed by path."""
    rows = {r.name: r for r in by.solution.transcription.rows}
    period = sum(phase.duration for phase in by.solution.phases.values())
    if STEP_CONSTRAINT in rows:
        yield "hop.speed", float(_by_shift(by, rows[STEP_CONSTRAINT], np.array([-period])))
    for limit in (IMPULSE, IMPACT_LOSS, FOOT_SPEED):
        if limit in rows:
            yield limit.key, float(by.of_rows(rows[limit])[1].sum())
    if IMPACT_FRICTION in rows:
        push = _values(by, rows[IMPACT_PUSH])[0]
        yield IMPACT_FRICTION.key, float(_by_shift(by, rows[IMPACT_FRICTION], np.full(2, push)))
    if GEAR_IMPACT in rows:
        low, high = by.of_rows(rows[GEAR_IMPACT])
        yield GEAR_IMPACT.key, float((high - low).sum())
        torque = _values(by, rows[GEAR_IMPACT])
        yield "hop.touchdown_time", float(_by_shift(by, rows[GEAR_IMPACT], -torque / design.hop.touchdown_time))


def _by_shift(by: Slopes, rows: Rows, shift: np.ndarray) -> float:
    """Derivative by a number that moves the values of a constraint by ``shift`` [its unit per unit], (components,): as if
    both bounds moved the other way."""
    low, high = by.of_rows(rows)
    return -float((low + high)[0] @ shift)


def _values(by: Slopes, rows: Rows) -> np.ndarray:
    """A boundary constraint's values [its unit], (components,)."""
    return by.solution.g[rows.start : rows.stop] * rows.scale
