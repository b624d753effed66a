"""The supply that all motors of a leg share: what they draw, how far its voltage sags, what that leaves them.

A motor draws its mechanical power and its winding's heat, P = sum(tau w + h tau^2) over the joints. Behind an internal
resistance R_s the bus has V = V_0 - R_s P / V; with v = V / V_0 that is v = (1 + sqrt(1 - 4 R_s P / V_0^2)) / 2. Stall
torque and no-load speed go with the voltage: a tau + b w <= v on the torque-speed lines; caps of torque and speed
stay. Current, power and least voltage all bound P. Of numbers, arrays or CasADi symbols.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from hopopt.design import Leg
from hopopt.drivetrain.motor import motor_torque_and_speed

EVEN = 1e-3  # share of the motors' greatest power over which drawing goes into feeding back
FLOOR = 1e-4  # of the root's argument, below which no bus has a voltage
WINDING = ("winding_resistance", "torque_constant")  # entries of a motor that tell its heat
STIFF_SUPPLY, BURNS, TAKES_BACK = 0, 1, 2  # what a supply does with power that the motors feed back
STIFFER = 1e-2  # of its internal resistance: with none, the power it lets through had no bound
NEARLY = 0.999  # of the most power that an internal resistance lets through: there the voltage would fall without end


def winding_heat(leg: Leg, joint: str, p: Mapping[str, Any]) -> Any:
    """h [W/(N m)^2]: heat of a motor's winding by its torque at the joint squared, from its resistance and torque constant.

    Where the problem has not both, those that a torque-speed line at the supply's voltage implies: no-load speed over stall
    torque.
    """
    ratio = p[leg.drive(joint, "gear", "ratio")[0]]
    resistance, constant = (p.get(leg.drive(joint, "motor", e)[0]) for e in WINDING)
    if resistance is None or constant is None:
        torque, speed = motor_torque_and_speed(leg, joint, p)
        return speed / ratio / (ratio * torque)
    return resistance / (ratio * constant) ** 2


def power_scale(leg: Leg, p: Mapping[str, Any]) -> Any:
    """Greatest mechanical power of all motors [W]: a quarter of stall torque times no-load speed each."""
    drives = [motor_torque_and_speed(leg, joint, p) for joint in leg.joints]
    return sum(torque * speed / 4 for torque, speed in drives)


def power_used(leg: Leg, p: Mapping[str, Any], tau: Any, w: Any) -> Any:
    """Mechanical power and heat of the windings [W] of one leg, below zero where its motors feed back; arguments as of
    ``power_drawn``."""
    heats = [winding_heat(leg, joint, p) for joint in leg.joints]
    return sum(t * v + h * t * t for t, v, h in zip(tau, w, heats, strict=True))


def power_drawn(leg: Leg, p: Mapping[str, Any], tau: Any, w: Any) -> Any:
    """P [W] of one leg, from its motors' torques tau [N m] and joint speeds w [rad/s], one of each for each joint."""
    total = power_used(leg, p, tau, w)
    if leg.supply is None or leg.supply.recuperation:
        return total
    even = EVEN * power_scale(leg, p)
    return (total + (total * total + even * even) ** 0.5) / 2  # what flows back beyond is burnt


def sag(leg: Leg, p: Mapping[str, Any]) -> Any:
    """R_s / V_0^2 [1/W] by the power of one leg."""
    resistance = p["leg.supply.internal_resistance"] * p["leg.supply.legs"] / p["leg.supply.count"]
    return resistance / p["leg.supply.voltage"] ** 2


def stiffer_entries(p: Mapping[str, float]) -> dict[str, float]:
    """Entries by their paths with which a supply hardly sags, if it does with those of p."""
    path = "leg.supply.internal_resistance"
    return {path: STIFFER * p[path]} if p.get(path) else {}


def voltage_share(leg: Leg, p: Mapping[str, Any], tau: Any, w: Any) -> Any:
    """v: the bus voltage over its open-circuit voltage, arguments as those of ``power_drawn``; 1 without a supply."""
    return 1.0 if leg.supply is None else share_at(sag(leg, p), power_drawn(leg, p, tau, w))


def share_at(sag: Any, power: Any) -> Any:
    """v where one leg draws a power [W], for ``sag`` [1/W]."""
    left = 1 - 4 * sag * power
    return (1 + ((left + (left * left + FLOOR**2) ** 0.5) / 2) ** 0.5) / 2


def power_limits(leg: Leg, p: Mapping[str, Any]) -> dict[str, Any]:
    """Bounds on the power [W] that one leg draws, by the entry that sets each."""
    if leg.supply is None:
        return {}
    own: dict[str, Any] = {name: p.get(f"leg.supply.{name}") for name in type(leg.supply).model_fields}
    many, of_voltage, limits = own["count"] / own["legs"], own["voltage"], dict[str, Any]()
    if leg.supply.internal_resistance > 0:
        limits["internal_resistance"] = NEARLY / (4 * sag(leg, p))
    if own["power_cap"] is not None:
        limits["power_cap"] = many * own["power_cap"]
    if own["current_cap"] is not None:
        limits["current_cap"] = (
            many * own["current_cap"] * (of_voltage - own["internal_resistance"] * own["current_cap"])
        )
    if own["least_voltage"] is not None and leg.supply.internal_resistance > 0:
        low = own["least_voltage"]
        limits["least_voltage"] = many * low * (of_voltage - low) / own["internal_resistance"]
    return limits


def supply_numbers(leg: Leg, p: Mapping[str, float]) -> dict[str, Any]:
    """What the clamp of the plants reads of a supply: heat (n,), sag, even, most power, and whether there is one."""
    if leg.supply is None:
        return stiff(len(leg.joints))
    heat = np.array([float(winding_heat(leg, joint, p)) for joint in leg.joints])
    even = 0.0 if leg.supply.recuperation else EVEN * float(power_scale(leg, p))
    most = min((float(x) for x in power_limits(leg, p).values()), default=np.inf)
    kind = TAKES_BACK if leg.supply.recuperation else BURNS
    return {"heat": heat, "supplied": kind, "sag": float(sag(leg, p)), "even": even, "most_power": most}


def stiff(n: int) -> dict[str, Any]:
    """The same of a supply that never sags, for n joints."""
    return {"heat": np.zeros(n), "supplied": STIFF_SUPPLY, "sag": 0.0, "even": 0.0, "most_power": np.inf}
