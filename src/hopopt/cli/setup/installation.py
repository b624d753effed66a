"""Whether this installation works: versions, solvers, compiler, cache, and a few answers that are known beforehand."""

import platform
import shutil
import subprocess
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import casadi as ca
import numpy as np
import pinocchio as pin

from hopopt.cli.setup.versions import TESTED, installed, not_tested, too_old
from hopopt.control.closed_loop import simulate
from hopopt.control.strategies import find
from hopopt.errors import HopoptError
from hopopt.leg.dynamics import LegDynamics
from hopopt.leg.robot import build_robot
from hopopt.nlp.mesh import uniform
from hopopt.nlp.schemes import radau
from hopopt.nlp.solver.compiled import FOLDER, cache_folder
from hopopt.nlp.solver.ipopt import NlpSolver
from hopopt.nlp.transcription import Guess, Transcription
from hopopt.ocp.problem import Control, Objective, Phase, Problem, State
from hopopt.planner.solve import solve
from hopopt.problem.load import load

SOLVERS = {"ipopt": True, "uno": False}  # NLP solvers of CasADi, and whether hopopt needs them
EXTRAS = {
    "dask": "dask", "distributed": "dask", "example-robot-data": "robots", "jupyterlab": "notebooks", "mcap": "mcap",
    "mcap-ros2-support": "mcap", "mujoco": "mujoco", "pycollada": "view", "tornado": "explore", "viser": "view",
}  # fmt: skip
SHOWN_VERSIONS = ("hopopt", *(name for name in TESTED if name not in EXTRAS))
COARSE_MESH = {"solver.refine": False, "solver.stance_intervals": 12, "solver.flight_intervals": 6}
WAYS_AGREE = 1e-9  # relative: within which two ways of computing the same number agree
LEAST_EFFORT = 12.0  # closed form: 1 m in 1 s from rest to rest, u = 6 - 12 t, integral of u^2


@dataclass(frozen=True)
class Finding:
    """One thing that was looked at.

    group: versions, solvers, tools or self-test
    name: what it is
    found: what there is, in words
    ok: whether it is as it should be
    needed: whether hopopt does without it
    advice: what to do if it is not, or what else is to be known; may be empty
    """

    group: str
    name: str
    found: str
    ok: bool = True
    needed: bool = True
    advice: str = ""


def findings() -> Iterator[Finding]:
    """Everything that is looked at, one by one; the self-test comes last and takes some seconds."""
    yield Finding("versions", "system", f"{platform.system()} {platform.machine()}")
    yield from (_version(name) for name in ("python", *SHOWN_VERSIONS))
    yield from (_version(package, extra) for package, extra in EXTRAS.items())
    yield from (_solver(name, needed) for name, needed in SOLVERS.items())
    yield _compiler()
    yield _cache()
    for name, test in SELF_TESTS.items():
        yield _tested(name, test)


def _version(name: str, extra: str | None = None) -> Finding:
    """Which version there is; ``extra``: the one that brings it, if hopopt does without."""
    found, needed = installed(name), extra is None
    if found is None:
        advice = f"optional: pip install 'hopopt[{extra}]'" if extra else f"pip install {name}"
        return Finding("versions", name, "not installed", ok=False, needed=needed, advice=advice)
    if old := too_old(name, found):
        advice = f"{found} is {old}: pip install --upgrade {name}"
        return Finding("versions", name, found, ok=False, needed=needed, advice=advice)
    new = not_tested(name, found)
    return Finding("versions", name, found, needed=needed, advice=f"{found} is {new}" if new else "")


def _solver(name: str, needed: bool) -> Finding:
    there = ca.has_nlpsol(name)
    advice = "" if there else "install casadi from its wheel: pip install --force-reinstall casadi"
    use = "finds the hop" if needed else "for --cross-check alone"
    return Finding("solvers", name, use if there else f"not part of this CasADi ({use})", there, needed, advice)


def _compiler() -> Finding:
    path = shutil.which("cc")
    if path is None:
        advice = "optional: with a C compiler, studies of many problems are quicker"
        return Finding("tools", "compiler", "none (cc)", ok=False, needed=False, advice=advice)
    try:
        done = subprocess.run([path, "--version"], capture_output=True, text=True, timeout=10, check=False)
        words = (done.stdout.splitlines() or ["of unknown version"])[0]
    except (OSError, subprocess.SubprocessError):
        words = "that does not run"
    return Finding("tools", "compiler", f"{path}: {words}", needed=False)


