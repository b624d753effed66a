"""The catalogue: what its names stand for, where they may stand, and that the numbers are those of the sources."""

import ast
import json
import re
from typing import Any, cast

import numpy as np
import pytest
from scipy.stats import linregress

from hopopt.cli.main import run
from hopopt.control.closed_loop import make_plant
from hopopt.design import Design, physical_parameters
from hopopt.drivetrain.motor import rated
from hopopt.drivetrain.operating_region.region import operating_region
from hopopt.errors import ProblemFileError
from hopopt.leg.robot import build_robot
from hopopt.problem import catalogue as actuators
from hopopt.problem import named_parts
from hopopt.problem.catalogue import catalogue, names
from hopopt.problem.catalogue_facts import CATALOGUE_PARTS, KINDS, fields, problem_entries
from hopopt.problem.checking.mass_law import fit, mass_law, weighed
from hopopt.problem.load import changed, design_hash, load, resolved_toml, template

RPM, GCM2 = 2 * np.pi / 60, 1e-7
GEARS = {  # ratio, repeated peak torque [N m], largest input speed [rpm], as the makers' tables have them
    "csg-17-100": (100, 70, 7300),
    "csg-20-100": (100, 107, 6500),
    "csg-25-100": (100, 204, 5600),
    "csd-20-100": (100, 57, 6500),
}
ROTORS = {"maxon-ec45-150": 119, "maxon-ec45-250": 209}  # [g cm^2]


def only_fault(source, overrides=()) -> str:
    with pytest.raises(ProblemFileError) as raised:
        load(source, overrides)
    assert len(raised.value.problems) == 1, raised.value.problems
    return raised.value.problems[0]


def region(design: Design, joint: str = "knee"):
    return operating_region(design.leg, joint, build_robot(design.leg).parameters)


# ---- the entries ------------------------------------------------------------------------------------------------


LAWS = [["paper"], ["four-quadrant"], ["paper", "four-quadrant"]]


@pytest.mark.parametrize("motor", names("motor"))
def test_every_pair_closes_the_region(motor):
    """With its motor's law; without one where a cap on torque and one on speed are printed."""
    entries = catalogue()
    for k, gear in enumerate(names("gear")):
        own, after = entries[motor].stated["motor"], entries[gear].stated["gear"]
        capped = "speed_cap" in after and ("torque_cap" in own or "torque_cap" in after)
        design = load("paper", {"leg.motor": motor, "leg.gear": gear, "leg.motor.laws": [] if capped else LAWS[k % 3]})
        planes = np.array(
            [(h.a, h.b) for h in operating_region(design.leg, "knee", physical_parameters(design.leg)).planes]
        )
        planes /= np.max(np.abs(planes), axis=0)
        angles = np.linspace(0, 2 * np.pi, 721)
        outward = planes @ np.array([np.sin(angles), np.cos(angles)])
        assert np.min(np.max(outward, axis=0)) > 1e-3  # whichever way torque and speed grow, something holds them


@pytest.mark.parametrize("motor", names("motor"))
def test_a_motor_alone_closes_the_region_under_a_law(motor):
    design = load("paper", {"leg.motor": motor, "leg.motor.laws": ["four-quadrant"]})
    corners = region(design).corners()
    lower, upper = region(design).torque_bounds(np.array([0.0]))
    assert -lower[0] == pytest.approx(upper[0])
    assert upper[0] == pytest.approx(100 * min(rated(design.leg, "knee")[0], design.leg.motor.torque_cap or np.inf))
    assert np.all(np.isfinite(corners))
    assert len(corners) >= 4


def test_a_joints_own_motor_of_the_catalogue_takes_nothing_of_the_legs():
    common = {"leg.motor.torque_cap": 2.0, "leg.gear.friction": 3.0, "leg.gear.speed_cap": 500.0}
    leg = load("paper", {**common, "leg.knee.motor": "maxon-ec90-flat-260", "leg.knee.gear": "csf-25-50"}).leg
    assert leg.drive("knee", "motor", "torque_cap")[1] is None  # nobody prints one
    assert leg.drive("knee", "gear", "friction")[1] is None
    assert leg.drive("knee", "motor", "laws") == ("leg.motor.laws", leg.motor.laws)
    assert leg.drive("hip", "motor", "torque_cap") == ("leg.motor.torque_cap", 2.0)
    upper = region(load("paper", {**common, "leg.knee.motor": "maxon-ec90-flat-260"})).torque_bounds(np.array([0.0]))[1]
    assert upper[0] == pytest.approx(100 * 13.137)


