# %% [markdown]
# # The robot painter
#
# The gripper paints in the air: key frames on a circle, each with the fingers pointing at its axis,
# become a trajectory, and the trajectory joint positions. (Exercise 3.8.)

# %%
import numpy as np
from pydrake.math import RigidTransform, RotationMatrix

from prehensile.kinematics.keyframe_timing import time_keyframes
from prehensile.kinematics.keyframes import Keyframe
from prehensile.kinematics.tracing import nearest_configuration, posture_near
from prehensile.kinematics.tree import tree_from_plant
from prehensile.station import build, load_scenario
from prehensile.viz.figures import save_figure
from prehensile.viz.images import draw_points, side_by_side
from prehensile.viz.render import look_at, render
from prehensile.viz.trajectories import plot_pose_trajectory_3d

station = build(load_scenario("iiwa_wsg"))
plant = station.GetSubsystemByName("plant")
arm = plant.GetModelInstanceByName("iiwa")
G = plant.GetFrameByName("body", plant.GetModelInstanceByName("wsg"))
joints = [plant.GetJointByName(f"iiwa_joint_{k + 1}", arm) for k in range(7)]
compiled = tree_from_plant(plant, [G], joints=joints)
context = station.CreateDefaultContext()
plant_context = plant.GetMyMutableContextFromRoot(context)
q_start = plant.GetPositions(plant_context, arm)

# %% [markdown]
# ## (a) Key frames on a circle
#
# The centre is in front of the arm, the circle has a radius of 12 cm. At the angle $\theta$ the
# gripper is at $p^C + r (\cos\theta, \sin\theta, 0)$; its y, the direction of the fingers,
# points down and 0.3 rad inwards, and its x stays as near to the world's y as that permits.

# %%
p_WCenter, radius, tilt = np.array([0.58, 0.0, 0.25]), 0.12, 0.3


def painter_pose(theta):
    """X_WG at an angle on the circle."""
    outwards = np.array([np.cos(theta), np.sin(theta), 0.0])
    y = -np.sin(tilt) * outwards - np.cos(tilt) * np.array([0.0, 0.0, 1.0])
    z = np.cross([0.0, 1.0, 0.0], y)
    z /= np.linalg.norm(z)
    R_WG = RotationMatrix(np.column_stack([np.cross(y, z), y, z]))
    return RigidTransform(R_WG, p_WCenter + radius * outwards)


for theta in (0.0, 0.7, 2.0):
    X = painter_pose(theta)
    # The line of the fingers meets the axis of the circle.
    p, d = X.translation() - p_WCenter, X.rotation().col(1)
    assert np.allclose(p[:2] + radius / np.sin(tilt) * d[:2], 0.0)

# %% [markdown]
# ## (b) Through the key frames
#
# Key frames at every 15°, each but the first and last passed without stopping;
# times from what the joints can do.

# %%
angles = np.linspace(-np.pi, np.pi, 25)
posture = posture_near(compiled, q_start)
q_first, error = nearest_configuration(compiled, 0, painter_pose(angles[0]), q_start, posture)
assert error < 1e-6
blends = [0.0, *[0.014] * (len(angles) - 2), 0.0]
keyframes = [
    Keyframe(f"{np.degrees(angle):.0f}°", painter_pose(angle), blend=blend)
    for angle, blend in zip(angles, blends, strict=True)
]
motion = time_keyframes(compiled, 0, q_first, keyframes)
assert motion.found, motion.reason
assert motion.poses is not None
assert motion.joints is not None
print(f"once around in {motion.duration:.2f} s, limited by {motion.limited_by[0]}")

# %% [markdown]
# The stroke is a circle to within the rounding of the corners, the arm is within its limits, and
# the fingers look at the axis all the way.

# %%
t = np.linspace(0.0, motion.duration, 1500)
poses = [motion.poses.value(s) for s in t]
p_WG = np.array([X.translation() for X in poses])
distance = np.linalg.norm((p_WG - p_WCenter)[:, :2], axis=1)
assert np.all(np.abs(distance - radius) < 0.003)
assert np.ptp(p_WG[:, 2]) < 1e-9
Q = np.array([motion.joints.value(s)[:, 0] for s in t])
v = np.array([motion.joints.EvalDerivative(s, 1)[:, 0] for s in t])
assert np.all(compiled.lower <= Q)
assert np.all(compiled.upper >= Q)
assert np.all(np.abs(v) <= compiled.velocity * (1.0 + 1e-9))
down = np.array([X.rotation().col(1) @ [0.0, 0.0, -1.0] for X in poses])
assert np.all(np.abs(np.arccos(down) - tilt) < 0.02)

figure = plot_pose_trajectory_3d(
    motion.poses.value, 0.0, motion.duration,
    keyframes={k.name: k.X_WG for k in keyframes[:-1:4]},
)  # fmt: skip
save_figure(figure, "the_stroke")

# %% [markdown]
# The paint, seen by a camera in front of the arm:

# %%
view = look_at([1.6, -1.0, 1.1], [0.3, 0.0, 0.35])
width, height, fov_y = 480, 420, 0.7
focal = 0.5 * height / np.tan(0.5 * fov_y)
K = np.array([[focal, 0.0, width / 2 - 0.5], [0.0, focal, height / 2 - 0.5], [0.0, 0.0, 1.0]])
pictures = []
for share in (0.3, 0.65, 1.0):
    k = int(share * (len(t) - 1))
    plant.SetPositions(plant_context, arm, Q[k])
    picture = render(station, context, view, width=width, height=height, fov_y=fov_y)
    p_WTip = [X @ np.array([0.0, 0.118, 0.0]) for X in poses[: k + 1]]
    pictures.append(draw_points(picture, K, view, p_WTip, color=(220, 40, 120)))
save_figure(side_by_side(pictures), "painting")
