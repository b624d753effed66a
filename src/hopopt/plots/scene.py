"""A hop in three dimensions in a browser, through viser: the leg moves with a time slider, and plays.

Poses are those of Pinocchio's forward kinematics. Links look as the URDF says where its meshes lie on disk, else as
cylinders.
"""

import io
import socket
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stdout
from importlib import import_module
from pathlib import Path
from threading import RLock
from typing import Any

import numpy as np
import pinocchio as pin

from hopopt.errors import MissingExtraError, UsageError
from hopopt.leg.closed_chains import PARTS
from hopopt.leg.files.urdf_visuals import BODY, Visual
from hopopt.leg.geometry.solids import BESIDE, solids
from hopopt.leg.robot import BASE
from hopopt.leg.scales import Scale
from hopopt.planner.motion import Motion

POSE_INTERVAL = 0.002  # [s] on the paper's leg, between two poses
FRAME_INTERVAL = 1 / 50  # [s] between two pictures
THICK = 0.04  # radius of a link's cylinder, as a share of the leg's length
BAR = 0.5  # radius of a crank's and a rod's, as a share of a link's
FORCE = 0.0006  # [m/N] on the paper's leg: length of the ground force's line
GROUND, CELL, SECTION = 4.0, 0.1, 0.5  # [m] on the paper's leg: sides of the ground, of its cells, of their sections
PLAY_SPEEDS = {"1": 1.0, "1/4": 0.25, "1/10": 0.1}
BLUE, GREY, BLACK, SHAPE = (0, 114, 178), (120, 120, 120), (26, 26, 26), (230, 159, 0)
SLICE = 0.15  # of the leg's length: half the width at which a polygon is drawn
LARGEST_MESH = 100_000_000  # bytes of a mesh


