"""The shapes of a leg: distances against minimisation over points and against Pinocchio's own reading of a URDF."""

import re
from dataclasses import replace
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from scipy.optimize import minimize

from hopopt import load
from hopopt.control.closed_loop import make_plant
from hopopt.design import Design, Leg
from hopopt.errors import UsageError
from hopopt.leg.geometry.above import above_ground, height_rows, points_of
from hopopt.leg.geometry.distance import Distances
from hopopt.leg.geometry.smooth import clearances, margin_of
from hopopt.leg.geometry.solids import BODY, NEAR, Solid, counted_points, outline, placed, solids
from hopopt.leg.kinematics import joint_positions, start_angles, tucked
from hopopt.leg.robot import build_robot
from hopopt.ocp.guesses.posture import Posture
from hopopt.ocp.hop import Hop
from hopopt.ocp.hops.collision import slack_of
from hopopt.planner.solve import solve
from hopopt.problem.load import changed
from hopopt.problem.render import resolved_toml
from hopopt.report.motion import planned
from hopopt.sim.controller import Measurement
from hopopt.sim.machine import Machine
from hopopt.sim.plant import Plant

SHAPES = """
[leg.body.shapes.trunk]
box = [0.5, 0.2, 0.1]
at = [0.05, 0.02, 0.1]
[leg.body.shapes.tail]
points = [[-0.3, 0.0, -0.1], [-0.4, 0.1, 0.0], [-0.3, 0.05, 0.1], [-0.45, 0.0, 0.05], [-0.2, 0.03, 0.0]]
radius = 0.01
[leg.thigh]
radius = 0.04
[leg.shank.shapes.calf]
points = [[0.0, 0.0, 0.0], [0.0, 0.02, -0.361]]
radius = 0.03
"""
A1 = "a1_description/urdf/a1.urdf"
JOINTS, FOOT = ("FL_thigh_joint", "FL_calf_joint"), "FL_foot"
A1_PROBLEM = f"""
name = "a1"
[leg]
urdf = "example-robot-data/{A1}"
joints = {list(JOINTS)}
foot_frame = "{FOOT}"
geometry = true
motor.rotor_inertia = 0.0
[start]
joint_angles = [0.8, -1.6]
"""


def paper_leg(tmp_path: Path, text: str = SHAPES) -> Design:
    """The paper's leg with shapes."""
    (tmp_path / "shaped.toml").write_text(f'extends = "paper"\nname = "shaped"\n{text}')
    return load(tmp_path / "shaped.toml")


def test_a_margin_that_cannot_be_kept_is_refused(tmp_path: Path) -> None:
    with pytest.raises(
        UsageError, match=r"hop\.collision_margin = 0\.1 m is more than 0\.03 of the leg's length: at most 0\.0222"
    ):
        paper_leg(tmp_path, SHAPES + "[hop]\ncollision_margin = 0.1\n")


def test_a_link_without_a_shape_is_a_line_that_counts(tmp_path: Path) -> None:
    """A ball on the shank of the start pose, and one a hand's breadth beside it: the distance from the line, less the radius."""
    start = start_angles(load("paper"))
    knee, foot = joint_positions(load("paper").leg, start)[-2:]
    middle, across = (knee + foot) / 2, np.array([foot[2] - knee[2], 0.0, knee[0] - foot[0]])
    across /= np.linalg.norm(across)
    for away in (0.0, 0.1):
        at = (middle + away * across).tolist()
        leg = paper_leg(tmp_path, f"[leg.body.shapes.ball]\npoints = [[0.0, 0.0, 0.0]]\nradius = 0.02\nat = {at}\n").leg
        found = Distances(leg, start)
        distances = dict(zip(map(found.names, found.pairs), found.all(start[None])[0], strict=True))
        assert distances["shank", "ball"] == pytest.approx(away - 0.02, abs=1e-3 * leg.length + 1e-9)
    text = f"[leg.body.shapes.ball]\npoints = [[0.0, 0.0, 0.0]]\nradius = 0.02\nat = {middle.tolist()}\n"
    with pytest.raises(UsageError, match=r"shank is 0\.02\d* m inside ball where the hop starts: start otherwise"):
        Hop(paper_leg(tmp_path, text)).problem  # noqa: B018


