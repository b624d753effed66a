"""Figures of simulated runs: what they show is what was recorded, and every strategy can be told from the others."""

import re
from collections.abc import Callable
from dataclasses import replace
from itertools import combinations, pairwise
from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.transforms import Bbox

from hopopt.comparison.compare import OPTIMUM
from hopopt.control.closed_loop import simulate
from hopopt.control.reference import PhaseReference, PlanReference
from hopopt.control.strategies import BUILT_IN, find
from hopopt.design import Design
from hopopt.drivetrain.motor import rated
from hopopt.errors import ResultError
from hopopt.leg.scales import weight
from hopopt.paper.stiffness import HEIGHT_MARGIN, neutral, secant_stiffness
from hopopt.plots.controllers.runs import FIGURES, save_all
from hopopt.plots.controllers.runs_style import by_stance, last, looks
from hopopt.plots.controllers.tracking import tracking
from hopopt.plots.style import BLACK, FIGURE_SIZE
from hopopt.problem.load import load
from hopopt.sim.controller import Measurement
from hopopt.sim.hop_metrics import HopFigures

Runs = dict[str, HopFigures]
NEUTRAL = neutral(load("paper"))
COARSE = {"simulation.control_rate": 500.0, "simulation.encoder_bits": 0}
THREE = {
    "leg.joints": ["hip", "knee", "ankle"], "leg.links": ["thigh", "shank", "toe"],
    "leg.ankle": {"lower": -1.0, "upper": 1.2}, "leg.toe": {"length": 0.12, "mass": 0.2},
    "start.joint_angles": [0.9, -1.9, 1.0],
}  # fmt: skip
FIVE = (OPTIMUM, "track", "force", "force_tuck", "position")
CASES = ("one", "five", "two hops", "never flies", "three joints")
COMPARED = ("five", "never flies")  # these have an optimum
DRAWN = [(name, case) for name in FIGURES for case in (COMPARED if name == "budget" else CASES)]


class Limp:
    """No torque at all: the leg folds."""

    def torque(self, now: Measurement) -> np.ndarray:
        return np.zeros(len(now.q))


class Stretch:
    """Every joint pulled straight."""

    def torque(self, now: Measurement) -> np.ndarray:
        return -60 * now.q


def hop(strategy: str, design: Design | None = None, **more: object) -> HopFigures:
    return simulate(design or load("paper", COARSE), find(strategy), **more).figures  # type: ignore[arg-type]


def another(run: HopFigures, by: float) -> HopFigures:
    """The run again, a hair's breadth beside it: to the figures another stance."""
    return replace(run, trace=replace(run.trace, q=run.trace.q + by))


@pytest.fixture(scope="module")
def runs() -> Callable[[str], Runs]:
    """The runs of a case, simulated once. The names stand for nothing: force_tuck clears most, and is the optimum."""
    kept: dict[str, Runs] = {}

    def make(case: str) -> Runs:
        if case == "one":
            return {"force": hop("force")}
        if case == "five":
            made = {name: hop(name) for name in ("force", "force_tuck", "position")}
            return {name: made.get(name) or another(made["force_tuck"], 1e-12 * k) for k, name in enumerate(FIVE, 1)}
        if case == "two hops":
            return {"force": hop("force", hops=2)}
        if case == "never flies":
            return {OPTIMUM: hop("force"), "limp": hop("force", controller=Limp())}
        with pytest.MonkeyPatch.context() as patch:  # the plant that is not compiled, which takes 20 s for three joints
            patch.setattr("hopopt.control.closed_loop.can_slip", lambda leg: False)
            return {"stretch": hop("force", load("paper", {**COARSE, **THREE}), controller=Stretch())}

    def get(case: str) -> Runs:
        if case not in kept:
            kept[case] = make(case)
        return kept[case]

    return get


