# %% [markdown]
# # Only the translation is unknown
#
# Three scene points, three model points, and $R^O$ known to be the identity. What is left is a
# problem of two unknowns. (Exercise 4.4.)

# %%
import matplotlib.pyplot as plt
import numpy as np

from prehensile.perception.registration.known import fit_translation
from prehensile.viz.figures import save_figure

p_s = np.array([[1.0, 5.0], [3.0, 10.0], [5.0, 10.0]])
p_m = np.array([[-2.0, -5.0], [0.0, 0.0], [2.0, 0.0]])

# %% [markdown]
# ## (a) Decision variables and (b) constraints
#
# The decision variables are the two coordinates of $p^O = (p_x, p_y)$. The constraints of the full
# problem, $R R^T = I$ and $\det R = 1$, are about the rotation, which is given: none is left.
#
# ## (c) The objective at three places

# %%


def cost(p):
    """Sum of |p + p^m - p^s|^2, for p (..., 2)."""
    return ((np.asarray(p)[..., None, :] + p_m - p_s) ** 2).sum(axis=(-1, -2))


assert cost([0, 0]) == 9 + 100 + 9 + 100 + 9 + 100
assert cost([3, 10]) == 0
assert cost([6, 12]) == 3 * (9 + 4)

# %% [markdown]
# ## (d) Its shape
#
# A round paraboloid, $3\,|p - p^*|^2$ plus a constant (here zero), unconstrained: convex, with one
# minimum, where the gradient vanishes, at the difference of the two centroids. No start can be a
# wrong one.

# %%
fit = fit_translation(p_m, p_s, np.eye(2))
assert np.allclose(fit.p_WO, [3, 10])
assert np.allclose(fit.p_WO, p_s.mean(axis=0) - p_m.mean(axis=0))
places = np.random.default_rng(0).normal([3, 10], 5, (100, 2))
assert np.allclose(cost(places), 3 * ((places - fit.p_WO) ** 2).sum(axis=1))

fig = plt.figure(figsize=(10, 4))
left = fig.add_subplot(1, 2, 1)
left.fill(*p_s.T, alpha=0.3, color="tab:red", label="scene")
left.fill(*p_m.T, alpha=0.3, color="tab:blue", label="model")
for m, s in zip(p_m, p_s, strict=True):
    left.annotate("", s, m, arrowprops={"arrowstyle": "->", "color": "0.6"})
left.set(aspect="equal", xlabel="x", ylabel="y")
left.legend()
right = fig.add_subplot(1, 2, 2, projection="3d")
x, y = np.meshgrid(np.linspace(-3, 9, 41), np.linspace(3, 17, 41))
z = cost(np.stack([x, y], axis=-1))
right.plot_surface(x, y, z, cmap="viridis", alpha=0.8)
right.scatter(3, 10, 0, color="red", depthshade=False)
right.set(xlabel="$p_x$", ylabel="$p_y$", zlabel="cost")
save_figure(fig, "fixed_rotation")
