"""The global search: what it finds, that its rollouts are motions of the leg, and where it does not apply."""

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hopopt import load
from hopopt.compiled.kernel import packed
from hopopt.design import Design
from hopopt.drivetrain.operating_region.region import operating_region
from hopopt.errors import UsageError
from hopopt.evidence.dynamic_programming import by_dynamic_programming, reduced
from hopopt.global_search import GlobalSearch, Rollout, applies, left_out, search
from hopopt.global_search.constants import stance_constants, to_link_angles
from hopopt.global_search.equations.flight import flight_of, fold_loss
from hopopt.global_search.equations.four_states import fastest_joints
from hopopt.global_search.posture import tuck_height
from hopopt.leg.geometry.distance import distances_of
from hopopt.leg.kinematics import start_angles
from hopopt.leg.robot import build_robot
from hopopt.sim.machine import Machine

SIZE = 11
BEST_KNOWN = 0.79935  # m: clearance of the paper's leg on ideal ground
PLANES, FORCE = 0.02, 3.0  # tolerances: share of a drive's region; ground force [N]
ANGLE, HEIGHT = 1e-6, 1e-6  # rad, m

TRUNKED = {"mass": 5.6, "shapes": {"trunk": {"box": (0.2, 0.2, 0.2)}}}

CASES = {
    "ideal ground": [],
    "friction": ["contact.friction=0.6", "contact.least_force=15", "hop.least_height=0.02"],
    "no counter-movement": ["hop.counter_movement=false", "contact.friction=0.8"],
    "other laws": ["leg.motor.laws=[\"four-quadrant\"]", "leg.gear.torque_cap=107", "leg.gear.speed_cap=680"],
    "slider": ['leg.guides=["z"]', "contact.friction=0.3", "start.foot_x=0.03"],
}  # fmt: skip


@pytest.fixture(scope="module")
def found() -> dict[str, tuple[Design, GlobalSearch]]:
    designs = {name: load("paper", settings) for name, settings in CASES.items()}
    return {name: (design, search(design, SIZE)) for name, design in designs.items()}


@pytest.mark.parametrize("name", CASES)
def test_rollouts_keep_all_limits(found: dict[str, tuple[Design, GlobalSearch]], name: str) -> None:
    design, result = found[name]
    assert result.rollouts
    for rollout in result.rollouts:
        _check_motion(rollout)
        np.testing.assert_allclose(rollout.q[0], start_angles(design), atol=1e-3)
        assert design.hop.stance_duration[0] - 1e-9 <= rollout.t[-1] <= design.hop.stance_duration[1] + 1e-9
        _check_limits(design, rollout)
        assert _clearance(design, rollout) - _lost_in_flight(design, rollout) == pytest.approx(
            rollout.clearance, abs=2e-3
        )


def _check_motion(r: Rollout) -> None:
    """Speeds and angles follow from the accelerations."""
    dt = np.diff(r.t)[:, None]
    close = 2e-2 * float(np.abs(r.v).max())  # on a slider the joints' accelerations change within a step
    np.testing.assert_allclose(np.diff(r.v, axis=0), dt * r.a[:-1], atol=close)
    np.testing.assert_allclose(np.diff(r.q, axis=0), dt * (r.v[:-1] + r.v[1:]) / 2, atol=2e-3)


