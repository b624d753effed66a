"""A finer mesh's program led gently to its solution, where the last mesh's point and multipliers do not lead there at once.

Sharp bends in a problem's functions can keep Newton's method from it, and a gentler problem (ocp/problem.py) has none. On one mesh
its optimum moves little as it is sharpened, so that each step begins near its end. (Continuation: Nocedal and Wright,
Numerical Optimization, 11.3.)
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from hopopt.nlp.refinement.continuous_limits import Enforced, enforcing
from hopopt.nlp.solver.ipopt import NEAR_OPTIONS, WAYS, Bounds, Multipliers, NlpSolution, NlpSolver
from hopopt.nlp.transcription import Transcription

GOOD = 1  # steps that end a solve which the next begins from
Solver = Callable[..., NlpSolver]  # of a program, options and, if that is given, how many good steps in a row end it


def led_gently(
    program: Enforced, solver: Solver, guess: Any, free: Mapping[str, Any], multipliers: Multipliers, bounds: Bounds
) -> NlpSolution | None:
    """The program's solution by way of the gentler problem's, with the iterations of all steps; None if it has none, or a step
    fails.

    solver: makes one for a program, from options and how many good steps in a row end it
    guess, free, multipliers, bounds: where the gentler one begins, as of ``NlpSolver``
    """
    t = program.given
    if (gentler := t.problem.gentler) is None:
        return None
    first, *others = gentler.values
    easier = enforcing(
        Transcription(t.problem.once("gentler", gentler.make), t.scheme, t.mesh), program.chosen
    ).transcription
    if not np.array_equal(easier.scale, t.scale):  # of a program that has been given the numbers of another leg
        return None
    s = solver(easier, WAYS[0], GOOD)(guess, {**free, gentler.number: first}, multipliers, bounds)
    if not s.success:
        return None
    near, iterations = solver(easier, NEAR_OPTIONS, GOOD), s.iterations
    for value in others:
        s = near.again(replace(s, p=easier.parameter_values({gentler.number: value})), bounds)
        iterations += s.iterations
        if not s.success:
            return None
    s = solver(program.transcription, NEAR_OPTIONS).again(replace(s, p=t.parameter_values()), bounds)
    return replace(s, iterations=iterations + s.iterations) if s.success else None
