"""Ends a solve that leads nowhere, and keeps the best iterate of one that never settles."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from hopopt.nlp.solver.ipopt import NlpSolution
from hopopt.nlp.solver.known_optima import KnownOptima

HOPEFUL, KEPT = 1e-3, 1e-5  # largest scaled violation of a row of an iterate that gives hope, and of one that is kept
PATIENCE = 60  # iterations; of 52 pairs of a motor and a gear with a hop all but one of 6 mm gave hope within 20


class Patience(KnownOptima):
    """Stops besides where so many iterations have given no hope of an objective below 0, the objective being minimised.

    best: scaled variables, objective and rows of the best iterate of the last solve that keeps the rows, or None
    """

    def begin(self) -> None:
        """Forget the last solve."""
        super().begin()
        self.best: tuple[np.ndarray, float, np.ndarray] | None = None
        self._hope, self._count = False, 0

    def stops(self, values: Mapping[str, Any]) -> bool:
        """Whether this iterate is near a known optimum, or none so far gives hope."""
        g, f = np.array(values["g"]).ravel(), float(values["f"])
        violation = np.maximum(self.low_g - g, g - self.high_g).max(initial=0.0)
        self._hope, self._count = self._hope or (violation < HOPEFUL and f < 0), self._count + 1
        if violation < KEPT and f < (0.0 if self.best is None else self.best[1]):
            self.best = np.array(values["x"]).ravel(), f, g
        return super().stops(values) or (not self._hope and self._count >= PATIENCE)

    def settled(self, s: NlpSolution) -> NlpSolution:
        """A solve's end, or of one that neither settled nor ran into a known optimum its best iterate, if there is one."""
        if s.success or self.found is not None or self.best is None:
            return s
        z, f, g = self.best
        t = s.transcription
        phases, parameters = t.unpack(z, s.p)
        return replace(
            s, z=z, g=g, phases=phases, parameters=parameters, objective=t.problem.objective.cost(f), success=True
        )
