"""Several legs under one controller: torques fed forward and feedback that suit all of them, as one problem.

The legs run side by side in the same phases, on one clock. Leg 0 is the believed one: its motion is the reference, and its
torque tau_0 is fed forward. Leg k, whose motors' torque constants are G_k times the believed ones, gets

    tau_k = G_k (tau_0 - K_p (q_k - q_0) - K_d (v_k - v_0)).

K_p and K_d are diagonal, constant, and chosen by the program (sampled scenarios: Calafiore and Campi, IEEE Trans. Automatic
Control 51, 2006). The objective is the clearance that every leg reaches when flight ends.
"""

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from hopopt.design import Design, as_changed
from hopopt.drivetrain.motor import state_ratings
from hopopt.drivetrain.operating_region.limits import SPEEDS, TORQUES, Entry
from hopopt.errors import UsageError
from hopopt.leg.kinematics import start_angles
from hopopt.leg.robot import BASE, build_robot
from hopopt.ocp.drives import motor_torques, refuse_drive_states
from hopopt.ocp.guesses.motion import FLIGHT, STANCE
from hopopt.ocp.heat import refuse_heat
from hopopt.ocp.hop import Hop
from hopopt.ocp.objectives.objective import height, lowest_point
from hopopt.ocp.objectives.tie_break import EFFORT, effort
from hopopt.ocp.phases import flight, stance
from hopopt.ocp.problem import BoundaryConstraint, Ends, Instant, Objective, Parameter, PathConstraint, Phase, Problem
from hopopt.ocp.transitions import lift_off

CLEARANCE, STIFFNESS, DAMPING = "clearance", "k_p", "k_d"  # the program's parameters
# Feedback of sampled motors: joint stiffness and damping over what stops the joint's inertia within a period
STIFFEST, MOST_DAMPED = 0.05**2, 0.4
# Powers of the torque constant with which the entries of a drive go. Currents stay, but for that of a friction that stays
GOES_WITH: dict[Entry, int] = {
    **dict.fromkeys(TORQUES, 1),
    **dict.fromkeys(SPEEDS, -1),
    ("motor", "torque_constant"): 1,
    ("motor", "current_cap"): 0,
    ("motor", "no_load_current"): -1,
}


@dataclass(frozen=True)
class OfLeg:
    """A constraint of one of the legs: the leg's number, and what it is called there."""

    leg: int
    of: Hashable

    def __str__(self) -> str:
        return f"{self.of}, leg {self.leg}"


class TrueLeg:
    """One of the legs.

    hop: its problem, with the limits that its true drives have.
    gain: torque constants over the believed ones (n).
    phases, transitions: its hop from rest at the joint angles ``start`` (n) [rad].
    """

    def __init__(self, number: int, design: Design, gain: np.ndarray, start: np.ndarray):
        self.number, self.gain = number, np.asarray(gain, dtype=float)
        self.hop = Hop(with_torque_constants(design, self.gain))
        refuse_heat(self.hop, "a plan that several legs share")
        refuse_drive_states(self.hop, "a plan that several legs share")
        self.phases = {
            STANCE: stance(self.hop, np.asarray(start, dtype=float), np.zeros(self.hop.n)),
            FLIGHT: flight(self.hop),
        }
        self.transitions = lift_off(self.hop, STANCE, FLIGHT)
        self.numbers = {name: float(value) for name, value in self.hop.numbers.items()}

    def name(self, variable: str) -> str:
        """What one of its variables is called in the program."""
        return f"{variable}_{self.number}"

    def at(self, s: Instant) -> Instant:
        """Its own instant within that of all legs."""

        def own() -> Instant:
            group = [v.name for p in self.phases.values() for v in (*p.phase.states, *p.phase.controls)]
            found = {name: getattr(s, self.name(name)) for name in group if hasattr(s, self.name(name))}
            return Instant(t=s.t, p={**s.p, **self.numbers}, **found)

        return s.once(self.name("leg"), own)

    def ends(self, e: Ends) -> Ends:
        """Its own ends of phases."""
        initial, final = ({name: self.at(s) for name, s in side.items()} for side in (e.initial, e.final))
        return Ends(initial, final, e.duration, e.integral, {**e.p, **self.numbers})

    def of_path(self, c: PathConstraint) -> PathConstraint:
        """A limit of its own within the program."""
        return replace(c, name=OfLeg(self.number, c.name), value=lambda s: c.value(self.at(s)))

    def of_boundary(self, c: BoundaryConstraint) -> BoundaryConstraint:
        """A transition or an end of its own within the program."""
        return replace(c, name=OfLeg(self.number, c.name), value=lambda e: c.value(self.ends(e)))

    def command(self, phase: str, s: Instant) -> ca.SX:
        """The torque that its controller asks for (n) [N m]."""
        return motor_torques(self.hop, self.phases[phase].motion)(self.at(s)) / self.gain


