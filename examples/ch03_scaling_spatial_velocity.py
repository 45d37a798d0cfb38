# %% [markdown]
# # Scaling a spatial velocity
#
# Direction-preserving differential inverse kinematics multiplies a commanded spatial velocity by a
# number between 0 and 1. Is that reasonable, when half of the vector is in rad/s and the other half
# in m/s? It is: a body that moves with the constant spatial velocity $\alpha V$ passes the same
# poses as one that moves with $V$, later. (Exercise 3.4.)

# %%
import matplotlib.pyplot as plt
import numpy as np
from scipy.linalg import expm

from prehensile.viz.figures import save_figure


def twist_matrix(V):
    """The 4x4 matrix of a spatial velocity [w; v] in space coordinates."""
    w, v = V[:3], V[3:]
    return np.array(
        [[0, -w[2], w[1], v[0]], [w[2], 0, -w[0], v[1]], [-w[1], w[0], 0, v[2]], [0, 0, 0, 0]]
    )


def pose(V, t):
    """X_WB after moving for t with the constant twist V of the body, expressed in the body."""
    return expm(twist_matrix(V) * t)


# %% [markdown]
# ## Constant in the body frame: a screw
#
# The path is a screw motion, $X(t) = e^{\hat V t}$, and $e^{(\alpha \hat V) t} = e^{\hat V
# (\alpha t)}$.

# %%
rng = np.random.default_rng(0)
for _ in range(50):
    V, alpha, t = rng.normal(size=6), rng.uniform(), rng.uniform(0.0, 3.0)
    np.testing.assert_allclose(pose(alpha * V, t), pose(V, alpha * t), atol=1e-12)

# %% [markdown]
# ## Varying: the path is kept, if all of it is scaled
#
# With $V$ changing along the path, scaling by a different $\alpha(t)$ at each instant is still only
# another timing. Scaling the rotation alone is not: then the body leaves the path.


# %%
def follow(scale, duration, steps=4000):
    """Origins of a body whose scaled velocity is a function of the progress along its path."""
    X, progress, h = np.eye(4), 0.0, duration / steps
    origins = [X[:3, 3].copy()]
    while progress < 1.0:
        V = np.array([0.0, 0.0, 2.0 + 3.0 * progress, 1.0, 0.3 * progress, 0.2])
        rotation, translation = scale(progress)
        step = min(h, (1.0 - progress) / translation)
        X = X @ pose(np.concatenate([rotation * V[:3], translation * V[3:]]), step)
        progress += translation * step
        origins.append(X[:3, 3].copy())
    return np.array(origins)


whole = follow(lambda s: (1.0, 1.0), 1.0)
slowed = follow(lambda s: (0.2 + 0.6 * s, 0.2 + 0.6 * s), 2.0)
turned_less = follow(lambda s: (0.5, 1.0), 1.0)


def distance_to_path(points, path):
    return max(float(np.min(np.linalg.norm(path - point, axis=1))) for point in points[::40])


assert distance_to_path(slowed, whole) < 1e-3
np.testing.assert_allclose(slowed[-1], whole[-1], atol=2e-3)
assert distance_to_path(turned_less, whole) > 0.1

# %%
figure = plt.figure(figsize=(6, 5))
axes = figure.add_subplot(projection="3d")
axes.plot(*whole.T, color="0.7", linewidth=6, label="V")
axes.plot(*slowed.T, color="tab:blue", label="α V, another α at each instant")
axes.plot(*turned_less.T, color="tab:red", label="only the rotation halved")
axes.set(xlabel="x (m)", ylabel="y (m)", zlabel="z (m)")
axes.legend(loc="upper left")
save_figure(figure, "scaled_velocities")
