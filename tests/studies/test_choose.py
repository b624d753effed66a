"""Which motor and gear: pairs that clear, what the others lack, and the leg that is written."""

import json
import time
from pathlib import Path

import numpy as np
import pytest

import hopopt as ho
from hopopt.api.asked import as_class
from hopopt.cli.main import run
from hopopt.design import Design
from hopopt.errors import UsageError
from hopopt.leg.robot import BASE
from hopopt.nlp.deadline import NEVER
from hopopt.ocp.phases import STANCE
from hopopt.planner.solve import solve
from hopopt.problem.catalogue import catalogue
from hopopt.problem.load import catalogue_of, changed, load
from hopopt.studies.choose.bound import highest
from hopopt.studies.choose.choice import (
    CLEARS,
    DROPPED,
    FAILS,
    NOT_SOLVED,
    UNWEIGHED,
    WEAK,
    Candidate,
    Choice,
    first_to_verify,
)
from hopopt.studies.choose.pairs import drives, pairs
from hopopt.studies.choose.run import choose, written
from hopopt.studies.maps.pieces import pieces
from hopopt.studies.maps.run import map_in
from hopopt.studies.sweep.definition import Axis, Definition
from hopopt.studies.sweep.recheck import recheck_study
from hopopt.verify.upper_bound import upper_bound
from once import solved_once

SOME = ("maxon-ec90-flat-260", "maxon-ec45-flat-30", "csg-20-100", "csf-25-50", "unitree-n5020-16")


def some() -> dict:
    return {name: catalogue()[name] for name in SOME}


def test_pairs_are_motors_with_gears_that_are_sold_alone_and_modules_with_their_own() -> None:
    found = {p.name for p in pairs(catalogue())}
    assert "maxon-ec90-flat-260 with csg-20-100" in found
    assert "cubemars-ak80-64" in found
    assert not any("with cubemars" in name for name in found)
    assert all(p.mass is None or p.mass > 0 for p in pairs(catalogue()))
    some = pairs(catalogue(), ["mini-cheetah", "csf-25-*"])
    assert {p.name for p in some} == {"mini-cheetah", "mini-cheetah with csf-25-50"}
    with pytest.raises(UsageError, match=r"--only csf-9\*: no motor or gear is called so"):
        pairs(catalogue(), ["csf-9*"])


def test_the_body_carries_what_new_drives_weigh_more(tmp_path: Path) -> None:
    design, known = load("paper"), catalogue()
    chosen = drives(design, None, 4, 3.0, known)
    pair = next(p for p in pairs(known) if p.name == "maxon-ec90-flat-260 with csf-25-50")
    assert pair.mass is not None
    assert pair.mass == pytest.approx(0.98 + 1.5)
    assert chosen.added(pair) == pytest.approx(4 * (2 * pair.mass - 3.0))
    heavier = changed(design, chosen.named(pair))
    assert heavier.leg.body.mass == pytest.approx(design.leg.body.mass + chosen.added(pair))
    assert heavier.leg.gear.ratio == 50


def test_a_motor_of_ones_own_file_is_tried_by_its_numbers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    own = "[motor.mine]\nmax_torque = 3.0\nmax_speed = 400.0\nrotor_inertia = 2e-5\nmass = 0.5\n"
    (tmp_path / "my.toml").write_text(own)
    (tmp_path / "leg.toml").write_text('extends = "paper"\ncatalogue = "my.toml"\n[leg.motor]\ntorque_cap = 1.5\n')
    known = catalogue_of("leg.toml")
    assert known.keys() == catalogue_of("paper", ["catalogue=my.toml"]).keys()
    chosen = drives(load("leg.toml"), None, 1, 3.0, known)
    pair = next(p for p in pairs(known) if p.name == "mine with csf-25-50")
    leg = changed(chosen.design, chosen.named(pair)).leg
    assert (leg.motor.max_torque, leg.motor.max_speed, leg.motor.rotor_inertia) == (3.0, 400.0, 2e-5)
    assert leg.motor.torque_cap is None  # the leg's own cap is not the new motor's
    assert leg.gear.catalogue == "csf-25-50"


