"""Parameters of a leg that differs from the believed one, from logs that the plant makes with 14-bit encoders and noise."""

import csv
import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hopopt as ho
from hopopt.cli import main as cli
from hopopt.control.closed_loop import Run, make_plant, simulate
from hopopt.control.strategies import BUILT_IN
from hopopt.design import Design
from hopopt.leg.robot import BASE
from hopopt.problem.load import changed, load
from hopopt.robot_data.identification import Identification, ParameterEstimate, identify
from hopopt.robot_data.identification_rows import LogRows, places
from hopopt.robot_data.leg_momenta import LegMomenta
from hopopt.robot_data.robot_log import RobotLog, same_run
from refusals import refusal

GAIN = 0.94  # true torque constants over the believed ones
STEP = 2 * np.pi / 2**14  # rad, of the encoders
TORQUE_NOISE, FORCE_NOISE = 0.3, 1.0  # N m, N
GAIN_KEY, SPEED_KEY = "leg.motor.torque_constant", "leg.motor.max_speed"
MASSES = {"leg.body.mass": 5.6, "leg.thigh.mass": 1.87, "leg.shank.mass": 0.8}  # kg, believed
TRUTH = {key: 1.07 * mass for key, mass in MASSES.items()} | {
    "leg.motor.rotor_inertia": 1.05 * 1.19e-5,
    "simulation.gear_efficiency": 0.85,
    "simulation.gear_friction": 6.0,
    "simulation.gear_damping": 1.0,
    SPEED_KEY: 0.95 * 1256.637,
    GAIN_KEY: GAIN,
}
DRAWS = 50


@dataclass(frozen=True)
class Recording:
    """What perfect sensors say of a run, a row each control period: times (k,), angles and speeds at the row (k, n), means of
    motor torque at the joint (k, n) and ground force (k, 2) until the next row, commands (k, n), contact (k,)."""

    t: np.ndarray
    q: np.ndarray
    v: np.ndarray
    tau: np.ndarray
    force: np.ndarray
    command: np.ndarray
    contact: np.ndarray

    def log(self, seed: int) -> RobotLog:
        """With encoders whose zero lies anywhere within a step, and noise; torques as the believed constant has them."""
        random = np.random.default_rng(seed)
        q = STEP * np.round((self.q + random.uniform(-0.5, 0.5, self.q.shape[1]) * STEP) / STEP)
        tau = self.tau / GAIN + random.normal(0, TORQUE_NOISE, self.tau.shape)
        force = self.force + random.normal(0, FORCE_NOISE, self.force.shape)
        return RobotLog(self.t, q, self.v, tau, self.contact, force, self.command)


def recorded(run: Run, truth: Design, gain: np.ndarray) -> Recording:
    """The samples of a run at its control rate; means by the trapezoidal rule between samples, each under its own command."""
    trace, plant, period = run.trace, make_plant(truth, gain), 1 / truth.simulation.control_rate
    row = np.floor(trace.t / period + 1e-6).astype(int)
    first = np.searchsorted(row, np.arange(row[-1]))
    tau, force = np.zeros((row[-1], 2)), np.zeros((row[-1], 2))
    for a in range(len(trace.t) - 1):
        q, part = trace.q[a + 1, BASE:], (trace.t[a + 1] - trace.t[a]) / period
        if row[a] < row[-1] and part > 0:
            after = replace(
                plant.stance_start(q), q=trace.q[a + 1], v=trace.v[a + 1], contact=bool(trace.contact[a + 1])
            )
            motor, _, standing = plant.torques(after, trace.command[a])
            tau[row[a]] += part * 0.5 * (trace.motor[a] + motor)
            if trace.contact[a]:
                force[row[a]] += part * 0.5 * (trace.f[a] + standing)
    at = (trace.q[first, BASE:], trace.v[first, BASE:])
    return Recording(period * np.arange(row[-1]), *at, tau, force, trace.command[first], trace.contact[first])


