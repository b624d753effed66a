"""The two-mass hopper the paper takes its position reference from, in closed form, its misprints corrected.

A body m over a foot m_e on a spring k of rest length l0; z up, SI units. y_s and y_f are the leg's length y_m - y_e in
stance and in flight. The stance clock is zero at mid-stance (leg shortest, at rest: there the hop starts), the flight
clock at lift-off; t has any shape. docs/paper.md sets each printed equation beside the one used here.

With s = omega_f t and a = omega_f v_c / g, y_e = (g / omega_f^2) (a (s - sin s) - (s^2/2 - 1 + cos s)): the foot comes
down where h(s) = (s^2/2 - 1 + cos s) / (s - sin s) reaches a, exactly once, since h' is the square of
(s cos(s/2) - 2 sin(s/2)) / (s - sin s); and without speed where that is zero too, which means tan a = a.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Self

import numpy as np
from scipy.optimize import brentq

from hopopt.design import GRAVITY


@dataclass(frozen=True)
class TwoMass:
    """Body m [kg] over foot m_e [kg] on a spring k [N/m] of rest length l0 [m], hopping with amplitude C_amp [m].

    C_amp is how far beyond l0 the spring would stretch if the foot were held; C_max [-] is the largest reduction by
    C_com; l0 is y_s.neu as the lift-off condition has it. Raises ValueError for values out of range, and for
    everything that needs a flight where there is none.
    """

    m: float
    m_e: float
    k: float
    l0: float
    C_amp: float
    C_max: float
    g: float = GRAVITY

    def __post_init__(self) -> None:
        if not (all(x > 0 for x in (self.m, self.m_e, self.k, self.l0, self.C_amp, self.g)) and 0 <= self.C_max < 1):
            raise ValueError(f"m, m_e, k, l0, C_amp and g must be greater than 0, and 0 <= C_max < 1: {self}")

    @classmethod
    def from_loaded_length(
        cls, y_neu: float, m: float, m_e: float, k: float, g: float = GRAVITY, **rest: float
    ) -> Self:
        """The other reading of y_s.neu [m], that of its eq. 3: the length at which the spring carries the body."""
        return cls(m=m, m_e=m_e, k=k, l0=y_neu + m * g / k, g=g, **rest)

    @cached_property
    def M(self) -> float:
        """Both masses [kg]."""
        return self.m + self.m_e

    @cached_property
    def loaded_length(self) -> float:
        """Length [m] at which the spring carries the body, the centre of the stance oscillation."""
        return self.l0 - self.m * self.g / self.k

    @cached_property
    def A(self) -> float:
        """Amplitude [m] of the stance oscillation (the paper's eq. 3)."""
        return self.C_amp + self.m * self.g / self.k

    @cached_property
    def omega_s(self) -> float:
        """Angular frequency [rad/s] in stance."""
        return float(np.sqrt(self.k / self.m))

    @cached_property
    def omega_f(self) -> float:
        """Angular frequency [rad/s] in flight, of the reduced mass m m_e / M."""
        return float(np.sqrt(self.k * self.M / (self.m * self.m_e)))

    def y_s(self, t: Any) -> Any:
        """Length [m] in stance (the paper's eq. 3 about the loaded length): m r'' = -m g - k (r - l0)."""
        return self.loaded_length - self.A * np.cos(self.omega_s * np.asarray(t))

    def y_s_rate(self, t: Any) -> Any:
        """Its rate [m/s]."""
        return self.A * self.omega_s * np.sin(self.omega_s * np.asarray(t))

    def ground_force(self, t: Any) -> Any:
        """Force [N] of the ground on the foot in stance; lift-off is where it falls to zero."""
        return self.k * (self.l0 - self.y_s(t)) + self.m_e * self.g

    @property
    def peak_ground_force(self) -> float:
        """Largest force [N] of the ground on the foot, at mid-stance; the spring's is m_e g less."""
        return self.M * self.g + self.k * self.A

    @property
    def stance_range(self) -> tuple[float, float]:
        """Shortest and longest length [m] in stance."""
        return self.loaded_length - self.A, min(self.y_lo, self.l0 + self.C_amp)

    @cached_property
    def t_lo(self) -> float:
        """Time [s] from mid-stance to lift-off (the paper's eq. 6). Raises ValueError if the foot never lifts off."""
        if (pull := self.k * self.C_amp) <= (weight := self.m_e * self.g):
            raise ValueError(
                f"The foot never lifts off: the spring pulls it with at most k C_amp = {pull:.3g} N, its weight is "
                f"{weight:.3g} N. It takes k > {weight / self.C_amp:.4g} N/m or C_amp > {weight / self.k:.4g} m."
            )
        return float((np.pi - np.arccos(self.M * self.g / (self.k * self.A))) / self.omega_s)

    @cached_property
    def y_lo(self) -> float:
        """Length [m] at lift-off: the spring carries the foot."""
        return self.l0 + self.m_e * self.g / self.k

    @cached_property
    def v_lo(self) -> float:
        """Rate of the length [m/s], and speed of the body, at lift-off."""
        return float(self.y_s_rate(self.t_lo))

    @cached_property
    def v_c(self) -> float:
        """Speed [m/s] of the centre of mass at lift-off."""
        return self.m * self.v_lo / self.M

    def y_f(self, t: Any) -> Any:
        """Length [m] in flight (the paper's eq. 4, its time shift expanded): the reduced mass on the spring."""
        s = self.omega_f * np.asarray(t)
        return self.l0 + (self.y_lo - self.l0) * np.cos(s) + self.v_lo / self.omega_f * np.sin(s)

    def y_f_rate(self, t: Any) -> Any:
        """Its rate [m/s]."""
        s = self.omega_f * np.asarray(t)
        return self.v_lo * np.cos(s) - self.omega_f * (self.y_lo - self.l0) * np.sin(s)

    def y_c(self, t: Any) -> Any:
        """Height [m] of the centre of mass in flight: it falls freely."""
        return self.m * self.y_lo / self.M + self.v_c * np.asarray(t) - self.g * np.square(t) / 2

    def y_m(self, t: Any) -> Any:
        """Height [m] of the body in flight."""
        return self.y_c(t) + self.m_e / self.M * self.y_f(t)

    def y_e(self, t: Any) -> Any:
        """Height [m] of the foot in flight."""
        return self.y_c(t) - self.m / self.M * self.y_f(t)

    def y_e_rate(self, t: Any) -> Any:
        """Its rate [m/s]."""
        return self.v_c - self.g * np.asarray(t) - self.m / self.M * self.y_f_rate(t)

    @cached_property
    def _a(self) -> float:
        """omega_f v_c / g [-]: half a ballistic flight in radians of the flight oscillation."""
        return self.omega_f * self.v_c / self.g

    @cached_property
    def t_f(self) -> float:
        """Time [s] from lift-off to touchdown: s with h(s) = a, between a and 4 a since s/4 <= h(s) <= s."""

        def early(x: float) -> float:  # h(2 x) - a, without cancellation at small x
            return (x - np.sin(x)) * (x + np.sin(x)) / (x - np.sin(x) * np.cos(x)) - self._a

        return 2 * _root(early, self._a / 2, 2.1 * self._a) / self.omega_f

    @cached_property
    def T(self) -> float:
        """Period [s] from mid-stance to mid-stance of the reference, which resets its phase at touchdown."""
        return 2 * self.t_lo + self.t_f

    @property
    def com_rise(self) -> float:
        """Rise [m] of the centre of mass in flight."""
        return self.v_c**2 / (2 * self.g)

    @cached_property
    def clearance(self) -> float:
        """Greatest height [m] of the foot in flight.

        y_e' falls through zero once in each 2 a_n < s < 2 pi (n + 1) with tan a_n = a_n < a, and nowhere else.
        """
        a, starts = self._a, [min(self._a, np.pi)]
        while _soft_landing(len(starts)) < a * (1 - 1e-9):  # a top that just appears lies on the ground, at touchdown
            starts.append(2 * _soft_landing(len(starts)))
        tops = [
            _root(lambda s: a * (1 - np.cos(s)) - (s - np.sin(s)), start, 2 * np.pi * (n + 1))
            for n, start in enumerate(starts)
        ]
        return float(np.max(self.y_e(np.array(tops) / self.omega_f)))

    def soft_landing_stiffness(self, n: int) -> float:
        """The k [N/m] with which these masses and C_amp touch down without speed, n = 1, 2, ...; 0: just lift off.

        There t_f = (2 pi n + 2 arctan a) / omega_f = 2 v_c / g, so tan a = a; a^2 M m_e = (k C_amp / g + m)^2 - M^2.
        """
        return self.g / self.C_amp * float(np.sqrt(self.M**2 + _soft_landing(n) ** 2 * self.M * self.m_e) - self.m)

    def C_com(self, t: Any) -> Any:
        """Compensation [-] at t [s] since mid-stance: 1 up to the apex, then 1 -> 1 - C_max -> 1 (paper's eq. 8)."""
        phase = np.mod(t, self.T)
        return np.where(phase < self.T / 2, 1.0, 1 - self.C_max / 2 * (1 - np.cos(4 * np.pi * phase / self.T)))

    def C_com_rate(self, t: Any) -> Any:
        """Its rate [1/s]."""
        omega = 4 * np.pi / self.T
        return np.where(np.mod(t, self.T) < self.T / 2, 0.0, -self.C_max / 2 * omega * np.sin(omega * np.asarray(t)))

    def stance_reference(self, t: Any) -> tuple[Any, Any]:
        """y_des, y_des' at t [s] since mid-stance, t >= -t_lo, for as long as the plant is in contact.

        A plant late to lift off finds the reference go on to the oscillation's top and stay there.
        """
        t = np.minimum(t, np.pi / self.omega_s)
        clock = np.minimum(t, 0.0)  # 1 from mid-stance on; with a light foot the top may come after T/2
        C, C_rate = self.C_com(clock), self.C_com_rate(clock)
        return C * self.y_s(t), C_rate * self.y_s(t) + C * self.y_s_rate(t)

    def touchdown_reference(self, t: Any) -> tuple[Any, Any]:
        """y_des, y_des' at t [s] since the plant's touchdown: the phase is reset to t_lo before mid-stance.

        Both jump there unless the landing is soft: the flight oscillation then ends in another phase.
        """
        return self.stance_reference(np.asarray(t) - self.t_lo)

    def flight_reference(self, t: Any) -> tuple[Any, Any]:
        """y_des, y_des' at t [s] since the plant's lift-off; C_com stops at t_f if the flight does not."""
        clock = self.t_lo + np.minimum(t, self.t_f)
        C, C_rate = self.C_com(clock), np.where(np.asarray(t) > self.t_f, 0.0, self.C_com_rate(clock))
        return C * self.y_f(t), C_rate * self.y_f(t) + C * self.y_f_rate(t)

    def y_des(self, t: Any) -> Any:
        """Desired length [m] at t [s] since mid-stance on the model's own clock, period T (the paper's eq. 9)."""
        return self._reference(t)[0]

    def y_des_rate(self, t: Any) -> Any:
        """Its rate [m/s]."""
        return self._reference(t)[1]

    def _reference(self, t: Any) -> tuple[Any, Any]:
        phase = np.mod(t, self.T)
        flies = (phase >= self.t_lo) & (phase <= self.T - self.t_lo)
        stance = self.stance_reference(np.where(phase < self.T / 2, phase, phase - self.T))
        flight = self.flight_reference(phase - self.t_lo)
        return np.where(flies, flight[0], stance[0]), np.where(flies, flight[1], stance[1])


def _soft_landing(n: int) -> float:
    """The n-th positive root of tan a = a; 0 for n = 0."""
    return _root(lambda a: np.sin(a) - a * np.cos(a), n * np.pi, (n + 0.5) * np.pi)


def _root(function: Any, lower: float, upper: float) -> float:
    """Where the function changes sign between lower and upper, to the last digits."""
    return float(brentq(function, lower, upper, xtol=1e-15, rtol=1e-14))  # pyright: ignore[reportArgumentType]


PAPER = TwoMass(m=5.6, m_e=0.8, k=1700.0, l0=0.45, C_amp=0.12, C_max=0.11)  # tables 1 and 2; k_s as 17 N/cm
