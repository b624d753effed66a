"""Problem files as their author sees them: what is read, what is refused, and in which words."""

import string
import tomllib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from hopopt.design import Design, physical_parameters
from hopopt.drivetrain.operating_region.region import operating_region
from hopopt.errors import HopoptError, ProblemFileError
from hopopt.leg.geometry.above import above_ground
from hopopt.problem.load import as_json, builtin_names, design_hash, load, resolved_toml, rows, template

pytestmark = pytest.mark.filterwarnings("error")


def faults(source, overrides=()) -> list[str]:
    """The sentences ``load`` raises."""
    with pytest.raises(ProblemFileError) as raised:
        load(source, overrides)
    assert str(raised.value) == "\n".join(raised.value.problems)
    return raised.value.problems


def only_fault(source, overrides=()) -> str:
    found = faults(source, overrides)
    assert len(found) == 1, found
    return found[0]


@pytest.fixture
def write(tmp_path, monkeypatch):
    """Writes a problem file into the folder we are in and returns its path."""
    monkeypatch.chdir(tmp_path)

    def write(text: str, name: str = "mine.toml") -> Path:
        path = Path(name)
        path.write_text(text, encoding="utf-8")
        return path

    return write


@pytest.fixture
def edited(write):
    """Writes the paper's file with one text replaced by another."""

    def edited(*edits: tuple[str, str]) -> Path:
        text = template("mine")
        for old, new in edits:
            assert old in text
            text = text.replace(old, new, 1)
        return write(text)

    return edited


# ---- what is read -----------------------------------------------------------------------------------------------


def test_paper_is_the_papers_leg():
    leg = load().leg
    assert (leg.link["thigh"].length, leg.link["shank"].length, leg.body.mass, leg.gear.ratio) == (
        0.38,
        0.361,
        5.6,
        100,
    )
    assert leg.motor.max_speed == pytest.approx(12000 * 2 * np.pi / 60, abs=1e-3)
    assert leg.motor.rotor_inertia == pytest.approx(119 * 1e-3 * 1e-4)


def test_paper_states_the_defaults():
    design = load()
    assert design.solver == type(design.solver)()
    assert design.hop == type(design.hop)().with_defaults(1.0, 9.81)


@pytest.mark.parametrize("given", [(), None])
def test_all_that_stays_above_the_ground_is_named(given: tuple | None):
    overrides = {"hop.above_ground": given}
    assert tuple(above_ground(load("paper", overrides))) == ("hip", "knee", "foot")
    assert tuple(above_ground(load("three_joint", overrides))) == ("hip", "knee", "ankle", "foot")
    named = load("paper", {"hop.above_ground": ["hip", "knee", "foot"]})
    assert design_hash(load("paper", overrides)) == design_hash(named)


@pytest.mark.parametrize("name", builtin_names())
def test_every_value_of_a_built_in_problem_has_a_comment(name):
    text = (Path(__file__).parents[2] / "problems" / f"{name}.toml").read_text(encoding="utf-8")
    values = [line for line in text.splitlines() if "=" in line.split("#")[0]]
    bare = [line for line in values if "#" not in line and not line.startswith(("extends", "name", "title"))]
    assert not bare


def test_optional_entries_of_the_template_can_be_switched_on(write):
    text = template("mine").replace("# joint_angles", "#joint_angles").replace("# above_ground", "#above_ground")
    lines = []
    for line in text.splitlines():
        entry = line.removeprefix("# ").split("  ")[0].strip()
        is_entry = (
            entry.split(" = ")[0].isidentifier() if " = " in entry else entry.startswith(("[leg.knee.", "[supply]"))
        )
        lines.append(line.removeprefix("# ") if is_entry else line)
    leg = load(write("\n".join(lines))).leg
    assert leg.drive("knee", "gear", "ratio") == ("leg.knee.gear.ratio", 80)
    assert leg.drive("hip", "gear", "ratio") == ("leg.gear.ratio", 100)
    assert (leg.link["thigh"].com, leg.motor.torque_cap, leg.gear.torque_cap) == (0.19, 1.5, 107)


