"""A motor's torque at standstill and speed at no torque: as stated, or as its datasheet implies.

A winding of resistance R_w and torque constant k at a voltage V has the current (V - k omega) / R_w, so stall torque
k V / R_w and no-load speed V / k. Where the motor's voltage is not stated, V is the supply's open-circuit voltage. What is
stated counts over what the datasheet implies; a joint's own voltage counts over what [leg.motor] states. Torque and speed
that hold at a motor's own voltage V go with the supply's V_0, by V_0 / V. Of numbers, arrays or CasADi symbols.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

from hopopt.design import Leg, physical_parameters
from hopopt.drivetrain.operating_region.limits import Entry

SUPPLY = "leg.supply.voltage"
DATASHEET = ("voltage", "winding_resistance", "torque_constant")
INDUCTANCE = "winding_inductance"
IMPLIES = {"max_torque": DATASHEET, "max_speed": ("voltage", "torque_constant")}  # which entries imply each


def motor_torque_and_speed(leg: Leg, joint: str, p: Mapping[str, Any]) -> tuple[Any, Any]:
    """Torque at standstill [N m] and speed at no torque [rad/s] of a joint's motor, in front of its gear, at the open-circuit
    voltage of what feeds it; p: parameter values or symbols by their paths."""
    torque, speed = at_own_voltage(leg, joint, p)
    if not other_voltage(leg, joint):
        return torque, speed
    share = p[SUPPLY] / p[leg.drive(joint, "motor", "voltage")[0]]
    return share * torque, share * speed


def at_own_voltage(leg: Leg, joint: str, p: Mapping[str, Any]) -> tuple[Any, Any]:
    """The same at the voltage that the problem states for the motor; at the supply's where it states none."""

    def entry(name: str) -> Any:
        return p[leg.drive(joint, "motor", name)[0]]

    torque, speed = (entry(name) if states(leg, joint, name) else None for name in IMPLIES)
    if torque is None or speed is None:
        volts = entry("voltage") if leg.drive(joint, "motor", "voltage")[1] is not None else p[SUPPLY]
        k = entry("torque_constant")
        torque = k * volts / entry("winding_resistance") if torque is None else torque
        speed = volts / k if speed is None else speed
    return torque, speed


def other_voltage(leg: Leg, joint: str) -> bool:
    """Whether a joint's motor has a voltage of its own beside that of a supply."""
    return leg.supply is not None and leg.drive(joint, "motor", "voltage")[1] is not None


def rated(leg: Leg, joint: str) -> tuple[float, float]:
    """The same in numbers, as the problem has them."""
    torque, speed = motor_torque_and_speed(leg, joint, physical_parameters(leg))
    return float(torque), float(speed)


def stall_torque(leg: Leg, joint: str, p: Mapping[str, Any]) -> Any:
    """Torque at standstill behind the gear [N m], of parameter values or symbols."""
    return p[leg.drive(joint, "gear", "ratio")[0]] * motor_torque_and_speed(leg, joint, p)[0]


def reflected_inertia(leg: Leg, joint: str, p: Mapping[str, Any]) -> Any:
    """Of what spins in front of a joint's gear, as seen behind it [kg m^2], of parameter values or symbols."""
    ratio, rotor = p[leg.drive(joint, "gear", "ratio")[0]], p[leg.drive(joint, "motor", "rotor_inertia")[0]]
    rotor = rotor + p.get(leg.drive(joint, "gear", "inertia")[0], 0.0)
    return rotor * ratio**2


def electrical_time(leg: Leg, joint: str, p: Mapping[str, Any]) -> Any:
    """L / R_w [s], by which the current of a joint's winding is late; None where the problem states no inductance."""
    path, inductance = leg.drive(joint, "motor", INDUCTANCE)
    return None if inductance is None else p[path] / p[leg.drive(joint, "motor", "winding_resistance")[0]]


def torque_cap(leg: Leg, joint: str, p: Mapping[str, Any]) -> Any:
    """Least cap on a motor's torque [N m], in front of its gear: the drive's, or that of its current; None without one."""
    cap, current = (p.get(leg.drive(joint, "motor", name)[0]) for name in ("torque_cap", "current_cap"))
    caps = [cap, None if current is None else p[leg.drive(joint, "motor", "torque_constant")[0]] * current]
    return min((x for x in caps if x is not None), default=None)


def states(leg: Leg, joint: str, name: str) -> bool:
    """Whether the problem states max_torque or max_speed of a joint's motor."""
    path, value = leg.drive(joint, "motor", name)
    own = leg.joint[joint].motor
    return value is not None and not (path == f"leg.motor.{name}" and own is not None and own.voltage is not None)


