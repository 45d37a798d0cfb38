# %% [markdown]
# # Planar arms and their manipulability ellipses
#
# The unit circle of joint velocities becomes an ellipse of hand velocities: how fast the hand can
# go in each direction. Here for planar arms of two and of three links. (Exercise 3.6.)

# %%
import matplotlib.pyplot as plt
import numpy as np

from prehensile.kinematics.jacobians import force_ellipsoid, manipulability, velocity_ellipsoid
from prehensile.viz.ellipsoids import plot_ellipse
from prehensile.viz.figures import save_figure


def points(q, lengths):
    """The base, the joints and the hand of a planar arm, (n + 1, 2)."""
    angles = np.cumsum(q)
    links = np.array(lengths)[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    return np.vstack([[0.0, 0.0], np.cumsum(links, axis=0)])


def jacobian(q, lengths):
    """Translational Jacobian of the hand, (2, n): each joint turns it about itself."""
    chain = points(q, lengths)
    arms = chain[-1] - chain[:-1]
    return np.stack([-arms[:, 1], arms[:, 0]])


# The columns are right: compare with differences.
rng = np.random.default_rng(0)
for _ in range(20):
    q, lengths = rng.uniform(-np.pi, np.pi, 3), rng.uniform(0.2, 1.0, 3)
    steps = 1e-6 * np.eye(3)
    ends = np.array([points(q + d, lengths)[-1] - points(q - d, lengths)[-1] for d in steps])
    np.testing.assert_allclose(jacobian(q, lengths), ends.T / 2e-6, atol=1e-8)

# %% [markdown]
# ## (a) The size of the Jacobian
#
# Two rows, for x and y, and a column for each joint: 2×2 for two links, 2×3 for three.

# %%
two, three = [1.0, 0.8], [0.8, 0.6, 0.4]
assert jacobian([0.3, 0.8], two).shape == (2, 2)
assert jacobian([0.3, 0.8, -0.5], three).shape == (2, 3)

# %% [markdown]
# ## (b) Its inverse
#
# The square one has an inverse where its determinant is not zero; then one joint velocity, and
# only one, moves the hand as wanted. The wide one never has an inverse. Where its rank is two,
# many joint velocities move the hand as wanted; the pseudo-inverse picks the smallest, and what a
# vector of the nullspace adds does not move the hand at all.

# %%
q_2, q_3, wanted = np.array([0.3, 0.8]), np.array([0.3, 0.8, -0.5]), np.array([0.1, -0.2])
J_2, J_3 = jacobian(q_2, two), jacobian(q_3, three)
np.testing.assert_allclose(np.linalg.pinv(J_2), np.linalg.inv(J_2), atol=1e-12)
v = np.linalg.pinv(J_3) @ wanted
null = np.linalg.svd(J_3)[2][2]
np.testing.assert_allclose(J_3 @ v, wanted, atol=1e-12)
np.testing.assert_allclose(J_3 @ (v + 0.7 * null), wanted, atol=1e-12)
assert np.linalg.norm(v) < np.linalg.norm(v + 0.7 * null)

# %% [markdown]
# ## (c) The ellipse
#
# Its half axes are the singular values, its area is pi times their product, the manipulability. At
# a singularity it collapses to a line: the straight arm can only move across itself. The ellipse of
# forces is the inverse one: strong where the arm is slow.

# %%
for q, lengths in ((q_2, two), (q_3, three)):
    J = jacobian(q, lengths)
    velocity, force = velocity_ellipsoid(J), force_ellipsoid(J)
    np.testing.assert_allclose(velocity.radii, np.linalg.svd(J, compute_uv=False))
    np.testing.assert_allclose(np.prod(velocity.radii), manipulability(J))
    np.testing.assert_allclose(np.sort(force.radii * velocity.radii), [1.0, 1.0])
    # No unit joint velocity gets out of it, and it is reached.
    circle = np.array(
        [
            np.cos(a) * np.eye(len(q))[0] + np.sin(a) * np.eye(len(q))[1]
            for a in np.linspace(0, 2 * np.pi, 200)
        ]
    )
    inside = (velocity.axes.T @ J @ circle.T) / velocity.radii[:, None]
    assert np.all(np.linalg.norm(inside, axis=0) <= 1.0 + 1e-9)
straight = velocity_ellipsoid(jacobian([0.5, 0.0], two))
assert straight.radii[1] < 1e-12
along_arm = np.array([np.cos(0.5), np.sin(0.5)])
assert abs(straight.axes[:, 0] @ along_arm) < 1e-9

# %%
figure, panels = plt.subplots(1, 3, figsize=(13, 4.4))
postures = (
    ("two links", two, [[1.9, -2.2], [1.3, -1.3], [0.9, -0.5], [0.3, 0.0]]),
    ("three links", three, [[2.2, -1.6, -1.2], [1.5, -1.0, -0.7], [0.6, -0.2, -0.1]]),
)
for axes, (title, lengths, configurations) in zip(panels, postures, strict=False):
    for k, q in enumerate(configurations):
        color = f"C{k}"
        chain, shape = points(q, lengths), velocity_ellipsoid(jacobian(q, lengths))
        axes.plot(*chain.T, "o-", color=color, markersize=4)
        plot_ellipse(axes, chain[-1], shape.axes, shape.radii, scale=0.25, color=color)
    axes.set(aspect="equal", title=f"{title}: velocities", xlabel="x (m)", ylabel="y (m)")
    axes.autoscale_view()
q = [1.3, -1.3]
chain, J = points(q, two), jacobian(q, two)
panels[2].plot(*chain.T, "o-", color="0.4", markersize=4)
for shape, color, label in (
    (velocity_ellipsoid(J), "tab:orange", "velocity"),
    (force_ellipsoid(J), "tab:green", "force"),
):
    plot_ellipse(
        panels[2], chain[-1], shape.axes, shape.radii, scale=0.25, color=color, label=label
    )
panels[2].set(aspect="equal", title="velocities and forces", xlabel="x (m)")
panels[2].autoscale_view()
panels[2].legend()
save_figure(figure, "ellipses")
