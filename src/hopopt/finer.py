"""A problem solved more accurately than a height is read: for answers that differences are taken of."""

from hopopt.leg.design import Design

TOLERANCE, PRICE_TOLERANCE = 1e-6, 1e-5  # a tenth and a fifth of the defaults: twice the time


def finer(design: Design) -> Design:
    """The problem with the solver's tolerances for such answers, where they are not smaller already."""
    s = design.solver
    smaller = {
        "tolerance": min(s.tolerance, TOLERANCE),
        "price_tolerance": min(s.price_tolerance, PRICE_TOLERANCE),
    }
    return design.model_copy(update={"solver": s.model_copy(update=smaller)})
