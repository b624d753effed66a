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
# # How high can it keep hopping?
#
# One push from rest is half of the question. A robot hops on: it lands, gives way, and pushes again. This notebook asks how
# high the paper's leg can keep hopping, what a landing costs, and whether the paper's controllers really hop continuously.
#
# How long a solve takes: `docs/performance.md`.

# %%
import pandas as pd

import hopopt as ho

GROUND = {"contact.friction": 0.6}
single = ho.solve(ho.load("paper", GROUND), starts=2)
orbit = ho.solve(ho.load("paper", {**GROUND, "hop.kind": "periodic"}), starts=2)
landed = ho.solve(ho.load("paper", {**GROUND, "hop.kind": "landing", "hop.touchdown_loss": 1.0}), starts=2)
assert all(s.verified for s in (single, orbit, landed))

pd.DataFrame({
    "clearance [m]": {"from rest": single.clearance, "landed, at rest": landed.clearance, "hop after hop": orbit.clearance},
    "lasts [s]": {"from rest": single.end, "landed, at rest": landed.end, "hop after hop": orbit.end},
    "impact [J]": {
        "landed, at rest": landed.summary.landing.impact_loss_J, "hop after hop": orbit.summary.orbit.impact_loss_J,
    },
}).round(3)  # fmt: skip

# %% [markdown]
# The hop that repeats itself ends where it began, so it cannot lean and drift as the hop from rest does. The one that is
# landed may lose 1 J at touchdown at most. Both are optima of one program with an impact in it, verified by
# Pinocchio's impulse dynamics.

# %%
landed.plot("heights")

# %%
landed.plot("ground_force")

# %% [markdown]
# ## The cycle, and controllers that keep it up
#
# `track` follows a periodic optimum that keeps a little back from every limit. It begins 2 cm too high. The paper's force
# control with a full tuck begins at rest, as its robot does. Each does a dozen hops on the simulated leg, with encoders,
# saturated motors and a foot that may slip.

# %%
c = orbit.compare_hops("track", "force_tuck", hops=12)
rows = {name: c.row(name) for name in c.hops}
pd.DataFrame({
    "keeps up [m]": {name: row["kept_m"] for name, row in rows.items()},
    "share of the bound": {name: row["share_of_bound"] for name, row in rows.items()},
    "moves in a hop [m]": {name: row["drift_m_per_hop"] for name, row in rows.items()},
    "multiplier": {name: h.stable.largest if h.stable else None for name, h in c.hops.items()},
}).round(3)  # fmt: skip

# %%
c.plot("clearances")

# %%
c.plot("orbit")

# %% [markdown]
# The multiplier is the factor by which a small error grows from one hop to the next (Floquet). All are far below 1: errors die
# out, and the paper's controllers do hop continuously. They do not hop in place, though: they drift.

# %% [markdown]
# `hopopt solve --hop periodic`, `--hop landing` and `hopopt compare --hop periodic` do the same at the command line;
# `docs/periodic.md` and `docs/landing.md` have the equations. `--objective obstacle` asks over what box the leg hops.
