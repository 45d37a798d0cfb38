# %% [markdown]
# # Differential inverse kinematics as a quadratic program
#
# $$\min_v |J^G(q) v - V^{G_d}|^2 \quad \text{subject to} \quad v_{min} \le v \le v_{max}$$
#
# With two joints the cost is a bowl over the plane of joint velocities, and the limits cut a box
# out of it. Near a singularity the bowl becomes a valley and its bottom moves far away; the best
# point in the box is then not the bottom cut off joint by joint. (Example 3.14.)

# %%
import matplotlib.pyplot as plt
import numpy as np

from prehensile.kinematics.differential_ik import pseudo_inverse, velocity_limited
from prehensile.viz.figures import save_figure

v_max = np.array([1.0, 1.0])
V = np.array([-0.5, 0.6])


def jacobian(q):
    """Translational Jacobian of a planar arm with two links of 1 m."""
    first, both = q[0], q[0] + q[1]
    return np.array([
        [-np.sin(first) - np.sin(both), -np.sin(both)],
        [np.cos(first) + np.cos(both), np.cos(both)],
    ])  # fmt: skip


def cost(J, v):
    return np.sum((J @ v - V) ** 2)


# %% [markdown]
# The first posture is a good one: the optimum is in the box, and it is that of the pseudo-inverse.
# The second is nearly straight.

# %%
postures = {"bent": np.array([0.2, 1.4]), "nearly straight": np.array([0.2, 0.35])}
grid = np.linspace(-2.6, 2.6, 201)
v_0, v_1 = np.meshgrid(grid, grid)
figure, panels = plt.subplots(1, 2, figsize=(11, 5))
results = {}
for axes, (name, q) in zip(panels, postures.items(), strict=True):
    J = jacobian(q)
    free, best = pseudo_inverse(J, V), velocity_limited(J, V, v_max)
    cut = np.clip(free, -v_max, v_max)
    results[name] = (J, free, cut, best)
    error = np.einsum("ij,jab->iab", J, np.stack([v_0, v_1])) - V[:, None, None]
    levels = np.geomspace(0.003, 60.0, 18)
    axes.contour(v_0, v_1, np.sum(error**2, axis=0), levels=levels, cmap="viridis")
    axes.add_patch(plt.Rectangle(-v_max, 2, 2, facecolor="none", edgecolor="tab:red", linewidth=2))
    axes.plot(*free, "kx", label="pseudo-inverse")
    axes.plot(*cut, "s", color="tab:orange", label="cut off joint by joint")
    axes.plot(*best.v, "o", color="tab:red", label="optimum within the limits")
    axes.set(xlim=(-2.6, 2.6), ylim=(-2.6, 2.6), title=name, xlabel="$v_0$", ylabel="$v_1$")
    axes.set_aspect("equal")
panels[0].legend()
save_figure(figure, "bowl_and_box")

# %%
J, free, cut, best = results["bent"]
np.testing.assert_allclose(best.v, free, atol=1e-8)
assert cost(J, best.v) < 1e-12

J, free, cut, best = results["nearly straight"]
assert np.max(np.abs(free)) > 1.0
assert np.all(np.abs(best.v) <= v_max + 1e-9)
assert cost(J, best.v) < 0.8 * cost(J, cut)

# %% [markdown]
# It is the optimum: no point of a fine grid of the box is better, and the gradient of the cost
# points out of the box wherever a limit is active.

# %%
inside = np.linspace(-1.0, 1.0, 401)
best_on_grid = min(cost(J, np.array([a, b])) for a in inside for b in inside)
assert cost(J, best.v) <= best_on_grid + 1e-12
gradient = 2.0 * J.T @ (J @ best.v - V)
for k in range(2):
    if best.at_limit[k] == 0:
        assert abs(gradient[k]) < 1e-6
    else:
        assert gradient[k] * best.at_limit[k] < 0.0

# %% [markdown]
# What the hand does: with the joints cut off one by one it moves at half the speed that it should;
# the optimum comes as near to the wanted velocity as the joints permit.

# %%
figure, axes = plt.subplots(figsize=(5.5, 4.5))
for name, v, color in (
    ("wanted", free, "k"),
    ("cut off joint by joint", cut, "tab:orange"),
    ("optimum within the limits", best.v, "tab:red"),
):
    axes.quiver(0, 0, *(J @ v), angles="xy", scale_units="xy", scale=1, color=color, label=name)
axes.set(xlim=(-0.8, 0.3), ylim=(-0.3, 0.9), aspect="equal", xlabel="m/s", ylabel="m/s")
axes.legend(loc="lower left")
save_figure(figure, "what_the_hand_does")