def boxes(ax: Axes, axis: str) -> list[Bbox]:
    """Boxes [pixels] of the visible tick labels of an axis."""
    low, high = sorted(ax.get_xlim() if axis == "x" else ax.get_ylim())
    ticks = (ax.xaxis if axis == "x" else ax.yaxis).get_major_ticks()
    inside = (t.label1 for t in ticks if low <= t.get_loc() <= high and t.label1.get_visible())
    return [label.get_window_extent() for label in inside if label.get_text()]


def names_in(texts: list[str], runs: Runs) -> list[str]:
    """The runs that the texts name: one, or several that share their stance."""
    found = [re.match(r"\w+", name) for text in texts for name in text.split(":")[0].split(", ")]
    return [match[0] for match in found if match and match[0] in runs]


QUICK = ("five", "never flies")


@pytest.mark.parametrize(
    ("name", "case"), [pytest.param(*each, marks=() if each[1] in QUICK else pytest.mark.slow) for each in DRAWN]
)
def test_every_figure_can_be_read(runs: Callable[[str], Runs], name: str, case: str) -> None:
    """Axes have units, labels do not touch, every strategy is named once, and the legend covers nothing."""
    figure = FIGURES[name](runs(case))
    figure.draw_without_rendering()
    page = figure.bbox
    for ax in figure.axes:
        for label in (ax.get_xlabel(), ax.get_ylabel()):  # in a grid only its outer axes have some
            assert not label or re.search(r"\S \[.+\]$", label)
        for axis in "xy":
            assert not any(a.overlaps(b) for a, b in pairwise(boxes(ax, axis)))
        assert all(page.x0 <= t.get_window_extent().x0 and t.get_window_extent().x1 <= page.x1 for t in ax.texts)
    assert figure.axes[-1].get_xlabel()
    assert figure.axes[0].get_ylabel() or name == "budget"
    parts = [tight for ax in figure.axes if (tight := ax.get_tightbbox())]
    assert not any(a.overlaps(b) for a, b in combinations(parts, 2))
    assert all(page.x0 <= part.x0 and part.x1 <= page.x1 for part in parts)
    shown = [text.get_text() for text in figure.legends[0].get_texts()] if figure.legends else []
    if name == "stick":
        shown = [ax.get_title(loc="left") for ax in figure.axes]
    elif name == "budget":
        shown = [OPTIMUM, *(label.get_text() for label in figure.axes[0].get_yticklabels())]
    assert sorted(names_in(shown, runs(case))) == sorted(runs(case))
    for legend in figure.legends:
        box = Bbox.union([text.get_window_extent() for text in legend.get_texts()])
        assert page.x0 <= box.x0
        assert box.x1 <= page.x1
        assert not any(box.overlaps(part) for part in parts)


def curve(figure: Figure, axes: int, label: str) -> np.ndarray:
    """x, y (k, 2) of the curve of a run, without gaps."""
    (line,) = [line for line in figure.axes[axes].lines if str(line.get_label()).startswith(label)]
    xy = np.array(line.get_xydata())
    return xy[~np.isnan(xy).any(axis=1)]


def test_curves_are_the_recorded_samples(runs: Callable[[str], Runs]) -> None:
    (run,) = runs("one").values()
    trace, stance = run.trace, run.trace.t <= run.lift_off["time_s"]
    for name, own in runs("five").items():
        foot = np.column_stack([own.trace.t - own.lift_off["time_s"], own.trace.points["foot"][:, 1]])
        np.testing.assert_array_equal(curve(FIGURES["foot_height"](runs("five")), 0, f"{name}: "), foot)
    bent = another(run, -1.0)  # drawn for this alone: its knee is lower than its foot
    assert (bent.trace.lowest < bent.trace.points["foot"][:, 1] - 0.01).any()
    foot = np.column_stack([bent.trace.t - bent.lift_off["time_s"], bent.trace.points["foot"][:, 1]])
    np.testing.assert_array_equal(curve(FIGURES["foot_height"]({"bent": bent, "force": run}), 0, "bent"), foot)
    for k in range(2):
        way = curve(FIGURES["speed_torque"](runs("one")), k, "force")
        assert set(map(tuple, way)) <= set(zip(trace.v[:, 2 + k], trace.motor[:, k], strict=True))
        assert len(way) in (stance.sum(), stance.sum() - 1)  # at lift-off there is a sample before and one after


