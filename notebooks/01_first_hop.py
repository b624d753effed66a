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
# # A first hop
#
# How high can a leg possibly lift its foot in one hop, with the motors it has? This notebook finds the highest hop of
# the leg of arXiv 2107.13717, takes it apart, and says why the number can be believed.
#
# SI units throughout; *z* points up. How long a solve takes: `docs/performance.md`.

# %%
import numpy as np
import pandas as pd

import hopopt as ho

design = ho.load("paper")

# %% [markdown]
# A problem is data: a leg, its drives, where the hop starts and what counts as one. `hopopt show paper` prints all of it
# with units; here are the drives. None of the motor's values is printed in the paper, they are assumptions.

# %%
motor, gear = design.leg.motor, design.leg.gear
print(f"tau_max {motor.max_torque} N m, omega_max {motor.max_speed:.0f} rad/s, ratio {gear.ratio:g}")
print(f"so a joint gives {gear.ratio * motor.max_torque:.0f} N m at standstill, "
      f"and nothing at {motor.max_speed / gear.ratio:.1f} rad/s")  # fmt: skip

# %% [markdown]
# ## Solve
#
# `solve` poses the hop (stance, then flight to the apex) as an optimal control problem, solves it from several starting
# points, refines the mesh until the answer has settled, and checks it, most of it with code that the planner did not use.

# %%
s = ho.solve(design, objective="clearance", starts=3)
print(f"clearance {s.clearance:.4f} m, verified: {s.verified}")
assert s.verified

# %% [markdown]
# Clearance is the height of the leg's *lowest* point at the apex. It is a sum of three parts: how high the centre of
# mass is when the foot leaves the ground, how far it rises ballistically, and how far the leg still hangs below it
# at the apex.

# %%
lift_off, apex = s.sample(s.lift_off), s.sample(s.duration)
height = lift_off.points["com"][0, 1]
rise = lift_off.com_v[0, 1] ** 2 / (2 * 9.81)
below = apex.points["com"][0, 1] - apex.points["foot"][0, 1]
print(f"{height:.4f} + {rise:.4f} - {below:.4f} = {height + rise - below:.4f} m")

# %%
s.plot("heights")

# %% [markdown]
# ## What the leg does
#
# It does not just push. It swings forward until its knee is on the ground, comes back, and pushes off leaning. Given
# longer, it would swing again, so the longest stance (0.4 s) belongs to the number.

# %%
s.plot("stick")

# %%
s.plot("joints")

# %% [markdown]
# ## Where the motors are the limit
#
# Each joint's drive can give the torques and speeds inside its operating region. The optimum runs along its edge: here
# a stronger or faster motor would lift the foot higher.

# %%
s.plot("operating_region")

# %%
means = s.summary.saturation_mean
print("mean saturation in stance:", ", ".join(f"{joint} {share:.0%}" for joint, share in means.items()))

# %% [markdown]
# ## The plan in your own hands
#
# `sample` gives the whole leg at any time: positions, speeds, torques, the contact force, points of the leg. So any
# question can be asked of a hop. Does the work of the joints explain the height? From rest, the energy gained until
# lift-off must be the work of the torques.

# %%
t = np.linspace(0, s.lift_off - 1e-9, 20_001)
hop = s.sample(t)
power = np.sum(hop.tau * hop.v[:, 2:], axis=1)
work = np.sum((power[1:] + power[:-1]) / 2 * np.diff(t))

mass = design.leg.body.mass + sum(link.mass for link in design.leg.link.values())
lifted = mass * 9.81 * (hop.points["com"][-1, 1] - hop.points["com"][0, 1])
up, along = mass * hop.com_v[-1, 1] ** 2 / 2, mass * hop.com_v[-1, 0] ** 2 / 2
pd.Series({
    "work of the joints": work,
    "centre of mass lifted until lift-off": lifted,
    "its motion up, which becomes height": up,
    "its motion along, which does not": along,
    "motion about it and of the rotors, which does not": work - lifted - up - along,
}, name="J").round(1).to_frame()  # fmt: skip

# %%
assert work > lifted + up + along  # the centre of mass cannot have gained more than the joints gave

# %% [markdown]
# The ground carries nothing between two pushes, and yet the foot stays: the paper's ground is ideal and holds the foot
# along the ground even without load. The optimum uses that. `contact.friction` takes it away, at a cost in height and in
# solving effort.

# %%
s.plot("ground_force")

# %% [markdown]
# ## Why believe it?
#
# A solver that says "solved" is not evidence: on a coarse mesh it can claim more than the leg can do. So every hop is
# checked again, by replaying its torques in another dynamics library, by balances of energy and momentum, and at
# many places between the mesh points. A few checks are of the program itself (stationarity, local error). Here are the
# checks, the tightest first.

# %%
checks = pd.DataFrame(s.summary.verification)
checks["passed"] = [check.passed for check in s.summary.verification]
checks["share of what is allowed"] = checks["residual"] / checks["tolerance"]
columns = ["name", "residual", "tolerance", "unit", "share of what is allowed", "passed"]
checks.sort_values("share of what is allowed", ascending=False)[columns].head(8)

# %% [markdown]
# The optimum is the best of what the starting points led to, not a proven global one. How many ended where is part of
# the answer. The heights in this table are those of the *first*, coarse mesh, on which all starts are solved. Only the best
# hop is refined, so its height differs a little from the answer's, and the others are not verified.

# %%
first = pd.DataFrame(s.summary.starts.optima)
print(f"the answer, refined: {s.clearance:.4f} m; on the first mesh: {first['objective'].max():.4f} m")
first

# %% [markdown]
# ## What if?
#
# Any entry can be changed without touching the file. Half the time for the push, and no counter-movement:

# %%
quick = ho.solve(ho.load("paper", ["hop.stance_duration=[0.03, 0.2]"]), starts=2)
straight = ho.solve(ho.load("paper_no_countermovement"), starts=2)
for name, hop in {"stance up to 0.4 s": s, "up to 0.2 s": quick, "no counter-movement": straight}.items():
    print(f"{name:20s} {hop.clearance:.3f} m, verified: {hop.verified}")

# %% [markdown]
# Next: what controllers make of this bound (`02_pd_against_the_bound`), and which gear ratio is best
# (`03_gear_ratio`). `ho.save(s, "results")` keeps a hop; `ho.read(folder)` brings it back.
