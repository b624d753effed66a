"""How a problem is solved: the transcription, its first mesh, tolerances and starting points."""

from typing import Any, Literal

from hopopt.design.fields import EntryName, Section, choice, named, quantity


class Ipopt(Section):
    """Options of Ipopt, by its own names, that count in every solve; what is left out is hopopt's choice.

    Where a solve goes on from a point that is known, hopopt's own choice of barrier and perturbation counts.
    """

    linear_solver: Literal["mumps", "ma27", "ma57", "ma77", "ma86", "ma97", "pardiso", "pardisomkl", "spral"] | None = (
        choice("of its steps; all but mumps need a library of their own", None)
    )
    tol: float | None = quantity("scaled error at which a solve ends", "1", 1e-14, 1e-4, None)
    mu_strategy: Literal["adaptive", "monotone"] | None = choice("how the barrier falls", None)
    mu_init: float | None = quantity("barrier with which it begins", "1", 1e-12, 1e3, None)
    bound_push: float | None = quantity("by how much a start is pushed off its bounds", "1", 1e-12, 1, None)
    bound_frac: float | None = quantity("share of a range by which it is pushed at most", "1", 1e-12, 0.5, None)
    hessian_approximation: Literal["exact", "limited-memory"] | None = choice("of the Lagrangian", None)
    limited_memory_max_history: int | None = choice("steps that a limited memory keeps", None, ge=1, le=1000)
    first_hessian_perturbation: float | None = quantity("where the Hessian is not convex", "1", 1e-20, 1e5, None)
    max_hessian_perturbation: float | None = quantity("at most", "1", 1e-10, 1e30, None)
    perturb_always_cd: Literal["yes", "no"] | None = choice("whether rows may depend on each other", None)
    max_soc: int | None = choice("second-order corrections of a step", None, ge=0, le=100)
    watchdog_shortened_iter_trigger: int | None = choice(
        "short steps before one is taken at length", None, ge=0, le=1000
    )
    mumps_pivtol: float | None = quantity("pivot tolerance of mumps", "1", 0, 1, None)
    mumps_mem_percent: int | None = choice("memory that mumps adds to its estimate, per cent", None, ge=0, le=100000)
    ma57_pivtol: float | None = quantity("pivot tolerance of ma57", "1", 1e-12, 0.999, None)

    @property
    def options(self) -> dict[str, Any]:
        """Those that are given, by CasADi's names."""
        return {f"ipopt.{name}": value for name, value in self if value is not None}


class Solver(Section):
    scheme: EntryName = named("transcription", "radau", "scheme", "radau", "hermite-simpson", "trapezoidal")
    degree: int = choice("collocation points an interval (radau only)", 3, ge=1, le=9)
    stance_intervals: int = choice("intervals of the first mesh, stance", 40, ge=1, le=2000)
    flight_intervals: int = choice("intervals of the first mesh, flight", 10, ge=1, le=2000)
    refine: bool = choice("refine the mesh until the tolerances are met", True)
    tolerance: float = quantity("local error allowed in every interval", "1", 1e-12, 1e-2, 1e-5)
    objective_tolerance: float = quantity(
        "relative change of the objective at which refinement has settled", "1", 1e-9, 1e-1, 1e-4
    )
    price_tolerance: float = quantity(
        "allowed tightening cost: what enforcing limits between the nodes may cost the objective, relatively",
        "1",
        1e-8,
        1e-2,
        5e-5,
    )
    max_refinements: int = choice("mesh refinements at most", 20, ge=0, le=40)
    max_iterations: int = choice("Ipopt iterations at most, each mesh", 600, ge=1, le=100000)
    tie_break: float = quantity(
        "weight of the integral of (tau / tau_max)^2 that decides between equal optima, for the paper's leg and scaled; its bias is reported",
        "m/s", 0, 1e-3, 1e-6,
    )  # fmt: skip
    starts: int = choice("different starting points", 6, ge=1, le=1000)
    ipopt: Ipopt | None = choice("options of Ipopt, by its own names", None, listed=False)
    seed: int = choice("seed of the starting points beyond the named ones", 0, ge=0, le=2**32 - 1)

    @property
    def options(self) -> dict[str, Any]:
        """Options of Ipopt that the problem gives, by CasADi's names."""
        return {} if self.ipopt is None else self.ipopt.options