def test_variants_differ_only_in_what_they_say():
    paper, variant = as_json(load("paper")), as_json(load("paper_no_countermovement"))
    assert {p for p in paper if paper[p] != variant[p]} == {"name", "title", "hop.counter_movement"}
    variant = as_json(load("paper_four_quadrant"))
    assert {p for p in paper if paper[p] != variant[p]} == {"name", "title", "leg.motor.laws", "leg.motor.torque_cap"}


@pytest.mark.parametrize("name", builtin_names())
def test_round_trip(name, write):
    last = load(name).leg.joints[-1]
    design = load(name, {f"leg.{last}.gear.ratio": 80, "title": 'a "quoted" \\ title, ü 🦿'})
    assert load(write(resolved_toml(design))) == design


def test_a_leg_of_three_joints(write):
    three = template("three").replace('["hip", "knee"]', '["hip", "knee", "ankle"]')
    three = three.replace('["thigh", "shank"]', '["thigh", "shank", "foot"]')
    three = three.replace("hip_height = 0.28", "joint_angles = [0.5, -1.0, 0.5]")
    three += "\n[leg.ankle]\nlower = -1\nupper = 1\n[leg.foot]\nlength = 0.1\nmass = 0.2\n"
    design = load(write(three))
    assert design.start.joint_angles == (0.5, -1.0, 0.5)
    assert load(write(resolved_toml(design))) == design


def test_overrides_from_texts_tables_and_numpy():
    texts = load(
        "paper", ["leg.gear.ratio=80", "solver.scheme=trapezoidal", 'title="x"', "hop.stance_duration=[0.1, 0.2]"]
    )
    tables = {"leg": {"gear": {"ratio": np.float64(80)}}, "solver.scheme": "trapezoidal", "title": "x"}
    assert texts == load("paper", {**tables, "hop.stance_duration": np.array([0.1, 0.2])})
    assert texts.leg.gear.ratio == 80
    assert texts.hop.stance_duration == (0.1, 0.2)


def test_none_takes_an_entry_out():
    assert load("paper", {"leg.motor.rotor_inertia": None}).leg.motor.rotor_inertia == 0


def test_a_later_start_takes_the_place_of_an_earlier_one():
    start = load("paper", ["start.joint_angles=[1.1, -2.3]"]).start
    assert (start.hip_height, start.joint_angles) == (None, (1.1, -2.3))


def test_byte_order_mark_is_read(tmp_path):
    path = tmp_path / "windows.toml"
    path.write_bytes(b"\xef\xbb\xbf" + template("windows").replace("\n", "\r\n").encode())
    assert load(path).name == "windows"


def test_rows_and_json_name_unit_and_meaning():
    by_path = {row.path: row for row in rows(load())}
    assert by_path["leg.thigh.length"].value == 0.38
    assert by_path["leg.thigh.length"].unit == "m"
    assert "joint" in by_path["leg.thigh.length"].meaning
    assert by_path["hop.stance_duration"].unit == "s"
    assert as_json(load())["leg.gear.ratio"] == {
        "value": 100.0,
        "unit": "1",
        "meaning": "R: motor turns for one turn of the joint",
    }
    assert by_path["contact.friction"].value is None


def test_hash_sees_all_but_the_title():
    plain = design_hash(load())
    assert len(plain) == 8
    assert set(plain) <= set(string.hexdigits)
    assert design_hash(load("paper", ["title=another"])) == plain
    assert design_hash(load("paper", ["leg.gear.ratio=100"])) == plain
    assert design_hash(load("paper", ["leg.gear.ratio=100.5"])) != plain


def test_template_is_the_papers_leg_under_another_name(write):
    mine = load(write(template("my-leg_2")))
    assert mine.name == "my-leg_2"
    assert mine.leg == load().leg
    with pytest.raises(ProblemFileError, match=r'^name = "../x" is not allowed: text of 1 to 64 letters'):
        template("../x")


