# %% [markdown]
# # A plan sketched in keyframes, and its timing
#
# Pick and place as poses that the gripper goes through: initial, prepick, pick, prepick again,
# clearance, preplace, place, preplace. How long each takes can be guessed, at so many seconds for a
# metre, or follow from what the joints can do. (Examples 3.11 and 3.12.)

# %%
import itertools

import matplotlib.pyplot as plt
import numpy as np
from pydrake.math import RigidTransform, RotationMatrix

from prehensile.kinematics.keyframe_timing import keyframe_motion, time_keyframes
from prehensile.kinematics.keyframes import Keyframe
from prehensile.kinematics.tree import tree_from_plant
from prehensile.station import build, load_scenario
from prehensile.viz.figures import save_figure
from prehensile.viz.trajectories import (
    plot_joint_trajectory,
    plot_pose_trajectory,
    plot_pose_trajectory_3d,
)

station = build(load_scenario("pick_brick"))
plant = station.GetSubsystemByName("plant")
arm = plant.GetModelInstanceByName("iiwa")
G = plant.GetFrameByName("body", plant.GetModelInstanceByName("wsg"))
joints = [plant.GetJointByName(f"iiwa_joint_{k + 1}", arm) for k in range(7)]
compiled = tree_from_plant(plant, [G], joints=joints)
q_start = plant.GetPositions(plant.CreateDefaultContext(), arm)
X_WGinitial = RigidTransform(compiled.tree.pose(q_start, 0))

# %% [markdown]
# ## The keyframes

# %%
X_OGpick = RigidTransform(RotationMatrix.MakeXRotation(-0.5 * np.pi), [0.0, 0.0, 0.11])
X_GpickGprepick = RigidTransform([0.0, -0.09, 0.0])
X_WO = RigidTransform(RotationMatrix.MakeZRotation(1.9), [0.5, -0.25, 0.025])
X_WOd = RigidTransform(RotationMatrix.MakeZRotation(1.1), [0.45, 0.3, 0.025])
X_WGpick, X_WGplace = X_WO @ X_OGpick, X_WOd @ X_OGpick
X_WGprepick, X_WGpreplace = X_WGpick @ X_GpickGprepick, X_WGplace @ X_GpickGprepick
p_clearance = 0.5 * (X_WGprepick.translation() + X_WGpreplace.translation()) + [0.0, 0.0, 0.15]
X_WGclearance = RigidTransform(X_WGinitial.rotation(), p_clearance)

keyframes = [
    Keyframe("initial", X_WGinitial, width=0.1),
    Keyframe("prepick", X_WGprepick, blend=0.03),
    Keyframe("pick", X_WGpick, width=0.0, dwell=0.5),
    Keyframe("lift", X_WGprepick, blend=0.03),
    Keyframe("clearance", X_WGclearance, blend=0.1),
    Keyframe("preplace", X_WGpreplace, blend=0.03),
    Keyframe("place", X_WGplace, width=0.1, dwell=0.5),
    Keyframe("retreat", X_WGpreplace),
]

# %% [markdown]
# ## Guessed times: 10 s for a metre

# %%
corners = [k.X_WG.translation() for k in keyframes]
guess = [10.0 * np.linalg.norm(b - a) for a, b in itertools.pairwise(corners)]
guessed = keyframe_motion(keyframes, np.maximum(guess, 2.0))
assert guessed.poses is not None

# %% [markdown]
# ## Least times: what velocities and accelerations of the joints permit

# %%
timed = time_keyframes(compiled, 0, q_start, keyframes)
assert timed.found, timed.reason
assert timed.poses is not None
assert timed.joints is not None
assert timed.widths is not None
print(f"guessed {guessed.duration:.1f} s, least {timed.duration:.1f} s")
print("limited by", *timed.limited_by, sep="\n  ")
assert timed.duration < guessed.duration / 3.0

# %% [markdown]
# The joints keep their limits, and somewhere on each stretch one of them uses its limit up.

# %%
t = np.linspace(0.0, timed.duration, 4001)
v = np.array([timed.joints.EvalDerivative(s, 1)[:, 0] for s in t])
a = np.array([timed.joints.EvalDerivative(s, 2)[:, 0] for s in t])
share = np.maximum(np.abs(v) / compiled.velocity, np.abs(a) / compiled.acceleration)
assert share.max() < 1.0 + 1e-6
assert share.max() > 0.9

# %% [markdown]
# The pose of the hand is that of the joints, its spatial velocity that of the Jacobian, and the
# gripper's opening goes with them.

# %%
for s in np.linspace(0.1, timed.duration - 0.1, 25):
    q = timed.joints.value(s)[:, 0]
    X_WG = timed.poses.value(s)
    np.testing.assert_allclose(compiled.tree.pose(q, 0), X_WG.GetAsMatrix4(), atol=1e-4)
    V_WG = compiled.tree.jacobian(q, 0) @ timed.joints.EvalDerivative(s, 1)[:, 0]
    np.testing.assert_allclose(V_WG, timed.poses.velocity(s), atol=2e-2)
pick, place = timed.names.index("pick"), timed.names.index("place")
middle = 0.5 * (timed.times[pick] + 0.5 + timed.times[place])
assert timed.widths.value(middle)[0, 0] == 0.0
assert np.isclose(timed.widths.value(timed.duration)[0, 0], 0.1)

# %%
marks = dict(zip(timed.names, timed.times, strict=True))
save_figure(
    plot_pose_trajectory(
        timed.poses.value, timed.poses.velocity, 0.0, timed.duration, keyframes=marks
    ),
    "pose_and_velocity",
)

# %%
save_figure(
    plot_joint_trajectory(
        timed.joints,
        compiled.joints,
        lower=compiled.lower,
        upper=compiled.upper,
        velocity=compiled.velocity,
        acceleration=compiled.acceleration,
        keyframes=marks,
    ),
    "joints_and_their_limits",
)

# %%
named = {name: k.X_WG for name, k in zip(timed.names, keyframes, strict=True)}
save_figure(
    plot_pose_trajectory_3d(timed.poses.value, 0.0, timed.duration, keyframes=named),
    "the_way_of_the_gripper",
)

# %%
figure, axes = plt.subplots(figsize=(7, 2.8))
axes.plot(t, [1e3 * timed.widths.value(s)[0, 0] for s in t])
axes.set(xlabel="t (s)", ylabel="mm", title="opening of the gripper")
save_figure(figure, "opening_of_the_gripper")