def test_no_hop_passes_the_bound_that_drops_pairs() -> None:
    """The bound of the page, less what a supply does not let through."""
    design = load("paper")
    assert highest(design) == pytest.approx(upper_bound(design).clearance_m)
    assert highest(design) > solved_once({}).clearance
    fed = [
        load("paper", {"supply.voltage": 48.0, "supply.power_cap": cap, "hop.stance_duration": [0.03, 0.1]})
        for cap in (300.0, 600.0)
    ]
    assert highest(fed[0]) < highest(fed[1]) <= upper_bound(fed[1]).clearance_m
    work = 300.0 * 0.1  # J in the longest stance lift the centre of mass by so much less than 600 W do
    weight = 9.81 * 8.27
    assert highest(fed[1]) - highest(fed[0]) == pytest.approx(work / weight, rel=1e-3)


def test_what_cannot_be_asked_gets_one_sentence() -> None:
    design = load("paper")
    for wrong in ({"clearance": -1.0}, {"by": "colour"}, {"joints": ["ankle"]}, {"legs": 0}, {"verify": -1}):
        with pytest.raises(UsageError):
            choose(design, **{"clearance": 0.5, **wrong})
    with pytest.raises(UsageError, match=r"--only maxon-ec60\* names no gear: give patterns for both"):
        choose(design, 0.5, only=["maxon-ec60*"])


@pytest.mark.rarely
def test_the_first_pair_is_verified_and_its_written_leg_hops_as_high(tmp_path: Path) -> None:
    """Preliminary within 0.2 per cent of what a solve of the written leg finds, verified within 1e-5 m."""
    design = load("paper")
    found = choose(design, 0.3, verify=1, starts=2, processes=1, results=tmp_path, entries=some())
    first = found.clearing[0]
    assert found.exit_code == 0
    assert found.folder is not None
    assert len(map_in(found.folder).points) == len(
        [c for c in found.candidates if c.outcome not in (UNWEIGHED, DROPPED, WEAK)]
    )
    assert first.verified is not None
    assert first.verified >= 0.3
    again: Design = written(found, first)
    answer = solve(again, starts=2)
    assert answer.verified
    assert first.verified == pytest.approx(answer.clearance, abs=1e-5)
    assert first.preliminary == pytest.approx(answer.clearance, rel=2e-3)
    by_mass = [c.mass for c in found.clearing if c.mass is not None]
    assert by_mass == sorted(by_mass)
    outcomes = {c.pair.name: c.outcome for c in found.candidates}
    assert outcomes["unitree-n5020-16 with csg-20-100"] == UNWEIGHED
    assert outcomes["maxon-ec45-flat-30 with csf-25-50"] in (WEAK, DROPPED, FAILS)
    assert CLEARS in outcomes.values()


def test_of_a_gear_family_the_best_ratio_is_listed() -> None:
    design, known = load("paper"), catalogue()
    chosen = drives(design, None, 1, None, known)
    own = [p for p in pairs(known) if p.motor == "maxon-ec90-flat-260" and p.gear in ("csg-17-80", "csg-17-100")]
    tried = tuple(Candidate(p, CLEARS, p.mass, preliminary=0.5 + 0.1 * k) for k, p in enumerate(own))
    listed = Choice(chosen, 0.4, "mass", tried, None, 0.0).clearing
    assert [c.pair.name for c in listed] == [own[1].name]


def test_a_choice_in_python_has_a_table_figures_and_the_leg() -> None:
    """Sorted by what was asked for, what is not known of a pair last; the front is of pairs that none with less beats."""
    design, known = load("paper"), catalogue()
    gears = ("apex-af042-20", "csf-25-50", "maxon-gp52c-12")
    first, second, third = [p for p in pairs(known) if p.motor == "maxon-ec90-flat-260" and p.gear in gears]
    tried = (
        Candidate(first, CLEARS, 3.0, preliminary=0.5, energy=60.0, peak_power=900.0),
        Candidate(second, CLEARS, 2.0, price=700.0, preliminary=0.6, energy=70.0, peak_power=800.0),
        Candidate(third, FAILS, 1.0, preliminary=0.1, lacks="torque", energy=20.0, peak_power=100.0),
    )
    found = as_class(ho.Choice, Choice(drives(design, None, 1, None, known), 0.4, "price", tried, None, 0.0))
    assert [c.pair for c in found.clearing] == [second, first]
    assert [c.pair for c in found.front()] == [c.pair for c in found.front("peak-power")] == [third, second]
    assert first_to_verify(dict(enumerate(tried)), "energy", 1) == [0]
    table = found.to_dataframe()
    assert table.loc[second.name, "mass"] == 2.0
    assert list(table["outcome"]) == [CLEARS, CLEARS, FAILS]
    assert second.name in found._repr_html_()
    assert found.problem().leg.gear.catalogue == second.gear
    assert "together [W]" in found.plot("peak_power").axes[0].get_xlabel()
    with pytest.raises(UsageError, match="there is no pair 'mini'"):
        found.problem("mini")


