# %% [markdown]
# # The spatial velocity of a moving frame
#
# An arm with one joint: frame A is its base, frame B is on its end. At angle zero all axes of A
# and B agree and the arm lies along y: the joint is at $p_0 = (0, l_0, 0)$ in A, and B is ahead
# of it by $l_1$ along y and $l_2$ along z of the link, which turns about z. (Exercise 3.12; the
# dimensions are chosen here.)

# %%
import matplotlib.pyplot as plt
import numpy as np
from pydrake.math import RigidTransform, RotationMatrix

from prehensile.viz.figures import save_figure

l_0, l_1, l_2 = 0.4, 0.7, 0.2

# %% [markdown]
# ## (a) The pose, and a point fixed in B
#
# $$R^{AB} = R_z(\theta), \qquad p^{AB} = p_0 + R_z(\theta) (0, l_1, l_2)^T$$


# %%
def pose(theta):
    """X_AB at joint angle theta."""
    R_AB = RotationMatrix.MakeZRotation(theta)
    return RigidTransform(R_AB, np.array([0.0, l_0, 0.0]) + R_AB @ np.array([0.0, l_1, l_2]))


p_BC = np.array([1.0, 0.0, 0.0])
p_AC = pose(0.0) @ p_BC
np.testing.assert_allclose(p_AC, [1.0, l_0 + l_1, l_2])

# %% [markdown]
# ## (b) $\dot R R^{-1}$ is skew symmetric
#
# From $R R^T = I$ follows $\dot R R^T + R \dot R^T = 0$, so $\hat\omega = \dot R R^T$ is the
# negative of its transpose. Here it is $\dot\theta$ times the cross product with z.

# %%
theta, theta_dot = 0.6, 1.7
c, s = np.cos(theta), np.sin(theta)
R_dot = theta_dot * np.array([[-s, -c, 0.0], [c, -s, 0.0], [0.0, 0.0, 0.0]])
omega_hat = R_dot @ pose(theta).rotation().matrix().T
np.testing.assert_allclose(omega_hat, -omega_hat.T, atol=1e-15)
omega = np.array([omega_hat[2, 1], omega_hat[0, 2], omega_hat[1, 0]])
np.testing.assert_allclose(omega, [0.0, 0.0, theta_dot], atol=1e-15)

# %% [markdown]
# ## (c) The spatial velocity
#
# $$V^{AB} = \begin{bmatrix} 0 & 0 & \dot\theta & -l_1 \dot\theta \cos\theta &
# -l_1 \dot\theta \sin\theta & 0 \end{bmatrix}^T$$
#
# $l_0$ and $l_2$ do not occur: neither moves B when the joint turns.

# %%
V_AB = np.array([0.0, 0.0, theta_dot, -l_1 * theta_dot * c, -l_1 * theta_dot * s, 0.0])
h = 1e-6
p_dot = (pose(theta + h).translation() - pose(theta - h).translation()) / (2.0 * h) * theta_dot
np.testing.assert_allclose(V_AB[3:], p_dot, atol=1e-9)
np.testing.assert_allclose(V_AB[:3], omega, atol=1e-15)

# %%
figure, axes = plt.subplots(figsize=(5.4, 5))
for angle in np.linspace(0.0, 1.8, 7):
    B = pose(angle).translation()
    fade = 0.25 + 0.75 * angle / 1.8
    axes.plot([0.0, 0.0, B[0]], [0.0, l_0, B[1]], "o-", color="0.4", alpha=fade)
    velocity = l_1 * np.array([-np.cos(angle), -np.sin(angle)])
    axes.quiver(*B[:2], *velocity, angles="xy", scale_units="xy", scale=4, color="tab:red")
axes.set(aspect="equal", xlabel="x of A (m)", ylabel="y of A (m)", title="velocity of B in A")
save_figure(figure, "velocity_of_the_end")
