"""User-defined objectives and path constraints: short Python functions of the leg at an instant.

An objective sees the end of the hop, or with ``running`` every instant of it, over which it is then integrated; a
constraint sees every instant. Both compute with CasADi expressions: no ``if`` on a value, no ``abs`` where it matters.
Only the command line and Python name such functions, never a problem file.
"""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, TypeVar

import casadi as ca
import numpy as np

from hopopt.design import Design
from hopopt.design.parameters import own_entry, own_numbers
from hopopt.errors import UsageError
from hopopt.extensions import function
from hopopt.leg.limit_id import Kind, LimitId
from hopopt.ocp.drives import changing
from hopopt.ocp.guesses.motion import MotionAt, MovingLeg
from hopopt.ocp.objectives.objective import AT_CLEARANCE, HopObjective
from hopopt.ocp.problem import INF, Ends, Instant, PathConstraint
from hopopt.ocp.rules import RULES, Rule, is_rule, named_constraints
from hopopt.user_code import copied, expressions, fault_of, last_line, load

CUSTOM_FIGURE = "user_objective"
CUSTOM_PHASES = ("stance", "flight")
Function = TypeVar("Function", bound=Callable[..., Any])  # the user's


@dataclass(frozen=True)
class Rates:
    """How fast accelerations, torques and forces of a moment change, each as there.

    a: rates of the accelerations (2 + n) [m/s^3, rad/s^3]
    tau: rates of the joint torques (n) [N m/s]
    f: rates of the ground force (2) [N/s]
    """

    a: Any
    tau: Any
    f: Any


@dataclass(frozen=True)
class Moment:
    """The whole leg at one instant, as CasADi expressions in SI units. At the end of the hop there is no a, tau or f.

    t: since the phase began [s]; at the end of the hop its whole duration
    phase: name of the phase
    q: place of the body x, z [m], then joint angles [rad], (2 + n)
    v: velocity of the body [m/s], then joint speeds [rad/s], (2 + n)
    points: name -> x, z (2) [m] of every joint, "foot" and "com"
    com_v: velocity of the centre of mass x, z (2) [m/s]
    a: acceleration of the body [m/s^2] and of the joints [rad/s^2], (2 + n)
    tau: joint torques (n) [N m]
    f: ground force x, z (2) [N], with y between them where the leg leaves the plane: f[-1] is its vertical part
    rates: how fast a, tau and f change, where the motors' torques are of limited rate
    lift_off: the last instant of stance, at the end of the hop
    p: numbers of the user's own by name, ``parameters`` of the problem [their units]
    """

    t: Any
    phase: str
    q: Any
    v: Any
    points: Mapping[str, Any]
    com_v: Any
    a: Any = None
    tau: Any = None
    f: Any = None
    rates: Any = None
    lift_off: "Moment | None" = None
    p: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Terms:
    """What a function is meant as; see ``objective`` and ``constraint``. A side that is not given is open."""

    unit: str = ""
    maximize: bool = True
    running: bool = False
    clearance: bool = False
    lower: float = -INF
    upper: float = INF
    scale: float = 1.0
    phases: tuple[str, ...] = CUSTOM_PHASES


def objective(
    *, unit: str = "", maximize: bool = True, running: bool = False, clearance: bool = False, scale: float = 1.0
) -> Callable[[Function], Function]:
    """Say of a function what objective it is.

    unit: of its value
    maximize: whether more is better
    running: whether it is a rate, to be integrated over the hop
    clearance: whether the hop must reach hop.clearance too
    scale: its magnitude [unit]
    """
    return _marked(Terms(unit, maximize, running, clearance, scale=scale))


def constraint(
    *, lower: float | None = None, upper: float | None = None, unit: str = "", scale: float = 1.0,
    phases: tuple[str, ...] = CUSTOM_PHASES,
) -> Callable[[Function], Function]:  # fmt: skip
    """Say of a function what path constraint it is. Without any bound, as without this, it must be at least 0.

    lower, upper: its bounds [unit]; where one is given, the other side is open
    unit: of its value
    scale: the size of its range [unit]
    phases: in which it holds
    """
    if lower is None:
        lower = 0.0 if upper is None else -INF
    return _marked(Terms(unit, lower=lower, upper=INF if upper is None else upper, scale=scale, phases=phases))


def _marked(terms: Terms) -> Callable[[Function], Function]:
    def mark(function: Function) -> Function:
        function.hopopt_terms = terms  # type: ignore[attr-defined]
        return function

    return mark


