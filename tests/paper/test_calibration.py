"""Calibration: known motors recovered, what data cannot say admitted, problem files rewritten whole or not at all."""

import tomllib
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hopopt.control.paper_options import PaperOptions
from hopopt.control.two_mass import PAPER
from hopopt.design import Design
from hopopt.drivetrain.motor import rated
from hopopt.errors import UsageError
from hopopt.paper.experiment import Experiment, Free, parse_free, present
from hopopt.paper.fit import calibrate, identify
from hopopt.paper.problem_file import CALIBRATED_MARK, replace_checked, with_motor, write_motor
from hopopt.paper.result import (
    EXPERIMENT,
    HEIGHT,
    SATURATION,
    SIMULATION,
    CalibratedValue,
    Calibration,
    Figure,
    FigureComparison,
    text,
)
from hopopt.paper.tracking_demand import point_masses, tracking_saturation
from hopopt.problem.load import load, template
from refusals import refusal

QUICK = {"simulation.control_rate": 1000.0, "simulation.encoder_bits": 0}  # coarser steps make C_avg jump
TRUE = {"leg.motor.max_torque": 1.75, "leg.motor.max_speed": 1150.0}
SOFT = {"k_p": 400.0, "k_d": 30.0}  # a servo that does not saturate throughout: C_avg tells something


def design(**overrides: Any) -> Design:
    return load("paper", QUICK | overrides)


# ---- the fit ------------------------------------------------------------------------------------------------------


def test_the_printed_figures_are_those_of_the_paper() -> None:
    """Section III: 0.44 and 0.32 m (in the right order), C_avg 1 and 0.5; section IV: 0.38 and 0.24 m, 1 and 0.7."""
    assert [(f.strategy, f.quantity, f.value) for f in SIMULATION] == [
        ("force", HEIGHT, 0.44), ("force", SATURATION, 1.0), ("position", HEIGHT, 0.32), ("position", SATURATION, 0.5),
    ]  # fmt: skip
    assert [f.value for f in EXPERIMENT] == [0.38, 1.0, 0.24, 0.7]


def round_trip(printed: Sequence[Figure], rate: float) -> Calibration:
    """Figures made by the simulator with the motor TRUE, fitted from the paper's motor."""
    leg = design(**{"simulation.control_rate": rate})
    free = (Free("leg.motor.max_torque", 1.2, 2.8), Free("leg.motor.max_speed", 900.0, 1500.0))
    truth = Experiment(leg.model_dump(exclude_none=True), free, tuple(printed), SOFT)
    made = truth.simulated(truth.place(list(TRUE.values()))).tolist()
    figures = [Figure(f.strategy, f.quantity, v, f.warrant) for f, v in zip(printed, made, strict=True)]
    return calibrate(leg, figures, held_out=(), free=free, options=SOFT, scanned=0, starts=1, processes=1)


@pytest.mark.rarely
def test_a_known_motor_is_recovered_from_its_own_figures() -> None:
    c = round_trip(SIMULATION, rate=1000.0)
    for p, true in zip(c.parameters, TRUE.values(), strict=True):
        assert p.before != pytest.approx(true, rel=0.05)
        assert p.value == pytest.approx(true, rel=0.01)
        assert p.standard_error is not None
    assert c.determined
    assert c.matched


@pytest.mark.rarely
def test_an_exact_fit_is_no_identification() -> None:
    """Position control's two figures are met exactly by more than one motor: the fit is perfect, and nothing is known."""
    c = round_trip(SIMULATION[2:], rate=500.0)
    assert c.misfit < 1e-4
    assert not c.determined
    assert c.undetermined


@pytest.mark.rarely
def test_one_saturation_does_not_determine_two_values() -> None:
    only = SIMULATION[1:2]
    leg = design(**{"simulation.control_rate": 500.0})
    c = calibrate(leg, only, held_out=(), scanned=0, starts=1, processes=1)
    assert not c.determined
    assert c.undetermined
    assert any(p.standard_error is None for p in c.parameters)
    assert "UNDETERMINED" in text(c)
    assert c.freedom == -1


