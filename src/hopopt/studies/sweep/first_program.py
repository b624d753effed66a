"""The first mesh's program of a study's points, compiled once for all that share it, and optima on it as neighbours keep them."""

import time
from collections.abc import Iterable, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from hopopt.design import Design
from hopopt.design.parameters import variable_numbers
from hopopt.errors import ProblemFileError
from hopopt.leg.geometry.solids import has_shape
from hopopt.nlp.deadline import NEVER, Deadline
from hopopt.nlp.solver.compiled import compiling
from hopopt.nlp.solver.ipopt import CARRIED, NlpSolver
from hopopt.nlp.solver.known_optima import KnownOptima
from hopopt.nlp.solver.reuse import with_numbers_of
from hopopt.nlp.transcription import Transcription
from hopopt.ocp.hop import Hop
from hopopt.planner.search.multistart import StartOutcome, first_transcription, outcome_of, watch_on
from hopopt.studies.sweep.definition import Definition

NEIGHBOUR_ITERATIONS = 60  # iterations from a neighbour's multipliers
FRACTIONS = np.linspace(0.0, 1.0, 9)  # of each phase, where its shape is taken

Begin = Mapping[str, np.ndarray]  # what a neighbour begins from
KEPT_PROGRAMS = 2  # of the first mesh, by a process: for neighbours, and for starts
OTHER = "other-{}.{}"  # name of an array of another kind of optimum than the best, in a Begin
FROM_NEIGHBOUR = CARRIED | {"ipopt.max_iter": NEIGHBOUR_ITERATIONS}

_compiled: dict[str, tuple[Hop, Transcription, NlpSolver]] = {}  # this process's last programs of the first mesh


@dataclass(frozen=True)
class Neighbour:
    """A neighbour to begin from: its index, the pass its solution is of, and that solution."""

    index: int
    solved_in: int
    begin: Begin


def first_program(
    definition: Definition, hop: Hop, values: Mapping[str, float], until: Deadline,
    options: Mapping[str, Any] = FROM_NEIGHBOUR, watching: type[KnownOptima] = KnownOptima,
) -> tuple[Transcription, NlpSolver]:  # fmt: skip
    """The first mesh's program of a point, compiled once for all points that differ in numbers of leg and start, with Ipopt's
    ``options``, and ``watching`` it.

    It is compiled, and scaled, for the study's own problem, so that no point's answer depends on another's.
    """
    own, at = (_formative(design, values) for design in (definition.design, hop.design))
    form = {
        entry: values[entry] for entry in dict.fromkeys([*own, *at])
    }  # what the study's problem does not state, too
    key = repr((definition.as_dict(), form, options, watching.__name__))
    if key not in _compiled:
        while len(_compiled) >= KEPT_PROGRAMS:
            del _compiled[next(iter(_compiled))]
        try:
            _compiled[key] = _ready(Hop(definition.design_with(form), definition.objective), NEVER, options, watching)
        except ProblemFileError:  # only its points are possible
            return _ready(hop, until, options, watching)[1:]
    common, t, solver = _compiled[key]
    # which joints a closed loop moves is form too, and so is the tie-break's weight
    if common.dependent != hop.dependent or common.reverses != hop.reverses:
        return _ready(hop, until, options, watching)[1:]
    t = with_numbers_of(t, hop.problem)
    return t, solver.on(t, until)


def _ready(
    hop: Hop, until: Deadline, options: Mapping[str, Any], watching: type[KnownOptima]
) -> tuple[Hop, Transcription, NlpSolver]:
    """A problem with its first mesh's program, to be solved with Ipopt's options."""
    t = first_transcription(hop)
    return hop, t, NlpSolver(t, options, watch_on(t, watching), until)


def compiling_shared(definition: Definition) -> AbstractContextManager[None]:
    """Derivatives are compiled where all points share them: where numbers of the leg and its start alone are varied."""
    return nullcontext() if formative_entries(definition) else compiling()


def formative_entries(definition: Definition) -> list[str]:
    """The varied entries that change a program's form or bounds, so that it is built anew for each of their values."""
    return _formative(definition.design, (axis.entry for axis in definition.axes))


def _formative(design: Design, entries: Iterable[str]) -> list[str]:
    """Those of the entries that are not just numbers of a program, but change its form or its bounds: of a leg with shapes
    its lengths and start too, on which its distances depend."""
    numbers = variable_numbers(design)
    if has_shape(design.leg):
        numbers = {entry: value for entry, value in numbers.items() if not entry.endswith(".length")}
        return [entry for entry in entries if entry not in numbers]
    return [entry for entry in entries if entry not in numbers and not entry.startswith("start.")]


def from_neighbour(hop: Hop, t: Transcription, solver: NlpSolver, source: Neighbour) -> StartOutcome:
    """The first mesh's program from a neighbour's optimum: with its multipliers, else without."""
    began, name, begin = time.perf_counter(), f"point {source.index}", source.begin
    multipliers = (begin["lam_g"], begin["lam_x"]) if "lam_g" in begin else None  # a map keeps none
    if len(begin["x"]) != len(t.scale) or (multipliers and len(multipliers[0]) != len(t.lbg)):  # another mesh or limits
        return StartOutcome(name, "does not fit", False, 0.0, 0, 0.0, {})
    z = begin["x"] / t.scale
    s = solver.from_vector(z, multipliers) if multipliers else None
    if s is None or not s.success:
        s = NlpSolver(t, {"ipopt.max_iter": hop.design.solver.max_iterations}, until=solver.until).from_vector(z)
    return outcome_of(name, s, time.perf_counter() - began)


def begin_of(outcome: StartOutcome, t: Transcription) -> dict[str, np.ndarray]:
    """What a neighbour begins from: variables (SI), multipliers and objective on the first mesh; and its shape, the
    scaled states at fractions of the phases, which tells optima apart."""
    phases, _ = t.unpack(outcome.vectors["z"], outcome.vectors["p"])
    states = [
        phases[name].sample(FRACTIONS * phases[name].duration)[0] / layout.phase.columns(layout.phase.states, "scale")
        for name, layout in t.layouts.items()
    ]
    return {
        "x": outcome.vectors["z"] * t.scale,
        "lam_g": outcome.vectors["lam_g"],
        "lam_x": outcome.vectors["lam_x"],
        "objective": np.array(outcome.objective),
        "shape": np.concatenate([s.ravel() for s in states]),
    }


def with_others(begin: Begin, others: Iterable[Begin]) -> dict[str, np.ndarray]:
    """What neighbours begin from where other kinds of optima are carried on too."""
    more = {OTHER.format(k, name): value for k, other in enumerate(others) for name, value in other.items()}
    return {**begin, **more}


def kinds(begin: Begin) -> list[Begin]:
    """The optima that a point hands on, the best first."""
    found, k = [{name: value for name, value in begin.items() if "." not in name}], 0
    while other := {name: begin[key] for name in found[0] if (key := OTHER.format(k, name)) in begin}:
        found.append(other)
        k += 1
    return list(found)


def stored_outcome(hop: Hop, t: Transcription, begin: Begin) -> StartOutcome:
    """An optimum on the first mesh as it was stored for neighbours."""
    z, p = begin["x"] / t.scale, t.parameter_values()
    g = np.array(ca.Function("g", [t.nlp["x"], t.nlp["p"]], [t.nlp["g"]])(z, p)).ravel()
    vectors = {"z": z, "p": p, "g": g, "lam_g": begin["lam_g"], "lam_x": begin["lam_x"]}
    return StartOutcome("stored", "stored", True, float(begin["objective"]), 0, 0.0, vectors, hop.objective.sign)
