"""Ipopt on a transcription: exact Hessian, our own scaling, and an outcome that says what happened."""

from collections.abc import Mapping
from copy import copy
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from hopopt.errors import SolverError, UsageError, one_line
from hopopt.nlp.deadline import NEVER, Deadline
from hopopt.nlp.solver.casadi_solver import CasadiSolver
from hopopt.nlp.solver.known_optima import KnownOptima
from hopopt.nlp.trajectory import PhaseTrajectory
from hopopt.nlp.transcription import Transcription

OPTIONS = {
    "print_time": False,
    "error_on_fail": False,
    "calc_lam_p": False,
    "no_nlp_grad": True,
    "ipopt.print_level": 0,
    "ipopt.sb": "yes",
    "ipopt.linear_solver": "mumps",
    "ipopt.nlp_scaling_method": "none",
    "ipopt.tol": 1e-11,
    "ipopt.acceptable_iter": 0,
    "ipopt.bound_relax_factor": 0.0,
    "ipopt.mu_strategy": "adaptive",
}


def _from_known(push: float) -> dict[str, Any]:
    """Options to begin at a point and multipliers, pushed off their bounds by this much."""
    places = ("bound_push", "bound_frac", "slack_bound_push", "slack_bound_frac", "mult_bound_push")
    pushes = {f"ipopt.warm_start_{place}": push for place in places}
    return {"ipopt.warm_start_init_point": "yes", "ipopt.mu_init": 1e-8} | pushes


# A barrier that falls back to decreasing monotonically needs more iterations from there, and on some legs never ends;
# Ipopt's own first perturbation of the Hessian (1e-4) holds still what hardly matters (docs/performance.md).
STEADY = {"ipopt.adaptive_mu_globalization": "never-monotone-mode", "ipopt.first_hessian_perturbation": 1e-10}
WARM = _from_known(1e-6) | STEADY  # where the point and the multipliers are nearly known
CARRIED = _from_known(1e-4) | STEADY  # where they come from a coarser mesh or another problem
# Where optima are flat, as that of a stance that may wait, steps creep for ever at an error of 1e-8: this many in a row that
# change the objective by less than 1e-9 are enough (ANYmal B, Centauro); on other legs no solve ended so (docs/tried.md).
SETTLED = {"ipopt.acceptable_iter": 10, "ipopt.acceptable_tol": 1e-7, "ipopt.acceptable_obj_change_tol": 1e-9}
# The same, and where such steps lead round a sharp bend, and back: then a filter is to stop them.
WAYS = (CARRIED | SETTLED, CARRIED | SETTLED | {"ipopt.adaptive_mu_globalization": "obj-constr-filter"})
NEAR_OPTIONS = _from_known(1e-11)  # where they are those of the same program within other limits
# Of schemes that collocate both ends of an interval: controls and multipliers oscillate, and rows of neighbouring intervals
# depend on each other, which Ipopt has to be told (it finds out too late).
UNDAMPED = {"ipopt.tol": 1e-8, "ipopt.perturb_always_cd": "yes"}
# Not to be followed where Hessians are made convex by steep terms: such iterates hardly move, and their factorisations fill
# up, which can take minutes each.
GENTLE_OPTIONS = {"ipopt.max_hessian_perturbation": 1e5}
RESTARTED = GENTLE_OPTIONS | SETTLED  # on a finer mesh, from the point alone


def enough(scale: float, steps: int) -> dict[str, Any]:
    """Options to end after so many steps in a row that are optimal to 1e-8, with complementarity still to 1e-10 of the ``scale`` of the
    objective [its unit]: where functions bend sharply, steps along what hardly matters go back and forth for dozens more."""
    return {
        "ipopt.acceptable_iter": steps,
        "ipopt.acceptable_tol": 1e-8,
        "ipopt.acceptable_constr_viol_tol": 1e-8,
        "ipopt.acceptable_compl_inf_tol": 1e-10 * scale,
        "ipopt.acceptable_obj_change_tol": 1e-8,
    }


