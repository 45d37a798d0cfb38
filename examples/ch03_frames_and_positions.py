# %% [markdown]
# # Frames and positions
#
# A position is measured from one point to another, and expressed in a frame: $p^{GO}_W$ is where
# the object's origin O is, seen from the gripper's origin G, in the axes of the world. The same
# arrow has other numbers in other frames. (Exercise 3.1, and example 3.1 at the end.)

# %%
import numpy as np
from pydrake.geometry import Cylinder
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.parsing import Parser
from pydrake.planning import RobotDiagramBuilder

from prehensile.models.registry import find_model, package_map
from prehensile.viz.figures import save_figure
from prehensile.viz.render import look_at, render

builder = RobotDiagramBuilder(time_step=0.0)
plant = builder.plant()
parser = Parser(plant)
parser.package_map().AddMap(package_map())
parser.AddModels(url=find_model("wsg50").url)
parser.AddModels(url=find_model("foam_brick").url)
hand, brick = plant.GetBodyByName("body"), plant.GetBodyByName("base_link")
RED, GREEN, BLUE = [0.9, 0.1, 0.1, 1.0], [0.1, 0.7, 0.1, 1.0], [0.1, 0.2, 0.9, 1.0]


def add_triad(body, name, length=0.12):
    """Draws the axes of a body: x red, y green, z blue."""
    turns = (
        RotationMatrix.MakeYRotation(0.5 * np.pi),
        RotationMatrix.MakeXRotation(-0.5 * np.pi),
        RotationMatrix(),
    )
    for k, (turn, color) in enumerate(zip(turns, (RED, GREEN, BLUE), strict=True)):
        X_BA = RigidTransform(turn, turn @ np.array([0.0, 0.0, 0.5 * length]))
        shape = Cylinder(0.003, length)
        plant.RegisterVisualGeometry(body, X_BA, shape, f"{name}{k}", color)


add_triad(hand, "G", length=0.17)
add_triad(brick, "O")
add_triad(plant.world_body(), "W")
plant.Finalize()
diagram = builder.Build()
context = diagram.CreateDefaultContext()
plant_context = plant.GetMyMutableContextFromRoot(context)

# %% [markdown]
# The hand points down 30 cm above the table, its fingers along $-z$ of the world. The brick lies 20
# cm farther along x.

# %%
X_WG = RigidTransform(RotationMatrix.MakeXRotation(-0.5 * np.pi), [0.1, 0.0, 0.3])
X_WO = RigidTransform([0.3, 0.0, 0.1])
plant.SetFreeBodyPose(plant_context, hand, X_WG)
plant.SetFreeBodyPose(plant_context, brick, X_WO)
view = look_at([0.7, -0.7, 0.45], [0.2, 0.0, 0.2])
save_figure(render(diagram, context, view), "the_frames")

# %% [markdown]
# ## Positions add when their symbols match
#
# $$p^{GO}_W = p^{WO}_W - p^{WG}_W, \qquad p^{GO}_G = R^{GW} p^{GO}_W$$

# %%
p_GO_W = X_WO.translation() - X_WG.translation()
np.testing.assert_allclose(p_GO_W, [0.2, 0.0, -0.2])
# Seen by the gripper the brick is 20 cm along its x and 20 cm ahead of its fingers, along its y.
p_GO_G = X_WG.rotation().inverse() @ p_GO_W
np.testing.assert_allclose(p_GO_G, [0.2, 0.2, 0.0], atol=1e-12)
# The whole transform says the same at once.
X_GO = X_WG.inverse() @ X_WO
np.testing.assert_allclose(X_GO.translation(), p_GO_G, atol=1e-12)
# Expressing it elsewhere does not change its length.
assert np.isclose(np.linalg.norm(p_GO_G), np.linalg.norm(p_GO_W))

# %% [markdown]
# So of the answers (0.2, 0, -0.2), (0, 0.3, 0.1) and (0, -0.3, 0.1) the first can be $p^{GO}_W$:
# the brick is lower than the hand, so its last number is negative. In the gripper's axes it must
# have a positive y, for the fingers point to where the brick is.
#
# ## From the camera to the world
#
# A depth camera tells where a point P is in its own frame C. What it takes to have it in the world
# is the camera's pose: $p^{WP} = X^{WC} p^{CP}$.

# %%
X_WC = view
p_WP = np.array([0.3, 0.0, 0.1])
p_CP = X_WC.inverse() @ p_WP
assert p_CP[2] > 0.0  # In front of the camera: its z looks into the scene.
np.testing.assert_allclose(X_WC @ p_CP, p_WP, atol=1e-12)
distance = np.linalg.norm(p_WP - X_WC.translation())
assert np.isclose(np.linalg.norm(p_CP), distance)
