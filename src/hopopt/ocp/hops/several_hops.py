"""Several hops as one program, which end on an orbit: the state in which a periodic hop's stance begins.

Every hop is stance, flight and descent, as in a periodic one; their names are numbered. The impact leads from one hop to the
next. The first begins at rest, or on another orbit. Of all ways that lead there, the one of least effort is asked for.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from hopopt.ocp.drives import refuse_drive_states
from hopopt.ocp.free_parameters import FreeParameters
from hopopt.ocp.guesses.motion import MovingLeg
from hopopt.ocp.heat import refuse_heat
from hopopt.ocp.hops.touchdown_impact import impact_leads_to, impact_limits, landing
from hopopt.ocp.objectives.objective import cleared
from hopopt.ocp.objectives.tie_break import EFFORT, effort
from hopopt.ocp.phases import DESCENT, FLIGHT, STANCE, LegPhase, descent, flight, stance
from hopopt.ocp.problem import BoundaryConstraint, Objective, Phase, Problem
from hopopt.ocp.transitions import handed_over, lift_off, touchdown

HOP_PHASES = (STANCE, FLIGHT, DESCENT)  # of every hop


@dataclass(frozen=True)
class JointState:
    """Joint angles q (n) [rad] and speeds v (n) [rad/s]: with the foot on the ground they are the leg's whole state."""

    q: np.ndarray
    v: np.ndarray


def numbered(phase: str, hop: int) -> str:
    """The name of a phase of a hop; hops count from 1."""
    return f"{phase} {hop}"


def in_words(hops: int) -> str:
    """So many hops."""
    return f"{hops} hop{'s' if hops > 1 else ''}"


def several_hops(leg: MovingLeg, begin: JointState, end: JointState, clearances: Sequence[float]) -> Problem:
    """The program from the state in which the first stance begins to that in which a stance after the last hop would begin.

    clearances: what each hop must clear at least when its flight ends [m]; so many hops.
    """
    refuse_heat(leg, "a plan of several hops")
    refuse_drive_states(leg, "a plan of several hops")
    phases, transitions, last = list[Phase](), list[BoundaryConstraint](), len(clearances)
    for k, least in enumerate(clearances, 1):
        up, over, down = (numbered(phase, k) for phase in HOP_PHASES)
        first = stance(leg, begin.q, begin.v) if k == 1 else stance(leg)
        phases += [_named(leg, part, name) for part, name in ((first, up), (flight(leg), over), (descent(leg), down))]
        on_the_ground, _, from_above = touchdown(leg, down)
        transitions += [*lift_off(leg, up, over), handed_over(leg, over, down), on_the_ground, from_above]
        transitions += [
            *impact_limits(leg, down),
            *([cleared(leg, over, lambda e, least=least: least)] if least > 0 else []),
        ]
        transitions += (
            [impact_leads_to("orbit", leg, down, lambda e: end)]
            if k == last
            else landing(leg, down, numbered(STANCE, k + 1))
        )
    goal = Objective(EFFORT, lambda e: sum((e.integral[p.name][EFFORT] for p in phases), ca.SX(0)), unit="s")
    numbers = FreeParameters().parameters(leg.numbers)
    return Problem(leg.design.name, tuple(phases), goal, numbers, tuple(transitions), leg.design.solver.options)


def _named(leg: MovingLeg, part: LegPhase, name: str) -> Phase:
    """The phase under its number, with the effort that it takes."""
    return replace(part.with_more((), (), {EFFORT: effort(leg, part.motion)}), name=name)