def test_saturation_is_the_papers(runs: Callable[[str], Runs]) -> None:
    """C = |tau| / (R tau_max (1 - R |w| / omega_max)), and the legend has its mean."""
    (run,) = runs("one").values()
    figure, drive = FIGURES["saturation"](runs("one")), rated(run.design.leg, "hip")
    ratio = run.design.leg.gear.ratio
    for k, joint in enumerate(run.trace.robot.joints):
        t, c = curve(figure, k, "force").T
        w, tau = (x[: len(t), k] for x in (run.trace.v[:, 2:], run.trace.motor))
        stall, no_load = ratio * drive[0], drive[1] / ratio
        np.testing.assert_allclose(c, np.abs(tau) / (stall * (1 - np.abs(w) / no_load)), atol=1e-9)
        assert t[-1] == 0  # lift-off, in every run
        (text,) = figure.legends[0].get_texts()
        assert f"{joint} {np.trapezoid(c, t) / (t[-1] - t[0]):.2f}" in text.get_text()


def test_speed_torque_curves_stay_in_the_region_drawn(runs: Callable[[str], Runs]) -> None:
    figure = FIGURES["speed_torque"](runs("five"))
    for ax in figure.axes:
        (region,) = ax.patches  # one for the optimum and all controllers
        ways = [line for line in ax.lines if str(line.get_label()).split(", ")[0] in runs("five")]
        assert len(ways) == len(by_stance(runs("five"))[0])
        for way in ways:
            xy = np.array(way.get_xydata())
            assert region.get_path().contains_points(xy[~np.isnan(xy).any(axis=1)] * 0.999).all()


@pytest.mark.parametrize("k", [400.0, 1700.0])
def test_the_secant_stiffness_of_a_spring_is_the_springs(runs: Callable[[str], Runs], k: float) -> None:
    """f_z = k (y_neu - y) + m_e g gives k at every height; nothing near the neutral height or where f_z < 0."""
    (run,) = runs("one").values()
    trace, foot = run.trace, run.design.leg.link["shank"].mass * 9.81
    y = trace.q[:, 1] - trace.points["foot"][:, 1]
    spring = np.column_stack([np.zeros(len(y)), k * (NEUTRAL - y) + foot])
    height, found = secant_stiffness(replace(run, trace=replace(trace, f=spring)))
    low = height <= NEUTRAL - HEIGHT_MARGIN
    assert 10 < low.sum() < len(low)
    np.testing.assert_allclose(found[low], k, rtol=1e-6)
    assert np.isnan(found[~low]).all()
    pulling = np.where(y[:, None] > 0.35, -0.1 * weight(trace.robot.model), spring)
    _, found = secant_stiffness(replace(run, trace=replace(trace, f=pulling)))
    np.testing.assert_array_equal(np.isnan(found), height > 0.35)


def test_the_losses_lead_from_the_bound_to_the_clearance(runs: Callable[[str], Runs]) -> None:
    """Each part begins where the one before it ended; the last ends at the run's clearance [cm]."""
    case = runs("five")
    ax = FIGURES["budget"](case).axes[0]
    bars = [p for p in ax.patches if isinstance(p, Rectangle)]
    written = iter([float(t.get_text().removesuffix(" cm")) for t in ax.texts if t.get_text()[0] in "+-"])
    for number, name in enumerate(FIVE[1:]):
        whole, *parts = bars[4 * number : 4 * number + 4]
        assert whole.get_width() == pytest.approx(100 * case[name].clearance)
        begin = [p.get_x() for p in parts]
        end = [p.get_x() + p.get_width() for p in parts]
        assert [*begin, 100 * case[name].clearance] == pytest.approx([100 * case[OPTIMUM].clearance, *end])
        assert [next(written) for _ in parts] == pytest.approx([-p.get_width() for p in parts], abs=0.051)  # lost: +


