# %% [markdown]
# # Cameras and clouds
#
# A mustard bottle on a table, and three ideal RGB-D cameras around it. From the images of one
# camera come the points that its pixels see; three views merge to one cloud; and what is missing
# says as much as what is there: the back that nobody sees, and the space that every ray has crossed
# without meeting anything. (Example 4.1, and section 4.2.)

# %%
import dataclasses as dc

import matplotlib.pyplot as plt
import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw
from scipy.spatial import KDTree

from prehensile.perception import (
    Box,
    CameraModel,
    DepthView,
    PointCloud,
    PosedCamera,
    crop,
    fuse,
    merge,
    mesh_of_model,
    sample_mesh_poisson_disc,
    unproject,
)
from prehensile.perception.visibility import visible_points
from prehensile.perception.volume import Occupancy, fuse_volume
from prehensile.station.build import build
from prehensile.station.cameras import d415_camera_config
from prehensile.station.scenario_file import loads_scenario
from prehensile.viz.figures import save_figure
from prehensile.viz.images import colorize_depth, colorize_labels
from prehensile.viz.render import look_at, render

SCENE = """
directives:
- add_model: {name: table, file: package://prehensile/table/table.sdf}
- add_weld: {parent: world, child: table::base_link}
- add_model:
    name: mustard
    file: package://prehensile/mustard_bottle/mustard_bottle.sdf
    default_free_body_pose:
        base_link: {translation: [0, 0, 0.0955], rotation: !Rpy {deg: [0, 0, 25]}}
"""
X_WO = RigidTransform(RollPitchYaw(0, 0, np.deg2rad(25)), [0, 0, 0.0955])

# %% [markdown]
# ## The images
#
# A camera is a system with output ports, and evaluating a port takes the picture. The pixels of the
# label image hold the number of the body that they see: no real camera knows that, but it is how
# training data are made.

# %%
eyes = [[0.55, -0.25, 0.35], [-0.05, 0.65, 0.35], [-0.5, -0.35, 0.35]]
configs = {
    f"camera{i}": d415_camera_config(f"camera{i}", look_at(eye, [0, 0, 0.08]))
    for i, eye in enumerate(eyes)
}
station = build(dc.replace(loads_scenario(SCENE), cameras=configs))
context = station.CreateDefaultContext()


def image(name):
    """What a camera's port shows: (H, W, channels)."""
    return station.GetOutputPort(name).Eval(context).data


names = list(configs)
colors = [image(f"{name}.rgb_image")[:, :, :3].copy() for name in names]
depths = [image(f"{name}.depth_image")[:, :, 0].copy() for name in names]
labels = [image(f"{name}.label_image")[:, :, 0].copy() for name in names]
assert depths[0].shape == (480, 640)
bottle = labels[0][240, 320]  # The camera looks at it.
assert len(np.unique(labels[0])) == 3  # Bottle, table, and the nothing beyond.

fig, axes = plt.subplots(1, 3, figsize=(11, 3))
pictures = (colors[0], colorize_depth(depths[0], 0.4, 1.2), colorize_labels(labels[0]))
for ax, picture, title in zip(axes, pictures, ("colour", "depth", "labels"), strict=True):
    ax.imshow(picture)
    ax.set_title(title)
    ax.set_axis_off()
fig.tight_layout()
save_figure(fig, "images")

# %% [markdown]
# ## Depth image to points
#
# A pixel $(u, v)$ of a pinhole with focal length $f$ and principal point $(c_u, c_v)$ whose depth
# is $z$ sees the point
#
# $$ {}^C p = z \left( \frac{u - c_u}{f}, \frac{v - c_v}{f}, 1 \right) $$
#
# in the camera's frame C, which has $z$ along the optical axis, $x$ to the right and $y$ down. The
# depth is not the distance along the ray, but its part along the axis.

# %%
focal = configs["camera0"].focal_x()
cu, cv = configs["camera0"].principal_point()
camera = CameraModel(640, 480, focal, focal, cu, cv)
cameras = [
    PosedCamera(camera, station.GetOutputPort(f"{name}.X_WC").Eval(context)) for name in names
]

p_C = unproject(depths[0], camera)
v, u = 200, 330
by_hand = depths[0][v, u] * np.array([(u - cu) / focal, (v - cv) / focal, 1])
np.testing.assert_allclose(p_C[v, u], by_hand, rtol=1e-6)
np.testing.assert_allclose(camera.project(p_C[v, u]), [u, v], atol=1e-3)  # And back.

# Drake's own system does the same, straight to the world frame.
from_drake = station.GetOutputPort("camera0.point_cloud").Eval(context).xyzs().T
X_WC = cameras[0].X_WC
mine = p_C.reshape(-1, 3) @ X_WC.rotation().matrix().T + X_WC.translation()
seen = np.isfinite(mine).all(axis=1)
np.testing.assert_allclose(mine[seen], from_drake[seen], atol=1e-5)

# %% [markdown]
# Each point keeps its pixel's colour and label, and where the camera stood. With known camera poses
# ${}^W X^C$, merging views is putting lists together.

# %%
views = []
for depth, color, label, posed in zip(depths, colors, labels, cameras, strict=True):
    points = unproject(depth, posed.model)
    valid = np.isfinite(points[..., 0])
    cloud = PointCloud(
        points[valid],
        colors=color[valid],
        labels=label[valid].astype(np.int64),
        sensor_origins=np.zeros(3),
    )
    views.append(cloud.transformed(posed.X_WC))
