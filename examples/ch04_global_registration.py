# %% [markdown]
# # A pose without a guess
#
# Every method that follows a slope needs a start near the end. Where it comes from: short pieces of
# geometry that look alike wherever they are, such as two points with normals, or the neighbourhood
# of one point, are matched between model and scene; each match proposes a pose; wrong ones disagree
# with each other, right ones agree. (Sections 4.4 and 4.5.6.)

# %%
import time

import matplotlib.pyplot as plt
import numpy as np
from pydrake.geometry import Box as Solid
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.planning import RobotDiagramBuilder
from pydrake.systems.sensors import CameraInfo

from prehensile.models.packages import package_map
from prehensile.models.registry import find_model
from prehensile.perception import (
    Box,
    CameraModel,
    DepthConfig,
    DepthNoiseConfig,
    DepthView,
    PosedCamera,
    add_depth_noise,
    downsample,
    fuse,
    mesh_of_model,
    sample_mesh_uniform,
)
from prehensile.perception.registration import (
    KnownObject,
    LocateConfig,
    RegistrationStatus,
    fpfh,
    locate,
    match_features,
    refine_pose,
    register_correspondences,
)
from prehensile.perception.segmentation import euclidean_clusters, subtract
from prehensile.viz.figures import save_figure
from prehensile.viz.render import look_at, render, render_depth

# %% [markdown]
# ## The scene
#
# A mustard bottle has fallen over, between a box of sugar and a can of soup. Three noisy depth
# cameras look at them; the table is subtracted.

# %%
X_WO = {
    "mustard_bottle": RigidTransform(RollPitchYaw(np.pi / 2, 0, 0.6), [0.0, 0.02, 0.0]),
    "sugar_box": RigidTransform(RollPitchYaw(0, 0, 0.4), [-0.14, 0.12, 0.0]),
    "tomato_soup_can": RigidTransform(RollPitchYaw(0, 0, 2.2), [0.13, 0.13, 0.0]),
}
builder = RobotDiagramBuilder(time_step=0.0)
plant, parser = builder.plant(), builder.parser()
parser.package_map().AddMap(package_map())
for name in X_WO:
    parser.AddModels(url=find_model(name).url)
table = RigidTransform([0, 0, -0.05])
plant.RegisterVisualGeometry(
    plant.world_body(), table, Solid(2, 2, 0.1), "table", np.array([0.6, 0.55, 0.5, 1.0])
)
plant.Finalize()
diagram = builder.Build()
context = diagram.CreateDefaultContext()
for name, X in X_WO.items():  # Each is set down on the table.
    lowest = (X @ mesh_of_model(name).vertices.T)[2].min()
    X.set_translation(X.translation() - [0, 0, lowest])
    body = plant.GetBodyByName("base_link", plant.GetModelInstanceByName(name))
    plant.SetFreeBodyPose(plant.GetMyMutableContextFromRoot(context), body, X)

info = CameraInfo(640, 480, 615.0, 615.0, 319.5, 239.5)
rng = np.random.default_rng(0)
views = []
for eye in ([0.6, 0.3, 0.6], [-0.2, -0.7, 0.6], [-0.5, 0.5, 0.6]):
    X_WC = look_at(eye, [0, 0, 0.05])
    ideal = render_depth(diagram, context, X_WC, info)
    noisy = add_depth_noise(ideal, info.intrinsic_matrix(), DepthNoiseConfig(), rng)
    views.append(DepthView(noisy, PosedCamera(CameraModel.from_drake(info), X_WC)))
region = Box(RigidTransform([0, 0, 0.15]), np.array([0.6, 0.6, 0.4]))
like_d415 = DepthConfig(min_depth=0.3, max_depth=1.5, window=9, noise_quadratic=0.0026)
cloud = fuse(
    [view.depth for view in views], [view.camera for view in views], region, 0.003, config=like_d415
)
scene = subtract(cloud, [Box(table, np.array([2.0, 2.0, 0.1]))], margin=0.008)
labels = euclidean_clusters(scene.points, 0.012, min_points=60)
assert labels.max() == 2  # Three pieces.

