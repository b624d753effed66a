"""The global search for legs on a vertical slider: two states, the height of the body and its speed."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hopopt.design import Design
from hopopt.drivetrain.operating_region.region import operating_region
from hopopt.global_search.constants import stance_constants
from hopopt.global_search.equations.bilinear import Bilinear
from hopopt.global_search.equations.slider_leg import SliderLeg, accelerations, slider_leg
from hopopt.global_search.posture import tuck_height
from hopopt.global_search.result import GlobalSearch, Rollout, different
from hopopt.leg.kinematics import start_place
from hopopt.leg.robot import build_robot
from hopopt.nlp.deadline import Deadline

NODES_FACTOR = 6  # nodes on an axis for each that is asked for: two states cost less than four
ACCELERATIONS = 9  # tried between the least and the largest
PACE = 1.0  # steps in the time of a fast rise, for each node to the power 2/3: they err with dt, cells with their size
STUCK_VALUE = -1e3  # m: value of a state from which the leg cannot go on
STANCE_SHARES = (1.0, 0.75, 0.5, 0.35, 0.25)  # of the longest stance, for which rollouts are made
METHOD = "dynamic programming over height and speed"


def search_slider(
    design: Design, size: int, rollouts: int, threads: int, progress: Callable[[str], None] | None, until: Deadline
) -> GlobalSearch:
    """Value and rollouts; ``threads`` changes nothing here. TimeoutError if that has not ended by ``until``."""
    found = _Slider.of(design, NODES_FACTOR * size)
    layers = found.layers(progress, until)
    start = start_place(design)[1]
    made = [found.rollout(layers, start, share) for share in STANCE_SHARES]
    best = different(sorted((r for r in made if r is not None), key=lambda r: -r.clearance))
    value = float(found.look_up(np.array(start), np.array(0.0))(layers[-1])) - found.tuck
    return GlobalSearch(METHOD, found.apex.shape, len(layers) - 1, value, tuple(best[:rollouts]), 0.0)


@dataclass(frozen=True)
class _Slider:
    """The grid: heights leg.y, and at each the same shares of the fastest speed there.

    share: of the fastest speed (k,)
    fastest: (m,) [m/s]
    apex: of the centre of mass for lift-off at once (m, k) [m]
    least, largest: accelerations (m, k) [m/s^2]
    dt: step [s]
    duration: shortest and longest stance [s]
    tuck: centre of mass above the lowest point, tucked [m]
    descent: whether the body may descend
    """

    leg: SliderLeg
    share: np.ndarray
    fastest: np.ndarray
    apex: np.ndarray
    least: np.ndarray
    largest: np.ndarray
    dt: float
    duration: tuple[float, float]
    tuck: float
    descent: bool

    @classmethod
    def of(cls, design: Design, nodes: int) -> "_Slider":
        """The grid of a problem, nodes x nodes."""
        leg, share = slider_leg(design, nodes), np.linspace(-1.0, 1.0, 2 * (nodes // 2) + 1)
        parameters, c = build_robot(design.leg).parameters, stance_constants(design)
        regions = [operating_region(design.leg, joint, parameters) for joint in design.leg.joints]
        speeds = np.array([np.abs(region.corners()[:, 0]).max() for region in regions])
        fastest = np.min(speeds / np.maximum(np.abs(leg.dq), 1e-9), axis=1)
        v = fastest[:, None] * share
        apex = leg.com[:, None] + np.maximum(leg.dcom[:, None] * v, 0.0) ** 2 / (2 * c.gravity)
        longest = design.hop.stance_duration[1]
        crossing = (leg.y[-1] - leg.y[0]) / float(np.median(fastest))  # [s], from the lowest to the highest
        steps = max(4, round(PACE * longest / max(crossing, 1e-3) * nodes ** (2 / 3)))
        return cls(
            leg, share, fastest, apex, *accelerations(design, leg, v), longest / steps, design.hop.stance_duration,
            tuck_height(c, design.hop.foot_window), design.hop.counter_movement,
        )  # fmt: skip

    def layers(self, progress: Callable[[str], None] | None, until: Deadline) -> list[np.ndarray]:
        """Greatest apex of the centre of mass [m] by the number of steps left."""
        v = self.fastest[:, None] * self.share
        a = self._tried(self.least, self.largest)
        look_up = self.look_up(*self._after(self.leg.y[:, None, None], v[..., None], a))
        layers = [self.apex]
        for k in range(1, round(self.duration[1] / self.dt) + 1):
            if until.passed:
                raise TimeoutError
            ahead = look_up(layers[-1]).max(axis=-1)
            layers.append(np.maximum(ahead, self.apex) if self._may_leave(k) else np.maximum(ahead, STUCK_VALUE))
        if progress:
            progress(f"global search: {len(layers) - 1} steps")
        return layers

    def _may_leave(self, left: int) -> bool:
        return self.duration[1] - left * self.dt >= self.duration[0] - 1e-9

    def _tried(self, least: np.ndarray, largest: np.ndarray) -> np.ndarray:
        return least[..., None] + (largest - least)[..., None] * np.linspace(0, 1, ACCELERATIONS)

    def _after(self, y: np.ndarray, v: np.ndarray, a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Heights and speeds a step on; nan where the body would descend and may not."""
        then = v + a * self.dt
        return y + v * self.dt + 0.5 * a * self.dt**2, then if self.descent else np.where(then < 0, np.nan, then)

    def look_up(self, y: np.ndarray, v: np.ndarray) -> Bilinear:
        """What reads a layer at heights [m] and speeds [m/s]."""
        return Bilinear(self.leg.y, self.share, y, v / np.interp(y, self.leg.y, self.fastest), STUCK_VALUE)

    def rollout(self, layers: list[np.ndarray], start: float, share: float) -> Rollout | None:
        """Greedy by value within a share of the longest stance; None if it leads nowhere."""
        left = max(round(share * (len(layers) - 1)), 2)
        y, v, path = start, 0.0, []
        for k in range(left, 0, -1):
            here = self.look_up(np.array(y), np.array(v))
            a = self._tried(here(self.least), here(self.largest))
            ends = self._after(np.array(y), np.array(v), a)
            values = self.look_up(*ends)(layers[k - 1])
            best = int(np.argmax(values))
            may_leave = (left - k) * self.dt >= self.duration[0] and len(path) > 1
            if values[best] <= STUCK_VALUE or (may_leave and here(self.apex) >= values[best] - 1e-9):
                break
            path.append((y, v, float(a[best])))
            y, v = float(ends[0][best]), float(ends[1][best])
        if len(path) < 2:
            return None
        clearance = float(self.look_up(np.array(y), np.array(v))(self.apex)) - self.tuck
        return self._in_joints(np.array([*path, (y, v, path[-1][2])]), clearance)

    def _in_joints(self, path: np.ndarray, clearance: float) -> Rollout:
        """The joints' motion for the body's height, speed and acceleration (m, 3)."""
        y, v, a = path.T
        q, dq, ddq = (
            np.stack([np.interp(y, self.leg.y, column) for column in table.T], axis=1)
            for table in (self.leg.q, self.leg.dq, self.leg.ddq)
        )
        joint_v, joint_a = dq * v[:, None], dq * a[:, None] + ddq * v[:, None] ** 2
        return Rollout(np.arange(len(path)) * self.dt, q, joint_v, joint_a, clearance)