merged = merge(views)
assert len(merged) == sum(len(view) for view in views)

on_bottle = [view.select(view.labels == bottle) for view in views]
surface = mesh_of_model("mustard_bottle").transformed(X_WO).surface()
for view in on_bottle:
    assert np.abs(surface.signed_distance(view.points)).max() < 0.004

# %% [markdown]
# For work one wants fewer points, evenly spread, with normals: `fuse` makes normals in each image,
# where neighbours are known, and averages points, normals and colours over voxels of a region.

# %%
region = Box(RigidTransform([0, 0, 0.1]), np.array([0.3, 0.3, 0.24]))
cloud = fuse(depths, cameras, region, 0.004, color_images=colors)
assert len(cloud) < 0.2 * len(crop(merged, region))
toward = np.einsum("ij,ij->i", cloud.require_sensor_origins() - cloud.points, cloud.normals)
assert (toward > 0).all()


def draw(ax, cloud, title):
    """A cloud in its colours."""
    p = cloud.points
    ax.scatter(*p.T, c=cloud.colors / 255, s=2, depthshade=False)
    ax.set(xlim=(-0.12, 0.12), ylim=(-0.12, 0.12), zlim=(-0.02, 0.2), title=title)
    ax.set_box_aspect((1, 1, 0.92))
    ax.view_init(elev=20, azim=100)
    ax.set_axis_off()


fig = plt.figure(figsize=(11, 3.8))
one = crop(views[0], region)
for i, (part, title) in enumerate(
    (
        (one.select(slice(None, None, 5)), "one view, from behind"),
        (crop(merged, region).select(slice(None, None, 15)), "three views"),
        (cloud, "fused, 4 mm voxels"),
    )
):
    draw(fig.add_subplot(1, 3, i + 1, projection="3d"), part, title)
fig.tight_layout()
save_figure(fig, "clouds")
save_figure(render(station, context, look_at([-0.45, 0.4, 0.4], [0, 0, 0.09])), "scene")

# %% [markdown]
# ## What is not seen
#
# Line of sight is all a camera has. Of points spread evenly over the bottle, one view covers less
# than half, and three views still miss the bottom. Which points a camera *could* see can be said
# without rendering anything, from the points alone: reflected at a sphere around the camera, the
# visible ones lie on the convex hull.

# %%
model = sample_mesh_poisson_disc(mesh_of_model("mustard_bottle"), count=3000, seed=0)
on_surface = model.transformed(X_WO)


def covered(cloud):
    """Which of the bottle's points have a point of the cloud within 3 mm."""
    return KDTree(cloud.points).query(on_surface.points)[0] < 0.003


coverage = [covered(view) for view in on_bottle]
for mask in coverage:
    assert mask.mean() < 0.5
total = np.any(coverage, axis=0)
assert 0.8 < total.mean() < 0.95
bottom = on_surface.points[:, 2] < 0.002
assert total[bottom].mean() < 0.2  # What is missing is the bottom.
assert total[~bottom].mean() > 0.98  # The rest: faces of the cap that lie inside of it.

predicted = [visible_points(on_surface.points, posed.X_WC.translation()) for posed in cameras]
for guess, mask in zip(predicted, coverage, strict=True):
    assert (guess == mask).mean() > 0.9

# %% [markdown]
# ## What is known to be empty
#
# A cloud says where something is; the depth image says in addition that between the camera and
# there is nothing. A grid of voxels keeps that: *occupied* at the surface, *free* where rays went
# through, *unknown* behind it. Some of the unknown can only be cleared by moving a camera; the
# inside of the bottle never.

# %%
depth_views = [DepthView(d, posed) for d, posed in zip(depths, cameras, strict=True)]
room = Box(RigidTransform([0, 0, 0.11]), np.array([0.6, 0.6, 0.3]))
one_view = fuse_volume(depth_views[:1], room, 0.005)
all_views = fuse_volume(depth_views, room, 0.005)


def shares(volume):
    """Which part of the room is unknown, free, occupied."""
    state = volume.occupancy()
    return {kind.name.lower(): float((state == kind).mean()) for kind in Occupancy}


assert shares(all_views)["unknown"] < shares(one_view)["unknown"]
inside = np.array([[0, 0, 0.05], [0, 0, 0.1]])
assert (all_views.occupancy_at(inside) == Occupancy.UNKNOWN).all()
beside = [0.0, 0.1, 0.15]
assert all_views.occupancy_at([beside])[0] == Occupancy.FREE

fig, axes = plt.subplots(1, 2, figsize=(10, 2.9), sharey=True)
x, z = np.meshgrid(np.linspace(-0.29, 0.29, 291), np.linspace(-0.03, 0.25, 141))
for ax, volume, title in zip(axes, (one_view, all_views), ("one view", "three views"), strict=True):
    slice_points = np.stack([x, np.zeros_like(x), z], axis=-1).reshape(-1, 3)
    state = volume.occupancy_at(slice_points).reshape(x.shape)
    extent = (x.min(), x.max(), z.min(), z.max())
    ax.imshow(state, origin="lower", extent=extent, cmap="viridis", vmin=-1, vmax=1)
    parts = ", ".join(f"{share:.0%} {name}" for name, share in shares(volume).items())
    ax.set(title=f"{title}: {parts}", xlabel="x [m]")
    ax.title.set_fontsize(9)
axes[0].set_ylabel("z [m]")
fig.tight_layout()
save_figure(fig, "free_space")