def _check_limits(design: Design, r: Rollout) -> None:
    """Halfway through each step: drives and ground; at its end: angles, heights, no descent."""
    robot = build_robot(design.leg)
    machine, slider = Machine(robot), "x" not in design.leg.guides
    regions = [operating_region(design.leg, name, robot.parameters) for name in design.leg.joints]
    dt = np.diff(r.t)[:, None]
    middles = r.q[:-1] + dt / 2 * (r.v[:-1] + dt / 4 * r.a[:-1]), r.v[:-1] + dt / 2 * r.a[:-1]
    for q, v, a in zip(*middles, r.a[:-1], strict=True):
        terms = machine.stance_terms(q, v)
        tau, (fx, fz) = terms.mass_matrix @ a + terms.joint_bias, terms.force(a)
        assert fz > design.contact.least_force - FORCE
        if not slider:  # there a horizontal force that the guide answers enters the torques
            use = [max(region.use(w, t)) for region, w, t in zip(regions, v, tau, strict=True)]
            assert max(use) < 1 + PLANES
            friction = design.contact.friction
            assert friction is None or abs(fx) < friction * fz + FORCE
    sides = np.array([[design.leg.joint[name].lower, design.leg.joint[name].upper] for name in design.leg.joints])
    assert np.all(r.q >= sides[:, 0] - ANGLE)
    assert np.all(r.q <= sides[:, 1] + ANGLE)
    for q, v in zip(r.q, r.v, strict=True):
        terms = machine.stance_terms(q, v)
        points = machine.points(terms.q)
        assert min(points[name][1] for name in design.leg.joints) > design.hop.least_height - HEIGHT
        assert design.hop.counter_movement or terms.v[1] > -1e-3


def _lost_in_flight(design: Design, r: Rollout) -> float:
    """What folding takes of it [m]; on a slider legs are taken to fold in no time."""
    if "x" not in design.leg.guides:
        return 0.0
    c = stance_constants(design)
    flight = packed(flight_of(c, design.hop.foot_window, fastest_joints(design)))
    return fold_loss(packed(c), flight, *to_link_angles(c, r.q[-1]), *to_link_angles(c, r.v[-1]))


def _clearance(design: Design, r: Rollout) -> float:
    """From the last state, in Pinocchio's words, the leg folded in no time."""
    machine, c = Machine(build_robot(design.leg)), stance_constants(design)
    terms = machine.stance_terms(r.q[-1], r.v[-1])
    com, speed = machine.points(terms.q)["com"][1], machine.com_velocity(terms.q, terms.v)[1]
    return com + max(speed, 0.0) ** 2 / 2 / c.gravity - tuck_height(c, design.hop.foot_window)


def test_rollouts_differ_and_the_best_comes_first(found: dict[str, tuple[Design, GlobalSearch]]) -> None:
    rollouts = found["friction"][1].rollouts
    heights = [r.clearance for r in rollouts]
    assert heights == sorted(heights, reverse=True)
    durations = np.array([r.t[-1] for r in rollouts])
    assert np.ptp(durations) > 0.1  # a short push and a long stance


def test_finer_grids_come_closer_to_the_best_known_hop(found: dict[str, tuple[Design, GlobalSearch]]) -> None:
    design, coarse = found["ideal ground"]
    fine = search(design, 17)
    assert coarse.value < fine.value < 1.01 * BEST_KNOWN
    assert fine.value > 0.9 * BEST_KNOWN
    assert 0.95 * BEST_KNOWN < fine.rollouts[0].clearance < 1.01 * BEST_KNOWN


@pytest.mark.parametrize(
    ("entry", "answer"),
    [("leg.motor.max_speed=250", 0.1556), ("leg.motor.max_torque=0.4", 0.4671), ("leg.gear.ratio=400", 0.2535)],
)
def test_slow_drives_give_no_false_alarm(entry: str, answer: float) -> None:
    """Of legs that fold slowly the flight counts: nothing on a small grid passes the known hop [m]."""
    said = search(load("paper", [entry]), 9)
    assert max(said.value, *(r.clearance for r in said.rollouts)) < 1.01 * answer


def test_one_thread_finds_the_same(found: dict[str, tuple[Design, GlobalSearch]]) -> None:
    design, two = found["friction"]
    one = search(design, SIZE, threads=1)
    assert one.value == two.value
    assert len(one.rollouts) == len(two.rollouts)
    for a, b in zip(one.rollouts, two.rollouts, strict=True):
        np.testing.assert_array_equal(a.q, b.q)


MIRRORED = ["leg.hip.lower=-1.3", "leg.hip.upper=0.6", "leg.knee.lower=0.15", "leg.knee.upper=2.4"]
TURNED = ["leg.hip.axis=[0,1,0]", "leg.knee.axis=[0,1,0]", *MIRRORED]


