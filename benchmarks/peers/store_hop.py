"""The hop of the paper's leg as formulas and numbers that any package can be given (posed.py: hop)."""

import json
import sys
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
from posed import OPERATIONS

import hopopt as ho
from hopopt.nlp.layout import make_stage
from hopopt.ocp.guesses.initial_guess import NAMED_STARTS, make_guess
from hopopt.ocp.hop import Hop
from hopopt.ocp.phases import FLIGHT, STANCE
from hopopt.ocp.problem import Ends, Instant, Phase, split, symbols

OPTIMUM = 0.79935  # [m]: `hopopt solve --starts 1`, refined from the same start to 136 + 73 intervals and verified


def steps(f: ca.Function) -> dict[str, Any]:
    """A CasADi function as posed.Formulas."""
    names = {getattr(ca, f"OP_{name.upper()}"): name for name in OPERATIONS}
    found: list[list[Any]] = []
    for k in range(f.n_instructions()):
        kind, given, to = f.instruction_id(k), f.instruction_input(k), f.instruction_output(k)
        if kind == ca.OP_INPUT:
            found.append(["input", to[0], *given])
        elif kind == ca.OP_OUTPUT:
            found.append(["output", given[0], *to])
        elif kind == ca.OP_CONST:
            found.append(["const", to[0], f.instruction_constant(k)])
        else:
            found.append([names[kind], to[0], *given])
    return {"outputs": [f.size1_out(k) for k in range(f.n_out())], "steps": found}


def parameters(hop: Hop) -> dict[str, Any]:
    """Every fixed parameter's value, by name."""
    return {p.name: ca.DM(np.broadcast_to(p.value, (p.size,))) for p in hop.problem.parameters if not p.free}


def pairs(lower: Any, upper: Any) -> list[tuple[float, float]]:
    """(lower, upper) of each component."""
    return [(float(a), float(b)) for a, b in zip(lower, upper, strict=True)]


def instant(phase: Phase, x: ca.SX) -> Instant:
    """The phase's states at an instant, from their scaled stack."""
    return Instant(t=ca.SX(0), p={}, **split(phase.states, x * ca.DM(phase.columns(phase.states, "scale"))))


def right_hand_sides(hop: Hop, phase: Phase) -> ca.Function:
    """(x, u) -> (x', path, running cost), all scaled."""
    stage = make_stage(phase, hop.problem.parameters)
    x, u = (ca.SX.sym(name, stage.function.size1_in(k)) for k, name in enumerate("xu"))
    scales = [ca.DM(phase.columns(group, "scale")) for group in (phase.states, phase.controls)]
    fixed = parameters(hop)
    p = ca.vertcat(*[fixed.get(q.name, ca.DM.zeros(q.size)) for q in hop.problem.parameters])
    rates, path, effort = stage.function(x * scales[0], u * scales[1], 0, p)
    outputs = [rates / scales[0], path / ca.DM(stage.path_column("scale")), hop.tie_break * effort]
    return ca.Function(phase.name, [x, u], [ca.densify(out) for out in outputs])


def phase_numbers(hop: Hop, phase: Phase, intervals: int) -> dict[str, Any]:
    """Bounds and guess of a phase, scaled: the fields of posed.Phase but its functions."""
    x, u = (phase.columns(group, "scale") for group in (phase.states, phase.controls))
    stage, guess = make_stage(phase, hop.problem.parameters), make_guess(hop, NAMED_STARTS[0])[phase.name]
    ends = [
        pairs(*(np.concatenate([s.end_bounds(end)[k] for s in phase.states]) / x for k in (0, 1)))
        for end in ("initial", "final")
    ]
    return {
        "intervals": intervals,
        "x": pairs(*(phase.columns(phase.states, side) / x for side in ("lower", "upper"))),
        "u": pairs(*(phase.columns(phase.controls, side) / u for side in ("lower", "upper"))),
        "start": ends[0],
        "end": ends[1],
        "duration": phase.duration,
        "path": pairs(*(stage.path_column(side) / stage.path_column("scale") for side in ("lower", "upper"))),
        "guess": (guess.fraction.tolist(), (guess.x / x).tolist(), (guess.u / u).tolist(), guess.duration),
    }


def store(folder: Path) -> None:
    """Write the functions and hop.json."""
    hop = Hop(ho.load("paper"))
    stance, flight = hop.problem.phase(STANCE), hop.problem.phase(FLIGHT)
    solver, free = hop.design.solver, [p for p in hop.problem.parameters if p.free]
    numbers: dict[str, Any] = {
        STANCE: phase_numbers(hop, stance, solver.stance_intervals),
        FLIGHT: phase_numbers(hop, flight, solver.flight_intervals),
        "parameters": pairs(*(np.concatenate([p.column(side) for p in free]) for side in ("lower", "upper"))),
        "optimum": -OPTIMUM,
    }
    for phase in (stance, flight):
        numbers[f"{phase.name}_formulas"] = steps(right_hand_sides(hop, phase))
    ends = end_functions(hop, stance, flight)
    rows = [c for c in hop.problem.boundary if c.name != "lift-off"]
    sizes = [len(c.labels) or 1 for c in rows]
    sides = (
        np.concatenate([np.broadcast_to(getattr(c, side), (n,)) for c, n in zip(rows, sizes, strict=True)])
        for side in ("lower", "upper")
    )
    numbers["ends"] = [(0.0, 0.0)] * ends[0].size1_out(0) + pairs(*sides)
    for function in ends:
        numbers[function.name()] = steps(function)
    (folder / "hop.json").write_text(json.dumps(numbers))


def end_functions(hop: Hop, stance: Phase, flight: Phase) -> tuple[ca.Function, ca.Function]:
    """lift_off: the last state of stance -> the first of flight; top: (last state of flight, p) -> what must hold."""
    p = {**parameters(hop), **symbols([q for q in hop.problem.parameters if q.free])}
    x0, x1, y0, y1 = (
        ca.SX.sym(n, len(phase.columns(phase.states, "scale")))
        for n, phase in (("x0", stance), ("x1", stance), ("y0", flight), ("y1", flight))
    )
    at = {name: instant(phase, x) for name, phase, x in
          (("x0", stance, x0), ("x1", stance, x1), ("y0", flight, y0), ("y1", flight, y1))}  # fmt: skip
    for one in at.values():
        one.p = p
    e = Ends({STANCE: at["x0"], FLIGHT: at["y0"]}, {STANCE: at["x1"], FLIGHT: at["y1"]}, {}, {}, p)
    linked, *rest = hop.problem.boundary
    assert linked.name == "lift-off"
    gap = linked.value(e) / ca.DM(flight.columns(flight.states, "scale"))  # y0 less where stance leads to
    lift_off = ca.Function("lift_off", [x1], [ca.densify(ca.substitute(-gap, y0, ca.SX.zeros(y0.shape)))])
    top = ca.Function("top", [y1, p["clearance"]], [ca.densify(ca.vertcat(*[ca.vec(c.value(e)) for c in rest]))])
    return lift_off, top


if __name__ == "__main__":
    store(Path(sys.argv[1]))
