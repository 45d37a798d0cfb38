# %% [markdown]
# # A brick from a cloud
#
# In chapter 3 the brick's pose was given. Here it is found: depth images become a cloud, what is
# known of the scene is taken away, what is left falls into pieces, and the brick's shape is laid
# onto the right one. (Exercise 4.9.)

# %%
import matplotlib.pyplot as plt
import numpy as np
from pydrake.common.eigen_geometry import AngleAxis
from pydrake.math import RigidTransform, RotationMatrix

from prehensile.perception import (
    Box,
    CameraModel,
    DepthConfig,
    DepthNoiseConfig,
    PosedCamera,
    add_depth_noise,
    crop,
    fuse,
    mesh_of_model,
    sample_mesh_poisson_disc,
)
from prehensile.perception.distance_field import cached_distance_field
from prehensile.perception.registration import (
    IcpConfig,
    IcpModel,
    RefineConfig,
    RegistrationStatus,
    RobustLoss,
    icp,
    refine_poses,
)
from prehensile.perception.segmentation import euclidean_clusters, subtract
from prehensile.station.build import build
from prehensile.station.cameras import d415_camera_config
from prehensile.station.scenario_file import load_scenario
from prehensile.viz.figures import save_figure
from prehensile.viz.images import as_rgb
from prehensile.viz.render import look_at

# %% [markdown]
# ## What the cameras see
#
# The station of chapter 3, with two cameras beside the table, and what a D415 would make of the
# scene: noise, ragged edges, returns missed.

# %%
scenario = load_scenario("pick_brick")
scenario.cameras.clear()
for i, eye in enumerate(([1.1, 0.35, 0.6], [0.75, -0.8, 0.55])):
    scenario.cameras[f"camera{i}"] = d415_camera_config(f"camera{i}", look_at(eye, [0.5, -0.1, 0]))
station = build(scenario)
context = station.CreateDefaultContext()
plant = station.GetSubsystemByName("plant")
body = plant.GetBodyByName("base_link", plant.GetModelInstanceByName("foam_brick"))
X_WO = plant.EvalBodyPoseInWorld(plant.GetMyContextFromRoot(context), body)

rng = np.random.default_rng(0)
cameras, depths, colors = [], [], []
for name, config in scenario.cameras.items():
    _, depth_camera = config.MakeCameras()
    info = depth_camera.core().intrinsics()
    X_WC = station.GetOutputPort(f"{name}.X_WC").Eval(context)
    cameras.append(PosedCamera(CameraModel.from_drake(info), X_WC))
    colors.append(as_rgb(station.GetOutputPort(f"{name}.rgb_image").Eval(context).data))
    ideal = station.GetOutputPort(f"{name}.depth_image").Eval(context).data[:, :, 0]
    K = info.intrinsic_matrix()
    depths.append(add_depth_noise(ideal, K, DepthNoiseConfig(), rng, colors[-1]))

fig, axes = plt.subplots(2, 2, figsize=(9, 6.6))
for row, color, depth in zip(axes, colors, depths, strict=True):
    row[0].imshow(color)
    row[1].imshow(np.where((depth > 0) & np.isfinite(depth), depth, np.nan), vmin=0.3, vmax=1.5)
    for ax in row:
        ax.axis("off")
axes[0, 0].set_title("colour")
axes[0, 1].set_title("depth (white: nothing returned)")
fig.tight_layout()
save_figure(fig, "images")

# %% [markdown]
# ## (a) Segmentation
#
# One cloud of both images inside a box over the table, with normals; without the points that the
# table accounts for; and of the pieces that are left, those that lie no further apart than 15 mm,
# the red one. The hand and the arm hang above the table and are pieces, too.

# %%
region = Box(RigidTransform([0.55, 0.0, 0.2]), np.array([0.6, 0.9, 0.5]))
like_d415 = DepthConfig(min_depth=0.3, max_depth=1.5, window=9, noise_quadratic=0.0026)
cloud = fuse(depths, cameras, region, 0.004, color_images=colors, config=like_d415)
table = Box(RigidTransform([0.5, 0.0, -0.05]), np.array([2.0, 2.0, 0.1]))
above = subtract(cloud, [table], margin=0.008)
labels = euclidean_clusters(above.points, 0.015, min_points=60)
assert above.colors is not None
pieces = [above.select(labels == k) for k in range(labels.max() + 1)]
redness = []
for piece in pieces:
    assert piece.colors is not None
    redness.append(np.mean(piece.colors[:, 0] - 0.5 * piece.colors[:, 1:].sum(axis=1)))
