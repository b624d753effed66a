# ---
# jupyter:
#   jupytext:
#     formats: ipynb,py:percent
#     text_representation:
#       extension: .py
#       format_name: percent
#       format_version: '1.3'
#       jupytext_version: 1.19.6
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # Which gear ratio?
#
# The paper's leg has harmonic drives of 1:100. A larger ratio gives more torque and less speed, and the rotor's inertia
# at the joint grows with its square. Where is the best trade for a hop? And what remains of it with a gear that can be
# bought, which bears only so much torque and turns only so fast?
#
# How long a solve takes: `docs/performance.md`. The stance is kept to 0.2 s here: one push, no pumping.

# %%
import tempfile

import numpy as np
import pandas as pd

import hopopt as ho

ONE_PUSH = "hop.stance_duration=[0.03, 0.2]"
design = ho.load("paper", [ONE_PUSH])

# %% [markdown]
# ## The curve
#
# `sweep` solves and verifies every point as a single solve is. The first point is solved from several starts, the others
# from their neighbours. Do not save on `starts`: verified means that a hop is real, not that it is the best one. With
# one start and other ratios this study came out up to 10 cm lower, every point verified. A study that was stopped goes on
# where it was: `ho.sweep(..., resume=folder)`.

# %%
study = ho.sweep(design, {"leg.gear.ratio": "60,80,98,100,102,120,140"}, starts=3, results=tempfile.mkdtemp())
assert study.exit_code == 0  # every point verified
study.plot()["study"]

# %% [markdown]
# No trade: over this range the smaller ratio is better throughout. The motor's speed is what the push runs out of: at 1:100
# the joint can turn no faster than 12.6 rad/s, whatever the torque.
#
# ## The slope, for nothing
#
# The multipliers of one optimum already know how the height changes with every number of the problem. At 1:100, without
# solving again:

# %%
s = ho.solve(design, starts=2)
slopes = {i.name: i for i in s.sensitivity() if not i.part_of}
slope = slopes["leg.gear.ratio"].per_unit
print(f"at 1:100 {s.clearance:.4f} m, and {1000 * slope:+.2f} mm for one more turn of the motor")

# %%
figure = study.plot()["study"]
ax, here = figure.axes[0], np.array([80.0, 120.0])
look = {"color": "#D55E00", "lw": 2, "label": "slope at 1:100, from the multipliers"}
tangent = ax.plot(here, s.clearance + slope * (here - 100), **look)
ax.plot(100, s.clearance, "D", color="#D55E00", ms=9)
ax.legend(handles=tangent, loc="upper right", fontsize=13, frameon=False)
figure

# %% [markdown]
# The study solved 1:98 and 1:102 as well, and so says the same:

# %%
clearance = study.dataset.clearance_m
difference = float(clearance.sel({"leg.gear.ratio": 102}) - clearance.sel({"leg.gear.ratio": 98})) / 4
print(f"{1000 * difference:+.2f} mm for one more turn of the motor")
assert abs(difference - slope) < 0.01 * abs(slope)

# %% [markdown]
# And so for every other number: what would 1 % more bring?

# %%
s.plot("tornado")

# %% [markdown]
# ## A gear that can be bought
#
# The ideal gear above passes on 200 N m at up to 12 000 rpm. The catalogue (`hopopt actuators`) has real ones: limits of
# repeated peak torque and of input speed, and a wave generator that turns with the rotor. What is left?


# %%
def best(*changes: str) -> ho.Solution:
    """The best verified hop of this leg with some entries changed."""
    found = ho.solve(ho.load("paper", [ONE_PUSH, *changes]), starts=2)
    assert found.verified
    return found


def row(found: ho.Solution) -> dict[str, object]:
    gear, binding = found.design.leg.gear, found.summary.active_limits
    return {
        "clearance [m]": round(found.clearance, 3),
        "peak torque [N m]": gear.torque_cap,
        "joint speed [rad/s]": gear.speed_cap and round(gear.speed_cap / gear.ratio, 1),
        "input inertia [kg m^2]": gear.inertia,
        "active in stance": ", ".join(f"{name} {share:.0%}" for name, share in list(binding.items())[:3]),
    }


gears = {name: best(f"leg.gear={name}") for name in ("csg-17-100", "csg-25-100")}
pd.DataFrame({"ideal, 1:100": row(s)} | {name: row(found) for name, found in gears.items()}).T

# %% [markdown]
# Three times the torque rating gains nothing: the smaller gear is no worse, as it may turn faster and has less to turn. The
# larger one bears more torque than the motor gives. Which of its other numbers costs the height? Take them one at a time.

# %%
csg = gears["csg-25-100"].design.leg.gear
alone = {
    "input speed": f"leg.gear.speed_cap={csg.speed_cap}",
    "inertia of the wave generator": f"leg.gear.inertia={csg.inertia}",
}
lost = pd.Series({name: s.clearance - best(change).clearance for name, change in alone.items()})
lost["both"] = s.clearance - gears["csg-25-100"].clearance
(100 * lost).round(1).to_frame("height lost [cm]")

# %% [markdown]
# So the study of the ideal gear asks the right question, and the real gear sharpens the answer: speed, and what has to be
# turned to reach it. A gear's losses come on top: the planner's gears lose nothing, the simulated ones do
# (`leg.gear.efficiency`, see `docs/actuators.md`).
