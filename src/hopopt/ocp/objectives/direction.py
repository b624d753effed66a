"""Whether more or less of something is better: the only place where ``maximize`` becomes a sign."""

from typing import Any


def sign(maximize: bool) -> float:
    """1 where more is better, -1 where less is: the one place where that becomes a number."""
    return 1.0 if maximize else -1.0


class Directed:
    """Something of which more is better, or less: what has a field ``maximize``."""

    maximize: bool

    @property
    def sign(self) -> float:
        """1 where more is better, -1 where less is."""
        return sign(self.maximize)

    def signed_value(self, value: Any) -> Any:
        """The value with the sign by which more is better; of a signed value, the value."""
        return self.sign * value

    def cost(self, value: Any) -> Any:
        """Less is better, as the solver has it; of a cost, the value."""
        return -self.sign * value
