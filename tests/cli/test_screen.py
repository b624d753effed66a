"""What a person sees on a screen of a given width, and what a pipe gets."""

import io
import re
import time
from contextlib import redirect_stdout
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from hopopt.cli.main import run
from hopopt.cli.screen import runs
from hopopt.cli.screen.answer import checks_line, in_short, notes
from hopopt.cli.screen.checks import checks as shown_checks
from hopopt.cli.screen.checks import structure_lines
from hopopt.cli.screen.console import NamedLines, progress, show
from hopopt.cli.screen.details import whole
from hopopt.cli.screen.motion import drive_lines, hard
from hopopt.cli.screen.studies import of_sweep
from hopopt.cli.studies import sensitivity
from hopopt.comparison.compare import compare
from hopopt.optimality.minimum_principle.switching_structure import Stretch
from hopopt.planner.answer.limit_names import AS_GOOD, INSENSITIVE
from hopopt.planner.answer.motion_figures import LeansOn
from hopopt.planner.answer.program_figures import Structure
from hopopt.planner.answer.summary import LATE
from hopopt.planner.answer.touchdown import Impact
from hopopt.planner.solution import Solution
from hopopt.planner.stopwatch import Countdown
from hopopt.problem.load import load
from hopopt.studies.influence import Influence
from hopopt.studies.sweep.definition import define
from hopopt.studies.sweep.point_file import VERIFIED, Point
from hopopt.studies.sweep.run import Study
from hopopt.verify.check import Check
from hopopt.verify.drives import JointLosses, SupplyFigures
from hopopt.verify.whole_hop import left_out

LONG = "hip: " + ", then ".join(f"torque-speed line backward until 0.{k:03d} s" for k in range(100, 120))


