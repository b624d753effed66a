"""Over a box: the distance that the program knows, the box that is measured, and a hop that both agree on."""

from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import casadi as ca
import numpy as np
import pytest
from scipy.spatial import ConvexHull

import hopopt as ho
from hopopt.cli.main import run
from hopopt.design import Design
from hopopt.errors import UsageError
from hopopt.leg.geometry.hulls import coal
from hopopt.leg.geometry.outlines import outlines, seen
from hopopt.leg.limit_id import Kind, LimitId
from hopopt.ocp.hop import Hop
from hopopt.ocp.hops.obstacle import distance, distance_of_polygon
from hopopt.planner.motion import Motion
from hopopt.planner.search.multistart import first_transcription, solution_of
from hopopt.planner.search.neighbours.obstacle_place import below_the_middle
from hopopt.planner.search.neighbours.relaxations import QUICK, own_bounds, wider
from hopopt.planner.solution import Solution
from hopopt.planner.solve import solve
from hopopt.problem.load import load
from hopopt.sim.machine import Machine
from hopopt.verify.hops.obstacle import height_over, highest_box
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


def test_a_polygon_is_clear_of_the_box_where_the_lowest_of_its_sides_above_the_box_is() -> None:
    """Two ways again, of round links: any side may be the one that separates."""
    rng, circle = np.random.default_rng(3), 2 * np.pi * np.arange(8) / 8
    corner = [ca.SX.sym(f"c{k}", 2) for k in range(16)]
    functions = dict[int, ca.Function]()
    clear = 0
    for _ in range(2000):
        ends, radius = rng.uniform([-0.2, 0.0], [1.0, 1.2], (2, 2)), rng.uniform(0.01, 0.1)
        points = (ends[:, None] + radius * np.stack([np.cos(circle), np.sin(circle)], axis=1)).reshape(-1, 2)
        corners = points[ConvexHull(points).vertices]
        k = len(corners)
        if k not in functions:
            own = corner[:k]
            turned = [(b - a) / ca.norm_2(b - a) for a, b in zip(own, [*own[1:], own[0]], strict=True)]
            sides = [(a, ca.vertcat(along[1], -along[0])) for a, along in zip(own, turned, strict=True)]
            found = distance_of_polygon([own, own, own], sides, (0.3, 0.2, 0.5), SMOOTH)
            functions[k] = ca.Function("distance", [ca.horzcat(*own)], [found])
        lowest = height_over((corners, np.roll(corners, -1, axis=0)), 0.3, 0.2)
        smooth = float(functions[k](corners.T))
        assert smooth <= 0 or lowest > 0.5
        assert smooth > 0 or lowest < 0.5 + 5 * SMOOTH
        clear += lowest > 0.5
    assert 300 < clear < 1700


def test_an_outline_holds_all_that_is_measured() -> None:
    """The planner's polygons about trunk and links have within them every corner that the second way measures."""
    design = load_trunk()
    shapes, q = outlines(design.leg), np.zeros((1, 4))
    assert list(shapes) == ["trunk", "thigh", "shank"]
    for shape, (corners,) in zip(shapes.values(), seen(design.leg, q), strict=True):
        begin = np.array([0.0, -0.38]) if shape.name == "shank" else np.zeros(2)
        outside = [np.max((corners - begin - a) @ away) for a, away in shape.faces]
        assert max(outside) < 0.003 * 0.035
    assert not outlines(design.model_copy(update={"leg": design.leg.model_copy(update={"lowest": "joints"})}).leg)
    assert not outlines(load("paper").leg)


@pytest.mark.parametrize(("link", "other"), [("thigh", 0.41), ("shank", 0.35)])
def test_an_outline_goes_with_the_length_of_its_link(link: str, other: float) -> None:
    """Its corners, moved by their derivatives, are those of a leg that is built with another length."""
    leg, data = load_trunk().leg, load_trunk().model_dump(exclude_none=True)
    data["leg"][link]["length"] = other
    here, there = outlines(leg)[link], outlines(Design.model_validate(data).leg)[link]
    more = other - leg.link[link].length
    np.testing.assert_allclose(here.corners + more * here.by_length, there.corners, atol=1e-9)
    for (_, a), (_, b) in zip(here.faces, there.faces, strict=True):
        np.testing.assert_allclose(a, b, atol=1e-9)


