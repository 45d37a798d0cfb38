# %% [markdown]
# # RANSAC: taking the table away
#
# Most of what a camera sees is not the object. Here a rabbit sits on a table amid clutter, and two
# cameras look at it. The table is found as the plane through most points, and removed; of what is
# left, the pieces are told apart; then ICP has a chance. (Exercise 4.7.)

# %%
import matplotlib.pyplot as plt
import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw

from prehensile.models.shapes.implicit import cone, polygonize, union
from prehensile.perception import (
    PointCloud,
    TriangleMesh,
    sample_mesh_poisson_disc,
    sample_mesh_uniform,
)
from prehensile.perception.planes import ransac_plane
from prehensile.perception.registration import IcpConfig, IcpModel, icp
from prehensile.perception.segmentation import euclidean_clusters
from prehensile.perception.visibility import visible_points
from prehensile.viz.figures import save_figure


def rabbit():
    """The rabbit of `ch04_bunny`, which sits on z = 0 and looks along x, as a triangle mesh."""
    parts = [
        cone([-0.025, 0, 0.038], [0.02, 0, 0.045], 0.038, 0.03),
        cone([0.02, 0, 0.05], [0.042, 0, 0.08], 0.022, 0.018),
        cone([0.045, 0, 0.088], [0.062, 0, 0.082], 0.024, 0.017),
        cone([-0.066, 0, 0.04], [-0.068, 0, 0.042], 0.013, 0.012),
    ]
    for y in (1, -1):
        ear_tip = [0.008 + 0.004 * y, 0.03 * y, 0.15]
        parts += [
            cone([0.036, 0.012 * y, 0.105], ear_tip, 0.008, 0.0055),
            cone([-0.03, 0.03 * y, 0.018], [0.005, 0.032 * y, 0.010], 0.02, 0.010),
            cone([0.035, 0.016 * y, 0.03], [0.045, 0.017 * y, 0.008], 0.011, 0.009),
        ]
    solid = polygonize(union(*parts, blend=0.012), [-0.1, -0.08, -0.02], [0.1, 0.08, 0.18], 0.004)
    return TriangleMesh(solid.vertices, solid.faces)


# %% [markdown]
# ## The scene
#
# Everything stands on a table that is tilted a little, so that "cut at a height" would not do.
# There is 1 mm of noise, and there are stray points.

# %%
rng = np.random.default_rng(3)
X_WT = RigidTransform(RollPitchYaw(0.06, -0.04, 0), [0, 0, 0.02])  # The table's frame.
X_WO = X_WT @ RigidTransform(RollPitchYaw(0, 0, 0.6), [0.02, 0.03, 0.002])
mesh = rabbit()
model = sample_mesh_poisson_disc(mesh, count=2000, seed=0)

table = np.c_[rng.uniform(-0.3, 0.3, (6000, 2)), np.zeros(6000)]
things = [sample_mesh_uniform(mesh, 5000, seed=1).transformed(X_WT.inverse() @ X_WO).points]
for x, y, width, height in ((0.17, -0.14, 0.04, 0.1), (-0.2, 0.12, 0.05, 0.06)):
    cube = rng.normal(size=(1500, 3))
    cube /= np.abs(cube).max(axis=1, keepdims=True)
    things.append(cube * [width, width, height / 2] + [x, y, height / 2])
everything = np.vstack([table, *things]) @ X_WT.rotation().matrix().T + X_WT.translation()
labels = np.repeat([0, 1, 2, 3], [len(part) for part in (table, *things)])
eyes = [[0.6, -0.5, 0.6], [0.5, 0.6, 0.6]]
seen = np.any([visible_points(everything, eye) for eye in eyes], axis=0)
points = everything[seen] + rng.normal(0, 0.001, (seen.sum(), 3))
stray = rng.uniform([-0.3, -0.3, 0], [0.3, 0.3, 0.3], (200, 3))
scene = PointCloud(np.vstack([points, stray]), labels=np.r_[labels[seen], np.full(200, -1)])
assert (scene.labels == 1).mean() < 0.4  # Of all points, the rabbit has the smaller part.

# %% [markdown]
# ## (a) RANSAC
#
# Take three points at random, and count who lies near the plane through them. Do that again and
# again, keep the plane with most followers, and fit it to them by least squares at the end. One
# triple in $1 / q^3$ lies on the table as a whole, q being the table's share of the points, so that
# $n$ triples all miss it with probability $(1 - q^3)^n$.


# %%
def ransac(points, tolerance, iterations, rng):
    """Normal, offset and inliers of the plane through most points; counts on the way."""
    best, counts = np.zeros(len(points), dtype=bool), []
    for _ in range(iterations):
        a, b, c = points[rng.choice(len(points), 3, replace=False)]
        normal = np.cross(b - a, c - a)
        length = np.linalg.norm(normal)
        if length > 0:
            inliers = np.abs((points - a) @ normal) < tolerance * length
            if inliers.sum() > best.sum():
                best = inliers
        counts.append(int(best.sum()))
    mean = points[best].mean(axis=0)
    normal = np.linalg.svd(points[best] - mean, full_matrices=False)[2][2]
    normal *= np.sign(normal[2])
    offset = float(normal @ mean)
    return normal, offset, np.abs(points @ normal - offset) < tolerance, counts


