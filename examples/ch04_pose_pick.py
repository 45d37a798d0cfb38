# %% [markdown]
# # Putting it all together
#
# A mustard bottle lies somewhere in a bin, and is to stand upright in another one. Three noisy
# depth cameras; a cloud without the bin; a pose without a guess; a grasp that fits the object; and
# a motion from here to there. Here the first look and what is planned upon it are drawn step by
# step; `prehensile demo pose-pick` runs the whole task in simulation, with a page to watch it on.
# (Section 4.8.)

# %%
import itertools

import matplotlib.pyplot as plt
import numpy as np

from prehensile.perception import CameraModel, DepthView, PosedCamera
from prehensile.perception.registration import RegistrationStatus, locate
from prehensile.tasks.clear_bin_run import bin_geometry
from prehensile.tasks.pose_pick_finder import FinderConfig, object_cloud
from prehensile.tasks.pose_pick_object import prepare_object
from prehensile.tasks.pose_pick_report import adds
from prehensile.tasks.pose_pick_run import PosePickRun
from prehensile.viz.figures import save_figure
from prehensile.viz.images import colorize_depth, draw_points
from prehensile.viz.render import look_at, render

# %% [markdown]
# ## The scene
#
# The bottle was dropped into the first bin and came to rest. What is known of it beforehand, its
# distance field and table of point pairs and the grasps that the hand can have of it, is prepared
# once.

# %%
bottle = prepare_object()
run = PosePickRun(seed=0, thing=bottle)
context = run.simulator.get_mutable_context()
station, station_context = run.station, run.station_context()
plant = station.GetSubsystemByName("plant")
X_WO = run.X_WO

views, colors = [], []
for name, K in run.cameras.items():
    depth = station.GetOutputPort(f"{name}.depth_image").Eval(station_context).data[:, :, 0].copy()
    colors.append(station.GetOutputPort(f"{name}.rgb_image").Eval(station_context).data.copy())
    X_WC = station.GetOutputPort(f"{name}.X_WC").Eval(station_context)
    model = CameraModel.from_K(K, depth.shape[1], depth.shape[0])
    views.append(DepthView(depth, PosedCamera(model, X_WC)))

# %% [markdown]
# ## Where it is
#
# The bin's floor and walls are subtracted from the fused cloud, and the largest piece that is left
# is looked at: point pairs vote, candidates are refined, the best is checked against all that the
# cameras saw. The bottle looks the same after half a turn about its axis; the answer says so, and
# both poses are as good.

# %%
finder = FinderConfig()
cloud = object_cloud(views, bin_geometry(station, "bin0"), finder)
found = locate(cloud, bottle.known, finder.locate, views=views)
assert found.X_WO is not None
assert found.status in (RegistrationStatus.SUCCESS, RegistrationStatus.AMBIGUOUS)
error = adds(bottle.shape.cloud_O.points, X_WO, found.X_WO)
print(f"{found.status.value}: {found.message}; ADD-S {1e3 * error:.2f} mm, {len(cloud)} points")
assert error < 0.005

surface = (found.X_WO @ bottle.shape.cloud_O.points.T).T
fig, axes = plt.subplots(2, 3, figsize=(13, 6.8))
for column, view, color in zip(axes.T, views, colors, strict=True):
    depth, (model, X_WC) = view.depth, view.camera
    picture = colorize_depth(depth, 0.5, 1.4)
    picture[depth == 0] = (230, 30, 30)
    column[0].imshow(picture)
    column[1].imshow(draw_points(color, model.K, X_WC, surface[::5], radius=1))
    for ax in column:
        ax.axis("off")
axes[0, 1].set_title("depth (red: nothing returned)")
axes[1, 1].set_title("the bottle where it was found")
fig.tight_layout()
save_figure(fig, "found")

# %% [markdown]
# ## What is planned
#
# The task does the same when the simulation starts, and plans at once: a grasp by which the bottle
# can be lifted here and set down there, and the whole way of the arm between, clear of bins and of
# itself.

# %%
run.advance()
(look,) = run.memory.looks
assert look.sight.X_WO is not None
assert adds(bottle.shape.cloud_O.points, X_WO, look.sight.X_WO) < 0.005
transfer = run.memory.transfer
assert transfer is not None
motions = ("approach", "lift", "carry", "lower", "retreat", "home")
paths = [getattr(transfer, name) for name in motions]
for before, after in itertools.pairwise(paths):
    assert np.allclose(before.q_end, after.value(0.0), atol=1e-6)  # One way, without a jump.

plant_context = plant.GetMyMutableContextFromRoot(context)
arm, hand = (plant.GetModelInstanceByName(name) for name in ("iiwa", "wsg"))
body = plant.GetBodyByName("base_link", plant.GetModelInstanceByName("mustard_bottle_0"))


def set_scene(q, X_bottle=None):
    """Puts the arm at q and the bottle at a pose; None: as the hand holds it. Returns its pose."""
    plant.SetPositions(plant_context, arm, q)
    if X_bottle is None:
        X_WG = plant.EvalBodyPoseInWorld(plant_context, plant.GetBodyByName("body", hand))
        X_bottle = X_WG @ transfer.X_OG.inverse()
    plant.SetFreeBodyPose(plant_context, body, X_bottle)
    return X_bottle


def apart(X, Y):
    """Distance of two poses of the bottle, half turns not counted [m]."""
    return adds(bottle.shape.cloud_O.points, X, Y)


held_at_grasp = set_scene(transfer.approach.q_end)
assert apart(held_at_grasp, look.sight.X_WO) < 0.002  # The hand closes where the bottle was found,
set_down = set_scene(transfer.lower.q_end)
assert apart(set_down, transfer.X_WTarget) < 0.005  # and opens where it is to be set down.
if run.memory.to_goal:  # Some poses need a rest between: a bottle may first be laid elsewhere.
    assert apart(transfer.X_WTarget, run.X_WGoal) < 0.02
    assert set_down.rotation().matrix()[2, 2] > 0.99  # Upright.

eye = look_at([1.75, 1.25, 1.15], [0.2, 0.2, 0.2])
moments = (
    ("grasp", transfer.approach.q_end, X_WO),
    ("lift", transfer.lift.q_end, None),
    ("carry", transfer.carry.value(0.5 * transfer.carry.duration), None),
    ("lower", transfer.lower.q_end, None),
    ("retreat", transfer.retreat.q_end, set_down),
    ("home", transfer.home.q_end, set_down),
)
fig, axes = plt.subplots(2, 3, figsize=(13, 6.8))
for ax, (title, q, X_bottle) in zip(axes.flat, moments, strict=True):
    set_scene(q, X_bottle)
    ax.imshow(render(run.diagram, context, eye, width=480, height=360))
    ax.set_title(title)
    ax.axis("off")
fig.tight_layout()
save_figure(fig, "planned")
seconds = sum(path.duration for path in paths)
print(f"{seconds:.1f} s of motion")