class Screen(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.fixture(autouse=True)
def _narrow(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in {"COLUMNS": "80", "NO_COLOR": "1", "TERM": "xterm"}.items():
        monkeypatch.setenv(name, value)


def test_long_lines_go_on_below_their_beginning() -> None:
    with redirect_stdout(Screen()) as screen:
        show([NamedLines("structure", [LONG, "ground: free"])])
    first, *more, last = screen.getvalue().splitlines()
    assert first.startswith("  structure hip: torque-speed")
    assert all(line.startswith(" " * 14) and line[14] != " " for line in more)
    assert last == " " * 12 + "ground: free"
    assert max(map(len, (first, *more))) <= 80
    assert " ".join(line.strip() for line in (first, *more)) == f"structure {LONG}"


def test_of_a_chattering_structure_the_first_and_the_last_are_told(hop: Solution) -> None:
    ends = [0.1 + 0.001 * k for k in range(20)]
    hip = [Stretch("hip", "torque-speed line backward", end - 0.001, end) for end in ends]
    ground = [Stretch("ground", "free", 0.0, 0.1), Stretch("ground", "carries nothing", 0.1, 0.2)]
    told = Structure((), (*hip, *ground), (Stretch("hip", "free", 0.0, 1.0),))
    long, short = structure_lines(replace(hop.summary, structure=told))
    assert short == "ground: free until 0.100 s, then carries nothing"
    told, every = long.split(", then "), LONG.split(", then ")
    assert told == [*every[:4], f"{len(every) - 5} more (--json tells all)", "torque-speed line backward"]


def test_a_pipe_gets_whole_lines(capsys: pytest.CaptureFixture[str]) -> None:
    show([NamedLines("structure", [LONG])])
    assert capsys.readouterr().out == f"  structure {LONG}\n"


def test_a_study_whose_best_lies_at_an_edge_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    definition = define(load("paper"), {"leg.gear.ratio": [90, 100, 110], "leg.shank.length": [0.35, 0.36, 0.37]})
    for best, words in (
        (4, ""),
        (1, "; leg.gear.ratio at the least that was tried: better may lie beyond"),
        (8, "; leg.gear.ratio at the most and leg.shank.length at the most that was tried: better may lie beyond"),
    ):
        heights = [0.8 if k == best else 0.7 for k in range(9)]
        points = [
            Point(k, definition.values(k), VERIFIED, objective_value=z, clearance_m=z) for k, z in enumerate(heights)
        ]
        show(of_sweep(Study(definition, tuple(points), tmp_path, 1.0)))
        assert f"clearance 0.8000 m{words}\n" in capsys.readouterr().out


def test_a_comparison_fits_a_narrow_screen(hop: Solution) -> None:
    found = compare(hop.design, ["force"], bound=hop).as_dict()
    with redirect_stdout(Screen()) as screen:
        show(runs.comparison({**found, "result_dir": "results/here", "wall_s": 1.0}))
    lines = re.sub(r"\x1b\[[0-9;]*m", "", screen.getvalue()).splitlines()
    assert max(map(len, lines)) <= 80
    assert not any("…" in line for line in lines)
    (row,) = [line.split() for line in lines if line.startswith("force ")]
    assert len(row) == 11  # one table: name, clearance, share, three losses, two joints, lift-off, ground


def test_a_strategy_that_does_not_hop_says_why_and_has_no_share(capsys: pytest.CaptureFixture[str]) -> None:
    gap = {"push_m": 0.8, "timing_m": 0.0, "retraction_m": -0.2}
    stands = {"clearance_m": 0.0, "share_of_bound": None, "gap": gap, "saturation_mean": {"hip": 0.1, "knee": 0.2}}
    stands |= {"no_hop": "the foot never leaves the ground", "lift_off": {"time_s": 0.0, "vertical_m_s": 0.0}}
    show([runs.run_table({"stands": {**stands, "peaks": {"ground_force_N": 80.0}}})])
    (row,) = [line.split() for line in capsys.readouterr().out.splitlines() if line.startswith("stands")]
    assert row == ["stands", "0.000", "-", "-", "-", "-", "0.10", "0.20", "-", "-", "80"]


def test_names_are_whole_on_a_narrow_screen() -> None:
    """Rows that are told apart by the ends of their names stay apart."""
    names = ["leg.motor.max_torque", "leg.motor.max_speed", "leg.knee.motor.max_torque", "leg.knee.motor.max_speed"]
    influences = [Influence(n, 1256.637, "rad/s", 1e-4, n.replace("knee.", "") if "knee" in n else None) for n in names]
    data = {
        "problem": "x",
        "failed_checks": [],
        "settled_within": 1e-5,
        "lengths_left_out": False,
        "tie_break_bias": 1e-6,
    }
    data |= {"objective": "clearance", "objective_unit": "m", "objective_value": 0.8}
    with redirect_stdout(Screen()) as screen:
        show(sensitivity.shown({**data, "result_dir": "results/x"}, influences))
        run(["actuators"])
    lines = re.sub(r"\x1b\[[0-9;]*m", "", screen.getvalue()).splitlines()
    rows = [line.split()[0] for line in lines if line.strip()]
    assert set(names) | {"maxon-ec45-150", "maxon-ec45-250", "unitree-go2-knee"} <= set(rows)
    assert max(map(len, lines)) <= 80


def test_checks_fit_a_narrow_screen_and_say_where_they_failed() -> None:
    checks = [
        Check(f"stance transversality of its duration{k}", 10.0**-k, 1e-3, "of the objective", f"at 0.{k} s")
        for k in (1, 5)
    ]
    with redirect_stdout(Screen()) as screen:
        show(shown_checks("x", checks))
    lines = re.sub(r"\x1b\[[0-9;]*m", "", screen.getvalue()).splitlines()
    assert max(map(len, lines)) <= 80
    assert sum("stance transversality of its duration" in line for line in lines) == 3
    assert f"FAILED {checks[0].name}: at 0.1 s" in lines


def test_checks_that_are_left_out_are_counted_apart_with_the_reason(
    hop: Solution, capsys: pytest.CaptureFixture[str]
) -> None:
    made = [Check(f"{phase} replay", 1e-9, 1e-5, "SI") for phase in ("stance", "flight")]
    checks = [*made, *left_out("the simulated leg left the plan")]
    listed = tuple(checks)
    summary = replace(hop.summary, verification=listed)
    assert checks_line(summary).startswith("2 of 2 checks passed, 2 left out; replay")
    show(shown_checks("x", checks))
    shown = capsys.readouterr().out
    assert "x: 2 of 2 checks passed" in shown
    assert (
        "left out: simulated in one piece, limits when simulated in one piece (the simulated leg left the plan)"
        in shown
    )


def test_one_line_says_what_a_hop_is_worth_and_leans_on(hop: Solution) -> None:
    line, rests, leans = in_short(replace(hop.summary, result_dir=None), hop.design)
    lengths = hop.clearance / sum(hop.design.leg.link[name].length for name in hop.design.leg.links)
    assert line.startswith(
        f"the foot clears {lengths:.2f} leg lengths; this motion needs ground that holds the foot sideways"
    )
    assert "of stance without load" in line
    assert rests == "it rests on gears without losses, and on a supply that never sags"
    lost = 100 * hop.summary.gains["longest stance"]
    assert leans == f"it leans on the longest stance (1 % less of it costs {lost:.2g} cm)"
    gripping = replace(hop.summary, leans_on=LeansOn(0.55, 0.0, None))
    assert in_short(gripping, hop.design)[0].endswith("needs friction of at least 0.55")
    noise = {**hop.summary.gains, "longest stance": 0.5 * hop.summary.objective_error.either_way}
    for_nothing = replace(hop.summary, gain_per_percent_m=noise, result_dir="there")
    last = "what the best motion without these loses: hopopt diagnose there --worth"
    assert in_short(for_nothing, hop.design)[1:] == [rests, last]
    assert in_short(replace(hop.summary, verified=False), hop.design) == []


def test_all_that_does_not_matter_is_one_line(hop: Solution) -> None:
    alike = [f"{INSENSITIVE}the {name} torque in stance{AS_GOOD}" for name in ("hip", "knee")]
    told = notes(replace(hop.summary, notes=(alike[0], "a hint", alike[1])))
    assert told == ["a hint", f"{INSENSITIVE}the hip torque in stance, nor on the knee torque in stance{AS_GOOD}"]


def test_a_foot_that_is_swung_onto_the_ground_is_named() -> None:
    """A fall from 0.8 m ends at 3.96 m/s, one of 8.8 m/s begins at 3.95 m."""
    fallen, swung = (Impact(0.0, 0.0, 6.4, 2.0, 6.4, v, 0.1, 10.0) for v in (3.96, 8.8))
    assert hard(fallen, 0.8, 9.81) == []
    (line,) = hard(swung, 0.8, 9.81)
    assert "as fast as by a fall from 3.95 m; hop.touchdown_speed limits that" in line


@pytest.mark.parametrize(("burnt", "told"), [(1e-9, False), (0.04, False), (0.06, True), (None, False)])
def test_energy_is_told_of_one_leg_or_of_all_and_only_where_it_is_any(burnt: float | None, told: bool) -> None:
    s: Any = SimpleNamespace(
        losses={"hip": JointLosses(0.0, 0.0, 200.0), "knee": JointLosses(0.0, 0.0, 378.0)},
        supply=SupplyFigures(40.0, 90.0, 2761.6, burnt_J=burnt),
        objective_error=SimpleNamespace(simulated=SimpleNamespace(sharper_gears_m=None)),
    )
    (line,), (alone,) = drive_lines(s, 4.0), drive_lines(s, 1.0)
    assert line.startswith("heat of windings 578.0 J in one leg; ")
    assert "2761.6 J drawn by all 4 legs" in line
    assert ("0.1 J fed back and burnt" in line) is told
    assert ("burnt" in line) is told
    assert "leg" not in alone


def test_a_time_limit_ends_in_its_sentence(hop: Solution) -> None:
    """Not in a list of the checks that a refinement cut short does not pass."""
    failed = tuple(replace(c, residual=1.0, tolerance=0.1) for c in hop.summary.verification)
    names = tuple(c.name for c in failed)
    limit = {"notes": (LATE,), "time_limit_s": 1.0}
    late = hop.with_summary(verified=False, verification=failed, failed_checks=names, **limit)
    with redirect_stdout(io.StringIO()) as screen:
        show(whole(late))
    assert "the time limit of" in screen.getvalue()
    assert f"{len(failed)} checks fail, as refinement was cut short: hopopt verify lists them" in screen.getvalue()
    assert "FAILED" not in screen.getvalue()


def test_a_leg_that_stays_down_is_said_to(hop: Solution) -> None:
    down = replace(hop.summary, parts=replace(hop.summary.parts, ballistic_rise_m=-0.0009))
    assert in_short(down, hop.design)[0] == (
        "the leg does not leave the ground in any useful sense (ballistic rise -0.0009 m): it is drawn up"
    )
    falls = replace(hop.summary, parts=replace(hop.summary.parts, ballistic_rise_m=-0.09))
    assert in_short(falls, hop.design)[0].startswith("too weak to hop: the body only falls (ballistic rise -0.0900 m)")


def test_how_many_legs_carry_the_body_is_said_first(hop: Solution) -> None:
    whole_robot, shared = (in_short(hop.summary, load("paper", {"leg.body.legs": n}))[0] for n in (1.0, 4.0))
    assert whole_robot.startswith("one leg carries the whole robot, a body of ")
    assert shared.startswith("one of 4 legs that push together and mirror each other: each carries ")


def test_an_answer_without_rotors_says_so(hop: Solution) -> None:
    light = load("paper", ["leg.knee.motor.rotor_inertia=0"])
    words = "it rests on gears without losses, and on a supply that never sags, and on no rotor inertia at the knee, which a motor has"
    assert in_short(hop.summary, light)[1] == words


def test_a_certified_answer_has_no_crude_bound_beside_it(hop: Solution) -> None:
    for certified in (True, False):
        with redirect_stdout(io.StringIO()) as screen:
            show(whole(hop.with_summary(certified=certified)))
        assert ("a crude bound" in screen.getvalue()) is not certified


def test_progress_that_is_piped_is_a_line_now_and_then(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("hopopt.cli.screen.console.PROGRESS_PERIOD", 0.05)
    with progress(quiet=False) as say:
        count_down = Countdown(say, "starting points", 3)
        count_down.more()
        time.sleep(0.2)
        count_down.more(2)
        time.sleep(0.2)
    shown = capsys.readouterr()
    lines = shown.err.splitlines()
    assert shown.out == ""
    assert 2 <= len(lines) <= 9
    assert re.fullmatch(r"hopopt: after 0 s: starting points: 1 of 3 done, about 0 s left", lines[0])
    assert lines[-1].endswith("starting points: 3 of 3 done")
    with progress(quiet=True) as say:
        say("x")
        time.sleep(0.1)
    assert capsys.readouterr().err == ""


def test_brackets_in_what_a_user_wrote_are_shown(capsys: pytest.CaptureFixture[str]) -> None:
    row = {"strategy": "mine:Hop", "meaning": "torque [N m], kept in [/reserve]", "parts": {}, "lift_off": {}}
    show(runs.run({**row, "lift_offs": [], "outcome": "it stands", "result_dir": "results/here"}))
    assert "mine:Hop: torque [N m], kept in [/reserve]" in capsys.readouterr().out


def test_brackets_in_a_line_of_progress_are_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    screen = Screen()
    monkeypatch.setattr("sys.stderr", screen)
    with progress(quiet=False) as say:
        say("keeping [reserve] and [/torque] back")
    assert "[reserve] and [/torque]" in screen.getvalue()
