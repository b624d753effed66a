"""The global search for legs whose body moves along x and z: four states."""

from collections.abc import Callable

import numpy as np

from hopopt.design import Design
from hopopt.drivetrain.operating_region.region import operating_region
from hopopt.global_search.constants import stance_constants, start_state
from hopopt.global_search.equations.flight import flight_of
from hopopt.global_search.grid import MANY, make_grid, ranges
from hopopt.global_search.paths import ForwardSearch
from hopopt.global_search.result import GlobalSearch
from hopopt.global_search.value import is_compiled, value_function
from hopopt.leg.robot import build_robot
from hopopt.nlp.deadline import Deadline

STEPS, STEPS_OF_MANY = 16, 20  # of the longest stance: with more, interpolation smears more than the motions err
SUBSTEPS = 2  # of each motion
COMPILING = 30.0  # s that its loops take to be compiled, once after an installation, and more
METHOD = "dynamic programming over link angles and rates"


def search_stance(
    design: Design, size: int, rollouts: int, threads: int, progress: Callable[[str], None] | None, until: Deadline
) -> GlobalSearch:
    """Value and rollouts on a grid of ``size`` nodes on each of four axes; TimeoutError if that takes too long."""
    if until.seconds_left < COMPILING and not is_compiled():
        raise TimeoutError
    c = stance_constants(design)
    start, fastest = start_state(c, design), fastest_joints(design)
    flight, grid = flight_of(c, design.hop.foot_window, fastest), make_grid((size,) * 4, *ranges(c, fastest))
    duration, steps = design.hop.stance_duration, STEPS_OF_MANY if size >= MANY else STEPS
    value = value_function(c, flight, grid, duration, steps, SUBSTEPS, threads, progress, until=until)
    found = ForwardSearch(c, value, start, duration, until).rollouts(flight, rollouts)
    return GlobalSearch(METHOD, (size,) * 4, steps, value.at(start, steps) - flight.tuck, found, 0.0)


def fastest_joints(design: Design) -> np.ndarray:
    """Fastest speed of each drive (2,) [rad/s]; an open region is cut at twice what it can drive at."""
    parameters = build_robot(design.leg).parameters
    regions = [operating_region(design.leg, name, parameters) for name in design.leg.joints]
    return np.array([np.abs(region.corners()[:, 0]).max() for region in regions])