def test_an_own_table_of_a_joint_falls_back_on_the_legs():
    leg = load("paper", {"leg.motor.torque_cap": 2.0, "leg.knee.motor.max_torque": 3.0}).leg
    assert leg.drive("knee", "motor", "torque_cap") == ("leg.motor.torque_cap", 2.0)


# ---- where the numbers are from -----------------------------------------------------------------------------------

COUNTED = {  # what an entry of the catalogue has to state, from a source, to be counted
    "motor": (
        "max_torque",
        "max_speed",
        "rotor_inertia",
        "torque_constant",
        "winding_resistance",
        "no_load_current",
        "mass",
    ),
    "gear": ("ratio", "torque_cap", "speed_cap", "inertia", "efficiency", "mass"),
}


@pytest.mark.parametrize("part", CATALOGUE_PARTS)
def test_every_number_has_a_mark_and_every_printed_one_a_source(part):
    for name in names(part):
        entry = catalogue()[name]
        assert set(entry.marks[part]) == set(entry.stated[part]), name
        assert set(entry.marks[part].values()) <= {"S", "D", "U"}
        for key, mark in entry.marks[part].items():
            source = entry.cited[part].get(key)
            assert (source is not None) == (mark == "S"), (name, key)
            assert source is None or (len(source.title) > 10 and source.address.startswith("https://")), (name, key)
        if "D" in entry.marks[part].values():
            assert entry.sources or not entry.unverified(part), name  # what it is derived from is printed somewhere


@pytest.mark.parametrize(("part", "least"), [("motor", 20), ("gear", 15)])
def test_enough_entries_are_printed_whole(part, least):
    whole = [
        name
        for name in names(part)
        if all(catalogue()[name].marks[part].get(key) in ("S", "D") for key in COUNTED[part])
    ]
    assert len(whole) >= least


def test_what_is_marked_unverified_is_called_so():
    for path in (actuators.problems_folder() / "actuators").glob("*.toml"):
        for line in path.read_text(encoding="utf-8").splitlines():
            if "[U]" in line and not line.startswith("# "):
                assert re.search(r"unverified +\[U\]", line), (path.name, line)


def worked_out(formula: str, names: dict[str, Any]) -> float:
    """A formula of numbers, names, + - * / **, sqrt and pi; KeyError for any other name."""

    def value(node: ast.AST) -> float:
        if isinstance(node, ast.Constant):
            return float(cast(Any, node.value))
        if isinstance(node, ast.Name):
            return {**names, "pi": np.pi}[node.id]
        if isinstance(node, ast.UnaryOp):
            return -value(node.operand)
        if isinstance(node, ast.Call):
            assert cast(Any, node.func).id == "sqrt"
            return value(node.args[0]) ** 0.5
        assert isinstance(node, ast.BinOp)
        signs = {
            ast.Add: "__add__",
            ast.Sub: "__sub__",
            ast.Mult: "__mul__",
            ast.Div: "__truediv__",
            ast.Pow: "__pow__",
        }
        return getattr(value(node.left), signs[type(node.op)])(value(node.right))

    return value(ast.parse(formula, mode="eval").body)


DERIVED = re.compile(r"^([a-z_]+) = \S+ +# \S+(?: \S+)*? +(?:= (.*?)(?:  .*)?)? *\[D\]$", re.MULTILINE)


@pytest.mark.parametrize("name", catalogue())
def test_what_is_derived_follows_from_its_formula(name):
    text = (actuators.problems_folder() / "actuators" / f"{name}.toml").read_text(encoding="utf-8")
    found, entry = 0, catalogue()[name]
    for piece in re.split(r"^(?=\[(?:motor|gear)\])", text, flags=re.MULTILINE)[1:]:
        stated = entry.stated[piece[1 : piece.index("]")]]
        for key, formula in DERIVED.findall(piece):
            found += 1
            assert worked_out(formula, stated) == pytest.approx(stated[key], rel=3.5e-3), (name, key, formula)
    assert found == sum(mark == "D" for marks in entry.marks.values() for mark in marks.values())


