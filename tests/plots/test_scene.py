"""The hop in three dimensions: frames are those of Pinocchio, the slider moves them, meshes lie where they belong."""

import json
import os
import signal
import subprocess
import sys
import time
import urllib.request
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import hopopt as ho
from hopopt.cli import main as cli
from hopopt.errors import ProblemFileError
from hopopt.leg.files.urdf_visuals import BODY, visuals
from hopopt.leg.robot import build_robot
from hopopt.planner.solution import Solution
from hopopt.plots import scene as plots
from hopopt.plots.scene import HopScene, serve
from hopopt.problem.load import changed
from hopopt.storage.solution import save
from refusals import refusal

pytest.importorskip("viser", reason="the view in three dimensions needs pip install 'hopopt[view]'")
PYRAMID = b"solid p\n" + b"".join(
    b"facet normal 0 0 0\nouter loop\n" + b"".join(b"vertex %d %d %d\n" % c for c in face) + b"endloop\nendfacet\n"
    for face in (
        ((0, 0, 0), (1, 0, 0), (0, 1, 0)), ((0, 0, 0), (0, 1, 0), (0, 0, 1)),
        ((0, 0, 0), (0, 0, 1), (1, 0, 0)), ((1, 0, 0), (0, 0, 1), (0, 1, 0)),
    )
) + b"endsolid p\n"  # fmt: skip
URDF = """<robot name="r">
<link name="trunk"><inertial><mass value="5"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
<visual><origin xyz="0 0 0.1"/><geometry><box size="0.3 0.2 0.1"/></geometry></visual></link>
<link name="tail"><visual><geometry><sphere radius="0.1"/></geometry></visual></link>
<joint name="to_tail" type="fixed"><parent link="trunk"/><child link="tail"/><origin xyz="-1 0 0"/></joint>
<link name="thigh"><inertial><mass value="1"/><inertia ixx=".1" iyy=".1" izz=".1" ixy="0" ixz="0" iyz="0"/></inertial>
<visual><origin xyz="0 0 -0.1" rpy="0 1.5707963267948966 0"/>
<geometry><mesh filename="package://robot_description/meshes/thigh.stl" scale="0.1 0.1 0.1"/></geometry></visual></link>
<joint name="hip" type="revolute"><parent link="trunk"/><child link="thigh"/><origin xyz="0.2 0 -0.05" rpy="0 0.3 0"/>
<axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="10" velocity="10"/></joint>
<link name="shank"><inertial><mass value="1"/><inertia ixx=".1" iyy=".1" izz=".1" ixy="0" ixz="0" iyz="0"/></inertial>
<visual><geometry><mesh filename="nothing.stl"/></geometry></visual></link>
<joint name="knee" type="revolute"><parent link="thigh"/><child link="shank"/><origin xyz="0 0 -0.4"/>
<axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="10" velocity="10"/></joint>
<link name="foot"><visual><geometry><cylinder radius="0.02" length="0.05"/></geometry></visual></link>
<joint name="ankle" type="fixed"><parent link="shank"/><child link="foot"/><origin xyz="0 0 -0.4"/></joint></robot>"""


@pytest.fixture
def server() -> Iterator[Any]:
    found = serve("127.0.0.1", 0)
    yield found
    with plots.quiet():
        found.stop()


@pytest.fixture
def robot(tmp_path: Path) -> Path:
    """Folder of a URDF, with the mesh of its thigh."""
    folder = tmp_path / "robot_description" / "urdf"
    folder.mkdir(parents=True)
    (folder.parent / "meshes").mkdir()
    (folder.parent / "meshes" / "thigh.stl").write_bytes(PYRAMID)
    (folder / "robot.urdf").write_text(URDF)
    return folder


