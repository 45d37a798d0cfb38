# %% [markdown]
# # Through a singularity at constant speed
#
# A planar arm of two links, each 1 m long, is stretched out along x when both joints are zero.
# There its Jacobian loses rank: no joint velocity moves the hand along x. The arm can pass the
# place all the same, and with constant joint velocities.

# %%
import matplotlib.pyplot as plt
import numpy as np

from prehensile.viz.figures import save_figure


def forward(q):
    """p_WG of the hand, (..., 2), at joint angles q (..., 2)."""
    first, both = q[..., 0], q[..., 0] + q[..., 1]
    return np.stack([np.cos(first) + np.cos(both), np.sin(first) + np.sin(both)], axis=-1)


def jacobian(q):
    """Translational Jacobian of the hand in W, (2, 2)."""
    first, both = q[0], q[0] + q[1]
    return np.array(
        [
            [-np.sin(first) - np.sin(both), -np.sin(both)],
            [np.cos(first) + np.cos(both), np.cos(both)],
        ]
    )


# %% [markdown]
# Take $q_0(t) = 1 - t$ and $q_1(t) = 2t - 2$. At $t = 1$ the arm is straight.

# %%
t = np.linspace(0.0, 2.0, 201)
q = np.stack([1.0 - t, 2.0 * t - 2.0], axis=-1)
v = np.array([-1.0, 2.0])
p = forward(q)
assert np.allclose(p[:, 1], 0.0)  # The hand stays on the x axis,
assert np.allclose(p[:, 0], 2.0 * np.cos(1.0 - t))  # goes out to 2 m and comes back.

# %% [markdown]
# The smallest singular value of the Jacobian falls to zero on the way, and the velocity of the hand
# with it. Its acceleration does not: what turns the hand around is the term $\dot J v$.

# %%
sigma = np.array([np.linalg.svd(jacobian(one), compute_uv=False) for one in q])
velocity = np.array([jacobian(one) @ v for one in q])
acceleration = np.gradient(velocity[:, 0], t)
middle = len(t) // 2
assert sigma[middle, 1] < 1e-12
assert abs(velocity[middle, 0]) < 1e-12
assert np.isclose(acceleration[middle], -2.0, atol=1e-3)

figure, (left, right) = plt.subplots(1, 2, figsize=(10, 3.8))
for k in range(0, len(t), 25):
    elbow = np.array([np.cos(q[k, 0]), np.sin(q[k, 0])])
    chain = np.array([[0.0, 0.0], elbow, p[k]])
    left.plot(*chain.T, "o-", color=plt.get_cmap("viridis")(t[k] / 2.0), markersize=4)
left.set(title="the arm, dark to bright", xlabel="x (m)", ylabel="y (m)", aspect="equal")
right.plot(t, p[:, 0], label="position (m)")
right.plot(t, velocity[:, 0], label="velocity (m/s)")
right.plot(t, acceleration, label="acceleration (m/s²)")
right.plot(t, sigma[:, 1], "--", label="smallest singular value (m)")
right.set(title="the hand along x", xlabel="t (s)")
right.legend()
save_figure(figure, "through_the_singularity")
