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
# # What a controller can really reach
#
# The highest hop of an optimisation is true for a leg that is known exactly. No robot's leg is. This notebook goes from that
# number to one that 95 % of uncertain legs reach, on ground with a friction of 0.6, and asks why PD control is lower.
#
# How long a solve takes: `docs/performance.md`.

# %%
import pandas as pd

import hopopt as ho

bound = ho.solve(ho.load("paper", {"contact.friction": 0.6}), starts=2)
assert bound.verified
bound

# %% [markdown]
# ## A plan that uses every limit fully cannot be followed
#
# Here the tracker follows the bound's own motion with little held back, and its model is right. A true leg has masses that
# are off by up to 5 % and torque constants that are off by up to 10 %. Many such legs would fall.

# %%
tracked = bound.compare("track", "force_tuck")
pd.DataFrame({name: {"clearance [m]": f.clearance, "share of the bound": f.clearance / tracked.bound}
              for name, f in tracked.figures.items()}).T.round(3)  # fmt: skip

# %%
tracked.plot("foot_height")

# %% [markdown]
# `hopopt robust` finds a plan for such legs in two ways. One tunes what is held back from every limit, on a few drawn legs. The
# other is one program for several legs at once. They share torques and feedback, and all must reach the clearance. The better
# plan is judged on legs that neither has seen. What 95 % of all legs reach is then an order statistic (Wilks, 1941).

# %%
robust = ho.robust(bound, draws=60, evaluations=1, starts=2)
found = robust.as_dict()
pd.Series({
    "bound, ideal ground": found["ideal_bound_m"],
    "bound, this ground": found["bound_m"],
    "95 % of the legs, tracked": found["clearance_m"],
    **{f"95 % of the legs, {name}": clearance for name, clearance in found["pd"].items()},
}, name="clearance [m]").round(3)  # fmt: skip

# %%
pd.Series({**found["lowest_by_way_m"], "chosen": found["way"], "legs that fell": found["fell"]})

# %%
robust.plot()

# %% [markdown]
# The better way is the program. Its feedback is stiff, and its plan keeps only a third of the leg's weight on the ground.
# Knowledge of the leg is worth the rest: the distance from that curve to the bound of this ground.
#
# ## Why PD control is lower
#
# From PD to the bound by verified optima, each with one more freedom that PD does not use. What a freedom is worth depends on
# those that are there already. So there are three orders, and the black whiskers show the spread.

# %%
ladder = tracked.why()
ladder.plot()

# %%
assert ladder.verified
pd.DataFrame([vars(rung) for rung in ladder.rungs]).set_index("allows").round(3)

# %% [markdown]
# The body off the plumb line and a longer stance share most of it: either is worth little or much, depending on which comes
# first. Three centimetres need no freedom at all, only better control of what PD does already.