tolerance = 0.004
normal, offset, inliers, counts = ransac(scene.points, tolerance, 200, rng)
true_normal = X_WT.rotation().matrix()[:, 2]


def angle(a, b):
    """Angle between unit vectors [deg]."""
    return float(np.degrees(np.arccos(np.clip(a @ b, -1, 1))))


assert angle(normal, true_normal) < 0.3
assert abs(offset - true_normal @ X_WT.translation()) < 0.001

search = ransac_plane(scene, tolerance)
assert search.plane is not None
assert angle(search.plane.normal, normal) < 0.1
assert (search.inliers == inliers).mean() > 0.995

# %% [markdown]
# The library's takes as many triples as it needs to be 99.9 % sure, given the best plane so far,
# and no more; after how many it stops depends on the table's share.

# %%
share = (scene.labels == 0).mean()
needed = np.log(0.001) / np.log(1 - share**3)
print(f"{share:.0%} of the points: {needed:.0f} triples needed, {search.iterations} made")
assert 0.3 * needed < search.iterations < 3 * needed

trials = np.array([ransac(scene.points[::4], tolerance, 60, rng)[3] for _ in range(40)])
found = (trials > 0.9 * trials.max()).mean(axis=0)
n = np.arange(1, 61)
fig, ax = plt.subplots(figsize=(6, 3.2))
ax.plot(n, found, label="found the table, of 40 runs")
ax.plot(n, 1 - (1 - share**3) ** n, "--", label="1 - (1 - q³)ⁿ")
ax.set(xlabel="triples n", ylabel="share", ylim=(0, 1.03))
ax.legend()
fig.tight_layout()
save_figure(fig, "how_many_triples")
# Three points of the table close together span a plane that is far off elsewhere.
assert (found <= 1 - (1 - share**3) ** n + 0.15).all()
assert found[-1] > 0.85

# %% [markdown]
# ## (b) Without the table
#
# What lies on the plane goes, and what lies below it. The feet of the rabbit go with it: a
# tolerance has its price.

# %%
rest = scene.select(search.plane.heights(scene.points) > tolerance)
assert (rest.labels == 0).mean() < 0.02
pieces = euclidean_clusters(rest.points, 0.02, min_points=100)
assert pieces.max() == 2  # Three things, and strays that are none.
largest = rest.select(pieces == 0)
assert (largest.labels == 1).mean() > 0.98

fig = plt.figure(figsize=(12, 4))
pictures = (
    ("scene: table, rabbit, clutter, strays", scene, search.inliers, "tab10"),
    ("without the plane, in pieces", rest, pieces, "Set1"),
)
for i, (title, cloud, value, colors) in enumerate(pictures):
    ax = fig.add_subplot(1, 3, i + 1, projection="3d")
    ax.scatter(*cloud.points.T, c=value, cmap=colors, s=1, depthshade=False)
    ax.set(xlim=(-0.25, 0.25), ylim=(-0.25, 0.25), zlim=(-0.1, 0.4), title=title)
    ax.view_init(elev=25, azim=-50)
    ax.set_axis_off()
    ax.set_box_aspect((1, 1, 1), zoom=1.4)

# %% [markdown]
# ## The pose, at last
#
# ICP in the whole scene, from a start 25° and 3 cm off, looks for a model partner of every point of
# the table, and sinks. With the largest piece alone the same start is good enough.

# %%
start = X_WO @ RigidTransform(RollPitchYaw(0.2, -0.2, 0.35), [0.02, -0.02, 0.01])
prepared = IcpModel(model)
config = IcpConfig(tolerance=1e-4)


def error_of(X):
    """Root mean square distance of the model's points from where they should be [m]."""
    gap = model.transformed(X).points - model.transformed(X_WO).points
    return float(np.sqrt((gap**2).sum(axis=1).mean()))


in_all = icp(scene, prepared, start, config)
in_piece = icp(largest, prepared, start, config)
assert in_all.X_WO is not None
assert in_piece.X_WO is not None
print(f"off by {1000 * error_of(start):.1f} mm at first, {1000 * error_of(in_all.X_WO):.1f} mm in")
print(f"the whole scene, {1000 * error_of(in_piece.X_WO):.1f} mm in the piece")
assert error_of(in_all.X_WO) > 0.02
assert in_piece.succeeded
assert error_of(in_piece.X_WO) < 0.002

ax = fig.add_subplot(1, 3, 3, projection="3d")
ax.scatter(*largest.points.T, s=1, color="tab:red", depthshade=False, label="largest piece")
found = model.transformed(in_piece.X_WO).points
ax.scatter(*found.T, s=1, color="tab:blue", depthshade=False, label="model, by ICP")
ax.set(xlim=(-0.08, 0.12), ylim=(-0.07, 0.13), zlim=(0, 0.2), title="the rabbit, found")
ax.view_init(elev=25, azim=-50)
ax.set_axis_off()
ax.set_box_aspect((1, 1, 1), zoom=1.3)
ax.legend(loc="lower right", markerscale=5)
fig.tight_layout()
save_figure(fig, "steps")