def test_pairs_name_what_is_nearer_to_the_foot_second(tmp_path: Path) -> None:
    """A foot with a shape, and lines for thigh and shank."""
    text = "[leg.foot.shapes.sole]\npoints = [[0.0, 0.0, 0.0]]\nradius = 0.01\n"
    (tmp_path / "sole.toml").write_text(f'extends = "three_joint"\nname = "sole"\n{text}')
    design = load(tmp_path / "sole.toml")
    found = Distances(design.leg, start_angles(design))
    assert [found.names(pair) for pair in found.pairs] == [("sole", "thigh")]


def between(leg: Leg, one: Solid, two: Solid, q: np.ndarray) -> float:
    """The distance of two solids that do not overlap: over all mixtures of their points, by SciPy."""
    a, b = placed(leg, one, q), placed(leg, two, q)
    weights = np.repeat([1 / len(a), 1 / len(b)], [len(a), len(b)])

    def squared(w: np.ndarray) -> tuple[float, np.ndarray]:
        apart = w[: len(a)] @ a - w[len(a) :] @ b
        return float(apart @ apart), 2 * np.concatenate([a @ apart, -b @ apart])

    sums = [
        {"type": "eq", "fun": lambda w: w[: len(a)].sum() - 1},
        {"type": "eq", "fun": lambda w: w[len(a) :].sum() - 1},
    ]
    found = minimize(squared, weights, jac=True, method="SLSQP", bounds=[(0, 1)] * len(weights), constraints=sums,
                     options={"ftol": 1e-16, "maxiter": 500})  # fmt: skip
    return float(np.sqrt(found.fun)) - one.radius - two.radius


def test_distances_are_those_of_the_nearest_mixtures_of_points(tmp_path: Path) -> None:
    leg = paper_leg(tmp_path).leg
    found = Distances(leg, np.array([0.9, -1.9]))
    rng, compared = np.random.default_rng(1), 0
    for q in rng.uniform([-0.6, -2.4], [1.3, -0.15], (8, 2)):
        for pair, distance in zip(found.pairs, found.all(q[None])[0], strict=True):
            one, two = (found.solids[k] for k in pair)
            if distance > 1e-3:
                compared += 1
                assert distance == pytest.approx(between(leg, one, two, q), abs=1e-6)
    assert compared > 10


def test_what_touches_at_a_joint_where_the_hop_starts_is_left_out(tmp_path: Path) -> None:
    """The thigh's and the calf's capsules overlap at the knee; the thigh is in the trunk if that is as low as the hip."""
    found = Distances(paper_leg(tmp_path).leg, np.array([0.9, -1.9]))
    names = [solid.name for solid in found.solids]
    assert [{names[i], names[j]} for i, j in found.left_out] == [{"thigh", "calf"}]
    low = Distances(paper_leg(tmp_path, SHAPES.replace("0.02, 0.1]\n[", "0.02, 0.02]\n[")).leg, np.array([0.9, -1.9]))
    assert {"thigh", "trunk"} in [{names[i], names[j]} for i, j in low.left_out]


def test_neighbours_that_turn_beside_each_other_need_not_be_kept_apart(tmp_path: Path) -> None:
    """A plate 1 mm beside the thigh, 4 cm thick; one further than the margin away; and tilted ones, one of which it turns into."""

    def plate(inside: float, tilt: float) -> Distances:
        corners = [[x, y, z] for x in (-0.3, 0.3) for z in (-0.3, 0.3) for y in (inside + tilt * x, 0.08)]
        text = f"[leg.body.shapes.plate]\npoints = {corners}\ncounts = false\n[leg.thigh]\nradius = 0.04\n"
        return Distances(paper_leg(tmp_path, text).leg, np.array([0.9, -1.9]))

    beside, further, *tilted = (plate(*at) for at in ((0.041, 0.0), (0.05, 0.0), (0.0404, 0.003), (0.0404, -0.003)))
    assert [beside.names(pair) for pair in beside.beside] == [("thigh", "plate")]
    assert not beside.between(0, BODY)
    assert not further.beside
    assert len(further.between(0, BODY)) == 1
    assert not any(one.beside for one in tilted)
    assert sorted(len(one.between(0, BODY)) for one in tilted) == [0, 1]