@pytest.mark.parametrize("name", [n for n in names("motor") if "stall_torque" in catalogue()[n].stated["motor"]])
def test_what_makers_print_obeys_physics(name):
    """Against what the sheet prints itself: stall torque, k V / R; no load, (V - R i) / k; time constant, J R / k^2."""
    m = cast(dict[str, float], catalogue()[name].stated["motor"])
    k, V, R = m["torque_constant"], m["voltage"], m["winding_resistance"]
    assert m["stall_torque"] == pytest.approx(k * V / R, rel=0.02)
    assert m["no_load_speed"] == pytest.approx((V - R * m["no_load_current"]) / k, rel=0.02)
    assert m["mechanical_time_constant"] == pytest.approx(m["rotor_inertia"] * R / k**2, rel=0.02)
    copper = R * (1 + 0.0039 * (m["winding_limit"] - 25)) * (m["continuous_torque"] / k) ** 2
    iron = V * m["no_load_current"]  # and friction: at full speed
    rise = copper * (m["winding_to_housing"] + m["housing_to_ambient"]) + iron * m["housing_to_ambient"]
    assert 0.9 < rise / (m["winding_limit"] - 25) < 1.4  # continuous torque is what heats the winding to its limit


def test_gears_give_more_for_a_moment_than_all_day():
    for name in names("gear"):
        gear = cast(dict[str, float], catalogue()[name].stated["gear"])
        order = [gear[key] for key in ("rated_torque", "torque_cap", "momentary_torque") if key in gear]
        assert order == sorted(order), name
        assert gear.get("average_torque", 0.0) <= gear["torque_cap"]


@pytest.mark.parametrize("part", CATALOGUE_PARTS)
def test_facts_have_units_and_no_name_brings_one_into_a_problem(part):
    assert all(field["unit"] and field["description"] for field in fields(part).values())
    assert set(problem_entries(part)) <= set(KINDS[part].model_fields)
    for name in names(part):
        assert not set(catalogue()[name].facts[part]) & set(catalogue()[name].parts[part])
        assert set(catalogue()[name].parts[part]) <= set(KINDS[part].model_fields)


def test_makers_tables():
    for name, (ratio, torque, rpm) in GEARS.items():
        gear = load("paper", {"leg.gear": name}).leg.gear
        assert (gear.ratio, gear.torque_cap) == (ratio, torque)
        assert gear.speed_cap == pytest.approx(rpm * RPM, rel=1e-6)
    for name, inertia in ROTORS.items():
        assert load("paper", {"leg.motor": name}).leg.motor.rotor_inertia == pytest.approx(inertia * GCM2)


def test_mini_cheetah_is_its_makers_actuator_model():
    """ActuatorModel.h: v = clip(i R + 2 k_t w_m, 24), tau = 6 clip(1.5 k_t (v - 2 k_t w_m) / R, 3)."""
    both = {"leg.motor": "mini-cheetah", "leg.gear": "mini-cheetah"}
    k_t, R, w = 0.05, 0.173, np.linspace(0, 39.9, 200)
    largest = 6 * np.clip(1.5 * k_t * (24 - 2 * k_t * 6 * w) / R, -3, 3)
    assert region(load("paper", both)).torque_bounds(w)[1] == pytest.approx(largest, rel=1e-3, abs=1e-3)


def test_go2_is_its_makers_torque_speed_curve():
    both = {"leg.motor": "unitree-go2", "leg.gear": "unitree-go2"}
    w = np.linspace(0, 29.9, 200)
    largest = np.where(w < 13.5, 20.2, 20.2 * (30 - w) / (30 - 13.5))
    assert region(load("paper", both)).torque_bounds(w)[1] == pytest.approx(largest, rel=1e-3, abs=1e-3)


def test_solo_gives_its_makers_torque_at_12_amperes_after_losses():
    leg = load("paper", {"leg.motor": "odri-solo", "leg.gear": "odri-solo"}).leg
    assert leg.motor.torque_cap is not None
    assert leg.gear.efficiency is not None
    assert leg.motor.torque_cap * leg.gear.ratio * leg.gear.efficiency == pytest.approx(2.5, rel=0.01)
    assert leg.motor.max_speed == pytest.approx(24 * 300 * RPM, rel=0.01)  # 300 turns a minute for a volt


