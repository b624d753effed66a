"""One plan for several legs under one controller: the program of ocp/hops/shared_control.py, solved from a motion that is known."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hopopt.design import Design
from hopopt.errors import NotSolvedError
from hopopt.nlp.deadline import NEVER, Deadline
from hopopt.nlp.mesh import uniform
from hopopt.nlp.schemes import scheme
from hopopt.nlp.solver.ipopt import NlpSolution, NlpSolver
from hopopt.nlp.trajectory import FromTrajectory, PhaseTrajectory
from hopopt.nlp.transcription import Transcription
from hopopt.ocp.hops.shared_control import CLEARANCE, DAMPING, STIFFNESS, TrueLeg, highest_gains, under_one_controller
from hopopt.ocp.phases import FLIGHT, STANCE
from hopopt.optimality.violations import violations
from hopopt.planner.motion import Motion
from hopopt.planner.solution import Solution

ACCURATE = 1e-6  # Ipopt's tolerance: the plan is judged by simulation, not by a certificate
FIRST_GAINS = 0.4  # of the highest, where the search for them begins
FLIGHTS = 2  # times the flight intervals of a first mesh: every leg retracts at its own speed


@dataclass(frozen=True)
class SharedPlan:
    """A plan for several legs.

    clearance: what each of them reaches by the program [m].
    feedback: K (n, 2 n) of the errors (q, v) [N m/rad, N m s/rad].
    believed: the believed leg's motion, which is the reference.
    solution: the program's, from which another may begin.
    """

    clearance: float
    feedback: np.ndarray
    believed: Motion
    solution: NlpSolution


def first_guess(plan: Solution) -> dict[str, Any]:
    """The parameters from which the search begins: the plan's clearance, and gains that sampled motors can have."""
    k_p, k_d = highest_gains(plan.design)
    return {CLEARANCE: plan.clearance, STIFFNESS: FIRST_GAINS * k_p, DAMPING: FIRST_GAINS * k_d}


def shared_plan(legs: Sequence[TrueLeg], begin: Solution | SharedPlan, until: Deadline = NEVER) -> SharedPlan:
    """The highest clearance that all these legs reach under one controller, and that controller; ``begin``: the plan of the
    believed leg alone, or one for as many other legs. Raises NotSolvedError with the worst constraints."""
    believed, s = legs[0].hop, legs[0].hop.design.solver
    mesh = {STANCE: uniform(s.stance_intervals), FLIGHT: uniform(FLIGHTS * s.flight_intervals)}
    program = Transcription(under_one_controller(legs), scheme(s.scheme, s.degree), mesh)
    guess: Mapping[str, Any]
    if isinstance(begin, SharedPlan):
        guess, parameters = program.guess_from(begin.solution.phases), dict(begin.solution.parameters)
    else:
        guess = {name: AllAlike(begin.phases[name], len(legs)) for name in mesh}
        parameters = first_guess(begin)
    solver = NlpSolver(program, {"ipopt.max_iter": s.max_iterations, "ipopt.tol": ACCURATE}, until=until)
    found = solver(guess, parameters)
    if not found.success:
        message = f"{believed.design.name}: no controller for {len(legs)} legs was found ({found.status})."
        raise NotSolvedError(message, violations(found))
    gains = [np.diag(np.atleast_1d(found.parameters[name])) for name in (STIFFNESS, DAMPING)]
    phases = {name: of_leg(trajectory, 0, len(legs)) for name, trajectory in found.phases.items()}
    clearance = float(np.squeeze(found.parameters[CLEARANCE]))
    return SharedPlan(clearance, np.hstack(gains), Motion(believed.design, believed.objective.name, phases), found)


@dataclass(frozen=True)
class AllAlike(FromTrajectory):
    """A guess in which so many legs move as one does."""

    legs: int

    def sample(self, fraction: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """States and controls of all legs at fractions of the phase."""
        x, u = super().sample(fraction)
        return np.tile(x, self.legs), np.tile(u, self.legs)


def of_leg(trajectory: PhaseTrajectory, number: int, legs: int) -> PhaseTrajectory:
    """One leg's part of a phase of so many legs."""
    nx, nu = trajectory.x_start.shape[-1] // legs, trajectory.u.shape[-1] // legs
    x, u = slice(number * nx, (number + 1) * nx), slice(number * nu, (number + 1) * nu)
    t = trajectory
    return replace(t, x_start=t.x_start[:, x], xdot=t.xdot[..., x], u=t.u[..., u])


def true_legs(
    design: Design, others: Sequence[tuple[Design, np.ndarray, np.ndarray]], start: np.ndarray
) -> list[TrueLeg]:
    """The believed leg and others, each as (problem, torque constants over the believed ones, joint angles at the start)."""
    believed = TrueLeg(0, design, np.ones(len(design.leg.joints)), start)
    return [believed, *(TrueLeg(k, *other) for k, other in enumerate(others, 1))]