def lowest(leg: Leg, solid: Solid, q: np.ndarray) -> float:
    """Height [m] of the lowest point of a solid over the first joint, for joint angles q [rad]."""
    return float(placed(leg, solid, q)[:, 2].min()) - solid.radius


def test_lowest_point_and_outline_in_closed_form(tmp_path: Path) -> None:
    leg, q = paper_leg(tmp_path).leg, np.array([0.4, -1.0])
    trunk, tail, thigh, calf = solids(leg)
    assert lowest(leg, trunk, q) == pytest.approx(0.05, abs=1e-12)
    assert lowest(leg, tail, q) == pytest.approx(-0.11, abs=1e-12)
    assert lowest(leg, thigh, q) == pytest.approx(-0.38 * np.cos(0.4) - 0.04, abs=1e-12)
    assert lowest(leg, calf, q) == pytest.approx(-0.38 * np.cos(0.4) - 0.361 * np.cos(-0.6) - 0.03, abs=1e-12)
    np.testing.assert_allclose(np.ptp(outline(leg, trunk, q), axis=0), [0.5, 0.1], atol=1e-9)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[leg.body.shapes.trunk]\nbox = [0.1, 0.1, 0.1]\npoints = [[0, 0, 0]]\n", "has box and points"),
        ("[leg.body.shapes.trunk]\nradius = 0.1\n", "has neither box nor polygon nor points"),
        ("[leg.shank.shapes.calf]\npoints = [[0, 0, 0], [0, 0, 1]]\n", "2 points and no radius"),
        ("[leg.body.shapes.trunk]\nbox = [0.1, -0.1, 0.1]\n", "leg.body.shapes.trunk.box[1] = -0.1 m is too small"),
        ('[leg.body.shapes."a b"]\nbox = [0.1, 0.1, 0.1]\n', "no name of a shape"),
        ("[leg.body.shapes.trunk]\npoints = [[0.1, 0.0, -0.2]]\nradius = 0.1\n", "puts the trunk 0.020 m too low"),
        ("[leg]\ngeometry = true\n", "leg.geometry has a meaning only beside leg.urdf"),
    ],
)
def test_shapes_that_are_none_are_refused_in_a_sentence(text: str, words: str, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=words.replace("[", r"\[")):
        paper_leg(tmp_path, text)


def robots() -> Path:
    """Folder of the public robots."""
    try:
        return Path(str(distribution("example-robot-data").locate_file("cmeel.prefix/share/example-robot-data/robots")))
    except PackageNotFoundError:  # pragma: no cover
        pytest.skip("example-robot-data is not installed")


def test_geometry_of_a_urdf_is_that_of_pinocchio(tmp_path: Path) -> None:
    """A1's boxes, cylinders and spheres on the whole robot: equal but for the prisms about cylinders, 2 % wider at most."""
    path = robots() / A1
    (tmp_path / "a1.toml").write_text(A1_PROBLEM)
    design = load(tmp_path / "a1.toml")
    (tmp_path / "again.toml").write_text(resolved_toml(design))
    assert load(tmp_path / "again.toml") == design
    found = Distances(design.leg, np.array([0.8, -1.6]))
    model = pin.buildModelFromXML(path.read_text(), pin.JointModelFreeFlyer())
    geometry = pin.buildGeomFromUrdfString(model, path.read_text(), pin.GeometryType.COLLISION)
    of_link = {g.name.rpartition("_")[0]: k for k, g in enumerate(geometry.geometryObjects)}
    for i, j in found.pairs:
        geometry.addCollisionPair(pin.CollisionPair(*(of_link[found.solids[k].name] for k in (i, j))))
    at, data, shapes = pin.neutral(model), model.createData(), geometry.createData()
    low, high = model.lowerPositionLimit[7:], model.upperPositionLimit[7:]
    at[7:] = np.clip(0.0, low, high)
    places = [model.joints[model.getJointId(name)].idx_q for name in JOINTS]
    rng = np.random.default_rng(2)
    for q in rng.uniform([-1.0, -2.6], [4.0, -0.9], (20, 2)):
        at[places] = q
        pin.computeDistances(model, data, geometry, shapes, at)
        theirs = np.array([result.min_distance for result in shapes.distanceResults])
        mine = found.all(q[None])[0]
        clear = theirs > 0
        assert np.all(mine <= theirs + 3e-5)
        assert np.all(mine[clear] >= theirs[clear] - 0.02 * 0.046 - 3e-5)  # of the thickest cylinder


