"""A multi-phase optimal control problem, stated at instants: no nodes, no solver, no legs.

Phases run one after another; each has its own states, controls, differential equations and duration. Every
function below takes an ``Instant`` (or the ``Ends`` of all phases) and returns CasADi expressions.
"""

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import SimpleNamespace
from typing import Any

import casadi as ca
import numpy as np

from hopopt.ocp.objectives.direction import Directed

INF = float("inf")
Numbers = float | Sequence[float] | np.ndarray


class Instant(SimpleNamespace):
    """Symbols at one instant of a phase: one attribute for each state and control, ``t`` [s] since the phase
    began, and ``p``: parameter name -> symbol. ``once`` keeps what several functions of an instant share."""

    t: Any
    p: Mapping[str, Any]

    def once(self, name: str, make: Callable[[], Any]) -> Any:
        """The value called ``name``, made at its first use."""
        kept = self.__dict__.setdefault("_kept", {})
        if name not in kept:
            kept[name] = make()
        return kept[name]


@dataclass(frozen=True)
class Component:
    """One row of a constraint or component of a variable, told from all others.

    of: the constraint or variable, by its name or a typed identity.
    label: which component; "" if there is but one.
    """

    of: Hashable
    label: Hashable = ""

    def __str__(self) -> str:
        return str(self.of) if self.label == "" else f"{self.of}[{self.label}]"


def components(of: Hashable, size: int, labels: Sequence[Hashable]) -> tuple[Component, ...]:
    """The ``size`` components of a constraint or variable: by their labels, else by number."""
    if size == 1 and not labels:
        return (Component(of),)
    return tuple(Component(of, label) for label in labels or [str(k) for k in range(size)])


@dataclass(frozen=True)
class Variable:
    """A state, control or parameter of ``size`` components; bounds and scale broadcast over them."""

    name: str
    size: int = 1
    lower: Numbers = -INF
    upper: Numbers = INF
    scale: Numbers = 1.0
    unit: str = ""
    labels: tuple[str, ...] = ()

    def column(self, what: str) -> np.ndarray:
        """``lower``, ``upper`` or ``scale`` as an array of shape (size,)."""
        return np.broadcast_to(np.asarray(getattr(self, what), dtype=float), (self.size,)).copy()

    def components(self) -> tuple[Component, ...]:
        """Its components; as text, ``q[hip]`` or just ``u``."""
        return components(self.name, self.size, self.labels)


@dataclass(frozen=True)
class Control(Variable):
    """A control; ``only_bounds``: it moves nothing, but bounds a quantity of the motion from above."""

    only_bounds: bool = False


@dataclass(frozen=True)
class State(Variable):
    """A state; ``initial`` and ``final`` are None (free), values (a number, list or array), or two lists or arrays
    (lower, upper). sharp: over which range about zero what depends on it changes sharply, 0 where nothing does. TypeError
    for a tuple of numbers, which might be either."""

    initial: Numbers | tuple[Numbers, Numbers] | None = None
    final: Numbers | tuple[Numbers, Numbers] | None = None
    sharp: Numbers = 0.0

    def __post_init__(self) -> None:
        for given in (self.initial, self.final):
            if isinstance(given, tuple) and [np.ndim(side) for side in given] != [1, 1]:
                raise TypeError(
                    f"{self.name} = {given}: write values as a list, bounds as two lists ([lower], [upper])"
                )

    def end_bounds(self, end: str) -> tuple[np.ndarray, np.ndarray]:
        """Bounds at the ``initial`` or ``final`` instant, within the state's own bounds, (size,) each."""
        given, lower, upper = getattr(self, end), self.column("lower"), self.column("upper")
        if given is None:
            return lower, upper
        low, high = given if isinstance(given, tuple) else (given, given)
        return np.maximum(lower, low), np.minimum(upper, high)


@dataclass(frozen=True)
class Parameter(Variable):
    """A number that does not change with time: fixed at ``value``, or a decision within bounds if ``free``."""

    value: Numbers = 0.0
    free: bool = False


@dataclass(frozen=True)
class PathConstraint:
    """lower <= value(instant) <= upper throughout a phase.

    name: a text, or an identity whose text it is.
    scale: the size of its range, for accuracy.
    labels: which component is which.
    smooth: whether it is like a polynomial over an interval, so that it may be enforced between the nodes; one that is not
    is met between them by a finer mesh.
    """

    name: Hashable
    value: Callable[[Instant], Any]
    lower: Numbers = -INF
    upper: Numbers = INF
    scale: Numbers = 1.0
    unit: str = ""
    labels: tuple[Hashable, ...] = ()
    smooth: bool = True


