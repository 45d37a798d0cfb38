# %% [markdown]
# # Interpolating rotations in space
#
# Unit quaternions carry the idea of the plane to three dimensions: interpolate the angle of the
# rotation from one orientation to the other, about its fixed axis. Drake's
# `PiecewiseQuaternionSlerp` does that; a pose trajectory puts it together with a line.
# (Exercise 3.3, in 3-D.)

# %%
import itertools

import matplotlib.pyplot as plt
import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from pydrake.trajectories import PiecewiseQuaternionSlerp

from prehensile.kinematics.rotations import exp_so3, log_so3
from prehensile.kinematics.trajectories import pose_trajectory
from prehensile.viz.figures import save_figure

R_WF = RotationMatrix(RollPitchYaw(0.2, -0.4, 0.3))
R_WG = RotationMatrix(RollPitchYaw(-0.5, 1.1, 2.4))
q_F, q_G = (R.ToQuaternion().wxyz() for R in (R_WF, R_WG))
if q_F @ q_G < 0.0:  # Of the two quaternions of a rotation take the nearer one.
    q_G = -q_G

# %% [markdown]
# ## Slerp, by its formula and by the logarithm
#
# $$q(t) = \frac{\sin((1-t)\Omega)}{\sin\Omega} q_F + \frac{\sin(t\Omega)}{\sin\Omega} q_G, \quad
# \cos\Omega = q_F \cdot q_G$$
#
# It is the same as turning by $t$ times the rotation vector from F to G.

# %%
omega = np.arccos(q_F @ q_G)


def slerp(t):
    return (np.sin((1.0 - t) * omega) * q_F + np.sin(t * omega) * q_G) / np.sin(omega)


turn = log_so3(R_WG.matrix() @ R_WF.matrix().T)
drake = PiecewiseQuaternionSlerp([0.0, 1.0], [R_WF.ToQuaternion(), R_WG.ToQuaternion()])
for t in np.linspace(0.0, 1.0, 11):
    assert np.isclose(np.linalg.norm(slerp(t)), 1.0)
    R = exp_so3(t * turn) @ R_WF.matrix()
    np.testing.assert_allclose(RotationMatrix(drake.orientation(t)).matrix(), R, atol=1e-12)
    w, x, y, z = slerp(t)
    np.testing.assert_allclose(R[2, 1] - R[1, 2], 4.0 * w * x, atol=1e-12)
# The angular velocity is constant.
np.testing.assert_allclose(drake.angular_velocity(0.2), turn, atol=1e-9)
np.testing.assert_allclose(drake.angular_velocity(0.9), turn, atol=1e-9)

# %% [markdown]
# ## What else one might interpolate
#
# The straight line between the quaternions, set to unit length, takes the same way at an uneven
# rate. Roll, pitch and yaw take another way, which depends on the choice of axes.

# %%
times = np.linspace(0.0, 1.0, 101)
rpy_F, rpy_G = (RollPitchYaw(R).vector() for R in (R_WF, R_WG))


def normalized_line(t):
    q = (1.0 - t) * q_F + t * q_G
    w, x, y, z = q / np.linalg.norm(q)
    return RotationMatrix(np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]))  # fmt: skip


ways = {
    "slerp": [RotationMatrix(drake.orientation(t)) for t in times],
    "quaternions, normalized": [normalized_line(t) for t in times],
    "roll, pitch, yaw": [
        RotationMatrix(RollPitchYaw((1.0 - t) * rpy_F + t * rpy_G)) for t in times
    ],
}


def length(path):
    """How far a path of rotations turns in all, in rad."""
    steps = itertools.pairwise(path)
    return sum(float(np.linalg.norm(log_so3(b.matrix() @ a.matrix().T))) for a, b in steps)


lengths = {name: length(path) for name, path in ways.items()}
assert np.isclose(lengths["slerp"], np.linalg.norm(turn), atol=1e-6)
assert np.isclose(lengths["quaternions, normalized"], lengths["slerp"], atol=1e-6)
assert lengths["roll, pitch, yaw"] > 1.03 * lengths["slerp"]

figure = plt.figure(figsize=(10.5, 4.4))
sphere = figure.add_subplot(1, 2, 1, projection="3d")
u, v = np.meshgrid(np.linspace(0, 2 * np.pi, 40), np.linspace(0, np.pi, 20))
sphere.plot_wireframe(
    np.cos(u) * np.sin(v), np.sin(u) * np.sin(v), np.cos(v), color="0.9", linewidth=0.5
)
rate = figure.add_subplot(1, 2, 2)
styles = ("-", "--", "-")
for (name, path), style in zip(ways.items(), styles, strict=True):
    tips = np.array([R.col(0) for R in path])
    sphere.plot(*tips.T, style, label=f"{name}: {np.degrees(lengths[name]):.0f}°")
    speed = [
        np.linalg.norm(log_so3(b.matrix() @ a.matrix().T)) * 100.0
        for a, b in itertools.pairwise(path)
    ]
    rate.plot(times[1:], speed, style)
sphere.set(title="where the x axis points")
sphere.set_box_aspect((1, 1, 1))
sphere.legend(fontsize="small", loc="lower left")
rate.set(xlabel="t", ylabel="rad", title="rate of turning")
save_figure(figure, "three_ways_to_turn")

# %% [markdown]
# ## Poses
#
# A pose trajectory moves the origin on a line and turns by slerp. Its spatial velocity comes from
# the formula, not from differences.

# %%
X_WF, X_WG = RigidTransform(R_WF, [0.5, 0.0, 0.3]), RigidTransform(R_WG, [0.3, 0.4, 0.5])
motion = pose_trajectory([0.0, 2.0], [X_WF, X_WG])
assert motion.value(0.0).IsNearlyEqualTo(X_WF, 1e-12)
assert motion.value(2.0).IsNearlyEqualTo(X_WG, 1e-12)
h = 1e-6
for t in (0.4, 1.0, 1.7):
    after, before = motion.value(t + h), motion.value(t - h)
    w = log_so3(after.rotation().matrix() @ before.rotation().matrix().T) / (2.0 * h)
    p_dot = (after.translation() - before.translation()) / (2.0 * h)
    np.testing.assert_allclose(motion.velocity(t), np.concatenate([w, p_dot]), atol=1e-7)