ROBOT = """
<robot name="r">
  <link name="trunk"><inertial><mass value="5"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="hip" type="revolute"><parent link="trunk"/><child link="thigh"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="2" effort="30" velocity="20"/></joint>
  <link name="thigh"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><origin xyz="0 0 -0.1"/><geometry><box size="0.04 0.04 0.2"/></geometry></collision></link>
  <joint name="knee" type="revolute"><parent link="thigh"/><child link="shank"/><axis xyz="0 1 0"/><origin xyz="0 0 -0.2"/>
    <limit lower="-2.5" upper="-0.1" effort="30" velocity="20"/></joint>
  <link name="shank"><inertial><mass value="0.2"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="sole" type="fixed"><parent link="shank"/><child link="foot"/><origin xyz="0 0 -0.2"/></joint>
  <link name="foot"/>
</robot>
"""
BOX = '<box size="0.04 0.04 0.2"/>'


def robot(tmp_path: Path, urdf: str) -> Design:
    """A robot of this text in a folder below that of its problem."""
    (tmp_path / "mine" / "robots").mkdir(parents=True, exist_ok=True)
    (tmp_path / "mine" / "robots" / "robot.urdf").write_text(urdf)
    (tmp_path / "mine" / "mine.toml").write_text(
        'name = "mine"\n[leg]\nurdf = "robots/robot.urdf"\njoints = ["hip", "knee"]\nfoot_frame = "foot"\ngeometry = true\n'
        "[start]\njoint_angles = [0.7, -1.4]\n"
    )
    return load(tmp_path / "mine" / "mine.toml")


@pytest.mark.parametrize(
    ("written", "words"),
    [
        (
            '<capsule radius="0.02" length="0.2"/>',
            'link "thigh" has a <collision> that is <capsule>: hopopt reads <mesh>, <box>',
        ),
        ('<box size="0.04 0.2"/>', 'has size="0.04 0.2": 3 numbers with blanks between is needed'),
        ('<box size="0.04 -1 0.2"/>', "numbers above zero are needed"),
        ('<sphere radius="nan"/>', 'has radius="nan": a number such as'),
        ('<mesh filename="a.stl" scale="1 1"/>', 'has scale="1 1": 3 numbers'),
        (
            '<mesh filename="a.stl"/>',
            'the collision mesh "a.stl" of link "thigh", which is not in the folder of the problem',
        ),
        ('<mesh filename="../../out.stl"/>', "which is not in the folder of the problem"),
        ('<mesh filename="package://out.stl"/>', "which is not in the folder of the problem"),
        ('<mesh filename="OUT"/>', "which is not in the folder of the problem"),
        ('<mesh filename="file://OUT"/>', "which is not in the folder of the problem"),
        ('<mesh filename="linked.stl"/>', "which is not in the folder of the problem"),
        ('<mesh filename="../bad.stl"/>', 'mesh "../bad.stl" of link "thigh", which cannot be read as a solid'),
    ],
)
def test_collision_geometry_that_cannot_be_read_is_refused(written: str, words: str, tmp_path: Path) -> None:
    """Nothing is left out or guessed, and no mesh is read beyond the problem's folder."""
    out = tmp_path / "out.stl"
    out.write_bytes(tetrahedron())
    (tmp_path / "mine" / "robots").mkdir(parents=True)
    (tmp_path / "mine" / "robots" / "linked.stl").symlink_to(out)
    (tmp_path / "mine" / "bad.stl").write_bytes(b"solid")
    with pytest.raises(UsageError, match=re.escape(words)):
        robot(tmp_path, ROBOT.replace(BOX, written.replace("OUT", str(out))))