# ---- what is refused: one fault, one sentence -------------------------------------------------------------------

SENTENCES = [
    (("length = 0.361", "length = 361"), "leg.shank.length = 361 m is too large: a number from 0.01 to 3 m is needed; 361 looks like millimetres: write 0.361."),
    (("1.19e-5 ", "119 "), "leg.motor.rotor_inertia = 119 kg m^2 is too large: a number from 0 to 0.05 kg m^2 is needed; 119 looks like g cm^2: write 1.19e-05, or like kg cm^2: write 0.0119."),
    (("1256.637", "12000"), "leg.motor.max_speed = 12000 rad/s is too large: a number from 1 to 6000 rad/s is needed; 12000 looks like rpm: write 1256.64."),
    (("upper = 1.3", "upper = 75"), "leg.hip.upper = 75 rad is too large: a number from -7 to 7 rad is needed; 75 looks like degrees: write 1.309."),
    (("mass = 1.87", "mass = 1870"), "leg.thigh.mass = 1870 kg is too large: a number from 0.0001 to 200 kg is needed; 1870 looks like grams: write 1.87."),
    (("mass = 1.87", "mass = -1"), "leg.thigh.mass = -1 kg is too small: a number from 0.0001 to 200 kg is needed; write 1 if the sign is all that is wrong."),
    (("mass = 5.6", "mass = nan"), "leg.body.mass = nan kg is not finite: a number from 0.001 to 1000 kg is needed."),
    (("mass = 5.6", "mass = inf"), "leg.body.mass = inf kg is not finite: a number from 0.001 to 1000 kg is needed."),
    (("mass = 5.6", 'mass = "5.6 kg"'), 'leg.body.mass = "5.6 kg" is not allowed: a number from 0.001 to 1000 kg is needed; write the number alone, without quotes or unit.'),
    (("ratio = 100", "ratio = true"), "leg.gear.ratio = true is not allowed: a number from 1 to 1000 is needed."),
    (("ratio = 100", "rati = 100"), "leg.gear.rati is not a known key (did you mean ratio?): [leg.gear] takes ratio, torque_cap, speed_cap, inertia, efficiency, efficiency_table, friction, damping, catalogue and model."),
    (('"radau"', '"radua"'), 'solver.scheme = "radua" is not allowed: "radau" or "hermite-simpson" or "trapezoidal" is needed; did you mean "radau"?'),
    (('["paper"]', '["4-quadrant"]'), 'leg.motor.laws[0] = "4-quadrant" is not allowed: a list of "paper" or "four-quadrant" is needed; did you mean "four-quadrant"?'),
    (
        ('["paper"]', '"[paper]"'),
        'leg.motor.laws = "[paper]" is not allowed: a list of "paper" or "four-quadrant" is needed; write its names in quotes.',
    ),
    (('["paper"]', '"paper"'), 'leg.motor.laws = "paper" is not allowed: a list of "paper" or "four-quadrant" is needed; write it in [ ].'),
    (('["paper"]', "[]"), 'leg.motor.laws = [] leaves nothing to bound the torque (motor.torque_cap or gear.torque_cap) and the speed (gear.speed_cap) of hip, knee: give these caps, or "paper" or "four-quadrant" in leg.motor.laws.'),
    (("degree = 3", "degree = 3.0"), "solver.degree = 3.0 is not allowed: a whole number from 1 to 9 is needed."),
    (("[0.03, 0.4]", "[30, 0.4]"), "hop.stance_duration[0] = 30 s is too large: a list of two numbers, each from 0.001 to 10 s, is needed; 30 looks like milliseconds: write 0.03."),
    (("[0.03, 0.4]", "[0.03]"), "hop.stance_duration"),
    (("[0.03, 0.4]", "[0.4, 0.03]"), "hop.stance_duration = [0.4, 0.03] s begins above its end: write [shortest, longest]."),
    (("[0.03, 0.4]", "[0, 0.4]"), "hop.stance_duration[0] = 0 s is too small: a list of two numbers, each from 0.001 to 10 s, is needed."),
    (("lower = -0.6", "lower = 1.3"), "leg.hip.lower = 1.3 rad is not below leg.hip.upper = 1.3 rad: exchange or widen them."),
    (("# com = 0.19 ", "com = 0.5 "), "leg.thigh.com = 0.5 m is beyond the end of the link: a number from 0 to leg.thigh.length = 0.38 m is needed."),
    (("[leg.hip]", "[leg.hipp]"), "leg.hip is missing: leg.joints names it, so add the table [leg.hip] with lower and upper."),
    (('["thigh", "shank"]', '["thigh"]'), 'leg.links names 1 where leg.joints names 2: each joint carries one link.'),
    (('["hip", "knee"]', '["hip", "hip"]'), 'leg.joints has "hip" 2 times: give each a name of its own.'),
    (('["hip", "knee"]', '["hip", "foot"]'), 'leg.joints has "foot", which is reserved'),
    (('["hip", "knee"]', '["hip", "knee joint"]'), 'leg.joints has "knee joint": a name is a letter, then'),
    (('["thigh", "shank"]', '["thigh", "knee"]'), 'leg.links has "knee", which is a joint too'),
    (('# above_ground = ["knee", "foot"]', 'above_ground = ["kne"]'), 'hop.above_ground has "kne" (did you mean knee?): it takes hip, knee, foot.'),
    (("hip_height = 0.28", "hip_height = 0.9"), "start.hip_height = 0.9 m with start.foot_x = 0.0 m is not possible: the leg reaches from 0.019 to 0.741 m; with this foot_x choose it from 0.270 to 0.738 m."),
    (("hip_height = 0.28", "hip_height = 0.1"), "start.hip_height = 0.1 m with start.foot_x = 0.0 m is not possible: it needs joint angles"),
    (("hip_height = 0.28", "# nothing"), "start says nothing about the pose: give hip_height (legs of two joints) or joint_angles."),
    (("# joint_angles", "joint_angles"), "start has both hip_height and joint_angles: each says where the leg starts, remove one."),
    (("hip_height = 0.28", "joint_angles = [1.0]"), "start.joint_angles = [1.0] has the wrong number of angles (1): one is needed for each of hip, knee."),
    (("hip_height = 0.28", "joint_angles = [1.0, 0.5]"), "start.joint_angles[1] = 0.5 rad is outside the limits of knee: a number from leg.knee.lower = -2.4 to leg.knee.upper = -0.15 rad is needed."),
    (("[leg.gear]", "[leg.gears]"), "leg.gear is missing: "),
    (('name = "mine"', 'name = "a b"'), 'name = "a b" is not allowed: text of 1 to 64 letters, digits, _ or -, the first a letter or digit, is needed.'),
    (("[leg.shank]", "[leg.shnk]"), "leg.shnk is not a known key (did you mean shank?): [leg] takes"),
    (('name = "mine"', 'nam = "mine"'), "nam is not a known key (did you mean name?): the top of the file takes name, title,"),
    (('name = "mine"', 'name = "mine"\nratio = 3'), "ratio is not a known key: the top of the file takes name, title, leg, contact, start, hop, solver, environment, simulation, reserve, control, uncertainty, needs, parameters, supply, catalogue and extends; ratio belongs in [leg.gear]."),
    (("[start]", "[begin]"), "start is missing: add the table [start] with hip_height (legs of two joints) or joint_angles, or begin the file with extends = \"paper\"."),
    (('joints = ["hip", "knee"]', "joints = 3"), 'leg.joints = 3 is not allowed: a list of names, such as ["hip", "knee"], is needed'),
    (("[contact]", "[contact.friction]"), "contact.friction = a table is not allowed: a number from 0 to 10 is needed."),
]  # fmt: skip


