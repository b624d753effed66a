"""The hop as a multi-phase problem: a sequence of phases, an objective, and what the user adds to both."""

from copy import copy
from dataclasses import replace
from functools import cached_property

import casadi as ca

from hopopt.design import Design
from hopopt.drivetrain.gear import SOFTNESS
from hopopt.errors import UsageError
from hopopt.ocp.custom import Custom, as_rule, checked, named_custom
from hopopt.ocp.custom import path as custom_path
from hopopt.ocp.drives import carried_on, holding, reversing_speeds
from hopopt.ocp.free_parameters import FreeParameters
from hopopt.ocp.guesses.motion import MovingLeg
from hopopt.ocp.heat import heat_goes_on
from hopopt.ocp.hops.periodic import hop_after_hop
from hopopt.ocp.hops.to_rest import to_rest
from hopopt.ocp.objectives.objective import HopObjective
from hopopt.ocp.objectives.registry import find
from hopopt.ocp.objectives.tie_break import EFFORT, LOOPED, REVERSING, effort, largest_effort
from hopopt.ocp.phases import LegPhase
from hopopt.ocp.problem import Ends, Gentler, Objective, Parameter, PathConstraint, Phase, Problem
from hopopt.ocp.rules import rules_of

FIXED = FreeParameters()
# times as gently as their law says gears turn from driving to braking: a program is led from each to the next
SOFTER = (16.0, 6.0, 2.5)
SEQUENCES = {"periodic": hop_after_hop, "landing": to_rest}  # by hop.kind; of a single hop the objective's


class Hop(MovingLeg):
    """One hop of a leg towards an objective; ``problem`` is what the transcription sees.

    constraints: the user's own that were given beside the problem; own: these and those that the problem names
    """

    def __init__(
        self, design: Design, objective: str | HopObjective = "clearance", free_parameters: FreeParameters = FIXED,
        constraints: tuple[Custom, ...] = (),
    ):  # fmt: skip
        self.objective, self.free_parameters, self.constraints = find(objective), free_parameters, constraints
        self.asked = objective if isinstance(objective, str) else self.objective
        if self.objective.kind is not None and not design.hop.lands:
            design = design.of_kind(self.objective.kind)
        if fault := self.objective.fault(design):
            raise UsageError(f"objective {self.objective.name}: {fault}")
        super().__init__(design)
        named = named_custom(design)
        self.rules, self.own = (*rules_of(design), *map(as_rule, named)), (*named, *constraints)
        if design.hop.lands and (self.loops or len(self.falling) < 2):
            raise UsageError(
                f'hop.kind = "{design.hop.kind}" needs a leg in a plane whose body moves along x and z (leg.guides): this one\'s '
                'guides or joints hold the foot on the ground as well; set hop.kind = "single"'
            )
        for c in (*self.own, *((self.objective.custom,) if self.objective.custom else ())):
            checked(c, self, c is self.objective.custom)

    def with_solver_of(self, design: Design) -> "Hop":
        """The same question, to be answered with the solver settings of another design; of them the tie-break alone is
        part of ``problem``."""
        other = copy(self)
        other.design = self.design.model_copy(update={"solver": design.solver})
        if other.tie_break != self.tie_break or other.design.solver.options != self.design.solver.options:
            other.__dict__.pop("problem", None)
        return other

    @cached_property
    def problem(self) -> Problem:
        """The multi-phase problem; every physical parameter of the leg is a parameter of it. Where gears turn round sharply from
        driving to braking there is a gentler one."""
        gentler = Gentler(lambda: self._problem(Parameter(SOFTNESS, value=1.0)), SOFTNESS, SOFTER)
        return replace(self._problem(), gentler=gentler if self.reverses else None)

    def _problem(self, *more: Parameter) -> Problem:
        """The problem, with these parameters besides."""
        goal = self.objective
        sequence = SEQUENCES.get(self.design.hop.kind, goal.sequence)(self, self.free_parameters)
        names = [part.phase.name for part in sequence.phases]
        drives = carried_on(self, *names, *(names[:1] if self.design.hop.periodic else ()))  # and round a cycle
        landing = names[-1] if self.design.hop.kind == "landing" else None
        drives += () if self.design.hop.periodic else holding(self, landing)
        return Problem(
            self.design.name,
            tuple(self._extended(phase) for phase in sequence.phases),
            self._towards(1.0),
            (*self.free_parameters.parameters(self.numbers), *goal.parameters(self), *more),
            (
                *sequence.transitions,
                *drives,
                *heat_goes_on(self, names),
                *goal.boundary(self),
                *self.free_parameters.boundary(self),
            ),
            self.design.solver.options,
        )

    def _extended(self, phase: LegPhase) -> Phase:
        """A phase with what the objective and the user's own constraints add to it."""
        motion = phase.motion
        own = (custom_path(c, self, phase.kind, motion) for c in self.constraints)
        path: list[PathConstraint] = [c for group in (self.objective.path(self, phase), *own) for c in group]
        integrands = {EFFORT: effort(self, motion), **self.objective.integrands(self, motion)}
        return phase.with_more(self.objective.controls(self), path, integrands)

    # ---- the tie-break ---------------------------------------------------------------------------------

    def _towards(self, times: float) -> Objective:
        """The objective, made a little worse by so many times the usual share of the effort."""
        goal, weight = self.objective, times * self.tie_break

        def value(e: Ends) -> ca.SX:
            total = sum(integrals[EFFORT] for integrals in e.integral.values())
            return goal.value(self, e) - goal.sign * weight * total

        return Objective(goal.name, value, goal.maximize, goal.unit, goal.scale(self), {EFFORT: weight})

    def tied(self, times: float) -> Problem:
        """The problem with a tie-break so many times as large; without one for 0."""
        return self.problem.towards(self._towards(times))

    @cached_property
    def reverses(self) -> bool:
        """Whether its gears turn from driving to braking."""
        return bool(reversing_speeds(self).any())

    @property
    def tie_break(self) -> float:
        """Weight of the effort in the objective [objective's unit per second]."""
        times, goal = (LOOPED if self.loops else 1.0), self.objective
        times *= REVERSING if self.reverses else 1.0
        return times * self.design.solver.tie_break * goal.tie_break(self) * goal.scale(self)

    @property
    def tie_break_bias(self) -> float:
        """What the tie-break can have cost the objective at most [its unit]: weight x largest effort x longest hop."""
        return self.tie_break * largest_effort(self) * sum(phase.duration[1] for phase in self.problem.phases)
