# %% [markdown]
# # Normals, flat pieces, and pieces
#
# A point says where a surface is; its neighbours say which way it faces, how much it bends, and
# what it belongs to. From that alone a heap in a bin falls into planes and into objects, before any
# of them is known. (Sections 4.2 and 5.3.)

# %%
import time

import matplotlib.pyplot as plt
import numpy as np
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
    PointCloud,
    PosedCamera,
    add_depth_noise,
    convex_segments,
    crop,
    downsample,
    estimate_normals,
    fuse,
    mesh_of_model,
    surface_variation,
    unproject,
)
from prehensile.perception.distance_field import cached_distance_field
from prehensile.perception.planes import plane_regions
from prehensile.perception.segmentation import euclidean_clusters
from prehensile.viz.figures import save_figure
from prehensile.viz.render import look_at, render, render_depth

# %% [markdown]
# ## A bin with three things in it
#
# The bottle leans against the box of sugar. Two noisy depth cameras see them.

# %%
X_WO = {
    "bin": RigidTransform(),
    "mustard_bottle": RigidTransform(RollPitchYaw(np.pi / 2, 0, 0.5), [0.02, -0.07, 0.0]),
    "sugar_box": RigidTransform(RollPitchYaw(np.pi / 2, 0, 1.2), [-0.01, 0.06, 0.0]),
    "tomato_soup_can": RigidTransform(RollPitchYaw(0, 0, 0), [-0.1, -0.035, 0.0]),
}
things = ("mustard_bottle", "sugar_box", "tomato_soup_can")
meshes = {name: mesh_of_model(name) for name in X_WO}
builder = RobotDiagramBuilder(time_step=0.0)
plant, parser = builder.plant(), builder.parser()
parser.package_map().AddMap(package_map())
for name in X_WO:
    parser.AddModels(url=find_model(name).url)
bin_frame = plant.GetBodyByName("base_link", plant.GetModelInstanceByName("bin")).body_frame()
plant.WeldFrames(plant.world_frame(), bin_frame)
plant.Finalize()
diagram = builder.Build()
context = diagram.CreateDefaultContext()
floor = 0.03
for name in things:  # Each is set down on the bin's floor.
    X = X_WO[name]
    X.set_translation(X.translation() + [0, 0, floor - (X @ meshes[name].vertices.T)[2].min()])
    body = plant.GetBodyByName("base_link", plant.GetModelInstanceByName(name))
    plant.SetFreeBodyPose(plant.GetMyMutableContextFromRoot(context), body, X)

info = CameraInfo(640, 480, 615.0, 615.0, 319.5, 239.5)
rng = np.random.default_rng(0)
cameras, depths = [], []
for eye in ([0.3, -0.45, 0.75], [-0.45, 0.2, 0.75]):
    camera = PosedCamera(CameraModel.from_drake(info), look_at(eye, [0, 0, 0.06]))
    ideal = render_depth(diagram, context, camera.X_WC, info)
    cameras.append(camera)
    depths.append(add_depth_noise(ideal, info.intrinsic_matrix(), DepthNoiseConfig(), rng))

# %% [markdown]
# ## Two ways to a normal
#
# In space: through the nearest neighbours of each point lies a plane, whose normal is the direction
# in which they spread least. In the image: the inverse depth of a plane is a linear function of the
# pixel, so a window of pixels gives its normal, without looking for neighbours, and knows which
# side the camera is on. What is true is known here, from the objects' shapes.

# %%
like_d415 = DepthConfig(min_depth=0.3, max_depth=1.5, window=9, noise_quadratic=0.0026)
region = Box(RigidTransform([0, 0, 0.13]), np.array([0.6, 0.42, 0.24]))
voxel = 0.004
start = time.process_time()
by_pixels = fuse(depths, cameras, region, voxel, config=like_d415)
fused_in = time.process_time() - start

merged, origins = [], []
for depth, camera in zip(depths, cameras, strict=True):
    p_C = unproject(depth, camera.model, like_d415).reshape(-1, 3)
    p_W = (camera.X_WC @ p_C[np.isfinite(p_C).all(axis=1)].T).T
    merged.append(p_W)
    origins.append(np.tile(camera.X_WC.translation(), (len(p_W), 1)))
raw = crop(PointCloud(np.vstack(merged), sensor_origins=np.vstack(origins)), region)
start = time.process_time()
by_neighbors = estimate_normals(downsample(raw, voxel), radius=0.012)
estimated_in = time.process_time() - start
print(f"all of fusion {1e3 * fused_in:.0f} ms; thinning and neighbours {1e3 * estimated_in:.0f} ms")


def deviations(cloud):
    """Angles from the true normals [deg], of points that lie on one of the things."""
    assert cloud.normals is not None
    angles = []
    for name in things:
        p_O = (X_WO[name].inverse() @ cloud.points.T).T
        field = cached_distance_field(meshes[name])
        own = np.abs(field.at(p_O).distances) < 0.004
        n_W = field.closest(p_O[own]).normals @ X_WO[name].rotation().matrix().T
        cosines = np.einsum("ij,ij->i", n_W, cloud.normals[own])
        angles.append(np.degrees(np.arccos(np.clip(cosines, -1, 1))))
    return np.concatenate(angles)