eye = look_at([0.35, -0.5, 0.45], [0, 0.05, 0.06])
picture = render(diagram, context, eye)
fig = plt.figure(figsize=(11, 4.4))
ax = fig.add_subplot(1, 2, 1)
ax.imshow(picture)
ax.axis("off")
ax = fig.add_subplot(1, 2, 2, projection="3d")
shade = plt.get_cmap("tab10")(labels % 10)
ax.scatter(*scene.points.T, c=shade, s=1)
ax.set_box_aspect(np.ptp(scene.points, axis=0))
ax.view_init(35, -55)
ax.set_title("the cloud, in pieces")
save_figure(fig, "scene")

# %% [markdown]
# ## Point pairs vote
#
# Two points with normals have four numbers that no motion changes: their distance, the angles
# between it and the normals, and the angle between the normals. A table holds all pairs of the
# model by these. A pair of the scene looks up the pairs of the model that it may be, and each of
# them says where the model would lie. Poses with many votes, the best of thousands of proposals,
# are good starts, whatever else is in the scene.

# %%
bottle = KnownObject.from_mesh(mesh_of_model("mustard_bottle"), field_spacing=0.004)
half_turn = RigidTransform(RollPitchYaw(0, 0, np.pi), [0, 0, 0])
alike = (RigidTransform(), half_turn)


def errors(X, truth, symmetries):
    """Distance of the origins [m] and angle [deg]; the nearest of poses that look the same."""
    nearest = (np.inf, np.inf)
    for S in symmetries:
        E = (truth @ S).inverse() @ X
        angle = np.degrees(E.rotation().ToAngleAxis().angle())
        nearest = min(nearest, (angle, np.linalg.norm(E.translation())))
    return nearest[1], nearest[0]


thin = downsample(scene, 0.008)
votes = bottle.pairs.vote(thin, num_references=len(thin), max_poses=60)
poses = [RigidTransform(X) for X in votes.X_WO]
truth = X_WO["mustard_bottle"]
good = np.array([max(e[0] / 0.03, e[1] / 25) < 1 for e in (errors(X, truth, alike) for X in poses)])
print(
    f"{good.sum()} of {len(poses)} proposals are near, the first of them is number {good.argmax()}"
)
assert good[:5].any()
assert good.mean() < 0.5

K = CameraInfo(640, 480, 0.7).intrinsic_matrix()  # Of the picture.


def pixels(X, points_O):
    """(N, 2) where an object's points are in the picture."""
    p_C = np.asarray(eye.inverse() @ (X @ points_O.T)).T
    return (p_C[:, :2] / p_C[:, 2:]) @ K[:2, :2].T + K[:2, 2]


fig, axes = plt.subplots(2, 4, figsize=(13, 5.2))
for k, ax in enumerate(axes.flat):
    ax.imshow(picture)
    at = pixels(poses[k], bottle.cloud.points)
    ax.plot(*at.T, ".", ms=2, color="lime" if good[k] else "red")
    ax.set(title=f"{k}: {votes.votes[k]:.0f} votes", xlim=(60, 580), ylim=(440, 60))
    ax.axis("off")
fig.tight_layout()
save_figure(fig, "votes")

# %% [markdown]
# ## Neighbourhoods match
#
# The other way: around each point, histograms of how the normals turn (FPFH). Smooth things look
# alike in many places, and noise does the rest: of the matches between the bottle's piece and its
# model not one in ten is right. But the right ones keep the distances among each other,
# and for the wrong ones to do so, too, would be a great coincidence.

