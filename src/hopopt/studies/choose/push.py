"""What the drives do in a hop of the first mesh: energy and power of the push, and what is exhausted in it longest."""

from dataclasses import dataclass

import numpy as np

from hopopt.drivetrain.operating_region.limits import Line
from hopopt.drivetrain.operating_region.region import operating_region
from hopopt.drivetrain.supply import power_limits
from hopopt.leg.derived import velocity_limit
from hopopt.leg.robot import build_robot
from hopopt.nlp.deadline import NEVER
from hopopt.ocp.hop import Hop
from hopopt.ocp.phases import STANCE
from hopopt.planner.motion import Motion
from hopopt.studies.maps.warm import WARM, MapPoint
from hopopt.studies.sweep.definition import Definition
from hopopt.studies.sweep.first_program import first_program
from hopopt.verify.hops.heat import heat_checks

EXHAUSTED = 0.97  # share of a limit from which on it counts as reached
PLACES = np.array([0.0, 0.25, 0.5, 0.75, 1.0])  # in every interval


@dataclass(frozen=True)
class Push:
    """energy: positive work of the drives in stance [J]; peak_power: the most of all drives together [W]; exhausted: "torque",
    "speed" or "supply", whichever is at its limit for the longest, empty if none is; too_hot: whether a winding gets hotter in
    the hop than its limit, where that counts only once it is verified."""

    energy: float
    peak_power: float
    exhausted: str
    too_hot: bool


def push(definition: Definition, point: MapPoint, x: np.ndarray) -> Push:
    """The push of a point's hop, of its variables x [SI] on the first mesh."""
    hop = Hop(definition.design_at(point.index), definition.objective)
    t = first_program(definition, hop, point.values, NEVER, WARM)[0]
    plan = Motion(hop.design, definition.objective, t.unpack(x / t.scale, t.parameter_values())[0])
    s = plan.everywhere(STANCE, PLACES)
    torques, sprung = np.array(hop.robot.drive_torques(s.q, s.tau)), list(hop.drive_states.sprung)
    torques[:, sprung] = s.command[:, sprung]  # a series spring's torque is not its motor's
    power = torques * s.w
    at = s.t
    energy = float(np.trapezoid(np.maximum(power, 0.0).sum(axis=1), at))
    exhausted = _exhausted(hop, s.command, s.w, power.sum(axis=1))
    return Push(energy, float(power.sum(axis=1).max()), exhausted, _too_hot(definition, point.index, plan))


def _too_hot(definition: Definition, k: int, plan: Motion) -> bool:
    if not (definition.full and definition.full[k]):
        return False
    design = definition.full_design_at(k)
    return any(c.residual > 0 for c in heat_checks(design, build_robot(design.leg), plan.tables))


def _exhausted(hop: Hop, tau: np.ndarray, w: np.ndarray, power: np.ndarray) -> str:
    found = {"torque": 0.0, "speed": 0.0, "supply": 0.0}
    for j, joint in enumerate(hop.robot.joints):
        region = operating_region(hop.leg, joint, hop.robot.parameters)
        used, fast = np.array(region.use(w[:, j], tau[:, j])), velocity_limit(region) / 2
        line = [region.planes[k].line for k in used.argmax(axis=0)]
        for k in np.flatnonzero(used.max(axis=0) > EXHAUSTED):
            quick = line[k] == Line.SPEED_CAP or (line[k] == Line.TORQUE_SPEED and abs(w[k, j]) > fast)
            found["speed" if quick else "torque"] += 1
    limits = power_limits(hop.leg, hop.robot.parameters).values()
    if limits:
        found["supply"] = len(hop.robot.joints) * float(np.sum(power > EXHAUSTED * min(map(float, limits))))
    worst = max(found, key=lambda name: found[name])
    return worst if found[worst] else ""