@pytest.fixture(scope="module")
def believed() -> Design:
    return load("paper")


@pytest.fixture(scope="module")
def truth(believed: Design) -> Design:
    """Its no-load speed is that of motors with the believed constant: weaker ones turn faster by as much."""
    return changed(believed, {k: v for k, v in TRUTH.items() if k != GAIN_KEY} | {SPEED_KEY: GAIN * TRUTH[SPEED_KEY]})


@pytest.fixture(scope="module")
def run(believed: Design, truth: Design) -> Run:
    """One hop of the true leg with the paper's force control, up to the landing."""
    return simulate(believed, BUILT_IN["force"], plant=truth, torque_gain=np.full(2, GAIN))


@pytest.fixture(scope="module")
def recording(run: Run, truth: Design) -> Recording:
    return recorded(run, truth, np.full(2, GAIN))


@pytest.fixture(scope="module")
def found(believed: Design, recording: Recording) -> Identification:
    return identify(believed, [recording.log(0)])


@pytest.fixture
def written(tmp_path: Path, recording: Recording) -> Callable[..., Path]:
    """Writes a log as CSV; columns may be replaced, or left out (None)."""
    log = recording.log(0)
    assert log.command is not None
    columns: dict[str, Any] = {"t": log.t, "contact": log.contact.astype(float)}
    for k, joint in enumerate(("hip", "knee")):
        parts = {"q": log.q, "v": log.v, "tau": log.tau, "command": log.command}
        columns |= {f"{part}_{joint}": values[:, k] for part, values in parts.items()}
    columns |= {"force_x": log.force[:, 0], "force_z": log.force[:, 1]}

    def write(**other: Any) -> Path:
        given = {name: x for name, x in (columns | other).items() if x is not None}
        file = tmp_path / "run.csv"
        with file.open("w", encoding="utf-8", newline="") as stream:
            csv.writer(stream).writerows([given, *zip(*given.values(), strict=True)])
        return file

    return write


def by_key(found: Identification) -> dict[str, ParameterEstimate]:
    return {e.key: e for e in found.estimates}


def error(e: ParameterEstimate, truth: float) -> float:
    return abs(e.value / truth - 1)


# ---- the equations ------------------------------------------------------------------------------------------------


def test_the_true_leg_moves_as_the_equations_say(believed: Design, recording: Recording) -> None:
    """Without noise and with the true parameters, both sides of every equation agree to 3e-3 of the logged one: where a gear
    goes from driving to braking, accelerations are told by smoothed slopes."""
    log = RobotLog(
        recording.t,
        recording.q,
        recording.v,
        recording.tau / GAIN,
        recording.contact,
        recording.force,
        recording.command,
    )
    rows, at = LogRows(believed, LegMomenta(believed), log), places(2)
    x = np.zeros(at["end"])
    x[: at["rotor"]], x[at["rotor"] : at["gain"]] = 1.07, 100**2 * TRUTH["leg.motor.rotor_inertia"]
    keys = ("gain", GAIN_KEY), ("efficiency", "simulation.gear_efficiency"), ("friction", "simulation.gear_friction")
    for name, key in (*keys, ("damping", "simulation.gear_damping"), ("speed", SPEED_KEY)):
        x[at[name] : at[name] + 2] = TRUTH[key]
    x[[at["lag"], at["force_lag"]]] = -0.5 / believed.simulation.control_rate  # means until the next row
    blocks = rows.blocks(x)
    assert {b.kind for b in blocks} == {"tau0", "tau1", "force0", "force1", "line1"}
    for block in blocks:
        assert np.sqrt(np.mean(block.e**2)) < 3e-3 * np.sqrt(np.mean(block.logged**2)), block.kind


