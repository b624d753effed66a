"""The parameters of a real leg from logs of its hops: least squares through the model, with 95 % intervals.

``identification_rows`` has the equations, ``identification_fit`` their weighted least squares. An interval is the wider of
two: from the covariance that the sensors' noise gives, and from the residuals themselves. Its quantile is Student's, for a
short log tells variances poorly.

What the data cannot tell is found in two ways. By what was logged: without a measured force, nothing tells masses, rotor
inertia, friction and torque constant from a common factor; without a drive at its torque-speed line, nothing tells the
no-load speed. And by the interval: a parameter whose interval is wider than ``TOLD`` either way keeps the problem's value.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from itertools import combinations
from typing import Any

import numpy as np
from scipy import stats

from hopopt.design import Design
from hopopt.drivetrain.dynamics import refuse_series_springs
from hopopt.errors import ResultError, UsageError
from hopopt.leg.kinematics import planar
from hopopt.problem.load import changed
from hopopt.problem.render import printable, resolved_toml
from hopopt.robot_data.identification_fit import NOT_THIS_LEG, TOO_LITTLE, Regression, WeightedFit
from hopopt.robot_data.identification_parameters import Unknown, changed_by, unknowns_of
from hopopt.robot_data.identification_rows import LogRows, places
from hopopt.robot_data.leg_momenta import LegMomenta
from hopopt.robot_data.robot_log import RobotLog, same_run

CONFIDENCE = 0.95  # of the intervals
TOLD = 0.1  # of a parameter by which its interval may reach to either side
NOTICED = 0.02  # of the logged torque that friction, damping or rotor inertia take where their share counts
UNEXPLAINED = 0.2  # of the logged torque, root mean square, above which it is not this leg's
STRANGE = 3.0  # factor between a mass or torque constant and the problem's, beyond which units are wrong
CORRELATED = 0.9  # correlation of two parameters above which one is named as the other's excuse
# Kinds that a common factor may change without a measured force:
SCALED = ("mass", "rotor", "gain", "friction", "damping")
GIVEN = "given as known"


@dataclass(frozen=True)
class ParameterEstimate:
    """A parameter as the logs tell it: value and 95 % interval in ``unit``, whether it is identified, and if not, why; what is
    not identified keeps the problem's value, and has no interval where there is none."""

    key: str
    unit: str
    believed: float
    value: float
    low: float | None
    high: float | None
    identified: bool
    why: str = ""


@dataclass(frozen=True)
class Identification:
    """What logs tell of a leg.

    design: the believed problem
    estimates: of every parameter, with its interval
    noise: standard deviation of each sensor's noise [SI]
    lags: of torque and force behind the angles, and how much greater those are at a drive's line [s]
    """

    design: Design
    estimates: tuple[ParameterEstimate, ...]
    noise: dict[str, float]
    lags: dict[str, float]

    def __repr__(self) -> str:
        found = sum(e.identified for e in self.estimates)
        return f"<Identification of {self.design.name}: {found} of {len(self.estimates)} parameters identified>"

    def as_dict(self) -> dict[str, Any]:
        """Everything in numbers, for ``--json``."""
        parameters = {e.key: {k: v for k, v in asdict(e).items() if k != "key"} for e in self.estimates}
        return {"problem": self.design.name, "parameters": parameters, "noise": self.noise, "lags_s": self.lags}

    @property
    def identified(self) -> Design:
        """The problem with what was identified."""
        return changed(self.design, self._entries()[0])

    def problem_file(self, logs: Sequence[str]) -> str:
        """The identified problem as a file that ``load`` reads, with its source in comments."""
        entries, sources = self._entries()
        source = f"identified from {', '.join(logs)}"
        notes = {path: f"{source}, {words}" for path, words in sources.items()}
        head = [f"The problem {self.design.name} with what hopopt identify found in {', '.join(logs)}."]
        head += [f"Not identified: {e.key}: {e.why}." for e in self.estimates if not e.identified]
        return "".join(f"# {printable(line)}\n" for line in head) + resolved_toml(changed(self.design, entries), notes)

    def _entries(self) -> tuple[dict[str, Any], dict[str, str]]:
        """Entries of the problem to replace, and where each is from."""
        entries: dict[str, Any] = {}
        sources: dict[str, str] = {}
        unknowns = {u.key: u for u in unknowns_of(self.design)}
        for e in self.estimates:
            if e.identified and e.why != GIVEN:
                own = dict(changed_by(self.design, unknowns[e.key], float(f"{e.value:.6g}")))
                entries |= own
                sources |= dict.fromkeys(own, f"95 %: {e.key} {e.low:.5g} to {e.high:.5g}")
        return entries, sources


