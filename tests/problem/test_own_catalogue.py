"""A user's own catalogue, in TOML or CSV: how a problem names it, and what is said of one that is wrong."""

import json

import pytest

from hopopt.cli.main import run
from hopopt.errors import ProblemFileError
from hopopt.problem.catalogue import catalogue
from hopopt.problem.catalogue_files import own_catalogue
from hopopt.problem.load import catalogue_of, design_hash, load, resolved_toml

TOML = """
[motor.hand-wound]
title = "My motor"
source = "measured on the bench"
unverified = ["rotor_inertia"]
max_torque = 3.0
max_speed = 400.0
rotor_inertia = 2e-5
voltage = 24.0
[gear.two-belts]
ratio = 9
mass = 0.2
efficiency_speeds = [100.0, 200.0]
efficiency_values = [0.9, 0.8]
"""
CSV = """part,name,title,unverified,max_torque,max_speed,rotor_inertia,voltage,ratio,mass,efficiency_speeds,efficiency_values
motor,hand-wound,My motor,rotor_inertia,3.0,400,2e-5,24,,,,

gear,two-belts,,,,,,,9,0.2,100 200,0.9 0.8
"""
NAMES = 'extends = "paper"\ncatalogue = "{}"\n[leg]\nmotor = "hand-wound"\n[leg.knee]\ngear = "two-belts"\n'


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, text in (("my.toml", TOML), ("my.csv", CSV)):
        (tmp_path / name).write_text(text)
        (tmp_path / f"of_{name}.toml").write_text(NAMES.format(name))
    return tmp_path


def faults(path) -> list[str]:
    with pytest.raises(ProblemFileError) as raised:
        own_catalogue(path)
    return raised.value.problems


@pytest.mark.parametrize("name", ["my.toml", "my.csv"])
def test_a_problem_names_motors_and_gears_of_its_own_catalogue(folder, name):
    leg = load(f"of_{name}.toml", ["leg.knee.gear.efficiency=0.5"]).leg
    assert (leg.motor.max_torque, leg.motor.max_speed, leg.motor.rotor_inertia) == (3.0, 400.0, 2e-5)
    assert leg.drive("knee", "gear", "ratio") == ("leg.knee.gear.ratio", 9.0)
    assert leg.drive("knee", "gear", "efficiency")[1] == 0.5  # a number counts over a name
    assert leg.drive("hip", "gear", "ratio")[1] == 100
    assert leg.motor.catalogue == "hand-wound"


def test_toml_and_csv_say_the_same(folder):
    one, other = own_catalogue("my.toml"), own_catalogue("my.csv")
    assert {n: e.stated for n, e in one.items()} == {n: e.stated for n, e in other.items()}
    assert {n: e.marks for n, e in one.items()} == {n: e.marks for n, e in other.items()}
    assert one["hand-wound"].unverified("motor") == other["hand-wound"].unverified("motor") == ("rotor_inertia",)
    assert one["hand-wound"].title == other["hand-wound"].title == "My motor"
    assert one["two-belts"].facts["gear"] == {
        "mass": 0.2,
        "efficiency_speeds": [100.0, 200.0],
        "efficiency_values": [0.9, 0.8],
    }


def test_own_entries_stand_beside_the_built_in_ones(folder):
    known = catalogue_of("of_my.toml.toml")
    assert set(known) == {*catalogue(), "hand-wound", "two-belts"}
    assert catalogue_of("paper") == catalogue()
    assert known["two-belts"].masses == {"gear": 0.2}