@dataclass(frozen=True)
class Ends:
    """What boundary constraints and the objective may depend on, for each phase by name."""

    initial: Mapping[str, Instant]
    final: Mapping[str, Instant]
    duration: Mapping[str, Any]
    integral: Mapping[str, Mapping[str, Any]]
    p: Mapping[str, Any]


@dataclass(frozen=True)
class BoundaryConstraint:
    """lower <= value(ends) <= upper.

    name, scale and labels: as of a path constraint.
    joins: it is no limit, but what one phase hands to the next.
    """

    name: Hashable
    value: Callable[[Ends], Any]
    lower: Numbers = 0.0
    upper: Numbers = 0.0
    scale: Numbers = 1.0
    unit: str = ""
    labels: tuple[Hashable, ...] = ()
    joins: bool = False


def linkage(name: str, value: Callable[[Ends], Any], scale: Numbers = 1.0, **more: Any) -> BoundaryConstraint:
    """value(ends) = 0, what one phase hands to the next."""
    return BoundaryConstraint(name, value, 0.0, 0.0, scale, joins=True, **more)


@dataclass(frozen=True)
class Objective(Directed):
    """What is made as small (or, with ``maximize``, as large) as possible; ``scale`` is its magnitude.

    tie_break: integrals, by name, that ``value`` is made worse by, and their weights [unit per the integral's]
    """

    name: str
    value: Callable[[Ends], Any]
    maximize: bool = False
    unit: str = ""
    scale: float = 1.0
    tie_break: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Phase:
    """states' = dynamics(instant), with path constraints, integrals of ``integrands`` and a bounded duration.

    dynamics returns {state name: derivative}; outputs are further quantities worth reporting over time.
    long: the scale of its duration where it may last longer than this [s].
    """

    name: str
    states: tuple[State, ...]
    controls: tuple[Control, ...]
    dynamics: Callable[[Instant], Mapping[str, Any]]
    duration: tuple[float, float]
    path: tuple[PathConstraint, ...] = ()
    integrands: Mapping[str, Callable[[Instant], Any]] = field(default_factory=dict)
    long: float = 1.0

    @property
    def duration_scale(self) -> float:
        """Scale of its duration [s]."""
        return min(self.duration[1], self.long)

    def columns(self, group: Sequence[Variable], what: str) -> np.ndarray:
        """``lower``, ``upper`` or ``scale`` of all states (or controls), stacked."""
        return np.concatenate([v.column(what) for v in group]) if group else np.zeros(0)


@dataclass(frozen=True)
class Gentler:
    """A problem without the sharp bends of another: how gently it bends is a fixed parameter more, with which at 1 it is the other.

    make: makes it; number: that parameter's name; values: from which it is led towards 1, the gentlest first
    """

    make: "Callable[[], Problem]"
    number: str
    values: tuple[float, ...]


@dataclass(frozen=True)
class Problem:
    """A whole multi-phase problem; phases in the order in which they run.

    solver_options: what the problem asks of every solver of it, by CasADi's names
    gentler: one that is easier to solve, by way of which a finer mesh is solved where the last one's solution does not lead to
        its own
    """

    name: str
    phases: tuple[Phase, ...]
    objective: Objective
    parameters: tuple[Parameter, ...] = ()
    boundary: tuple[BoundaryConstraint, ...] = ()
    solver_options: Mapping[str, Any] = field(default_factory=dict)
    gentler: Gentler | None = field(default=None, repr=False, compare=False)
    kept: dict[Any, Any] = field(default_factory=dict, init=False, repr=False, compare=False)

    def once(self, name: Any, make: Callable[[], Any]) -> Any:
        """The value called ``name``, made at its first use: what all meshes of the problem share."""
        if name not in self.kept:
            self.kept[name] = make()
        return self.kept[name]

    def towards(self, objective: Objective) -> "Problem":
        """The same with another objective; what was made of its phases, which is named (what, phase), is shared."""
        other = replace(self, objective=objective, gentler=None)
        other.kept.update({name: value for name, value in self.kept.items() if isinstance(name, tuple)})
        return other

    def phase(self, name: str) -> Phase:
        """The phase of that name; KeyError if there is none."""
        return {p.name: p for p in self.phases}[name]


def split(group: Sequence[Variable], stacked: Any) -> dict[str, Any]:
    """Rows of a stacked array or expression, by variable name."""
    parts, row = {}, 0
    for variable in group:
        parts[variable.name] = stacked[row : row + variable.size]
        row += variable.size
    return parts


def symbols(group: Sequence[Variable]) -> dict[str, ca.SX]:
    """One SX symbol for each variable."""
    return {v.name: ca.SX.sym(v.name, v.size) for v in group}


def stack(parts: Mapping[str, Any], group: Sequence[Variable]) -> ca.SX:
    """The inverse of ``split``: expressions in the order of the variables."""
    return ca.vertcat(*[parts[v.name] for v in group])
