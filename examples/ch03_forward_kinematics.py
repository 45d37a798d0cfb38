# %% [markdown]
# # Forward kinematics
#
# From joint positions to poses: of the gripper on an arm, and of a body that floats freely.
# (Examples 3.3 and 3.4.)

# %%
import time

import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import SpatialInertia

from prehensile.kinematics.conventions import pose_to_array
from prehensile.kinematics.spatial import exp_se3
from prehensile.kinematics.tree import tree_from_plant
from prehensile.station import build, load_scenario
from prehensile.viz.figures import save_figure
from prehensile.viz.render import look_at, render

# %% [markdown]
# ## The gripper
#
# The plant answers for any frame in it, from the configuration in its context.

# %%
station = build(load_scenario("iiwa_wsg"))
context = station.CreateDefaultContext()
plant = station.GetSubsystemByName("plant")
plant_context = plant.GetMyMutableContextFromRoot(context)
arm = plant.GetModelInstanceByName("iiwa")
gripper = plant.GetBodyByName("body", plant.GetModelInstanceByName("wsg"))
q = np.array([0.3, 0.4, 0.0, -1.3, 0.2, 1.2, -0.4])
plant.SetPositions(plant_context, arm, q)
X_WG = plant.EvalBodyPoseInWorld(plant_context, gripper)
print(X_WG)
save_figure(render(station, context, look_at([1.7, -1.5, 1.1], [0.2, 0.0, 0.4])), "at_that_pose")

# %% [markdown]
# For many configurations there is a compiled copy of the tree that takes arrays. It gives the same
# poses.

# %%
joints = [plant.GetJointByName(f"iiwa_joint_{k + 1}", arm) for k in range(7)]
compiled = tree_from_plant(plant, [gripper.body_frame()], joints=joints)
np.testing.assert_allclose(compiled.tree.pose(q, 0), X_WG.GetAsMatrix4(), atol=1e-12)

rng = np.random.default_rng(0)
Q = rng.uniform(compiled.lower, compiled.upper, (100_000, 7))
start = time.perf_counter()
poses = compiled.tree.poses(Q, 0)
print(f"{1e9 * (time.perf_counter() - start) / len(Q):.0f} ns for each of {len(Q)} poses")
for k in range(0, len(Q), 10_000):
    plant.SetPositions(plant_context, arm, Q[k])
    expected = plant.EvalBodyPoseInWorld(plant_context, gripper).GetAsMatrix4()
    np.testing.assert_allclose(poses[k], expected, atol=1e-12)
# The gripper never leaves the sphere that the stretched arm reaches, about the shoulder.
p_WShoulder = np.array([0.0, 0.0, 0.34])
reach = np.linalg.norm(poses[:, :3, 3] - p_WShoulder, axis=1)
assert reach.max() < 0.4 + 0.4 + 0.126 + 0.09 + 1e-9

# %% [markdown]
# ## A free body
#
# Its seven positions are a unit quaternion and a point. Forward kinematics is not the identity: it
# makes a rotation matrix of the quaternion.

# %%
floating = MultibodyPlant(0.0)
body = floating.AddRigidBody("body", SpatialInertia.SolidBoxWithMass(1.0, 0.1, 0.1, 0.1))
floating.Finalize()
floating_context = floating.CreateDefaultContext()
X_WB = exp_se3(rng.normal(size=6))
floating.SetPositions(floating_context, pose_to_array(X_WB, "wxyz_xyz"))
found = floating.EvalBodyPoseInWorld(floating_context, body)
assert found.IsNearlyEqualTo(X_WB, 1e-12)
# The opposite quaternion is the same rotation: other positions, the same pose.
q = floating.GetPositions(floating_context)
q[:4] *= -1.0
floating.SetPositions(floating_context, q)
assert floating.EvalBodyPoseInWorld(floating_context, body).IsNearlyEqualTo(X_WB, 1e-12)
assert isinstance(found, RigidTransform)
