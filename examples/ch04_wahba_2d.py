# %% [markdown]
# # A rotation as a point on a circle: a bowl and a cylinder
#
# Which rotation takes model points $p^{m_i}$ nearest to scene points $p^{s_i}$ (Wahba's problem)?
# In the plane a rotation matrix has two numbers,
#
# $$R = \begin{bmatrix} a & -b \\ b & a \end{bmatrix}, \qquad a^2 + b^2 = 1,$$
#
# so the whole problem can be drawn: the sum of squared distances is a quadratic bowl over the plane
# of $(a, b)$, and the constraint is a cylinder over the unit circle. (Example 4.2.)

# %%
import matplotlib.pyplot as plt
import numpy as np

from prehensile.perception.registration.known import fit_rotation
from prehensile.viz.figures import save_animation, save_figure


def rotation(theta):
    """R(theta) of the plane, (2, 2)."""
    return np.array([[np.cos(theta), -np.sin(theta)], [np.sin(theta), np.cos(theta)]])


def cost(a, b, model, scene):
    """Sum of |R(a, b) p^m - p^s|^2 for numbers or grids a, b."""
    x = a[..., None] * model[:, 0] - b[..., None] * model[:, 1] - scene[:, 0]
    y = b[..., None] * model[:, 0] + a[..., None] * model[:, 1] - scene[:, 1]
    return (x**2 + y**2).sum(axis=-1)


model = np.array([[0.9, 0.1], [-0.2, 0.7]])
truth = 0.8
scene = model @ rotation(truth).T

# %% [markdown]
# ## The bowl
#
# The bowl is round: its Hessian is $2 \sum_i |p^{m_i}|^2$ times the identity, whatever the points.
# Its lowest point solves a linear system of two unknowns. Without noise, that point lies on the
# circle already: the constraint does nothing.

# %%
weight = (model**2).sum()


def bottom(model, scene):
    """(a, b) where the bowl is lowest."""
    a = (model * scene).sum()
    b = (model[:, 0] * scene[:, 1] - model[:, 1] * scene[:, 0]).sum()
    return np.array([a, b]) / (model**2).sum()


assert np.allclose(bottom(model, scene), [np.cos(truth), np.sin(truth)])
a, b = np.random.default_rng(0).normal(size=(2, 100))
low = bottom(model, scene)
bowl = weight * ((a - low[0]) ** 2 + (b - low[1]) ** 2)
assert np.allclose(cost(a, b, model, scene), bowl)

# %% [markdown]
# ## Noise lifts the bottom off the circle
#
# With noise in the scene the bottom of the bowl is no rotation. Because the bowl is round, the best
# point on the circle is simply the nearest one to the bottom: divide by its length. That is what
# the singular value decomposition does in any dimension.

# %%
noisy = scene + np.array([[0.15, -0.35], [0.2, 0.1]])
low = bottom(model, noisy)
best = low / np.linalg.norm(low)
fit = fit_rotation(model, noisy)
assert abs(np.linalg.norm(low) - 1) > 0.02
assert np.allclose(fit.R_WO, [[best[0], -best[1]], [best[1], best[0]]])

angles = np.linspace(-np.pi, np.pi, 2001)
along = cost(np.cos(angles), np.sin(angles), model, noisy)
assert np.isclose(angles[along.argmin()], np.arctan2(best[1], best[0]), atol=2e-3)


def draw(ax, scene):
    """Bowl, cylinder, and the best rotation."""
    grid = np.linspace(-1.6, 1.6, 41)
    A, B = np.meshgrid(grid, grid)
    ax.plot_surface(A, B, cost(A, B, model, scene), color="tab:green", alpha=0.35, linewidth=0)
    turn = np.linspace(0, 2 * np.pi, 121)
    top = 7.0
    T, Z = np.meshgrid(turn, [0.0, top])
    ax.plot_surface(np.cos(T), np.sin(T), Z, color="tab:red", alpha=0.12, linewidth=0)
    on = cost(np.cos(turn), np.sin(turn), model, scene)
    ax.plot(np.cos(turn), np.sin(turn), on, color="tab:red")
    low = bottom(model, scene)
    best = low / np.linalg.norm(low)
    ax.scatter(*low, 0, color="tab:green", s=40, depthshade=False, label="bottom of the bowl")
    height = cost(best[0][None], best[1][None], model, scene)
    ax.scatter(*best, height, color="black", s=40, depthshade=False, label="best rotation")
    ax.set(xlabel="a", ylabel="b", zlabel="cost", zlim=(0, top))
    ax.view_init(32, -60)


fig, axes = plt.subplots(1, 2, figsize=(10, 4.8), subplot_kw={"projection": "3d"})
for ax, points, title in zip(axes, (scene, noisy), ("without noise", "with noise"), strict=True):
    draw(ax, points)
    ax.set_title(title)
axes[0].legend(loc="upper left")
save_figure(fig, "bowl_and_cylinder")

# %% [markdown]
# ## Turning the scene
#
# The true angle moves the bowl around the circle; its shape stays.

# %%
fig, ax = plt.subplots(figsize=(5, 4.6), subplot_kw={"projection": "3d"})


def frames():
    """The same picture for one turn of the scene."""
    for theta in np.linspace(0, 2 * np.pi, 24, endpoint=False):
        ax.clear()
        turned = model @ rotation(theta).T + 0.05
        draw(ax, turned)
        ax.set_title(f"true angle {np.degrees(theta):.0f}°")
        assert np.isclose(bottom(model, model @ rotation(theta).T)[0], np.cos(theta))
        yield fig


save_animation(frames(), "turning", period=0.15)