def test_the_derivatives_of_the_rows_are_their_differences(believed: Design, recording: Recording) -> None:
    rows, at = LogRows(believed, LegMomenta(believed), recording.log(0)), places(2)
    x = np.concatenate([np.ones(3), np.full(2, 0.12), np.full(2, 0.9), np.full(2, 0.8), np.full(2, 5.0), np.ones(2)])
    x = np.concatenate([x, np.full(2, 1200.0), np.full(4, -1e-4)])
    assert len(x) == at["end"]
    exact = np.vstack([b.J for b in rows.blocks(x)])
    for k in range(len(x)):
        h = 1e-5 * np.eye(len(x))[k] * max(abs(x[k]), 1e-3)
        ahead, behind = (np.concatenate([b.e for b in rows.blocks(x + s * h)]) for s in (1, -1))
        np.testing.assert_allclose(
            exact[:, k], (ahead - behind) / (2 * h[k]), atol=1e-5 * np.abs(exact[:, k]).max() + 1e-9
        )


# ---- what is told -------------------------------------------------------------------------------------------------


def test_one_hop_tells_every_parameter_within_two_per_cent(found: Identification) -> None:
    estimates = by_key(found)
    assert estimates.keys() == TRUTH.keys()
    for key, value in TRUTH.items():
        assert estimates[key].identified, key
        assert error(estimates[key], value) < 0.02, key


def test_torques_sampled_once_in_a_period_tell_them_as_well(believed: Design, run: Run) -> None:
    """Held ones are half a period early then, those at a drive's line are not."""
    trace = run.trace
    rows = np.flatnonzero(np.diff(trace.t, prepend=-1.0) > 1e-4)  # not those of events
    seen = (trace.q[rows, BASE:], trace.v[rows, BASE:], trace.motor[rows], trace.f[rows], trace.command[rows])
    found = by_key(identify(believed, [Recording(trace.t[rows], *seen, trace.contact[rows]).log(0)]))
    for key, value in TRUTH.items():
        assert found[key].identified, key
        assert error(found[key], value) < 0.02, key


def test_the_noise_of_the_sensors_is_told_too(found: Identification) -> None:
    """Within what half a second shows of it; and that means until the next row are half a period early."""
    assert found.noise["tau_knee"] == pytest.approx(TORQUE_NOISE, rel=0.6)
    assert found.noise["q_knee"] == pytest.approx(STEP / np.sqrt(12), rel=0.4)
    assert found.lags["lag"] == pytest.approx(-0.125e-3, abs=0.03e-3)


@pytest.mark.rarely
def test_fifty_logs_are_right_and_their_intervals_hold_the_truth(believed: Design, recording: Recording) -> None:
    """Every parameter within 2 % in all of them, its 95 % interval around the truth in at least 45."""
    held = dict.fromkeys(TRUTH, 0)
    for seed in range(DRAWS):
        for key, e in by_key(identify(believed, [recording.log(seed)])).items():
            assert e.identified, f"{key} of log {seed}"
            assert error(e, TRUTH[key]) < 0.02, f"{key} of log {seed}"
            assert e.low is not None
            assert e.high is not None
            held[key] += e.low <= TRUTH[key] <= e.high
    assert min(held.values()) >= 0.9 * DRAWS, held


def test_motors_of_their_own_are_told_apart(believed: Design, recording: Recording, tmp_path: Path) -> None:
    """A joint with an entry of its own has a parameter of its own; a link's own inertia goes with its mass."""
    own = changed(believed, {"leg.knee.motor.max_torque": 2.0, "leg.thigh.inertia": 1.87 * 0.38**2 / 12})
    found = identify(own, [recording.log(1)])
    estimates = by_key(found)
    for key in (GAIN_KEY, "leg.knee.motor.torque_constant"):
        assert error(estimates[key], GAIN) < 0.02
    file = tmp_path / "own.toml"
    file.write_text(found.problem_file(["run.csv"]), encoding="utf-8")
    leg = load(file).leg
    assert leg == found.identified.leg
    assert leg.drive("hip", "motor", "max_torque")[1] == pytest.approx(2.0 * estimates[GAIN_KEY].value, rel=1e-5)
    knee = estimates["leg.knee.motor.torque_constant"].value
    assert leg.drive("knee", "motor", "max_torque")[1] == pytest.approx(2.0 * knee, rel=1e-5)
    assert leg.link["thigh"].inertia == pytest.approx(leg.link["thigh"].mass * 0.38**2 / 12, rel=1e-5)