brick = pieces[int(np.argmax(redness))]
assert len(pieces) >= 2
assert max(redness) > 40
true_box = Box(X_WO, np.array([0.05, 0.075, 0.05]) + 0.012)
assert len(crop(brick, true_box)) > 0.97 * len(brick)  # Hardly a point of anything else,
assert len(brick) > 0.9 * len(crop(above, true_box))  # and hardly one missing.

fig = plt.figure(figsize=(12, 4.6))
views = (
    (cloud, cloud.colors / 255, "the cloud"),
    (above, plt.get_cmap("tab10")(labels % 10), "without the table, in pieces"),
)
for k, (shown, paint, title) in enumerate(views):
    ax = fig.add_subplot(1, 2, 1 + k, projection="3d")
    ax.scatter(*shown.points.T, c=paint, s=1.5)
    ax.set(title=title, xlim=(0.25, 0.85), ylim=(-0.45, 0.45), zlim=(0, 0.45))
    ax.set_box_aspect((0.6, 0.9, 0.45))
    ax.view_init(25, -35)
save_figure(fig, "segmentation")

# %% [markdown]
# ## (b) Iterative closest points
#
# From a crude guess: in the middle of the piece, upright, turned by chance by some 30° from the
# truth. The few points at ragged edges count little under a robust loss.

# %%
mesh = mesh_of_model("foam_brick")
model = IcpModel(sample_mesh_poisson_disc(mesh, count=2000, seed=0))
guess = RigidTransform(brick.points.mean(axis=0))
config = IcpConfig(loss=RobustLoss.GEMAN_MCCLURE, loss_scale=0.005)
history: list[RigidTransform] = []
found = icp(brick, model, guess, config, history=history)
assert found.X_WO is not None


def errors(X):
    """Distance of the origins [m], and the angle [deg] between two poses."""
    E = X_WO.inverse() @ X
    return np.linalg.norm(E.translation()), np.degrees(E.rotation().ToAngleAxis().angle())


start, end = errors(guess), errors(found.X_WO)
print(f"from {1e3 * start[0]:.1f} mm, {start[1]:.0f}° to {1e3 * end[0]:.2f} mm, {end[1]:.2f}°")
assert start[0] > 0.003
assert np.isclose(start[1], 30, atol=0.1)
assert end[0] < 0.003
assert end[1] < 2

fig, axes = plt.subplots(1, 2, figsize=(9.5, 4.4))
outline = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]]) * [0.025, 0.0375]
corners = np.column_stack([outline, np.full(5, 0.025)])
for k, X in enumerate(history):
    shade = plt.get_cmap("Blues")(0.25 + 0.75 * k / (len(history) - 1))
    axes[0].plot(*(X @ corners.T)[:2], color=shade, lw=1)
axes[0].plot(*(X_WO @ corners.T)[:2], "--", color="tab:red", label="truth")
axes[0].plot(*brick.points[:, :2].T, ".", color="0.6", ms=2, zorder=0)
axes[0].set(aspect="equal", xlabel="x [m]", ylabel="y [m]", title="from above")
axes[0].legend()
steps = np.array([errors(X) for X in history])
axes[1].semilogy(1e3 * steps[:, 0], label="origin [mm]")
axes[1].semilogy(steps[:, 1], label="angle [deg]")
axes[1].set(xlabel="iteration", title="error")
axes[1].legend()
fig.tight_layout()
save_figure(fig, "icp")

# %% [markdown]
# ## Eight right answers
#
# The brick is a box with a square cross-section. Quarter turns about its long axis $y$ and half
# turns about the others lay it onto itself: eight rotations that no geometry can tell apart. Starts
# turned by them end in eight poses with the same cost, and a method that looks at several starts
# says so, by its status. Each of them is as good to grasp; to tell them apart takes colour or
# print.

# %%
field = cached_distance_field(mesh)
quarters = [RotationMatrix.MakeYRotation(0.5 * np.pi * k) for k in range(4)]
turns = [
    R @ half for R in quarters for half in (RotationMatrix(), RotationMatrix.MakeXRotation(np.pi))
]
tilt = RotationMatrix(AngleAxis(0.3, np.array([0.6, 0.64, 0.48])))
starts = [X_WO @ RigidTransform(R @ tilt, [0.004, -0.003, 0.005]) for R in turns]
answers = refine_poses(brick, field, starts, RefineConfig(num_finalists=8))
assert answers.best.status is RegistrationStatus.AMBIGUOUS
print(answers.best.message)
for R, result in zip(turns, answers.results, strict=True):
    assert result is not None
    assert result.X_WO is not None
    E = X_WO.inverse() @ result.X_WO
    assert np.degrees((R.inverse() @ E.rotation()).ToAngleAxis().angle()) < 2
    assert np.linalg.norm(E.translation()) < 0.003
assert np.ptp(answers.costs) < 0.05 * answers.costs.min()