def identify(design: Design, logs: Sequence[RobotLog], known: Sequence[str] = ()) -> Identification:
    """The parameters of a leg from logs of its hops.

    design: what is believed of the leg
    logs: of the same leg
    known: keys of parameters that are taken from the problem

    Raises UsageError for a leg that is not on x and z guides in their plane, and an unknown key; ResultError for logs that are
    not of this leg, and for a run that is given twice.
    """
    if not planar(design.leg) or "x" not in design.leg.guides:
        raise UsageError(
            f"{design.name}: only legs on x and z guides whose joints all turn about the y axis are identified"
        )
    refuse_series_springs(design.leg, "identification")
    if not design.leg.direct:
        raise UsageError(
            f"{design.name}: legs are identified whose drives turn as their joints do: leave out transmissions"
        )
    if design.leg.follows or design.leg.sliding:
        raise UsageError(
            f"{design.name}: legs are identified all of whose joints turn and have drives: leave out the others"
        )
    unknowns = unknowns_of(design)
    wrong = [key for key in known if key not in [u.key for u in unknowns]]
    if wrong:
        raise UsageError(f"--known {wrong[0]}: it is none of {', '.join(u.key for u in unknowns)}")
    for (a, one), (b, other) in combinations(enumerate(logs, 1), 2):
        if same_run(one, other):
            raise ResultError(f"logs {a} and {b} are of one run, which would count twice: give it once")
    momenta = LegMomenta(design)
    rows = [r for r in (LogRows(design, momenta, log) for log in logs) if r.count]
    if not rows:
        raise ResultError(TOO_LITTLE)
    untold = _structural(unknowns, rows, known)
    forced = any(r.axes and r.standing.count for r in rows)  # which fixes the factor that the SCALED have in common
    anchored = forced or any(u.key in known for u in unknowns if u.kind in SCALED)
    anchor = None if anchored else next(u.key for u in unknowns if u.kind == "gain")
    free = [u for u in unknowns if u.key not in {*known, *untold, anchor}]
    lags = ["lag", *(["force_lag"] if forced else [])]
    if any(r.ramps.any() for r in rows):
        lags += ["ramp_lag", *(["force_ramp_lag"] if forced else [])]
    fixed, columns = _vectors(design, unknowns, free, lags)
    period = float(max(np.median(np.diff(log.t)) for log in logs))
    about = np.array([*(np.inf for _ in free), *(period if "ramp" in name else np.inf for name in lags)])
    regression = Regression(rows, fixed, columns, about)
    fit = regression.fit(np.array([*(u.believed for u in free), *(0.0 for _ in lags)]))
    _credible(free, fit, regression, anchored)
    places_of = {u.key: k for k, u in enumerate(free)}
    found = []
    for u in unknowns:
        if u.key in known:
            found.append(_kept(u, GIVEN, True))
        elif anchor is not None and u.kind in SCALED:
            value = f"{fit.theta[places_of[u.key]]:.4g} {u.unit}" if u.key in places_of else ""
            found.append(_kept(u, _one_of_many(u, anchor, value)))
        elif u.key in untold:
            found.append(_kept(u, untold[u.key]))
        else:
            found.append(_estimate(u, fit, places_of[u.key], free, rows))
    noise = {_sensor(design, name): float(np.sqrt(x)) for name, x in fit.variances.items()}
    late = {name: float(x) for name, x in zip(lags, fit.theta[len(free) :], strict=True)}
    return Identification(design, tuple(found), noise, late)


def _kept(u: Unknown, why: str, identified: bool = False) -> ParameterEstimate:
    """A parameter that keeps the problem's value."""
    return ParameterEstimate(u.key, u.unit, u.believed, u.believed, None, None, identified, why)


def _one_of_many(u: Unknown, anchor: str, value: str) -> str:
    """Why a parameter that a common factor may change is not told; value: what it is if the torque constant is right."""
    if u.key == anchor or not value:
        return "without force_z, masses, rotor inertia, friction and torque constant times any factor fit as well"
    return f"without force_z only its ratio to the torque constant shows: {value} with --known {anchor}"


def _sensor(design: Design, name: str) -> str:
    """A sensor's column of the log."""
    kind, number = name[:-1], int(name[-1])
    return f"force_{'xz'[number]}" if kind == "force" else f"{kind}_{design.leg.joints[number]}"


def _structural(unknowns: Sequence[Unknown], rows: Sequence[LogRows], known: Sequence[str]) -> dict[str, str]:
    """What no row depends on, by what was logged: key -> why."""
    found = {}
    for u in unknowns:
        seen = any(r.joints[k].count for r in rows for k in u.joints)
        saturated = any(r.saturated[k].count for r in rows for k in u.joints)
        commanded = any(np.isfinite(r.s.command[:, k]).any() for r in rows for k in u.joints)
        if u.key in known:
            continue
        if u.kind == "speed" and not commanded:
            found[u.key] = "no column command_JOINT shows where a drive gives less than it is asked for"
        elif u.kind == "speed" and not saturated:
            found[u.key] = "no drive gives less than its command for long enough"
        elif u.kind != "speed" and not seen:
            found[u.key] = "its joint hardly moves"
    return found


