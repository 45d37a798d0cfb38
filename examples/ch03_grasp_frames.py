# %% [markdown]
# # Grasp and pregrasp frames
#
# Where should the gripper be to take the brick? The answer is a pose of the gripper in the frame of
# the object, and does not depend on where the object is. (Example 3.10 and exercise 3.7.)

# %%
import numpy as np
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.parsing import Parser
from pydrake.planning import RobotDiagramBuilder

from prehensile.models.registry import find_model, package_map
from prehensile.viz.figures import save_figure
from prehensile.viz.images import side_by_side
from prehensile.viz.render import look_at, render

builder = RobotDiagramBuilder(time_step=0.0)
plant = builder.plant()
parser = Parser(plant)
parser.package_map().AddMap(package_map())
(hand,) = parser.AddModels(url=find_model("wsg50").url)
(object_,) = parser.AddModels(url=find_model("foam_brick").url)
plant.Finalize()
diagram = builder.Build()
context = diagram.CreateDefaultContext()
plant_context = plant.GetMyMutableContextFromRoot(context)
gripper, brick = plant.GetBodyByName("body"), plant.GetBodyByName("base_link")

# %% [markdown]
# ## (a) The desired grasp
#
# The gripper G points its fingers along y and closes along x. The brick O is 5 cm wide along its x,
# 7.5 cm along its y, and 5 cm high. Coming from above, y of the gripper is to be along $-z$ of the
# brick, and x along x. The brick's centre is 11 cm ahead of the gripper's frame, between the pads.

# %%
R_GO = RotationMatrix.MakeXRotation(0.5 * np.pi)
np.testing.assert_allclose(R_GO @ [0, 0, 1], [0, -1, 0], atol=1e-12)  # z of O is -y of G
np.testing.assert_allclose(R_GO @ [1, 0, 0], [1, 0, 0], atol=1e-12)  # x of O is x of G
X_GgraspO = RigidTransform(R_GO, [0.0, 0.11, 0.0])
X_OGgrasp = X_GgraspO.inverse()

# %% [markdown]
# The pregrasp is 9 cm farther back along the fingers. From there to the grasp is a straight line on
# which nothing is touched.

# %%
X_GgraspGpregrasp = RigidTransform([0.0, -0.09, 0.0])
X_OGpregrasp = X_OGgrasp @ X_GgraspGpregrasp

# %% [markdown]
# ## (b) For a brick anywhere
#
# The pose of the gripper in the world follows by composition: $X^{G} = X^{O} X^{OG}$, whatever the
# brick's yaw. Drake's signed distances tell that the open hand touches nothing on its way in, and
# that fingers as far apart as the brick is wide just touch it.


# %%
def distance(X_WO, X_WG, width):
    """The least signed distance between the hand and the brick."""
    plant.SetFreeBodyPose(plant_context, brick, X_WO)
    plant.SetFreeBodyPose(plant_context, gripper, X_WG)
    for name, sign in (("left", -0.5), ("right", 0.5)):
        joint = plant.GetJointByName(f"{name}_finger_sliding_joint", hand)
        joint.set_translation(plant_context, sign * width)
    query = plant.get_geometry_query_input_port().Eval(plant_context)
    pairs = query.ComputeSignedDistancePairwiseClosestPoints(0.2)
    inspector = query.inspector()
    hands = {g for b in plant.GetBodyIndices(hand) for g in geometries(b)}
    bricks = set(geometries(brick.index()))
    assert inspector.num_geometries() > 0
    return min(
        pair.distance
        for pair in pairs
        if (pair.id_A in hands and pair.id_B in bricks)
        or (pair.id_B in hands and pair.id_A in bricks)
    )


def geometries(index):
    return plant.GetCollisionGeometriesForBody(plant.get_body(index))


rng = np.random.default_rng(0)
for yaw in rng.uniform(-np.pi, np.pi, 5):
    X_WO = RigidTransform(RotationMatrix.MakeZRotation(yaw), [0.5, 0.1, 0.025])
    for back in np.linspace(0.09, 0.0, 4):
        X_WG = X_WO @ X_OGgrasp @ RigidTransform([0.0, -back, 0.0])
        assert distance(X_WO, X_WG, width=0.1) > 0.02
    X_WGgrasp = X_WO @ X_OGgrasp
    assert abs(distance(X_WO, X_WGgrasp, width=0.05)) < 1e-3
    # The fingers point down, and the hand is above the brick.
    np.testing.assert_allclose(X_WGgrasp.rotation().col(1), [0.0, 0.0, -1.0], atol=1e-12)
    assert np.isclose(X_WGgrasp.translation()[2], 0.025 + 0.11)

# %%
X_WO = RigidTransform(RotationMatrix.MakeZRotation(0.6), [0.0, 0.0, 0.025])
view = look_at([0.35, -0.4, 0.3], [0.0, 0.0, 0.12])
pictures = []
for X_OG, width in ((X_OGpregrasp, 0.1), (X_OGgrasp, 0.1), (X_OGgrasp, 0.05)):
    distance(X_WO, X_WO @ X_OG, width)  # puts everything in its place
    pictures.append(render(diagram, context, view, width=400, height=420, fov_y=0.8))
save_figure(side_by_side(pictures), "pregrasp_grasp_and_grip")

# %% [markdown]
# ## (c) The same poses in other frames
#
# With the pose of the robot's base B in the world the gripper's pose in the base is $X^{BG} =
# (X^{WB})^{-1} X^{WG}$; and if the brick moves with the hand, $X^{GO}$ stays, so a goal of the
# brick is a goal of the gripper: $X^{WG_{place}} = X^{WO_d} X^{OG}$.

# %%
X_WB = RigidTransform(RotationMatrix.MakeZRotation(np.pi / 2), [-0.6, 0.2, 0.0])
X_BG = X_WB.inverse() @ (X_WO @ X_OGgrasp)
assert (X_WB @ X_BG @ X_GgraspO).IsNearlyEqualTo(X_WO, 1e-12)
X_WOd = RigidTransform(RotationMatrix.MakeZRotation(-1.0), [0.4, -0.3, 0.025])
X_WGplace = X_WOd @ X_OGgrasp
assert (X_WGplace @ X_GgraspO).IsNearlyEqualTo(X_WOd, 1e-12)

# %% [markdown]
# ## (d) Another grasp
#
# Across the long side, from the side: y of the gripper along $-x$ of the brick and x along its y.
# It needs a hand that opens wider than 7.5 cm, which this one does.

# %%
R_OG = RotationMatrix(np.column_stack([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]))
X_OGside = RigidTransform(R_OG, [0.11, 0.0, 0.0])
X_WO = RigidTransform([0.0, 0.0, 0.3])  # held up: there would be no room beside a table
assert distance(X_WO, X_WO @ X_OGside, width=0.1) > 0.01
assert abs(distance(X_WO, X_WO @ X_OGside, width=0.075)) < 1e-3
