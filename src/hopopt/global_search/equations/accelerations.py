"""What the leg can do at a state: the polygon of link accelerations that drives and ground allow, compiled.

Drives bound two torques, the ground its vertical force and its friction: all are straight lines in the plane of the
link accelerations (alpha1, alpha2) [rad/s^2]. A vertex is named by the two limits that meet in it (numbers below), so
that the same pair can be kept active while the state moves on.
"""

from hopopt.compiled.kernel import kernel
from hopopt.global_search.constants import UNLIMITED
from hopopt.global_search.equations.dynamics import stance_terms, torque_range

HIP_LEAST, HIP_MOST, KNEE_LEAST, KNEE_MOST, FORCE, SLIP_FORWARD, SLIP_BACKWARD = range(7)
VERTICES = 12  # room for those of a polygon: four torques, cut by three lines
STEP_SLACK = 1e-3  # share of its range by which a torque or a ground force may leave its limits within a step
PARALLEL_LIMITS = 1e-12  # relative determinant below which two limits do not meet


@kernel
def _cut(x, y, edge, count, gx, gy, g0, name, to_x, to_y, to_edge):
    """The part of a polygon where gx x + gy y + g0 >= 0; ``edge``: the limit between a vertex and the next."""
    k = 0
    for i in range(count):
        j = i + 1 if i + 1 < count else 0
        a, b = gx * x[i] + gy * y[i] + g0, gx * x[j] + gy * y[j] + g0
        if a >= 0:
            to_x[k], to_y[k], to_edge[k] = x[i], y[i], edge[i]
            k += 1
        if (a >= 0) != (b >= 0):
            t = a / (a - b)
            to_x[k], to_y[k] = x[i] + t * (x[j] - x[i]), y[i] + t * (y[j] - y[i])
            to_edge[k] = name if a >= 0 else edge[i]
            k += 1
    return k


@kernel
def polygon(c, phi1, phi2, r1, r2, x, y, edge, spare_x, spare_y, spare_edge):
    """Vertices (x, y) [rad/s^2] in order and their edges; returns how many, none if the leg cannot stand on."""
    m12, h1, h2, x1, z1, x2, z2, fx, fz = stance_terms(c, phi1, phi2, r1, r2)
    least1, most1 = torque_range(c.most1, c.least1, c.fastest1, c.turn1 * r1)
    least2, most2 = torque_range(c.most2, c.least2, c.fastest2, c.turn2 * (r2 - r1))
    if least1 > most1 or least2 > most2:
        return 0
    det = c.m11 * c.m22 - m12 * m12
    for i in range(4):
        tau1, tau2 = most1 if i == 1 or i == 2 else least1, most2 if i >= 2 else least2
        Q1, Q2 = c.turn1 * tau1 - c.turn2 * tau2 - h1, c.turn2 * tau2 - h2
        spare_x[i], spare_y[i] = (c.m22 * Q1 - m12 * Q2) / det, (c.m11 * Q2 - m12 * Q1) / det
    spare_edge[0], spare_edge[1], spare_edge[2], spare_edge[3] = KNEE_LEAST, HIP_MOST, KNEE_MOST, HIP_LEAST
    n = _cut(spare_x, spare_y, spare_edge, 4, x1, x2, fz - c.least_force, FORCE, x, y, edge)
    if c.friction >= UNLIMITED or n == 0:
        return n
    mu = c.friction
    n = _cut(x, y, edge, n, mu * x1 + z1, mu * x2 + z2, mu * fz - fx, SLIP_FORWARD, spare_x, spare_y, spare_edge)
    return _cut(spare_x, spare_y, spare_edge, n, mu * x1 - z1, mu * x2 - z2, mu * fz + fx, SLIP_BACKWARD, x, y, edge)


@kernel
def with_limits(c, phi1, phi2, r1, r2, one, two):
    """Accelerations [rad/s^2] at which two limits are active, and whether they meet and no other is passed by SLACK."""
    m12, h1, h2, x1, z1, x2, z2, fx, fz = stance_terms(c, phi1, phi2, r1, r2)
    least1, most1 = torque_range(c.most1, c.least1, c.fastest1, c.turn1 * r1)
    least2, most2 = torque_range(c.most2, c.least2, c.fastest2, c.turn2 * (r2 - r1))
    if least1 > most1 or least2 > most2:
        return 0.0, 0.0, False
    hip = c.turn1 * (c.m11 + m12), c.turn1 * (m12 + c.m22), c.turn1 * (h1 + h2)  # torques, affine in the accelerations
    knee = c.turn2 * m12, c.turn2 * c.m22, c.turn2 * h2
    ax, ay, a0 = _line(one, hip, knee, least1, most1, least2, most2, c.least_force, c.friction, x1, z1, x2, z2, fx, fz)
    bx, by, b0 = _line(two, hip, knee, least1, most1, least2, most2, c.least_force, c.friction, x1, z1, x2, z2, fx, fz)
    det = ax * by - bx * ay
    if abs(det) < PARALLEL_LIMITS * (abs(ax) + abs(ay)) * (abs(bx) + abs(by)):
        return 0.0, 0.0, False
    x, y = (ay * b0 - a0 * by) / det, (bx * a0 - ax * b0) / det
    return x, y, possible(c, phi1, phi2, r1, r2, x, y)


@kernel
def possible(c, phi1, phi2, r1, r2, alpha1, alpha2):
    """Whether drives and ground allow accelerations [rad/s^2] at a state, with SLACK."""
    m12, h1, h2, x1, z1, x2, z2, fx, fz = stance_terms(c, phi1, phi2, r1, r2)
    least1, most1 = torque_range(c.most1, c.least1, c.fastest1, c.turn1 * r1)
    least2, most2 = torque_range(c.most2, c.least2, c.fastest2, c.turn2 * (r2 - r1))
    tau2 = c.turn2 * (m12 * alpha1 + c.m22 * alpha2 + h2)
    tau1 = c.turn1 * (c.m11 * alpha1 + m12 * alpha2 + h1 + c.turn2 * tau2)
    slack1, slack2 = STEP_SLACK * (most1 - least1) + 1e-6, STEP_SLACK * (most2 - least2) + 1e-6
    if tau1 < least1 - slack1 or tau1 > most1 + slack1 or tau2 < least2 - slack2 or tau2 > most2 + slack2:
        return False
    slack, up = STEP_SLACK * c.mass * c.gravity, fz + x1 * alpha1 + x2 * alpha2
    if up < c.least_force - slack:
        return False
    return c.friction >= UNLIMITED or abs(fx - z1 * alpha1 - z2 * alpha2) <= c.friction * up + slack


@kernel
def _line(name, hip, knee, least1, most1, least2, most2, least_force, friction, x1, z1, x2, z2, fx, fz):
    """The line gx alpha1 + gy alpha2 + g0 = 0 on which a limit is active."""
    if name in (HIP_LEAST, HIP_MOST):
        return hip[0], hip[1], hip[2] - (least1 if name == HIP_LEAST else most1)
    if name in (KNEE_LEAST, KNEE_MOST):
        return knee[0], knee[1], knee[2] - (least2 if name == KNEE_LEAST else most2)
    if name == FORCE:
        return x1, x2, fz - least_force
    if name == SLIP_FORWARD:
        return friction * x1 + z1, friction * x2 + z2, friction * fz - fx
    return friction * x1 - z1, friction * x2 - z2, friction * fz + fx
