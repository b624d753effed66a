"""From one touchdown of a controlled leg to the next, and how errors grow or shrink from hop to hop (Floquet multipliers).

The state is that of the leg just before it lands: joint angles q_j, and speeds v of body and joints. The foot is on the
ground, and where along the ground it is does not matter. Control instants count from the touchdown, and encoders are
perfect: their steps would hide a derivative.
"""

from copy import deepcopy
from dataclasses import dataclass
from typing import Any

import numpy as np

from hopopt.control.closed_loop import longest, make_plant
from hopopt.design import Design
from hopopt.leg.robot import BASE
from hopopt.leg.scales import Scale, radians
from hopopt.sim.controller import Controller
from hopopt.sim.encoder import Encoder
from hopopt.sim.hop_sequence import before_landing, landings
from hopopt.sim.state import State, Timing
from hopopt.sim.trace import Trace

STATE_STEP = (
    2e-3  # [rad; m/s, rad/s on the paper's leg] of the differences, above what the control period leaves unsmooth
)
SPEED_STEP_FACTOR = 10.0  # how much larger steps of speeds are
BOUNCES = 4  # after a landing that are waited for
SETTLE = 5  # hops by which the leg comes nearer to its own orbit first


@dataclass(frozen=True)
class Multipliers:
    """Floquet multipliers of a controlled leg's hop.

    values: eigenvalues of the return map's derivative (2 n + 2), the largest first
    largest: magnitude of the largest; below 1 errors die out
    error: by how much ``largest`` changes with half the steps
    closure: largest difference of the state from that one hop later [rad, and m/s, rad/s on the paper's leg]
    """

    values: tuple[complex, ...]
    error: float
    closure: float

    @property
    def largest(self) -> float:
        return abs(self.values[0])

    def as_dict(self) -> dict[str, Any]:
        """For ``--json``."""
        pairs = [[x.real, x.imag] for x in self.values]
        return {"multipliers": pairs, "largest_multiplier": self.largest, "error": self.error, "closure": self.closure}


class Fallen(Exception):
    """The leg did not come to its next landing."""


@dataclass(frozen=True)
class ReturnMap:
    """One hop of a controlled leg, as a map of its state before a touchdown.

    design: the leg and its plant
    controller: as it is at a touchdown; each hop gets a copy, so what it remembers from before is the same in all
    """

    design: Design
    controller: Controller

    @property
    def units(self) -> np.ndarray:
        """Of the state's entries (2 n + 2): the paper's leg's are rad, m/s and rad/s."""
        n = len(self.design.leg.joints)
        return np.concatenate([np.ones(n), Scale.of(self.design.leg).states(self.design.leg)[1]])

    def __call__(self, z: np.ndarray) -> np.ndarray:
        """The state (2 n + 2) before the next touchdown; Fallen if there is none."""
        design, s, n = self.design, self.design.simulation, len(self.design.leg.joints)
        plant, period = make_plant(design), 1 / s.control_rate
        q = np.concatenate([np.zeros(BASE), z[:n]])
        q[1] = -plant.machine.foot_motion(q, np.zeros_like(q))[0][1]
        falling = State(q, z[n:], contact=False, foot=0.0, since=-1.0)
        landed, _ = plant.change(falling, lambda t, q, v: np.zeros(n))
        for bounces in range(BOUNCES):
            trace = plant.run(
                landed, deepcopy(self.controller), longest(design),
                landings=landed.landings + 1 + bounces,
                timing=Timing(period, s.torque_delay), encoder=Encoder(0, 1, period, s.speed_error, radians(self.design.leg)),
            )  # fmt: skip
            if landings(trace) or not trace.outcome.startswith("landing"):
                return state_at_landing(trace)
        raise Fallen("the leg bounces")


def state_at_landing(trace: Trace) -> np.ndarray:
    """The state (2 n + 2) before the last landing of a run; Fallen if there is none."""
    found = landings(trace)
    if not found or not trace.outcome.startswith("landing"):
        raise Fallen(trace.outcome)
    k = before_landing(trace, found[-1])
    return np.concatenate([trace.q[k, BASE:], trace.v[k]])


def multipliers(
    hop: ReturnMap, z: np.ndarray, settle: int = SETTLE, step: float = STATE_STEP, units: float | np.ndarray = 1.0
) -> Multipliers:
    """Of a return map about its fixed point near z, by central differences; Fallen if the leg does not hop there.

    units: of the state's entries (2 n + 2), of which steps and closure are multiples.
    """
    for _ in range(settle):
        z = hop(z)
    closure = float(np.abs((hop(z) - z) / units).max())
    (coarse, _), (fine, values) = (_largest(hop, z, h * np.broadcast_to(units, len(z))) for h in (2 * step, step))
    return Multipliers(values, abs(fine - coarse), closure)


def _largest(hop: ReturnMap, z: np.ndarray, step: np.ndarray) -> tuple[float, tuple[complex, ...]]:
    n = (len(z) - BASE) // 2
    steps = step * np.concatenate([np.ones(n), np.full(len(z) - n, SPEED_STEP_FACTOR)])
    columns = [(hop(z + d) - hop(z - d)) / (2 * d.sum()) for d in np.diag(steps)]
    values = sorted(np.linalg.eigvals(np.array(columns).T), key=abs, reverse=True)
    return float(abs(values[0])), tuple(complex(x) for x in values)
