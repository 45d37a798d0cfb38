# %% [markdown]
# # Objects are not inside the table
#
# Points of a camera are noisy; that the object stands *on* the table and *before* the wall is
# certain. Such knowledge is a constraint on the pose: every point of the object in a half-space.
# With constraints the closed form is gone; here are two ways on. (Examples 4.8 and 4.9.)

# %%
import matplotlib.pyplot as plt
import numpy as np

from prehensile.perception.registration.constraints import HalfSpaces, fit_rigid_constrained
from prehensile.perception.registration.convex_constraints import fit_rigid_convex
from prehensile.perception.registration.known import fit_rigid
from prehensile.viz.figures import save_figure

first_quadrant = HalfSpaces.box([0.0, 0.0], [np.inf, np.inf])  # x >= 0 and y >= 0.
box = np.array([[-0.5, -0.3], [0.5, -0.3], [0.5, 0.3], [-0.5, 0.3]])


def moved(theta, x, y):
    """The box's corners at a pose of the plane."""
    c, s = np.cos(theta), np.sin(theta)
    return box @ np.array([[c, -s], [s, c]]).T + [x, y]


# %% [markdown]
# ## Nonlinear optimization
#
# Minimize the squared distances of known correspondences over $\theta$ and $p$, with
# $p + R(\theta)\, p^{m_i} \ge 0$ for every corner. In two unknown angles and lengths there is no
# convexity to lean on, so the solver starts from several places.

# %%
scene = moved(0.4, 0.35, 0.15)
assert scene.min() < -0.1  # Seen to reach through both walls.
free = fit_rigid(box, scene)
assert free.residual < 1e-12

nonlinear = fit_rigid_constrained(box, scene, first_quadrant)
assert nonlinear.X_WO is not None
X = nonlinear.X_WO.GetAsMatrix4()
corners = box @ X[:2, :2].T + X[:2, 3]
assert corners.min() > -1e-6
assert np.isclose(np.linalg.det(X[:2, :2]), 1)

# By brute force: for each angle the best translation is known in closed form, since the cost is a
# paraboloid about the centroid and the constraints say p_x >= -min x, p_y >= -min y.
best = np.inf
for theta in np.linspace(-np.pi, np.pi, 20001):
    turned = moved(theta, 0, 0)
    p = np.maximum(scene.mean(axis=0) - turned.mean(axis=0), -turned.min(axis=0))
    best = min(best, ((turned + p - scene) ** 2).sum())
cost = ((corners - scene) ** 2).sum()
assert cost < best * (1 + 1e-6)

# %% [markdown]
# ## Convex optimization
#
# Write $R = \begin{bmatrix} a & -b \\ b & a \end{bmatrix}$ and relax $a^2 + b^2 = 1$ to $a^2 +
# b^2 \le 1$: a second-order cone program, with one minimum and no start to choose. Its value is a
# lower bound on that of any pose. If the answer lies on the circle it *is* the best pose.
# Otherwise the box has been shrunk to explain the data, and the answer says so.

# %%
loose = fit_rigid_convex(box, scene, first_quadrant)
assert loose.R_WO is not None
assert loose.p_WO is not None
shrunk = box @ loose.R_WO.T + loose.p_WO
assert shrunk.min() > -1e-6
size = np.sqrt(np.linalg.det(loose.R_WO))
assert size < 0.95
assert loose.rotation_error > 0.05
assert loose.lower_bound <= cost <= loose.cost + 1e-9

# %% [markdown]
# Where the scene hardly pulls the object into the walls, the relaxation is tight, and then the
# bound proves that no pose is better.

# %%
gentle = moved(0.4, 0.70, 0.60)
tight = fit_rigid_convex(box, gentle, first_quadrant)
assert tight.rotation_error < 1e-3
assert tight.gap < 1e-4

fig, axes = plt.subplots(1, 3, figsize=(12, 4), sharex=True, sharey=True)
shown = (
    ("nonlinear", scene, corners),
    (f"relaxed: shrunk to {size:.2f}", scene, shrunk),
    ("relaxed, tight", gentle, box @ tight.R_WO.T + tight.p_WO),
)
for ax, (title, seen, answer) in zip(axes, shown, strict=True):
    ax.axhline(0, color="tab:green", lw=3)
    ax.axvline(0, color="tab:green", lw=3)
    ax.fill(*seen.T, facecolor="none", edgecolor="tab:red", lw=2, label="scene")
    ax.fill(*answer.T, facecolor="none", edgecolor="tab:blue", lw=2, label="answer")
    ax.set(title=title, aspect="equal", xlim=(-0.3, 1.3), ylim=(-0.4, 1.2))
axes[0].legend()
fig.tight_layout()
save_figure(fig, "both_ways")

# %% [markdown]
# ## How often is it tight?
#
# Scenes pushed ever deeper into the corner: the gap between the bound and the pose grows with the
# pull.

# %%
depths = np.linspace(-0.2, 0.4, 13)
errors = [
    fit_rigid_convex(box, moved(0.4, 0.6 - d, 0.5 - d), first_quadrant).rotation_error
    for d in depths
]
assert errors[0] < 1e-3
assert errors[-1] > 0.1
fig, ax = plt.subplots(figsize=(6, 3.2))
ax.plot(depths, errors, "o-")
ax.set(xlabel="how far the scene is pushed in", ylabel="distance of R from a rotation")
fig.tight_layout()
save_figure(fig, "tightness")
