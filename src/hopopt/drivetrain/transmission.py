"""How the joints of a leg turn its drives: belts, rods, cranks, ratios that change with the angle.

A drive turns by theta(q) behind its gear: by a law of its own joint's angle, and by other joints' angles in constant
proportion. With J = d theta / d q, speed w, torque tau_d of the drives and reflected inertia A of what spins in front of
their gears,

    w = J v,    tau = J' tau_d,    s' = S a + (dJ/dt) v,    and the leg bears S' A s' besides its own M a + h.

Where every drive turns as its joint does, J is the unit matrix. S = J + D, where D v is how fast the motors' housings turn about
their axes, over their gears' ratios: by that a rotor's own speed s differs from w, which is against its housing and has the torque.
D is 0 where motors sit on the body, which does not turn. A rotor's sense is that of its drive, unless it is reversed. A law is a function of the angle, its entry of ``LAWS``; what
derives from it is found by CasADi. Laws of linkages: plane geometry by the law of cosines, as in Norton, Design of Machinery.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np

from hopopt.design import Leg
from hopopt.design.drives.transmission import Transmission
from hopopt.drivetrain.linkages.five_bar import forward, in_plane, side_links

Law = Callable[[Transmission, Callable[[str], Any], Any], Any]  # of a joint's table, its parameters, its angle [rad]


def linear(table: Transmission, entry: Callable[[str], Any], q: Any) -> Any:
    """The ratio is 1 + slope (q - at) times that of the gear."""
    away = q - entry("at")
    return away + entry("slope") * away**2 / 2


def rod(table: Transmission, entry: Callable[[str], Any], q: Any) -> Any:
    """The length of a rod between two pivots, base and arm from the joint, over its travel by radian."""
    base, arm = entry("base"), entry("arm")
    return ca.sqrt(base**2 + arm**2 - 2 * base * arm * ca.cos(q - entry("folded"))) / entry("travel")


def four_bar(table: Transmission, entry: Callable[[str], Any], q: Any) -> Any:
    """Angle of the crank whose rod ends at (ground + arm cos phi, arm sin phi) from its pivot, phi from the stretched angle."""
    assert table.four_bar is not None
    ground, crank, length, arm = (entry(name) for name in ("ground", "crank", "rod", "arm"))
    phi = q - entry("stretched")
    x, z = ground + arm * ca.cos(phi), arm * ca.sin(phi)
    share = (crank**2 + x**2 + z**2 - length**2) / (2 * crank * ca.sqrt(x**2 + z**2))
    return ca.atan2(z, x) + (1 if table.four_bar.ahead else -1) * ca.acos(share)


def table(table: Transmission, entry: Callable[[str], Any], q: Any) -> Any:
    """The integral of a monotone cubic spline through the ratios, which is level before and behind its points and has no corner."""
    assert table.table is not None
    knots = table.table.angle
    values = [ca.SX(entry(f"ratio[{k}]")) for k in range(len(knots))]
    widths, slopes = np.diff(knots), spline_slopes(knots, values)
    theta, turned = values[0] * (q - knots[0]), 0.0  # up to the first point; the drive's angle at a piece's beginning
    for k, h in enumerate(widths.tolist()):
        (y, m), (y_end, m_end), s = (values[k], slopes[k]), (values[k + 1], slopes[k + 1]), q - knots[k]
        rise = (y_end - y) / h
        bend, twist = (3 * rise - 2 * m - m_end) / h, (m + m_end - 2 * rise) / h**2

        def part(s: Any, y: Any = y, m: Any = m, bend: Any = bend, twist: Any = twist) -> Any:
            return s * (y + s * (m / 2 + s * (bend / 3 + s * twist / 4)))

        theta = ca.if_else(q >= knots[k], turned + part(s), theta)
        turned += part(h)
    return ca.if_else(q >= knots[-1], turned + values[-1] * (q - knots[-1]), theta)


def spline_slopes(knots: Sequence[float], values: Sequence[Any]) -> list[Any]:
    """Slopes at its points of a cubic spline that rises and falls only as its points do, 0 at both ends, so that a ratio that is
    level beyond them has no corner; values: symbols or constants among them (Fritsch and Butland, SIAM J. Sci. Stat. Comput. 5, 1984).
    Where three points are level its derivatives by them are those of straight tables, so that an optimum can be level."""
    h = np.diff(knots).tolist()
    rises = [(b - a) / width for (a, b), width in zip(pairwise(values), h, strict=True)]
    inner = []
    for (before, behind), (d, e) in zip(pairwise(h), pairwise(rises), strict=True):
        near, far = before + 2 * behind, 2 * before + behind
        # 0 of three level points, to which the harmonic mean of nearly equal rises comes with this slope
        level = ca.if_else(ca.fabs(d) + ca.fabs(e) > 0, 0.0, (near * d + far * e) / (near + far))
        inner.append(ca.if_else(d * e > 0, (near + far) * d * e / (near * e + far * d), level))
    return [0.0, *inner, 0.0]


SAMPLES = 201  # of a joint's range, where ratios are looked at
GRID = 61  # of each of two ranges, where those of a five-bar are
LAWS: dict[str, Law] = {"linear": linear, "rod": rod, "four_bar": four_bar, "table": table}
# Of a joint's range where compiled plants have a ratio and its slope: a cubic between two is off by 1e-9, by 1e-6 where the
# curve of a table's ratio jumps.
PLACES = 513


def drive_angle(leg: Leg, joint: str, p: Mapping[str, Any], q: Any) -> Any:
    """How far the drive of a joint turns [rad] by the angle q [rad] of this joint alone."""
    between = leg.joint[joint].transmission
    if between is None or between.law is None:
        return q
    path = f"leg.{joint}.transmission.{between.law}"
    return LAWS[between.law](between, lambda name: p[f"{path}.{name}"], q)


def couplings(leg: Leg, p: Mapping[str, Any]) -> Iterator[tuple[int, int, Any]]:
    """(drive, joint, ratio), by their places in the leg, of every other joint that turns a drive."""
    for k, joint in enumerate(leg.joints):
        between = leg.joint[joint].transmission
        for other in (between and between.coupling) or ():
            yield k, leg.joints.index(other), p[f"leg.{joint}.transmission.coupling.{other}.ratio"]


def housings(leg: Leg, p: Mapping[str, Any]) -> Iterator[tuple[int, int, Any]]:
    """(drive, joint, ratio), by their places in the leg, of every joint that turns the housing of a drive's motor about its axis, over
    the gear's ratio: the entries of D; below zero where the housing turns against the rotor."""
    for k, joint in enumerate(leg.joints):
        between = leg.joint[joint].transmission
        if between is None or between.motor_on is None or joint not in leg.riding:
            continue
        own = next(at for at in leg.link_joints if at.coordinate == k and not at.follows)
        gear = p[leg.drive(joint, "gear", "ratio")[0]] * (-1 if between.reversed else 1)
        for at in leg.link_joints[: leg.links.index(between.motor_on) + 1]:
            yield k, at.coordinate, float(np.dot(at.axis, own.axis)) * at.ratio / gear


