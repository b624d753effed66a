"""The tracker of a plan as one C header without dependencies: the strategy ``track`` with its tables of numbers.

``tracker.h`` beside this file is the algorithm; here its tables are filled in. A test compiles it and compares it with
``control/tracking/track.py`` at every control instant of a simulated hop.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib.metadata import version
from importlib.resources import files

import numpy as np
from scipy.interpolate import BarycentricInterpolator

from hopopt.control.reference import EVENT_RESOLUTION, FLIGHT, STANCE, PhaseReference
from hopopt.control.tracking.regulator import Gains
from hopopt.control.tracking.track import EARLY_LIFT_OFF, Track
from hopopt.design import refuse_landed
from hopopt.drivetrain.drives import LAW
from hopopt.drivetrain.operating_region.half_planes import UNBOUNDED
from hopopt.drivetrain.transmission import cubics, numbers
from hopopt.errors import UsageError
from hopopt.export.plan import tracker_of
from hopopt.planner.reserve import TrackedPlan
from hopopt.verify.table import NORMALISED_TIMES

TABLES_MARK = "/* @TABLES@ */\n"
TIMES = len(NORMALISED_TIMES)  # places of every interval, for times and impulses
PLACES = (3, 4, 5, 7, TIMES)  # for angles and speeds: the fewest that move no torque
UNMOVED = 1e-4  # share of what a drive gives at standstill, by which a torque counts as not moved
TOLERANCES = (
    0.01,
    0.02,
    0.05,
)  # shares of the greatest, within which gains between knots are: the least with which they fit
MOST_BYTES = 128_000  # of constants: what a drive's microcontroller has room for beside all else
REAL_BYTES = 4  # of a number in single precision
NUMBERS_ON_A_LINE = 8  # numbers on a line


def to_c(plan: TrackedPlan) -> str:
    """The C header (C99, single precision, tgmath.h and string.h alone). Raises UsageError for a hop that lands once, for
    constants that do not fit, and as ``tracker_of`` does."""
    design = plan.motion.design
    if not design.hop.periodic:
        refuse_landed(design, "the tracker in C")
    return header(tracker_of(plan), design.name, design.leg.joints)


def header(tracker: Track, problem: str, joints: Sequence[str], tolerance: float | None = None) -> str:
    """The C header of a tracker, for the joints of a problem; tolerance of the gains between knots, as ``knots`` has it,
    None for the least with which the constants fit."""
    code = files("hopopt.export").joinpath("tracker.h").read_text(encoding="utf-8")
    found = fitting(tracker) if tolerance is None else Tables(tracker, tolerance, TIMES)
    title = (
        f"/* Tracks the plan of {problem}: joints {', '.join(joints)}; clearance {tracker.plan.clearance:.4f} m. Made by "
        f"hopopt {version('hopopt')}.\n   Call hopopt_reset before a hop and hopopt_torque once in every control "
        "period. SI units.\n   "
        f"About {constants_bytes(found.code) / 1000:.0f} kB of constants in single precision; gains between knots within "
        f"{found.tolerance:.0%} of their greatest.\n   Angles and speeds at {found.places} places of each interval move torques by {found.torque_error:.1e} of what the drives "
        "give at standstill at most,\n   single precision by less than 1e-3 of it. */\n"
    )
    before, after = code.split(TABLES_MARK)
    return title + before + found.code + after


def fitting(tracker: Track) -> "Tables":
    """The most exact tables that take MOST_BYTES at most; UsageError if there are none."""
    places = next(n for n in PLACES if Tables(tracker, TOLERANCES[0], n).torque_error <= UNMOVED)
    tried = [Tables(tracker, tolerance, places) for tolerance in TOLERANCES]
    if fits := next((found for found in tried if constants_bytes(found.code) <= MOST_BYTES), None):
        return fits
    raise UsageError(
        f"the tracker in C takes at least {constants_bytes(tried[-1].code) / 1000:.0f} kB of constants, more than the {MOST_BYTES / 1000:.0f} kB that a "
        "drive has room for: solve with a greater solver.tolerance, which leads to fewer intervals"
    )


def constants_bytes(code: str) -> int:
    """Bytes that the numbers of C tables take in single precision."""
    arrays = re.findall(r"static const hopopt_real [^=]*= (\{.*?\});", code, flags=re.DOTALL)
    return REAL_BYTES * sum(len(re.findall(r"[^\s,{}]+", array)) for array in arrays)


def knots(tracker: Track, contact: bool, tolerance: float) -> np.ndarray:
    """Control periods (k,) of a phase between which gains may be taken as linear: none is off by more than this share of the
    greatest in its row, for errors and torques that count alike."""
    gains, o, n = tracker.gains[contact], tracker.options, len(tracker.rest)
    error = np.repeat([o.angle, o.speed], n)
    effects = (
        (gains.A - np.eye(2 * n)) * error / error[:, None],
        gains.B * tracker.stall / error[:, None],
        gains.K * error,
        gains.L / error[:, None],
    )
    rows = [x / np.maximum(np.abs(x).max(axis=(0, 2), keepdims=True), 1e-300) for x in effects]
    numbers, found = np.hstack([x.reshape(len(x), -1) for x in rows]), [0]
    while found[-1] < len(numbers) - 1:
        begin, step = found[-1], 1
        while begin + step + 1 < len(numbers) and _straight(numbers[begin : begin + step + 2], tolerance):
            step += 1
        found.append(begin + step)
    return np.array(found)


def _straight(rows: np.ndarray, tolerance: float) -> bool:
    along = np.linspace(0.0, 1.0, len(rows))[:, None]
    return bool(np.abs(rows[0] + along * (rows[-1] - rows[0]) - rows).max() <= tolerance)


@dataclass(frozen=True)
class Tables:
    """All numbers of a tracker as C constants.

    tolerance: share of their greatest, within which gains between knots are
    places: in every interval, of angles and speeds
    """

    tracker: Track
    tolerance: float
    places: int

    @cached_property
    def phases(self) -> dict[str, "PhaseTables"]:
        """By name of the phase."""
        t = self.tracker
        return {
            name: PhaseTables(phase, t.gains[name == STANCE], self.places)
            for name, phase in ((STANCE, t.plan.stance), (FLIGHT, t.plan.flight))
        }

    @property
    def torque_error(self) -> float:
        """By how much fewer places move a torque at most, of what its drive gives at standstill."""
        period, stall = self.tracker.period, self.tracker.stall
        return max(float((phase.torque_errors(period) / stall).max()) for phase in self.phases.values())

    @cached_property
    def code(self) -> str:
        """Raises UsageError for gears whose law the C code does not have."""
        tracker = self.tracker
        turning = tracker.drive.turning
        if turning and turning.leg.five_bars:
            raise UsageError(
                "the tracker in C knows belts and ratios by a joint's own angle, and no five-bars: leave those out"
            )
        if tracker.drive.gear.tabled:
            raise UsageError(
                "the tracker in C knows one efficiency for each gear: give leg.gear.efficiency, not its table"
            )
        o, n, plan = tracker.options, len(tracker.rest), self.phases[STANCE].plan
        bounds = {"upper": tracker.drive.upper, "lower": tracker.drive.lower}
        sizes = {
            "JOINTS": n,
            "TIMES": TIMES,
            "PLACES": self.places,
            "LINES": max(planes.shape[1] for planes in bounds.values()),
        }
        sizes |= {"REPEATS": int(tracker.plan.repeats), "COUPLED": int(turning is not None)}
        at = {name: knots(tracker, name == STANCE, self.tolerance) for name in self.phases}
        for name, phase in self.phases.items():
            sizes |= {f"{name.upper()}_INTERVALS": len(phase.plan.t), f"{name.upper()}_KNOTS": len(at[name])}
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
        shared = {"places": plan.places, "weights": plan.barycentric, "rest": tracker.rest}
        shared |= {name: tracker.drive.numbers[name] for name in LAW} | {"rotor": tracker.drive.rotor}
        shared["power"] = np.minimum(tracker.drive.numbers["power"], UNBOUNDED)
        if turning:
            laws = [cubics(turning.leg, joint, turning.p) for joint in turning.leg.joints]
            begins = np.cumsum([0, *(len(angle) for angle, _, _ in laws)])
            lines.append(f"static const unsigned short hopopt_law[] = {{{', '.join(map(str, begins))}}};")
            parts = ("angle", "ratio", "slope"), map(np.concatenate, zip(*laws, strict=True))
            shared |= {f"law_{name}": values for name, values in zip(*parts, strict=True)}
            coupling = numbers(turning.leg, turning.p)["coupling"]
            shared |= {"coupling": coupling, "housings": turning.housings}
        lines += [_array(name, values) for name, values in shared.items()]
        for side, planes in bounds.items():  # (n, k, 2), the last repeated: that bounds nothing more
            joints = np.pad(planes, ((0, 0), (0, sizes["LINES"] - planes.shape[1]), (0, 0)), mode="edge").tolist()
            rows = ", ".join("{" + ", ".join(f"{{{_real(c)}, {_real(d)}}}" for c, d in joint) + "}" for joint in joints)
            lines.append(f"static const hopopt_real hopopt_{side}[HOPOPT_JOINTS][HOPOPT_LINES][2] = {{{rows}}};")
        for name, phase in self.phases.items():
            lines.append(f"static const unsigned short hopopt_{name}_knot[] = {{{', '.join(map(str, at[name]))}}};")
            lines += [_array(f"{name}_{column}", values) for column, values in phase.columns(at[name]).items()]
        return "\n".join(lines) + "\n"


@dataclass(frozen=True)
class PhaseTables:
    """What the C code knows of a phase: angles and speeds at some places of every interval, and the gains."""

    phase: PhaseReference
    gains: Gains
    places: int

    @cached_property
    def plan(self) -> PhaseReference:
        """The phase at that many places."""
        if self.places == len(self.phase.places):
            return self.phase
        at = 0.5 - 0.5 * np.cos(np.pi * np.arange(self.places) / (self.places - 1))
        basis = BarycentricInterpolator(self.phase.places, np.eye(len(self.phase.places)))(at)
        arrays = {
            name: np.einsum("pk,nk...->np...", basis, getattr(self.phase, name)) for name in ("t", "q", "v", "tau")
        }
        return PhaseReference(at, **arrays)

    def columns(self, at: np.ndarray) -> Mapping[str, np.ndarray]:
        """Times and impulses [N m s], angles and speeds, torques at both ends, A, B, K, L of the periods ``at``."""
        return {
            "t": self.phase.t,
            "impulse": self.phase.impulses[1],
            "q": self.plan.q,
            "v": self.plan.v,
            "begins": self.phase.tau[0, 0],
            "ends": self.phase.tau[-1, -1],
            **{name: getattr(self.gains, name)[at] for name in "ABKL"},
        }

    def torque_errors(self, period: float) -> np.ndarray:
        """By how much the feedback on what angles and speeds are off moves each torque at most, (n) [N m]."""
        off = [
            np.hstack(self.plan.at(k * period)[:2]) - np.hstack(self.phase.at(k * period)[:2])
            for k in range(len(self.gains.K))
        ]
        moved: np.ndarray = np.abs(np.einsum("knm,km->kn", self.gains.K, np.array(off))).max(axis=0)
        return moved


def _array(name: str, values: Iterable[float]) -> str:
    numbers = [_real(x) for x in np.ravel(np.asarray(values))]
    rows = [", ".join(numbers[k : k + NUMBERS_ON_A_LINE]) for k in range(0, len(numbers), NUMBERS_ON_A_LINE)]
    return f"static const hopopt_real hopopt_{name}[] = {{\n" + ",\n".join(rows) + "};"


def _real(x: float) -> str:
    """A number as C has it in either precision."""
    return f"HOPOPT_R({float(x)!r})"
