"""A problem solved more accurately than a height is read: where switches are to be told, and where checks fail."""

from hopopt.design import Design

TOLERANCE, PRICE_TOLERANCE = 1e-6, 1e-5  # a tenth and a fifth of the defaults
AT_MOST = {"tolerance": TOLERANCE, "price_tolerance": PRICE_TOLERANCE}  # entries of [solver]


def finer(design: Design) -> Design:
    """The problem with tolerances of the solver that are at most those."""
    s = design.solver
    smaller = {name: min(getattr(s, name), most) for name, most in AT_MOST.items()}
    return design.model_copy(update={"solver": s.model_copy(update=smaller)})
