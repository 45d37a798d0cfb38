# %% [markdown]
# # A rabbit, registered
#
# ICP written out: the least-squares transform of pairs, then the loop around it, applied to two
# clouds of one rabbit; and beside it the library's. (Exercise 4.6.)

# %%
import time

import matplotlib.pyplot as plt
import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw
from scipy.spatial import KDTree

from prehensile.models.shapes.implicit import cone, polygonize, union
from prehensile.perception import PointCloud, TriangleMesh, sample_mesh_poisson_disc
from prehensile.perception.registration import IcpConfig, IcpKind, IcpModel, fit_rigid, icp
from prehensile.viz.figures import save_animation, save_figure

# %% [markdown]
# ## The rabbit
#
# Capsules whose radius changes along the way, for the body, neck, head, tail, ears and paws,
# blended into one another: the union of their distance functions, with fillets where they meet.
# The surface is where that function is zero.


# %%
def rabbit():
    """A rabbit 16 cm tall that sits on z = 0 and looks along x, as a triangle mesh."""
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


mesh = rabbit()
assert mesh.is_watertight()
model = sample_mesh_poisson_disc(mesh, count=2500, seed=0).points
X_WO = RigidTransform(RollPitchYaw(0.1, -0.1, 0.7), [0.04, -0.03, 0.02])
R_WO, p_WO = X_WO.rotation().matrix(), X_WO.translation()
scene = sample_mesh_poisson_disc(mesh, count=2000, seed=1).points @ R_WO.T + p_WO

fig = plt.figure(figsize=(9, 3.8))
for i, azimuth in enumerate((-60, 20)):
    ax = fig.add_subplot(1, 2, i + 1, projection="3d")
    ax.plot_trisurf(*mesh.vertices.T, triangles=mesh.triangles, color="tan", linewidth=0)
    ax.view_init(elev=15, azim=azimuth)
    ax.set_aspect("equal")
    ax.set_axis_off()
fig.tight_layout()
save_figure(fig, "rabbit")

# %% [markdown]
# ## (a) The least-squares transform of pairs
#
# Centre both sets, take the data matrix of the centred pairs apart, mend the determinant.


# %%
def least_squares_transform(model_points, scene_points):
    """R (3, 3) and p (3,) that bring model points closest to scene points, row by row."""
    m_mean, s_mean = model_points.mean(axis=0), scene_points.mean(axis=0)
    W = (scene_points - s_mean).T @ (model_points - m_mean)
    U, _, Vt = np.linalg.svd(W)
    R = U @ np.diag([1, 1, np.linalg.det(U @ Vt)]) @ Vt
    return R, s_mean - R @ m_mean


moved = model @ R_WO.T + p_WO
R, p = least_squares_transform(model, moved)
np.testing.assert_allclose(R, R_WO, atol=1e-12)
np.testing.assert_allclose(p, p_WO, atol=1e-12)
fit = fit_rigid(model, moved)
np.testing.assert_allclose(R, fit.R_WO, atol=1e-12)

# %% [markdown]
# ## (b) The loop
#
# For each scene point the nearest model point, the transform of the pairs, and again, until the
# mean error changes no more. Instead of moving the model and building its search tree anew, the
# scene is brought into the model's frame, where the tree can stay.


# %%
def iterative_closest_points(scene, model, R, p, max_iterations=100, tolerance=1e-7):
    """R, p and the mean distances and poses on the way."""
    tree = KDTree(model)
    errors, poses = [], []
    while True:
        distance, nearest = tree.query((scene - p) @ R)
        errors.append(float(distance.mean()))
        poses.append((R, p))
        settled = len(errors) > 1 and abs(errors[-2] - errors[-1]) < tolerance
        if settled or len(errors) > max_iterations:
            return R, p, errors, poses
        R, p = least_squares_transform(model[nearest], scene)


begin = time.process_time()
R, p, errors, poses = iterative_closest_points(scene, model, np.eye(3), np.zeros(3))
ours_seconds = time.process_time() - begin


def turn_between(A, B):
    """Angle between two rotations [deg]."""
    return float(np.degrees(np.arccos(np.clip((np.trace(A.T @ B) - 1) / 2, -1, 1))))


assert turn_between(R, R_WO) < 0.5
assert np.linalg.norm(p - p_WO) < 0.001

# %%
fig = plt.figure(figsize=(5, 4.4))
ax = fig.add_subplot(projection="3d")
ax.scatter(*scene[::3].T, s=2, color="tab:red", label="scene", depthshade=False)
(dots,) = ax.plot([], [], [], ".", ms=2, color="tab:blue", label="model")
ax.set(xlim=(-0.05, 0.13), ylim=(-0.12, 0.06), zlim=(0, 0.18))
ax.view_init(elev=20, azim=-70)
ax.set_box_aspect((1, 1, 1), zoom=1.35)
ax.set_axis_off()
ax.legend(loc="upper right")


def frames():
    """The model, step by step; the later steps are smaller and go by faster."""
    for k in [*range(12), *range(12, len(poses), 6)]:
        R, p = poses[k]
        dots.set_data_3d(*(model[::3] @ R.T + p).T)
        ax.set_title(f"step {k}: {1000 * errors[k]:.2f} mm")
        yield fig


save_animation(frames(), "icp", period=0.25)
plt.close(fig)

# %% [markdown]
# ## Beside the library
#
# From the same start, `icp` point to point reaches the same pose; point to plane it takes a
# fraction of the steps, for surfaces may slide along each other; and its pose is better, for the
# scene's points lie *between* the model's points, but *on* the planes.

# %%
start = RigidTransform()
rows = [("this example", len(errors) - 1, turn_between(R, R_WO), ours_seconds)]
prepared, cloud = IcpModel(PointCloud(model)), PointCloud(scene)
for kind in (IcpKind.POINT_TO_POINT, IcpKind.POINT_TO_PLANE):
    begin = time.process_time()
    result = icp(cloud, prepared, start, IcpConfig(kind=kind, coarse_points=0, tolerance=1e-6))
    seconds = time.process_time() - begin
    assert result.succeeded
    assert result.X_WO is not None
    error = turn_between(result.X_WO.rotation().matrix(), R_WO)
    rows.append((kind.value, result.iterations, error, seconds))
for name, steps, error, seconds in rows:
    print(f"{name:16} {steps:3} steps, off by {error:.3f}°, {1000 * seconds:.0f} ms")
_, to_points, to_planes = rows
assert abs(to_points[2] - rows[0][2]) < 0.1
assert to_planes[1] < to_points[1]
assert to_planes[2] < to_points[2]

fig, ax = plt.subplots(figsize=(6, 3.2))
ax.semilogy([1000 * e for e in errors], label="mean distance [mm]")
ax.semilogy([turn_between(R_k, R_WO) for R_k, _ in poses], label="error of the rotation [deg]")
ax.set(xlabel="step")
ax.legend()
fig.tight_layout()
save_figure(fig, "errors")