@given(st.integers(0, 2**32 - 1), st.integers(1, 4), st.integers(0, 3))
def test_errors_are_those_of_linear_least_squares(seed: int, p: int, spare: int) -> None:
    """Covariance (J' J)^-1, widened by the misfit for each spare figure only where that exceeds 1."""
    random = np.random.default_rng(seed)
    slopes = 100 * random.standard_normal((p + spare, p))
    if np.linalg.cond(slopes) > 20:
        return
    found = identify(slopes, np.zeros(p + spare), misfit=0.5 * spare)
    covariance = np.linalg.inv(slopes.T @ slopes)
    errors = np.sqrt(np.diag(covariance))
    known = errors < 1 / np.sqrt(12)
    assert found.errors[known] == pytest.approx(errors[known])
    assert np.all(np.isinf(found.errors[~known]))
    assert found.correlation == pytest.approx(covariance / np.outer(errors, errors))
    assert found.condition == pytest.approx(np.linalg.cond(slopes))
    if spare:
        wide = identify(slopes, np.zeros(p + spare), misfit=4.0 * spare).errors
        both = np.isfinite(wide)
        assert wide[both] == pytest.approx(2 * found.errors[both])


def test_a_figure_that_jumps_counts_for_less() -> None:
    slopes = np.array([[10.0]])
    assert identify(slopes, np.zeros(1), 0.0).errors == pytest.approx([0.1])
    assert identify(slopes, np.array([np.sqrt(3.0)]), 0.0).errors == pytest.approx([0.2])


def test_a_combination_no_figure_shows_is_named() -> None:
    """Figures of the sum of two values leave their difference open, and with it both."""
    found = identify(np.array([[50.0, 50.0], [20.0, 20.0], [10.0, 10.0]]), np.zeros(3), 0.0)
    assert len(found.open) == 1
    assert abs(found.open[0]) == pytest.approx([np.sqrt(0.5)] * 2)
    assert found.open[0].sum() == pytest.approx(0.0, abs=1e-12)
    assert np.all(np.isinf(found.errors))


# ---- what may be freed --------------------------------------------------------------------------------------------


def test_freed_values_reach_the_leg_and_the_strategy() -> None:
    free = (Free("leg.motor.rotor_inertia", 0.0, 3e-5), Free("position.k_p", 100.0, 500.0), Free("k_s", 1000.0, 2000.0))
    e = Experiment(design().model_dump(exclude_none=True), free, SIMULATION)
    assert present(e) == [1.19e-5, 5424.0, 1700.0]
    values = e.values(np.array([0.5, 0.25, 1.0]))
    assert e.place(list(values)) == pytest.approx([0.5, 0.25, 1.0])
    assert e.design(values).leg.motor.rotor_inertia == 1.5e-5
    assert e.settings(values, "position") == {**e.gains, "k_p": 200.0, "k_s": 2000.0}
    assert e.settings(values, "force") == {**e.gains, "k_s": 2000.0}
    assert e.gains["k_p"] == PaperOptions().k_p
    assert design().leg.motor.rotor_inertia == 1.19e-5


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        ("leg.motor.rotor_inertia", "lower:upper"),
        ("k_p=1:2:3", "lower:upper"),
        ("k_p=low:high", "lower:upper"),
        ("leg.motor.colour=1:2", "cannot be freed"),
        ("leg.joints=1:2", "cannot be freed"),
        ("retraction=1:2", "cannot be freed"),
        ("k_p=200:100", "below"),
        ("leg.motor.max_torque=-1:2", "out of range"),
    ],
)
def test_what_cannot_be_freed_is_refused(words: str, reason: str) -> None:
    with pytest.raises(UsageError, match=reason):
        present(Experiment(design().model_dump(exclude_none=True), (parse_free(words),), SIMULATION))


def test_what_is_free_twice_is_refused() -> None:
    twice = (parse_free("k_p=100:200"), parse_free("k_p=150:300"))
    with pytest.raises(UsageError, match="k_p is free already"):
        present(Experiment(design().model_dump(exclude_none=True), twice, SIMULATION))


