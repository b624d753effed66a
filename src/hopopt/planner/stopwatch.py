"""Wall time by stage."""

import time


class Stopwatch:
    """Wall time by stage [s]."""

    def __init__(self) -> None:
        self.begin = self.last = time.perf_counter()
        self.stages: dict[str, float] = {}

    def mark(self, stage: str) -> None:
        """Add the time since the last mark to ``stage``."""
        now = time.perf_counter()
        self.stages[stage] = self.stages.get(stage, 0.0) + now - self.last
        self.last = now