def drive_angles(leg: Leg, p: Mapping[str, Any], q: ca.SX) -> ca.SX:
    """theta (n) [rad] of the drives behind their gears at joint angles q (n), from parameter values or symbols by their paths."""
    found = [drive_angle(leg, joint, p, q[k]) for k, joint in enumerate(leg.joints)]
    for joint in leg.five_bars:  # as its joint counts, from where the crank lies along the link behind it
        k = leg.joints.index(joint)
        found[k] = forward(leg, k) * (side_links(leg, joint, p, q).angle - in_plane(leg, k)[1])
    for k, other, ratio in couplings(leg, p):
        found[k] += ratio * q[other]
    return ca.vertcat(*found)


def ratios(leg: Leg, joint: str, p: Mapping[str, Any], angles: np.ndarray) -> np.ndarray:
    """How fast the drive of a joint turns with it at angles (k,) [rad], over its gear's ratio; NaN where a linkage cannot close."""
    return _ratios_and_slopes(leg, joint, p, angles)[0]


def in_range(leg: Leg, joint: str, count: int = SAMPLES, beyond: float = 0.0) -> np.ndarray:
    """So many angles [rad] of a joint's range, and ``beyond`` it [rad], evenly."""
    return np.linspace(leg.joint[joint].lower - beyond, leg.joint[joint].upper + beyond, count)


