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
# # Bring your own URDF
#
# A leg that exists as a URDF needs no table of lengths and masses: the problem names the file, the joints that move and
# the link that touches the ground. Drives come from the catalogue (`hopopt actuators`) or as numbers. This notebook writes
# a small leg to disk, as a stand-in for yours, hops it, and asks whether its drives are well chosen.
#
# How long a solve takes: `docs/performance.md`.

# %%
import tempfile
from pathlib import Path

import numpy as np
import pandas as pd
import pinocchio as pin

import hopopt as ho

folder = Path(tempfile.mkdtemp())

# %% [markdown]
# ## The robot
#
# A leg of three joints on a trunk, about as large as a small quadruped's. Its first joint swings sideways. It says what
# collides: a box for the trunk, cylinders for the links, a ball for the foot.

# %%
URDF = """
<robot name="test_leg">
  <link name="trunk">
    <collision> <origin xyz="0 0 0.03"/> <geometry> <box size="0.36 0.12 0.1"/> </geometry> </collision>
  </link>
  <joint name="hip_roll" type="revolute">
    <parent link="trunk"/> <child link="hip_bracket"/> <axis xyz="1 0 0"/>
    <limit lower="-0.8" upper="0.8" effort="24" velocity="30"/>
  </joint>
  <link name="hip_bracket">
    <inertial> <origin xyz="0 0.02 0"/> <mass value="0.68"/>
      <inertia ixx="5e-4" ixy="0" ixz="0" iyy="9e-4" iyz="0" izz="6e-4"/> </inertial>
  </link>
  <joint name="hip_pitch" type="revolute">
    <parent link="hip_bracket"/> <child link="thigh"/> <origin xyz="0 0.09 0"/> <axis xyz="0 1 0"/>
    <limit lower="-1.6" upper="0.6" effort="24" velocity="30"/>
  </joint>
  <link name="thigh">
    <inertial> <origin xyz="-0.004 -0.02 -0.03"/> <mass value="1.15"/>
      <inertia ixx="5.5e-3" ixy="0" ixz="3e-4" iyy="5.3e-3" iyz="0" izz="1.3e-3"/> </inertial>
    <collision> <origin xyz="0 0 -0.107"/> <geometry> <cylinder radius="0.02" length="0.15"/> </geometry> </collision>
  </link>
  <joint name="knee" type="revolute">
    <parent link="thigh"/> <child link="shank"/> <origin xyz="0 0 -0.213"/> <axis xyz="0 1 0"/>
    <limit lower="0.25" upper="2.6" effort="45" velocity="15"/>
  </joint>
  <link name="shank">
    <inertial> <origin xyz="0.006 0 -0.11"/> <mass value="0.17"/>
      <inertia ixx="1.1e-3" ixy="0" ixz="0" iyy="1.1e-3" iyz="0" izz="3e-5"/> </inertial>
    <collision> <origin xyz="0 0 -0.107"/> <geometry> <cylinder radius="0.012" length="0.17"/> </geometry> </collision>
  </link>
  <joint name="ankle" type="fixed">
    <parent link="shank"/> <child link="foot"/> <origin xyz="0 0 -0.213"/>
  </joint>
  <link name="foot">
    <inertial> <mass value="0.04"/>
      <inertia ixx="1e-5" ixy="0" ixz="0" iyy="1e-5" iyz="0" izz="1e-5"/> </inertial>
    <collision> <geometry> <sphere radius="0.015"/> </geometry> </collision>
  </link>
</robot>
"""
_ = (folder / "leg.urdf").write_text(URDF)

# %% [markdown]
# ## The problem
#
# Joints that are not named are locked, and what they carry is lumped into the links that move; so is the foot, which is
# fixed to the shank. The trunk is what the leg carries: on the test stand it slides up and along, and does not turn.

