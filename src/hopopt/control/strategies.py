"""Strategies by name: built in, from another package's entry points, or a class given as ``package.module:Class``."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from importlib.metadata import entry_points
from typing import Any

import numpy as np

from hopopt.control.counter_movement import CounterMovement
from hopopt.control.paper_pd import Force, Position
from hopopt.control.setting import Setting
from hopopt.control.tracking.receding_horizon import TrackWithinLimits
from hopopt.control.tracking.track import Track
from hopopt.errors import UsageError
from hopopt.extensions import Registry, function, hand_over, known, origin
from hopopt.sim.controller import Controller, Measurement
from hopopt.user_code import last_line, load

SOFT = 180.0  # [N m/rad] the paper prints no gain for position control; `hopopt calibrate --free position.k_p=...`
BEST = {  # found by `hopopt tune --evaluations 60` (seed 0) on problems/paper.toml, with retraction tuck
    "force": {"k_p": 8974.0, "k_d": 3.5, "k_s": 2809.0},
    "position": {"k_p": 2107.0, "k_d": 2.1, "k_s": 4403.0},
}
TUCK, BRAKED = {"retraction": "tuck"}, {"flight": "braked"}
ENTRY_POINT_GROUP = "hopopt.strategies"  # entry points of other packages


@dataclass(frozen=True)
class Strategy:
    """A way to make controllers: its name, what it is in words, its maker and the maker's settings."""

    name: str
    meaning: str
    make: Callable[[Setting], Controller]
    options: Mapping[str, Any] = field(default_factory=dict)
    needs_plan: bool = False

    def controller(self, setting: Setting) -> Controller:
        """A fresh controller; the setting's own options go before the strategy's. UsageError for unusable ones."""
        try:
            return self.make(replace(setting, options={**self.options, **setting.options}))
        except UsageError as error:
            raise UsageError(f"strategy {self.name}: {error}") from None


@dataclass(frozen=True)
class Guarded:
    """A controller of the user's that was given by name: what it raises, or gives in place of torques, is said in a sentence."""

    name: str
    controller: Controller

    def torque(self, now: Measurement) -> np.ndarray:
        """Its torques [N m]; UsageError for whatever its code raises."""
        try:
            return np.asarray(self.controller.torque(now), dtype=float)
        except Exception as error:
            words = f"torque(now) stopped with {type(error).__name__}: {last_line(error)}"
            raise UsageError(f"strategy {self.name}: {words}") from error


BUILT_IN: Registry[Any] = Registry(
    "strategy",
    {
        s.name: s
        for s in (
            Strategy("force", "the paper's force control with motor saturation", Force),
            Strategy("force_braked", "the same, its reference followed in flight without overshoot", Force, BRAKED),
            Strategy("force_tuck", "the paper's force control, then a full tuck", Force, TUCK),
            Strategy("position", "the paper's position control", Position),
            Strategy("position_soft", "the same, as soft as fits the paper's figures", partial(Position, k_p=SOFT)),
            Strategy("position_tuck", "the paper's position control, then a full tuck", Position, TUCK),
            Strategy(
                "force_tuned", "force_tuck with gains tuned on the paper's leg", partial(Force, **BEST["force"]), TUCK
            ),
            Strategy("position_tuned", "position_tuck with such gains", partial(Position, **BEST["position"]), TUCK),
            Strategy("counter_movement", "down first, then force control up, then a full tuck", CounterMovement, TUCK),
            Strategy("track", "the optimum tracked, LQG feedback", Track, needs_plan=True),
            Strategy(
                "track_mpc",
                "the optimum tracked within all limits, a receding horizon",
                TrackWithinLimits,
                needs_plan=True,
            ),
            Strategy("track_pd", "the optimum tracked, PD feedback", Track, {"feedback": "pd"}, needs_plan=True),
        )
    },
)


def named(strategy: str | type) -> str:
    """The name of a strategy, or of a class of the user's own, which may be found by it from now on; UsageError for others."""
    if isinstance(strategy, str):
        return strategy
    if not (isinstance(strategy, type) and callable(getattr(strategy, "torque", None))):
        raise UsageError(f"{strategy!r:.80} is no strategy: give its name, or a class with a method torque(now)")
    name = f"{strategy.__module__}:{strategy.__qualname__}"
    hand_over(name, strategy)
    return name


def find(name: str) -> Strategy:
    """The strategy called ``name``; UsageError, with what there is, if it cannot be found."""
    if name in BUILT_IN:
        found = BUILT_IN[name]
        return found if isinstance(found, Strategy) else _others(name, f"from {origin('strategy', name)}", found)
    if ":" in name:
        return _others(name, "your own strategy", function(name) if known("function", name) else _load(name))
    others = {e.name: e for e in entry_points(group=ENTRY_POINT_GROUP)}
    if name in others:
        return _others(name, f"from {others[name].value}", others[name].load())
    if known("strategy", name):
        return find(name)
    raise UsageError(
        f"there is no strategy {name!r}: choose one of {', '.join([*BUILT_IN, *others])}, "
        "give the module that has it with --with, or a class of your own as package.module:Class"
    )


def _others(name: str, meaning: str, made: Any) -> Strategy:
    """A strategy that is not built in; it asks for a planned hop by an attribute ``needs_plan`` that is true."""

    def make(setting: Setting) -> Controller:
        try:
            return Guarded(name, made(setting))
        except UsageError:
            raise
        except Exception as error:
            words = f"it cannot be made from a Setting ({type(error).__name__}: {last_line(error)})"
            raise UsageError(f"{words}: see hopopt.control.setting") from error

    return Strategy(name, meaning, make, needs_plan=bool(getattr(made, "needs_plan", False)))


def _load(path: str) -> Any:
    try:
        found = load(path)
    except UsageError as error:
        raise UsageError(f"strategy {error}") from None
    if not callable(getattr(found, "torque", None)):
        raise UsageError(
            f"strategy {path}: {path.partition(':')[2]} has no method torque(now): see hopopt.control.setting"
        )
    return found