def _vectors(
    design: Design, unknowns: Sequence[Unknown], free: Sequence[Unknown], lags: Sequence[str]
) -> tuple[np.ndarray, np.ndarray]:
    """The vector of unknown values at theta = 0, and its derivatives by theta: the free parameters, then the lags."""
    at, leg = places(len(design.leg.joints)), design.leg
    fixed = np.zeros(at["end"])
    for k, joint in enumerate(leg.joints):
        turning = leg.drive(joint, "gear", "inertia")[1] or 0.0
        fixed[at["rotor"] + k] = turning * leg.drive(joint, "gear", "ratio")[1] ** 2
    keys = [u.key for u in free]
    fixed += sum((u.believed * u.column for u in unknowns if u.key not in keys), np.zeros(at["end"]))
    late = np.eye(at["end"])[[at[name] for name in lags]]
    return fixed, np.vstack([*(u.column for u in free), *late]).T


def _credible(free: Sequence[Unknown], fit: WeightedFit, regression: Regression, anchored: bool) -> None:
    """ResultError where the fit does not explain the logs, or says what no leg is like."""
    blocks = [b for r in regression.rows for b in r.blocks(regression.fixed + regression.columns @ fit.theta)]
    for kind in sorted({b.kind for b in blocks}):
        e, logged = (np.concatenate([getattr(b, name) for b in blocks if b.kind == kind]) for name in ("e", "logged"))
        if kind.startswith("tau") and np.sqrt(np.mean(e**2)) > UNEXPLAINED * np.sqrt(np.mean(logged**2)):
            raise ResultError(NOT_THIS_LEG)
    for u, value, error in zip(free, fit.theta, fit.errors, strict=False):
        sure = error < TOLD * abs(value)
        if anchored and u.kind in ("mass", "gain") and sure and not 1 / STRANGE < value / u.believed < STRANGE:
            unit = "" if u.unit == "1" else f" {u.unit}"
            raise ResultError(
                f"{u.key} would be {value:.3g}{unit}, the problem says {u.believed:.3g}: is tau that of the joint, before its "
                "gear's losses, in N m, is force_z in N, or are torque columns swapped?"
            )


def _estimate(
    u: Unknown, fit: WeightedFit, k: int, free: Sequence[Unknown], rows: Sequence[LogRows]
) -> ParameterEstimate:
    """A parameter with its interval; the problem's value, and why, where that is too wide."""
    value, error = float(fit.theta[k]), float(fit.errors[k])
    reach = error * float(stats.t.ppf(0.5 + CONFIDENCE / 2, fit.freedom[k]))
    lowest, highest = (
        (-np.inf if u.kind in ("mass", "gain", "speed") else 0.0),
        (1.0 if u.kind == "efficiency" else np.inf),
    )
    low, high = (float(np.clip(x, lowest, highest)) for x in (value - reach, value + reach))
    if reach <= TOLD * max(abs(value), _least(u, rows)):
        return ParameterEstimate(u.key, u.unit, u.believed, float(np.clip(value, lowest, highest)), low, high, True)
    why = f"its 95 % interval is {low:.3g} to {high:.3g} {u.unit}: these motions tell no more"
    spread = np.sqrt(np.diag(fit.covariance))
    alike = np.abs(fit.covariance[k] / spread[k] / spread)[: len(free)] * (np.arange(len(free)) != k)
    if alike.max(initial=0.0) > CORRELATED:
        why = f"{why.partition(':')[0]}: it can hardly be told from {free[int(np.argmax(alike))].key}"
    return ParameterEstimate(u.key, u.unit, u.believed, u.believed, low, high, False, why)


def _least(u: Unknown, rows: Sequence[LogRows]) -> float:
    """The size of a parameter that takes ``NOTICED`` of the logged torque; for others nothing."""
    k = u.joints[0]
    torque = NOTICED * np.sqrt(np.mean([np.mean(r.s.tau[:, k] ** 2) for r in rows]))
    if u.kind == "friction":
        return float(torque)
    if u.kind == "damping":
        return float(torque / max(np.sqrt(np.mean([np.mean(r.s.v[:, k] ** 2) for r in rows])), 1e-9))
    if u.kind == "rotor":
        rate = np.sqrt(np.mean([np.mean((r.s.D @ r.s.v[:, k]) ** 2) for r in rows]))
        return float(torque / max(rate, 1e-9) / rows[0].ratio[k] ** 2)
    return 0.0
