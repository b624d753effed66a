"""What feeds the motors."""

from hopopt.design.fields import Section, choice, quantity


class Supply(Section):
    """What the motors of a leg are fed from; also written as the table [supply] of the file."""

    voltage: float = quantity("open-circuit voltage", "V", 1.0, 1000, physical=True)
    internal_resistance: float = quantity("of battery and wires", "ohm", 0.0, 100, 0.0, physical=True)
    count: float = quantity("equal supplies side by side", "1", 0.1, 100, 1.0, physical=True)
    legs: float = quantity(
        "equal legs that push together from it (default: as many as carry the body)", "1", 1, 100, 1.0, physical=True
    )
    least_voltage: float | None = quantity(
        "at its terminals, below which boards reset", "V", 0.5, 1000, None, physical=True
    )
    current_cap: float | None = quantity("greatest current of each supply", "A", 0.01, 1e4, None, physical=True)
    power_cap: float | None = quantity("greatest power of each supply", "W", 0.1, 1e6, None, physical=True)
    recuperation: bool = choice("whether it takes back what the motors together feed back", False)