# %%
PROBLEM = """
name = "test_leg"

[leg]
urdf = "leg.urdf"
joints = ["hip_pitch", "knee"]    # what moves, from the body to the foot; the rest is locked
foot_frame = "foot"               # the link whose origin touches the ground
geometry = true                   # what collides counts: the leg keeps away from the body and from itself
motor = "unitree-go2"
gear = "unitree-go2"

[leg.body]
mass = 3.3                        # kg: what the leg carries

[leg.knee]
gear = "unitree-go2-knee"

[start]
hip_height = 0.21                 # m

[hop]
stance_duration = [0.03, 0.25]    # s
foot_window = 0.05                # m
"""
_ = (folder / "leg.toml").write_text(PROBLEM)
design = ho.load(folder / "leg.toml")

# %% [markdown]
# What was read, in numbers. From here on nothing needs the URDF or the catalogue any more; a stored result holds them all.

# %%
leg = design.leg
pd.DataFrame({
    name: {"length [m]": link.length, "mass [kg]": link.mass, "centre of mass x, y, z [m]": np.round(link.com_position, 4)}
    for name, link in leg.link.items()
})  # fmt: skip

# %%
pd.DataFrame({
    joint: {
        "angles [rad]": (leg.joint[joint].lower, leg.joint[joint].upper),
        "ratio": leg.drive(joint, "gear", "ratio")[1],
        "torque at most [N m]": round(leg.drive(joint, "motor", "torque_cap")[1] * leg.drive(joint, "gear", "ratio")[1], 1),
        "speed at no torque [rad/s]": round(leg.drive(joint, "motor", "max_speed")[1] / leg.drive(joint, "gear", "ratio")[1], 1),
        "from the catalogue": leg.drive(joint, "gear", "catalogue")[1],
    }
    for joint in leg.joints
})  # fmt: skip

# %% [markdown]
# Trust is good: Pinocchio reads the same file. The links below the trunk weigh as much there as here.

# %%
model = pin.buildModelFromXML(URDF)
moving = sum(model.inertias[model.getJointId(joint)].mass for joint in leg.joints)
print(f"{moving:.3f} kg in the URDF, {sum(link.mass for link in leg.link.values()):.3f} kg in the problem")
assert abs(moving - sum(link.mass for link in leg.link.values())) < 1e-12

# %% [markdown]
# ## The hop

# %%
s = ho.solve(design, starts=2)
assert s.verified
print(f"clearance {s.clearance:.3f} m, which is that of the {s.summary.lowest_point}")
s.plot("stick")

# %% [markdown]
# The trunk's lowest point counts too. How near the leg comes to it, or to itself, another library measures; a hop in which they
# meet would not be verified (docs/body.md).

# %%
near = s.summary.collision
print(
    f"{near.between[0]} passes {near.between[1]} at {1000 * near.least_distance_m:.1f} mm, {near.time_s:.3f} s after the start"
)
assert near.least_distance_m > 0

# %%
s.plot("operating_region")

# %% [markdown]
# The regions are those of the real drive: a current limit cuts the tip, the gear's rating and its speed the sides. (By the
# paper's law speed weakens braking as it weakens driving; `leg.motor.laws = ["four-quadrant"]` does not.)
#
# ## Are the drives well chosen?
#
# What 1 % more of every number would bring:

# %%
s.plot("tornado")

# %% [markdown]
# The knee's speed leads. So the same leg without the linkage that slows the knee down:

# %%
choices = {
    "as built": s,
    "knee geared like the hip": ho.solve(ho.load(folder / "leg.toml", ["leg.knee.gear=unitree-go2"]), starts=2),
}
assert all(hop.verified for hop in choices.values())
pd.DataFrame({
    name: {"clearance [m]": hop.clearance, "lift-off, up [m/s]": hop.summary.lift_off.vertical_m_s,
           **{f"{joint} C_avg": share for joint, share in hop.summary.saturation_mean.items()}}
    for name, hop in choices.items()
}).round(3)  # fmt: skip

# %% [markdown]
# The knee runs out of speed long before it runs out of torque: without the linkage behind its gear this leg would clear far
# more. (It would carry less; a hop is not all that a leg is for.)
#
# A leg of your own: `hopopt new my_leg` writes a commented problem file; put `urdf`, `joints` and `foot_frame` into `[leg]` and
# leave the tables of the links out. Legs of public robots are built in: `hopopt solve go2_leg`.
