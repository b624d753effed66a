"""Ipopt on a transcription: exact Hessian, our own scaling, and an outcome that says what happened."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from hopopt.nlp.trajectory import PhaseTrajectory
from hopopt.nlp.transcribe import Transcription

OPTIONS = {
    "print_time": False,
    "error_on_fail": False,
    "ipopt.print_level": 0,
    "ipopt.sb": "yes",
    "ipopt.linear_solver": "mumps",
    "ipopt.nlp_scaling_method": "none",
    "ipopt.tol": 1e-11,
    "ipopt.acceptable_iter": 0,
    "ipopt.bound_relax_factor": 0.0,
    "ipopt.mu_strategy": "adaptive",
}


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


class NlpSolver:
    """An Ipopt instance for one transcription, to be called with any guess and parameter values."""

    def __init__(self, transcription: Transcription, options: Mapping[str, Any] | None = None):
        self.transcription = transcription
        settings = OPTIONS | transcription.program.options() | dict(options or {})
        self.solver = ca.nlpsol("hopopt", "ipopt", transcription.nlp, settings)

    def __call__(self, guess: Mapping[str, Any], parameters: Mapping[str, Any] | None = None) -> NlpSolution:
        """Solve from ``guess`` (phase name -> anything with duration and sample) at the given parameters."""
        t = self.transcription
        low, high = t.bounds(guess)
        z0, p = np.clip(t.pack(guess, parameters), low, high), t.parameter_values(parameters)
        result = self.solver(x0=z0, p=p, lbx=low, ubx=high, lbg=t.lbg, ubg=t.ubg)
        stats = self.solver.stats()
        z, g, lam_g, lam_x = (np.array(result[k]).ravel() for k in ("x", "g", "lam_g", "lam_x"))
        phases, values = t.unpack(z, p)
        sign = -1.0 if t.problem.objective.maximize else 1.0
        return NlpSolution(
            t, phases, values, sign * float(result["f"]), str(stats["return_status"]), bool(stats["success"]),
            int(stats["iter_count"]), z, p, g, lam_g, lam_x,
        )  # fmt: skip