TRUNK: dict[str, Any] = {  # of the body: x, y, z and where its middle is from the hip [m]; radii of the links [m]
    "box": [0.4, 0.2, 0.16], "at": [-0.05, 0.0, 0.06], "thigh": 0.035, "shank": 0.025,
}  # fmt: skip


def load_trunk(more: str = "") -> Design:
    """The paper's leg with a trunk and round links."""
    with TemporaryDirectory() as folder:
        file = Path(folder) / "trunk.toml"
        file.write_text(
            f'extends = "paper"\nname = "trunk"\n[leg.body.shapes.trunk]\nbox = {TRUNK["box"]}\nat = {TRUNK["at"]}\n'
            f"[leg.thigh]\nradius = {TRUNK['thigh']}\n[leg.shank]\nradius = {TRUNK['shank']}\n[hop.obstacle]\nwidth = 0.2\n{more}"
        )
        return load(file)


def capsule(a: np.ndarray, b: np.ndarray, radius: float) -> tuple[Any, Any]:
    """coal's, from a to b (x, z) [m]."""
    middle, along = (a + b) / 2, (b - a) / np.linalg.norm(b - a)
    turn = np.array([[along[1], 0.0, along[0]], [0.0, 1.0, 0.0], [-along[0], 0.0, along[1]]])
    return coal.Capsule(radius, float(np.linalg.norm(b - a))), coal.Transform3s(
        turn, np.array([middle[0], 0.0, middle[1]])
    )


@pytest.mark.slow
def test_no_point_of_trunk_or_link_is_in_the_obstacle() -> None:
    """By coal, which neither the planner's polygons nor the cut-off sides know, over a fine grid of times; of a rough plan, whose
    limits hold at its nodes."""
    hop = Hop(load_trunk("[solver]\nstance_intervals = 12\nflight_intervals = 10\n"), "obstacle")
    (found,) = below_the_middle(hop, 1)
    plan = Motion(hop.design, "obstacle", solution_of(found, first_transcription(hop)).phases)
    height, begins = highest_box(Machine(plan.robot), hop.design.hop, plan.tables)
    assert found.success
    assert 0.9 * found.value < height < found.value + 1e-3
    assert not below_the_middle(
        Hop(load("paper", {"hop.obstacle.width": 0.2}), "obstacle"), 1
    )  # a body that is a point
    solid = coal.Box(0.2, 2.0, height)
    there, trunk = coal.Transform3s(np.eye(3), np.array([begins + 0.1, 0.0, height / 2])), coal.Box(*TRUNK["box"])
    s, least = plan.sample(np.linspace(0.0, plan.end, 4001)), np.inf
    for hip, knee, foot in zip(*(s.points[name] for name in ("hip", "knee", "foot")), strict=True):
        at = coal.Transform3s(np.eye(3), np.array([hip[0], 0.0, hip[1]]) + TRUNK["at"])
        for body, place in ((trunk, at), capsule(hip, knee, TRUNK["thigh"]), capsule(knee, foot, TRUNK["shank"])):
            least = min(least, coal.distance(body, place, solid, there, coal.DistanceRequest(), coal.DistanceResult()))
    assert -1e-4 < least < 5e-4  # m; between the instants that are looked at links go a little on


def test_without_the_trunk_s_obstacle_every_link_still_has_its_own() -> None:
    """What a start relaxes; on a body that is a point there is nothing to relax."""
    t, name = first_transcription(Hop(load_trunk(), "obstacle")), "no obstacle for the trunk"
    (relaxation,) = (r for r in QUICK if r.name == name)
    assert relaxation.suits(t)
    wide, own = wider(t, relaxation), own_bounds(t)
    changed = wide.low_g != own.low_g
    rows = [r for r in t.rows if isinstance(r.name, LimitId) and r.name.kind is Kind.OBSTACLE]
    labels = np.concatenate([np.tile([str(label.label) for label in r.labels], len(r.interval)) for r in rows])
    where = np.concatenate([np.arange(r.start, r.stop) for r in rows])
    assert set(labels) == {"trunk", "thigh", "shank"}
    np.testing.assert_array_equal(np.flatnonzero(changed), where[labels == "trunk"])
    assert np.isneginf(wide.low_g[changed]).all()
    assert not relaxation.suits(first_transcription(Hop(load("paper", {"hop.obstacle.width": 0.2}), "obstacle")))


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
