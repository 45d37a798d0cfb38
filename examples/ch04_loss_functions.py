# %% [markdown]
# # Losses that outliers cannot pull on
#
# Least squares lets one wild point decide: its cost grows with the square of its distance. Robust
# losses taper, so that what is far away hardly counts, or not at all. (Section 4.5.5.)

# %%
import matplotlib.pyplot as plt
import numpy as np

from prehensile.perception.registration.known import fit_rigid
from prehensile.perception.registration.losses import RobustLoss
from prehensile.viz.figures import save_figure

# %% [markdown]
# ## The family
#
# All are $r^2$ near zero; a scale $c$ says what "near" is. The weight $\partial l / \partial (r^2)$
# is what each residual is multiplied by when the sum of losses is minimized by repeated weighted
# least squares.

# %%
c = 1.0
r = np.linspace(0, 4, 401)
fig, axes = plt.subplots(1, 2, figsize=(10, 3.8))
for loss in RobustLoss:
    axes[0].plot(r, loss.loss(r, c), label=loss.value.replace("_", " "))
    axes[1].plot(r, loss.weight(r, c))
axes[0].set(xlabel="r / c", ylabel="loss", ylim=(0, 4))
axes[1].set(xlabel="r / c", ylabel="weight")
axes[0].legend(fontsize=8)
fig.tight_layout()
save_figure(fig, "losses")

# %% [markdown]
# Three properties, checked: near zero all agree; the weight is the derivative; and all but least
# squares and Huber's are bounded, which is why a sum over *all* pairs of points can make sense.

# %%
small = 1e-4
bounded = {RobustLoss.TUKEY, RobustLoss.GEMAN_MCCLURE, RobustLoss.TRUNCATED}
for loss in RobustLoss:
    assert np.isclose(loss.loss(small, c), small**2, rtol=1e-6)
    smooth = np.abs(r - c) > 0.02  # Truncation has a kink there.
    slope = np.gradient(loss.loss(r, c), r) / np.maximum(2 * r, 1e-9)
    assert np.allclose(slope[smooth][2:-2], loss.weight(r, c)[smooth][2:-2], atol=0.01)
    assert (loss.loss(1e6, c) <= c**2) == (loss in bounded)

# %% [markdown]
# ## The mean of a line of points, with a growing share of outliers
#
# The simplest estimate there is: one number from many. The least squares answer is the mean; it
# moves with every outlier. Truncated least squares keeps to the majority, but its cost has many
# local minima: from a bad start, reweighting stays where it is.

# %%
rng = np.random.default_rng(1)
inliers, outliers = rng.normal(0, 0.1, 60), rng.normal(3.0, 0.6, 40)
data = np.concatenate([inliers, outliers])
x = np.linspace(-1, 5, 1201)
fig, ax = plt.subplots(figsize=(8, 3.6))
lowest = {}
for loss in RobustLoss:
    cost = loss.loss(x[:, None] - data, 0.5).sum(axis=1)
    lowest[loss] = x[cost.argmin()]
    ax.plot(x, cost / cost.max(), label=f"{loss.value.replace('_', ' ')}: {lowest[loss]:.2f}")
ax.plot(data, np.full_like(data, -0.05), "|", color="black")
ax.set(xlabel="estimate", ylabel="cost (scaled)", title="60 points near 0, 40 outliers near 3")
ax.legend(fontsize=8)
save_figure(fig, "one_number")

assert abs(lowest[RobustLoss.LEAST_SQUARES] - data.mean()) < 0.01
assert abs(lowest[RobustLoss.LEAST_SQUARES]) > 1
assert all(abs(lowest[loss]) < 0.05 for loss in bounded)

# %% [markdown]
# ## A pose from correspondences of which a third are wrong
#
# Iteratively reweighted least squares: fit, look at the residuals, weigh, fit again. Graduated
# non-convexity is the same with a scale that starts large, when the cost is nearly convex, and
# shrinks.

# %%


def reweighted(model, scene, loss, scales):
    """Rotation and translation of the plane by reweighted least squares with given scales."""
    fit = fit_rigid(model, scene)
    for scale in scales:
        weights = loss.weight(fit.residuals, scale)
        if weights.sum() < 2:
            break
        fit = fit_rigid(model, scene, weights)
    return fit


def error(fit):
    """Angle between the estimated rotation and the true one [deg]."""
    R = fit.R_WO @ R_WO.T
    return abs(np.degrees(np.arctan2(R[1, 0], R[0, 0])))


theta = 0.6
R_WO = np.array([[np.cos(theta), -np.sin(theta)], [np.sin(theta), np.cos(theta)]])
median = {}
for loss in RobustLoss:
    errors = []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        model = rng.uniform(-1, 1, (60, 2))
        scene = model @ R_WO.T + [0.5, 0.2] + rng.normal(0, 0.01, (60, 2))
        wrong = rng.permutation(60)[:20]
        scene[wrong] = rng.uniform([0, -1], [3, 2], (20, 2))  # To one side: they pull together.
        scales = 0.05 * np.maximum(1.4 ** np.arange(12, -8, -1), 1)
        errors.append(error(reweighted(model, scene, loss, scales)))
    median[loss] = np.median(errors)
assert median[RobustLoss.LEAST_SQUARES] > 5
assert all(median[loss] < 0.5 for loss in bounded)

fig, ax = plt.subplots(figsize=(7, 3))
ax.barh([loss.value.replace("_", " ") for loss in RobustLoss], [median[k] for k in RobustLoss])
ax.set(xscale="log", xlabel="median error of the rotation over 40 problems [deg]")
fig.tight_layout()
save_figure(fig, "pose_with_outliers")