# ---- what is not told ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(2))
def test_without_a_force_whatever_a_factor_may_change_is_named(
    believed: Design, recording: Recording, seed: int
) -> None:
    """Masses, rotor inertia, friction and torque constant keep the problem's values; efficiency and speed are told."""
    log = recording.log(seed)
    found = by_key(identify(believed, [replace(log, force=np.zeros_like(log.force))]))
    for key in ("simulation.gear_efficiency", SPEED_KEY):
        assert error(found[key], TRUTH[key]) < 0.02
    for key, e in found.items():
        if key not in ("simulation.gear_efficiency", SPEED_KEY):
            assert not e.identified
            assert "without force_z" in e.why
            assert e.value == e.believed


def test_without_a_force_a_known_mass_or_torque_constant_tells_the_rest(believed: Design, recording: Recording) -> None:
    """Believed torques are 1 / 0.94 of the true ones: so are the masses that they move. With a true mass all is true."""
    log = recording.log(0)
    blind = replace(log, force=np.zeros_like(log.force))
    found = by_key(identify(believed, [blind], known=[GAIN_KEY]))
    for key in MASSES:
        assert error(found[key], TRUTH[key] / GAIN) < 0.02
    weighed = changed(believed, {"leg.body.mass": TRUTH["leg.body.mass"]})
    for key, e in by_key(identify(weighed, [blind], known=["leg.body.mass"])).items():
        assert error(e, TRUTH[key]) < 0.02, key


@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.slow)])
def test_a_drive_that_was_never_at_its_line_does_not_tell_its_speed(
    believed: Design, recording: Recording, seed: int
) -> None:
    log = recording.log(seed)
    for command, why in ((None, "no column command_JOINT"), (log.tau, "no drive gives less than its command")):
        e = by_key(identify(believed, [replace(log, command=command)]))[SPEED_KEY]
        assert not e.identified
        assert e.why.startswith(why)
        assert e.value == believed.leg.motor.max_speed


def test_what_the_motion_hardly_shows_is_named(believed: Design, recording: Recording) -> None:
    """Torque noise beyond the friction drowns it: it is not told, and its interval says why."""
    log, random = recording.log(0), np.random.default_rng(1)
    loud = replace(log, tau=log.tau + random.normal(0, 10, log.tau.shape))
    e = by_key(identify(believed, [loud]))["simulation.gear_friction"]
    assert not e.identified
    assert "95 % interval" in e.why
    assert e.value == 0.0


# ---- the command --------------------------------------------------------------------------------------------------


def test_the_command_writes_a_problem_with_its_source(
    written: Callable[..., Path], found: Identification, capsys: pytest.CaptureFixture[str]
) -> None:
    """It loads, has what was identified and says from where; a drive's torque goes with its torque constant."""
    file = written()
    output = file.with_name("identified.toml")
    assert cli.run(["identify", str(file), "--output", str(output), "--json"]) == 0
    data = json.loads(capsys.readouterr().out)
    parameters = data["parameters"]
    assert data["exit_code"] == 0
    assert all(parameters[e.key]["value"] == pytest.approx(e.value, rel=1e-6) for e in found.estimates)
    design = load(output)
    assert design.leg.body.mass == pytest.approx(parameters["leg.body.mass"]["value"], rel=1e-5)
    assert design.leg.motor.max_torque == pytest.approx(2.0 * parameters[GAIN_KEY]["value"], rel=1e-5)
    assert design.simulation.gear_friction == pytest.approx(6.0, rel=0.02)
    assert "identified from run.csv" in output.read_text(encoding="utf-8")
    assert cli.run(["show", str(output)]) == 0
    capsys.readouterr()
    before = output.read_bytes()
    assert cli.run(["identify", str(file), "--output", str(output)]) == 2
    assert "is not overwritten" in capsys.readouterr().err
    assert output.read_bytes() == before
    assert ho.identify("paper", file).as_dict()["parameters"] == parameters