def test_the_catalogue_can_be_named_on_the_command_line(folder, capsys):
    assert load("paper", {"catalogue": "my.csv", "leg.motor": "hand-wound"}).leg.motor.max_torque == 3.0
    assert run(["show", "--set", "leg.motor=hand-wound", "--set", "catalogue=my.toml", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["leg.motor.max_torque"]["value"] == 3.0
    assert run(["actuators", "--catalogue", "my.toml", "--json"]) == 0
    listed = json.loads(capsys.readouterr().out)
    assert listed["motors"]["hand-wound"]["max_torque"]["source"] == "your own file"
    assert listed["motors"]["hand-wound"]["rotor_inertia"]["source"] == "unverified"
    assert listed["notes"] == ["hand-wound has no mass as a motor: give motor.mass to compare it by mass"]
    assert run(["actuators", "--catalogue", "my.toml"]) == 0
    shown = capsys.readouterr().out
    assert "hand-wound has no mass" in shown
    assert next(line for line in shown.splitlines() if line.startswith("hand-wound")).split()[-1] in ("3/4", "motor")


def test_the_resolved_problem_needs_no_own_catalogue(folder):
    design = load("of_my.toml.toml")
    (folder / "my.toml").unlink()
    (folder / "problem.toml").write_text(resolved_toml(design))
    assert load("problem.toml") == design
    assert design_hash(load("problem.toml")) == design_hash(design)


@pytest.mark.parametrize(
    ("was", "now", "sentence"),
    [
        ("max_torque = 3.0", "", "motor.hand-wound.max_torque is missing: tau_max: motor torque at standstill"),
        ("max_torque = 3.0", "max_torqe = 3.0\nmax_torque = 3.0", "motor.hand-wound.max_torqe is not a known key (did you mean max_torque?)"),
        ("rotor_inertia = 2e-5", "rotor_inertia = 200", "motor.hand-wound.rotor_inertia = 200 kg m^2 is too large: a number from 0 to 0.05 "
         "kg m^2 is needed; 200 looks like g cm^2: write 2e-05"),
        ("mass = 0.2", "mass = 200", "gear.two-belts.mass = 200 kg is too large: a number from 0.001 to 100 kg is needed; 200 looks like "
         "grams: write 0.2."),
        ("mass = 0.2", "mass = true", "gear.two-belts.mass = true is not allowed: a number from 0.001 to 100 kg is needed."),
        ("voltage = 24.0", "winding_limit = -90", "motor.hand-wound.winding_limit = -90 degC is too small: a number from -50 to 400 degC"),
        ("[100.0, 200.0]", "100.0", "gear.two-belts.efficiency_speeds = 100.0 is not allowed: a list of numbers, each from 0.1 to 6000"),
        ("[gear.two-belts]", "[gear.csg-20-100]", "gear.csg-20-100 has the name of a built-in entry: choose another name."),
        ("[gear.two-belts]", "[gear.Belt]", "gear.Belt is not a name: at most 50 small letters, digits and hyphens"),
        ('["rotor_inertia"]', '["inertia"]', 'motor.hand-wound.unverified = ["inertia"] is not allowed: a list of keys of this motor'),
        ("[gear.two-belts]", "[motor.hand-wound]", "is not valid TOML"),
        ("[gear.two-belts]", "[belt.two]", 'has "belt", which no catalogue has: write [motor.NAME] and [gear.NAME] alone.'),
    ],
)  # fmt: skip
def test_a_wrong_entry_gets_one_sentence(folder, was, now, sentence):
    assert was in TOML
    (folder / "my.toml").write_text(TOML.replace(was, now))
    (said,) = faults("my.toml")
    assert said.startswith("my.toml")
    assert sentence in said
    with pytest.raises(ProblemFileError) as raised:
        load("of_my.toml.toml")
    assert sentence in raised.value.problems[0]


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "has no column part in its first line"),
        ("part,ratio\ngear,3", "has no column name in its first line"),
        ("part,name,ratio\n", "has no motor and no gear"),
        ("part,name,ratio\nbelt,x,3", 'has the part "belt" in line 2: motor or gear is needed'),
        ("part,name,ratio\ngear,x,3,5", "has more cells in line 2 than columns"),
        ("part,name,ratio,ratio\ngear,x,3,5", 'has the column "ratio" twice'),
        ("part,name,ratio\ngear,x,nine", 'gear.x.ratio = "nine" is not allowed: a number from 1 to 1000 is needed'),
        ("part,name,ratio\ngear,x,9\ngear,x,8", "gear.x is there twice: give each its own name."),
        ("part,name,ratio,rati\ngear,x,9,9", "gear.x.rati is not a known key (did you mean ratio?)"),
    ],
)
def test_a_wrong_table_of_csv_gets_one_sentence(tmp_path, text, sentence):
    (tmp_path / "my.csv").write_text(text)
    (said,) = faults(tmp_path / "my.csv")
    assert sentence in said


@pytest.mark.parametrize("name", ["../my.toml", "/etc/passwd", "nowhere.toml", 3, "\x00"])
def test_no_path_leads_out_of_the_folder_of_the_problem(folder, name):
    inner = folder / "inner"
    inner.mkdir()
    (inner / "p.toml").write_text(f'extends = "paper"\ncatalogue = {json.dumps(name)}\n')
    with pytest.raises(ProblemFileError) as raised:
        load(inner / "p.toml")
    (said,) = raised.value.problems
    assert "catalogue = " in said
    assert any(
        words in said for words in ("leads out of the folder", "there is no such file", "is not the path of a file")
    )