WOUND = [
    name
    for name in names("motor")
    if {"winding_resistance", "torque_constant"} <= catalogue()[name].stated["motor"].keys()
]


@pytest.mark.parametrize("name", sorted(set(WOUND) - {"mini-cheetah"}))
def test_heat_fits_the_torque_speed_line(name):
    """tau = k (V - k w) / R is 0 at V / k and k V / R at standstill, so their ratio is R / k^2 at any voltage."""
    motor = catalogue()[name].parts["motor"]
    heat = motor["winding_resistance"] / motor["torque_constant"] ** 2  # [W/(N m)^2]
    assert heat == pytest.approx(motor["max_speed"] / motor["max_torque"], rel=2e-3)


# ---- names in problems --------------------------------------------------------------------------------------------

BY_HAND = """
extends = "paper"
[leg.motor]
max_torque = 10.0
max_speed = 1256.637
rotor_inertia = 2.09e-5
torque_cap = 2.0
torque_constant = 0.0382
winding_resistance = 0.1833
[leg.gear]
ratio = 100
torque_cap = 107.0
speed_cap = 680.678
inertia = 1.93e-5
efficiency = 0.7
"""
FORMS = {
    "texts": 'extends = "paper"\n[leg]\nmotor = "maxon-ec45-250"\ngear = "csg-20-100"\n',
    "tables": 'extends = "paper"\n[leg.motor]\nmodel = "maxon-ec45-250"\n[leg.gear]\nmodel = "csg-20-100"\n',
}


def without_labels(design: Design) -> dict:
    tables = design.model_dump(exclude_none=True)
    for table in (tables["leg"], *(tables["leg"][joint] for joint in tables["leg"]["joints"])):
        for part in CATALOGUE_PARTS:
            table.get(part, {}).pop("catalogue", None)
    return tables


@pytest.mark.parametrize("form", FORMS.values(), ids=FORMS)
def test_a_name_is_the_same_as_its_numbers_by_hand(tmp_path, form):
    (tmp_path / "hand.toml").write_text(BY_HAND)
    (tmp_path / "named.toml").write_text(form)
    hand, by_name = load(tmp_path / "hand.toml"), load(tmp_path / "named.toml")
    assert without_labels(by_name) == without_labels(hand)
    assert (by_name.leg.motor.catalogue, by_name.leg.gear.catalogue) == ("maxon-ec45-250", "csg-20-100")
    names = ["leg.motor=maxon-ec45-250", "leg.gear=csg-20-100"]
    assert load("paper", names) == by_name
    assert changed(load("paper"), {"leg.motor": "maxon-ec45-250", "leg.gear": "csg-20-100"}) == by_name


def test_numbers_count_over_names_in_any_order():
    texts = ["leg.gear.ratio=80", "leg.gear=csg-20-100"]
    assert load("paper", texts) == load("paper", texts[::-1])
    gear = load("paper", texts).leg.gear
    assert (gear.ratio, gear.torque_cap) == (80, 107)
    inline = load("paper", ['leg.gear={model = "csg-20-100", ratio = 80}'])
    assert inline == load("paper", texts) == load("paper", {"leg.gear.model": "csg-20-100", "leg.gear": {"ratio": 80}})


def test_a_name_takes_the_place_of_what_was_there_but_not_of_the_law():
    leg = load("paper_four_quadrant", {"leg.motor": "maxon-ec45-150", "leg.gear": "csg-17-100"}).leg
    assert leg.motor.laws == ("four-quadrant",)
    second = changed(load("paper", {"leg.gear": "csg-17-100"}), {"leg.gear": "csg-25-100"}).leg.gear
    assert second == load("paper", {"leg.gear": "csg-25-100"}).leg.gear
    own = {"leg.knee.motor.rotor_inertia": 1e-4, "leg.knee.motor.max_torque": 3.0}
    over = load("paper", {**own, "leg.knee.motor": "mini-cheetah"}).leg
    assert over.drive("knee", "motor", "rotor_inertia")[1] == 1e-4
    renamed = changed(load("paper", own), {"leg.knee.motor": "mini-cheetah"}).leg
    assert [renamed.drive("knee", "motor", key)[1] for key in ("rotor_inertia", "max_torque")] == [6.3e-5, 10.405]


