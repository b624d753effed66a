"""Over a box: the distance that the program knows, the box that is measured, and a hop that both agree on."""

from dataclasses import replace
from functools import cache

import casadi as ca
import numpy as np
import pytest

import hopopt as ho
from hopopt.cli.main import run
from hopopt.errors import UsageError
from hopopt.ocp.hop import Hop
from hopopt.ocp.hops.obstacle import distance
from hopopt.planner.solution import Solution
from hopopt.planner.solve import solve
from hopopt.problem.load import load
from hopopt.verify.hops.obstacle import height_over
from hopopt.verify.plan import verify_plan
from hopopt.verify.table import FLIGHT

SMOOTH = 1e-3


def separation(a: np.ndarray, b: np.ndarray, begin: float, width: float, height: float) -> float:
    """Distance along the best separating axis of the link and a box that goes down for ever; negative: they meet."""
    corners = np.array([[begin, height], [begin + width, height]])
    along = b - a
    normals = [np.array([-1.0, 0.0]), np.array([1.0, 0.0]), np.array([0.0, 1.0])]
    across = np.array([-along[1], along[0]]) / np.linalg.norm(along)
    normals += [across if across[1] > 0 else -across]
    return max(min(m @ (p - c) for p in (a, b) for c in corners) for m in normals)


def test_the_distance_is_never_more_than_it_is_and_hardly_less() -> None:
    a, b = ca.SX.sym("a", 2), ca.SX.sym("b", 2)
    found = ca.Function("distance", [a, b], [distance(a, b, 0.3, 0.2, 0.5, SMOOTH)])
    rng = np.random.default_rng(1)
    missing = []
    for _ in range(4000):
        p, q = rng.uniform([-0.2, 0.0], [1.0, 1.2], (2, 2))
        exact, smooth = separation(p, q, 0.3, 0.2, 0.5), float(found(p, q))
        assert smooth <= max(exact, 0.0) + 1e-12  # within the box it is negative, how deep does not matter
        missing.append(exact - smooth if exact > 0 else 0.0)
    assert np.max(missing) < 5 * SMOOTH
    assert np.median(missing) < 1e-6


def test_what_is_too_near_by_the_distance_is_what_the_cut_off_link_says() -> None:
    """Two ways to the same answer: separating axes, and the lowest point of the link above the box's width."""
    rng = np.random.default_rng(2)
    for _ in range(4000):
        a, b = rng.uniform([-0.2, 0.0], [1.0, 1.2], (2, 2))
        lowest = height_over((a[None], b[None]), 0.3, 0.2)
        assert (lowest > 0.5) == (separation(a, b, 0.3, 0.2, 0.5) > 0)


def test_a_mass_point_on_a_parabola() -> None:
    """At speed v over a box in the middle of its flight it is H - g (w / 2 v)^2 / 2 above the sides; of no width, H."""
    H, v, g = 0.8, 2.0, 9.81
    t = np.linspace(-0.4, 0.4, 80001)
    point = np.stack([v * t, H - g * t**2 / 2], axis=1)
    links = point[:-1], point[1:]
    for w in (0.0, 0.1, 0.4):
        assert height_over(links, -w / 2, w) == pytest.approx(H - g * (w / (2 * v)) ** 2 / 2, abs=1e-7)


def test_upright_links_and_links_that_do_not_come_there() -> None:
    upright = np.array([[0.35, 0.9]]), np.array([[0.35, 0.6]])
    assert height_over(upright, 0.3, 0.2) == pytest.approx(0.6)
    assert height_over(upright, 0.4, 0.2) == np.inf


def test_what_it_needs_is_said(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["solve", "--objective", "obstacle"]) == 2
    assert "give hop.obstacle.width [m], such as --set hop.obstacle.width=0.2" in capsys.readouterr().err
    with pytest.raises(UsageError, match="along x and z"):
        Hop(load("paper", {"hop.obstacle.width": 0.2, "leg.guides": ["z"]}), "obstacle")


def test_it_is_a_hop_that_lands() -> None:
    """Whatever hop.kind says of a single hop: beyond the obstacle the leg comes to rest."""
    assert Hop(load("paper", {"hop.obstacle.width": 0.2}), "obstacle").design.hop.kind == "landing"
    again = {"hop.obstacle.width": 0.2, "hop.kind": "periodic", "hop.speed": 1.0}
    assert Hop(load("paper", again), "obstacle").design.hop.kind == "periodic"


@cache
def over() -> Solution:
    return solve(
        load("paper", {"hop.obstacle.width": 0.2, "solver.flight_intervals": 30}), "obstacle", starts=1, processes=1
    )


@pytest.mark.rarely
def test_the_hop_clears_what_it_says_and_a_planted_intrusion_fails() -> None:
    """Two ways: the program's smooth distance, and the area that the links of the stored table sweep."""
    s = over()
    assert s.verified
    assert s.summary.obstacle is not None
    assert s.summary.obstacle_m is not None
    assert s.summary.obstacle.height_m == pytest.approx(s.summary.obstacle_m, abs=1e-3)
    assert s.summary.obstacle.height_m >= s.summary.obstacle_m - 1e-5
    landed = s.summary.landing
    assert landed is not None
    assert landed.step_m > s.summary.obstacle.begins_m + s.summary.obstacle.width_m
    table = s.tables[FLIGHT]
    lower = table.q.copy()
    lower[-1, :, 1] -= 1e-2  # the whole leg, in the last interval before the apex
    checks = verify_plan(s.design, {**s.tables, FLIGHT: replace(table, q=lower)}, s.claims(), "free")
    assert "claimed obstacle_m" in [c.name for c in checks if not c.passed]
    assert "obstacle" in ho.Solution.with_methods(s).plot()
