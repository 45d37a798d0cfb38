# %% [markdown]
# # The basins of a two-point ICP
#
# Two model points at $(\pm 1, 0)$, two scene points at the same places. Nearest neighbours decide
# who belongs to whom, so the start decides where ICP ends. The problem is small enough to know all
# of its answers. (Exercise 4.5.)

# %%
import matplotlib.pyplot as plt
import numpy as np

from prehensile.perception.registration.known import fit_rigid
from prehensile.viz.figures import save_figure

p_m = np.array([[1.0, 0.0], [-1.0, 0.0]])
p_s = np.array([[1.0, 0.0], [-1.0, 0.0]])


def rotation(theta):
    """R(theta), (..., 2, 2)."""
    c, s = np.cos(theta), np.sin(theta)
    return np.stack([np.stack([c, -s], -1), np.stack([s, c], -1)], -2)


def correspondences(theta, p):
    """For each scene point the nearest model point at the pose (theta, p), (2,)."""
    moved = p_m @ rotation(theta).T + p
    return np.linalg.norm(p_s[:, None] - moved, axis=-1).argmin(axis=1)


# %% [markdown]
# ## (a) The right correspondence
#
# With $c = (1, 2)$ the cost is $2(p_x^2 + p_y^2) + 2((a - 1)^2 + b^2)$, a sum of squares that is
# zero only at $p = 0$, $a = 1$, $b = 0$. The start is paired so if each scene point is nearer to
# its own model point. With the rotated model points at $p \pm u$, $u = (\cos\theta, \sin\theta)$,
# the scene point $s$ prefers the first when $(s - p) \cdot u > 0$; so for $s = (\pm 1, 0)$ both
# are right when
#
# $$\cos\theta > |p \cdot u|.$$

# %%
fit = fit_rigid(p_m, p_s)
assert np.allclose(fit.R_WO, np.eye(2))
assert np.allclose(fit.p_WO, 0)

rng = np.random.default_rng(0)
thetas, places = rng.uniform(-np.pi, np.pi, 2000), rng.uniform(-2, 2, (2000, 2))
u = np.column_stack([np.cos(thetas), np.sin(thetas)])
along = np.abs((places * u).sum(axis=1))
for theta, p, cosine, offset in zip(thetas, places, u[:, 0], along, strict=True):
    right = correspondences(theta, p).tolist() == [0, 1]
    assert right == (cosine > offset)

# %% [markdown]
# ## (b) The flipped correspondence
#
# With $c = (2, 1)$ the same sum has $a + 1$ for $a - 1$: the minimum, again zero, is the half turn
# $a = -1$. Its basin is the mirror image, $-\cos\theta > |p \cdot u|$. Without marks on the points
# nothing tells the two apart.

# %%
fit = fit_rigid(p_m[[1, 0]], p_s)
assert np.allclose(fit.R_WO, -np.eye(2))
assert fit.residual < 1e-12

# %% [markdown]
# ## (c) Both scene points take one model point
#
# Otherwise both prefer the same model point. The centred model points are then zero, so the data
# matrix $W = \sum (p^{s_i} - \bar p^s)(p^{m_{c_i}} - \bar p^m)^T$ vanishes: the rotation is left
# open (a plain SVD of zero gives the identity), and the translation puts that one model point
# into the middle, at a cost of $1 + 1 = 2$ for ever after. (The other model point then lies
# exactly as near to one of the scene points, a tie, which changes nothing if it goes to the old
# partner.)

# %%
stuck = fit_rigid(p_m[[0, 0]], p_s)
assert not stuck.succeeded  # Says that the rotation is not determined.
centred = p_m[[0, 0]] - p_m[[0, 0]].mean(axis=0)
assert np.array_equal((p_s - p_s.mean(axis=0)).T @ centred, np.zeros((2, 2)))
assert np.isclose(2 * stuck.residual**2, 2)

# %% [markdown]
# ## The map of all starts
#
# For the translations $p = (p_x, 0)$: the right answer, the flipped one, and where ICP gets stuck.

# %%
theta, px = np.meshgrid(np.linspace(-np.pi, np.pi, 361), np.linspace(-2, 2, 241))
offset = np.abs(px * np.cos(theta))
basin = np.where(np.cos(theta) > offset, 0, np.where(-np.cos(theta) > offset, 1, 2))
for i, j in rng.integers(0, [241, 361], (300, 2)):
    c = correspondences(theta[i, j], np.array([px[i, j], 0])).tolist()
    clear = abs(abs(np.cos(theta[i, j])) - offset[i, j]) > 1e-9
    assert not clear or basin[i, j] == {(0, 1): 0, (1, 0): 1}.get(tuple(c), 2)

fig, ax = plt.subplots(figsize=(7, 4))
colours = plt.matplotlib.colors.ListedColormap(["tab:green", "tab:orange", "tab:red"])
ax.pcolormesh(np.degrees(theta), px, basin, cmap=colours, shading="nearest", alpha=0.8)
for text, x, y in (("right", 0, 0), ("flipped", 150, 0), ("stuck", 60, 1.6)):
    ax.text(x, y, text, ha="center", va="center", fontsize=13)
ax.set(
    xlabel="θ at the start [deg]", ylabel="$p_x$ at the start", title="where ICP ends ($p_y = 0$)"
)
save_figure(fig, "basins")