def test_joints_of_their_own(tmp_path):
    (tmp_path / "go2.toml").write_text(
        'extends = "paper"\n[leg]\nmotor = "unitree-go2"\ngear = "unitree-go2"\n[leg.knee]\ngear = "unitree-go2-knee"\n'
    )
    design = load(tmp_path / "go2.toml", ["leg.hip.motor=maxon-ec45-250", "leg.knee.gear.torque_cap=40"])
    leg = design.leg
    assert leg.drive("hip", "gear", "ratio") == ("leg.gear.ratio", 6.33)
    assert leg.drive("knee", "gear", "ratio") == ("leg.knee.gear.ratio", 12.15)
    assert leg.drive("knee", "gear", "torque_cap") == ("leg.knee.gear.torque_cap", 40)
    assert leg.drive("hip", "motor", "max_torque") == ("leg.hip.motor.max_torque", 10)
    assert leg.drive("knee", "motor", "max_torque") == ("leg.motor.max_torque", 5.802)
    hip, knee = build_robot(leg).model.armature[-2:]
    assert hip == pytest.approx(6.33**2 * 2.09e-5)
    assert knee == pytest.approx(12.15**2 * 1.118e-4)


def test_what_turns_with_the_rotor_counts_with_it():
    armature = build_robot(load("paper", {"leg.knee.gear": "csg-20-100"}).leg).model.armature
    assert armature[-2:] == pytest.approx([1e4 * 1.19e-5, 1e4 * (1.19e-5 + 1.93e-5)])


def test_the_resolved_problem_needs_no_catalogue(tmp_path, monkeypatch):
    design = load("paper", {"leg.motor": "maxon-ec45-150", "leg.knee.gear": "csg-20-100"})
    (tmp_path / "problem.toml").write_text(resolved_toml(design))
    monkeypatch.setattr(named_parts, "catalogue", dict)
    assert load(tmp_path / "problem.toml") == design
    assert design_hash(load(tmp_path / "problem.toml")) == design_hash(design)


# ---- what is refused ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "name",
    [
        "../paper",
        "..",
        "",
        "/etc/passwd",
        "csg-20-100.toml",
        "actuators/csg-20-100",
        "CSG-20-100",
        "paper",
        "*",
        "\x00",
    ],
)
def test_only_names_of_the_catalogue_are_read(name):
    for overrides in ({"leg.gear": name}, {"leg.gear.model": name}, {"leg.knee.gear": name}):
        assert "is not in the catalogue" in only_fault("paper", overrides)


