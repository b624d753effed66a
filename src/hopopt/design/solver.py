"""How a problem is solved: the transcription, its first mesh, tolerances and starting points."""

from hopopt.design.fields import EntryName, Section, choice, named, quantity


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
    seed: int = choice("seed of the starting points beyond the named ones", 0, ge=0, le=2**32 - 1)