@pytest.mark.parametrize("settings", [MIRRORED, TURNED], ids=["mirrored", "axes turned"])
def test_the_same_leg_seen_otherwise(found: dict[str, tuple[Design, GlobalSearch]], settings: Sequence[str]) -> None:
    """Folded to the other side, or with joints that count the other way."""
    other = search(load("paper", [*CASES["friction"], *settings]), SIZE)
    assert other.value == pytest.approx(found["friction"][1].value, rel=1e-3)  # ties of vertices differ


def test_slider_agrees_with_the_reduced_hop() -> None:
    """The same problem by the study's own dynamic programming, which counts the height of the centre of mass."""
    design = reduced(load("paper", ["hop.stance_duration=[0.03,0.2]"]))
    tuck = tuck_height(stance_constants(design), design.hop.foot_window)
    assert search(design, 13).value + tuck == pytest.approx(by_dynamic_programming(design, 78), rel=2e-3)


@pytest.mark.slow
def test_motions_meet_nothing_and_keep_the_trunk_above_the_ground(tmp_path: Path) -> None:
    """A bar behind the hip, which the folded shank would pass, and below it a plate: coal's distances of all states."""
    (tmp_path / "bar.toml").write_text(
        'extends = "paper"\nname = "bar"\n[leg.body.shapes.bar]\npoints = [[-0.15, 0.0, -0.15]]\nradius = 0.05\n'
        "[leg.body.shapes.plate]\nbox = [0.02, 0.02, 0.02]\nat = [-0.15, 0.0, -0.245]\n[leg.shank]\nradius = 0.02\n"
        "[hop]\nleast_height = 0.02\n"
    )
    design = load(tmp_path / "bar.toml")
    result, solids, machine = search(design, SIZE), distances_of(design), Machine(build_robot(design.leg))
    assert result.rollouts
    for r in result.rollouts:
        ways = np.concatenate([np.linspace(a, b, 9) for a, b in pairwise(r.q)])
        assert float(solids.all(ways).min()) > 0
        lowest = [machine.points(machine.stance_terms(q, v).q)["trunk"][1] for q, v in zip(r.q, r.v, strict=True)]
        assert min(lowest) > 0.02 - HEIGHT
    assert left_out(design) is None


@pytest.mark.parametrize(
    ("name", "changes", "reason"),
    [
        ("paper", {}, None),
        ("paper", {"guides": ("z",)}, None),
        ("three_joint", {}, "3 joints"),
        ("paper", {"knee": {"lower": -2, "upper": 0, "axis": (1, 0, 0)}}, "leaves the x-z plane"),
        ("paper", {"shank": {"length": 0.3, "mass": 1.0, "direction": (0, 1, 0)}}, "points across"),
        ("paper", {"guides": ("x",)}, "no guide"),
        ("paper", {"body": TRUNKED}, None),
        ("paper", {"guides": ("z",), "body": TRUNKED}, "what shape"),
        ("paper", {"guides": ("z",), "lowest": "joints", "body": TRUNKED}, "what shape"),
        ("paper", {"guides": ("z",), "body": TRUNKED, "may_collide": True}, "what shape"),
        ("paper", {"guides": ("z",), "lowest": "joints", "body": TRUNKED, "may_collide": True}, None),
    ],
)
def test_where_it_applies(name: str, changes: dict[str, Any], reason: str | None) -> None:
    data = load(name).model_dump(exclude_none=True)
    hop = {**data["hop"], **{key: value for key, value in changes.items() if key == "may_collide"}}
    leg = {**data["leg"], **{key: value for key, value in changes.items() if key != "may_collide"}}
    said = applies(Design.model_validate({**data, "leg": leg, "hop": hop}))
    assert (said is None) == (reason is None)
    assert reason is None or (said is not None and reason in said)


def test_refuses_what_it_is_not_made_for() -> None:
    with pytest.raises(UsageError, match="3 joints"):
        search(load("three_joint"))
    with pytest.raises(UsageError, match="a size from"):
        search(load("paper"), 3)