@pytest.mark.parametrize(("edit", "sentence"), SENTENCES, ids=[f"{edit[1][:40]}" for edit, _ in SENTENCES])
def test_sentence(edited, edit, sentence):
    matching = [fault for fault in faults(edited(edit)) if fault.startswith(f"mine.toml: {sentence}")]
    assert len(matching) == 1, faults(edited(edit))


def test_a_key_in_the_wrong_table_is_told_its_own(edited):
    assert only_fault(edited(('name = "mine"', 'name = "mine"\nratio = 3'))).endswith("; ratio belongs in [leg.gear].")


def test_every_fault_is_reported_at_once(edited):
    found = faults(
        edited(
            ("length = 0.361", "length = 361"),
            ("mass = 5.6", ""),
            ("lower = -0.6", "lower = 2"),
            ("degree = 3", "degre = 3"),
            ("[0.03, 1.0]", "[1.0, 0.03]"),
            ("# friction = 0.8", "friction = -1"),
            ("# joint_angles", "joint_angles"),
        )
    )
    assert len(found) == 7
    for path in (
        "leg.shank.length",
        "leg.body.mass",
        "leg.hip.lower",
        "solver.degre",
        "hop.flight",
        "contact.",
        "start has both",
    ):
        assert any(path in sentence for sentence in found), path
    assert (
        "mine.toml: leg.body.mass is missing: mass of the body with both motors, as this leg carries it; a number"
        in "\n".join(found)
    )


