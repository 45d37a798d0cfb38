# %% [markdown]
# # A gallery of hands
#
# Every hand among the models, open and closed, and what there is to see in two of them: a gripper
# whose fingers have more joints than motors, and a hand with a motor at every joint. (Example 2.5;
# `prehensile demo hands` moves them.)

# %%
import matplotlib.pyplot as plt
import numpy as np
from pydrake.geometry import (
    AddContactMaterial,
    AddRigidHydroelasticProperties,
    Cylinder,
    ProximityProperties,
)
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlant, CoulombFriction, MultibodyPlantConfig
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from prehensile.models.registry import find_model, list_models, package_map
from prehensile.viz.figures import save_figure
from prehensile.viz.images import side_by_side
from prehensile.viz.render import look_at, render


def scene(hand, post=None):
    """A hand whose first link is fixed; perhaps a post (radius, height) along y before its palm."""
    builder = DiagramBuilder()
    config = MultibodyPlantConfig(
        time_step=0.004,
        contact_model="hydroelastic_with_fallback",
        discrete_contact_approximation="sap",  # which the constraints of linkages need
    )
    plant, _ = AddMultibodyPlant(config, builder)
    parser = Parser(plant)
    parser.package_map().AddMap(package_map())
    (instance,) = parser.AddModels(url=find_model(hand).url)
    base = plant.get_body(plant.GetBodyIndices(instance)[0])
    plant.WeldFrames(plant.world_frame(), base.body_frame())
    if post:
        X_WP = RigidTransform(RollPitchYaw(np.pi / 2, 0.0, 0.0), [0.0, 0.0, post[1]])
        shape, surface = Cylinder(post[0], 0.08), ProximityProperties()
        AddRigidHydroelasticProperties(0.01, surface)
        AddContactMaterial(friction=CoulombFriction(0.3, 0.3), properties=surface)
        world = plant.world_body()
        plant.RegisterCollisionGeometry(world, X_WP, shape, "post", surface)
        plant.RegisterVisualGeometry(world, X_WP, shape, "post", [0.2, 0.5, 0.8, 1.0])
    plant.Finalize()
    return plant, builder.Build()


# %% [markdown]
# ## Open and closed
#
# What each hand does between the two: the positions of its joints are set here, none is simulated.
# The Robotiq's other joints follow from one: while nothing is touched, each finger is a
# parallelogram and its tip stays upright. The suction cup has nothing to move.


# %%
def linkage(q):
    """All positions of the Robotiq, a finger's four joints twice, for one of its motor."""
    return np.tile([q, 0.0, -q, q], 2)


straight = np.where(np.arange(16) == 12, 0.3, 0.0)  # the thumb's range begins at 0.263 rad
fist = np.array([0.0, 1.2, 1.0, 0.8] * 3 + [1.0, 0.3, 0.3, 0.5])
# Positions open and closed; the way up and to the viewer; how far away that one is.
X, Y, Z = np.eye(3)
HANDS = {
    "wsg50": ([np.array([-0.055, 0.055]), np.zeros(2)], Y, Z, 0.34),
    "panda_hand": ([np.array([0.04, 0.04]), np.zeros(2)], Z, X, 0.34),
    "robotiq_2f85": ([linkage(0.0), linkage(0.8014)], Z, -Y, 0.34),
    "allegro_left": ([straight, fist], Z, X, 0.6),
    "allegro_right": ([straight, fist], Z, X, 0.6),
    "suction_cup": ([np.zeros(0)], Z, -Y, 0.28),
}
assert set(HANDS) == {info.name for info in list_models() if info.category == "hand"}
pictures = {}
for name, (postures, up, front, away) in HANDS.items():
    plant, diagram = scene(name)
    context = diagram.CreateDefaultContext()
    plant_context = plant.GetMyMutableContextFromRoot(context)
    lower, upper = plant.GetPositionLowerLimits(), plant.GetPositionUpperLimits()
    middle = (0.035 if name == "wsg50" else 0.22 * away) * up
    eye = middle + away * (front + 0.25 * np.cross(up, front) + 0.1 * up)
    pictures[name] = []
    for q in postures:
        assert np.all((q >= lower - 1e-6) & (q <= upper + 1e-6))
        plant.SetPositions(plant_context, q)
        view = look_at(eye, middle, up)
        pictures[name].append(render(diagram, context, view, width=200, height=240))
