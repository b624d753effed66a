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
# # The leg and its hop, designed together
#
# So far the leg was given. Here some of its numbers are free: they become variables of the same optimisation, between
# bounds of ours, and the best leg comes out with its best hop. A total length of 0.741 m is to be divided between thigh
# and shank, and each joint may have a gear ratio of its own.
#
# How long a solve takes: `docs/performance.md`. The stance is kept to 0.2 s: one push, no pumping.

# %%
import pandas as pd

import hopopt as ho

ENTRIES = ["hop.stance_duration=[0.03, 0.2]", "leg.hip.gear.ratio=100", "leg.knee.gear.ratio=100"]
design = ho.load("paper", ENTRIES)
given = ho.solve(design, starts=2)
assert given.verified
print(f"the leg as it is: {given.clearance:.4f} m")

# %% [markdown]
# ## Free the numbers
#
# `free` states nothing on the optimiser's word: the design that comes out is solved again as any other problem, from
# its own starts, and verified.

# %%
lengths = {"leg.thigh.length": (0.33, 0.41), "leg.shank.length": (0.33, 0.41)}
ratios = {"leg.hip.gear.ratio": (80, 120), "leg.knee.gear.ratio": (80, 120)}
s = ho.solve(design, free=lengths | ratios, couple=["leg.thigh.length + leg.shank.length = 0.741"], starts=2)
assert s.verified
print(f"the leg that comes out: {s.clearance:.4f} m")

# %%
columns = ["entry", "was", "lower", "upper", "optimal", "unit", "at_bound"]
pd.DataFrame(s.summary.codesign.parameters)[columns].round(4)

# %% [markdown]
# Both gears are at the bound we gave them: that is an answer about the bound, not about the leg. (`03_gear_ratio` says why
# a smaller ratio clears more, and what a real gear makes of that.) The division of the length is a real optimum, inside
# its bounds.
#
# ## Is it one?
#
# Beside the best division, the link that is too short is worth more. At the best one, what one link gains the other loses
# at least. Limits trade places there, so that more and less of a link are worth different amounts: the optimum is a kink.
# The slopes come from the multipliers of single hops, each solved again, which know nothing of the co-design.


# %%
def row(hop: ho.Solution) -> dict[str, float]:
    """The division of the length, what it clears, and what a metre more of either brings, or a metre less costs."""
    found = {"thigh [m]": hop.design.leg.link["thigh"].length, "clearance [m]": hop.clearance}
    slopes = {i.name: i for i in hop.sensitivity()}
    for link in ("thigh", "shank"):
        i = slopes[f"leg.{link}.length"]
        found[f"more {link}"] = i.per_unit
        found[f"less {link}"] = i.per_unit if i.less_per_unit is None else i.less_per_unit
    return found


best = s.design.leg.link["thigh"].length
rows = {"the optimum": row(s)}
for name, thigh in {"5 mm less thigh": best - 0.005, "5 mm more thigh": best + 0.005}.items():
    divided = [f"leg.thigh.length={thigh}", f"leg.shank.length={0.741 - thigh}"]
    hop = ho.solve(ho.load("paper", [*ENTRIES, *divided, "leg.hip.gear.ratio=80", "leg.knee.gear.ratio=80"]), starts=2)
    assert hop.verified
    rows[name] = row(hop)
table = pd.DataFrame(rows).T.sort_values("thigh [m]")
table.round(4)

# %%
thigh_instead, shank_instead = table["more thigh"] - table["less shank"], table["more shank"] - table["less thigh"]
assert thigh_instead.iloc[0] > 0 > shank_instead.iloc[0]  # a thigh too short
assert thigh_instead.iloc[1] < 0 > shank_instead.iloc[1]
assert thigh_instead.iloc[2] < 0 < shank_instead.iloc[2]  # a shank too short
assert table["clearance [m]"].idxmax() == "the optimum"

# %% [markdown]
# What matters next, the tornado of the final leg shows:

# %%
s.plot("tornado")

# %%
s.plot("stick")

# %%
s.plot("operating_region")

# %% [markdown]
# What the co-design does not know: a longer link weighs the same here, and a motor of its own for each joint costs nothing.
# What a number costs belongs into the problem, as a bound, a coupling (`couple=[...]`) or a constraint of your own.