def tetrahedron() -> bytes:
    """An STL file of the corners 0, 0.1 x, 0.1 y, 0.1 z [m]."""
    corners = 0.1 * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype="<f4")
    faces = [np.concatenate([np.zeros(3, "<f4"), *(corners[k] for k in face)]).astype("<f4").tobytes() + b"\0\0"
             for face in ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3))]  # fmt: skip
    return bytes(80) + np.uint32(4).tobytes() + b"".join(faces)


def test_a_mesh_beside_the_problem_is_its_hull(tmp_path: Path) -> None:
    (tmp_path / "mine" / "meshes").mkdir(parents=True)
    (tmp_path / "mine" / "meshes" / "solid.stl").write_bytes(tetrahedron())
    leg = robot(tmp_path, ROBOT.replace(BOX, '<mesh filename="package://mine/meshes/solid.stl" scale="2 1 1"/>')).leg
    shapes = leg.link["thigh"].shapes
    assert shapes is not None
    assert set(shapes["thigh"].points or ()) == {(0, 0, -0.1), (0.2, 0, -0.1), (0, 0.1, -0.1), (0, 0, 0)}


def test_what_a_fixed_joint_hangs_on_the_body_is_the_body(tmp_path: Path) -> None:
    """A tank below the trunk, by two fixed joints, is its lowest point; another limb's is not."""
    more = "".join(
        f'<joint name="to_{name}" type="{kind}"><parent link="{parent}"/><child link="{name}"/><origin xyz="0 0.3 {-down}"/>'
        '<axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="30" velocity="20"/></joint>'
        f'<link name="{name}"><collision><geometry><sphere radius="0.02"/></geometry></collision></link>'
        for name, kind, parent, down in (("frame", "fixed", "trunk", 0.01), ("tank", "fixed", "frame", 0.03), ("limb", "revolute", "trunk", 0.1))
    )  # fmt: skip
    leg = robot(tmp_path, ROBOT.replace("</robot>", more + "</robot>")).leg
    assert leg.body.shapes is not None
    assert {name: shape.counts for name, shape in leg.body.shapes.items()} == {
        "frame": True,
        "tank": True,
        "limb": False,
    }
    ((lowest,),) = [[place[2] for name, _, place in counted_points(leg) if name == "trunk"]]
    assert lowest == pytest.approx(-0.06, abs=1e-3)


@pytest.mark.parametrize(
    ("kind", "body"), [("prismatic", {"trunk"}), ("floating", {"trunk"}), ("fixed", {"trunk", "world"})]
)
def test_what_the_body_is_not_fixed_to_is_no_body(tmp_path: Path, kind: str, body: set[str]) -> None:
    """A test stand: the trunk slides or floats in a world with rail and floor, or is fixed to it; the rail is no body's lowest."""
    box = '<collision><origin xyz="0 0 {}"/><geometry><box size="0.1 0.1 0.02"/></geometry></collision>'
    fixed = "".join(
        f'<joint name="to_{name}" type="fixed"><parent link="world"/><child link="{name}"/><origin xyz="0 0 -0.6"/></joint>'
        f'<link name="{name}">{box.format(0)}</link>'
        for name in ("rail", "floor")
    )
    stand = f'<link name="world">{box.format(0.3)}</link><joint name="stand" type="{kind}"><parent link="world"/><child link="trunk"/><axis xyz="0 0 1"/></joint>'
    trunk = ROBOT.replace("</inertial></link>", f"</inertial>{box.format(0)}</link>", 1)
    leg = robot(tmp_path, trunk.replace("</robot>", stand + fixed + "</robot>")).leg
    shapes = leg.body.shapes or {}
    assert {name for name, shape in shapes.items() if shape.counts} == body
    assert bool({"rail", "floor"} & shapes.keys()) == (kind == "fixed")  # held with the body, they are beside it


