"""Following a planned hop within its limits: a quadratic program over a receding horizon in place of the regulator's gains.

At each control instant the torque that is added to the plan's minimises what the linear-quadratic regulator of ``track``
minimises, over the next blocks of control periods, with the regulator's own cost of all that follows (Rawlings, Mayne and
Diehl, Model Predictive Control, 2.5). Predicted torques and speeds stay in the operating regions, which are half-planes in
both, and the contact force pushes, within its friction. Where not all can be kept, the excess costs, so there always is an
answer. With no limit in reach and blocks of one period the answer is the regulator's.
"""

from dataclasses import dataclass, replace
from functools import cache, cached_property

import casadi as ca
import numpy as np

from hopopt.control.reference import PhaseReference
from hopopt.control.setting import Setting
from hopopt.control.tracking.linearisation import Linearisation
from hopopt.control.tracking.regulator import Gains
from hopopt.control.tracking.track import Track, TrackingOptions
from hopopt.drivetrain.operating_region.half_planes import OperatingRegion
from hopopt.errors import UsageError
from hopopt.leg.scales import weight
from hopopt.sim.machine import Machine

PENALTY = (1e4, 1e3)  # linear and quadratic cost of an excess, in shares of a limit: beyond the cost of any limit
MOST_BLOCKS, LONGEST_BLOCK = 100, 10_000  # memory of a program grows with the square of the blocks, time with both
SOLVER = "daqp"  # CasADi's interface to it; an active-set method, exact and quick for programs this small


@dataclass(frozen=True)
class HorizonOptions(TrackingOptions):
    """As of ``track`` with feedback lqr; blocks: in the horizon; block: control periods for which each holds its torque;
    hold: control periods from one program to the next, at most a block."""

    blocks: int = 8
    block: int = 8
    hold: int = 4


@dataclass(frozen=True)
class Limits:
    """Rows G u + E x <= w of one control instant, for added torque u (n) [N m] and error x (2 n) of the joints."""

    G: np.ndarray
    E: np.ndarray
    w: np.ndarray


@dataclass(frozen=True)
class HorizonProgram:
    """One control instant's program, condensed to the added torques U (blocks n) and one excess s: minimise
    (U' H U)/2 + (F x)' U + cost of s, subject to G U + E x - s <= w."""

    H: np.ndarray
    F: np.ndarray
    G: np.ndarray
    E: np.ndarray
    w: np.ndarray


