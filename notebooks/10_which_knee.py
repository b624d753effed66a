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
# # Which knee would I build?
#
# A knee can have its motor on the joint, or on the body with rods that carry its torque down. A crank or a linear actuator
# changes the ratio as the leg opens, and a spring can lie beside it. Each is said to jump higher. Here they stand side by side
# on one leg, with the same motors, on ground that holds the foot. Every number is a verified optimum, of one start each: a
# fuller search may find more. `docs/transmissions.md` has the equations.

# %%
import matplotlib.pyplot as plt
import numpy as np

import hopopt as ho

KNEE = "leg.knee.transmission"

# %% [markdown]
# ## The knees
#
# The falling ratio is 100 in the middle of the knee's range and falls by a fifth for each radian that the knee opens. The four-bar has a
# crank that is longer than its arm, and a ratio that rises. The spring pushes the knee open from angles below its rest angle of -1 rad.

# %%
MIDDLE = -1.3  # [rad]
KNEES = {
    "on the joint": {},
    "parallel rods": {f"{KNEE}.coupling.hip.ratio": 1.0},
    "falling ratio": {f"{KNEE}.linear": {"slope": -0.2, "at": MIDDLE}},
    "four-bar": {
        f"{KNEE}.four_bar": {"ground": 0.3, "crank": 0.06, "rod": 0.3, "arm": 0.05, "stretched": MIDDLE - np.pi / 2}
    },
    "spring": {"leg.spring.knee.stiffness": 20.0, "leg.spring.knee.rest_angle": -1.0},
}
legs = {name: ho.load("paper", knee) for name, knee in KNEES.items()}

# %% [markdown]
# What each clears, and which ratio the knee's motor meets in its hop:

# %%
hops = {name: ho.solve(leg, starts=1, processes=1) for name, leg in legs.items()}
assert all(hop.verified for hop in hops.values())
for name, hop in hops.items():
    print(f"{name:15s} {hop.clearance:.3f} m, lift-off at {hop.summary.lift_off.vertical_m_s:.2f} m/s")

# %%
figure, ax = plt.subplots(figsize=(9, 5))
for name, hop in hops.items():
    s = hop.sample(np.linspace(0, hop.lift_off - 1e-6, 400))
    moves = np.abs(s.v[:, 3]) > 0.5
    ax.plot(s.q[moves, 3], 100 * s.w[moves, 1] / s.v[moves, 3], ".", ms=3, label=name)
ax.set(xlabel="knee angle [rad]", ylabel="turns of the motor for one of the knee in this hop [1]", ylim=(0, 220))
ax.legend(frameon=False, markerscale=4)
plt.close(figure)
figure

# %% [markdown]
# With parallel rods the motor turns with the shank against the body. While the leg opens the hip turns back, so the knee's motor
# turns about half as far, and both motors push the body up. So the same motor meets a lower ratio where it needs speed.

# %%
figure, ax = plt.subplots(figsize=(9, 4))
names, heights = list(hops), [hop.clearance for hop in hops.values()]
bars = ax.barh(names, heights, color=["0.6", "#0072B2", "#D55E00", "#E69F00", "#009E73"])
ax.bar_label(bars, [f"{h:.3f} m" for h in heights], padding=4)
ax.invert_yaxis()
ax.set(xlabel="clearance [m]", xlim=(0, 1.15 * max(heights)))
plt.close(figure)
figure

# %% [markdown]
# ## Is it the law, or only the lower ratio?
#
# A fair comparison lets every knee have its own best gear. The slope of the falling ratio is free as well.

# %%
own = {"leg.knee.gear.ratio": 100.0}
gears = {"leg.knee.gear.ratio": (25, 150)}
best = {
    "on the joint": ho.solve(ho.load("paper", own), free=gears, starts=1, processes=1),
    "falling ratio": ho.solve(
        ho.load("paper", {**own, **KNEES["falling ratio"]}),
        free={**gears, f"{KNEE}.linear.slope": (-0.7, 0.7)}, starts=1, processes=1,
    ),
    "parallel rods": ho.solve(
        ho.load("paper", {**own, **KNEES["parallel rods"]}), free=gears, starts=1, processes=1
    ),
}  # fmt: skip
assert all(hop.verified for hop in best.values())
for name, hop in best.items():
    chosen = ", ".join(f"{p.entry} {p.optimal:.3g}" for p in hop.summary.codesign.parameters)
    print(f"{name:15s} {hop.clearance:.3f} m with {chosen}")

# %%
figure, ax = plt.subplots(figsize=(9, 4))
y = np.arange(len(best))
ax.barh(y - 0.2, [hops[name].clearance for name in best], 0.38, color="0.7", label="with the gear of 100")
ax.barh(y + 0.2, [hop.clearance for hop in best.values()], 0.38, color="#0072B2", label="with the best gear of each")
ax.set_yticks(y, list(best))
ax.invert_yaxis()
ax.set(xlabel="clearance [m]")
ax.legend(frameon=False, loc="upper center", bbox_to_anchor=(0.5, 1.15), ncols=2)
plt.close(figure)
figure

# %% [markdown]
# ## With a real gear and battery
#
# A gear that loses a tenth, and a battery that sags. These two take most of the six minutes of this notebook:

# %%
REAL = {"leg.gear.efficiency": 0.9, "supply.voltage": 48.0, "supply.internal_resistance": 0.02}
for name in ("on the joint", "falling ratio"):
    hop = ho.solve(ho.load("paper", {**REAL, **KNEES[name]}), starts=1, processes=1)
    assert hop.verified
    print(f"{name:15s} {hop.clearance:.3f} m for {hops[name].clearance:.3f} m without losses")

# %% [markdown]
# ## What came out
#
# - Much of what a falling ratio or parallel rods bring with one gear is the lower ratio that they mean. A fixed ratio of 40 has most of it.
# - With the best gear of each, a falling ratio and parallel rods both bring 6 %, and losses leave the order as it is. A published leg gained 28 % in theory
#   (arXiv 2506.12314), from a baseline whose own ratio was not optimised first.
# - A spring at the knee stores what it is given at the start. It needs no motor, and its place is free.
# - Not shown: the mass of rods, cranks and springs, and what a landing asks of them.
