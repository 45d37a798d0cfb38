# %% [markdown]
# # Composing signed distances
#
# The signed distance of two shapes together is not simply the smaller one of the two, nor that of
# what they share the larger. But nearly, and always with the right sign: good enough to say where
# nothing may penetrate, also for a robot whose links move. (Exercise 4.10.)

# %%
import matplotlib.pyplot as plt
import numpy as np
from pydrake.geometry import Box
from pydrake.math import RigidTransform, RotationMatrix

from prehensile.perception.articulated_field import articulated_distance
from prehensile.perception.distance_field import DistanceField
from prehensile.perception.model_mesh import shape_mesh
from prehensile.viz.figures import save_animation, save_figure

# %% [markdown]
# ## (a), (b) Two half-planes and three points
#
# Red is $x \le 2$ and blue is $y \le 1$, so $\phi_r = x - 2$ and $\phi_b = y - 1$. The points are
# $p_0 = (1, -1)$ in both, $p_1 = (-1, 2)$ in red only, $p_2 = (5, 5)$ in neither:
#
# | | $\phi_r$ | $\phi_b$ | union | intersection |
# |---|---|---|---|---|
# | $p_0$ | −1 | −2 | $-\sqrt 5$ | −1 |
# | $p_1$ | −3 | +1 | −3 | +1 |
# | $p_2$ | +3 | +4 | +3 | +5 |
#
# Two of the six are neither of the two distances. $p_0$ lies deep in the union: the straight ways
# out of red and out of blue end inside the other one, and the nearest place outside of both is
# their corner $(2, 1)$, by Pythagoras. Likewise $p_2$ must go to the corner to get into both.

# %%
edge = np.array([2.0, 1.0])


def phi(p):
    """(..., 2) signed distances of red and of blue at points (..., 2)."""
    return np.asarray(p) - edge


# %% [markdown]
# ## (c) In cases
#
# By the four regions: in both, the union's boundary is nearest at the corner; in red only, at the
# edge of red, which is what $\phi_r$ says, and $\phi_r < \phi_b$; in blue only, likewise; in
# neither, the nearer of both. Three of the four are the minimum, which leaves
#
# $$\phi_{r \cup b} = \begin{cases} -\sqrt{\phi_r^2 + \phi_b^2} & \phi_r \le 0, \phi_b \le 0 \\
# \min(\phi_r, \phi_b) & \text{otherwise,} \end{cases} \qquad \phi_{r \cap b} = \begin{cases}
# \sqrt{\phi_r^2 + \phi_b^2} & \phi_r \ge 0, \phi_b \ge 0 \\ \max(\phi_r, \phi_b) &
# \text{otherwise.} \end{cases}$$
#
# (The corner is as simple as this because the edges are perpendicular.)

# %%


def union(p):
    """Signed distance of red and blue together."""
    both = phi(p)
    deep = (both <= 0).all(axis=-1)
    return np.where(deep, -np.linalg.norm(both, axis=-1), both.min(axis=-1))


def intersection(p):
    """Signed distance of what red and blue share."""
    both = phi(p)
    outside = (both >= 0).all(axis=-1)
    return np.where(outside, np.linalg.norm(both, axis=-1), both.max(axis=-1))


three = np.array([[1.0, -1.0], [-1.0, 2.0], [5.0, 5.0]])
assert np.allclose(phi(three), [[-1, -2], [-3, 1], [3, 4]])
assert np.allclose(union(three), [-np.sqrt(5), -3, 3])
assert np.allclose(intersection(three), [-1, 1, 5])

# %% [markdown]
# Against brute force: the distance to the nearest of many points of the boundary, which is the two
# half-lines that leave the corner to the right and up, or to the left and down.

# %%
x, y = np.meshgrid(np.linspace(-3, 7, 61), np.linspace(-4, 6, 61))
grid = np.stack([x, y], axis=-1)
reach = np.linspace(0, 15, 1501)


def brute_force(direction, inside):
    """Signed distance by the boundary's points; direction +1: right and up, -1: left and down."""
    zero = np.zeros_like(reach)
    boundary = np.vstack([np.column_stack([reach, zero]), np.column_stack([zero, reach])])
    boundary = edge + direction * boundary
    distance = [np.linalg.norm(row[:, None] - boundary, axis=-1).min(axis=1) for row in grid]
    return np.where(inside, -1, 1) * np.array(distance)


both = phi(grid)
assert np.allclose(union(grid), brute_force(+1, (both <= 0).any(axis=-1)), atol=0.01)
assert np.allclose(intersection(grid), brute_force(-1, (both <= 0).all(axis=-1)), atol=0.01)

# %% [markdown]
# ## Where the minimum is wrong, and by how much
#
# Only in the purple part: there the minimum is the way out of one shape, too short by up to
# $1 - 1/\sqrt 2 = 29\ \%$ on the diagonal. Everywhere its sign is right: the minimum is negative
# exactly where a point is in one of the shapes.

# %%
least = both.min(axis=-1)
wrong = np.abs(least - union(grid))
assert np.array_equal(np.sign(least), np.sign(union(grid)))
assert wrong[~(both < 0).all(axis=-1)].max() == 0
inside = union(grid) < 0
assert np.isclose((wrong[inside] / -union(grid)[inside]).max(), 1 - np.sqrt(0.5), atol=0.01)

