# %% [markdown]
# # Angular velocities add, rotations do not
#
# Frame B turns in A, and C turns in B. The rotations multiply, in an order that matters. The
# angular velocities add, once they are expressed in one frame:
#
# $$\omega^{AC}_A = \omega^{AB}_A + R^{AB} \omega^{BC}_B$$
#
# (Exercise 3.2.)

# %%
import matplotlib.pyplot as plt
import numpy as np
from pydrake.math import RotationMatrix
from scipy.spatial.transform import Rotation

from prehensile.viz.figures import save_figure

rng = np.random.default_rng(0)


def turning(R_0, w, t):
    """A frame that starts at R_0 and turns with the constant angular velocity w, both in A."""
    return Rotation.from_rotvec(w * t).as_matrix() @ R_0


def angular_velocity(R, t, h=1e-6):
    """The vector of R_dot R^T, by differences."""
    skew = (R(t + h) - R(t - h)) / (2.0 * h) @ R(t).T
    return np.array([skew[2, 1], skew[0, 2], skew[1, 0]])


# %% [markdown]
# ## Random frames

# %%
for _ in range(20):
    R_AB0, R_BC0 = Rotation.random(2, random_state=rng).as_matrix()
    w_AB_A, w_BC_B = rng.normal(size=(2, 3))
    t = rng.uniform(0.0, 2.0)
    R_AB = turning(R_AB0, w_AB_A, t)
    w_AC_A = angular_velocity(
        lambda s: turning(R_AB0, w_AB_A, s) @ turning(R_BC0, w_BC_B, s),  # noqa: B023
        t,
    )
    np.testing.assert_allclose(w_AC_A, w_AB_A + R_AB @ w_BC_B, atol=1e-7)

# %% [markdown]
# ## Finite rotations depend on their order
#
# A quarter turn about x and one about z end differently if they are exchanged. The smaller the
# angle, the less it matters: what is left is of second order, $\theta^2$ for the angle $\theta$.

# %%
angles = np.geomspace(1e-3, 0.5 * np.pi, 40)
gap = []
for angle in angles:
    x, z = RotationMatrix.MakeXRotation(angle), RotationMatrix.MakeZRotation(angle)
    between = (x @ z).inverse() @ (z @ x)
    gap.append(between.ToAngleAxis().angle())
gap = np.array(gap)
assert gap[-1] > np.radians(100.0)
np.testing.assert_allclose(gap[angles < 0.05] / angles[angles < 0.05] ** 2, 1.0, atol=0.01)

# %%
figure, axes = plt.subplots(figsize=(6, 4))
axes.loglog(np.degrees(angles), np.degrees(gap), label="angle between xz and zx")
axes.loglog(np.degrees(angles), np.degrees(angles**2), "k:", label="second order")
axes.set(xlabel="angle of each rotation (°)", ylabel="°", title="exchanging two rotations")
axes.legend()
save_figure(figure, "exchanging_two_rotations")
