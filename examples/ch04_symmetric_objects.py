# %% [markdown]
# # Symmetric objects
#
# A cube turned by 90° about an axis through its centre looks the same, so several poses explain a
# view of it equally well. Yet with known correspondences the objective is quadratic in the entries
# of $R$, and a round bowl over a circle has one lowest point. How can it have several equally good
# solutions? (Exercise 4.2.)

# %%
import itertools

import matplotlib.pyplot as plt
import numpy as np

from prehensile.perception.registration.known import fit_rigid
from prehensile.viz.figures import save_figure


def rotation(theta):
    """R(theta) of the plane, (2, 2)."""
    return np.array([[np.cos(theta), -np.sin(theta)], [np.sin(theta), np.cos(theta)]])


square = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])
theta = np.radians(20)
scene = square @ rotation(theta).T
angles = np.linspace(-np.pi, np.pi, 1441)

# %% [markdown]
# ## It cannot, while the correspondences are known
#
# A correspondence that says "this corner is corner A" has told the corners apart: the symmetry is
# gone. The cost is $\sum_i |p^{m_i}|^2 + |p^{s_i}|^2$ minus a single cosine of $\theta$, which has
# one minimum.

# %%
known = np.array([((square @ rotation(t).T - scene) ** 2).sum() for t in angles])
lowest = (known < np.roll(known, 1)) & (known < np.roll(known, -1))
assert lowest.sum() == 1
assert np.isclose(angles[known.argmin()], theta, atol=0.01)

# %% [markdown]
# ## The symmetry is in the correspondences
#
# Each of the four cyclic ways to pair corners gives its own bowl, with its own minimum, 90° from
# the next. The cost over all correspondences, the least of the four bowls, has four equally deep
# minima. (The other pairings fit no rotation exactly.)

# %%
exact = []
for order in itertools.permutations(range(4)):
    fit = fit_rigid(square[list(order)], scene)
    if fit.residual < 1e-9:
        exact.append(np.arctan2(fit.R_WO[1, 0], fit.R_WO[0, 0]))
turns = np.sort(np.degrees(np.array(exact) - theta)) % 360
assert np.allclose(np.sort(turns), [0, 90, 180, 270])

distances = np.linalg.norm(
    (square @ np.array([rotation(t) for t in angles]).transpose(0, 2, 1))[:, None] - scene[:, None],
    axis=-1,
)
free = (distances.min(axis=-1) ** 2).sum(axis=-1)  # Each scene corner takes its nearest.
deep = (free < np.roll(free, 1)) & (free < np.roll(free, -1)) & (free < 0.01)
assert deep.sum() == 4

fig, ax = plt.subplots(figsize=(7, 3.6))
for k in range(4):
    bowl = [((np.roll(square, k, axis=0) @ rotation(t).T - scene) ** 2).sum() for t in angles]
    ax.plot(np.degrees(angles), bowl, "--", lw=1, label=f"corners shifted by {k}")
ax.plot(np.degrees(angles), free, color="black", label="nearest corners")
ax.set(xlabel="θ [deg]", ylabel="sum of squared distances", title="A square")
ax.legend(loc="upper right", fontsize=8)
save_figure(fig, "square")

# %% [markdown]
# ## In practice
#
# A registration of a symmetric object ends in one of its equivalent poses; which one depends on the
# start. An error measure that counts each pose of the symmetry as right (such as ADD-S, the mean
# distance to the *nearest* point of the true object) is then the fair one, and what a robot needs:
# any of the equivalent poses is as good to grasp. Where symmetry is continuous, as of a cylinder
# about its axis, the least squares themselves say so: their information matrix loses rank, and the
# result names the free motion instead of claiming a pose.

# %%
true_pose = scene
quarter = square @ rotation(theta + np.pi / 2).T
add = np.linalg.norm(quarter - true_pose, axis=1).mean()
add_s = np.linalg.norm(quarter[:, None] - true_pose, axis=-1).min(axis=0).mean()
assert add > 1.9
assert add_s < 1e-12