def test_a_leg_that_never_flies_has_no_losses_by_cause(runs: Callable[[str], Runs]) -> None:
    ax = FIGURES["budget"](runs("never flies")).axes[0]
    assert [text.get_text() for text in ax.texts] == ["no clearance"]
    labels = [text.get_text() for text in FIGURES["foot_height"](runs("never flies")).legends[0].get_texts()]
    assert "limp: no clearance" in [label.replace("*", "") for label in labels]


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_poses_are_to_scale_apart_and_in_columns(runs: Callable[[str], Runs], case: str) -> None:
    """Links have their lengths, no pose touches the next, poses as long after lift-off stand above each other, and the
    whole fits a slide."""
    figure = FIGURES["stick"](runs(case))
    assert tuple(figure.get_size_inches()) == FIGURE_SIZE
    ticks = figure.axes[-1].get_xticks()
    times = [float(label.get_text()) for label in figure.axes[-1].get_xticklabels()]
    columns = dict(zip(np.round(times, 2), ticks, strict=True))
    for ax, run in zip(figure.axes, runs(case).values(), strict=True):
        poses = [np.array(line.get_xydata()) for line in ax.lines if line.get_marker() == "o"]
        lengths = [link.length for link in run.design.leg.link.values()]
        for pose in poses:
            np.testing.assert_allclose(np.hypot(*np.diff(pose, axis=0).T), lengths, rtol=1e-6)  # drawn between samples
        assert all(a[:, 0].max() < b[:, 0].min() for a, b in pairwise(poses))
        assert ax.get_aspect() == 1
        first = np.ceil(-run.lift_off["time_s"] / 0.04 - 1e-9)
        for k, pose in enumerate(poses[:-1]):
            if (t := round(0.04 * (first + k), 2)) in columns:
                assert pose[:, 0].min() < columns[t] < pose[:, 0].max()
        if run.highest is not None:
            title = ax.get_title(loc="left")
            assert title.endswith(
                f"clears {run.clearance:.3f} m at {run.trace.t[run.highest] - run.lift_off['time_s']:.3f} s"
            )


def test_a_figure_has_five_runs_at_most(runs: Callable[[str], Runs]) -> None:
    """The optimum and the highest of the others, in the order given; the title says how many there were."""
    case = runs("five")
    more = {**case, **{f"more {k}": another(case["force"], 1e-9 * k) for k in range(1, 4)}}
    higher = sorted((n for n in more if n != OPTIMUM), key=lambda n: -more[n].clearance)[:4]
    figure = FIGURES["foot_height"](more)
    shown = [str(line.get_label()).split(":")[0] for line in figure.axes[0].lines]
    assert [name for name in shown if name in more] == [name for name in more if name in (OPTIMUM, *higher)]
    assert "(the highest 5 of 8)" in figure.get_suptitle()
    assert figure.get_suptitle().startswith("The paper's leg: ")


def test_strategies_differ_in_colour_and_the_optimum_stands_out() -> None:
    names = dict.fromkeys(FIVE)
    found = looks(names)  # type: ignore[arg-type]
    assert found.keys() == set(FIVE)
    assert len({look["color"] for look in found.values()}) == len(FIVE)
    assert found[OPTIMUM]["color"] == BLACK
    assert all(found[OPTIMUM]["lw"] > found[name]["lw"] for name in FIVE[1:])
    assert len({look["color"] for look in looks(dict.fromkeys(BUILT_IN)).values()}) == len(BUILT_IN) + 1  # type: ignore[arg-type]
    many = looks(dict.fromkeys([str(k) for k in range(12)]))  # type: ignore[arg-type]
    assert len({(look["color"], look.get("ls")) for look in many.values()}) == 13


def test_a_strategy_has_one_colour_in_every_figure(runs: Callable[[str], Runs]) -> None:
    """Also in figures of stance, where runs of the same stance are drawn as one: there the first one's."""
    case = runs("five")
    shared, _ = by_stance(case)
    assert len(shared) < len(case)
    for name in FIGURES.keys() - {"budget", "stick"}:
        for ax in FIGURES[name](case).axes:
            for line in ax.lines:
                first = re.match(r"\w+", str(line.get_label()))
                if first and first[0] in case:
                    assert line.get_color() == looks(case)[first[0]]["color"], name