def test_empty_file_says_what_is_missing(write):
    found = faults(write(""))
    assert [sentence.split(" is missing")[0] for sentence in found] == [
        f"mine.toml: {k}" for k in ("name", "leg", "start")
    ]


def test_section_that_is_no_table(write):
    assert any("hop = 5 is not a table: write [hop]" in sentence for sentence in faults(write("hop = 5")))


CAPS = {"leg.motor.laws": [], "leg.gear.torque_cap": 107.0, "leg.gear.speed_cap": 680.0}


@pytest.mark.parametrize("torque", ["leg.gear.torque_cap", "leg.motor.torque_cap"])
def test_a_drive_of_caps_alone(torque, write):
    """The region is the rectangle of the caps: R speed <= speed cap, torque <= cap at the joint."""
    cap, side = {"leg.gear.torque_cap": (107.0, 1), "leg.motor.torque_cap": (1.5, 100)}[torque]
    design = load("paper", {**CAPS, "leg.gear.torque_cap": None, torque: cap})
    region = operating_region(design.leg, "knee", physical_parameters(design.leg))
    corners = {tuple(np.round(corner, 6).tolist()) for corner in region.corners()}
    assert corners == {(s * 6.8, t * cap * side) for s in (-1, 1) for t in (-1, 1)}
    assert load(write(resolved_toml(design))) == design


@pytest.mark.parametrize(
    ("without", "words"),
    [
        ({"leg.gear.torque_cap": None}, "the torque (motor.torque_cap or gear.torque_cap) of hip, knee: give"),
        ({"leg.gear.speed_cap": None}, "the speed (gear.speed_cap) of hip, knee: give"),
        (
            {"leg.gear.speed_cap": None, "leg.hip.gear.speed_cap": 500.0},
            "the speed (gear.speed_cap) of knee: give",
        ),
    ],
)
def test_a_drive_of_caps_that_leave_something_open(without, words):
    assert only_fault("paper", CAPS | without).startswith(
        f"override leg.motor.laws = [] leaves nothing to bound {words}"
    )


def test_one_joint_without_a_law():
    one = {"leg.knee.motor.laws": []}
    assert only_fault("paper", one).startswith("override leg.knee.motor.laws = [] leaves nothing to bound the torque")
    capped = load("paper", {**one, "leg.knee.gear.torque_cap": 107.0, "leg.knee.gear.speed_cap": 680.0})
    names = [h.name for h in operating_region(capped.leg, "knee", physical_parameters(capped.leg)).planes]
    assert names == [f"gear {what} cap, {way}" for what in ("torque", "speed") for way in ("forward", "backward")]


