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
# # Which motor, gear and supply?
#
# A leg of your own is drawn, its drives are not bought yet. Which motor with which gear lifts the foot by 0.35 m, how heavy
# are they, and what must the supply give? `docs/actuators.md` says what the catalogue holds and how far to trust it.

# %%
import tempfile

import hopopt as ho

LEG = {
    "name": "my_leg",
    "title": "My leg",
    "leg.thigh.length": 0.3,
    "leg.shank.length": 0.3,
    "leg.thigh.mass": 0.6,
    "leg.shank.mass": 0.3,
    "leg.body.mass": 6.0,
    "start.hip_height": 0.3,
    "hop.stance_duration": [0.03, 0.2],
}
leg = ho.load("paper", LEG)

# %% [markdown]
# ## Every pair
#
# `choose` puts each motor with each gear on the leg. The body carries what they weigh: its 6 kg count 2.4 kg of drives, and
# new ones take their place. `only` keeps this page short; without it all of the catalogue is tried. The first is verified
# as a single solve is, the others are preliminary: of the first mesh alone.

# %%
ONLY = ["maxon-ec60-flat-*", "mini-cheetah", "unitree-go2", "maxon-gp52c-12", "apex-af042-20", "csf-17-50"]
found = ho.choose(leg, 0.35, only=ONLY, present_mass=2.4, verify=1, results=tempfile.mkdtemp())
assert found.exit_code == 0  # one clears and is verified
columns = ["outcome", "mass", "clearance", "state", "peak_power", "lacks"]
found.to_dataframe()[columns].round(3)

# %% [markdown]
# What does height cost in mass? The steps join the pairs that none lighter clears more than.

# %%
found.plot("mass")

# %% [markdown]
# And in power? What the drives give together at most, the supply must give at least, and the heat of the windings too.

# %%
found.plot("peak_power")

# %% [markdown]
# ## The leg with the lightest
#
# `problem()` is the leg with the first of them. `hopopt choose --write leg.toml` writes it as a file.

# %%
chosen = found.problem()
motor, gear = chosen.leg.motor, chosen.leg.gear
print(f"{motor.catalogue} with {gear.catalogue}: {gear.ratio:g} to 1, the body weighs {chosen.leg.body.mass:.2f} kg")

# %% [markdown]
# ## How little supply is enough?
#
# The power that the supply lets through is an entry of the problem, so it can be varied. The voltage is the motor's own.

# %%
peak = found.clearing[0].peak_power
caps = [round(share * peak) for share in (0.4, 0.8, 1.2, 1.6)]
fed = ho.load("paper", LEG | {
    "leg.motor": motor.catalogue, "leg.gear": gear.catalogue, "leg.body.mass": chosen.leg.body.mass,
    "supply.voltage": motor.voltage or 48.0, "supply.power_cap": caps[-1],
})  # fmt: skip
study = ho.sweep(fed, {"supply.power_cap": caps}, starts=2, results=tempfile.mkdtemp())
assert study.verified
study.plot("study")

# %% [markdown]
# A supply that lets through no more than the peak of the drives still costs height: the heat of the windings is drawn
# from it too. Where the curve gets flat, only another motor or gear buys height.
