# %% [markdown]
# # Coherent point drift
#
# ICP decides: this point belongs to that one. Coherent point drift hedges: each scene point belongs
# to every model point, to a degree that falls with distance. Model points are the centres of
# Gaussians of one width; pose and width are chosen to make the scene likely, in turns, and the
# width shrinks by itself as things fall into place. (Section 4.5.4.)

# %%
import time

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.collections import LineCollection, PatchCollection
from pydrake.math import RigidTransform, RollPitchYaw
from scipy.interpolate import CubicSpline
from scipy.spatial.distance import cdist

from prehensile.perception import PointCloud, mesh_of_model, sample_mesh_poisson_disc
from prehensile.perception.registration import (
    FilterRegConfig,
    IcpConfig,
    PointDriftConfig,
    coherent_point_drift,
    filter_registration,
    fit_rigid,
    icp,
    icp_2d,
    planar_pose,
    point_drift_2d,
)
from prehensile.perception.visibility import visible_points
from prehensile.viz.figures import save_animation, save_figure

# %% [markdown]
# ## Weights instead of partners
#
# With $d_{ij}$ the distance of scene point $i$ from model point $j$ at the present pose, the weight
# of the pair is
#
# $$ C_{ij} = \frac{e^{-d_{ij}^2 / 2 \sigma^2}}{\sum_k e^{-d_{ik}^2 / 2 \sigma^2} + c} $$
#
# where the constant $c$ stands for "belongs to nothing": with a part $w$ of outliers spread evenly
# over a volume $V$ it is $(2 \pi \sigma^2)^{D/2} \frac{w}{1 - w} \frac{N_m}{V}$. The pose is then
# the weighted fit of all pairs, which is that of each scene-weighted mean to its model point; and
# the new variance is the weighted mean square of the distances that remain, over the dimension.