def errs(design: Design, count: int) -> None:
    """The smooth distances err at random angles by no more than they state, where they are from 0 to NEAR."""
    found = clearances(design)
    assert found is not None
    true = Distances(design.leg, start_angles(design))
    limits = [(design.leg.joint[name].lower, design.leg.joint[name].upper) for name in design.leg.joints]
    low, high = np.transpose(limits)
    angles = np.random.default_rng(7).uniform(low, high, (count, len(limits)))
    for link in found.links:
        pairs = true.between(link.joint, link.other)
        least = found.level * np.tanh(true.all(angles, pairs).min(axis=1) / found.level)
        smooth = np.array(link.function(angles[:, link.angles].T)).ravel()
        off, near = np.abs(smooth - least), (smooth >= 0) & (smooth < NEAR * found.reach)
        assert off[near].max(initial=0.0) <= link.error
        assert near.sum() > 0.001 * count or not near.any()
    assert 0 < found.error < 0.01 * found.reach


def test_the_smooth_distance_errs_by_no_more_than_it_states(tmp_path: Path) -> None:
    errs(paper_leg(tmp_path), 10_000)


@pytest.mark.slow
def test_the_smooth_distance_of_a_public_robot_errs_by_no_more_than_it_states(tmp_path: Path) -> None:
    robots()
    (tmp_path / "a1.toml").write_text(A1_PROBLEM)
    errs(load(tmp_path / "a1.toml"), 10_000)


def test_the_lowest_point_is_of_the_shapes_unless_joints_alone_count(tmp_path: Path) -> None:
    """By Pinocchio's frames against the hulls' own points: the trunk exactly, a link by a polygon of twelve sides about it."""
    design = paper_leg(tmp_path, SHAPES.replace("at = [0.05, 0.02, 0.1]", "at = [0.05, 0.02, 0.1]\ncounts = false"))
    leg, robot = design.leg, build_robot(design.leg)
    assert tuple(above_ground(design)) == ("hip", "knee", "trunk", "thigh", "foot")
    trunk, thigh = solids(leg)[1:3]
    for q in np.random.default_rng(3).uniform([-0.6, -2.4], [1.3, -0.15], (20, 2)):
        heights = {name: z for name, (_, z) in Machine(robot).points(np.array([0.3, 0.7, *q])).items() if name != "com"}
        assert heights["trunk"] == pytest.approx(0.7 + lowest(leg, trunk, q), abs=1e-12)
        about = min(z for name, z in heights.items() if name.startswith("thigh"))
        assert -0.04 * (1 / np.cos(np.pi / 12) - 1) - 1e-12 <= about - 0.7 - lowest(leg, thigh, q) <= 1e-12
    joints = paper_leg(tmp_path, f'[leg]\nlowest = "joints"\n{SHAPES}')
    assert list(build_robot(joints.leg).points) == ["hip", "knee", "foot"]
    assert tuple(above_ground(joints)) == ("hip", "knee", "foot")


def test_what_stays_above_the_ground_follows_the_shapes(tmp_path: Path) -> None:
    """Shapes that come or go by a change, shapes that do not count, and a link that starts too low."""
    shaped = paper_leg(tmp_path)
    assert tuple(above_ground(changed(shaped, {"leg.lowest": "joints"}))) == ("hip", "knee", "foot")
    later = changed(load("paper"), {"leg.body.shapes": {"trunk": {"box": [0.5, 0.2, 0.1], "at": [0.0, 0.0, 0.1]}}})
    assert tuple(above_ground(later)) == ("hip", "knee", "trunk", "foot")
    for without in ('[leg]\nlowest = "joints"\n', "[leg.body.shapes.trunk]\ncounts = false\nbox = [0.1, 0.1, 0.1]\n"):
        text = without if "shapes" in without else without + SHAPES
        with pytest.raises(UsageError, match=r'hop\.above_ground has "trunk", no shape of which counts'):
            paper_leg(tmp_path, f'{text}[hop]\nabove_ground = ["trunk"]\n')
    thick = SHAPES.replace("radius = 0.04", "radius = 0.3")
    assert "thigh" not in above_ground(paper_leg(tmp_path, thick))
    with pytest.raises(UsageError, match=r"puts the thigh 0\.\d+ m too low"):
        paper_leg(tmp_path, thick + '[hop]\nabove_ground = ["thigh"]\n')


