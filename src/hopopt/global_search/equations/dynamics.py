"""Equations of motion of the stance, compiled: torques, ground force and limits at a state (phi1, phi2, r1, r2) of link
angles [rad] and their rates [rad/s].

Seen from the foot the two links are a double pendulum turned upside down; angles against the world make its mass matrix
depend on one difference and leave no Coriolis terms but centrifugal ones.
"""

import numpy as np

from hopopt.compiled.kernel import kernel
from hopopt.drivetrain.kernels import add_spring_torques
from hopopt.global_search.constants import TORQUE_LINES

MARGINS = 8  # state limits: two of each joint, the heights of knee and hip, the body's descent, what links pass
RELATIVE = 1e-9  # by so much a speed may exceed the fastest
TOUCHED = 1e-4  # of the reach: by so much links may come nearer on a way than they may, for it is a chord
TOUCHING = 1e-3  # N m: by so much the bounds of a torque may cross at the very end of a drive's region


@kernel
def sprung(c, q1, q2):
    """Generalised forces on the links (2) [N m] of springs at joint angles q1, q2 [rad]."""
    if c.springs == 0:
        return 0.0, 0.0
    given = np.zeros(2)
    add_spring_torques(c, np.array([q1, q2]), given)
    return c.turn1 * given[0] - c.turn2 * given[1], c.turn2 * given[1]


@kernel
def stance_terms(c, phi1, phi2, r1, r2):
    """Of M alpha + h = Q, springs counted in h, and of the ground force at link accelerations alpha: m12 [kg m^2], h (2) [N m], and first
    moments of mass, x and z of each link [kg m], with the force without acceleration (x, z) [N]:
    f_x = f_x0 - z1 alpha1 - z2 alpha2, f_z = f_z0 + x1 alpha1 + x2 alpha2."""
    c1, s1, c2, s2 = np.cos(phi1), np.sin(phi1), np.cos(phi2), np.sin(phi2)
    cd, sd = c1 * c2 + s1 * s2, s1 * c2 - c1 * s2
    m12 = c.coupling * cd - c.coupling_across * sd + c.rotor
    slope = -c.coupling * sd - c.coupling_across * cd
    x1, z1 = c.first * c1 - c.first_across * s1, c.first * s1 + c.first_across * c1
    x2, z2 = c.second * c2 - c.second_across * s2, c.second * s2 + c.second_across * c2
    spring1, spring2 = sprung(c, c.turn1 * phi1, c.turn2 * (phi2 - phi1))
    h1 = c.gravity * x1 - slope * r2 * r2 - spring1
    h2 = slope * r1 * r1 + c.gravity * x2 - spring2
    return m12, h1, h2, x1, z1, x2, z2, -x1 * r1 * r1 - x2 * r2 * r2, c.mass * c.gravity - z1 * r1 * r1 - z2 * r2 * r2


@kernel
def apex_height(c, phi1, phi2, r1, r2):
    """Height that the centre of mass reaches if the foot leaves the ground now [m]."""
    c1, s1, c2, s2 = np.cos(phi1), np.sin(phi1), np.cos(phi2), np.sin(phi2)
    z = c.first * s1 + c.first_across * c1 + c.second * s2 + c.second_across * c2
    rise = (c.first * c1 - c.first_across * s1) * r1 + (c.second * c2 - c.second_across * s2) * r2
    speed = max(rise / c.mass, 0.0)
    return z / c.mass + speed * speed / (2 * c.gravity)


@kernel
def room(c, q1, q2):
    """By how much links keep their distances at joint angles q1, q2 [rad], linear between those of the table; 0 without one [m]."""
    n1, n2 = c.room.shape
    if n1 == 0:
        return 0.0
    x = (q1 - c.lower1) / (c.upper1 - c.lower1) * (n1 - 1)
    y = (q2 - c.lower2) / (c.upper2 - c.lower2) * (n2 - 1)
    i, j = min(max(int(x), 0), n1 - 2), min(max(int(y), 0), n2 - 2)
    s, t = x - i, y - j
    low = (1 - t) * c.room[i, j] + t * c.room[i, j + 1]
    return (1 - s) * low + s * ((1 - t) * c.room[i + 1, j] + t * c.room[i + 1, j + 1])