fig, ax = plt.subplots(figsize=(6.4, 3.6))
for cloud, label in ((by_neighbors, "by neighbours"), (by_pixels, "by pixels, then fused")):
    off = np.sort(deviations(cloud))
    assert np.median(off) < 10
    assert np.mean(off < 90) > 0.9  # On the cameras' side.
    ax.plot(off, 100 * np.arange(1, len(off) + 1) / len(off), label=label)
    print(f"{label}: median {np.median(off):.1f}°, {np.mean(off < 15):.0%} within 15°")
ax.set(xlim=(0, 45), xlabel="angle from the true normal [deg]", ylabel="of the points [%]")
ax.legend()
ax.grid(alpha=0.3)
fig.tight_layout()
save_figure(fig, "normals")


def scatter(ax, cloud, colors, title, size=1.0):
    """A cloud from above and the side."""
    ax.scatter(*cloud.points.T, c=colors, s=size, depthshade=False)
    ax.set_box_aspect((0.6, 0.42, 0.2))
    ax.view_init(50, -65)
    ax.set(title=title, xlim=(-0.3, 0.3), ylim=(-0.21, 0.21), zlim=(0, 0.2))
    ax.axis("off")


# %% [markdown]
# ## How much it bends
#
# The least spread, as a share of all, is near zero on planes, grows on what is curved, and is
# largest at edges and creases. (The pictures: normals as colours, and this share.) On a round wall
# of radius $R$ it is about $r^2/(16 R^2)$ for neighbours within $r$, so the can stands out.

# %%
bend = surface_variation(by_pixels, radius=0.012)
heights = by_pixels.points[:, 2]
assert by_pixels.normals is not None
on_floor = (np.abs(heights - floor) < 0.003) & (by_pixels.normals[:, 2] > 0.95)
edges = np.abs(heights - 0.19) < 0.002  # The bin's rim.
assert np.median(bend[on_floor]) < 0.3 * np.median(bend[edges])

fig = plt.figure(figsize=(13, 4))
ax = fig.add_subplot(1, 3, 1)
ax.imshow(render(diagram, context, look_at([0.25, -0.45, 0.6], [0, 0, 0.06])))
ax.axis("off")
for k, (colors, title) in enumerate(
    ((0.5 + 0.5 * by_pixels.normals, "normals"), (np.sqrt(bend), "curvature"))
):
    scatter(fig.add_subplot(1, 3, 2 + k, projection="3d"), by_pixels, colors, title)
fig.tight_layout()
save_figure(fig, "scene")

# %% [markdown]
# ## Flat pieces, and pieces
#
# Planes grow from the flattest points to neighbours that face the same way. The floor of the bin is
# the largest, its walls and the faces of the sugar box follow; bottle and can have next to none.
#
# Taking away what belongs to the bin's planes leaves the things. Points that are connected by short
# steps form clusters: things that touch are one. But most things are convex, so that where one ends
# and the next begins the surface turns inward: pieces that end at inward turns tell them apart.

# %%
flat, planes = plane_regions(by_pixels, 2 * voxel, min_points=80)
largest = planes[0]
assert largest.normal[2] > 0.99
assert abs(largest.offset - floor) < 0.003

above = by_pixels.points[:, 2] > floor + 0.008
walls = (np.abs(by_pixels.points[:, 0]) > 0.265) | (np.abs(by_pixels.points[:, 1]) > 0.175)
heap = by_pixels.select(above & ~walls)
clusters = euclidean_clusters(heap.points, 0.012, min_points=60)
pieces = convex_segments(heap, voxel)


def owners(cloud):
    """(N,) the number of the nearest thing of each point."""
    distances = []
    for name in things:
        p_O = (X_WO[name].inverse() @ cloud.points.T).T
        distances.append(np.abs(cached_distance_field(meshes[name]).at(p_O).distances))
    return np.argmin(distances, axis=0)


def purity(labels, truth):
    """Part of the labelled points that belong to what most points of their piece belong to."""
    known = labels >= 0
    best = [np.bincount(truth[labels == k]).max() for k in range(labels.max() + 1)]
    return sum(best) / known.sum()


truth = owners(heap)
print(f"{clusters.max() + 1} clusters, {pieces.max() + 1} convex pieces; "
      f"purity {purity(clusters, truth):.2f} and {purity(pieces, truth):.2f}")  # fmt: skip
assert clusters.max() + 1 < 3  # What touches is one.
assert pieces.max() + 1 >= 3
assert purity(pieces, truth) > 0.95
assert purity(pieces, truth) > purity(clusters, truth) + 0.1

fig = plt.figure(figsize=(13, 4))
for k, (cloud, labels, title) in enumerate(
    (
        (by_pixels, flat, f"{len(planes)} planes"),
        (heap, clusters, "connected"),
        (heap, pieces, "convex"),
    )
):
    colors = np.where(labels[:, None] >= 0, plt.get_cmap("tab20")(labels % 20), [0.8, 0.8, 0.8, 1])
    scatter(fig.add_subplot(1, 3, 1 + k, projection="3d"), cloud, colors, title)
fig.tight_layout()
save_figure(fig, "pieces")
