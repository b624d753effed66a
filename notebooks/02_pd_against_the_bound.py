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
# # PD control against the bound
#
# The paper maximises foot clearance with feedback: a proportional-derivative law that saturates the knee through the whole
# push ("force control with motor saturation"), beside plain position control. How near do they come to what the leg
# could do? This notebook sets them beside the verified optimum of the same leg with the same motors, and beside that
# optimum tracked in closed loop.
#
# How long a solve takes: `docs/performance.md`.

# %%
import pandas as pd

import hopopt as ho

s = ho.solve(ho.load("paper"), objective="clearance", starts=2)
assert s.verified
print(f"the bound: {s.clearance:.3f} m")

# %% [markdown]
# Every strategy runs on a simulated leg with dynamics, ground and integrator of its own: 4 kHz control, 14-bit encoders,
# saturated motors, impacts, end stops. `track` follows a second optimum, which keeps a little back from every limit
# (`[reserve]` in the problem file), because on the limits themselves feedback has no room.

# %%
c = s.compare("track", "force", "force_tuck", "position", "position_tuck")
assert not c.beaten_by  # none passes the bound: else the bound would be wrong

rows = {name: c.row(name) for name in c.figures}
table = pd.DataFrame({
    "clearance [m]": {name: row["clearance_m"] for name, row in rows.items()},
    "share of the bound": {name: row["share_of_bound"] for name, row in rows.items()},
    "knee C_avg": {name: row["saturation_mean"]["knee"] for name, row in rows.items()},
    "hip C_avg": {name: row["saturation_mean"]["hip"] for name, row in rows.items()},
    "meaning": {name: row["meaning"] for name, row in rows.items()},
})  # fmt: skip
table.round(3)

# %%
c.plot("foot_height")

# %% [markdown]
# ## Saturating the knee is not the whole answer
#
# The paper's force control keeps the knee saturated through the push: C_avg is near 1, as the paper prints. The optimum
# does the opposite. Its *hip* is saturated nearly throughout, its knee uses less than half of what it could, on average.

# %%
c.plot("saturation")

# %%
c.plot("speed_torque")

# %% [markdown]
# ## What is missing
#
# Clearance is an exact sum: the height of the centre of mass at lift-off, its ballistic rise, and how far the leg hangs
# below it. So the gap to the bound splits into what the *push* loses, what the *timing* loses (the lowest point is
# highest before or after the apex), and what the *retraction* loses (the leg is not drawn up as far as it could be).

# %%
gaps = pd.DataFrame({name: c.gap(name) for name in c.runs}).T
gaps["sum"] = gaps.sum(axis=1)
for name in c.runs:
    assert abs(gaps.loc[name, "sum"] - (c.bound - c.figures[name].clearance)) < 1e-9
gaps.round(3)

# %%
c.plot("budget")

# %% [markdown]
# Drawing the leg fully up in flight (`force_tuck`) costs nothing and wins back the retraction. The rest is push.
#
# ## Most of the push is grip that no robot has
#
# The paper's ground is ideal: it holds the foot along the ground whatever the foot carries, and the optimum leans on that.
# Real ground does not. So here are the same strategies beside the optimum on ground with a friction of 0.6.

# %%
needs = s.summary.leans_on
print(
    f"the bound on ideal ground: {needs.load_free_share:.0%} of stance without load on the foot, and held sideways then"
)
rough = ho.solve(ho.load("paper", ["contact.friction=0.6"]), objective="clearance", starts=2)
assert rough.verified
r = rough.compare("track", "force", "force_tuck", "position", "position_tuck")
pd.DataFrame({
    "ideal ground [m]": {"the bound": c.bound, **{name: c.figures[name].clearance for name in c.runs}},
    "friction 0.6 [m]": {"the bound": r.bound, **{name: r.figures[name].clearance for name in r.runs}},
}).round(3)  # fmt: skip

# %% [markdown]
# The PD strategies hardly notice the friction, while the bound comes down to them. What is left is mostly lean: the optimum's body
# leaves the plumb line, which theirs may not. `hopopt compare --why` says what each freedom is worth (`docs/why_pd.md`).
#
# ## Beside the paper
#
# The paper's own figures: simulated and measured foot heights. Its motor's torque and speed are not printed, so they are
# assumed here, and its two strategies hop from assumed gains; `hopopt reproduce` and `docs/paper.md` go into that.

# %%
names = ["force", "position"]
pd.DataFrame({
    "here [m]": {name: rows[name]["foot_height_m"] for name in names},
    "paper, simulated [m]": {name: rows[name]["paper"]["foot_height_m"][0] for name in names},
    "paper, measured [m]": {name: rows[name]["paper"]["foot_height_m"][1] for name in names},
}).round(2)  # fmt: skip

# %% [markdown]
# ## How it looks

# %%
c.plot("stick")

# %% [markdown]
# A strategy of your own is a class with a method `torque(now)`: `s.compare("track", "my_module:MyController")`. See
# `docs/own_controller.md`.