def test_knee_below_ground(write):
    pose = ("hip_height = 0.28", "joint_angles = [0.2, 2.6]")
    text = template("mine").replace(*pose).replace("upper = -0.15", "upper = 3").replace("lower = -2.4", "lower = -3")
    sentence = only_fault(write(text))
    assert "start.joint_angles = [0.2, 2.6] puts hip" in sentence or "puts knee" in sentence
    assert "below the ground: choose another pose, or leave" in sentence


def test_hip_height_of_a_leg_of_one_joint(write):
    one = template("one").replace('["hip", "knee"]', '["hip"]').replace('["thigh", "shank"]', '["thigh"]')
    head, tail = one.split("[leg.knee]")[0], one.split("[leg.thigh]")[1]
    one = head + "[leg.thigh]" + tail.split("[leg.shank]")[0] + "[leg.motor]" + tail.split("[leg.motor]", 1)[1]
    assert "start.hip_height = 0.28 m does not give the pose of a leg with other than two joints" in only_fault(
        write(one)
    )
    assert load(write(one), ["start.joint_angles=[0.1]"]).start.joint_angles == (0.1,)


# ---- files and overrides that cannot be used --------------------------------------------------------------------


def test_invalid_toml_names_line_and_text(write):
    sentence = only_fault(write('name = "x"\nlength 0.38\n'))
    assert "mine.toml line 2 is not valid TOML" in sentence
    assert 'It reads "length 0.38"' in sentence
    assert sentence.count("line 2") == 1
    assert "write key = value" in sentence


@pytest.mark.parametrize(
    ("raw", "words"),
    [
        (bytes(range(256)), "is not text (line 2 is not UTF-8)"),
        (b"a = " + b"[" * 100_000, "nested too deeply"),
        (b"a" + b".a" * 5000 + b" = 1", "nested more than 12 deep"),
        (b"a = " + b"9" * 5000, "a number is too long"),
        (b"#" * 1_000_001, "more than 1000000 bytes"),
        (b'<?xml version="1.0"?>\n<robot name="leg"/>', "is XML (a URDF?), not a problem file in TOML: `hopopt new"),
    ],
)
def test_garbage(tmp_path, raw, words):
    path = tmp_path / "garbage.toml"
    path.write_bytes(raw)
    assert words in only_fault(path)


def test_numbers_too_long_to_print(write):
    huge = "0x" + "f" * 9000
    text = (
        f"leg.gear.ratio = {huge}\nsolver.seed = {huge}\nleg.joints = ['hip']\nleg.hip = {{lower = {huge}, upper = 1}}"
    )
    found = faults(write(text))
    for path in ("leg.gear.ratio", "solver.seed", "leg.hip.lower"):
        assert len([sentence for sentence in found if f"mine.toml: {path} = (a very long number)" in sentence]) == 1


def test_missing_file_folder_and_unknown_name(tmp_path, write, monkeypatch):
    write("", "walker.toml")
    assert "there is no such file (did you mean walker.toml?)" in only_fault(tmp_path / "walkr.toml")
    assert "is a folder: give the path of a .toml file (walker.toml)" in only_fault(tmp_path)
    assert only_fault(tmp_path / "paper.toml").endswith("; the built-in problem is called paper, without .toml.")
    sentence = only_fault("papr")
    assert 'there is no built-in problem "papr" (did you mean paper?)' in sentence
    (tmp_path / "papr.toml").touch()
    monkeypatch.chdir(tmp_path)
    assert "(did you mean papr.toml, which lies here?)" in only_fault("papr")
    assert f"built in: {', '.join(builtin_names())}" in sentence
    for source in ("\0.toml", "x" * 5000, "x/" * 3000, "", "..", "nowhere/x.toml"):
        assert only_fault(source)


