"""Certificate of first-order optimality: Pontryagin's conditions along a solution, checked one by one.

Costates and limits' multipliers come from the program's multipliers (optimality/minimum_principle/costates.py). What they must satisfy
in continuous time is evaluated along the trajectory, between the nodes too (optimality/minimum_principle/pontryagin.py). The integration
and the derivatives of the phases' functions are not those of the program. Signs: docs/certificate.md.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from hopopt.nlp.solver.ipopt import NlpSolution
from hopopt.optimality.bounds import duration_bounds_residual, free_parameters_residual, initial_state_residual
from hopopt.optimality.minimum_principle.arcs import activity, arcs
from hopopt.optimality.minimum_principle.costates import phase_multipliers, sign
from hopopt.optimality.minimum_principle.phase_functions import Along, PhaseFunctions
from hopopt.optimality.minimum_principle.pontryagin import FINE_SCHEME, PhaseCertificate, missed
from hopopt.optimality.minimum_principle.transversality import TransversalityConditions, transversality_conditions
from hopopt.verify.check import Check, Condition

COSTATES = "costates"  # of the conditions along a phase, the one that is shown by itself
STEADY, AT_END = "controls stationary", "transversality at its end"
MESHES = tuple(f" {name}" for name in (COSTATES, STEADY, AT_END))  # endings of those that finer intervals may mend
# Tolerances, all relative; in brackets the most that a built-in leg leaves with default settings:
COSTATE = 1e-4  # ten times the local error that states may have: costates are integrated on their mesh (2e-6)
RESOLVED, MOST_PIECES = 0.1, 8  # of COSTATE: what is aimed at where intervals are cut for it; of one interval at a time
GAINED = 0.5  # of STATIONARY: the same, by all intervals alike
HAMILTONIAN = 5e-4  # H is the sum of large terms of either sign, each in error by up to COSTATE: a few of them (4e-4)
ENDS = 1e-5  # what the program itself meets, solved to 1e-11, where it creeps to 1e-7; its quadrature of H over a phase is less accurate (4e-6)
STATIONARY = 1e-3  # what could be gained to first order: a millimetre of a metre (5e-4; 8e-2 on the first mesh)


@dataclass(frozen=True)
class Certificate:
    """Every check, and by phase what it was evaluated on."""

    checks: tuple[Check, ...]
    phases: Mapping[str, PhaseCertificate]
    ends: TransversalityConditions

    @property
    def passed(self) -> bool:
        """Whether every condition holds."""
        return all(check.passed for check in self.checks)


def entry(condition: str, phase: str = "") -> str:
    """What a condition (of a phase) is called in the summary."""
    return f"{phase} {condition}".strip().replace(" ", "_")


def by_entry(conditions: Iterable[Check]) -> dict[str, Condition]:
    """Conditions by what they are called in the summary."""
    return {entry(c.name): c for c in conditions}


def certify(solution: NlpSolution) -> Certificate:
    """Pontryagin's conditions of a solution with its multipliers."""
    fine, nodes, integrals = dict[str, Along](), dict[str, Along](), dict[str, np.ndarray]()
    for name, layout in solution.transcription.layouts.items():
        functions = PhaseFunctions(layout, solution.transcription.problem.parameters)
        fine[name] = functions.along(solution, name, np.array(FINE_SCHEME.c))
        nodes[name] = functions.along(solution, name, np.array(layout.scheme.c))
        integrals[name] = np.einsum("i,k,ikl->l", solution.phases[name].lengths, FINE_SCHEME.b, fine[name].l)
    ends, phases = transversality_conditions(solution, integrals), {}
    for name in fine:
        m = phase_multipliers(solution, name)
        phases[name] = PhaseCertificate(solution, name, ends.phases[name], fine[name], nodes[name], m)
    checks = [check for phase in phases.values() for check in phase_checks(phase)]
    return Certificate((*checks, *_shared(solution, phases, ends)), phases, ends)


def unresolved(certificate: Certificate) -> dict[str, np.ndarray]:
    """Into how many pieces intervals should be cut so that costates fit, at the end too, and controls are stationary, by phase, (N,)
    each; {} if nothing is gained so: where all hold, or do not though other conditions fail too."""
    failed = {check.name for check in certificate.checks if not check.passed}
    if not failed or any(not name.endswith(MESHES) for name in failed):
        return {}
    pieces = {}
    for name, c in certificate.phases.items():
        misses = c.costate_misses(arcs(activity(c.solution, name))) / (RESOLVED * COSTATE)
        if f"{name} {STEADY}" in failed:
            misses = np.maximum(misses, c.gains() / (GAINED * STATIONARY / len(misses)))
        order = c.layout.scheme.order
        pieces[name] = np.clip(np.ceil(misses ** (1 / order)), 1, MOST_PIECES).astype(int)
    return pieces


def phase_checks(c: PhaseCertificate) -> list[Check]:
    """The conditions along one phase and at its ends."""
    found, name = arcs(activity(c.solution, c.name)), c.name
    costate, when = c.costate_residual(found)
    within, at = c.hamiltonian_within(found)
    across, edge = c.hamiltonian_across()
    limits, limit = c.limits_residual()
    start, state = initial_state_residual(c.solution, name)
    duration = duration_bounds_residual(c.solution, name)
    return [
        Check(f"{name} {COSTATES}", costate, COSTATE, "relative", when),
        Check(f"{name} {STEADY}", c.stationarity(), STATIONARY, "of the objective"),
        Check(f"{name} limits push where they hold", limits, STATIONARY, "of the objective", limit),
        Check(f"{name} Hamiltonian along arcs", within, HAMILTONIAN, "relative", at),
        Check(f"{name} Hamiltonian across switches", across, STATIONARY, "of the objective", edge),
        Check(f"{name} transversality at its start", c.start_residual(), ENDS, "relative"),
        Check(f"{name} {AT_END}", c.end_residual(), COSTATE, "relative"),
        Check(f"{name} transversality of its duration", c.duration_residual(), ENDS, "relative"),
        Check(f"{name} limits of its initial state", start, ENDS, "of the objective", state),
        Check(f"{name} limits of its duration", duration, ENDS, "of the objective"),
    ]


def _shared(
    solution: NlpSolution, phases: Mapping[str, PhaseCertificate], ends: TransversalityConditions
) -> list[Check]:
    """Boundary constraints' complementarity, and stationarity and complementarity of the free parameters."""
    objective = solution.magnitude
    pushed = np.abs(ends.multiplier) * missed(ends.multiplier, ends.value, ends.lower, ends.upper, sign(solution), 1.0)
    checks = [Check("limits of the ends", float(pushed.sum()) / objective, ENDS, "of the objective")]
    if ends.free.size:
        along = sum(c.by_free() for c in phases.values())
        size = solution.transcription.scale[solution.transcription.parameters]
        wrong = np.abs(ends.free + along - ends.free_multiplier) * size / objective
        bounds, parameter = free_parameters_residual(solution)
        checks.append(Check("free parameters", float(wrong.max()), ENDS, "of the objective"))
        checks.append(Check("limits of the free parameters", bounds, ENDS, "of the objective", parameter))
    return checks
