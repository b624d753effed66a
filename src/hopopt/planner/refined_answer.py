"""What one refined solution says, verified by the checks of a single solve."""

from collections.abc import Mapping
from dataclasses import dataclass

from hopopt.nlp.mesh_refinement import Refinement
from hopopt.ocp.hop import Hop
from hopopt.planner.refine_and_verify import numerical_checks, stated_figure
from hopopt.planner.solution import Solution
from hopopt.planner.summary import parts
from hopopt.verify.check import failed
from hopopt.verify.plan import verify_plan


@dataclass(frozen=True)
class Answer:
    """Objective [its unit], clearance and its parts [m], and which checks failed."""

    objective_value: float
    clearance_m: float
    parts: Mapping[str, float]
    failed_checks: tuple[str, ...]

    @property
    def verified(self) -> bool:
        return not self.failed_checks


def answer(hop: Hop, refinement: Refinement) -> Answer:
    """A refined solution, checked as the planner checks a single one."""
    goal, solution = hop.objective, refinement.solution
    plan = Solution(hop.design, goal.name, solution.phases, stated_figure(hop, solution))
    claims = plan.claims()
    checks = numerical_checks(hop.design, solution, refinement.errors, refinement.change)
    checks += verify_plan(hop.design, plan.tables, claims)
    names = tuple(check.name for check in failed(checks))
    return Answer(solution.objective, claims["clearance_m"], parts(plan), names)