# %%
middles = np.array([scene.points[labels == k].mean(axis=0) for k in range(3)])
nearest = np.linalg.norm(middles - truth.translation(), axis=1).argmin()
piece = downsample(scene.select(labels == nearest), 0.005)
model = downsample(sample_mesh_uniform(mesh_of_model("mustard_bottle"), 40_000, seed=0), 0.005)
matches = match_features(fpfh(piece, 0.025), fpfh(model, 0.025), mutual=False)
p_W, p_O = piece.points[matches[:, 0]], model.points[matches[:, 1]]
off = np.min(
    [np.linalg.norm((truth @ S @ p_O.T).T - p_W, axis=1) for S in alike],
    axis=0,
)
consensus = register_correspondences(p_O, p_W, 0.006)
assert consensus.X_WO is not None
distance, angle = errors(consensus.X_WO, truth, alike)
print(
    f"{(off < 0.01).mean():.1%} of {len(matches)} matches are right; {consensus.inliers.sum()} "
    f"agree, on a pose {1e3 * distance:.1f} mm and {angle:.1f}° off"
)
assert (off < 0.01).mean() < 0.1
assert distance < 0.01
assert angle < 15
refined = refine_pose(piece, bottle.field, consensus.X_WO)
assert refined.X_WO is not None
assert errors(refined.X_WO, truth, alike)[0] < 0.002
assert errors(refined.X_WO, truth, alike)[1] < 2

fig, axes = plt.subplots(1, 2, figsize=(12, 4.6), sharey=True)
shift = np.array([0.0, 0.3])
flat_model, flat_piece = model.points[:, [0, 2]] + shift, piece.points[:, :2]
for ax, chosen, title in (
    (axes[0], rng.permutation(len(matches))[:150], "150 of the matches"),
    (axes[1], np.flatnonzero(consensus.inliers), "those that agree"),
):
    ax.plot(*flat_piece.T, ".", ms=1.5, color="0.5")
    ax.plot(*flat_model.T, ".", ms=1.5, color="black")
    for i in chosen:
        ends = np.stack([p_W[i, :2], p_O[i, [0, 2]] + shift])
        ax.plot(*ends.T, lw=0.6, color="tab:green" if off[i] < 0.01 else "tab:red")
    ax.set(aspect="equal", title=title)
    ax.axis("off")
save_figure(fig, "matches")

# %% [markdown]
# ## Located, or not
#
# `locate` does all of it: vote, refine all candidates on few points and the best on all, then ask
# whether the scene shows what the pose promises, whether what is near agrees with it, and whether
# no camera saw through. It finds the bottle, and says that the half turn about its axis fits as
# well. It finds the can, and says that a turn about its axis is free. And of a can of meat, which
# is not in the scene, it says so, although a pose was found that fits best.

# %%
config = LocateConfig(num_references=100, max_violation=0.3)
found = {}
for name in ("mustard_bottle", "tomato_soup_can", "potted_meat_can"):
    if name == "mustard_bottle":
        known = bottle
    else:
        known = KnownObject.from_mesh(mesh_of_model(name), field_spacing=0.004)
    start = time.process_time()
    found[name] = locate(scene, known, config, views=views)
    milliseconds = 1e3 * (time.process_time() - start)
    answer = found[name]
    print(f"{name}: {answer.status.value}, {answer.message} ({milliseconds:.0f} ms)")
at_bottle, at_can = found["mustard_bottle"], found["tomato_soup_can"]
assert at_bottle.status is RegistrationStatus.AMBIGUOUS
assert at_bottle.X_WO is not None
assert errors(at_bottle.X_WO, truth, alike)[0] < 0.002
assert errors(at_bottle.X_WO, truth, alike)[1] < 2
(other,) = at_bottle.alternatives
assert errors(other, at_bottle.X_WO, [half_turn])[1] < 3
assert at_can.status is RegistrationStatus.DEGENERATE
assert at_can.X_WO is not None
assert np.linalg.norm(at_can.X_WO.translation() - X_WO["tomato_soup_can"].translation()) < 0.002
assert found["potted_meat_can"].status is RegistrationStatus.NO_CONSENSUS

fig, axes = plt.subplots(1, 3, figsize=(13, 3.6))
for ax, (name, answer) in zip(axes, found.items(), strict=True):
    ax.imshow(picture)
    if answer.X_WO is not None:
        surface = sample_mesh_uniform(mesh_of_model(name), 1500, seed=0).points
        believed = answer.status is not RegistrationStatus.NO_CONSENSUS
        ax.plot(*pixels(answer.X_WO, surface).T, ".", ms=1, color="lime" if believed else "red")
    ax.set(title=f"{name}: {answer.status.value}", xlim=(60, 580), ylim=(440, 60))
    ax.axis("off")
fig.tight_layout()
save_figure(fig, "located")
