# %% [markdown]
# # Iterative closest points, step by step
#
# Without known correspondences, guess them: each scene point belongs to the nearest model point.
# Find the best pose for that guess, move the model there, guess anew. Both halves of a step lessen
# the same sum of squared distances, so it always ends; but not always where it should.
# (Example 4.4.)

# %%
import matplotlib.pyplot as plt
import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial import KDTree

from prehensile.perception.registration import fit_rigid, icp_2d, planar_pose
from prehensile.viz.figures import save_animation, save_figure


def blob(rng, count=400):
    """Points along a random smooth closed outline, (count, 2)."""
    radius = rng.uniform(0.4, 1.1, 8)
    outline = CubicSpline(np.linspace(0, 2 * np.pi, 9), [*radius, radius[0]], bc_type="periodic")
    angle = np.linspace(0, 2 * np.pi, count, endpoint=False)
    return outline(angle)[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def moved(points, X):
    """Points of the plane by a pose (3, 3)."""
    return points @ X[:2, :2].T + X[:2, 2]


rng = np.random.default_rng(4)
model = blob(rng)
X_WO = planar_pose(0.0, [1.0, 0.5])
scene = moved(model[::10], X_WO)

# %% [markdown]
# ## The loop
#
# The whole algorithm is five lines; `icp_2d` is the same with limits and a verdict.


# %%
def closest_points(scene, model, X):
    """Besl and McKay's iteration; the pose and the sums of squares on the way."""
    partners, sums = None, []
    while True:
        distance, nearest = KDTree(moved(model, X)).query(scene)
        sums.append(float(distance @ distance))
        if partners is not None and np.array_equal(nearest, partners):
            return X, sums
        fit, partners = fit_rigid(model[nearest], scene), nearest
        X = planar_pose(np.arctan2(fit.R_WO[1, 0], fit.R_WO[0, 0]), fit.p_WO)


good_start, bad_start = planar_pose(0.7, [0.4, 0.1]), planar_pose(2.9, [1.2, 0.2])
runs = []
for start in (good_start, bad_start):
    result = icp_2d(scene, model, start)
    X, sums = closest_points(scene, model, start)
    np.testing.assert_allclose(result.X_WO, X, atol=1e-9)
    assert (np.diff(sums) < 1e-12).all()  # Every step lessens it.
    runs.append((result, sums))
good, bad = runs[0][0], runs[1][0]
assert good.succeeded
assert bad.succeeded  # It has converged: that is all that ICP can know of itself.
np.testing.assert_allclose(good.X_WO, X_WO, atol=0.03)
assert np.abs(bad.X_WO - X_WO).max() > 0.5

# %% [markdown]
# Left, a start that is off by 40°; right, by 166°. Grey lines show who is whose nearest. On the
# right the lines become short, no point has a reason to change its partner, and there it stays.

# %%
fig, axes = plt.subplots(1, 2, figsize=(9, 4.4))
tangles, outlines = [], []
for ax in axes:
    tangles.append(ax.plot([], [], color="0.6", lw=0.8)[0])
    ax.plot(*scene.T, "o", color="tab:red", ms=4, label="scene")
    outlines.append(ax.plot([], [], color="tab:blue", lw=1.5, label="model")[0])
    ax.set(xlim=(-0.9, 2.4), ylim=(-1.2, 2.0), aspect="equal")
axes[1].legend(loc="lower right")
fig.tight_layout()


def frames():
    """Draws both runs side by side, a step at a time."""
    last = max(len(result.history) for result, _ in runs) - 1
    for k in [*range(6), *range(6, last, 2), last]:
        for ax, tangle, outline, (result, sums) in zip(axes, tangles, outlines, runs, strict=True):
            step = result.history[min(k, len(result.history) - 1)]
            at = moved(model, step.X_WO)
            lines = np.full((len(scene), 3, 2), np.nan)
            lines[:, 0], lines[:, 1] = scene, at[step.correspondences]
            tangle.set_data(*lines.reshape(-1, 2).T)
            outline.set_data(*np.concatenate([at, at[:1]]).T)
            total = sums[min(k, len(sums) - 1)]
            ax.set_title(f"step {min(k, result.iterations)}: sum of squares {total:.3f}")
        yield fig


save_animation(frames(), "two_runs", period=0.3)
plt.close(fig)

fig, ax = plt.subplots(figsize=(6, 3.2))
for (_, sums), label in zip(runs, ("off by 40°", "off by 166°"), strict=True):
    ax.semilogy(np.maximum(sums, 1e-6), "o-", ms=3, label=label)
ax.set(xlabel="step", ylabel="sum of squared distances")
ax.legend()
fig.tight_layout()
save_figure(fig, "convergence")

# %% [markdown]
# ## How often
#
# Twelve shapes, each from starts turned by up to 180° either way; right is what ends within 10°.
# The translation comes out tolerably from anywhere, for the centroids are drawn to each other
# whatever the partners are; the rotation is right only if the start was.

# %%
offsets = np.radians(np.arange(-165, 180, 30))
right = np.zeros((12, len(offsets)), dtype=bool)
shift = np.zeros(right.shape)
for i in range(len(right)):
    model = blob(rng)
    scene = moved(model[::10], X_WO)
    for j, offset in enumerate(offsets):
        result = icp_2d(scene, model, planar_pose(offset, X_WO[:2, 2] + rng.normal(0, 0.2, 2)))
        assert result.X_WO is not None
        shift[i, j] = np.linalg.norm(result.X_WO[:2, 2] - X_WO[:2, 2])
        right[i, j] = abs(np.arctan2(result.X_WO[1, 0], result.X_WO[0, 0])) < np.radians(10)
share = right.mean(axis=0)
near = np.abs(offsets) < np.radians(50)
far = np.abs(offsets) > np.radians(85)
assert share[near].mean() > 0.85
assert share[far].mean() < 0.2
assert np.median(shift[~right]) < 0.35  # Of shapes about 1.5 across.

fig, ax = plt.subplots(figsize=(6, 3.2))
ax.bar(np.degrees(offsets), share, width=24)
ax.set(xlabel="first guess off by [deg]", ylabel="share of right answers", ylim=(0, 1))
ax.set_title(f"of all starts: {right.mean():.0%}", fontsize=10)
fig.tight_layout()
save_figure(fig, "share_of_right_answers")