def test_the_screen_names_what_is_not_told(written: Callable[..., Path], capsys: pytest.CaptureFixture[str]) -> None:
    nothing = dict.fromkeys(("force_x", "force_z", "command_hip", "command_knee"))
    assert cli.run(["identify", str(written(**nothing)), "--known", "leg.body.mass"]) == 0
    said = capsys.readouterr().out
    assert f"the data cannot tell {SPEED_KEY}: no column command_JOINT" in said
    assert said.count("given") == 1


def broken(recording: Recording) -> dict[str, tuple[dict[str, Any], str]]:
    """Faults of a log: the columns changed, and what is said."""
    log, nothing = recording.log(0), dict.fromkeys(("force_x", "force_z"))
    hip, knee = log.tau.T
    return {
        "gap": ({"t": np.where(np.arange(len(log.t)) > 900, log.t + 0.1, log.t)}, "nothing was logged from"),
        "degrees": ({"q_knee": np.rad2deg(log.q[:, 1])}, "is it in degrees"),
        "no phase": ({"contact": None, **nothing}, "nothing says when the foot stands"),
        "no flight": ({"contact": np.ones(len(log.t))}, "the foot never leaves the ground"),
        "swapped": ({"tau_hip": knee, "tau_knee": hip}, "are torque columns swapped"),
        "sign": ({"tau_hip": -hip, "tau_knee": -knee}, "of the other sign"),
        "motor side": ({"tau_hip": hip / 100, "tau_knee": knee / 100}, "is tau that of the joint"),
        "no number": ({"command_hip": ["?"] * len(log.t)}, "row 2, command_hip: '?' is not a number"),
    }


@pytest.mark.parametrize(
    "fault", ["gap", "degrees", "no phase", "no flight", "swapped", "sign", "motor side", "no number"]
)
def test_a_broken_log_is_refused_in_a_sentence_and_nothing_is_written(
    fault: str, written: Callable[..., Path], recording: Recording, capsys: pytest.CaptureFixture[str]
) -> None:
    columns, message = broken(recording)[fault]
    file = written(**columns)
    assert message in refusal(["identify", str(file), "--output", str(file.with_name("out.toml"))], capsys)
    assert [path.name for path in file.parent.iterdir()] == ["run.csv"]


def test_a_log_with_too_little_motion_is_refused(
    written: Callable[..., Path], recording: Recording, capsys: pytest.CaptureFixture[str]
) -> None:
    file = written()
    lines, left = file.read_text().splitlines(), int(np.argmin(recording.contact))
    file.write_text("\n".join([lines[0], *lines[left - 79 : left + 80]]))
    assert cli.run(["identify", str(file)]) == 2
    assert "too little motion" in capsys.readouterr().err


def test_a_run_that_is_given_twice_is_refused(
    written: Callable[..., Path], believed: Design, recording: Recording, capsys: pytest.CaptureFixture[str]
) -> None:
    """It would narrow the intervals with nothing new; cut differently it is the same run. Another run is another."""
    file = written()
    lines = file.read_text(encoding="utf-8").splitlines()
    cut = file.with_name("cut.csv")
    cut.write_text("\n".join([lines[0], *lines[21:]]), encoding="utf-8")
    for other in (file, cut):
        assert "logs 1 and 2 are of one run" in refusal(["identify", str(file), str(other)], capsys)
    assert not same_run(recording.log(0), recording.log(1))


def test_an_unknown_parameter_is_refused(written: Callable[..., Path], capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.run(["identify", str(written()), "--known", "leg.body.weight"]) == 2
    assert "--known leg.body.weight: it is none of leg.body.mass" in capsys.readouterr().err
