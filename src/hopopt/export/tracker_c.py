"""The tracker of a plan as one C header without dependencies: the strategy ``track`` with its tables of numbers.

``tracker.h`` beside this file is the algorithm; here its tables are filled in. A test compiles it and compares it with
``control/tracking/track.py`` at every control instant of a simulated hop.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from importlib.metadata import version
from importlib.resources import files

import numpy as np

from hopopt.control.reference import EVENT_RESOLUTION, FLIGHT, STANCE, PhaseReference
from hopopt.control.tracking.regulator import Gains
from hopopt.control.tracking.track import EARLY_LIFT_OFF, Track
from hopopt.design import refuse_landed
from hopopt.drivetrain.drives import LAW
from hopopt.drivetrain.operating_region.half_planes import UNBOUNDED
from hopopt.errors import UsageError
from hopopt.export.plan import tracker_of
from hopopt.planner.reserve import TrackedPlan

TABLES_MARK = "/* @TABLES@ */\n"
TOLERANCE = 0.01  # share of the greatest, within which gains between knots are
REAL_BYTES = 4  # of a number in single precision
NUMBERS_ON_A_LINE = 8  # numbers on a line


def to_c(plan: TrackedPlan) -> str:
    """The C header (C99, single precision, tgmath.h and string.h alone). Raises UsageError for a hop that lands, and as ``tracker_of`` does."""
    design = plan.motion.design
    refuse_landed(design, "the tracker in C")
    return header(tracker_of(plan), design.name, design.leg.joints)


def header(tracker: Track, problem: str, joints: Sequence[str], tolerance: float = TOLERANCE) -> str:
    """The C header of a tracker, for the joints of a problem; tolerance of the gains between knots, as ``knots`` has it."""
    code = files("hopopt.export").joinpath("tracker.h").read_text(encoding="utf-8")
    constants = tables(tracker, tolerance)
    title = (
        f"/* Tracks the plan of {problem}: joints {', '.join(joints)}; clearance {tracker.plan.clearance:.4f} m. Made by "
        f"hopopt {version('hopopt')}.\n   Call hopopt_reset before a hop and hopopt_torque once in every control "
        "period. SI units.\n   "
        f"About {constants_bytes(constants) / 1000:.0f} kB of constants in single precision; gains between knots within {tolerance:.1%} of their greatest. */\n"
    )
    before, after = code.split(TABLES_MARK)
    return title + before + constants + after


def constants_bytes(code: str) -> int:
    """Bytes that the numbers of C tables take in single precision."""
    arrays = re.findall(r"static const hopopt_real [^=]*= (\{.*?\});", code, flags=re.DOTALL)
    return REAL_BYTES * sum(len(re.findall(r"[^\s,{}]+", array)) for array in arrays)


def knots(gains: Gains, tolerance: float) -> np.ndarray:
    """Control periods (k,) between which gains may be taken as linear: no entry is off by more than this share of its greatest."""
    numbers = np.hstack([getattr(gains, name).reshape(len(gains.K), -1) for name in "ABKL"])
    numbers, found = numbers / np.maximum(np.abs(numbers).max(axis=0), 1e-300), [0]
    while found[-1] < len(numbers) - 1:
        begin, step = found[-1], 1
        while begin + step + 1 < len(numbers) and _straight(numbers[begin : begin + step + 2], tolerance):
            step += 1
        found.append(begin + step)
    return np.array(found)


def _straight(rows: np.ndarray, tolerance: float) -> bool:
    along = np.linspace(0.0, 1.0, len(rows))[:, None]
    return bool(np.abs(rows[0] + along * (rows[-1] - rows[0]) - rows).max() <= tolerance)


def tables(tracker: Track, tolerance: float = TOLERANCE) -> str:
    """All numbers of a tracker as C constants."""
    if tracker.drive.gear.knots:
        raise UsageError("the tracker in C knows one efficiency for each gear: give leg.gear.efficiency, not its table")
    o, n = tracker.options, len(tracker.rest)
    stance, bounds = tracker.plan.stance, {"upper": tracker.drive.upper, "lower": tracker.drive.lower}
    sizes = {"JOINTS": n, "PLACES": len(stance.places), "LINES": max(planes.shape[1] for planes in bounds.values())}
    for name, phase in _phases(tracker).items():
        gains = tracker.gains[name == STANCE]
        sizes |= {f"{name.upper()}_INTERVALS": len(phase.t), f"{name.upper()}_KNOTS": len(knots(gains, tolerance))}
    figures = {
        "PERIOD": tracker.period,
        "EDGE": EVENT_RESOLUTION,
        "EARLY": EARLY_LIFT_OFF,
        "STEP": tracker.step,
        "ENDS": tracker.ends,
        "K_P": o.k_p,
        "K_D": o.k_d,
    }
    lines = [f"#define HOPOPT_{name} {value!r}" for name, value in sizes.items()]
    lines += [f"#define HOPOPT_{name} HOPOPT_R({value!r})" for name, value in figures.items()]
    shared = {"places": stance.places, "weights": stance.barycentric, "rest": tracker.rest}
    shared |= {name: tracker.drive.numbers[name] for name in LAW} | {"rotor": tracker.drive.rotor}
    shared["power"] = np.minimum(tracker.drive.numbers["power"], UNBOUNDED)
    lines += [_array(name, values) for name, values in shared.items()]
    for side, planes in bounds.items():  # (n, k, 2), the last repeated: that bounds nothing more
        joints = np.pad(planes, ((0, 0), (0, sizes["LINES"] - planes.shape[1]), (0, 0)), mode="edge").tolist()
        rows = ", ".join("{" + ", ".join(f"{{{c!r}, {d!r}}}" for c, d in joint) + "}" for joint in joints)
        lines.append(f"static const hopopt_real hopopt_{side}[HOPOPT_JOINTS][HOPOPT_LINES][2] = {{{rows}}};")
    for name, phase in _phases(tracker).items():
        at = knots(tracker.gains[name == STANCE], tolerance)
        lines.append(f"static const unsigned short hopopt_{name}_knot[] = {{{', '.join(map(str, at))}}};")
        columns = phase_columns(phase, tracker.gains[name == STANCE], at)
        lines += [_array(f"{name}_{column}", values) for column, values in columns.items()]
    return "\n".join(lines) + "\n"


def phase_columns(phase: PhaseReference, gains: Gains, at: np.ndarray) -> Mapping[str, np.ndarray]:
    """What the C code knows of a phase: t, q, v, tau and impulse [N m s] at the places, A, B, K, L of the periods ``at``."""
    return {
        **{name: getattr(phase, name) for name in ("t", "q", "v", "tau")},
        "impulse": phase.impulses[1],
        **{name: getattr(gains, name)[at] for name in "ABKL"},
    }


def _phases(tracker: Track) -> dict[str, PhaseReference]:
    return {STANCE: tracker.plan.stance, FLIGHT: tracker.plan.flight}


def _array(name: str, values: Iterable[float]) -> str:
    numbers = [repr(float(x)) for x in np.ravel(np.asarray(values))]
    rows = [", ".join(numbers[k : k + NUMBERS_ON_A_LINE]) for k in range(0, len(numbers), NUMBERS_ON_A_LINE)]
    return f"static const hopopt_real hopopt_{name}[] = {{\n" + ",\n".join(rows) + "};"