@dataclass(frozen=True)
class Custom:
    """A user-defined function with its name as ``module:function`` and what it is meant as."""

    name: str
    function: Callable[[Moment], Any] = field(repr=False)
    terms: Terms

    def __call__(self, moment: Moment, size: int | None = None) -> ca.SX:
        """The function's value as a column; UsageError, saying what is wrong, if it gives none."""
        try:
            value = self.function(copied(moment))
        except (Exception, SystemExit) as error:  # whatever the author's code raises
            raise UsageError(
                f"{self.name} stopped with {type(error).__name__}: {last_line(error)}{_hint(error)}"
            ) from error
        try:
            parts = value if isinstance(value, (list, tuple)) else [value]
            found = ca.vertcat(*[ca.vec(ca.SX(part)) for part in parts])
        except (NotImplementedError, TypeError, ValueError, RuntimeError):
            kind = type(value).__name__
            raise UsageError(
                f"{self.name} returned {kind}: a CasADi expression, or a list of them, is needed"
            ) from None
        if size is not None and found.numel() != size:
            raise UsageError(f"{self.name} returned {found.numel()} values: an objective is one number")
        if found.numel() == 0:
            raise UsageError(f"{self.name} returned nothing: a CasADi expression is needed")
        return found


def _hint(error: BaseException) -> str:
    if re.search(r"'NoneType' object has no attribute '(a|tau|f)'$", str(error)):
        return " (rates are there where no torque can jump: give leg.motor.torque_rate; and not at the end of the hop)"
    if "NoneType" in str(error):
        return " (a, tau and f are not there at the end of the hop: use objective(running=True))"
    if "__bool__" in str(error) or "truth value" in str(error).lower() or "nonzero" in str(error).lower():
        return " (a value is not known while the problem is made: no if, while, min or max on it; see casadi.if_else)"
    return ""


def custom(given: Any, name: str = "") -> Custom:
    """A function, its name ``module:function``, or a ``Custom``, as a ``Custom``; UsageError if it cannot be called.

    name: what it is called (default: module:function)
    """
    if isinstance(given, Custom):
        return given
    name = given if isinstance(given, str) else name
    found = load(given) if isinstance(given, str) else given
    if not callable(found):
        raise UsageError(f"{name or repr(found)} is not a function")
    name = name or f"{getattr(found, '__module__', '?')}:{getattr(found, '__qualname__', type(found).__name__)}"
    return Custom(name, found, getattr(found, "hopopt_terms", Terms(lower=0.0)))


def named_custom(design: Design) -> tuple[Custom, ...]:
    """The constraints that a problem names and that are functions of an instant."""
    names = (name for name in named_constraints(design) if not is_rule(name))
    return tuple(custom(function(name) if ":" in name else RULES[name], name) for name in names)


def as_rule(c: Custom) -> Rule:
    """A constraint that a problem names, as what holds in every phase of a kind."""
    return lambda leg, kind: path(c, leg, kind, leg.motion_in(kind))


def as_objective(given: Any) -> HopObjective:
    """A user-defined function as an objective of the hop."""
    c = custom(given)
    terms = c.terms
    more: dict[str, Any] = dict(AT_CLEARANCE) if terms.clearance else {"ends": "free"}
    if terms.running:
        more["integrands"] = lambda hop, motion: {"custom": lambda s: c(moment(hop, motion, s), 1)}

    def value(hop: MovingLeg, e: Ends) -> ca.SX:
        if terms.running:
            return sum((integrals["custom"] for integrals in e.integral.values()), ca.SX(0))
        return c(end(hop, e), 1)

    return HopObjective(
        c.name, f"a user-defined function, {c.name}", terms.unit, value, CUSTOM_FIGURE, maximize=terms.maximize,
        scale=lambda hop: terms.scale, custom=c, **more,
    )  # fmt: skip


def path(c: Custom, hop: MovingLeg, phase: str, motion: MotionAt) -> tuple[PathConstraint, ...]:
    """A user-defined function as a path constraint of one phase, if it holds there."""
    t = c.terms
    if phase not in t.phases:
        return ()
    limit = LimitId(Kind.USER, c.name, unit=t.unit)
    return (PathConstraint(limit, lambda s: c(moment(hop, motion, s)), t.lower, t.upper, t.scale, t.unit),)


