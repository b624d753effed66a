"""A spring between a drive and its joint: the table [leg.<joint>.series_spring]."""

from hopopt.design.fields import Section, quantity


class SeriesSpring(Section):
    """A spring in series with a drive, behind its gear, without mass."""

    stiffness: float = quantity(
        "torque for each radian by which the drive is ahead of its joint", "N m/rad", 0.1, 1e8, physical=True
    )
    damping: float | None = quantity(
        "torque for each rad/s by which the drive is faster than its joint (default: none)",
        "N m s/rad", 0, 1e6, None, physical=True,
    )  # fmt: skip