REASON = 200  # characters
LEAST_MAGNITUDE = 1e-2  # of the objective's scale
SHORTEST, LONGEST = 1e-3, 600.0  # s that one solve is given, whatever the deadline
PUNCTUAL = 0.9  # share of the time that a solver was made with, beyond which, or its inverse, it is made again
FOREIGN = "NonIpopt_Exception_Thrown"  # how Ipopt ends at an error that is not its own
REFUSED = "Invalid_Option"  # how it ends where it cannot do what an option asks
NOT_HERE = (
    "Ipopt cannot do here what {} ask: a linear solver other than mumps needs its library where Ipopt finds it; "
    "leave it out, or install it"
)
ENDED_BY_ANOTHER = (
    "Ipopt was ended by an error in what it calls, of which CasADi tells no more: it may be a function of the problem's, or "
    "too little memory. Try fewer intervals and, if you gave functions of your own, the problem without them."
)


@dataclass(frozen=True)
class Bounds:
    """Lower and upper bounds of the scaled variables, low_z and high_z, and of the rows, low_g and high_g."""

    low_z: np.ndarray
    high_z: np.ndarray
    low_g: np.ndarray
    high_g: np.ndarray


@dataclass(frozen=True)
class NlpSolution:
    """One solve: trajectories and parameters, the scaled NLP vectors and multipliers, Ipopt's own account."""

    transcription: Transcription
    phases: dict[str, PhaseTrajectory]
    parameters: dict[str, np.ndarray]
    objective: float
    status: str
    success: bool
    iterations: int
    z: np.ndarray
    p: np.ndarray
    g: np.ndarray
    lam_g: np.ndarray
    lam_x: np.ndarray
    bounds: Bounds

    @cached_property
    def tie_break(self) -> float:
        """What its tie-break weighs in the objective [its unit]."""
        return self.transcription.tie_break(self.z, self.p)

    @property
    def value(self) -> float:
        """The objective without its tie-break [its unit]."""
        return self.objective + self.transcription.problem.objective.sign * self.tie_break

    @property
    def all_parameters(self) -> np.ndarray:
        """Values of all parameters of the problem, one after another."""
        chosen = [self.parameters[q.name] for q in self.transcription.problem.parameters]
        return np.concatenate([np.zeros(0), *map(np.atleast_1d, chosen)])

    def right_hand_sides(self, phase: str, t: np.ndarray, x: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, ...]:
        """Derivatives (..., nx), path constraints and integrands at times t (...) [s] since the phase began, states x
        (..., nx) and controls u (..., nu)."""
        flat = [np.ascontiguousarray(table.reshape(t.size, -1).T) for table in (x, u, t)]
        function = self.transcription.layouts[phase].stage.function
        found = function.map(t.size)(*flat, self.all_parameters)
        return tuple(np.array(table).T.reshape(*t.shape, -1) for table in found)

    @property
    def least(self) -> float:
        """Of an objective that may be 0 [its unit]: what is relative to it is relative to this at least."""
        return LEAST_MAGNITUDE * self.transcription.problem.objective.scale

    @property
    def magnitude(self) -> float:
        """What is relative to the objective is relative to this [its unit]."""
        return max(abs(self.objective), self.least)


Multipliers = tuple[np.ndarray, np.ndarray] | None  # lam_g, lam_x


def time_given(until: Deadline) -> float:
    """Time for a solve that begins now [s]; a little if none is left, so that it ends with an account of its guess."""
    return min(max(until.seconds_left, SHORTEST), LONGEST)