def test_a_choice_in_python_keeps_its_file_as_the_command_does(tmp_path: Path) -> None:
    """Also where no time was left to solve a pair."""
    asked = {"only": ["mini-cheetah"], "verify": 0, "processes": 1, "time_limit": 1e-3, "results": tmp_path}
    found = ho.choose("paper", 0.3, **asked)
    assert found.folder is not None
    written_down = json.loads((found.folder / "choice.json").read_text())
    (candidate,) = written_down["candidates"]
    assert (candidate["name"], candidate["outcome"]) == ("mini-cheetah", NOT_SOLVED)
    assert written_down["clearance_m"] == 0.3


def test_points_of_a_list_wait_for_no_other() -> None:
    listed = tuple((ratio,) for ratio in (50.0, 80.0, 100.0, 120.0, 160.0, 9.0))
    axis = Axis("leg.gear.ratio", (), 9.0, 160.0)
    whole = pieces(Definition(load("paper"), "clearance", (axis,), listed=listed), 0)
    assert sorted(k for piece in whole for k in piece.points) == list(range(6))
    assert all(piece.entrance is None for piece in whole)


def test_a_file_that_exists_is_told_before_the_work(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "leg.toml").write_text("mine")
    assert run(["choose", "--clearance", "0.5", "--write", str(tmp_path / "leg.toml")]) == 2
    assert "exists already and is not overwritten" in capsys.readouterr().err


@pytest.mark.slow
def test_every_pair_of_a_small_catalogue_is_tried_and_told(tmp_path: Path) -> None:
    names = ("mini-cheetah", "maxon-ec90-flat-260", "csg-20-100", "csf-25-50")
    entries = {name: catalogue()[name] for name in names}
    found = choose(load("paper"), 0.3, verify=0, starts=1, processes=1, results=tmp_path, entries=entries)
    assert len(found.candidates) == 5
    assert found.exit_code == 3  # none of them is verified
    by_name = {c.pair.name: c for c in found.candidates}
    assert by_name["mini-cheetah"].outcome == CLEARS
    assert all((c.outcome == CLEARS) == ((c.preliminary or 0.0) >= 0.2985) for c in found.candidates if c.preliminary)
    assert all(c.lacks in ("torque", "speed", "supply", "mass") for c in found.others)
    assert all(c.preliminary is None or c.preliminary < (c.bound or 0.0) for c in found.candidates)
    leg = written(found, by_name["mini-cheetah"]).leg
    assert (leg.motor.catalogue, leg.gear.catalogue) == ("mini-cheetah", "mini-cheetah")
    again = choose(
        load("paper"), 0.3, verify=0, starts=1, processes=1, results=tmp_path, entries=entries, resume=found.folder
    )
    assert [c.preliminary for c in again.candidates] == [c.preliminary for c in found.candidates]


@pytest.mark.slow
def test_a_solve_that_never_settles_counts_by_its_best_iterate_and_a_hopeless_one_ends_soon(tmp_path: Path) -> None:
    """Ipopt oscillates about this optimum until its iterations are out.
    A rotor too heavy for its gear lifts nothing; Ipopt's restoration took half a minute to say so."""
    names = ("faulhaber-4221-bxt", "csf-25-50", "maxon-ec90-flat-400", "csg-17-100")
    entries, told = {name: catalogue()[name] for name in names}, list[str]()
    first = list[Choice]()
    only = ("faulhaber-4221-bxt", "csf-25-50")
    settings = {"verify": 0, "starts": 1, "processes": 1, "results": tmp_path, "progress": told.append}
    found = choose(load("paper"), 0.515, only=only, entries=entries, listed=first.append, **settings)
    assert [c.outcome for c in found.candidates] == [CLEARS]
    assert found.candidates[0].clearance == pytest.approx(0.519, abs=2e-3)
    assert any("1 clear so far, the lightest faulhaber-4221-bxt" in words for words in told)
    assert not first  # nothing is verified, so the list is not told twice
    only = ("maxon-ec90-flat-400", "csg-17-100")
    began = time.process_time()
    assert choose(load("paper"), 0.5, only=only, entries=entries, **settings).candidates[0].outcome == NOT_SOLVED
    assert time.process_time() - began < 10


