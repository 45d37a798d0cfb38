# %% [markdown]
# # How sure is a pose?
#
# A registration that ends is not yet one to believe. Near its minimum the cost is a quadratic in a
# small motion of the object, turn $\omega$ and shift $v$, and what the points say of the motion is
# in its matrix: a motion that changes no distance is free, one that changes many is fixed well. If
# each distance has the variance $\sigma^2$ and its derivative by the motion is the row $J_i$, the
# estimate's covariance is
#
# $$\Sigma = \sigma^2 \Bigl(\sum_i J_i^T J_i\Bigr)^{-1}, \qquad J_i = \begin{bmatrix} (p_i \times
# n_i)^T & n_i^T \end{bmatrix},$$
#
# with points $p_i$ and normals $n_i$ of the surface.

# %%
import matplotlib.pyplot as plt
import numpy as np
from pydrake.geometry import Box, Cylinder, Sphere
from pydrake.math import RigidTransform, RollPitchYaw

from prehensile.perception import mesh_of_model, sample_mesh_poisson_disc
from prehensile.perception.cloud import PointCloud
from prehensile.perception.distance_field import DistanceField, cached_distance_field
from prehensile.perception.model_mesh import shape_mesh
from prehensile.perception.registration import RegistrationStatus, pose_uncertainty
from prehensile.perception.registration.refine import RefineConfig, refine_pose
from prehensile.viz.ellipsoids import plot_ellipse
from prehensile.viz.figures import save_figure

# %% [markdown]
# ## Motions that nothing sees
#
# Of a plane, three: both shifts along it and the turn about its normal. Of a cylinder, two: along
# its axis and about it. Of a sphere the three turns about its centre. A box has none, nor has a
# bottle. The eigenvalues of the matrix tell; turns and shifts are made comparable by the size of
# the cloud.

# %%
sigma = 0.001
surfaces = {
    "plane": shape_mesh(Box(0.2, 0.2, 0.2)),
    "sphere": shape_mesh(Sphere(0.1)),
    "cylinder": shape_mesh(Cylinder(0.05, 0.2)),
    "box": shape_mesh(Box(0.1, 0.15, 0.2)),
    "bottle": mesh_of_model("mustard_bottle"),
}
clouds = {
    name: sample_mesh_poisson_disc(mesh, count=800, seed=0) for name, mesh in surfaces.items()
}
clouds["plane"] = clouds["plane"].select(clouds["plane"].points[:, 2] > 0.0999)  # One face.
clouds["cylinder"] = clouds["cylinder"].select(np.abs(clouds["cylinder"].points[:, 2]) < 0.0999)
for name, round_axes in (("sphere", [1, 1, 1]), ("cylinder", [1, 1, 0])):
    radial = clouds[name].points * round_axes  # The meshes are polyhedra: round them off.
    normals = radial / np.linalg.norm(radial, axis=1, keepdims=True)
    clouds[name] = clouds[name].replace(normals=normals)


def information(cloud):
    """Sum of J^T J, and the root mean square distance of the points from their middle."""
    assert cloud.normals is not None
    p = cloud.points - cloud.points.mean(axis=0)
    J = np.hstack([np.cross(p, cloud.normals), cloud.normals])
    return J.T @ J, np.sqrt((p**2).sum(axis=1).mean())


expected = {"plane": 3, "sphere": 3, "cylinder": 2, "box": 0, "bottle": 0}
fig, ax = plt.subplots(figsize=(7, 3.6))
for row, (name, cloud) in enumerate(clouds.items()):
    H, length = information(cloud)
    _, free = pose_uncertainty(H, sigma**2, length)
    assert len(free) == expected[name]
    scale = np.array([1 / length] * 3 + [1.0] * 3)
    values = np.linalg.eigvalsh(scale[:, None] * H * scale) / len(cloud)
    ax.semilogx(np.maximum(values, 1e-7), np.full(6, row), "|", ms=18, mew=2)
    ax.text(2, row, f"{len(free)} free", va="center")
ax.axvspan(5e-8, 1e-4, color="tab:red", alpha=0.1)
ax.set(yticks=range(5), yticklabels=list(clouds), xlim=(5e-8, 10), ylim=(-0.6, 4.6))
ax.set(xlabel="eigenvalue, for each point", title="what the points say of six motions")
fig.tight_layout()
save_figure(fig, "eigenvalues")

# %% [markdown]
# The free directions name the motion, turns first. The cylinder's are its axis $z$, twice: a turn
# about it and a shift along it.