def test_an_unknown_name_is_told_what_there_is(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.toml").write_text('extends = "paper"\n[leg.knee]\nmotor = "maxon-ec45-15"\n')
    assert only_fault("mine.toml") == (
        'mine.toml: leg.knee.motor = "maxon-ec45-15" is not in the catalogue (did you mean maxon-ec45-150?): '
        f"hopopt actuators lists its {len(names('motor'))} motors; for another write [leg.motor] with max_torque, max_speed and "
        "rotor_inertia in front of its gear (docs/actuators.md)."
    )
    assert only_fault("paper", ["leg.gear=maxon-ec45-150"]).startswith(
        'override leg.gear = "maxon-ec45-150" has no gear in the catalogue: hopopt actuators lists its '
    )
    assert only_fault("paper", ["leg.gear.model=3"]).startswith("override leg.gear.model = 3 is not in the catalogue")
    with pytest.raises(ProblemFileError, match=r"leg\.motor = "):
        changed(load(), {"leg.motor": "nothing"})


def test_a_name_and_a_table_for_one_motor_are_a_fault_of_the_file(tmp_path):
    text = template("mine").replace("[leg]\n", '[leg]\nmotor = "maxon-ec45-150"\n')
    (tmp_path / "mine.toml").write_text(text)
    assert "is not valid TOML" in only_fault(tmp_path / "mine.toml")


# ---- efficiency -----------------------------------------------------------------------------------------------------


def test_efficiency_reaches_the_simulated_gear_of_its_joint():
    design = load("paper", {"leg.knee.gear": "csd-20-100", "simulation.gear_efficiency": 0.9})
    w, command = np.array([1.0, 1.0]), np.array([20.0, 10.0])
    motor, joint = make_plant(design).drive.torque(w, command)
    assert motor == pytest.approx(command)
    assert joint == pytest.approx(np.array([0.9, 0.57]) * command, rel=1e-3)


def test_an_efficiency_that_holds_for_no_gear_is_refused():
    sentence = only_fault("paper", ["leg.gear=csg-20-100", "simulation.gear_efficiency=0.8"])
    assert sentence == (
        "override simulation.gear_efficiency = 0.8 holds for no gear, as each has its own: "
        "change leg.gear.efficiency, or set simulation.gear_efficiency to 1."
    )


# ---- the command --------------------------------------------------------------------------------------------------


def test_the_list_names_everything(capsys):
    assert run(["actuators"]) == 0
    shown = capsys.readouterr().out
    assert all(name in shown for name in catalogue())
    assert run(["actuators", "--json"]) == 0
    listed = json.loads(capsys.readouterr().out)
    assert (set(listed["motors"]), set(listed["gears"])) == (set(names("motor")), set(names("gear")))
    assert listed["gears"]["csg-20-100"]["torque_cap"] == {"value": 107.0, "unit": "N m", "source": "public source"}
    assert listed["motors"]["maxon-ec45-150"]["max_torque"]["source"] == "unverified"


# ---- masses ---------------------------------------------------------------------------------------------------------


def test_a_mass_of_the_catalogue_changes_no_problem():
    """Whatever motor or gear is named, the leg weighs what it weighed."""
    for part in CATALOGUE_PARTS:
        for name in names(part):
            leg = load("paper", {f"leg.{part}": name}).leg
            assert leg.body.mass == load("paper").leg.body.mass
            assert build_robot(leg).model.inertias[2].mass == build_robot(load("paper").leg).model.inertias[2].mass
    assert "is not a known key" in only_fault("paper", {"leg.motor.mass": 0.85})


@pytest.mark.parametrize("given", ["0.0", "-1", "850", '"0.85"', "true", "nan", "[0.85]"])
def test_a_mass_that_none_can_have_is_refused(tmp_path, monkeypatch, given):
    """850 is grams."""
    (tmp_path / "actuators").mkdir()
    source = (actuators.problems_folder() / "actuators" / "maxon-ec45-150.toml").read_text(encoding="utf-8")
    (tmp_path / "actuators" / "mine.toml").write_text(source.replace("mass = 0.85 ", f"mass = {given} "))
    monkeypatch.setattr(actuators, "problems_folder", lambda: tmp_path)
    with pytest.raises(
        ProblemFileError, match=r"mine\.toml: motor\.mass = .* a number from 0\.001 to 100 kg is needed"
    ):
        catalogue.__wrapped__()


def test_published_masses():
    masses = {name: entry.masses for name, entry in catalogue().items()}
    assert masses["odri-solo"]["motor"] == 0.053
    assert masses["odri-solo"]["motor"] + masses["odri-solo"]["gear"] == pytest.approx(
        0.095 - 0.005
    )  # less the encoder
    assert masses["csg-20-100"]["gear"] == 0.98
    assert masses["unitree-go2"] == {}  # nobody says how the module's mass divides
    assert catalogue()["unitree-go2"].module_mass == 0.53


# ---- what torque weighs ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("c", "n"), [(0.2, 0.9), (1.5, 2 / 3), (3e-3, 1.0), (0.7, -0.5)])
def test_the_fit_recovers_a_power_law(c, n):
    torques = np.geomspace(0.1, 300, 7)
    law = fit(torques, c * torques**n)
    assert (law.coefficient, law.exponent) == pytest.approx((c, n), rel=1e-12)
    assert law.scatter == pytest.approx(1, abs=1e-12)
    assert (law.entries, law.lowest, law.highest) == (7, pytest.approx(0.1), pytest.approx(300))
    assert law.mass(2.0) == pytest.approx(c * 2**n)


def test_the_fit_is_the_line_of_least_squares_with_its_errors():
    """Against scipy's regression, on scattered masses; the scatter has the closed form of two pairs a factor apart."""
    rng = np.random.default_rng(3)
    torques, masses = np.exp(rng.normal(size=9)), np.exp(rng.normal(size=9))
    law, line = fit(torques, masses), cast(Any, linregress(np.log(torques), np.log(masses)))
    assert law.exponent == pytest.approx(line.slope)
    assert np.log(law.coefficient) == pytest.approx(line.intercept)
    assert law.exponent_error == pytest.approx(line.stderr)
    pairs = fit([1, 1, 8, 8], [1 / 3, 3, 4 / 3, 12])  # 1 and 4 in the middle, each off by a factor of 3
    assert (pairs.coefficient, pairs.exponent) == pytest.approx((1, 2 / 3))
    assert pairs.scatter is not None
    assert np.log(pairs.scatter) == pytest.approx(np.log(3) * np.sqrt(4 / 2))


def test_two_entries_have_no_scatter_and_one_torque_no_law():
    law = fit([1, 2], [3, 12])
    assert (law.coefficient, law.exponent) == pytest.approx((3, 2))
    assert (law.scatter, law.exponent_error) == (None, None)
    with pytest.raises(ValueError, match="two different torques"):
        fit([2, 2, 2], [1, 2, 3])


@pytest.mark.parametrize("part", CATALOGUE_PARTS)
def test_the_law_of_the_catalogue_is_of_what_its_entries_give(part):
    needed = {"motor": {"max_torque", "torque_cap"}, "gear": {"torque_cap"}}[part]  # for a short time
    entries = {
        name: catalogue()[name]
        for name in names(part)
        if part in catalogue()[name].masses and needed <= catalogue()[name].parts[part].keys()
    }
    pairs = weighed(part)
    if part == "motor":
        assert set(pairs) == set(entries)
    else:  # the lightest for their torque: a walk from the strongest down, each kept if it is lighter than all before
        order = sorted(entries, key=lambda n: (-entries[n].parts[part]["torque_cap"], entries[n].masses[part]))
        masses = [entries[n].masses[part] for n in order]
        first = [n for k, n in enumerate(order) if masses[k] < min([np.inf, *masses[:k]])]
        assert set(pairs.values()) == {(entries[n].parts[part]["torque_cap"], entries[n].masses[part]) for n in first}
    for name, (torque, mass) in pairs.items():
        values = entries[name].parts[part]
        assert torque == min(values["torque_cap"], values.get("max_torque", np.inf))
        assert mass == entries[name].masses[part]
    torques, masses = np.array(list(pairs.values())).T
    assert mass_law(part) == fit(torques, masses)
    assert 0.5 < mass_law(part).exponent < 1.5  # torque grows with volume, a ring's with somewhat more


def test_the_fit_on_the_command_line(capsys):
    assert run(["actuators", "--fit"]) == 0
    shown = capsys.readouterr().out
    law = mass_law("motor")
    assert f"mass = {law.coefficient:.3g} kg (torque / N m)^{law.exponent:.3g}: {law.entries} motors" in shown
    assert f"off by a factor of {law.scatter:.2g}" in shown
    assert "unitree-go2" not in shown  # has no mass
    assert run(["actuators", "--fit", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    for part in CATALOGUE_PARTS:
        law, said = mass_law(part), told[f"{part}s"]
        assert (said["coefficient"], said["exponent"], said["scatter"]) == (law.coefficient, law.exponent, law.scatter)
        assert said["entries"] == len(said["fitted_to"]) == len(weighed(part))
        for name, row in said["fitted_to"].items():
            assert (row["torque"], row["mass"]) == weighed(part)[name]
            assert row["fitted"] == pytest.approx(law.coefficient * row["torque"] ** law.exponent)
    assert told["motors"]["fitted_to"]["odri-solo"]["source"] == "public source"
    assert told["motors"]["fitted_to"]["maxon-ec45-150"]["source"] == "unverified"


def test_masses_are_listed(capsys):
    assert run(["actuators", "--json"]) == 0
    listed = json.loads(capsys.readouterr().out)
    assert listed["motors"]["odri-solo"]["mass"] == {"value": 0.053, "unit": "kg", "source": "public source"}
    assert "mass" not in listed["motors"]["unitree-go2"]
    assert run(["actuators"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert "0.053 " in next(line for line in lines if line.startswith("odri-solo"))
    assert " - " in next(line for line in lines if line.startswith("unitree-go2"))
    assert run(["actuators", "--fits"]) == 2


def test_show_tells_the_name(capsys):
    assert run(["show", "--set", "leg.knee.gear=csg-20-100", "--json"]) == 0
    entries = json.loads(capsys.readouterr().out)
    assert entries["leg.knee.gear.catalogue"]["value"] == "csg-20-100"
    assert entries["leg.knee.gear.torque_cap"]["value"] == 107.0