class HopScene:
    """A hop on a server of viser.

    server: viser's. links: frame of the body and of each moving joint, by name. slider: time since the hop began [s].
    drawn: link -> what is shown of it: "mesh", or "cylinder" where there is none. shapes: what collides, by its place in the scene.
    bars: frames of the cranks and rods of five-bars, by (joint, part).
    """

    def __init__(self, server: Any, hop: Motion, looks: Sequence[Visual] = ()):
        self.server, self._robot, self._lock = server, hop.robot, RLock()
        self.end, self._scale = hop.end, Scale.of(hop.design.leg)
        interval = POSE_INTERVAL * self._scale.time
        even = np.linspace(0.0, self.end, max(2, round(self.end / interval) + 1))
        samples = hop.sample(even)
        self._t, self._q, self._force = samples.t, samples.q, samples.f
        self._data = hop.robot.model.createData()
        self.playing = False
        self._stage()
        self.links: dict[str, Any] = {
            name: server.scene.add_frame(f"/leg/{name}", show_axes=False) for name in ("body", *hop.robot.leg.pivots)
        }
        self.drawn = self._dress(looks)
        self.shapes, self.bars = self._shapes(), self._bars()
        self._push = server.scene.add_line_segments(
            "/ground force", np.zeros((1, 2, 3)), BLACK, thickness=0.2 * THICK * self._length
        )
        self._controls()
        self.show(0.0)

    # ---- what is there ------------------------------------------------------------------------------------------

    @property
    def _length(self) -> float:
        """Of the stretched leg [m]."""
        return sum(self._robot.leg.link[name].length for name in self._robot.leg.links)

    def _stage(self) -> None:
        """The ground, and where one looks from: the side, so that x is to the right."""
        scene = self.server.scene
        scene.set_up_direction("+z")
        side, cell, section = (self._scale.length * size for size in (GROUND, CELL, SECTION))
        scene.add_grid("/ground", side, side, plane="xy", cell_size=cell, section_size=section)
        self.server.initial_camera.look_at = (0.0, 0.0, 0.8 * self._length)
        self.server.initial_camera.position = (0.3 * self._length, -2.6 * self._length, 1.0 * self._length)

    def _dress(self, looks: Sequence[Visual]) -> dict[str, str]:
        """Meshes and simple bodies into their frames; cylinders for links that have none."""
        names, worn = ("body", *self._robot.leg.pivots), set[int]()
        for k, look in enumerate(looks):
            mesh = _mesh(look)
            if mesh is not None:
                where = f"/leg/{names[look.joint + 1]}/{k}_{look.link}"
                self.server.scene.add_mesh_trimesh(
                    where, mesh, wxyz=_quaternion(look.rotation), position=tuple(look.position)
                )
                worn |= {look.joint} if look.own else set()
        drawn = {}
        for k, name in enumerate(names):
            if k - 1 not in worn:
                self._simple(k - 1, name)
            drawn["body" if k == 0 else self._robot.leg.links[k - 1]] = "mesh" if k - 1 in worn else "cylinder"
        return drawn

    def _shapes(self) -> dict[str, Any]:
        """What collides, half transparent in the frame of what moves it, by name."""
        trimesh, names, found = import_module("trimesh"), ("body", *self._robot.leg.pivots), dict[str, Any]()
        for k, solid in enumerate(solids(self._robot.leg)):
            ball = trimesh.creation.icosphere(1, solid.radius).vertices if solid.radius else np.zeros((1, 3))
            points = solid.points * [1.0, self._drawn_width(solid.points), 1.0]
            hull = trimesh.convex.convex_hull((points[:, None] + ball).reshape(-1, 3), qhull_options="QJ Pp")
            where = f"/leg/{names[solid.joint + 1]}/shape_{k}_{solid.name}"
            found[where] = self.server.scene.add_mesh_simple(
                where, hull.vertices, hull.faces, color=SHAPE, opacity=0.35, visible=solid.counts
            )
        return found

    def _bars(self) -> dict[tuple[str, str], Any]:
        """Cranks and rods of five-bars as thin cylinders along x of frames of their own."""
        trimesh, leg, found = import_module("trimesh"), self._robot.leg, dict[tuple[str, str], Any]()
        for joint, part in ((joint, part) for joint in leg.five_bars for part in PARTS):
            length, where = self._robot.parameters[f"leg.{joint}.transmission.five_bar.{part}"], f"/leg/{joint} {part}"
            found[joint, part] = self.server.scene.add_frame(where, show_axes=False)
            ends = [np.zeros(3), np.array([length, 0.0, 0.0])]
            bar = trimesh.creation.cylinder(BAR * THICK * self._length, segment=ends)
            self.server.scene.add_mesh_simple(f"{where}/simple", bar.vertices, bar.faces, color=GREY)
        return found

    def _drawn_width(self, points: np.ndarray) -> float:
        """Share of its width that is drawn of a solid: of a polygon, which nothing passes beside, a part."""
        width = float(np.abs(points[:, 1]).max())
        return 1.0 if width < BESIDE * self._length else SLICE * self._length / width

    def _simple(self, joint: int, name: str) -> None:
        """A cylinder from a joint to the next point, with balls at its ends; a ball for the body."""
        trimesh, radius = import_module("trimesh"), THICK * self._length
        parts = [trimesh.creation.icosphere(3, 2.2 * radius)]
        if joint != BODY:
            end = self._end_of(joint)
            parts = [
                trimesh.creation.cylinder(radius, segment=[np.zeros(3), end]),
                trimesh.creation.icosphere(3, 1.3 * radius),
            ]
            if joint == len(self._robot.joints) - 1:
                foot = trimesh.creation.icosphere(3, radius)
                parts.append(foot.apply_translation(end))
        for k, part in enumerate(parts):
            color = GREY if joint == BODY or k == 1 else BLUE
            self.server.scene.add_mesh_simple(f"/leg/{name}/simple_{k}", part.vertices, part.faces, color=color)

    def _end_of(self, joint: int) -> np.ndarray:
        """From a joint to the next one, or to the foot, in the joint's frame (3) [m]."""
        names = (*self._robot.leg.pivots, "foot")
        if names[joint + 1] == "foot":
            return np.array(self._robot.points["foot"][1], dtype=float)
        return self._robot.model.jointPlacements[self._robot.points[names[joint + 1]][0]].translation

    def _controls(self) -> None:
        gui = self.server.gui
        gui.configure_theme(show_share_button=False, show_logo=False)  # sharing would send the hop to another's server
        self.slider = gui.add_slider("time [s]", 0.0, round(self.end, 3), 0.001, 0.0)
        self.button = gui.add_button("Play")
        self.speed = gui.add_dropdown("speed", list(PLAY_SPEEDS), initial_value="1/4")
        if self.shapes:
            shown = gui.add_checkbox("shapes that collide, also those of other limbs", False)
            shown.on_update(lambda event: self._show_all(shown.value))
        self.slider.on_update(lambda event: self.show(self.slider.value))
        self.button.on_click(lambda event: self.play(not self.playing))

    def _show_all(self, on: bool) -> None:
        """Show all shapes, or those alone that count as the robot's lowest point."""
        for shape, solid in zip(self.shapes.values(), solids(self._robot.leg), strict=True):
            shape.visible = on or solid.counts

    # ---- what moves ---------------------------------------------------------------------------------------------

    def show(self, t: float) -> None:
        """The leg, and the force on its foot, as at a time [s]."""
        with self._lock, self.server.atomic():
            k = int(np.clip(np.searchsorted(self._t, t), 1, len(self._t) - 1))
            share = float(np.clip((t - self._t[k - 1]) / (self._t[k] - self._t[k - 1]), 0.0, 1.0))
            q = (1 - share) * self._q[k - 1] + share * self._q[k]
            force = (1 - share) * self._force[k - 1] + share * self._force[k]
            pin.framesForwardKinematics(self._robot.model, self._data, q)
            body = self._data.oMi[BASE].translation
            self.links["body"].position = tuple(body)
            for name in self._robot.leg.pivots:
                place = self._data.oMi[self._robot.points[name][0]]
                self.links[name].position = tuple(place.translation)
                self.links[name].wxyz = _quaternion(place.rotation)
            for part, place in (self._robot.chains.placements(q) if self._robot.chains else {}).items():
                self.bars[part].position = tuple(place.translation)
                self.bars[part].wxyz = _quaternion(place.rotation)
            foot = self._data.oMf[self._robot.model.getFrameId("point_foot")].translation
            push = (
                FORCE
                * self._scale.length
                / self._scale.force
                * np.array([force[0], force[1] if len(force) == 3 else 0.0, force[-1]])
            )
            self._push.points = np.array([[foot, foot + push]], dtype=np.float32)

    def play(self, on: bool) -> None:
        """Begin to play, from the start if the hop is at its end, or pause."""
        if on and self.slider.value >= self.end - 1e-3:
            self.slider.value = 0.0
        self.playing, self.button.label = on, "Pause" if on else "Play"

    def advance(self, seconds: float) -> None:
        """Let so much time pass [s], at the speed that is chosen; at its end the hop pauses."""
        if not self.playing:
            return
        t = min(self.end, self.slider.value + PLAY_SPEEDS[self.speed.value] * seconds)
        self.slider.value = min(t, self.slider.max)
        self.show(t)
        if t >= self.end - 1e-3:
            self.play(False)

    def run(self) -> None:
        """Play whenever asked, until interrupted."""
        before = time.perf_counter()
        while True:
            time.sleep(FRAME_INTERVAL)
            now = time.perf_counter()
            self.advance(now - before)
            before = now


