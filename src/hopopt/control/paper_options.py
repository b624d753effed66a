"""The numbers of the paper's strategies: those of its tables, scaled to a leg, and what they leave open."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from hopopt.control.setting import Setting, one_of
from hopopt.control.similarity import scaled
from hopopt.control.two_mass import TwoMass
from hopopt.design import Design
from hopopt.errors import UsageError


@dataclass(frozen=True)
class PaperOptions:
    """Settings of the paper's tables (1 and 2) on the paper's leg, and what they leave open.

    k_p [N m/rad], k_d [N m s/rad]; k_s [N/m], the printed 17 read as N/cm; y_neu and C_amp [m], C_max [1];
    retraction: "reference" (y_f goes on in flight) or "tuck" (the pose that lifts the foot highest);
    stance: "reference" (y_s) or "step" (a step to the stretched leg);
    flight: "servo" (as fast as it can towards the reference) or "braked" (no faster than it can brake);
    plumb_k [1/s^2] and plumb_d [1/s] bring the body back to the plumb line.
    """

    k_p: float = 5424.0
    k_d: float = 9.0
    k_s: float = 1700.0
    y_neu: float = 0.45
    C_amp: float = 0.12
    C_max: float = 0.11
    retraction: str = one_of("reference", "tuck")
    stance: str = one_of("reference", "step")
    flight: str = one_of("servo", "braked")
    plumb_k: float = 400.0
    plumb_d: float = 40.0

    @classmethod
    def of(cls, design: Design, gains: Mapping[str, Any]) -> "PaperOptions":
        """For a leg: the printed ones, or these ``gains`` of the paper's leg, scaled to it; what the problem's
        [control] gives goes before the printed ones, unscaled."""
        own = {name: x for name, x in design.control.model_dump(exclude_none=True).items() if name not in gains}
        return replace(scaled(cls(**gains), design), **own)

    def two_mass(self, setting: Setting) -> TwoMass:
        """The reference model, with the body's and the last link's mass for m and m_e."""
        leg = setting.design.leg
        g = float(-setting.robot.model.gravity.linear[2])
        masses = {"m": leg.body.mass, "m_e": leg.link[leg.links[-1]].mass}
        try:
            model = TwoMass(**masses, k=self.k_s, l0=self.y_neu, C_amp=self.C_amp, C_max=self.C_max, g=g)
            model.t_lo  # noqa: B018  it has to lift off
            return model
        except ValueError as error:
            raise UsageError(str(error)) from None