def lacking(leg: Leg, joint: str, name: str) -> list[str]:
    """Entries of the motor without which neither the problem nor its datasheet tells max_torque or max_speed; none if one does."""
    if states(leg, joint, name):
        return []
    missing = [entry for entry in IMPLIES[name] if leg.drive(joint, "motor", entry)[1] is None]
    return [entry for entry in missing if entry != "voltage" or leg.supply is None]


def behind(leg: Leg, joint: str, name: str) -> tuple[str, ...]:
    """Paths of the entries that set an entry of a motor, such as max_torque: its own, or those of its datasheet; and the
    voltages that it goes with."""
    (path, _), volts = leg.drive(joint, "motor", name), leg.drive(joint, "motor", "voltage")[0]
    if name not in IMPLIES:
        return (path,)
    if states(leg, joint, name):
        return (path, volts, SUPPLY) if other_voltage(leg, joint) else (path,)
    found = (leg.drive(joint, "motor", entry)[0] for entry in IMPLIES[name])
    return tuple(SUPPLY if each == volts and leg.supply is not None else each for each in found)


def behind_torque(leg: Leg, joint: str) -> tuple[str, ...]:
    """Paths of the entries that set the torque at a joint at standstill."""
    return (*behind(leg, joint, "max_torque"), leg.drive(joint, "gear", "ratio")[0])


def entries_behind(leg: Leg, joint: str, cap: tuple[Entry, ...]) -> tuple[str, ...]:
    """Paths of the entries that set a line of a joint's operating region; cap: of one that a cap draws, none for the others."""
    if cap:
        return tuple(leg.drive(joint, *entry)[0] for entry in cap)
    return tuple(
        dict.fromkeys(
            (*behind(leg, joint, "max_torque"), *behind(leg, joint, "max_speed"), leg.drive(joint, "gear", "ratio")[0])
        )
    )


def own_voltage(leg: Leg) -> dict[str, float]:
    """Entries by their paths that make motors independent of what feeds them, where the supply's voltage tells their torque or
    speed; with what is stated beside it."""
    found = dict[str, float]()
    for joint in leg.joints:
        if leg.supply is not None and any(SUPPLY in behind(leg, joint, name) for name in IMPLIES):
            found[f"leg.{joint}.motor.voltage"] = leg.supply.voltage
            values = zip(IMPLIES, rated(leg, joint), strict=True)
            found |= {f"leg.{joint}.motor.{name}": value for name, value in values if states(leg, joint, name)}
    return found


def state_ratings(leg: Leg, tables: dict[str, Any]) -> None:
    """Write into the leg's tables every max_torque and max_speed that a datasheet implies, at its joint."""
    for joint in leg.joints:
        for name, value in zip(IMPLIES, at_own_voltage(leg, joint, physical_parameters(leg)), strict=True):
            if not states(leg, joint, name):
                tables[joint].setdefault("motor", {})[name] = float(value)


class VoltageLine(NamedTuple):
    """A motor by the voltage at its terminals: u = V (tau / stall torque + w / no-load speed), at the motor.

    voltage: V, the supply's, or else that at which its torque and speed are meant [V]; None where the problem does not say
    max_torque: stall torque [N m]; max_speed: no-load speed [rad/s]; ratio: of its gear; torque_cap: [N m] or None
    """

    voltage: float | None
    max_torque: float
    max_speed: float
    ratio: float
    torque_cap: float | None

    def at(self, tau: float, w: float) -> float:
        """The voltage [V] for a torque tau [N m] of the motor and a speed w [rad/s], both at the joint."""
        assert self.voltage is not None
        return self.voltage * (tau / (self.ratio * self.max_torque) + self.ratio * w / self.max_speed)


def voltage_line(leg: Leg, joint: str, p: Mapping[str, float]) -> VoltageLine:
    """The line of a joint's motor, from parameter values by their paths."""
    volts = p.get(SUPPLY, p.get(leg.drive(joint, "motor", "voltage")[0]))
    ratio, of_gear = p[leg.drive(joint, "gear", "ratio")[0]], p.get(leg.drive(joint, "gear", "torque_cap")[0])
    caps = [torque_cap(leg, joint, p), None if of_gear is None else of_gear / ratio]
    cap = min((each for each in caps if each is not None), default=None)
    return VoltageLine(volts, *motor_torque_and_speed(leg, joint, p), ratio, cap)
