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
# # A paper's question anew: which gear heats its motors least?
#
# Seok and others (2015, doi:10.1109/TMECH.2014.2339013) name four principles for legged robots that waste little: motors of
# high torque density, drives that feed energy back, transmissions of low loss and legs of low inertia. Their MIT Cheetah has
# a single stage of a low ratio. At 6 m/s 76 % of what it takes from the battery becomes heat of the motors. That heat goes
# with the square of the motors' torque, and a low gear asks more torque of a motor. What does a low ratio cost one hop?
#
# This notebook asks it of hopopt's paper leg from beginning to end: an objective, a constraint, a number and a controller
# of our own, a map, a front, and a rule of the field beside them. On 28 November 2026 it took 82 s of processor time.

# %%
import casadi as ca
import matplotlib.pyplot as plt
import numpy as np

import hopopt as ho

# %% [markdown]
# ## The question
#
# The heat of a winding is the integral of its torque squared, over the square of the motor's constant. All motors here
# are alike. So we minimise the integral of the joints' torques squared over the whole hop, which must clear `hop.clearance`. The
# ratio squared then leads from joints to motors. The ground is soft: it bears so much force and no more, a number of our own.


# %%
@ho.objective(unit="N^2 m^2 s", maximize=False, running=True, clearance=True, scale=500.0)
def torque_squared(now):
    """What heats the motors, at the joints: a rate, integrated over the hop."""
    return ca.sumsqr(now.tau)


@ho.constraint(unit="N", scale=400.0, phases=("stance",))
def soft_ground(now):
    """The ground bears so much."""
    return now.p["bears"] - now.f[-1]


BEARS = {"parameters.bears": {"value": 400.0, "lower": 200.0, "upper": 2000.0, "unit": "N"}}
HOP = {"hop.stance_duration": [0.03, 0.2], "hop.clearance": 0.3}  # one push, no pumping
leg = ho.load("paper", {**BEARS, **HOP, "leg.gear.ratio": 110})

# %% [markdown]
# ## The map
#
# Two axes: the ratio, and what is to be cleared. One start, and every further point begins from its neighbours.

# %%
ratios, heights = [50, 80, 110, 140], [0.2, 0.3]
study = ho.sweep(
    leg, {"leg.gear.ratio": ratios, "hop.clearance": heights}, objective=torque_squared, constraints=[soft_ground],
    starts=1, processes=1,
)  # fmt: skip
assert study.verified  # every point
study.plot("study")

# %% [markdown]
# At the joints a larger ratio needs more: the rotors' inertia grows with its square, and has to be turned. At the motors the
# other half of the trade shows:

# %%
table = study.to_dataframe()
table["motor"] = table["objective_value"] / table["leg.gear.ratio"] ** 2  # [(N m)^2 s]
heat = table.pivot(index="leg.gear.ratio", columns="hop.clearance", values="motor")
heat.round(4)

# %% [markdown]
# ## A rule of the field
#
# Where a motion is given, the best ratio is known in closed form, as the matching of inertias (Pasch and Seering, 1984). The motor's
# torque is the load's over N, plus J N times the joint's acceleration. The integral of its square over the motion is least at the
# fourth root of the loads' squares over those of J times the accelerations. Take the motion of our optimum at 1:110:

# %%
s = ho.solve(leg, torque_squared, constraints=[soft_ground], starts=1, processes=1)
assert s.verified
t = np.linspace(0, s.end, 4001)
hop, rotor = s.sample(t), leg.leg.motor.rotor_inertia
acceleration = hop.a[:, 2:]
load = hop.tau - 110**2 * rotor * acceleration  # what the joints need without rotors
squares, turned = (np.trapezoid((x**2).sum(axis=1), t) for x in (load, rotor * acceleration))
cross = np.trapezoid((load * rotor * acceleration).sum(axis=1), t)
matched = (squares / turned) ** 0.25
N = np.linspace(45, 220, 100)
fixed = squares / N**2 + 2 * cross + turned * N**2
assert abs(np.interp(110, N, fixed) / heat.loc[110, 0.3] - 1) < 0.01  # the same motion, summed in another way
print(f"the motion at 1:110 would heat its motors least at 1:{matched:.0f}")

# %%
figure, ax = plt.subplots(figsize=(9, 5))
ax.plot(N, fixed, color="0.5", label="the motion of 1:110 with other gears: inertias matched at the cross")
ax.plot(matched, squares / matched**2 + 2 * cross + turned * matched**2, "x", color="0.3", ms=11, mew=2)
for height, colour in zip(heights, ("#0072B2", "#D55E00"), strict=True):
    ax.plot(heat.index, heat[height], "o-", color=colour, label=f"optimum of every gear, {height:g} m")