# %%
def blob(rng, count):
    """Points along a random smooth closed outline, (count, 2)."""
    radius = rng.uniform(0.4, 1.1, 8)
    outline = CubicSpline(np.linspace(0, 2 * np.pi, 9), [*radius, radius[0]], bc_type="periodic")
    angle = np.linspace(0, 2 * np.pi, count, endpoint=False)
    return outline(angle)[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def moved(points, X):
    """Points of the plane by a pose (3, 3)."""
    return points @ X[:2, :2].T + X[:2, 2]


def weights(scene, model_W, sigma, w, V):
    """C of all pairs, (Ns, Nm)."""
    closeness = np.exp(-(cdist(scene, model_W) ** 2) / (2 * sigma**2))
    c = 2 * np.pi * sigma**2 * w / (1 - w) * len(model_W) / V
    return closeness / (closeness.sum(axis=1, keepdims=True) + c)


def drift(scene, model, w, steps):
    """Poses and sigmas of coherent point drift in the plane, from the identity."""
    X, V = np.eye(3), float(np.prod(np.ptp(scene, axis=0)))
    sigma = np.sqrt((cdist(scene, model) ** 2).mean() / 2)
    history = [(X, sigma)]
    for _ in range(steps):
        C = weights(scene, moved(model, X), sigma, w, V)
        share = C.sum(axis=0)
        used = share > 1e-12
        mean = (C.T @ scene)[used] / share[used, None]  # What each model point is drawn to.
        fit = fit_rigid(model[used], mean, share[used])
        X = planar_pose(np.arctan2(fit.R_WO[1, 0], fit.R_WO[0, 0]), fit.p_WO)
        sigma = np.sqrt((C * cdist(scene, moved(model, X)) ** 2).sum() / (2 * C.sum()))
        history.append((X, sigma))
    return history


rng = np.random.default_rng(5)
model = blob(rng, 60)
X_WO = planar_pose(1.0, [0.9, 0.4])
scene = moved(model, X_WO) + rng.normal(0, 0.015, model.shape)
scene = np.vstack([scene, rng.uniform([-0.4, -1], [2.2, 1.7], (25, 2))])

history = drift(scene, model, 0.3, 60)
library = point_drift_2d(scene, model, config=PointDriftConfig(outlier_weight=0.3))
assert library.succeeded
assert library.X_WO is not None
np.testing.assert_allclose(history[-1][0], library.X_WO, atol=1e-3)
np.testing.assert_allclose(library.X_WO, X_WO, atol=0.03)

hard = icp_2d(scene, model, np.eye(3))
assert hard.X_WO is not None
assert np.abs(hard.X_WO - X_WO).max() > 0.3  # ICP from there gets stuck.

# %% [markdown]
# Left, the Gaussians as circles of one $\sigma$, and lines as dark as the weights; right, the
# matrix of weights itself. It begins grey, everything belonging to everything, and ends as a
# diagonal, that of the true correspondences; the last 25 scene points are outliers, and belong to
# nothing.

# %%
fig, (left, right) = plt.subplots(1, 2, figsize=(9, 4.2), width_ratios=(1.2, 1))
volume = float(np.prod(np.ptp(scene, axis=0)))


def frames():
    """Draws a step at a time."""
    for k in [*range(0, 32, 2), 35, 60]:
        X, sigma = history[k]
        at = moved(model, X)
        C = weights(scene, at, sigma, 0.3, volume)
        left.clear()
        i, j = np.nonzero(C > 0.05)
        shades = np.stack([0 * i, 0 * i, 0 * i, C[i, j]], axis=1)
        left.add_collection(LineCollection(np.stack([scene[i], at[j]], axis=1), colors=shades))
        circles = [plt.Circle(center, sigma) for center in at[::6]]
        left.add_collection(PatchCollection(circles, color="tab:blue", alpha=0.1, lw=0))
        left.plot(*at.T, ".", color="tab:blue", label="model")
        left.plot(*scene.T, ".", color="tab:red", label="scene")
        left.set(xlim=(-1.3, 2.4), ylim=(-1.4, 2.0), aspect="equal")
        left.set_title(f"step {k}: σ = {sigma:.3f}")
        left.legend(loc="upper left")
        right.clear()
        right.imshow(C, cmap="Greys", vmin=0, vmax=0.5, aspect="auto", interpolation="nearest")
        right.set(xlabel="model point", ylabel="scene point", title="weights")
        yield fig


save_animation(frames(), "drift", period=0.2)
plt.close(fig)

final = weights(scene, moved(model, history[-1][0]), history[-1][1], 0.3, volume)
assert np.median(final[:60].sum(axis=1)) > 0.9
assert np.median(final[60:].sum(axis=1)) < 0.1

# %% [markdown]
# ## The outlier weight
#
# Without it every scene point must be explained, and clutter keeps $\sigma$ wide and the pose off.
# The weight need not be exact: anything of the right order will do.

# %%
outlier_weights = (0.0, 0.05, 0.1, 0.2, 0.3, 0.5, 0.7)
errors = []
for w in outlier_weights:
    result = point_drift_2d(scene, model, config=PointDriftConfig(outlier_weight=w))
    assert result.X_WO is not None
    offset = moved(model, result.X_WO) - moved(model, X_WO)
    errors.append(float(np.sqrt((offset**2).sum(axis=1).mean())))
assert errors[0] > 0.05
assert max(errors[2:6]) < 0.02

# %% [markdown]
# ## In space, and what it costs
#
# Drift looks at all pairs, as long as the Gaussians are wide. The *filter form* puts them around
# the scene's points instead: each model point is drawn to the mean of the scene near it, sums run
# over near points only, as ICP's do, and distances may be those from tangent planes, which takes
# fewer steps. A full view of the mustard bottle, with 1 mm of noise, by more and more points:

# %%
mesh = mesh_of_model("mustard_bottle")
truth = RigidTransform(RollPitchYaw(0.3, -0.2, 0.4), [0.03, -0.02, 0.02])
start = RigidTransform()
to_planes = FilterRegConfig(point_to_plane=True, outlier_weight=0.5)
METHODS = {
    "coherent point drift": lambda scene, bottle: coherent_point_drift(scene, bottle, start),
    "filter, to points": lambda scene, bottle: filter_registration(scene, bottle, start),
    "filter, to planes": lambda scene, bottle: filter_registration(scene, bottle, start, to_planes),
}


def bottle_and_scene(count):
    """A model, the points that a scene shows of it, and which of them one camera would see."""
    bottle = sample_mesh_poisson_disc(mesh, count=count, seed=0)
    surface = sample_mesh_poisson_disc(mesh, count=count, seed=1).transformed(truth).points
    seen = visible_points(surface, [0.5, 0.4, 0.4])
    return bottle, PointCloud(surface + rng.normal(0, 0.001, surface.shape)), seen


def error_of(result, bottle):
    """Root mean square distance of the model's points from where they should be [m]."""
    gap = bottle.transformed(result.X_WO).points - bottle.transformed(truth).points
    return float(np.sqrt((gap**2).sum(axis=1).mean()))


sizes = (500, 1000, 2000, 3000)
seconds = {name: [] for name in METHODS}
for size in sizes:
    bottle, cloud, _ = bottle_and_scene(size)
    for name, method in METHODS.items():
        begin = time.process_time()
        result = method(cloud, bottle)
        seconds[name].append(time.process_time() - begin)
        assert result.X_WO is not None
        assert error_of(result, bottle) < 0.0015

fig, axes = plt.subplots(1, 2, figsize=(10, 3.4))
axes[0].plot(outlier_weights, errors, "o-")
axes[0].set(xlabel="outlier weight w", ylabel="error", title="in the plane, with clutter")
for name, times in seconds.items():
    axes[1].plot(sizes, 1000 * np.array(times), "o-", label=name)
axes[1].set(xlabel="points of model and scene", ylabel="time [ms]", title="a bottle in space")
axes[1].legend()
fig.tight_layout()
save_figure(fig, "outlier_weight_and_cost")

# %% [markdown]
# On a partial view, the part of the model that is not seen has no counterpart, and while the
# Gaussians are wide it is drawn to what is seen. The drift, whose scene points choose, gets over
# that here; in the filter form, where each model point chooses, some of the pull stays, millimetres
# of it. ICP from there puts them right.

# %%
bottle, cloud, seen = bottle_and_scene(1000)
pulled = {}
for name, method in METHODS.items():
    result = method(cloud.select(seen), bottle)
    assert result.X_WO is not None
    pulled[name] = error_of(result, bottle) / error_of(method(cloud, bottle), bottle)
    refined = icp(cloud.select(seen), bottle, result.X_WO, IcpConfig(tolerance=1e-4))
    assert error_of(refined, bottle) < 0.001
assert pulled["filter, to points"] > 5
assert pulled["filter, to planes"] > 3
