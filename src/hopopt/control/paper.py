"""The paper's strategies: force control up to motor saturation, and position control (arXiv 2107.13717, section III).

Both follow the two-mass reference y_des(t) (eq. kin_ydes) with the foot under the hip. The paper gives no law for
the hip in stance; with both joints saturated it throws the leg over. So in force control the knee is driven and
clamped (eq. con_tdyn, con_tdes), and the hip is given the torque that keeps the body on the plumb line.
"""

from dataclasses import dataclass

import numpy as np

from hopopt.control.strategy import Setting
from hopopt.control.two_mass import TwoMass
from hopopt.errors import UsageError
from hopopt.leg.kinematics import foot_offset, tucked, two_joint_angles
from hopopt.sim.measurement import Measurement

RATE = 1e-5  # [m] step of the reference's own derivative
MARGIN = 0.03  # [rad] that references keep from the joint limits


@dataclass(frozen=True)
class PaperOptions:
    """Settings of the paper's tables (tabF, tabP), and what they leave open.

    k_p [N m/rad], k_d [N m s/rad]; k_s [N/m], the printed 17 read as N/cm; retraction: "reference" (y_f goes on in
    flight) or "tuck" (the pose that lifts the foot highest); stance: "reference" (y_s) or "step" (a step to the
    stretched leg); plumb_k [1/s^2] and plumb_d [1/s] bring the body back to the plumb line.
    """

    k_p: float = 5424.0
    k_d: float = 9.0
    k_s: float = 1700.0
    y_neu: float = 0.45
    C_amp: float = 0.12
    C_max: float = 0.11
    retraction: str = "reference"
    stance: str = "reference"
    plumb_k: float = 400.0
    plumb_d: float = 40.0

    def two_mass(self, setting: Setting) -> TwoMass:
        """The reference model, with the body's and the last link's mass for m and m_e."""
        leg = setting.design.leg
        g = float(-setting.robot.model.gravity.linear[2])
        masses = {"m": leg.body.mass, "m_e": leg.link[leg.links[-1]].mass}
        return TwoMass(**masses, k=self.k_s, l0=self.y_neu, C_amp=self.C_amp, C_max=self.C_max, g=g)


class _Paper:
    """What both strategies share: the reference and the servo towards it."""

    def __init__(self, setting: Setting):
        self.leg = setting.design.leg
        if len(self.leg.joints) != 2:
            raise UsageError(
                f"{setting.design.name}: the paper's strategies need a leg of two joints, this one has "
                f"{len(self.leg.joints)}: compare the optimum with a strategy of your own"
            )
        self.options = PaperOptions(**setting.options)
        self.two_mass = self.options.two_mass(setting)
        self.side = np.sign(setting.start[1]) or 1.0
        self.lower, self.upper = (
            np.array([getattr(self.leg.joint[j], side) for j in self.leg.joints]) for side in ("lower", "upper")
        )
        self.machine = setting.machine()
        self.rise = 0.0  # [s] from lift-off to the apex, from the speed when the foot was last down
        self.tuck = tucked(self.leg, setting.design.hop.foot_window, MARGIN)
        self.begin = self._begin(float(-foot_offset(self.leg, setting.start)[1]))

    def _begin(self, height: float) -> float:
        """Time since mid-stance [s] at which the reference has the height of the start, on its way up."""
        times = np.linspace(0.0, self.two_mass.t_lo, 2001)
        return float(times[int(np.argmin(np.abs(self.two_mass.stance_reference(times)[0] - height)))])

    def length(self, now: Measurement) -> tuple[float, float]:
        """y_des [m] and its rate [m/s] now; the phase is reset at lift-off and at touchdown."""
        if not now.contact:
            y, rate = self.two_mass.flight_reference(now.since)
        elif now.landings:
            y, rate = self.two_mass.touchdown_reference(now.since)
        elif self.options.stance == "step":
            y, rate = np.inf, 0.0
        else:
            y, rate = self.two_mass.stance_reference(self.begin + now.since)
        return float(y), float(rate)

    def desired(self, now: Measurement) -> tuple[np.ndarray, np.ndarray]:
        """Joint angles [rad] and speeds [rad/s] to strive for (eq. con_angdes); tucked up to the apex if so asked."""
        if now.contact:
            s = self.machine.stance_terms(now.q, now.v)
            self.rise = self.machine.com_velocity(s.q, s.v)[1] / self.two_mass.g
        elif self.options.retraction == "tuck":
            if now.since < self.rise:
                return self.tuck, np.zeros(2)
            return self.angles(float(self.two_mass.touchdown_reference(0.0)[0])), np.zeros(2)
        y, rate = self.length(now)
        angles = self.angles(y)
        return angles, (self.angles(y + RATE) - angles) / RATE * rate

    def angles(self, y: float) -> np.ndarray:
        """Joint angles [rad] that put the foot y [m] under the hip, or as far as limits and reach allow."""
        l1, l2 = (self.leg.link[name].length for name in self.leg.links)
        y = min(y, 0.999999 * (l1 + l2))
        for q in two_joint_angles(self.leg, np.array([0.0, -y])):
            if q[1] * self.side > 0:
                return np.clip(q, self.lower, self.upper)
        return np.clip(np.array([0.0, np.inf * self.side]), self.lower, self.upper)


class Force(_Paper):
    """Force control with motor saturation: a PD law on the joint angles, clamped to the operating region."""

    def __init__(self, setting: Setting):
        super().__init__(setting)
        self.drive = setting.drive()

    def torque(self, now: Measurement) -> np.ndarray:
        """tau_dyn = -k_p (theta - theta_des) - k_d theta' (eq. con_tdyn), clamped (con_tdes); the hip on the plumb line."""
        desired, _ = self.desired(now)
        tau = self.drive.clamp(now.v, -self.options.k_p * (now.q - desired) - self.options.k_d * now.v)
        return np.array([self.upright(now, tau[1]), tau[1]]) if now.contact else tau

    def upright(self, now: Measurement, knee: float) -> float:
        """Hip torque [N m] under which the body's x'' = -plumb_k x - plumb_d x', the knee's torque given."""
        s = self.machine.stance_terms(now.q, now.v)
        wanted = -self.options.plumb_k * s.q[0] - self.options.plumb_d * s.v[0]
        # x'' = row (tau - bias) / mass matrix - drift, linear in the hip's torque
        row = np.linalg.solve(s.mass_matrix, -s.jacobian[0])
        still = row @ (np.array([0.0, knee]) - s.joint_bias) - s.drift[0]
        return float((wanted - still) / row[0])


class Position(_Paper):
    """Position control: a stiff servo of both joints on y_des(t) and its rate."""

    def torque(self, now: Measurement) -> np.ndarray:
        """k_p (theta_des - theta) + k_d (theta_des' - theta')."""
        angles, rates = self.desired(now)
        return self.options.k_p * (angles - now.q) + self.options.k_d * (rates - now.v)