@dataclass(frozen=True)
class PlanLimits:
    """The limits along one planned phase.

    reference: the phase. period: of control [s]. regions: of the drives. machine: the believed leg. contact: whether its foot
    is on the ground. friction: of the ground, None where it grips without limit.
    """

    reference: PhaseReference
    period: float
    regions: list[OperatingRegion]
    machine: Machine
    contact: bool
    friction: float | None

    def rows(self, k: int, periods: int) -> Limits:
        """In control period k, for a torque that is held over so many."""
        t = min(k * self.period, self.reference.duration)
        q, v, _ = self.reference.at(t)
        tau = self.reference.mean_torque(t, t + periods * self.period)
        G, E, w = self._of_drives(q, v, tau)
        if self.contact:
            force = self._of_contact(q, v, tau)
            G, E, w = (np.concatenate(pair) for pair in zip((G, E, w), force, strict=True))
        return Limits(G, E, w)

    def _of_drives(self, q: np.ndarray, v: np.ndarray, tau: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """a (tau + u) + b (v + dv) <= 1 for each half-plane of each drive (the paper's eq. 13), of its own torque and speed."""
        n, turning = len(v), self.machine.turning
        J = np.eye(n) if turning is None else turning.jacobian(q)
        T, G, E, w = np.linalg.inv(J).T, [], [], []
        tau, v = T @ tau, J @ v
        for j, region in enumerate(self.regions):
            for plane in region.planes:
                G.append(float(plane.a) * T[j])
                E.append(np.concatenate([np.zeros(n), float(plane.b) * J[j]]))
                w.append(1 - float(plane.a) * tau[j] - float(plane.b) * v[j])
        return np.array(G), np.array(E), np.array(w)

    @cached_property
    def _leg(self) -> Linearisation:
        return Linearisation(self.machine)

    def _of_contact(self, q: np.ndarray, v: np.ndarray, tau: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The ground pushes, within its friction cone; the force is linear in the torque, and linearised in the joints."""
        n, heavy, leg, z = len(q), weight(self.machine.model), self._leg, np.concatenate([q, v, tau])[None]
        force, slopes = leg.answers(z, True)[0, n:], leg.slopes(z, True)[0, n:]
        ways = np.array([[0.0, -1.0]])
        if self.friction is not None:
            ways = np.vstack([ways, [[1.0, -self.friction], [-1.0, -self.friction]]])
        ways = ways / heavy
        return ways @ slopes[:, 2 * n :], ways @ slopes[:, : 2 * n], -ways @ force


@dataclass(frozen=True)
class Block:
    """Control periods over which the added torque u is held: the error goes to A x + B u at the cost of x' Q x + 2 x' S u + u' R u."""

    A: np.ndarray
    B: np.ndarray
    Q: np.ndarray
    S: np.ndarray
    R: np.ndarray
    limits: Limits


class Horizon:
    """The programs along one planned phase, each made when it is first asked for.

    gains: of the regulator. limits: along the phase. options: of the tracker.
    """

    def __init__(self, gains: Gains, limits: PlanLimits, options: HorizonOptions):
        self.gains, self.limits, self.options = gains, limits, options
        self.program, self._block = cache(self._condensed), cache(self._over_periods)

    def __deepcopy__(self, memo: object) -> "Horizon":
        """Itself: its programs are the same in every hop."""
        return self

    def _over_periods(self, first: int) -> Block:
        """The block that begins with a control period."""
        n, cost = self.gains.B.shape[-1], self.gains.Q
        A, B = np.eye(2 * n), np.zeros((2 * n, n))
        Q, S, R = np.zeros((2 * n, 2 * n)), np.zeros((2 * n, n)), np.zeros((n, n))
        for period in range(first, first + self.options.block):
            Q, S, R = Q + A.T @ cost @ A, S + A.T @ cost @ B, R + B.T @ cost @ B + self.gains.R
            move, push = self.gains.at(period)[:2]
            A, B = move @ A, move @ B + push
        return Block(A, B, Q, S, R, self.limits.rows(first, self.options.block))

    def _condensed(self, k: int) -> HorizonProgram:
        """Control period k's program, the errors of all blocks eliminated: x = Phi x_0 + Gamma U."""
        o, n = self.options, self.gains.B.shape[-1]
        size = o.blocks * n
        Phi, Gamma = np.eye(2 * n), np.zeros((2 * n, size))
        H, F, rows = np.zeros((size, size)), np.zeros((size, 2 * n)), list[tuple[np.ndarray, ...]]()
        for j in range(o.blocks):
            b, own = self._block(k + j * o.block), slice(j * n, (j + 1) * n)
            G = b.limits.E @ Gamma
            G[:, own] += b.limits.G
            rows.append((G, b.limits.E @ Phi, b.limits.w))
            H, F = H + Gamma.T @ b.Q @ Gamma, F + Gamma.T @ b.Q @ Phi
            across = Gamma.T @ b.S
            H[:, own] += across
            H[own] += across.T
            H[own, own] += b.R
            F[own] += b.S.T @ Phi
            Phi, Gamma = b.A @ Phi, b.A @ Gamma
            Gamma[:, own] += b.B
        P = self.gains.cost_to_go(k + o.blocks * o.block)
        H, F = H + Gamma.T @ P @ Gamma, F + Gamma.T @ P @ Phi
        G, E, w = (np.concatenate(parts) for parts in zip(*rows, strict=True))
        return HorizonProgram(0.5 * (H + H.T), F, G, E, w)


class TrackWithinLimits(Track):
    """The strategy ``track_mpc``: as ``track``, its feedback from a constrained program over a receding horizon."""

    options_of = HorizonOptions
    options: HorizonOptions

    def __init__(self, setting: Setting):
        super().__init__(setting)
        o = self.options
        whole = (o.blocks, o.block, o.hold)
        if o.blocks > MOST_BLOCKS or o.block > LONGEST_BLOCK:
            raise UsageError(
                f"blocks is at most {MOST_BLOCKS}, block at most {LONGEST_BLOCK}: each program is solved at once"
            )
        if o.feedback != "lqr" or any(x != int(x) or x < 1 for x in whole) or o.hold > o.block:
            raise UsageError("feedback stays lqr; blocks, block and hold are whole numbers from 1, hold at most block")
        self.options = o = replace(o, blocks=int(o.blocks), block=int(o.block), hold=int(o.hold))
        self.last: tuple[bool, int, np.ndarray] | None = (
            None  # phase and control period of the last program, its torque
        )
        machine, regions, friction = setting.machine(), setting.regions(), setting.design.contact.friction
        self.horizons = {
            contact: Horizon(
                gains, PlanLimits(self.reference(contact), self.period, regions, machine, contact, friction), o
            )
            for contact, gains in self.gains.items()
        }

    def added(self, contact: bool, k: int, error: np.ndarray) -> np.ndarray:
        """The first block of the program's answer, held; the regulator's torque where the solver has none."""
        if self.last is not None and self.last[0] == contact and 0 <= k - self.last[1] < self.options.hold:
            return self.last[2]
        found = solved(self.horizons[contact].program(k), error)
        torque = super().added(contact, k, error) if found is None else found[: len(error) // 2]
        self.last = contact, k, torque
        return torque


def solved(p: HorizonProgram, error: np.ndarray) -> np.ndarray | None:
    """The added torques (blocks n) [N m] that solve a program from an error (2 n); None if the solver fails."""
    size, rows = len(p.H), len(p.w)
    slack = -np.ones((rows, 1))
    H = np.zeros((size + 1, size + 1))
    H[:size, :size], H[size, size] = p.H, PENALTY[1]
    solver = quadratic_solver(size + 1, rows)
    try:
        answer = solver(
            h=H, g=np.append(p.F @ error, PENALTY[0]), a=np.hstack([p.G, slack]), uba=p.w - p.E @ error,
            lba=-np.inf, lbx=np.append(np.full(size, -np.inf), 0.0), ubx=np.inf,
        )  # fmt: skip
    except RuntimeError:
        return None
    return np.array(answer["x"]).ravel()[:size]


@cache
def quadratic_solver(variables: int, rows: int) -> ca.Function:
    """For dense programs of that size."""
    dense = {"h": ca.Sparsity.dense(variables, variables), "a": ca.Sparsity.dense(rows, variables)}
    return ca.conic("horizon", SOLVER, dense)
