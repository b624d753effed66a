"""A motor by its torque and speed, or by its datasheet; it turns, or moves a prismatic joint along."""

from typing import Any

from hopopt.design.fields import CATALOGUE, CATALOGUE_NAME, DOWN, EntryName, Section, choice, named, quantity

# Entries of a linear motor in place of those of one that turns.
LINEAR = {
    "max_torque": "max_force",
    "max_speed": "max_velocity",
    "torque_cap": "force_cap",
    "rotor_inertia": "rotor_mass",
}


class Motor(Section):
    max_torque: float | None = quantity(
        "tau_max: motor torque at standstill (default: torque_constant voltage / winding_resistance)",
        "N m", 1e-6, 1000, None, physical=True,
    )  # fmt: skip
    max_force: float | None = quantity(
        "of a linear motor at standstill, for a prismatic joint in place of max_torque",
        "N", 1e-3, 1e6, None, physical=True, listed=False,
    )  # fmt: skip
    max_velocity: float | None = quantity(
        "of a linear motor at no force, in place of max_speed", "m/s", 1e-3, 100, None, physical=True, listed=False
    )
    force_cap: float | None = quantity(
        "of a linear motor's drive, in place of torque_cap", "N", 1e-3, 1e6, None, physical=True, listed=False
    )
    rotor_mass: float | None = quantity(
        "of a linear motor: what resists besides the link's own mass, in place of rotor_inertia (default: none)",
        "kg", 0.0, 1e3, None, physical=True, listed=False,
    )  # fmt: skip
    max_speed: float | None = quantity(
        "omega_max: motor speed at no torque (default: voltage / torque_constant)",
        "rad/s", 1.0, 6000, None, physical=True,
    )  # fmt: skip
    rotor_inertia: float = quantity("rotor inertia, motor side", "kg m^2", 0.0, 0.05, 0.0, physical=True)
    laws: tuple[EntryName, ...] = named(
        "torque-speed laws, all of which hold: the paper's |tau| <= tau_max (1 - |w| / omega_max), "
        "or the four-quadrant line in which braking is not weakened by speed; [] leaves the caps on torque and speed",
        ("paper",), "law", "paper", "four-quadrant",
    )  # fmt: skip
    torque_cap: float | None = quantity("drive's torque limit, motor side", "N m", 1e-6, 1000, None, physical=True)
    voltage: float | None = quantity(
        "at which its torque and speed are meant (default: the supply's)", "V", 0.1, 1000, None, physical=True
    )
    winding_resistance: float | None = quantity("electrical resistance", "ohm", 1e-4, 1e3, None, physical=True)
    winding_inductance: float | None = quantity(
        "L: the voltage bears R i + k omega + L di/dt (default: current rises at once)", "H", 1e-8, 10, None, physical=True,
    )  # fmt: skip
    torque_constant: float | None = quantity("k: motor torque for each ampere", "N m/A", 1e-4, 100, None, physical=True)
    no_load_current: float | None = quantity(
        "i_0: current that turns the motor alone, whose torque k i_0 its own friction takes",
        "A",
        0,
        1e3,
        None,
        physical=True,
    )
    current_cap: float | None = quantity(
        "greatest current, |torque| <= k times it", "A", 1e-3, 1e4, None, physical=True
    )
    continuous_torque: float | None = quantity(
        "that it gives for ever, to compare with: limits nothing", "N m", 1e-6, 1000, None, physical=True
    )
    winding_to_housing: float | None = quantity("thermal resistance", "K/W", 1e-3, 1e3, None, physical=True)
    housing_to_ambient: float | None = quantity("thermal resistance", "K/W", 1e-3, 1e3, None, physical=True)
    winding_time_constant: float | None = quantity("thermal, of the winding", "s", 0.1, 1e4, None, physical=True)
    housing_time_constant: float | None = quantity("thermal, of the housing", "s", 0.1, 1e6, None, physical=True)
    winding_limit: float | None = quantity("highest temperature of the winding", "degC", -50, 400, None, physical=True)
    torque_rate: float | None = quantity(
        "how fast its torque changes at most, up or down", "N m/s", 1e-3, 1e7, None, physical=True
    )
    power_cap: float | None = quantity("greatest mechanical power, |torque speed|", "W", 1e-3, 1e6, None, physical=True)
    catalogue: str | None = choice(CATALOGUE, None, pattern=CATALOGUE_NAME, allowed="the name of a catalogue entry")


def with_linear_motors(leg: dict[str, Any]) -> dict[str, Any]:
    """The leg's table in which linear motors turn nothing, and prismatic joints without an axis make the leg longer; where all
    motors are linear the leg needs no common one."""
    joints = leg.get("joint")
    if not isinstance(joints, dict):
        return leg
    found, linear = dict[str, Any](), 0
    for name, joint in joints.items():
        found[name] = joint
        if not isinstance(joint, dict) or joint.get("type") != "prismatic":
            continue
        found[name] = {"axis": DOWN, **joint}
        motor, gear = joint.get("motor"), joint.get("gear", {})
        if isinstance(motor, dict) and "max_force" in motor and isinstance(gear, dict):
            linear += 1
            found[name] |= {"motor": {"rotor_mass": 0.0, **motor}, "gear": {"ratio": 1.0, **gear}}
    common = {"motor": {}, "gear": {"ratio": 1.0}} if found and linear == len(found) else {}
    return common | leg | {"joint": found}