def places(scene: HopScene) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Position (3) and rotation (3, 3) of every frame."""
    found = {}
    for name, frame in scene.links.items():
        w, x, y, z = frame.wxyz
        found[name] = np.array(frame.position), pin.Quaternion(w, x, y, z).toRotationMatrix()
    return found


@pytest.mark.parametrize("share", [0.0, 0.31, 0.77, 1.0])
def test_frames_are_those_of_forward_kinematics(server: Any, hop: Solution, share: float) -> None:
    scene, t = HopScene(server, hop), share * hop.end
    scene.show(t)
    model = build_robot(hop.design.leg).model
    data, q = model.createData(), hop.sample(np.array([t])).q[0]
    pin.forwardKinematics(model, data, q)
    for name, (position, rotation) in places(scene).items():
        expected = data.oMi[model.getJointId(name if name != "body" else hop.design.leg.joints[0])]
        np.testing.assert_allclose(position, expected.translation, atol=1e-4)
        np.testing.assert_allclose(rotation, expected.rotation if name != "body" else np.eye(3), atol=1e-3)


def test_the_slider_moves_the_leg_and_play_moves_the_slider(server: Any, hop: Solution) -> None:
    """At the end the hop pauses; played again, it begins anew."""
    scene = HopScene(server, hop)
    before = places(scene)["knee"][0]
    scene.slider.value = 0.5
    until = time.monotonic() + 10.0
    while np.allclose(places(scene)["knee"][0], before) and time.monotonic() < until:
        time.sleep(0.01)  # viser tells of it from a thread of its own
    expected = hop.sample(np.array([0.5])).points["knee"][0]
    np.testing.assert_allclose(places(scene)["knee"][0][[0, 2]], expected, atol=1e-4)
    scene.play(True)
    assert scene.button.label == "Pause"
    scene.speed.value = "1"
    scene.advance(0.1)
    assert scene.slider.value == pytest.approx(0.6, abs=1e-3)
    scene.advance(10.0)
    assert (scene.playing, scene.button.label) == (False, "Play")
    assert scene.slider.value == pytest.approx(hop.end, abs=1e-3)
    scene.play(True)
    assert scene.slider.value == 0.0
    scene.play(False)
    scene.advance(1.0)
    assert scene.slider.value == 0.0


def test_links_without_meshes_are_cylinders(server: Any, hop: Solution) -> None:
    assert HopScene(server, hop).drawn == {"body": "cylinder", "thigh": "cylinder", "shank": "cylinder"}


def test_shapes_that_collide_are_drawn_where_they_are(server: Any, hop: Solution) -> None:
    """Half transparent, in the frames of body and thigh; what does not count is hidden until it is asked for."""
    shapes = {
        "trunk": {"box": [0.4, 0.2, 0.16], "at": [-0.05, 0.0, 0.06]},
        "other": {"points": [[0.1, 0.3, -0.2]], "radius": 0.05, "counts": False},
        "wall": {"polygon": [[-0.5, 0.1], [-0.4, 0.1], [-0.4, 0.2]], "counts": False},
    }
    design = changed(hop.design, {"leg.body.shapes": shapes, "leg.thigh.radius": 0.03})
    scene = HopScene(server, replace(hop, design=design))
    trunk, other, wall, thigh = scene.shapes.values()
    np.testing.assert_allclose(trunk.vertices.min(axis=0), [-0.25, -0.1, -0.02], atol=1e-6)
    np.testing.assert_allclose(np.ptp(other.vertices, axis=0), 0.1, atol=1e-2)
    assert np.abs(wall.vertices[:, 1]).max() < 0.2
    np.testing.assert_allclose(np.ptp(thigh.vertices, axis=0)[2], 0.44, atol=1e-2)
    assert [shape.visible for shape in scene.shapes.values()] == [True, False, False, True]


def test_cranks_and_rods_reach_from_the_body_to_the_shank(server: Any, hop: Solution) -> None:
    """The rod's end in its frame is the arm's in the shank's, at every time."""
    links = {"crank": 0.06, "rod": 0.38, "arm": 0.06, "ahead": False}
    design = changed(hop.design, {"leg.knee.transmission.five_bar": links})
    scene = HopScene(server, replace(hop, design=design))
    for t in (0.0, hop.lift_off, hop.end):
        scene.show(t)
        crank, rod, shank = (
            pin.SE3(pin.Quaternion(*frame.wxyz).toRotationMatrix(), np.asarray(frame.position, dtype=float))
            for frame in (*scene.bars.values(), scene.links["knee"])
        )
        np.testing.assert_allclose(crank.translation, scene.links["hip"].position, atol=1e-6)
        np.testing.assert_allclose(crank.act(np.array([0.06, 0, 0])), rod.translation, atol=1e-6)
        np.testing.assert_allclose(rod.act(np.array([0.38, 0, 0])), shank.act(np.array([0, 0, -0.06])), atol=1e-6)


def test_visuals_lie_where_the_urdf_puts_them(robot: Path) -> None:
    """By Pinocchio's whole model of the same file with all angles zero: each in the frame of the joint that moves it."""
    found = visuals((robot / "robot.urdf").read_bytes(), robot, ["hip", "knee"], "foot", {})
    assert [(v.link, v.joint, v.shape) for v in found] == [
        ("trunk", BODY, "box"), ("thigh", 0, "mesh"), ("shank", 1, "mesh"), ("foot", 1, "cylinder"),
    ]  # fmt: skip
    model = pin.buildModelFromXML(URDF)
    data = model.createData()
    pin.framesForwardKinematics(model, data, pin.neutral(model))
    hip, knee = (data.oMi[model.getJointId(name)].translation for name in ("hip", "knee"))
    thigh = data.oMf[model.getFrameId("thigh")] * pin.SE3(pin.rpy.rpyToMatrix(0, np.pi / 2, 0), np.array([0, 0, -0.1]))
    trunk, shank, foot = found[0], found[2], found[3]
    np.testing.assert_allclose(trunk.position + hip, [0, 0, 0.1], atol=1e-12)
    np.testing.assert_allclose(found[1].position + hip, thigh.translation, atol=1e-12)
    np.testing.assert_allclose(found[1].rotation, thigh.rotation, atol=1e-12)
    np.testing.assert_allclose(shank.position, 0.0, atol=1e-12)
    np.testing.assert_allclose(foot.position + knee, data.oMf[model.getFrameId("foot")].translation, atol=1e-12)
    assert found[1].file is not None
    assert found[1].file.samefile(robot.parent / "meshes" / "thigh.stl")
    assert found[1].size == (0.1, 0.1, 0.1)
    assert shank.file is None