def serve(host: str, port: int) -> Any:
    """A server of viser that only listens at this address; port 0: any that is free.

    Raises MissingExtraError without viser, UsageError if the address cannot be had.
    """
    try:
        viser = import_module("viser")
    except ModuleNotFoundError:
        raise MissingExtraError("viser", "view") from None
    if not 0 <= port < 65536:
        raise UsageError(f"--port {port}: from 0 to 65535 are allowed")
    try:
        with socket.create_server((host, port)) as tried:
            port = tried.getsockname()[1]
    except OSError as error:
        words = error.strerror or error
        raise UsageError(
            f"--host {host} --port {port}: nothing can listen there ({words}): choose another port"
        ) from None
    with quiet():
        return viser.ViserServer(host=host, port=port, label="hopopt", verbose=False)


@contextmanager
def quiet() -> Iterator[None]:
    """Nothing on standard output: viser writes there when it begins and ends, and a command alone says what it prints."""
    with redirect_stdout(io.StringIO()):
        yield


def _mesh(look: Visual) -> Any:
    """What a visual looks like as a mesh; None if its file is missing or cannot be read."""
    trimesh = import_module("trimesh")
    makers: Mapping[str, Any] = {
        "box": lambda *size: trimesh.creation.box(size),
        "cylinder": lambda radius, length: trimesh.creation.cylinder(radius, length),
        "sphere": lambda radius: trimesh.creation.icosphere(3, radius),
    }
    if look.shape != "mesh":
        return makers[look.shape](*look.size)
    return None if look.file is None else _read(trimesh, look.file, look.size)


def _read(trimesh: Any, file: Path, scale: Sequence[float]) -> Any:
    try:
        if file.stat().st_size > LARGEST_MESH:
            return None
        mesh = trimesh.load(file, force="mesh")
        mesh.apply_scale(scale)
        return mesh if len(mesh.faces) else None
    except Exception:  # its readers raise what they will at a damaged file; a cylinder stands for it
        return None


def _quaternion(rotation: np.ndarray) -> tuple[float, ...]:
    """w, x, y, z of a rotation (3, 3)."""
    x, y, z, w = pin.Quaternion(np.asarray(rotation, dtype=float)).coeffs()
    return float(w), float(x), float(y), float(z)