# ---- what exact tracking asks for ---------------------------------------------------------------------------------


def test_two_point_masses_need_the_torque_of_the_reference_spring() -> None:
    """Virtual work: the knee's torque is the spring's force on the body times dy/dq_knee, on massless links."""
    leg = point_masses(design())
    times = np.linspace(0.0, PAPER.t_lo, 20001)
    y, rate = PAPER.y_s(times), PAPER.y_s_rate(times)
    times, y, rate = (x[y >= 0.28] for x in (times, y, rate))
    knee = np.arccos((y**2 - 0.38**2 - 0.361**2) / (2 * 0.38 * 0.361))
    arm = 0.38 * 0.361 * np.sin(knee) / y
    tau = PAPER.k * (PAPER.l0 - y) * arm
    C = np.abs(tau) / (100 * 2.0 * (1 - 100 * rate / arm / rated(leg.leg, "knee")[1]))
    mean = np.trapezoid(C, times) / (times[-1] - times[0])
    printed = asdict(PaperOptions())
    found = tracking_saturation(leg, printed)
    assert found["knee"] == pytest.approx(mean, rel=2e-3)
    assert found["hip"] < 0.01
    assert tracking_saturation(design(), printed)["knee"] > 1.3 * mean


# ---- into the problem file ----------------------------------------------------------------------------------------

VALUES, ERRORS = {"max_torque": 1.75, "max_speed": 1150.0}, {"max_torque": 0.11, "max_speed": 32.0}


def calibration(error: float | None = 0.0123) -> Calibration:
    parameters = (
        CalibratedValue("leg.motor.max_torque", "N m", 2.0, 1.7512, error, 0.5, 5.0),
        CalibratedValue("leg.motor.max_speed", "rad/s", 1256.637, 1151.3, 3.21, 600.0, 1700.0),
    )
    compared = tuple(FigureComparison(f, f.value) for f in SIMULATION)
    starts = (((1.7512, 1151.3), 0.4),)
    return Calibration("mine", parameters, compared, (), 0.4, 2, 3.0, ((1.0, 0.2), (0.2, 1.0)), (), starts, 10, (0, 0))


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "mine.toml"
    path.write_text(template("mine"), encoding="utf-8")
    return path


def test_only_the_motor_changes_and_every_comment_stays(file: Path) -> None:
    before = file.read_text(encoding="utf-8")
    write_motor(file, calibration())
    after = file.read_text(encoding="utf-8")
    motor = load(file).leg.motor
    assert (motor.max_torque, motor.max_speed) == (1.751, 1151.3)
    changed = [line for line in after.splitlines() if line not in before.splitlines()]
    assert [line.split("#")[0].split() for line in changed if not line.startswith("#")] == [
        ["max_torque", "=", "1.751"], ["max_speed", "=", "1151.3"],
    ]  # fmt: skip
    assert [line for line in changed if line.startswith("#")] == [
        f"{CALIBRATED_MARK}, standard error 0.012 N m", f"{CALIBRATED_MARK}, standard error 3.2 rad/s",
    ]  # fmt: skip
    comments = [line.partition("#")[2] for line in before.splitlines()]
    assert [line.partition("#")[2] for line in after.splitlines() if not line.startswith(CALIBRATED_MARK)] == comments
    assert list(file.parent.iterdir()) == [file]


def test_writing_again_replaces_what_was_written() -> None:
    first = with_motor(template("mine"), {"max_torque": 1.0, "max_speed": 900.0}, ERRORS)
    assert with_motor(first, VALUES, ERRORS) == with_motor(template("mine"), VALUES, ERRORS)
    assert with_motor(first, VALUES, ERRORS).count(CALIBRATED_MARK) == 2


