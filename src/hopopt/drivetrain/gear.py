"""What a gear takes from the torque that passes its teeth: one law for planner, plant, verification and global search.

All at the joint side. The motor spins the rotor up and gives the rest to the teeth, tau_m = A a + tau_g; the leg feels
tau_out. With an efficiency eta, Coulomb friction tau_c and viscous friction b,

    tau_g = c1 tau_out + c2 |tau_out| + tau_c s + b w,    c1, c2 = (eta^-s +- eta^s) / 2,    s = sgn(w)

so that tau_out = eta tau_g where the gear drives, tau_g = eta tau_out where it brakes. At rest it holds whatever lies
between the two. The program needs smooth functions: s is w / (w^4 + slow^4)^(1/4), |tau| is sqrt(tau^2 + sharp^2). As s goes
to 0 the gear loses nothing, so that it gives power at no speed. Plain Python on purpose: of numbers, arrays or CasADi
symbols, and compiled as it is (drivetrain/kernels.py).
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from hopopt.design import Leg
from hopopt.drivetrain.motor import motor_torque_and_speed

SLOW = 1e-2  # share of the no-load speed over which losses change their sign: 0.1 rad/s on the paper's leg
SHARP = 1e-3  # share of stall torque over which a gear goes from driving to braking
ENTRIES = ("efficiency", "friction", "damping")
LOSSLESS = (1.0, 0.0, 0.0)
NO_LOAD = "no_load_current"


def teeth_torque(tau: Any, w: Any, eta: Any, friction: Any, damping: Any, slow: Any, sharp: Any) -> Any:
    """tau_g [N m] that gives the leg tau [N m] at joint speed w [rad/s]; the others as in ``Gear``."""
    turning = w / (w**4 + slow**4) ** 0.25
    up = eta**-turning
    c1, c2 = (up + 1 / up) / 2, (up - 1 / up) / 2
    return c1 * tau + c2 * (tau * tau + sharp * sharp) ** 0.5 + friction * turning + damping * w


def passed_torque(tau: Any, w: Any, eta: Any, friction: Any, damping: Any, slow: Any, sharp: Any) -> tuple[Any, Any]:
    """tau_out [N m] for a torque tau_g = tau [N m] at the teeth, the inverse of ``teeth_torque``, and its slope."""
    turning = w / (w**4 + slow**4) ** 0.25
    up = eta**-turning
    c1, c2 = (up + 1 / up) / 2, (up - 1 / up) / 2
    y = tau - friction * turning - damping * w
    size = (y * y + sharp * sharp) ** 0.5
    return c1 * y - c2 * size, c1 - c2 * y / size


@dataclass(frozen=True)
class Gear:
    """The gears of a leg, each entry a number or an array (n,); of one joint also symbols.

    efficiency: share of the torque at its teeth that it passes on (0 to 1)
    friction: Coulomb friction [N m]; damping: viscous friction [N m s/rad]
    slow: joint speed [rad/s] over which losses change their sign smoothly
    sharp: torque [N m] over which driving turns smoothly into braking
    lightest: least inertia [kg m^2] that friction is taken to stop
    """

    efficiency: Any = 1.0
    friction: Any = 0.0
    damping: Any = 0.0
    slow: Any = 0.02
    sharp: Any = 0.2
    lightest: float = 1e-3

    @property
    def ideal(self) -> bool:
        """Whether nothing is lost."""
        return bool(np.all(self.efficiency == 1.0) and not np.any(self.friction) and not np.any(self.damping))

    @property
    def law(self) -> tuple[Any, ...]:
        """What ``teeth_torque`` and ``passed_torque`` take after torque and speed."""
        return self.efficiency, self.friction, self.damping, self.slow, self.sharp

    @classmethod
    def of(cls, leg: Leg, joint: str, p: Mapping[str, Any]) -> Self:
        """The gear of a joint as its problem plans with it, from parameter values or symbols by their paths."""

        def entry(part: Any, name: str, default: Any = None) -> Any:
            return p.get(leg.drive(joint, part, name)[0], default)

        own = {name: entry("gear", name, default) for name, default in zip(ENTRIES, LOSSLESS, strict=True)}
        ratio, (torque, speed) = entry("gear", "ratio"), motor_torque_and_speed(leg, joint, p)
        own["friction"] += motor_friction(leg, joint, p)
        slow, sharp = SLOW * speed / ratio, SHARP * ratio * torque
        return cls(**own, slow=slow, sharp=sharp)


def motor_friction(leg: Leg, joint: str, p: Mapping[str, Any]) -> Any:
    """Coulomb friction R k i_0 [N m] of the motor itself, at the joint: what its no-load current overcomes."""
    current = p.get(leg.drive(joint, "motor", NO_LOAD)[0])
    if current is None:
        return 0.0
    return p[leg.drive(joint, "gear", "ratio")[0]] * p[leg.drive(joint, "motor", "torque_constant")[0]] * current


def gears_of(leg: Leg, p: Mapping[str, Any]) -> Gear:
    """The gears of all joints as the problem plans with them, entries (n,); p: numbers by their paths."""
    each = [Gear.of(leg, joint, p) for joint in leg.joints]
    efficiency, friction, damping, slow, sharp = np.array([gear.law for gear in each], dtype=float).T
    return Gear(efficiency, friction, damping, slow, sharp)


def lossless_entries(p: Mapping[str, float]) -> dict[str, float]:
    """Entries by their paths with which gears and motors' bearings lose nothing, of those among p that lose."""
    ideal = {f"gear.{name}": value for name, value in zip(ENTRIES, LOSSLESS, strict=True)} | {f"motor.{NO_LOAD}": 0.0}
    own = {path: ideal[key] for path in p if (key := ".".join(path.split(".")[-2:])) in ideal}
    return {path: value for path, value in own.items() if p[path] != value}


