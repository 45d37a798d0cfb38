# %% [markdown]
# # Known correspondences
#
# If each scene point is known to be a certain model point, the best pose has a closed form: centre
# both, a singular value decomposition for the rotation, and a difference of means for the
# translation. First a random shape in the plane, exact; then points in space with noise, with
# weights, and with noise so bad that the best orthogonal matrix is a mirror. (Example 4.3.)

# %%
import matplotlib.pyplot as plt
import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw

from prehensile.perception.registration import fit_rigid, planar_pose
from prehensile.viz.figures import save_figure

# %% [markdown]
# ## In the plane, without noise
#
# The scene is the model, moved by a pose ${}^W X^O$ and listed in another order; $c_i$ says which
# model point scene point $i$ is.

# %%
rng = np.random.default_rng(7)
angles = np.sort(rng.uniform(0, 2 * np.pi, 12))
model = (rng.uniform(0.3, 1.0, 12) * np.stack([np.cos(angles), np.sin(angles)])).T
X_WO = planar_pose(rng.uniform(-np.pi, np.pi), [1.4, 0.6])
c = rng.permutation(12)
scene = model[c] @ X_WO[:2, :2].T + X_WO[:2, 2]

fit = fit_rigid(model[c], scene)
assert fit.succeeded
np.testing.assert_allclose(fit.R_WO, X_WO[:2, :2], atol=1e-12)
np.testing.assert_allclose(fit.p_WO, X_WO[:2, 2], atol=1e-12)

fig, axes = plt.subplots(1, 2, figsize=(10, 4), sharex=True, sharey=True)
estimated = model @ fit.R_WO.T + fit.p_WO
for ax, points, title in zip(
    axes, (model, estimated), ("correspondences", "estimated pose"), strict=True
):
    for s, m in zip(scene, points[c], strict=True):
        ax.plot(*np.stack([s, m]).T, "--", color="0.7", lw=1)
    ax.fill(*points.T, fill=False, edgecolor="tab:blue")
    ax.plot(*points.T, "o", color="tab:blue", label="model")
    ax.plot(*scene.T, "o", color="tab:red", ms=4, label="scene")
    ax.set(title=title, aspect="equal")
axes[0].legend(loc="lower right")
fig.tight_layout()
save_figure(fig, "plane")

# %% [markdown]
# ## The closed form
#
# The sum of squares $\sum_i |R \, {}^O p^{m_i} + p - p^{s_i}|^2$ is least in $p$ where the
# centroids meet, whatever $R$ is. What remains is $\mathrm{tr}(R^T W)$ to be made large, with the
# data matrix $W = \sum_i (p^{s_i} - \bar p^s)({}^O p^{m_i} - {}^O \bar p^m)^T = U \Sigma V^T$:
#
# $$ R = U \, \mathrm{diag}(1, 1, \det(U V^T)) \, V^T $$
#
# The last factor makes it a rotation where $U V^T$ alone would be a reflection.


# %%
def closed_form(model, scene):
    """R, p, and whether the determinant had to be mended."""
    m, s = model - model.mean(axis=0), scene - scene.mean(axis=0)
    U, _, Vt = np.linalg.svd(s.T @ m)
    D = np.eye(model.shape[1])
    D[-1, -1] = np.linalg.det(U @ Vt)
    R = U @ D @ Vt
    return R, scene.mean(axis=0) - R @ model.mean(axis=0), D[-1, -1] < 0


R, p, _ = closed_form(model[c], scene)
np.testing.assert_allclose(R, fit.R_WO, atol=1e-12)
np.testing.assert_allclose(p, fit.p_WO, atol=1e-12)

# %% [markdown]
# ## In space, with noise
#
# With noise of 5 mm on each coordinate the pose is off by less than that, the less the more points
# there are; the covariance that comes with the result says by how much. Over many trials the true
# error is of the size that it states.

