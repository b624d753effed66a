"""Does the leg meet the body? A ball planted beside a plan's swing, its distance from the shank in closed form."""

from pathlib import Path

import numpy as np
import pytest

from hopopt.cli.screen.motion import nearest_lines
from hopopt.design import Design
from hopopt.planner.solution import Solution
from hopopt.planner.solve import solve
from hopopt.problem.load import load
from hopopt.verify.check import failed
from hopopt.verify.hops.collision import collision, collision_checks
from hopopt.verify.plan import verify_plan
from once import solved_once

BALL, SHANK = 0.015, 0.02  # m, radii


@pytest.fixture(scope="module")
def plan() -> Solution:
    return solved_once({"hop.stance_duration": [0.03, 0.2]})


def with_ball(tmp_path: Path, place: np.ndarray, more: str = "collision_margin = 0.0") -> Design:
    """The paper's leg with a round shank, and a ball on the body at (x, z) [m]."""
    (tmp_path / "ball.toml").write_text(
        f'extends = "paper"\nname = "ball"\n[hop]\nstance_duration = [0.03, 0.2]\n{more}\n[leg.shank]\nradius = {SHANK}\n'
        f"[leg.body.shapes.ball]\npoints = [[{place[0]}, 0.0, {place[1]}]]\nradius = {BALL}\ncounts = false\n"
    )
    return load(tmp_path / "ball.toml")


def swing(plan: Solution) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times [s], and where knee and foot are from the hip (k, 2) [m]."""
    s = plan.sample(np.linspace(0, plan.end, 20_001))
    return s.t, s.points["knee"] - s.points["hip"], s.points["foot"] - s.points["hip"]


def apart(place: np.ndarray, knee: np.ndarray, foot: np.ndarray) -> np.ndarray:
    """Distances (k,) [m] of a point from the shank's line."""
    along = foot - knee
    share = np.clip(((place - knee) * along).sum(axis=1) / (along**2).sum(axis=1), 0, 1)
    return np.linalg.norm(place - knee - share[:, None] * along, axis=1)


@pytest.mark.parametrize("beside", [0.05, 0.0])
def test_the_least_distance_is_that_of_a_ball_from_the_shank(plan: Solution, beside: float, tmp_path: Path) -> None:
    """Beside the swing it is passed, in it it is met, which no answer may do unless that is asked for."""
    t, knee, foot = swing(plan)
    middle = int(np.searchsorted(t, 0.5 * (plan.lift_off + plan.end)))
    place = foot[middle] + (foot[middle] - knee[middle]) * beside / np.linalg.norm(foot[middle] - knee[middle])
    design, true = with_ball(tmp_path, place), apart(place, knee, foot) - BALL - SHANK
    found = collision(design, plan.tables)
    assert found is not None
    assert found.between == ("shank", "ball")
    assert found.least_distance_m == pytest.approx(true.min(), abs=1e-5)
    assert np.interp(found.time_s, t, true) == pytest.approx(true.min(), abs=1e-4)
    names = [check.name for check in failed(verify_plan(design, plan.tables, plan.claims()))]
    assert names == ([] if true.min() > 0 else ["collision"])
    asked = with_ball(tmp_path, place, "may_collide = true")
    assert not failed(verify_plan(asked, plan.tables, plan.claims()))
    words = "passes ball at" if true.min() > 0 else "passes ball inside it by"
    assert f"nearest: shank {words} {1000 * abs(true.min()):.1f} mm" in nearest_lines(found)[0]


def test_a_link_that_keeps_less_than_the_margin_fails_by_what_is_missing(plan: Solution, tmp_path: Path) -> None:
    """The ball is passed nearer than the margin; one that touches the thigh around its joint changes nothing."""
    t, knee, foot = swing(plan)
    middle = int(np.searchsorted(t, 0.5 * (plan.lift_off + plan.end)))
    way = (foot[middle] - knee[middle]) / np.linalg.norm(foot[middle] - knee[middle])
    place = foot[middle] + way * 0.05
    true = apart(place, knee, foot) - BALL - SHANK
    design = with_ball(tmp_path, place, f"collision_margin = {true.min() + 0.002}")
    (check,) = collision_checks(design, plan.tables)
    assert not check.passed
    assert check.residual == pytest.approx(0.002, abs=1e-5)
    beside = "[leg.thigh]\nradius = 0.02\n[leg.body.shapes.by]\npoints = [[0.0, 0.0, 0.0]]\nradius = 0.02\nat = [0.0, 0.0, 0.021]\n"
    (tmp_path / "ball.toml").write_text((tmp_path / "ball.toml").read_text() + beside)
    near = collision(load(tmp_path / "ball.toml"), plan.tables)
    assert near is not None
    assert near.between == ("shank", "ball")
    (again,) = collision_checks(load(tmp_path / "ball.toml"), plan.tables)
    assert again.residual == pytest.approx(check.residual, abs=1e-9)


