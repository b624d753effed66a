"""Rules between the entries of motors: torque and speed that something bounds, whole datasheets, inductance, and heat."""

from hopopt.design import Leg
from hopopt.design.drives.motor import LINEAR
from hopopt.design.drives.supply import Supply
from hopopt.drivetrain.heat import BODIES, LIMIT
from hopopt.drivetrain.motor import IMPLIES, INDUCTANCE, lacking
from hopopt.drivetrain.operating_region.limits import Entry
from hopopt.drivetrain.supply import WINDING
from hopopt.problem.checking.faults import Report


def drive_rules(leg: Leg, report: Report) -> None:
    """Report drives whose torque or speed nothing would bound: without a law both need a cap; motors that neither say their torque
    and speed nor have a datasheet that implies them."""
    _linear_rules(leg, report)
    _datasheet_rules(leg, report)
    open_ended: dict[tuple[str, str], list[str]] = {}
    for joint in leg.joints:
        path, laws = leg.drive(joint, "motor", "laws")
        if not laws and (missing := _uncapped(leg, joint)):
            open_ended.setdefault((path, missing), []).append(joint)
    for (path, missing), joints in open_ended.items():
        words = f'give these caps, or "paper" or "four-quadrant" in {path}'
        report.add(path, f"= [] leaves nothing to bound {missing} of {', '.join(joints)}: {words}")


def _linear_rules(leg: Leg, report: Report) -> None:
    """Report entries of linear motors where none is, and beside those of motors that turn; transmissions of what slides."""
    for path, motor, slides in (
        ("leg.motor", leg.motor, False),
        *((f"leg.{joint}.motor", leg.joint[joint].motor, joint in leg.sliding) for joint in leg.joints),
    ):
        given = [name for name in LINEAR.values() if motor is not None and getattr(motor, name) is not None]
        turning = [name for name in (*LINEAR, "voltage") if motor is not None and getattr(motor, name) is not None]
        if given and not slides:
            report.add(
                f"{path}.{given[0]}",
                'is of a linear motor: it belongs to [leg.<joint>.motor] of a joint with type = "prismatic"',
            )
        elif given and motor is not None and motor.max_force is None:
            report.add(f"{path}.max_force", f"is missing beside {given[0]}: a linear motor has a force at standstill")
        elif given and turning:
            report.add(
                f"{path}.{turning[0]}",
                f"is of a motor that turns, beside {given[0]} of a linear one: leave out one of them",
            )
    for joint in leg.joints:
        between = leg.joint[joint].transmission
        if between is not None and (joint in leg.sliding or {*(between.coupling or ())} & {*leg.sliding}):
            report.add(
                f"leg.{joint}.transmission",
                "goes with joints that turn: a prismatic joint moves as its drive does, leave it out",
            )


def _datasheet_rules(leg: Leg, report: Report) -> None:
    """Report what a motor's datasheet lacks."""
    faults: dict[str, str] = {}
    for joint in leg.joints:
        for name in IMPLIES:
            if missing := lacking(leg, joint, name):
                needed = ", ".join(f"motor.{entry}" for entry in missing)
                datasheet = "" if leg.linear(joint) else f", or what the motor's datasheet still lacks: {needed}"
                words = f"is missing: give it{datasheet}"
                faults.setdefault(leg.drive(joint, "motor", name)[0], words)
        constant = leg.drive(joint, "motor", "torque_constant")[1]
        for name in ("no_load_current", "current_cap"):
            path, value = leg.drive(joint, "motor", name)
            if value is not None and constant is None:
                words = f"= {value:g} A is a current, whose torque nothing tells: give motor.torque_constant too"
                faults.setdefault(path, words)
        path, inductance = leg.drive(joint, "motor", INDUCTANCE)
        if inductance is not None and leg.drive(joint, "motor", "winding_resistance")[1] is None:
            faults.setdefault(
                path, f"= {inductance:g} H tells how fast current rises only with motor.winding_resistance too"
            )
        if inductance is not None and leg.supply is not None and _gives_way(leg.supply):
            words = f"= {inductance:g} H goes with a stiff supply alone: leave it out, or [supply] but for its voltage"
            faults.setdefault(path, words)
    for path, words in faults.items():
        report.add(path, words)


def _gives_way(supply: Supply) -> bool:
    """Whether what a supply gives depends on what is drawn from it."""
    caps = supply.least_voltage, supply.current_cap, supply.power_cap
    return supply.internal_resistance > 0 or any(cap is not None for cap in caps)


def _uncapped(leg: Leg, joint: str) -> str:
    """What no cap bounds in a joint's drive, with the entries that would; empty if torque and speed have one."""
    caps: tuple[Entry, ...] = ("motor", "torque_cap"), ("motor", "current_cap"), ("gear", "torque_cap")
    torque = any(leg.drive(joint, *cap)[1] for cap in caps)
    found = [] if torque else ["the torque (motor.torque_cap or gear.torque_cap)"]
    return " and ".join(found if leg.drive(joint, "gear", "speed_cap")[1] else [*found, "the speed (gear.speed_cap)"])


def heat_rules(leg: Leg, ambient: float, report: Report) -> None:
    """Report thermal entries that lack others, and a limit that the winding is above before it moves."""
    faults: dict[str, str] = {}
    for joint in leg.joints:
        own = {name: leg.drive(joint, "motor", name) for name in (LIMIT, *BODIES)}
        given = next((name for name, (_, value) in own.items() if value is not None), None)
        missing = [name for name in (*BODIES, *WINDING) if leg.drive(joint, "motor", name)[1] is None]
        if given and missing:
            path, value = own[given]
            words = f"= {value:g} tells how hot a motor gets only with all of its heat: give motor.{', motor.'.join(missing)} too"
            faults.setdefault(path, words)
        path, limit = own[LIMIT]
        if limit is not None and limit <= ambient:
            words = f"= {limit:g} degC is not above environment.temperature = {ambient:g} degC, with which the winding begins"
            faults.setdefault(path, f"{words}: give the insulation's limit, often 100 to 155 degC")
    for path, words in faults.items():
        report.add(path, words)