def largest_ratios(leg: Leg, p: Mapping[str, Any]) -> np.ndarray:
    """Magnitude of each joint's own ratio over its gear's where it is largest in the joint's range, (n,)."""
    if leg.direct:
        return np.ones(len(leg.joints))
    own = {joint: five_bar_ratios(leg, joint, p)[1][:, 1] for joint in leg.five_bars}
    found = (own[joint] if joint in own else ratios(leg, joint, p, in_range(leg, joint)) for joint in leg.joints)
    return np.array([np.abs(each).max() for each in found])


def five_bar_ratios(leg: Leg, joint: str, p: Mapping[str, Any], beyond: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Of poses of the joint before and the joint itself (m, 2) [rad] throughout their ranges and ``beyond``: these, and how fast
    the drive of a five-bar turns with either, over its gear's ratio (m, 2); NaN where the chain cannot close."""
    k = leg.joints.index(joint)
    axes = (in_range(leg, name, GRID, beyond) for name in leg.joints[k - 1 : k + 1])
    poses = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    q = ca.SX.sym("q", len(leg.joints))
    turns = ca.jacobian(forward(leg, k) * side_links(leg, joint, p, q).angle, q[k - 1 : k + 1])
    whole = np.zeros((len(leg.joints), len(poses)))
    whole[k - 1 : k + 1] = poses.T
    return poses, ca.Function("turns", [q], [ca.densify(turns)]).map(len(poses))(whole).full().reshape(-1, 2)


def numbers(leg: Leg, p: Mapping[str, float]) -> dict[str, Any]:
    """What compiled plants read of a leg's transmissions: ``turned``, whether there are any; ``coupling`` (n, n), how far drives
    turn with other joints; ``turn_from`` [rad] and ``turn_step`` (n) [rad], first and distance of the places at which ``turn_ratio`` and
    ``turn_slope`` [1/rad] (n, PLACES) are the ratio of a joint's own law and its derivative."""
    n = len(leg.joints)
    coupling, ratio, slope = np.zeros((n, n)), np.ones((n, PLACES)), np.zeros((n, PLACES))
    start, step = np.zeros(n), np.ones(n)
    for k, other, turns in couplings(leg, p):
        coupling[k, other] = turns
    for k, joint in enumerate(leg.joints if not leg.direct else ()):
        places = in_range(leg, joint, PLACES)
        ratio[k], slope[k] = _ratios_and_slopes(leg, joint, p, places)
        start[k], step[k] = places[0], places[1] - places[0]
    return {
        "turned": int(not leg.direct), "coupling": coupling, "turn_from": start, "turn_step": step,
        "turn_ratio": ratio, "turn_slope": slope,
    }  # fmt: skip


def cubics(leg: Leg, joint: str, p: Mapping[str, float]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Angles [rad], ratios and slopes [1/rad] (k,) between which a cubic is the ratio of a joint's own law, exactly where it is one
    itself, else within 1e-9; it goes straight on beyond them."""
    between = leg.joint[joint].transmission
    if between is None or between.law is None or between.linear is not None:
        angles = in_range(leg, joint, 2)
    else:
        angles = np.array(between.table.angle) if between.table is not None else in_range(leg, joint, PLACES)
    return angles, *_ratios_and_slopes(leg, joint, p, angles)


def _ratios_and_slopes(leg: Leg, joint: str, p: Mapping[str, Any], angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of a joint's own law at angles (k,) [rad]: its ratios and their derivatives [1/rad], (k,) each."""
    q = ca.SX.sym("q")
    own = ca.gradient(drive_angle(leg, joint, p, q), q)
    found = ca.Function("own", [q], [ca.densify(own), ca.densify(ca.gradient(own, q))])(angles.reshape(1, -1))
    ratio, slope = (each.full()[0] for each in found)
    return ratio, slope


@dataclass(frozen=True)
class Turned:
    """The drives at one instant: speeds w (n) [rad/s] behind their gears; rate (n) [rad/s^2] at which what spins in front of them speeds
    up, over their ratios; jacobian, spin: J and S (n, n)."""

    w: ca.SX
    rate: ca.SX
    jacobian: ca.SX
    spin: ca.SX


def turned(leg: Leg, p: Mapping[str, Any], q: ca.SX, v: ca.SX, a: ca.SX) -> Turned:
    """The drives of joint angles q, which are symbols, speeds v and accelerations a (n) [rad, rad/s, rad/s^2]."""
    jacobian = ca.jacobian(drive_angles(leg, p, q), q)
    w, spin = jacobian @ v, ca.SX(jacobian)
    for k, joint, ratio in housings(leg, p):
        spin[k, joint] += ratio
    return Turned(w, spin @ a + ca.jtimes(w, q, v), jacobian, spin)


class Turning:
    """The same in numbers.

    rotors: reflected inertias of what spins in front of the gears (n) [kg m^2]
    """

    def __init__(self, leg: Leg, p: Mapping[str, float], rotors: np.ndarray):
        self.leg, self.p, self.rotors = leg, p, rotors

    def __reduce__(self) -> tuple[Any, ...]:
        return Turning, (self.leg, self.p, self.rotors)

    @cached_property
    def _at(self) -> ca.Function:
        n = len(self.leg.joints)
        q, v = ca.SX.sym("q", n), ca.SX.sym("v", n)
        found = turned(self.leg, self.p, q, v, ca.SX.zeros(n))
        return ca.Function("turning", [q, v], [ca.densify(found.jacobian), found.rate])

    @cached_property
    def housings(self) -> np.ndarray:
        """D (n, n): how fast housings turn about their motors' axes, over their gears' ratios, by the joints' speeds."""
        found = np.zeros((len(self.leg.joints),) * 2)
        for k, joint, ratio in housings(self.leg, self.p):
            found[k, joint] += ratio
        return found

    def spin(self, q: np.ndarray) -> np.ndarray:
        """S (n, n): speeds of what spins in front of the gears, over their ratios, by those of the joints, at angles q (n)."""
        return self.jacobian(q) + self.housings

    def jacobian(self, q: np.ndarray) -> np.ndarray:
        """d theta / d q (n, n) at joint angles q (n)."""
        return self._at(q, 0.0)[0].full()

    def drift(self, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """(dJ/dt) v (n) [rad/s^2]: how the drives speed up where no joint does."""
        return self._at(q, v)[1].full()[:, 0]

    def speeds(self, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Speeds of the drives behind their gears at q, v (..., n) [rad, rad/s]."""
        return np.einsum("...ij,...j->...i", self._jacobians(q), v)

    def spins(self, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Speeds of what spins in front of the gears, over their ratios, at q, v (..., n) [rad, rad/s]."""
        return np.einsum("...ij,...j->...i", self._jacobians(q) + self.housings, v)

    def drive_torques(self, q: np.ndarray, tau: np.ndarray) -> np.ndarray:
        """Torques of the drives (..., n) [N m] that come to tau (..., n) at the joints."""
        return np.linalg.solve(np.swapaxes(self._jacobians(q), -1, -2), tau[..., None])[..., 0]

    def joint_torques(self, q: np.ndarray, tau: np.ndarray) -> np.ndarray:
        """Torques at the joints (..., n) [N m] of torques tau (..., n) of the drives: the inverse of ``drive_torques``."""
        return np.einsum("...ji,...j->...i", self._jacobians(q), tau)

    def rates(self, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        """s' (..., n) [rad/s^2] of what spins in front of the gears, over their ratios, at q, v, a (..., n) of the joints."""
        n, rows = q.shape[-1], q.reshape(-1, q.shape[-1])
        late = self._at.map(len(rows))(rows.T, v.reshape(-1, n).T)[1].full().T.reshape(q.shape)
        return self.spins(q, a) + late

    def inertia(self, q: np.ndarray) -> np.ndarray:
        """S' A S (n, n) [kg m^2]: what the rotors add to the joints' mass matrix."""
        S = self.spin(q)
        return S.T @ (self.rotors[:, None] * S)

    def force(self, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        """S' A s' (n) [N m]: what the rotors ask of the joints."""
        S = self.spin(q)
        return S.T @ (self.rotors * (S @ a + self.drift(q, v)))

    def _jacobians(self, q: np.ndarray) -> np.ndarray:
        rows = q.reshape(-1, q.shape[-1])
        n = rows.shape[1]
        found = self._at.map(len(rows))(rows.T, np.zeros((n, len(rows))))[0].full()
        return np.moveaxis(found.reshape(n, len(rows), n), 0, 1).reshape(*q.shape, n)
