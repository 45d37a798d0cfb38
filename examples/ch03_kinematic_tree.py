# %% [markdown]
# # The kinematic tree
#
# A plant orders its bodies in a tree whose root is the world: each body hangs on one other by a
# joint, or is free. An arm is more of a vine; a hand of several fingers and a brick beside it show
# the branches. `prehensile diagram iiwa7 --tree` draws the tree of any model. (Example 3.2.)

# %%
import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from prehensile.models.registry import find_model, package_map
from prehensile.viz.figures import save_figure
from prehensile.viz.kinematic_tree import kinematic_tree_image


def load(*names):
    """A plant with models of the registry, none of them fixed yet."""
    plant = MultibodyPlant(0.0)
    parser = Parser(plant)
    parser.package_map().AddMap(package_map())
    for name in names:
        parser.AddModels(url=find_model(name).url)
    return plant


# %% [markdown]
# ## An arm, its hand, and a brick

# %%
plant = load("iiwa7", "wsg50", "foam_brick")
plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("iiwa_link_0"))
plant.WeldFrames(
    plant.GetFrameByName("iiwa_link_7"), plant.GetFrameByName("body"), RigidTransform([0, 0, 0.09])
)
plant.Finalize()
save_figure(kinematic_tree_image(plant), "arm_hand_and_brick")

# %% [markdown]
# Joints do not add freedom, bodies do: each of the bodies came with six degrees, and joints took
# most of them away. Seven of the arm, two of the fingers and six of the free brick are left; the
# brick's orientation is a quaternion, so there is one position more than velocities.

# %%
assert plant.num_velocities() == 7 + 2 + 6
assert plant.num_positions() == 7 + 2 + 7
taken = 0
for index in plant.GetJointIndices():
    taken += 6 - plant.get_joint(index).num_velocities()
bodies = plant.num_bodies() - 1  # without the world
assert plant.num_velocities() == 6 * bodies - taken

# %% [markdown]
# ## The pose of a body, joint by joint
#
# Along the tree each pose is the parent's, times the fixed frame of the joint in the parent, times
# what the joint does, times the fixed frame of the child: $X^{PC} = X^{PJ_P} X^{J_P J_C}(q)
# X^{J_C C}$.

# %%
rng = np.random.default_rng(0)
context = plant.CreateDefaultContext()
arm = plant.GetModelInstanceByName("iiwa7")
plant.SetPositions(context, arm, rng.uniform(-1.5, 1.5, 7))
X_WC = RigidTransform()
for k in range(7):
    joint = plant.GetJointByName(f"iiwa_joint_{k + 1}")
    F, M = joint.frame_on_parent(), joint.frame_on_child()
    X_PF, X_FM = F.GetFixedPoseInBodyFrame(), M.CalcPose(context, F)
    X_MC = M.GetFixedPoseInBodyFrame().inverse()
    X_WC = X_WC @ X_PF @ X_FM @ X_MC
    expected = plant.EvalBodyPoseInWorld(context, joint.child_body())
    assert X_WC.IsNearlyEqualTo(expected, 1e-12)

# %% [markdown]
# ## A hand with four fingers

# %%
plant = load("allegro_right")
plant.WeldFrames(plant.world_frame(), plant.GetBodyByName("hand_root").body_frame())
plant.Finalize()
assert plant.num_positions() == 16
save_figure(kinematic_tree_image(plant), "allegro_hand")
