"""The nonlinear program of a problem, at hand: CasADi's expressions, names, bounds, sparsity, guess, dynamics, and its solver."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np

from hopopt.design import Design
from hopopt.errors import UsageError, one_line
from hopopt.leg.dynamics import LegDynamics
from hopopt.nlp.solver.ipopt import NlpSolution, NlpSolver
from hopopt.nlp.transcription import Transcription
from hopopt.nlp.variable_names import parameter_names, row_names, variable_names
from hopopt.ocp.guesses.initial_guess import make_guess, starts_of
from hopopt.ocp.hop import Hop
from hopopt.planner.motion import Motion
from hopopt.planner.search.from_known import Known, guess_of

if TYPE_CHECKING:
    import pinocchio as pin


@dataclass(frozen=True, repr=False)
class ProgramSolution:
    """Where Ipopt ended on a program.

    nlp: its vectors (z, lam_g, lam_x, scaled), trajectories by phase and parameters
    log: Ipopt's account of every iteration by column, each (iterations + 1): obj (scaled), inf_pr, inf_du, mu, ...
    design: the problem
    """

    nlp: NlpSolution
    log: Mapping[str, np.ndarray]
    design: Design

    def __repr__(self) -> str:
        return f"<ProgramSolution of {self.design.name}: {self.nlp.objective:.6g}, {self.nlp.status}>"

    @property
    def success(self) -> bool:
        """Whether it is an optimum of this program, on this mesh. It is not verified: solve from it for that."""
        return self.nlp.success

    @property
    def objective(self) -> float:
        """The objective with its tie-break [its unit]."""
        return self.nlp.objective

    @property
    def x(self) -> np.ndarray:
        """The variables, scaled."""
        return self.nlp.z

    @cached_property
    def motion(self) -> Motion:
        """The hop as functions of time: motion.sample(t)."""
        return Motion(self.design, self.nlp.transcription.problem.objective.name, self.nlp.phases)


class Program:
    """The program that is solved for a problem: minimise f(x, p) with lbx <= x <= ubx and lbg <= g(x, p) <= ubg.

    All vectors are scaled: x times ``scale`` is in SI units, and so is g times ``row_scale``. f is the objective to be
    made small, in its own unit.
    """

    def __init__(self, hop: Hop, transcription: Transcription, guess: np.ndarray | None = None):
        self.hop, self.transcription, self._guess = hop, transcription, guess

    def __repr__(self) -> str:
        rows = f"{len(self.lbg)} rows, {self.jacobian_sparsity.nnz()} nonzeros"
        return f"<Program of {self.hop.design.name}: {len(self.scale)} variables, {rows}>"

    # ---- expressions ---------------------------------------------------------------------------------------------

    @property
    def x(self) -> ca.MX:
        """The variables, (n, 1)."""
        return self.transcription.nlp["x"]

    @property
    def p(self) -> ca.MX:
        """The fixed parameters: numbers of the leg and those of ``[parameters]``, SI units."""
        return self.transcription.nlp["p"]

    @property
    def f(self) -> ca.MX:
        """What is made small."""
        return self.transcription.nlp["f"]

    @property
    def g(self) -> ca.MX:
        """The rows: equations of motion, limits, transitions, (m, 1)."""
        return self.transcription.nlp["g"]

    @cached_property
    def gradient(self) -> ca.Function:
        """(x, p) -> f, its gradient (n, 1)."""
        return self.transcription.program.grad_f()

    @cached_property
    def jacobian(self) -> ca.Function:
        """(x, p) -> g, its Jacobian (m, n), sparse."""
        return self.transcription.program.jac_g()

    @cached_property
    def hessian(self) -> ca.Function:
        """(x, p, lam_f, lam_g) -> upper triangle of the Hessian of lam_f f + lam_g' g, (n, n), sparse."""
        return self.transcription.program.hess_lag()

    @property
    def jacobian_sparsity(self) -> ca.Sparsity:
        """Of the Jacobian of g, (m, n)."""
        return self.jacobian.sparsity_out(1)

    @property
    def hessian_sparsity(self) -> ca.Sparsity:
        """Of the Hessian of the Lagrangian, its upper triangle, (n, n)."""
        return self.hessian.sparsity_out(0)

    # ---- names, bounds, values -----------------------------------------------------------------------------------

    @cached_property
    def variable_names(self) -> tuple[str, ...]:
        """Of x: phase, component and node ("stance q[hip] 3"), durations, free parameters."""
        return variable_names(self.transcription)

    @cached_property
    def row_names(self) -> tuple[str, ...]:
        """Of g: phase, what the row states, its interval and the place in it from 0 to 1 ("stance motion of q[hip] 3+0.645")."""
        return row_names(self.transcription)

    @cached_property
    def parameter_names(self) -> tuple[str, ...]:
        """Of p: entries of the problem."""
        return parameter_names(self.transcription)

    @property
    def scale(self) -> np.ndarray:
        """What x is in units of, (n,)."""
        return self.transcription.scale

    @property
    def row_scale(self) -> np.ndarray:
        """What g is in units of, (m,)."""
        return self.transcription.row_scale

    @cached_property
    def _bounds(self) -> tuple[np.ndarray, np.ndarray]:
        phases, _ = self.transcription.unpack(self.guess, self.parameters)
        return self.transcription.bounds(self.transcription.guess_from(phases))

    @property
    def lbx(self) -> np.ndarray:
        """Least x, (n,)."""
        return self._bounds[0]

    @property
    def ubx(self) -> np.ndarray:
        """Greatest x, (n,)."""
        return self._bounds[1]

    @property
    def lbg(self) -> np.ndarray:
        """Least g, (m,)."""
        return self.transcription.lbg

    @property
    def ubg(self) -> np.ndarray:
        """Greatest g, (m,)."""
        return self.transcription.ubg

    @property
    def parameters(self) -> np.ndarray:
        """Values of p."""
        return self.transcription.parameter_values()

    @cached_property
    def guess(self) -> np.ndarray:
        """The x from which it is solved: the first of hopopt's starts, or the hop that it was made of."""
        if self._guess is not None:
            return self._guess
        return self.transcription.pack(make_guess(self.hop, starts_of(self.hop, 1)[0]))

    # ---- dynamics ------------------------------------------------------------------------------------------------

    @cached_property
    def dynamics(self) -> dict[str, ca.Function]:
        """Of each phase (x, u, t, p) -> xdot: states, controls, time since it began [s], all parameters; SI units."""
        return {name: _derivatives(layout.stage.function) for name, layout in self.transcription.layouts.items()}

    def components(self, phase: str) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Names of the states and of the controls of a phase, as ``dynamics`` takes them."""
        of = self.transcription.layouts[phase].phase
        states, controls = ([str(c) for v in group for c in v.components()] for group in (of.states, of.controls))
        return tuple(states), tuple(controls)

    @cached_property
    def inverse_dynamics(self) -> ca.Function:
        """(q, v, a) -> forces: of body x, z [N] and joints [N m] that move the leg so in free flight, drives' rotors included."""
        n = 2 + self.hop.n
        q, v, a = (ca.SX.sym(name, n) for name in "qva")
        forces = LegDynamics(self.hop.robot, self.hop.robot.parameters).inverse_dynamics(q, v, a)
        return ca.Function("inverse_dynamics", [q, v, a], [forces], ["q", "v", "a"], ["forces"])

    @property
    def model(self) -> "pin.Model":
        """The leg as Pinocchio has it: body x, z, then the joints."""
        return self.hop.robot.model

    # ---- the solver ----------------------------------------------------------------------------------------------

    def solve(
        self, options: Mapping[str, Any] | None = None, *, guess: Known | ProgramSolution | np.ndarray | None = None,
        log: bool = False,
    ) -> ProgramSolution:  # fmt: skip
        """Solve it with Ipopt, on this mesh alone.

        options: Ipopt's, by its own names, over those of the problem
        guess: a hop that was solved, a solution of a program, or x (None: ``guess``)
        log: print Ipopt's own lines, one for each iteration

        Nothing is verified: ``ho.solve(problem, guess=found)`` does that. Raises UsageError for options that Ipopt does not
        have or a guess that does not fit, SolverError if Ipopt cannot work on it.
        """
        t, given = self.transcription, {"print_level": 5 * log, **(options or {})}
        begin = self.guess if guess is None else guess
        z = np.asarray(begin, dtype=float) if isinstance(begin, np.ndarray) else guess_vector(t, begin)
        if z.shape != self.scale.shape:
            raise UsageError(f"the guess has {z.size} numbers where the program has {len(self.scale)} variables")
        settings = {"ipopt.max_iter": self.hop.design.solver.max_iterations}
        settings |= {f"ipopt.{name}": value for name, value in given.items()}
        try:
            solver = NlpSolver(t, settings)
        except RuntimeError as error:
            raise UsageError(f"Ipopt does not take these options ({_reason(error)})") from None
        found = solver.from_vector(z, bounds=(self.lbx, self.ubx))
        account = solver.solver.stats()["iterations"]
        return ProgramSolution(found, {name: np.array(values) for name, values in account.items()}, self.hop.design)


def guess_vector(t: Transcription, known: "Known | ProgramSolution") -> np.ndarray:
    """A hop as the variables of a program, scaled; UsageError if it is one of other phases or joints."""
    guess, free = guess_of(t, known.nlp if isinstance(known, ProgramSolution) else known)
    return t.pack(guess, free)


def _reason(error: RuntimeError) -> str:
    """What CasADi says, without the places in its sources."""
    return re.split(r"\.cpp:\d+: ", one_line(error))[-1][:200]


def _derivatives(stage: ca.Function) -> ca.Function:
    given = [ca.MX.sym(name, stage.size1_in(k)) for k, name in enumerate("xutp")]
    return ca.Function("dynamics", given, [stage(*given)[0]], list("xutp"), ["xdot"])