def lossy(leg: Leg, joint: str) -> bool:
    """Whether the problem gives the gear of a joint, or the motor's bearings, losses to plan with, be they none."""
    own = (leg.drive(joint, "gear", name)[1] for name in ENTRIES)
    return leg.drive(joint, "motor", NO_LOAD)[1] is not None or any(value is not None for value in own)


def any_lossy(leg: Leg) -> bool:
    """Whether any joint's gear is ``lossy``."""
    return any(lossy(leg, joint) for joint in leg.joints)


def motor_torque(gear: Gear, tau: Any, w: Any, a: Any, rotor: Any) -> Any:
    """tau_m [N m] for the torque tau = A a + tau_out [N m] on a joint and its rotor, at speed w [rad/s] and acceleration
    a [rad/s^2]; rotor: A, reflected inertia of what spins in front of the gear [kg m^2]."""
    return rotor * a + teeth_torque(tau - rotor * a, w, *gear.law)


def joint_torque(gear: Gear, motor: Any, w: Any, a: Any, rotor: Any) -> Any:
    """tau [N m] for the motor's torque, the inverse of ``motor_torque``; arguments as there."""
    return rotor * a + passed_torque(motor - rotor * a, w, *gear.law)[0]


def driven_joints(gear: Gear, motor: np.ndarray, w: np.ndarray, a: np.ndarray, response: np.ndarray, rotor: np.ndarray) -> np.ndarray:  # fmt: skip
    """Torques tau (n) [N m] under which a leg moves as its motors' torques make it move, by Newton's method.

    The gear takes its share of what the rotor leaves, so tau depends on the acceleration that it leads to.
    motor, w (n): torques of the motors [N m], joint speeds [rad/s]
    a (n), response (n, n): accelerations without torques [rad/s^2], and by a unit of each [1/(kg m^2)]
    rotor (n): reflected inertias [kg m^2]
    """
    tau, unit = np.array(motor, dtype=float), np.eye(len(motor))
    for _ in range(MOST_STEPS):
        moved = a + response @ tau
        passed, slope = passed_torque(motor - rotor * moved, w, *gear.law)
        missing = tau - rotor * moved - passed
        if np.abs(missing).max() <= EXACT * (1.0 + np.abs(tau).max()):
            break
        tau = tau - np.linalg.solve(unit - (rotor * (1 - slope))[:, None] * response, missing)
    return tau


def response_to(accelerate: Callable[[np.ndarray], np.ndarray], n: int) -> tuple[np.ndarray, np.ndarray]:
    """Accelerations of n joints without torques (n) and by a unit of each (n, n), of an affine function of the torques."""
    still = accelerate(np.zeros(n))
    return still, np.array([accelerate(unit) - still for unit in np.eye(n)]).T


MOST_STEPS, EXACT = 20, 1e-13  # of Newton's method; relative