ax.set(xlabel="gear ratio [1]", ylabel="integral of the motors' torque squared [(N m)$^2$ s]", ylim=(0, None))
ax.legend(frameon=False)
plt.close(figure)
figure

# %% [markdown]
# The optima lie within a few per cent of the rule's curve, although each gear has a motion of its own. So the rule for a given
# motion is a good one here. From 1:140 to 1:50 the heat of the hop of 0.3 m grows by a factor of 4.7.
#
# The rule says 1:190, far above the Cheetah's low gear. It does not know speed: at 1:190 these motors turn a joint with 6.6 rad/s
# at most, without any torque. So it says where to look, and the map says what can be done there.
#
# Why then a low gear? Not for the heat of one hop: the gear alone makes that worse. The Cheetah pays for it with its motors, of a
# high torque for their mass, which are held fixed here. What it gains lies outside this question: less loss in the gear (ours is
# ideal), energy fed back, and little inertia when a foot strikes the ground. Our leg takes off once, from rest.

# %% [markdown]
# ## The front, and a controller of our own
#
# What does every clearance cost at least, with 1:110?

# %%
front = ho.pareto(leg, torque_squared, constraints=[soft_ground], points=4, lowest=0.2, starts=1, processes=1)
assert front.verified
front.plot()

# %% [markdown]
# Up to 0.59 m the price rises evenly. The last 9 cm cost six times as much: the highest hop does not save.
#
# Beside it a controller that knows nothing of heat: it pushes the ground straight down with a constant force, then folds the
# leg. Nothing holds its stance to 0.2 s.


# %%
class PushThenFold:
    """A constant push along the plumb line until lift-off, then back to the folded leg by PD."""

    def __init__(self, setting):
        leg = setting.design.leg
        self.lengths = [leg.link[name].length for name in leg.links]  # [m]
        self.folded, self.push = setting.start, setting.options["push"]  # [rad], [N]

    def torque(self, now):
        if not now.contact or now.landings:
            return 100.0 * (self.folded - now.q) - 6.0 * now.v
        angles = np.cumsum(now.q)  # of the links, from straight down [rad]
        x = np.sin(angles) @ self.lengths
        down, ahead = self.lengths * np.sin(angles), self.lengths * np.cos(angles)
        foot = np.array([[ahead.sum(), ahead[1]], [down.sum(), down[1]]])
        return -foot.T @ [2000.0 * x + 100.0 * (foot @ now.v)[0], self.push]


def simulated(push):
    """Clearance [m], the integral of the torques squared up to there [N^2 m^2 s], the peak of the ground force [N]."""
    run = ho.simulate(leg, PushThenFold, options={"push": push})
    trace, end = run.trace, run.figures.highest
    if end is None:
        return 0.0, np.nan, np.nan
    cost = np.trapezoid((trace.tau[: end + 1] ** 2).sum(axis=1), trace.t[: end + 1])
    return run.figures.clearance, cost, trace.f[:, -1].max()


pushes = (200.0, 250.0, 300.0, 350.0)
runs = np.array([simulated(push) for push in pushes])
for push, (clearance, cost, force) in zip(pushes, runs, strict=True):
    print(f"push {push:.0f} N: clears {clearance:.3f} m for {cost:.0f} N^2 m^2 s, peak force {force:.0f} N")

# %%
figure, ax = plt.subplots(figsize=(9, 5))

ax.plot(
    [p.clearance_m for p in front.points],
    [p.value for p in front.points],
    "o-",
    color="#0072B2",
    label="the least there is",
)
ax.plot(runs[:, 0], runs[:, 1], "s", color="#D55E00", label="push, then fold")
ax.set(xlabel="clearance [m]", ylabel="integral of the joints' torque squared [N$^2$ m$^2$ s]", ylim=(0, None))
ax.legend(frameon=False)
plt.close(figure)
figure

# %% [markdown]
# It stays below the force that the ground bears, and clears 0.5 m for 1.6 to 2 times what the line says. A harder push makes more heat and
# hardly any height.
#
# ## What came out
#
# - Seok and others measured heat as the largest loss of their robot. Here a low ratio makes it larger: 4.7 times from 1:140 to 1:50.
# - Both can hold: they chose motor and gear together, for running. Here the motor is given, for one hop. To follow it,
#   let the motor grow as the gear shrinks: `ho.choose`, as in `09_which_motor`, or `leg.motor` and `leg.body.mass` as further axes.
# - Not shown: losses of the gear, impacts, energy fed back, other starts. Each point here is one start's optimum, verified.