grippers = ("wsg50", "panda_hand", "robotiq_2f85")
others = ("allegro_left", "allegro_right", "suction_cup")
save_figure(side_by_side([p for name in grippers for p in pictures[name]]), "grippers")
save_figure(side_by_side([p for name in others for p in pictures[name]]), "fingers_and_a_cup")

# %% [markdown]
# ## Two fingers, eight joints, one motor
#
# The motor of the Robotiq 2F-85 turns the outer knuckles. Each finger is a loop of four links,
# closed by a constraint, and one of its hinges is held against a stop by a spring. As long as
# nothing pushes it off that stop, the pads move in parallel. Closed by a constant torque, their
# distance is
#
# $$2 \, (0.00534 + 0.05715 \cos(0.86298 + q)) \; \mathrm{m}$$


# %%
def loop_error(plant, context):
    """Greatest distance (m) of the two halves of a hinge that closes a loop."""
    gaps = []
    for side, x in (("left", 1.0), ("right", -1.0)):
        on_finger = plant.GetFrameByName(f"{side}_inner_finger").CalcPoseInWorld(context)
        on_knuckle = plant.GetFrameByName(f"{side}_inner_knuckle").CalcPoseInWorld(context)
        p_FHinge, p_KHinge = [-0.01790114 * x, 0.0, 0.00651548], [0.0371575 * x, 0.0, 0.04342168]
        gaps.append(np.linalg.norm(on_finger @ p_FHinge - on_knuckle @ p_KHinge))
    return max(gaps)


def pad_distance(plant, context):
    """Distance (m) of the pads, by Drake's distance query from a point between them."""
    query = plant.get_geometry_query_input_port().Eval(context)
    height = plant.GetFrameByName("left_pad").CalcPoseInWorld(context).translation()[2]
    hits = query.ComputeSignedDistanceToPoint([0.0, 0.002, height + 0.005])
    name = query.inspector().GetName
    return sum(hit.distance for hit in hits if name(hit.id_G).endswith("pad"))


def lean(plant, context, side):
    """Angle (rad) by which a finger's tip leans inwards."""
    z = plant.GetFrameByName(f"{side}_inner_finger").CalcPoseInWorld(context).rotation().col(2)
    return np.arctan2(-z[0] if side == "left" else z[0], z[2])


def close(post=None, torque=3.0, seconds=0.9):
    """Closes the gripper; returns plant, diagram, context and a row for each 10 ms."""
    plant, diagram = scene("robotiq_2f85", post)
    assert plant.num_positions() == 8
    assert plant.num_actuators() == 1
    simulator = Simulator(diagram)
    root = simulator.get_mutable_context()
    context = plant.GetMyMutableContextFromRoot(root)
    plant.get_actuation_input_port().FixValue(context, [torque])
    joints = [plant.GetJointByName(n) for n in ("finger_joint", "left_outer_finger_joint")]
    rows = []
    for t in np.arange(0.0, seconds + 1e-9, 0.01):
        simulator.AdvanceTo(t)
        q, bend = (joint.GetOnePosition(context) for joint in joints)
        rows.append(
            (
                t, q, bend, lean(plant, context, "left"),
                pad_distance(plant, context), loop_error(plant, context),
            )
        )  # fmt: skip
    return plant, diagram, root, np.array(rows)


plant, _, _, rows = close()
t, q, bend, tip, opening, gap = rows.T
formula = 2.0 * (0.00534 + 0.05715 * np.cos(0.86298 + q))
assert q[-1] > 0.8
np.testing.assert_allclose(opening, formula, atol=5e-5)
np.testing.assert_allclose(opening[[0, -1]], [0.085, 0.0], atol=2e-4)
assert np.max(np.abs(tip)) < 1e-3  # The pads stay parallel.
assert np.max(gap) < 1e-6  # The loops stay closed.

figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.4), layout="constrained")
left.plot(q, 1e3 * opening, label="simulated")
left.plot(q, 1e3 * formula, "k:", label="closed form")
left.set(xlabel="motor's joint (rad)", ylabel="mm", title="between the pads")
left.legend()
right.plot(t, 1e6 * gap)
right.set(xlabel="t (s)", ylabel="µm", title="how far the loops are open")
save_figure(figure, "closing_on_nothing")

# %% [markdown]
# ## It pinches, or it wraps
#
# A post between the pads is pinched: the hinge stays on its stop. A thicker one near the palm meets
# the inner knuckles first. They can go no further; the motor can, and what gives way is the spring:
# the tips bend round the post. Which of the two it will be nobody decides. One motor more would
# have to be told.

# %%
traces, pictures = {}, []
for name, post in (("pinched", (0.02, 0.152)), ("wrapped", (0.026, 0.105))):
    plant, diagram, root, rows = close(post, seconds=1.1)
    context = plant.GetMyContextFromRoot(root)
    view = look_at([0.0, -0.36, 0.1], [0.0, 0.0, 0.09])
    pictures.append(render(diagram, root, view, width=400, height=380))
    traces[name] = rows
    assert np.max(np.abs(plant.GetVelocities(context))) < 0.05  # It has come to rest,
    # with the same done on both sides, and the loops as they were.
    assert abs(lean(plant, context, "left") - lean(plant, context, "right")) < 0.01
    assert np.max(rows[:, 5]) < 2e-5
save_figure(side_by_side(pictures), "pinched_and_wrapped")

figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.4), layout="constrained", sharey=True)
for axes, name in ((left, "pinched"), (right, "wrapped")):
    t, q, bend, tip, _, _ = traces[name].T
    axes.plot(t, np.degrees(q), label="motor's joint")
    axes.plot(t, np.degrees(-bend), label="off the stop")
    axes.plot(t, np.degrees(tip), "k:", label="the tip leans inwards")
    axes.set(xlabel="t (s)", title=name)
left.set(ylabel="°")
left.legend(fontsize="small")
save_figure(figure, "who_gives_way")

t, q, bend, tip, opening, _ = traces["pinched"].T
assert np.max(np.abs(bend)) < 1e-3
assert abs(tip[-1]) < 3e-3
assert 0.0 < 2 * 0.02 - opening[-1] < 0.003  # The post is this thick; the rubber of the pads gives.
t, q, bend, tip, _, _ = traces["wrapped"].T
assert bend[-1] < -0.3
assert tip[-1] > 0.5

# %% [markdown]
# ## A right hand and a left one
#
# The two Allegro hands are mirror images of each other: the same joint positions bring the tips to
# mirrored places. Here is what one sees who looks into the palms.

# %%
tips = [f"link_{k}_tip" for k in (3, 7, 11, 15)]
paths = {}
for side in ("left", "right"):
    plant, _ = scene(f"allegro_{side}")
    assert plant.num_actuators() == plant.num_positions() == 16  # A motor at every joint.
    context = plant.CreateDefaultContext()
    paths[side] = []
    for s in np.linspace(0.0, 1.0, 30):
        plant.SetPositions(context, straight + s * (fist - straight))
        frames = [plant.GetFrameByName(tip) for tip in tips]
        paths[side].append([frame.CalcPoseInWorld(context).translation() for frame in frames])
right, left = np.array(paths["right"]), np.array(paths["left"])
np.testing.assert_allclose(left, right * [1.0, -1.0, 1.0], atol=1e-9)
assert np.min(np.linalg.norm(left - right, axis=2)[:, 3]) > 0.05  # Nor are they the same.

figure, panels = plt.subplots(1, 2, figsize=(8, 3.6), sharey=True)
for axes, side, p in ((panels[0], "left", left), (panels[1], "right", right)):
    for k, finger in enumerate(("index", "middle", "ring", "thumb")):
        (line,) = axes.plot(100 * p[:, k, 1], 100 * p[:, k, 2], label=finger)
        axes.plot(*(100 * p[-1, k, 1:]), "o", color=line.get_color())
    axes.set(xlabel="y (cm)", title=f"{side} hand", aspect="equal")
panels[0].set(ylabel="z (cm)")
panels[0].legend(fontsize="small")
save_figure(figure, "paths_of_the_tips")
