"""What CasADi and its Ipopt offer for a program like the hop's, each against the way hopopt does it.

    python benchmarks/casadi_ways.py [PROBLEM] [STANCE] [FLIGHT] [REPEATS]

Every way runs in a process of its own, in turns with hopopt's own, on the same mesh (40 + 10 intervals unless told),
from the guess "upright push", with the same options. Times are processor times, the compiler's included; x: the best
of the repeats (3 unless told) over hopopt's own, so above 1 hopopt's way is faster.
"""

import json
import re
import resource
import subprocess
import sys
import time
from contextlib import ExitStack
from typing import Any
from unittest.mock import patch

import casadi as ca
import numpy as np

import hopopt as ho
from hopopt.nlp import terms
from hopopt.nlp.mesh import uniform
from hopopt.nlp.program import Program
from hopopt.nlp.schemes import scheme
from hopopt.nlp.solver.ipopt import NlpSolver
from hopopt.nlp.transcription import Transcription
from hopopt.ocp.guesses.initial_guess import NAMED_STARTS, make_guess
from hopopt.ocp.hop import Hop
from hopopt.ocp.phases import FLIGHT, STANCE

LIMIT = 60.0  # [s] for all repeats of a way with hopopt's own beside it
REASON = re.compile(r"(?:Exception message: |Fatrop: |HPIPM: |WARNING\(|Setting: )(.{1,110})")
MAP, NLPSOL, HINT = ca.Function.map, ca.nlpsol, "equality"


def small(**options: Any) -> Any:
    """These options of the small functions."""
    return patch.object(terms, "FUNCTIONS", options)


def mapped(*how: Any) -> Any:
    """Another kind of map."""
    return patch.object(ca.Function, "map", lambda function, count: MAP(function, count, *how))


def solver(which: str, **options: Any) -> Any:
    """Another solver, told which rows are equations."""
    return patch.object(ca, "nlpsol", lambda n, _, nlp, o: NLPSOL(n, which, nlp, options | {HINT: o[HINT]}))


def symmetric_hessian(local: terms.Local) -> Any:
    """The small Hessian by CasADi's own rule."""
    w = ca.SX.sym("w", local.outputs.numel())
    bend = ca.hessian(ca.dot(w, local.outputs), local.y)[0]
    return local.function("hessian", [terms.nonzeros(ca.triu(bend))], w), *terms.triplet(bend.sparsity())


CASADIS = patch.object(Program, "options", {})  # derivatives of the whole program
AUTO, C = {"structure_detection": "auto"}, {"cse": True, "jit": True, "compiler": "shell"}
FLAGS = ("-O1", "-O2", "-O3 -march=native")
MUMPS = {"pivot_order": (0, 2, 4, 5, 6), "scaling": (0, 7, 8), "permuting_scaling": (0, 1)}
LINEAR_SOLVERS = ("spral", "ma27", "ma57", "ma97", "pardiso", "pardisomkl")  # with a level at which they say why not
WAYS: dict[str, tuple[dict[str, Any], list[Any]]] = {  # Ipopt's options, and what else is changed
    "all in SX (`expand`), CasADi's derivatives": ({"expand": True}, [CASADIS]),
    "`map`, CasADi's derivatives": ({}, [CASADIS]),
    "the same, `never_inline`": ({}, [CASADIS, small(cse=True, never_inline=True)]),
    "`inline`, `always_inline`": ({}, [CASADIS, small(cse=True, always_inline=True), mapped("inline")]),
    "`map` on 2 threads, `thread`": ({}, [mapped("thread", 2)]),
    "`map` on 2 threads, `openmp`": ({}, [mapped("openmp", 2)]),
    "small functions without `cse`": ({}, [small()]),
    "small Hessians from `ca.hessian`": ({}, [patch.object(terms.Local, "hessian", property(symmetric_hessian))]),
    **{f"small functions compiled, `{f}`": ({}, [small(**C, jit_options={"flags": f.split()})]) for f in FLAGS},
    **{f"`mumps_{key}` {n}": ({f"ipopt.mumps_{key}": n}, []) for key, values in MUMPS.items() for n in values},
    **{f"Ipopt, {n}": ({"ipopt.linear_solver": n, "ipopt.print_level": 1}, []) for n in LINEAR_SOLVERS},
    "fatrop, structure `auto`": ({}, [CASADIS, solver("fatrop", **AUTO)]),
    "fatrop, no structure": ({}, [CASADIS, solver("fatrop")]),
    "sqpmethod, QPs by fatrop": ({}, [CASADIS, solver("sqpmethod", qpsol="fatrop", qpsol_options=AUTO)]),
    "Ipopt, `limited-memory`": ({"ipopt.hessian_approximation": "limited-memory"}, []),
}