def test_unreadable_file(write):
    path = write(template("mine"))
    path.chmod(0)
    try:
        load(path)  # the superuser can read everything
    except ProblemFileError as error:
        assert "cannot be read: Permission denied" in str(error)


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("leg.gear.ratio", "override \"leg.gear.ratio\" has no '=': write path=value, such as leg.gear.ratio=80."),
        ("leg..ratio=3", 'override "leg..ratio" is not the path of an entry'),
        ("=3", 'override "" is not the path of an entry'),
        ("leg.gear.ratio=-3", "override leg.gear.ratio = -3 is too small: a number from 1 to 1000"),
        ("leg.gear.ratio=", 'override leg.gear.ratio = "" is not allowed'),
        ("leg.gear.ratio=80\nname='x'", "override leg.gear.ratio = "),
        ("leg.gaer.ratio=80", "override leg.gaer is not a known key (did you mean gear?)"),
        ("solver.scheme=radua", 'override solver.scheme = "radua" is not allowed'),
        ("extends=paper", "override extends is not a known key"),
        ("leg.gear=5", "override leg.gear = 5 is not allowed: a table is needed"),
        ("leg.gear.ratio={a=1}", "override leg.gear.ratio = a table is not allowed"),
        ("leg.hip.lower=9", "override leg.hip.lower = 9 rad is too large"),
        ("\x1b[31m.x=9", 'override "\\u001b[31m" is not a known key'),
    ],
)
def test_override_faults(override, words):
    assert any(fault.startswith(words) for fault in faults("paper", [override])), faults("paper", [override])


def test_override_that_is_no_table_does_not_hide_the_files_faults(edited):
    found = faults(edited(("mass = 5.6", "mass = -1")), ["nonsense", "leg.gear.ratio=0"])
    assert len(found) == 3


# ---- extends ----------------------------------------------------------------------------------------------------


def test_extends_a_file_of_the_same_folder(write):
    write('extends = "paper"\nname = "base"\n[leg.gear]\nratio = 50\n', "base.toml")
    for base in ("base", "base.toml"):
        design = load(write(f'extends = "{base}"\nname = "mine"\n[leg.motor]\nmax_torque = 3\n'))
        assert (design.leg.gear.ratio, design.leg.motor.max_torque, design.leg.motor.max_speed) == (50, 3, 1256.637)


def test_a_fault_names_the_file_that_has_it(write):
    write('extends = "paper"\nname = "base"\n[leg.gear]\nratio = 0\n', "base.toml")
    found = faults(write('extends = "base"\nname = "mine"\n[leg.motor]\nmax_torque = 0\n'))
    assert found[0].startswith("mine.toml: leg.motor.max_torque = 0 N m is too small")
    assert found[1].startswith("base.toml: leg.gear.ratio = 0 is too small")
    Path("other").mkdir()
    for name in ("mine.toml", "base.toml"):
        Path(name).rename(f"other/{name}")
    assert [f.partition(":")[0] for f in faults("other/mine.toml")] == ["other/mine.toml", "other/base.toml"]


@pytest.mark.parametrize(
    "base",
    ["/etc/passwd", "../secret", "..", "a/b", "a\\\\b", "C:x", "~x", "", ".hidden", "a..b", "x\\u0000", "x" * 300],
)
def test_extends_cannot_leave_the_folder(write, tmp_path, base):
    (tmp_path.parent / "secret.toml").write_text(template("secret"), encoding="utf-8")
    sentence = only_fault(write(f'extends = "{base}"\nname = "mine"\n'))
    assert "mine.toml: extends = " in sentence
    assert "is not allowed: write a built-in name (" in sentence


def test_extends_that_is_no_text(write):
    assert "extends = 3 is not allowed" in only_fault(write("extends = 3"))


def test_extends_nothing(write):
    assert 'extends = "nobody": there is no such problem' in only_fault(write('extends = "nobody"'))


def test_extends_in_a_circle(write):
    write('extends = "mine"\n', "other.toml")
    assert "goes in a circle (mine.toml -> other.toml -> mine.toml)" in only_fault(write('extends = "other"\n'))
    assert "goes in a circle" in only_fault(write('extends = "mine"\n'))


# ---- whatever a file contains -----------------------------------------------------------------------------------