def test_a_missed_limit_is_marked(runs: Callable[[str], Runs]) -> None:
    """Only then is there an asterisk at the name, and its meaning in the title."""
    (run,) = runs("one").values()
    assert not run.limits_exceeded
    shorter = load("paper", {**COARSE, "hop.stance_duration": [0.05, 0.1]})
    late = replace(run, design=shorter)
    for figures, star in (({"force": run}, False), ({"force": run, "late": late}, True)):
        for name in FIGURES.keys() - {"budget"}:
            figure = FIGURES[name](figures)
            assert ("*" in figure.get_suptitle()) == star, name
            texts = [text.get_text() for legend in figure.legends for text in legend.get_texts()]
            texts = texts or [ax.get_title(loc="left") for ax in figure.axes]
            named = [match[0] for text in texts if (match := re.match(r"(force|late)\*?", text))]
            assert named == ["force", "late*"][: 1 + star]


@pytest.mark.parametrize(
    ("case", "left_out"), [("one", {"budget"}), pytest.param("five", set(), marks=pytest.mark.slow)]
)
def test_all_figures_are_saved(runs: Callable[[str], Runs], tmp_path: Path, case: str, left_out: set[str]) -> None:
    paths = save_all(runs(case), tmp_path / "new", ("png", "svg") if case == "one" else ("png",))
    suffixes = {p.suffix for p in paths}
    assert {p.name for p in paths} == {f"{name}{s}" for name in FIGURES.keys() - left_out for s in suffixes}
    assert {p.name for p in (tmp_path / "new").iterdir()} == {p.name for p in paths}


def test_a_figure_that_fails_does_not_stop_the_others(
    runs: Callable[[str], Runs], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(_: object) -> Figure:
        raise ZeroDivisionError("no width")

    monkeypatch.setitem(FIGURES, "saturation", broken)
    with pytest.raises(ResultError, match=r"^saturation: ZeroDivisionError: no width$"):
        save_all(runs("one"), tmp_path, ("png",))
    assert {p.stem for p in tmp_path.iterdir()} == FIGURES.keys() - {"saturation", "budget"}


def test_what_feedback_adds_stands_apart_from_the_plan(runs: Callable[[str], Runs], tmp_path: Path) -> None:
    """Commands and a plan of constant torques: the lower axes show their difference, the upper ones both, the plan on top."""
    run = runs("five")["force"]
    lift = run.lift_off["time_s"]

    def constant(duration: float, tau: float) -> PhaseReference:
        t, shape = np.array([[0.0, duration]]), (1, 2, 2)
        return PhaseReference(np.array([0.0, 1.0]), t, np.zeros(shape), np.zeros(shape), np.full(shape, tau))

    plan = PlanReference(constant(lift, 50.0), constant(0.3, -20.0), 0.5, 0.2)
    figure = tracking("track", run, plan)
    hip, added = figure.axes[:2]
    until = last(run) + 1
    t, asked = run.trace.t[:until], run.trace.command[:until, 0]
    line = next(line for line in added.lines if line.get_label() == "added by feedback")
    y = np.asarray(line.get_ydata(), dtype=float)
    drawn = np.isfinite(y)  # a gap where it jumps
    expected = (asked - np.where(t < lift, 50.0, -20.0)) / 200 * 100  # of what the drive gives at standstill
    np.testing.assert_allclose(y[drawn], expected, atol=1e-9)
    planned, commanded = (
        next(each for each in hip.lines if each.get_label() == name) for name in ("planned", "commanded")
    )
    assert planned.get_zorder() > commanded.get_zorder()
    assert planned.get_linewidth() < commanded.get_linewidth()
    paths = save_all({"track": run}, tmp_path, ("png",), plan=plan)
    assert tmp_path / "tracking.png" in paths