def test_a_planner_keeps_the_ends_of_links_higher_by_their_radius(tmp_path: Path) -> None:
    """The link is a capsule about the line between its ends. One that is too low at the start is refused, by its points."""
    shaped = paper_leg(tmp_path)
    rows = {point: least for _, point, least in height_rows(shaped)}
    radius = 0.04 / np.cos(np.pi / 12)
    assert rows == {"hip": pytest.approx(radius), "knee": pytest.approx(radius), "trunk": 0.0, "foot": 0.0}
    machine = Machine(build_robot(shaped.leg))
    for q in np.random.default_rng(4).uniform([-0.6, -2.4], [1.3, -0.15], (50, 2)):
        z = {name: place[1] for name, place in machine.points(np.array([0.0, 0.5, *q])).items()}
        assert min(z[p] for p in points_of(shaped)["thigh"]) >= min(z["hip"], z["knee"]) - radius - 1e-12
    assert height_rows(load("paper")) == [("hip", "hip", 0.0), ("knee", "knee", 0.0), ("foot", "foot", 0.0)]


@pytest.mark.parametrize("friction", [None, 0.6])
def test_a_leg_that_falls_on_its_trunk_or_its_thigh_stops_there(friction: float | None, tmp_path: Path) -> None:
    """Compiled heights are Pinocchio's; a leg without torques folds until what is lowest strikes."""
    for text, name in ((SHAPES.replace("-0.3, 0.0, -0.1", "-0.3, 0.0, -0.25"), "trunk"), (SHAPES, "thigh")):
        plant = make_plant(changed(paper_leg(tmp_path, text), {"contact.friction": friction}))
        run = plant.run(np.array([0.9, -1.9]), Limp(), 1.0)
        assert run.outcome == f"the {name} hit the ground"
        slow = Plant(plant.robot, plant.drive, plant.above_ground)
        s = slow.stance_start(np.array([0.9, -1.9]))
        for q in np.random.default_rng(5).uniform([-0.6, -2.4], [1.3, -0.15], (20, 2)):
            at = replace(s, q=np.array([0.1, 0.4, *q]))
            assert plant.lowest_watched(at) == (slow.lowest_watched(at)[0], pytest.approx(slow.lowest_watched(at)[1]))


class Limp:
    """No torque."""

    def torque(self, now: Measurement) -> np.ndarray:
        return np.zeros(2)


@pytest.mark.slow
def test_a_trunk_that_hangs_low_is_what_clears(tmp_path: Path) -> None:
    """Its height at the apex is the clearance; the foot is drawn up as high and no higher."""
    low = "[leg.body.shapes.trunk]\npolygon = [[-0.2, -0.33], [0.2, -0.33], [0.2, 0.1], [-0.2, 0.1]]\n"
    design = paper_leg(
        tmp_path, f"{low}[hop]\nmay_collide = true\nstance_duration = [0.03, 0.2]\n[start]\nhip_height = 0.36\n"
    )
    found = solve(design, starts=1, processes=1)
    assert found.summary.verified
    assert found.summary.lowest_point in ("trunk", "foot")
    assert found.summary.clearance_m == pytest.approx(float(found.apex.q[0, 1]) - 0.33, abs=1e-9)
    shown = planned(found, "the optimum")
    assert np.interp(found.duration, shown.t, shown.lowest) == pytest.approx(found.summary.clearance_m, abs=1e-9)


def test_the_poses_that_starts_aim_at_are_clear(tmp_path: Path) -> None:
    """A ball is planted where the foot of the paper's leg would be drawn up to: the guesses go elsewhere."""
    free = load("paper")
    pose, best = tucked(free.leg, free.hop.foot_window), Posture(Hop(free)).best()
    for q in (pose, best):
        x, _, z = joint_positions(free.leg, q)[-1].tolist()
        ball = f"[leg.body.shapes.ball]\npoints = [[{x}, 0.0, {z}]]\nradius = 0.02\ncounts = false\n"
        hop = Hop(paper_leg(tmp_path, f"[leg.shank]\nradius = 0.02\n{ball}"))
        found = Distances(hop.leg, start_angles(hop.design))
        aimed = tucked(hop.leg, free.hop.foot_window, slack_of(hop)) if q is pose else Posture(hop).best()
        assert found.all(q[None]).min() < 0
        assert found.all(aimed[None]).min() > 0.9 * margin_of(hop.design)