def test_a_body_that_would_weigh_nothing_is_told_in_a_sentence() -> None:
    found = choose(load("paper"), 0.3, only=["mini-cheetah"], legs=4).candidates[0]
    assert found.outcome == NOT_SOLVED
    assert (
        "is less than the 17.7 kg of all legs' present drives, which it counts: give --present-mass" in found.sentence
    )


RODS_AND_SPRING = {
    "leg.knee.transmission.linear.slope": -0.2, "leg.knee.transmission.linear.at": -1.3,
    "leg.knee.transmission.coupling.hip.ratio": 1.0,
    "leg.spring.knee.stiffness": 20.0, "leg.spring.knee.rest_angle": -1.0, "leg.spring.knee.acts": "below",
}  # fmt: skip


def test_a_leg_with_springs_or_rods_drops_no_pair_because_it_cannot_hold_the_start_pose(tmp_path: Path) -> None:
    """With either it may sink into a pose in which it is stronger. A plain leg drops this motor without a gear at once."""
    plain, at_once = load("paper"), {"verify": 0, "processes": 1, "results": tmp_path, "until": NEVER.within(0.0)}
    weak = ["maxon-ec45-flat-70", "maxon-gp42c-26"]
    for entries, outcome in (
        ({}, WEAK),
        (RODS_AND_SPRING, NOT_SOLVED),
        ({"leg.spring.knee.stiffness": 1.0, "leg.spring.knee.rest_angle": 0.0}, NOT_SOLVED),
    ):
        heavy = changed(plain, {**entries, "leg.body.mass": 20.0})
        (candidate,) = choose(heavy, 0.05, only=weak, present_mass=1.0, **at_once).candidates
        assert candidate.outcome == outcome


@pytest.mark.rarely
def test_drives_that_push_through_rods_beside_a_spring_are_chosen(tmp_path: Path) -> None:
    """As high as a solve of the written leg, and the energy of the push is of its drives, whose ratios are written out here."""
    design = changed(load("paper"), RODS_AND_SPRING)
    found = choose(design, 0.4, only=["mini-cheetah"], verify=0, processes=1, results=tmp_path)
    (first,) = found.clearing
    answer = solve(written(found, first), starts=1, processes=1)
    assert answer.verified
    assert first.clearance == pytest.approx(answer.clearance, rel=2e-3)
    push = answer.everywhere(STANCE, np.linspace(0.0, 1.0, 9))
    own = 1 - 0.2 * (push.q[:, BASE + 1] + 1.3)  # turns of the knee's drive for one of the knee
    knee = push.tau[:, 1] / own
    powers = np.array([push.tau[:, 0] - knee, knee]) * [push.v[:, BASE], push.v[:, BASE] + own * push.v[:, BASE + 1]]
    assert first.energy == pytest.approx(np.trapezoid(np.maximum(powers, 0).sum(axis=0), push.t), rel=0.02)


@pytest.mark.rarely
def test_a_pair_that_clears_only_with_too_hot_a_winding_does_not_clear(tmp_path: Path) -> None:
    """Verified is the written leg, whose motor must stay below 155 degC, and not the list's, which knows no heat."""
    first = list[Choice]()
    found = choose(
        load("paper"), 0.3, only=["maxon-ec4pole30-200", "maxon-gp81a-14"], verify=1, processes=1, results=tmp_path,
        listed=first.append,
    )  # fmt: skip
    (listed,), (verified,) = first[0].candidates, found.candidates
    assert (listed.outcome, listed.lacks, verified.outcome, verified.lacks) == (CLEARS, "heat", FAILS, "heat")
    answer = solve(written(found, verified), starts=1, processes=1)
    assert verified.verified == pytest.approx(answer.clearance, abs=1e-5)
    assert answer.summary.heat is not None
    assert answer.summary.heat["hip"].winding_temperature_C == pytest.approx(155, abs=0.1)
    assert found.folder is not None
    rechecked, changed_files = recheck_study(found.folder)
    assert ([r.fault for r in rechecked], changed_files) == ([""], [])