def moment(hop: MovingLeg, motion: MotionAt, s: Instant) -> Moment:
    """The leg at an instant of a phase."""
    phase = "flight" if hasattr(s, "com") else "stance"

    def make() -> Moment:
        m = motion(s)
        points, com_v = _points(hop, s, m.q, m.v)
        rates = Rates(*(changing(hop, s, x) for x in (m.a, m.tau, m.f))) if hop.no_jumps else None
        return Moment(s.t, phase, m.q, m.v, points, com_v, m.a, m.tau, m.f, rates, p=_own(hop, s.p))

    return s.once("moment", make)


def end(hop: MovingLeg, e: Ends) -> Moment:
    """The leg when flight ends."""
    stance, flight = (e.final[phase] for phase in CUSTOM_PHASES)
    (q0, v0), (q1, v1) = hop.stance_pose(stance), hop.flight_pose(flight)
    lift_off = Moment(e.duration["stance"], "stance", q0, v0, *_points(hop, stance, q0, v0))
    whole = sum(e.duration.values(), ca.SX(0))
    return Moment(whole, "flight", q1, v1, *_points(hop, flight, q1, v1), lift_off=lift_off, p=_own(hop, e.p))


def _own(hop: MovingLeg, p: Mapping[str, Any]) -> dict[str, Any]:
    """The numbers of the user's own by name, as symbols."""
    return {name: p[own_entry(name)] for name in own_numbers(hop.design)}


def _points(hop: MovingLeg, s: Instant, q: ca.SX, v: ca.SX) -> tuple[dict[str, ca.SX], ca.SX]:
    """Points of the leg and the speed of its centre of mass, (2,)."""
    place, speed = ca.SX.sym("place", q.numel()), ca.SX.sym("speed", v.numel())
    com_v = ca.jtimes(hop.dynamics(s).points(place)["com"], place, speed)
    return hop.dynamics(s).points(q), ca.substitute(com_v, ca.vertcat(place, speed), ca.vertcat(q, v))


def checked(c: Custom, hop: MovingLeg, is_objective: bool) -> Custom:
    """The function, tried on symbols of the hop; UsageError if it does not give what it must, or nothing that moves."""
    at_end = is_objective and not c.terms.running
    own = own_numbers(hop.design)
    trial = symbols(hop.n, hop.robot.point_names, at_end, own, forces=hop.contact_axes, rates=hop.no_jumps)
    value = c(trial, 1 if is_objective else None)
    if not ca.symvar(value):
        raise UsageError(f"{c.name} does not depend on the hop: it returned {np.array(ca.DM(value)).ravel().tolist()}")
    if fault := fault_of(value, list(expressions(trial))):
        raise UsageError(f"{c.name} {fault}")
    if not set(c.terms.phases) <= set(CUSTOM_PHASES) or not c.terms.phases:
        raise UsageError(f"{c.name}: phases must be some of {', '.join(CUSTOM_PHASES)}")
    if not is_objective and np.isinf([c.terms.lower, c.terms.upper]).all():
        raise UsageError(f"{c.name} limits nothing: mark it as hopopt.constraint, with a lower or an upper bound")
    if not c.terms.lower <= c.terms.upper or not c.terms.scale > 0:
        raise UsageError(f"{c.name}: lower must not be above upper, and scale must be positive")
    return c


def symbols(
    n: int, names: tuple[str, ...], at_end: bool, p: Mapping[str, float], phase: str = "stance", forces: int = 2,
    rates: bool = False,
) -> Moment:  # fmt: skip
    """A moment made of free symbols, for a leg of n joints with points of these names; ``p``: numbers of the user's own;
    ``rates``: whether it has them."""

    def plain(phase: str, **more: Any) -> Moment:
        points = {name: ca.SX.sym(name, 2) for name in (*names, "com")}
        q, v, com_v = ca.SX.sym("q", n + 2), ca.SX.sym("v", n + 2), ca.SX.sym("com_v", 2)
        return Moment(ca.SX.sym("t"), phase, q, v, points, com_v, p=p, **more)

    if at_end:
        return plain("flight", lift_off=plain("stance"))
    sizes = {"a": n + 2, "tau": n, "f": forces}
    faster = Rates(**{name: ca.SX.sym(f"{name} rate", size) for name, size in sizes.items()}) if rates else None
    return plain(phase, **{name: ca.SX.sym(name, size) for name, size in sizes.items()}, rates=faster)