def test_neighbours_that_turn_beside_each_other_are_measured_and_nothing_is_promised(
    plan: Solution, tmp_path: Path
) -> None:
    """A plate 1 mm beside the hip, which the thigh passes at every angle."""
    with_ball(tmp_path, np.array([5.0, 5.0]))
    plate = "[leg.thigh]\nradius = 0.02\n[leg.body.shapes.plate]\nbox = [0.02, 0.01, 0.02]\nat = [0.0, 0.026, 0.0]\n"
    (tmp_path / "ball.toml").write_text((tmp_path / "ball.toml").read_text() + plate)
    design = load(tmp_path / "ball.toml")
    near = collision(design, plan.tables)
    assert near is not None
    rods = f"{(tmp_path / 'ball.toml').read_text()}[leg.knee.transmission.four_bar]\n"
    (tmp_path / "rods.toml").write_text(
        rods + "ground = 0.38\ncrank = 0.05\nrod = 0.38\narm = 0.05\nstretched = -2.8\n"
    )
    moved = collision(load(tmp_path / "rods.toml"), plan.tables)
    assert moved is not None
    assert nearest_lines(moved)[0].endswith("; not looked at, as without solids: crank and rod of the knee")
    assert near.between == ("thigh", "plate")
    assert near.least_distance_m == pytest.approx(0.001, abs=1e-6)
    assert near.margin_m is None
    (check,) = collision_checks(design, plan.tables)
    assert check.passed


@pytest.mark.slow
def test_a_planted_ball_is_avoided_and_costs_height(plan: Solution, tmp_path: Path) -> None:
    """The margin is kept by coal, whose distances the planner does not see."""
    t, _, foot = swing(plan)
    middle = int(np.searchsorted(t, 0.9 * plan.end))
    design = with_ball(tmp_path, foot[middle], "")
    found = solve(design, starts=1, processes=1)
    near = found.summary.collision
    assert found.summary.verified
    assert near is not None
    assert near.margin_m is not None
    assert near.margin_m == pytest.approx(0.005 * 0.741)
    assert near.margin_m - 1e-4 < near.least_distance_m < 0.02
    assert near.error_m is not None
    assert found.summary.clearance_m < plan.summary.clearance_m - 1e-5


@pytest.mark.slow
def test_a_box_where_a_leg_comes_down_to_land_is_found_and_avoided(tmp_path: Path) -> None:
    """The box has a corner where the shank passes in the descent alone. Points on the shank tell how near the solved hop comes."""
    lands = {"hop.stance_duration": [0.03, 0.2], "hop.kind": "landing"}
    bare, half = solved_once(lands), 0.015
    t, knee, foot = swing(bare)
    down = np.flatnonzero((t > bare.tables["flight"].t[-1, -1]) & (t < bare.tables["landing"].t[0, 0]))
    others = np.delete(np.arange(len(t)), down)
    middle = max(down[::100], key=lambda k: apart(foot[k], knee[others], foot[others]).min())
    place = foot[middle]
    with_ball(tmp_path, place, 'kind = "landing"')
    box = f"box = [{2 * half}, 0.06, {2 * half}]\nat = [{place[0]}, 0.0, {place[1]}]\ncounts = false\n"
    text = (tmp_path / "ball.toml").read_text().partition("[leg.body.shapes.ball]")[0]
    (tmp_path / "ball.toml").write_text(f"{text}[leg.body.shapes.box]\n{box}")
    design = load(tmp_path / "ball.toml")
    (wrong,) = failed(verify_plan(design, bare.tables, bare.claims()))
    assert wrong.name == "collision"
    found = solve(design, starts=1, processes=1)
    near, (_, knee, foot) = found.summary.collision, swing(found)
    assert found.verified
    assert near is not None
    beside = [np.abs(knee + share * (foot - knee) - place) - half for share in np.linspace(0, 1, 201)]
    least = min(float(np.linalg.norm(np.maximum(away, 0.0), axis=1).min()) for away in beside) - SHANK
    assert near.least_distance_m == pytest.approx(least, abs=2e-5)
    assert near.margin_m is not None
    assert least > near.margin_m - 1e-4


def test_a_leg_without_shapes_has_no_distance(plan: Solution) -> None:
    assert collision(plan.design, plan.tables) is None
    assert plan.summary.collision is None
