"""A watch that ends hopeless solves and keeps the best iterate."""

import numpy as np

from hopopt.nlp.solver.patience import PATIENCE, Patience


def looked(watch: Patience, f: float, g: float) -> bool:
    """What it says of an iterate (f, g) of a program of one variable whose row is to be 0."""
    return watch.stops({"x": np.array([f]), "f": f, "g": np.array([g])})


def test_without_hope_a_solve_ends_and_with_it_goes_on() -> None:
    watch = Patience(1, np.zeros(1), np.zeros(1), np.arange(1))
    watch.begin()
    assert [looked(watch, -1.0, 0.1) for _ in range(PATIENCE)] == [False] * (PATIENCE - 1) + [True]
    watch.begin()  # an iterate with a negative objective that nearly keeps the row is hope enough
    assert not any(looked(watch, f, 5e-4) for f in np.linspace(0.5, -1.0, 2 * PATIENCE))


def test_the_best_iterate_that_keeps_the_rows_is_kept() -> None:
    watch = Patience(1, np.zeros(1), np.zeros(1), np.arange(1))
    watch.begin()
    assert watch.best is None
    for f, g in ((-0.5, 1e-6), (-0.9, 1e-2), (-0.7, -1e-6), (-0.6, 0.0)):
        looked(watch, f, g)
    assert watch.best is not None
    assert watch.best[1] == -0.7
    watch.begin()
    assert watch.best is None