def clock() -> np.ndarray:
    """Processor seconds of this process and of its finished children, and wall time."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return np.array([time.process_time(), children.ru_utime + children.ru_stime, time.perf_counter()])


def measured(name: str, problem: str, counts: tuple[int, int]) -> dict[str, Any]:
    """Seconds and outcome of the hop on so many intervals of stance and flight; without a name, hopopt's own way."""
    hop, (options, changes) = Hop(ho.load(problem)), WAYS.get(name, ({}, []))
    s, posed, guess = hop.design.solver, hop.problem, make_guess(hop, NAMED_STARTS[0])
    mesh, began = {STANCE: uniform(counts[0]), FLIGHT: uniform(counts[1])}, clock()
    with ExitStack() as changed:
        _ = [changed.enter_context(change) for change in changes]
        t = Transcription(posed, scheme(s.scheme, s.degree), mesh)
        more = {HINT: (t.lbg == t.ubg).tolist(), "ipopt.max_iter": s.max_iterations}
        nlp = NlpSolver(t, more | options)
    built, found, ended = clock(), nlp(guess), clock()
    (own, compiling, _), (solve, _, wall) = (built - began).tolist(), (ended - built).tolist()
    return {
        "build": own + compiling, "compiling": compiling, "solve": solve, "wall": wall, "iterations": found.iterations,
        "objective": found.objective, "failure": "" if found.success else found.status,
    }  # fmt: skip


def compared(name: str, *arguments: str) -> str:
    """A way's line of the table."""
    remark = ""
    try:
        run = subprocess.run([sys.executable, __file__, *arguments, name], capture_output=True, timeout=LIMIT)
        said = (run.stdout + run.stderr).decode()
    except subprocess.TimeoutExpired as late:
        said, remark = (late.stdout or b"").decode(), f"not finished in {LIMIT:.0f} s"
    costs = [json.loads(line) for line in said.splitlines() if line.startswith('{"build"')]
    remark = "".join(REASON.findall(said)[:1]) or remark * (len(costs) < 2)
    return row(name, costs[::2], costs[1::2], remark)


def row(name: str, own: list[dict[str, Any]], other: list[dict[str, Any]], remark: str) -> str:
    """The other way's best against hopopt's best."""
    if not other or other[0]["failure"]:
        return f"| {name} | - | - | - | - | {' '.join([c['failure'] for c in other[:1]] + [remark])} |"
    ratio = {k: min(c[k] for c in other) / min(c[k] for c in own) for k in ("build", "solve", "wall")}
    steps, away = other[0]["iterations"], other[0]["objective"] - own[0]["objective"]
    notes = [f"{other[0]['compiling']:.1f} s in the compiler"] * (other[0]["compiling"] > 0.1)
    notes += [f"wall time x {ratio['wall']:.2f}"] * ("thread" in name) + [remark] * bool(remark)
    cells = f"{ratio['build']:.2f} | {ratio['solve'] * own[0]['iterations'] / steps:.2f} | {steps} | {away:+.0e}"
    return f"| {name} | {cells} | {', '.join(notes)} |"


def main() -> None:
    """Measure and print the table, or the costs of one way and hopopt's own in turns if it is named."""
    problem, stance, flight, repeats, *names = sys.argv[1:] + ["paper", "40", "10", "3"][len(sys.argv) - 1 :]
    counts = int(stance), int(flight)
    for way in int(repeats) * ["", *names] * bool(names):
        print(json.dumps(measured(way, problem, counts)), flush=True)
    if names:
        return
    own = measured("", problem, counts)
    print(f"{counts}: built in {own['build']:.2f} s, {own['iterations']} iterations in {own['solve']:.3f} s\n")
    print("| way | build x | iteration x | iterations | objective | remark |\n" + "|---" * 6 + "|")
    for name in WAYS:
        print(compared(name, problem, stance, flight, repeats), flush=True)


if __name__ == "__main__":
    main()