def with_torque_constants(design: Design, gain: np.ndarray) -> Design:
    """The problem with drives whose torque constants are so many times the believed ones: as much more torque for the same
    commands, as much less speed, and less heat for the same torque. Raises UsageError if that is more than a problem may have."""
    data = design.model_dump(exclude_none=True)
    state_ratings(design.leg, data["leg"])
    for joint, factor in zip(design.leg.joints, gain.tolist(), strict=True):
        for (part, key), power in GOES_WITH.items() if factor != 1 else ():
            own, (path, value) = data["leg"][joint].setdefault(part, {}), design.leg.drive(joint, part, key)
            name = path.rpartition(".")[2]  # of a linear motor another
            if (value := own.get(name, value)) is not None:
                own[name] = value * factor**power
    return as_changed(data, "[uncertainty] leads to", "give less of it")


def highest_gains(design: Design) -> tuple[np.ndarray, np.ndarray]:
    """K_p (n) [N m/rad] and K_d (n) [N m s/rad] that sampled feedback can have, from what each joint shows of inertia at the
    start while the others are free."""
    period = 1 / design.simulation.control_rate
    robot, start = build_robot(design.leg), start_angles(design)
    M = robot.mass_matrix(np.concatenate([np.zeros(BASE), start]))
    inertia = 1 / np.diag(np.linalg.inv(M))[BASE:]  # of each joint while all others are free
    return STIFFEST * inertia / period**2, MOST_DAMPED * inertia / period


def under_one_controller(legs: Sequence[TrueLeg]) -> Problem:
    """The problem of all legs together, the believed one first. Raises UsageError for a hop with more phases than two."""
    believed = legs[0]
    if believed.hop.design.hop.lands:
        raise UsageError(f"{believed.hop.design.name}: a shared controller is planned for a hop from rest to its apex")
    k_p, k_d = highest_gains(believed.hop.design)
    parameters = (
        height(believed.hop, CLEARANCE),
        Parameter(STIFFNESS, len(k_p), 0.0, k_p, k_p, "N m/rad", free=True),
        Parameter(DAMPING, len(k_d), 0.0, k_d, k_d, "N m s/rad", free=True),
    )
    boundary = [leg.of_boundary(c) for leg in legs for c in (*leg.transitions, *lowest_point(leg.hop, CLEARANCE))]
    weight = believed.hop.tie_break

    def reached(e: Ends) -> ca.SX:
        return e.p[CLEARANCE] - weight * sum(integrals[EFFORT] for integrals in e.integral.values())

    objective = Objective(CLEARANCE, reached, True, "m", believed.hop.objective.scale(believed.hop))
    phases = tuple(_side_by_side(legs, name) for name in believed.phases)
    name, options = f"{believed.hop.design.name}-shared", believed.hop.design.solver.options
    return Problem(name, phases, objective, parameters, tuple(boundary), options)


def _side_by_side(legs: Sequence[TrueLeg], name: str) -> Phase:
    """A phase of all legs on one clock."""
    believed, first = legs[0], legs[0].phases[name]
    of_believed = effort(believed.hop, first.motion)
    path = [leg.of_path(c) for leg in legs for c in leg.phases[name].phase.path]

    def rates(s: Instant) -> Mapping[str, ca.SX]:
        own = ((leg, leg.phases[name].phase.dynamics(leg.at(s))) for leg in legs)
        return {leg.name(state): rate for leg, found in own for state, rate in found.items()}

    return Phase(
        name,
        tuple(replace(v, name=leg.name(v.name)) for leg in legs for v in leg.phases[name].phase.states),
        tuple(replace(v, name=leg.name(v.name)) for leg in legs for v in leg.phases[name].phase.controls),
        rates,
        first.phase.duration,
        (*path, *(_law(believed, leg, name) for leg in legs[1:])),
        {EFFORT: lambda s: of_believed(believed.at(s))},
        first.phase.long,
    )


def _law(believed: TrueLeg, leg: TrueLeg, phase: str) -> PathConstraint:
    """The leg's command is the believed leg's, and feedback on what they differ by; the controls meet it at the nodes."""

    def miss(s: Instant) -> ca.SX:
        reference, own = believed.at(s), leg.at(s)
        feedback = s.p[STIFFNESS] * (own.q - reference.q) + s.p[DAMPING] * (own.v - reference.v)
        return leg.command(phase, s) - believed.command(phase, s) + feedback

    name, scale = OfLeg(leg.number, "control law"), believed.hop.weight * believed.hop.reach
    return PathConstraint(name, miss, 0.0, 0.0, scale, "N m", leg.hop.leg.joints, smooth=False)