@pytest.mark.parametrize(
    "source",
    [
        'name = "mine"\nextends = "paper"',
        'name = "mine"\nextends = "paper"\n[leg.motor]\nmax_torque=3.0# N m\n[hop]\nfoot_window = 0.2\n',
        'name = "mine"\r\nextends = "paper"\r\n[ leg.motor ] # drive\r\nmax_speed = 1000.0\r\n',
        'name = "mine"\nextends = "paper"\n[leg.knee.motor]\nmax_torque = 2.5\n',
    ],
)
def test_files_that_say_less_are_completed(tmp_path: Path, source: str) -> None:
    path = tmp_path / "mine.toml"
    path.write_bytes(source.encode())
    before = tomllib.loads(source)
    replace_checked(path, with_motor(source, VALUES, ERRORS), VALUES)
    after = tomllib.loads(path.read_bytes().decode())
    motor = after["leg"]["motor"]
    assert {name: motor.pop(name) for name in VALUES} == VALUES
    kept = {k: v for k, v in before.get("leg", {}).get("motor", {}).items() if k not in VALUES}
    assert motor == kept
    assert {k: v for k, v in after.items() if k != "leg"} == {k: v for k, v in before.items() if k != "leg"}
    assert ("\r\n" in source) == (b"\r\n" in path.read_bytes())


@pytest.mark.parametrize(
    ("source", "values"),
    [
        ('name = "mine"\nextends = "paper"\nleg.motor.max_torque = 3.0\n', VALUES),
        ('name = "mine"\nextends = "paper"\n[leg]\nmotor = { max_torque = 3.0 }\n', VALUES),
        (template("mine"), {"max_torque": float("nan"), "max_speed": 1150.0}),
        (template("mine"), {"max_torque": -1.0, "max_speed": 1150.0}),
        (template("mine"), {"max_torque": 1.75, "max_speed": 11500.0}),
    ],
)
def test_nonsense_leaves_the_file_alone(tmp_path: Path, source: str, values: dict[str, float]) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(source, encoding="utf-8")
    with pytest.raises(UsageError, match=r"mine\.toml was not changed"):
        replace_checked(path, with_motor(source, values, ERRORS), values)
    assert path.read_text(encoding="utf-8") == source
    assert list(tmp_path.iterdir()) == [path]


def test_what_is_not_determined_is_not_written(file: Path) -> None:
    before = file.read_bytes()
    with pytest.raises(UsageError, match="do not determine"):
        write_motor(file, calibration(error=None))
    assert file.read_bytes() == before


def test_an_answer_that_another_one_equals_is_not_determined() -> None:
    best, elsewhere = calibration(), (((1.7512, 1151.3), 0.4), ((3.1, 990.0), 0.9))
    assert best.determined
    assert not Calibration(**{**vars(best), "starts": elsewhere}).determined
    assert "ANOTHER ANSWER" in text(Calibration(**{**vars(best), "starts": elsewhere}))


def test_the_text_says_what_is_matched_and_what_is_not() -> None:
    found = calibration()
    off = Calibration(
        **{
            **vars(found),
            "compared": (FigureComparison(SIMULATION[0], 0.55),),
            "held_out": (FigureComparison(EXPERIMENT[0], 0.385),),
        }
    )
    assert "paper 0.44 m, simulated 0.550 m, NOT matched (+11.0 of 0.01)" in text(off)
    assert "paper 0.38 m, simulated 0.385 m, matched" in text(off)
    assert off.as_dict()["compared"][0]["matched"] is False


def test_point_masses_keep_where_links_point_and_nothing_else() -> None:
    more = {
        "leg.gear.inertia": 1.93e-5,
        "leg.thigh.direction": [0.6, 0.0, -0.8],
        "leg.shank.com_position": [0.0, 0.0, -0.1],
    }
    leg = point_masses(load("paper", more)).leg
    assert leg.link["thigh"].direction == (0.6, 0.0, -0.8)
    assert leg.link["shank"].com_position is None
    assert leg.link["shank"].com == leg.link["shank"].length
    assert leg.gear.inertia == 0.0


def test_a_bound_without_end_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert "both finite" in refusal(["calibrate", "--free", "k_p=0:inf", "--processes", "1"], capsys)