class NlpSolver:
    """An Ipopt instance for one transcription, to be called with any guess and parameter values; no solve of it goes on
    beyond ``until``."""

    def __init__(
        self, transcription: Transcription, options: Mapping[str, Any] | None = None, known: KnownOptima | None = None,
        until: Deadline = NEVER,
    ):  # fmt: skip
        self.transcription, self.known, self.until = transcription, known, until
        undamped = UNDAMPED if transcription.scheme.starts_at_node else {}
        scaled = {"ipopt.obj_scaling_factor": 1.0 / transcription.problem.objective.scale}
        settings = OPTIONS | undamped | scaled | transcription.program.options
        self._settings = settings | dict(transcription.problem.solver_options) | dict(options or {})
        self.solver = self._built()

    def _built(self) -> CasadiSolver:
        """Ipopt with the time that is left; a little if none is, so that every solve ends with an account of its guess."""
        self._given = time_given(self.until)
        settings = self._settings | {"ipopt.max_wall_time": self._given}
        return CasadiSolver("ipopt", self.transcription.nlp, settings, self.known)

    def __call__(
        self,
        guess: Mapping[str, Any],
        parameters: Mapping[str, Any] | None = None,
        multipliers: Multipliers = None,
        bounds: Bounds | None = None,
    ) -> NlpSolution:
        """Solve from ``guess`` (phase name -> anything with duration and sample) at the given parameters.

        With the options WARM or CARRIED, ``multipliers`` (lam_g, lam_x) are where those begin; ``bounds``: others than the
        program's own. Raises KeyboardInterrupt if the user stops Ipopt, SolverError if an error that is not Ipopt's does.
        """
        t = self.transcription
        bounds = bounds or Bounds(*t.bounds(guess), t.lbg, t.ubg)
        return self._solve(t.pack(guess, parameters), t.parameter_values(parameters), bounds, multipliers)

    @property
    def stopped(self) -> bool:
        """Whether the last solve was ended near an optimum that is known."""
        return self.known is not None and self.known.found is not None

    def on(self, transcription: Transcription, until: Deadline) -> "NlpSolver":
        """The same compiled program for the numbers of ``transcription`` (nlp/solver/reuse.py)."""
        other = copy(self)
        other.transcription, other.until = transcription, until
        return other

    def from_vector(
        self, z: np.ndarray, multipliers: Multipliers = None, bounds: tuple[np.ndarray, np.ndarray] | None = None
    ) -> NlpSolution:
        """Solve from a scaled vector at the program's own parameter values; for meshes of one arc a phase, or with ``bounds``,
        lower and upper, of the variables."""
        t = self.transcription
        return self._solve(z, t.parameter_values(), Bounds(*(bounds or t.bounds({})), t.lbg, t.ubg), multipliers)

    def again(self, last: NlpSolution, bounds: Bounds) -> NlpSolution:
        """Solve from the point and multipliers of an earlier solution of the same program, within other bounds."""
        return self._solve(last.z, last.p, bounds, (last.lam_g, last.lam_x))

    def _solve(self, z: np.ndarray, p: np.ndarray, b: Bounds, multipliers: Multipliers) -> NlpSolution:
        t, z0 = self.transcription, np.clip(z, b.low_z, b.high_z)
        begin = {} if multipliers is None else {"lam_g0": multipliers[0], "lam_x0": multipliers[1]}
        if self.known is not None:
            self.known.begin()
        if not PUNCTUAL * self._given <= time_given(self.until) <= self._given / PUNCTUAL:
            self.solver = self._built()
        try:
            result = self.solver(x0=z0, p=p, lbx=b.low_z, ubx=b.high_z, lbg=b.low_g, ubg=b.high_g, **begin)
        except RuntimeError as error:  # CasADi's, at length, with the reason in its last line
            raise SolverError(f"Ipopt cannot work on the program: {one_line(error)[-REASON:]}") from error
        stats = self.solver.stats()
        if stats["return_status"] == FOREIGN:
            raise SolverError(ENDED_BY_ANOTHER)
        if stats["return_status"] == REFUSED:
            raise UsageError(NOT_HERE.format(", ".join(t.problem.solver_options) or "its options"))
        z, g, lam_g, lam_x = (np.array(result[k]).ravel() for k in ("x", "g", "lam_g", "lam_x"))
        phases, values = t.unpack(z, p)
        return NlpSolution(
            t, phases, values, t.problem.objective.cost(float(result["f"])), str(stats["return_status"]), bool(stats["success"]),
            int(stats["iter_count"]), z, p, g, lam_g, lam_x, b,
        )  # fmt: skip