# %%
X_WO = RigidTransform(RollPitchYaw(0.4, -0.9, 2.1), [0.5, -0.2, 0.3])
R_WO, p_WO = X_WO.rotation().matrix(), X_WO.translation()
sigma, counts = 0.005, (5, 10, 20, 50, 100, 200, 500)
true_error, stated_error = [], []
for count in counts:
    squares, variances = [], []
    for _ in range(60):
        model = rng.uniform(-0.1, 0.1, (count, 3))
        scene = model @ R_WO.T + p_WO + rng.normal(0, sigma, (count, 3))
        result = fit_rigid(model, scene).result()
        squares.append(np.sum((result.X_WO.translation() - p_WO) ** 2))
        variances.append(np.trace(result.covariance[3:, 3:]))
    true_error.append(np.sqrt(np.mean(squares)))
    stated_error.append(np.sqrt(np.mean(variances)))
np.testing.assert_allclose(true_error, stated_error, rtol=0.25)
slope = np.polyfit(np.log(counts), np.log(true_error), 1)[0]
assert abs(slope + 0.5) < 0.1  # One over the root of their number.

fig, axes = plt.subplots(1, 2, figsize=(10, 3.6))
axes[0].loglog(counts, 1000 * np.array(true_error), "o", label="true")
axes[0].loglog(counts, 1000 * np.array(stated_error), label="by the covariance")
axes[0].set(xlabel="points", ylabel="error of the position [mm]", title="5 mm of noise")
axes[0].legend()

# %% [markdown]
# ## With weights
#
# If some points are known to be worse than others, weights of one over their variance make better
# use of them. Here two in three points have ten times the noise of the rest: with all alike they
# spoil the answer.

# %%
sigmas = np.where(np.arange(60) < 20, 0.002, 0.02)
plain, weighted = [], []
for _ in range(200):
    model = rng.uniform(-0.1, 0.1, (60, 3))
    scene = model @ R_WO.T + p_WO + sigmas[:, None] * rng.normal(size=(60, 3))
    for weights, errors in ((None, plain), (sigmas**-2, weighted)):
        R = fit_rigid(model, scene, weights).R_WO
        errors.append(np.degrees(np.arccos(np.clip((np.trace(R.T @ R_WO) - 1) / 2, -1, 1))))
assert np.mean(weighted) < 0.35 * np.mean(plain)

bins = np.linspace(0, 5, 41)
axes[1].hist(plain, bins, alpha=0.7, label="all alike")
axes[1].hist(weighted, bins, alpha=0.7, label="weighted")
axes[1].set(xlabel="error of the rotation [deg]", ylabel="trials", title="points good and bad")
axes[1].legend()
fig.tight_layout()
save_figure(fig, "noise_and_weights")

# %% [markdown]
# ## Improper rotations
#
# A nearly flat object, such as a plate, constrains its rotation well but hardly resists being
# turned inside out through its own plane. With noise larger than its thickness $U V^T$ is a mirror
# in many trials, and a camera would be told that the plate is made of left-handed china. The
# determinant mends it; the pose is then as good as in the other trials.

# %%
mirrored, errors = [], []
for _ in range(300):
    plate = rng.uniform(-1, 1, (8, 3)) * [0.1, 0.1, 0.001]
    scene = plate @ R_WO.T + p_WO + rng.normal(0, 0.004, (8, 3))
    R, _, mended = closed_form(plate, scene)
    np.testing.assert_allclose(R, fit_rigid(plate, scene).R_WO, atol=1e-9)
    assert np.isclose(np.linalg.det(R), 1)
    mirrored.append(mended)
    errors.append(np.degrees(np.arccos(np.clip((np.trace(R.T @ R_WO) - 1) / 2, -1, 1))))
mirrored, errors = np.array(mirrored), np.array(errors)
assert 0.2 < mirrored.mean() < 0.6
assert np.median(errors[mirrored]) < 1.5 * np.median(errors[~mirrored]) < 6

# A true mirror image, of a shape that is not flat, is another matter: no rotation fits it.
model = rng.uniform(-0.1, 0.1, (50, 3))
mirror = model * [1, 1, -1]
assert fit_rigid(model, mirror).residual > 0.02