KEYS = st.sampled_from(
    [
        "name",
        "title",
        "leg",
        "contact",
        "start",
        "hop",
        "solver",
        "joints",
        "links",
        "joint",
        "link",
        "body",
        "motor",
        "gear",
        "hip",
        "knee",
        "thigh",
        "shank",
        "length",
        "mass",
        "lower",
        "upper",
        "com",
        "laws",
        "ratio",
        "hip_height",
        "foot_x",
        "joint_angles",
        "stance_duration",
        "above_ground",
        "scheme",
        "degree",
        "seed",
        "extends",
    ]
) | st.text(max_size=5)
SCALARS = (
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats()
    | st.text(max_size=5)
    | st.sampled_from(["hip", "knee", "thigh", "shank", "paper", "foot", "body"])
)
VALUES = st.recursive(
    SCALARS, lambda inner: st.lists(inner, max_size=4) | st.dictionaries(KEYS, inner, max_size=5), max_leaves=12
)
PATHS = st.sampled_from(sorted(as_json(load()))) | st.lists(KEYS, min_size=1, max_size=4).map(".".join)
quick = settings(max_examples=50, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


def loads_or_says_why(source, overrides=()):
    try:
        assert isinstance(load(source, overrides), Design)
    except ProblemFileError as error:
        assert error.problems
        assert all(sentence.isprintable() for sentence in error.problems), error.problems
        str(error).encode()


@quick
@given(raw=st.binary(max_size=300) | st.text(alphabet="abc.=[]{}\"'\n#\\ 019-_", max_size=80).map(str.encode))
def test_fuzz_bytes(tmp_path, raw):
    path = tmp_path / "fuzz.toml"
    path.write_bytes(raw)
    loads_or_says_why(path)


@quick
@example(overrides={"contact.friction": -2.225073858507e-311})  # whose inverse is no number
@given(overrides=st.dictionaries(PATHS, VALUES, max_size=4))
def test_fuzz_values(overrides):
    loads_or_says_why("paper", overrides)


@quick
@given(table=st.dictionaries(KEYS, VALUES, max_size=6))
def test_fuzz_tables(tmp_path_factory, table):
    path = tmp_path_factory.getbasetemp() / "empty.toml"
    path.write_bytes(b"")
    loads_or_says_why(path, {k: v for k, v in table.items() if k})


@quick
@given(texts=st.lists(st.tuples(PATHS, st.text(max_size=12)).map("=".join) | st.text(max_size=12), max_size=3))
def test_fuzz_override_texts(texts):
    loads_or_says_why("paper", texts)


@quick
@given(source=st.text(max_size=20))
def test_fuzz_sources(source):
    try:
        load(source)
    except HopoptError as error:
        assert str(error)


@quick
@given(title=st.text(max_size=30), ratio=st.floats(1, 1000), torque=st.none() | st.floats(1e-3, 1000))
def test_fuzz_round_trip(tmp_path, title, ratio, torque):
    try:
        design = load("paper", {"title": title, "leg.gear.ratio": ratio, "leg.hip.motor.torque_cap": torque})
    except ProblemFileError:
        return  # control characters
    text = resolved_toml(design)
    tomllib.loads(text)
    (tmp_path / "again.toml").write_text(text, encoding="utf-8", newline="")
    again = load(tmp_path / "again.toml")
    assert as_json(again) == as_json(design)
    assert design_hash(again) == design_hash(design)


@pytest.mark.parametrize("rules", [{"leg.guides": ["z"]}, {"leg.hip.axis": [1.0, 0.0, 0.0]}])
def test_a_leg_that_cannot_move_while_it_stands(rules):
    """One joint, its foot pinned, the body held by a guide or out of the plane."""
    one = {"leg.joints": ["hip"], "leg.links": ["thigh"], "leg.knee": None, "leg.shank": None}
    start = {"start.hip_height": None, "start.joint_angles": [0.3]}
    (sentence,) = faults("paper", one | start | rules)
    assert 'leg.joints = ["hip"] cannot move while the foot stands' in sentence
