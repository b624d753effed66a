"""One compiled program for problems that differ only in their numbers."""

from copy import copy

from hopopt.nlp.transcription import Transcription
from hopopt.ocp.problem import Problem


def with_numbers_of(t: Transcription, problem: Problem) -> Transcription:
    """The program ``t`` for another problem of the same form, without building it again.

    The problems may differ in the values of their fixed parameters and in the bounds, ends and durations of their
    phases' variables; right-hand sides, bounds of the constraints and all scales are those of ``t``.
    """
    other = copy(t)
    other.problem = problem
    other.free = tuple(p for p in problem.parameters if p.free)
    other.fixed = tuple(p for p in problem.parameters if not p.free)
    if [(p.name, p.size) for p in other.fixed] != [(p.name, p.size) for p in t.fixed]:
        raise ValueError("the problems have different parameters")
    other.layouts = {}
    for phase in problem.phases:
        layout = copy(t.layouts[phase.name])
        layout.phase = phase
        other.layouts[phase.name] = layout
    return other