def _cache() -> Finding:
    folder = cache_folder()
    if folder is None:
        return Finding("tools", "cache", f"none yet, or {FOLDER} is off", needed=False)
    files = [path.stat().st_size for path in folder.glob("*.so")]
    return Finding(
        "tools", "cache", f"{folder}: {len(files)} compiled functions, {sum(files) / 1e6:.1f} MB", needed=False
    )


# ---- self-test ------------------------------------------------------------------------------------------------


def least_effort() -> tuple[float, float, float]:
    """Ipopt on a problem solved on paper: the integral of u^2 found, the true one, and what is allowed."""
    states = (State("x", initial=0.0, final=1.0), State("v", initial=0.0, final=0.0))
    phase = Phase(
        "move", states, (Control("u"),), lambda s: {"x": s.v, "v": s.u}, (1.0, 1.0), integrands={"u2": lambda s: s.u**2}
    )
    problem = Problem("effort", (phase,), Objective("effort", lambda e: e.integral["move"]["u2"]))
    line = Guess(1.0, np.array([0.0, 1.0]), np.array([[0.0, 0.0], [1.0, 0.0]]), np.zeros((2, 1)))
    found = NlpSolver(Transcription(problem, radau(3), {"move": uniform(6)}))({"move": line})
    return float(found.objective), LEAST_EFFORT, 1e-6 * LEAST_EFFORT


def dynamics() -> tuple[float, float, float]:
    """The planner's joint torques [N m] in CasADi at one state of the paper's leg, and Pinocchio's; their largest."""
    robot = build_robot(load("paper").leg)
    q, v, a = (np.linspace(low, 1.0, robot.model.nv) for low in (-0.7, 0.3, -2.0))
    planned = np.array(ca.DM(LegDynamics(robot, robot.parameters).inverse_dynamics(ca.DM(q), ca.DM(v), ca.DM(a))))
    known = pin.rnea(robot.model, robot.model.createData(), q, v, a)
    worst = int(np.abs(planned.ravel() - known).argmax())
    return float(planned.ravel()[worst]), float(known[worst]), WAYS_AGREE * float(np.abs(known).max())


def simulation() -> tuple[float, float, float]:
    """Energy that a simulated hop of the paper's leg does not account for, relative; none is known to be right."""
    run = simulate(load("paper"), find("force"), past_apex=True)
    return run.trace.energy_error, 0.0, 1e-6


def planning() -> tuple[float, float, float]:
    """A hop on a coarse mesh: its clearance [m] by the planner's kinematics, and by Pinocchio's at its joint angles."""
    solution = solve(load("paper", COARSE_MESH), starts=1, processes=1)
    robot, apex = solution.robot, solution.apex
    data = robot.model.createData()
    pin.forwardKinematics(robot.model, data, apex.q[0])
    heights = [data.oMi[joint].act(np.array(offset, dtype=float))[2] for joint, offset in robot.points.values()]
    return solution.clearance, float(min(heights)), WAYS_AGREE


SELF_TESTS: dict[str, Callable[[], tuple[float, float, float]]] = {
    "optimum of a problem solved on paper": least_effort,
    "dynamics, CasADi and Pinocchio": dynamics,
    "energy of a simulated hop": simulation,
    "a hop planned on a coarse mesh": planning,
}


def _tested(name: str, test: Callable[[], tuple[float, float, float]]) -> Finding:
    """What a self-test found, beside what it should be; an error is a finding too."""
    began = time.perf_counter()
    try:
        found, known, allowed = test()
    except (HopoptError, RuntimeError, ArithmeticError, ValueError) as error:
        words, ok = f"failed: {' '.join(str(error).split())[:200]}", False
    else:
        ok = abs(found - known) <= allowed
        words = f"{found:.6g}, should be {known:.6g} within {allowed:.0e} ({time.perf_counter() - began:.1f} s)"
    advice = (
        "" if ok else "answers of this installation are not to be trusted: install hopopt anew in a fresh environment"
    )
    return Finding("self-test", name, words, ok, advice=advice)
