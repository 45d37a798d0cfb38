# %% [markdown]
# # Does an angle as the unknown bring local minima?
#
# Nonlinear optimization over $\theta$ instead of the entries of $R$ needs no constraint, but the
# cost is no longer quadratic. With known correspondences, does it get local minima? (Example 4.7.)

# %%
import matplotlib.pyplot as plt
import numpy as np
from scipy.optimize import least_squares

from prehensile.perception.registration.known import fit_rigid
from prehensile.viz.figures import save_figure

rng = np.random.default_rng(5)
angles = np.linspace(-np.pi, np.pi, 721)


def rotation(theta):
    """R(theta) of the plane."""
    return np.array([[np.cos(theta), -np.sin(theta)], [np.sin(theta), np.cos(theta)]])


def residuals(theta, model, scene):
    """Differences of the centred points, one after the other."""
    turned = (model - model.mean(axis=0)) @ rotation(np.squeeze(theta)).T
    return (turned - (scene - scene.mean(axis=0))).ravel()


# %% [markdown]
# ## On a circle
#
# A point at radius $r$ that is turned wrongly by $\theta_e$ is off by the chord:
# $r^2 + r^2 - 2 r^2 \cos\theta_e$. Every point of a circle says the same, so the sum is one cosine.
#
# ## On anything
#
# Other shapes have points at other radii, and noise: the sum of cosines of the same frequency is
# a cosine again, $\sum_i |m_i|^2 + |s_i|^2 - 2 K \cos(\theta - \theta^*)$. One minimum per turn,
# which is the answer of the singular value decomposition.

# %%
turn = np.linspace(0, 2 * np.pi, 30, endpoint=False)
shapes = {
    "circle": np.column_stack([np.cos(turn), np.sin(turn)]),
    "anything": rng.normal(size=(12, 2)) * [1.5, 0.4],
}
fig, axes = plt.subplots(1, 2, figsize=(10, 3.4))
for ax, (name, model) in zip(axes, shapes.items(), strict=True):
    scene = model @ rotation(0.9).T + [3, 1] + rng.normal(0, 0.1, model.shape)
    cost = np.array([(residuals(t, model, scene) ** 2).sum() for t in angles])
    fit = fit_rigid(model, scene)
    best = np.arctan2(fit.R_WO[1, 0], fit.R_WO[0, 0])
    centred_m, centred_s = model - model.mean(axis=0), scene - scene.mean(axis=0)
    K = np.trace(centred_s.T @ centred_m @ rotation(best).T)
    total = (centred_m**2).sum() + (centred_s**2).sum()
    assert np.allclose(cost, total - 2 * K * np.cos(angles - best))
    for start in rng.uniform(-np.pi, np.pi, 20):
        found = least_squares(residuals, [start], args=(model, scene)).x[0]
        assert np.isclose(np.cos(found - best), 1, atol=1e-6)
    ax.plot(np.degrees(angles), cost)
    ax.axvline(np.degrees(best), color="tab:red", ls="--")
    ax.set(title=name, xlabel="θ [deg]", ylabel="cost")
fig.tight_layout()
save_figure(fig, "known_correspondences")

# %% [markdown]
# ## The correspondences bring them
#
# The same shape, but each scene point takes its *nearest* model point: now there are local minima,
# and where the optimization ends depends on its start.

# %%
model = shapes["anything"]
scene = model @ rotation(0.9).T
centred = model - model.mean(axis=0), scene - scene.mean(axis=0)


def nearest_cost(theta):
    """Sum of squared distances from each scene point to the nearest model point."""
    turned = centred[0] @ rotation(theta).T
    return (np.linalg.norm(centred[1][:, None] - turned, axis=-1).min(axis=1) ** 2).sum()


cost = np.array([nearest_cost(t) for t in angles[:-1]])
minima = (cost < np.roll(cost, 1)) & (cost < np.roll(cost, -1))
assert minima.sum() >= 4
assert np.isclose(angles[cost.argmin()], 0.9, atol=0.01)

fig, ax = plt.subplots(figsize=(8, 3.2))
ax.plot(np.degrees(angles[:-1]), cost)
ax.plot(np.degrees(angles[:-1][minima]), cost[minima], "o", color="tab:red")
ax.set(xlabel="θ [deg]", ylabel="cost", title=f"nearest neighbours: {minima.sum()} local minima")
fig.tight_layout()
save_figure(fig, "nearest_neighbours")
