"""What must hold between answers: an entry that only relaxes the problem cannot make the best hop worse."""

from collections.abc import Sequence

import numpy as np

from hopopt.design.drives.motor import LINEAR

CONTRADICTING_GAIN = (
    1e-4  # relative: a point with tighter limits that is so much better shows that another is not the best
)
# Which way an entry relaxes the problem, by the end of its name; joints' and motors' own entries end alike. Speeds and
# torques of drives count for all laws; a gear's ratio, masses and lengths do both.
RELAXING = {
    "contact.friction": 1, "contact.least_force": -1, "hop.stance_duration[1]": 1, "hop.stance_duration[0]": -1,
    "hop.flight_duration[1]": 1, "hop.flight_duration[0]": -1, "hop.foot_window": 1, "hop.least_height": -1,
    "hop.clearance": -1, "motor.max_torque": 1, "motor.max_speed": 1, "motor.torque_cap": 1, "gear.torque_cap": 1,
    "motor.max_force": 1, "motor.max_velocity": 1, "motor.force_cap": 1, "gear.speed_cap": 1, ".upper": 1, ".lower": -1,
    "hop.touchdown_loss": 1, "hop.touchdown_impulse": 1,
    "hop.touchdown_speed": 1, "hop.touchdown_gear_torque": 1, "hop.touchdown_time": 1, "hop.landing_duration[1]": 1,
    "hop.landing_duration[0]": -1,
}  # fmt: skip


def direction(entry: str, objective: str = "clearance") -> int:
    """1 if more of the entry relaxes the problem, -1 if less does, 0 if neither is certain."""
    if entry.endswith((*LINEAR, *LINEAR.values(), "cap")) and objective in ("peak_torque", "saturation"):
        return 0  # such objectives are relative to the drive itself
    return next((sign for end, sign in RELAXING.items() if entry.endswith(end)), 0)


def contradicted(
    entries: Sequence[str], points: np.ndarray, signed_value: np.ndarray, objective: str = "clearance"
) -> dict[int, list[int]]:
    """Rows that are worse than a row of tighter or equal limits, and those rows, the best first.

    entries: names of the columns; points (n, d): their values; signed_value (n,): more is better, nan where there is none.
    """
    signs = np.array([direction(entry, objective) for entry in entries])
    found: dict[int, list[int]] = {}
    for k, row in enumerate(points):
        ahead = (row - points) * signs  # how far this row's limits are wider
        wider = np.all(np.where(signs == 0, points == row, ahead >= 0), axis=1) & np.any(points != row, axis=1)
        own = signed_value[k] if np.isfinite(signed_value[k]) else -np.inf
        better = wider & (
            signed_value > own + CONTRADICTING_GAIN * np.abs(np.where(np.isfinite(signed_value), signed_value, 0.0))
        )
        if better.any():
            where = np.flatnonzero(better)
            found[k] = [int(g) for g in where[np.argsort(-signed_value[where], kind="stable")]]
    return found