# %%
H, length = information(clouds["cylinder"])
_, free = pose_uncertainty(H, sigma**2, length)
axis_turn, axis_shift = np.eye(6)[2], np.eye(6)[5]
for motion in (axis_turn, axis_shift):
    assert np.linalg.norm(free @ motion) > 0.999

# %% [markdown]
# Refining a pose on such a surface ends with a pose like any other, but with the status that says
# so: here on the middle of the box's upper face.

# %%
field = DistanceField.from_mesh(surfaces["plane"], spacing=0.005)
inner = np.abs(clouds["plane"].points[:, :2]).max(axis=1) < 0.06
face = PointCloud(clouds["plane"].points[inner] + [0.5, 0.0, 0.1])
on_face = refine_pose(face, field, RigidTransform([0.49, 0.01, 0.105]))
assert on_face.status is RegistrationStatus.DEGENERATE
assert on_face.free_directions is not None
assert len(on_face.free_directions) == 3
print(on_face.message)

# %% [markdown]
# ## Is the covariance true?
#
# The bottle, seen from one side, 250 points with a millimetre of noise along their normals, found
# again 300 times with fresh noise. The scatter of the poses must be what the result states, each
# time, of itself. The test: the squared error in the metric of the stated covariance, $e^T
# \Sigma^{-1} e$, has the mean 6 of a $\chi^2$ with six degrees of freedom.

# %%
rng = np.random.default_rng(0)
bottle = clouds["bottle"]
assert bottle.normals is not None
field = cached_distance_field(surfaces["bottle"])
facing = bottle.normals @ [0.8, -0.6, 0.0] > 0.1
p_OQ, n_O = bottle.points[facing][:250], bottle.normals[facing][:250]
X_WO = RigidTransform(RollPitchYaw(0.3, 0.2, 0.9), [0.5, 0.1, 0.2])
guess = X_WO @ RigidTransform(RollPitchYaw(0.05, 0.1, 0.0), [0.005, -0.003, 0.004])
config = RefineConfig(scale=0.02, initial_scale=0.03)  # Hardly robust: there are no outliers.
errors, covariances = [], []
for _ in range(300):
    noisy = p_OQ + sigma * rng.standard_normal((len(p_OQ), 1)) * n_O
    found = refine_pose(PointCloud((X_WO @ noisy.T).T), field, guess, config)
    assert found.succeeded
    assert found.X_WO is not None
    turn = (found.X_WO.rotation() @ X_WO.rotation().inverse()).ToAngleAxis()
    errors.append([*(turn.angle() * turn.axis()), *(found.X_WO.translation() - X_WO.translation())])
    covariances.append(found.covariance)
errors, covariances = np.array(errors), np.array(covariances)
squared = np.einsum("ni,nij,nj->n", errors, np.linalg.inv(covariances), errors)
print(f"mean of the squared normalized error: {squared.mean():.2f}")
assert 5 < squared.mean() < 7.5
stated = covariances.mean(axis=0)
ratio = np.sqrt(np.diag(np.cov(errors.T)) / np.diag(stated))
print("scatter over stated deviation:", ratio.round(2))
assert (np.abs(ratio - 1) < 0.2).all()

# %% [markdown]
# The ellipses hold 95 % of two coordinates each. What is turned about the long axis of the bottle,
# which is nearly round there, is known least.

# %%
units = np.array([np.degrees(1)] * 3 + [1e3] * 3)
drawn, stated_drawn = errors * units, stated * np.outer(units, units)
labels = [f"turn about {a} [deg]" for a in "xyz"] + [f"shift along {a} [mm]" for a in "xyz"]
fig, axes = plt.subplots(1, 3, figsize=(13, 4.2))
for ax, (i, j) in zip(axes, ((3, 4), (3, 5), (0, 2)), strict=True):
    ax.plot(drawn[:, i], drawn[:, j], ".", color="0.6", ms=4)
    block = stated_drawn[np.ix_([i, j], [i, j])]
    lengths, directions = np.linalg.eigh(block)
    radii = np.sqrt(5.991 * lengths)  # Quantile of chi^2 with two degrees of freedom.
    plot_ellipse(ax, [0.0, 0.0], directions, radii)
    inside = np.einsum("ni,ij,nj->n", drawn[:, [i, j]], np.linalg.inv(block), drawn[:, [i, j]])
    share = (inside < 5.991).mean()
    assert 0.91 < share < 0.99
    ax.axis("equal")
    ax.set(xlabel=labels[i], ylabel=labels[j], title=f"{share:.0%} inside")
fig.tight_layout()
save_figure(fig, "scatter")
axis = X_WO.rotation().matrix()[:, 2]
along = axis @ stated[:3, :3] @ axis
assert along > 0.5 * np.trace(stated[:3, :3])
