# %% [markdown]
# # The Jacobian of an arm, and where it loses rank
#
# The geometric Jacobian $J^G(q)$ takes joint velocities to the spatial velocity of the gripper. Its
# smallest singular value says how near the arm is to a configuration in which some direction is
# lost. (Examples 3.6 and 3.8.)

# %%
import matplotlib.pyplot as plt
import numpy as np
from pydrake.multibody.tree import JacobianWrtVariable

from prehensile.kinematics.jacobians import (
    manipulability,
    rank,
    singular_values,
    singularity_along,
    task_rows,
)
from prehensile.kinematics.tree import tree_from_plant
from prehensile.station import build, load_scenario
from prehensile.viz.figures import save_figure
from prehensile.viz.images import side_by_side
from prehensile.viz.render import look_at, render

station = build(load_scenario("iiwa_wsg"))
context = station.CreateDefaultContext()
plant = station.GetSubsystemByName("plant")
plant_context = plant.GetMyMutableContextFromRoot(context)
arm = plant.GetModelInstanceByName("iiwa")
G = plant.GetFrameByName("body", plant.GetModelInstanceByName("wsg"))
joints = [plant.GetJointByName(f"iiwa_joint_{k + 1}", arm) for k in range(7)]
compiled = tree_from_plant(plant, [G], joints=joints)
tree = compiled.tree
q = plant.GetPositions(plant_context, arm)

# %% [markdown]
# ## The Jacobian
#
# It says what the gripper does, and Drake's says the same.

# %%
J_G = tree.jacobian(q, 0)
assert J_G.shape == (6, 7)
plant.SetPositions(plant_context, arm, q)
J_all = plant.CalcJacobianSpatialVelocity(
    plant_context, JacobianWrtVariable.kV, G, [0, 0, 0], plant.world_frame(), plant.world_frame()
)
np.testing.assert_allclose(J_G, J_all[:, compiled.velocity_indices], atol=1e-12)

v = np.array([0.1, -0.2, 0.3, 0.1, 0.0, -0.1, 0.2])
h = 1e-6
p_dot = (tree.pose(q + h * v, 0) - tree.pose(q - h * v, 0))[:3, 3] / (2.0 * h)
np.testing.assert_allclose((J_G @ v)[3:], p_dot, atol=1e-9)

# %% [markdown]
# ## Stretching the arm
#
# Joint 4 goes from bent to straight. The rank stays six up to the end, but the smallest singular
# value shrinks all the way. Radians and metres are compared by a length, here 30 cm.

# %%
length = 0.3
bend = np.linspace(-2.0, 0.0, 81)
path = np.tile([0.0, 0.6, 0.0, 0.0, 0.0, 0.0, 0.0], (len(bend), 1))
path[:, 3] = bend
path[:, 5] = 0.8
along = singularity_along(tree, path, 0, part="both", length=length)
assert along.closest == len(bend) - 1  # The straight arm is the singular one,
assert along.distances[-1] < 1e-9
J_straight = task_rows(tree.jacobian(path[-1], 0), "both", length=length)
assert rank(J_straight) == 5
# and what it cannot do is to move its wrist along itself, from the shoulder outwards. That wrist
# is the origin of link 6.
wrist = tree_from_plant(plant, [plant.GetFrameByName("iiwa_link_6", arm)], joints=joints).tree
shoulder = plant.GetFrameByName("iiwa_link_2", arm).CalcPoseInWorld(plant_context)
p_WShoulder = shoulder.translation()  # It does not move with joint 1.
outwards = wrist.pose(path[-1], 0)[:3, 3] - p_WShoulder
np.testing.assert_allclose(outwards @ wrist.jacobian(path[-1], 0)[3:], 0.0, atol=1e-9)

# %%
J = task_rows(tree.jacobians(path, 0), "both", length=length)
figure, (left, right) = plt.subplots(1, 2, figsize=(10, 3.8))
left.semilogy(np.degrees(bend), np.maximum(singular_values(J), 1e-4))
left.set(xlabel="joint 4 (°)", title="the six singular values")
right.plot(np.degrees(bend), manipulability(J))
right.set(xlabel="joint 4 (°)", title="manipulability")
save_figure(figure, "stretching")

# %%
pictures = []
for k in (0, 40, 80):
    plant.SetPositions(plant_context, arm, path[k])
    view = look_at([1.5, -2.1, 1.0], [0.3, 0.0, 0.5])
    pictures.append(render(station, context, view, width=400, height=400))
save_figure(side_by_side(pictures), "on_the_way")

# %% [markdown]
# ## How rare are singular configurations?
#
# Few random configurations are near one; the way to meet them is to reach for the border of the
# workspace.

# %%
rng = np.random.default_rng(0)
Q = rng.uniform(compiled.lower, compiled.upper, (20_000, 7))
sigma = singular_values(task_rows(tree.jacobians(Q, 0), "both", length=length))[:, -1]
distance = np.linalg.norm(wrist.poses(Q, 0)[:, :3, 3] - p_WShoulder, axis=1)
far = distance > 0.75  # of 0.8 m
assert np.mean(sigma < 0.02) < 0.1
assert np.median(sigma[far]) < 0.6 * np.median(sigma)
figure, axes = plt.subplots(figsize=(7, 3.6))
axes.hist(sigma, bins=80, density=True, alpha=0.6, label="all")
axes.hist(sigma[far], bins=80, density=True, alpha=0.6, label="wrist far out")
axes.set(xlabel="smallest singular value", title="random configurations")
axes.legend()
save_figure(figure, "how_rare")