fig, axes = plt.subplots(1, 3, figsize=(13.5, 4.2), sharey=True)
levels = np.arange(-7, 8)
for ax, values, title in (
    (axes[0], union(grid), "union"),
    (axes[1], least, "minimum of the two"),
    (axes[2], wrong, "what the minimum is short of"),
):
    error = ax is axes[2]
    style = {"cmap": "Purples"} if error else {"cmap": "RdBu", "vmin": -7, "vmax": 7}
    filled = ax.contourf(x, y, values, np.arange(0, 2.1, 0.25) if error else levels, **style)
    if not error:
        ax.contour(x, y, values, levels, colors="0.4", linewidths=0.5)
    ax.axvline(edge[0], color="tab:red", lw=2)
    ax.axhline(edge[1], color="tab:blue", lw=2)
    ax.set(title=title, aspect="equal", xlabel="x")
    fig.colorbar(filled, ax=ax, shrink=0.8)
for k, p in enumerate(three):
    axes[0].plot(*p, "o", color="black")
    axes[0].annotate(f"$p_{k}$: {union(p):.2f}", p, xytext=(-20, 7), textcoords="offset points")
save_figure(fig, "half_planes")

# %% [markdown]
# ## (d) A two-link arm
#
# The signed distance of a whole arm changes with every joint angle. That of each link does not, in
# the link's own frame: it is worked out once. For a point $p$ of the world, forward kinematics
# gives the poses $X^A(q_0)$ and $X^B(q_0, q_1)$ of the links; bring the point into each link's
# frame, look its distance up there, and take the least,
#
# $$\phi(p) = \min\bigl(\phi_{AB}(X^A(q_0)^{-1} p),\ \phi_{BC}(X^B(q_0, q_1)^{-1} p)\bigr).$$

# %%
lengths, width = (0.5, 0.4), 0.08
link_sizes = [np.array([length + width, width, 0.3]) for length in lengths]
fields = [DistanceField.from_mesh(shape_mesh(Box(*s)), spacing=0.01) for s in link_sizes]


def forward_kinematics(q0, q1):
    """Poses of the links' middles, from joint A at the origin."""
    X_WA = RigidTransform(RotationMatrix.MakeZRotation(q0), [0, 0, 0])
    X_WB = X_WA @ RigidTransform(RotationMatrix.MakeZRotation(q1), [lengths[0], 0, 0])
    middles = [RigidTransform([0.5 * length, 0, 0]) for length in lengths]
    return [X_WA @ middles[0], X_WB @ middles[1]]


xs, ys = np.meshgrid(np.linspace(-0.5, 1.2, 137), np.linspace(-0.5, 1.1, 129))
plane = np.column_stack([xs.ravel(), ys.ravel(), np.zeros(xs.size)])


def rectangle_distances(q0, q1):
    """(2, N) the links' signed distances at the plane's points, in closed form."""
    answers = []
    for X_WL, size in zip(forward_kinematics(q0, q1), link_sizes, strict=True):
        p = np.asarray(X_WL.inverse() @ plane.T).T[:, :2]
        out = np.abs(p) - 0.5 * size[:2]
        answers.append(np.linalg.norm(np.maximum(out, 0), axis=1) + np.minimum(out.max(axis=1), 0))
    return np.array(answers)


q = (0.3, 1.4)
composed = articulated_distance(fields, forward_kinematics(*q), plane)
exact = rectangle_distances(*q)
near = np.abs(exact.min(axis=0)) < 0.1  # Beyond its grid a field gives upper bounds.
assert np.abs(composed.distances - exact.min(axis=0))[near].max() < 0.01
clear = np.abs(exact.min(axis=0)) > 0.001
assert np.array_equal(np.sign(composed.distances)[clear], np.sign(exact.min(axis=0))[clear])

# %% [markdown]
# Its derivative by the joint angles comes with it: turning joint A by $dq_0$ moves the nearest link
# under the point, which changes the distance by $-\nabla\phi \cdot (z \times p)\, dq_0$.

# %%
dq = 1e-5
ahead = articulated_distance(fields, forward_kinematics(q[0] + dq, q[1]), plane).distances
behind = articulated_distance(fields, forward_kinematics(q[0] - dq, q[1]), plane).distances
by_q0 = -np.einsum("ij,ij->i", composed.gradients, np.cross([0, 0, 1], plane))
assert np.percentile(np.abs((ahead - behind) / (2 * dq) - by_q0)[near], 90) < 0.02

fig, ax = plt.subplots(figsize=(6.2, 5.2))


def pictures():
    """The composed distance while both joints move."""
    for t in np.linspace(0, 2 * np.pi, 16, endpoint=False):
        X_WL = forward_kinematics(0.5 + 0.5 * np.sin(t), 1.0 + 0.9 * np.cos(t))
        values = articulated_distance(fields, X_WL, plane).distances.reshape(xs.shape)
        ax.clear()
        ax.contourf(xs, ys, values, np.arange(-0.05, 0.61, 0.05), cmap="YlGnBu_r", extend="both")
        ax.contour(xs, ys, values, [0.0], colors="black")
        ax.plot(0, 0, "o", color="tab:red")
        ax.plot(*(X_WL[1] @ [-0.5 * lengths[1], 0, 0])[:2], "o", color="tab:red")
        ax.set(aspect="equal", title="signed distance of the arm", xlabel="x", ylabel="y")
        yield fig


save_animation(pictures(), "arm", period=0.18)