@kernel
def way_is_free(c, q1, q2, then1, then2, start):
    """Whether links keep their distances on the straight way between two pairs of joint angles [rad], looked at as densely as
    the table is; where they were nearer at ``start`` [m] than they may, they come no nearer."""
    n1, n2 = c.room.shape
    if n1 == 0:
        return True
    reach = np.hypot(c.thigh_x, c.thigh_z) + np.hypot(c.shank_x, c.shank_z)
    least = min(start, 0.0) - TOUCHED * reach
    far1 = abs(then1 - q1) / (c.upper1 - c.lower1) * (n1 - 1)
    far2 = abs(then2 - q2) / (c.upper2 - c.lower2) * (n2 - 1)
    parts = int(np.ceil(max(far1, far2, 1.0)))
    for k in range(1, parts + 1):
        share = k / parts
        if room(c, q1 + share * (then1 - q1), q2 + share * (then2 - q2)) < least:
            return False
    return True


@kernel
def state_margins(c, phi1, phi2, r1, r2, out):
    """How far a state is within its limits, (MARGINS,): joint angles [rad], heights of knee and hip [m], rise [m/s], room [m]."""
    q1, q2 = c.turn1 * phi1, c.turn2 * (phi2 - phi1)
    out[0], out[1], out[2], out[3] = q1 - c.lower1, c.upper1 - q1, q2 - c.lower2, c.upper2 - q2
    c1, s1, c2, s2 = np.cos(phi1), np.sin(phi1), np.cos(phi2), np.sin(phi2)
    knee = -(c.shank_x * s2 + c.shank_z * c2)
    out[4], out[5], out[6] = knee - c.knee_least, knee - (c.thigh_x * s1 + c.thigh_z * c1) - c.hip_least, 0.0
    if not c.descent:
        out[6] = -(c.thigh_x * c1 - c.thigh_z * s1) * r1 - (c.shank_x * c2 - c.shank_z * s2) * r2
    out[7] = room(c, q1, q2)


@kernel
def motor_line(c, joint, most, m12, h1, h2, w, bound):
    """gx alpha1 + gy alpha2 + g0: by how much the torque of a joint's motor (0 or 1) is above ``bound`` [N m] at joint speed
    w [rad/s]. ``most``: whether that is its greatest; where it drives forward there, its gear brakes at the least."""
    gear = c.gear1 if joint == 0 else c.gear2
    turning, rotor = w / (w**4 + gear[3] ** 4) ** 0.25, gear[5]
    share = gear[0] ** -turning if most else gear[0] ** turning
    if joint == 0:
        x, y, still, one, two = c.m11 + m12, m12 + c.m22, c.turn1 * (h1 + h2), c.turn1, 0.0
        x, y = c.turn1 * x, c.turn1 * y
    else:
        x, y, still, one, two = c.turn2 * m12, c.turn2 * c.m22, c.turn2 * h2, -c.turn2, c.turn2
    spun = (1 - share) * rotor
    lost = gear[1] * turning + gear[2] * w
    return share * x + spun * one, share * y + spun * two, share * still + lost - bound


@kernel
def torque_range(most, least, fastest, w):
    """Least and greatest torque [N m] of a drive at joint speed w [rad/s]; crossed if it gives none."""
    if abs(w) > fastest * (1 + RELATIVE):
        return 1.0, -1.0
    low, high = least[0, 0] + least[0, 1] * w, most[0, 0] + most[0, 1] * w
    for k in range(1, TORQUE_LINES):
        low, high = max(low, least[k, 0] + least[k, 1] * w), min(high, most[k, 0] + most[k, 1] * w)
    if high < low < high + TOUCHING:
        low = high
    return low, high