def test_meshes_are_shown_where_there_are_any(server: Any, robot: Path, hop: Solution) -> None:
    looks = visuals((robot / "robot.urdf").read_bytes(), robot, ["hip", "knee"], "foot", {})
    assert HopScene(server, hop, looks).drawn == {"body": "mesh", "thigh": "mesh", "shank": "cylinder"}
    assert [look.own for look in looks] == [
        True,
        True,
        True,
        False,
    ]  # the shank's file is not there, its foot is no shank


@pytest.mark.parametrize(
    "change",
    [
        lambda text: text.replace('scale="0.1 0.1 0.1"', 'scale="nan a"'),
        lambda text: text.replace('size="0.3 0.2 0.1"', 'size="-1 0 0"'),
        lambda text: text.replace("package://", "package://\x01"[:10]),
        lambda text: text.replace("robot_description/meshes/thigh.stl", "/" * 5000),
        lambda text: text.replace("package://robot_description/meshes/thigh.stl", "https://example.org/thigh.stl"),
    ],
)
def test_odd_looks_refuse_nothing(server: Any, robot: Path, hop: Solution, change: Callable[[str], str]) -> None:
    looks = visuals(change(URDF).encode(), robot, ["hip", "knee"], "foot", {})
    assert set(HopScene(server, hop, looks).drawn) == {"body", "thigh", "shank"}


def test_a_damaged_mesh_gives_way_to_a_cylinder(server: Any, robot: Path, hop: Solution) -> None:
    (robot.parent / "meshes" / "thigh.stl").write_bytes(b"\x00" * 90)
    looks = visuals((robot / "robot.urdf").read_bytes(), robot, ["hip", "knee"], "foot", {})
    assert HopScene(server, hop, looks).drawn["thigh"] == "cylinder"


def test_a_public_robot_has_its_own_meshes() -> None:
    """Each of the leg's links has a mesh on disk, the shank's below the thigh's."""
    pytest.importorskip("collada", reason="meshes in .dae need pip install 'hopopt[view]'")
    try:
        design = ho.load("solo12_leg")
    except ProblemFileError:
        pytest.skip("robots of others need pip install 'hopopt[robots]'")
    from hopopt.problem.load import urdf_of

    given = urdf_of("solo12_leg")
    assert given is not None
    file = Path(given["urdf"])
    found = visuals(file.read_bytes(), file.parent, design.leg.joints, given["foot_frame"], given.get("locked", {}))
    assert {v.joint for v in found if v.file} == {BODY, 0, 1}


# ---- the command --------------------------------------------------------------------------------------------


def test_the_command_serves_this_computer_alone_and_ends_cleanly(hop: Solution, tmp_path: Path) -> None:
    """One JSON object, a page at the address, and exit code 0 after Ctrl-C."""
    folder = save(hop, tmp_path / "Größe und Höhe").result_dir
    words = [sys.executable, "-m", "hopopt", "view", str(folder), "--port", "0", "--json"]
    environment = os.environ | {"HOPOPT_CACHE": "off"}
    heard = partial(signal.signal, signal.SIGINT, signal.SIG_DFL)  # what runs in a shell's background ignores Ctrl-C
    pipe = subprocess.PIPE
    with subprocess.Popen(words, stdout=pipe, stderr=pipe, text=True, env=environment, preexec_fn=heard) as running:
        try:
            assert running.stdout is not None
            said = json.loads(running.stdout.readline())
            assert said["address"].startswith("http://127.0.0.1:")
            assert set(said["links"]) == {"body", "thigh", "shank"}
            with urllib.request.urlopen(said["address"], timeout=10) as answer:
                assert b"<html" in answer.read().lower()
            time.sleep(0.1)
            running.send_signal(signal.SIGINT)
            out, errors = running.communicate(timeout=20)
            assert (running.returncode, out) == (0, "")
            assert "Traceback" not in errors
        finally:
            running.kill()


def test_what_cannot_be_shown_is_said_in_a_sentence(
    hop: Solution, tmp_path: Path, server: Any, capsys: pytest.CaptureFixture
) -> None:
    folder = str(save(hop, tmp_path).result_dir)
    cases = {
        ("none",): "there is no such folder",
        (folder, "--port", str(server.get_port())): "nothing can listen there",
        (folder, "--port", "70000"): "from 0 to 65535 are allowed",
        (folder, "--leg", "paper"): "this problem has no leg.urdf",
        (folder, "--leg", "nothing.toml"): "there is no such file",
    }
    for words, message in cases.items():
        assert message in refusal(["view", *words], capsys)


def test_without_the_extra_the_command_says_what_to_install(
    hop: Solution, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    def missing(name: str) -> Any:
        raise ModuleNotFoundError(name)

    monkeypatch.setattr(plots, "import_module", missing)
    assert cli.run(["view", str(save(hop, tmp_path).result_dir)]) == 2
    assert capsys.readouterr().err == "hopopt: viser is not installed: pip install 'hopopt[view]'\n"
