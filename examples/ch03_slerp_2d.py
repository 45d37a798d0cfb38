# %% [markdown]
# # Interpolating rotations in the plane
#
# A vector $(x, y)$ is the complex number $z = x + iy$, and multiplying by $e^{i\theta}$ turns it by
# $\theta$. Between two orientations one can interpolate the number, or its angle; only one of the
# two is a rotation all the way. (Exercise 3.3.)

# %%
import matplotlib.pyplot as plt
import numpy as np

from prehensile.viz.figures import save_figure

# %% [markdown]
# ## (a) A complex number turns a vector
#
# The vector $(1, 1)$ has length $\sqrt 2$ and lies at 45°. Turned by another 45° it points along y.

# %%
z = (1.0 + 1.0j) * np.exp(1j * np.pi / 4)
assert np.isclose(z, np.sqrt(2.0) * 1j)


def rotation(angle):
    """R(angle) of the plane, (2, 2)."""
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


# The same as the rotation matrix, for any vector and angle.
rng = np.random.default_rng(0)
for x, y, angle in rng.uniform(-3.0, 3.0, (100, 3)):
    turned = (x + 1j * y) * np.exp(1j * angle)
    assert np.allclose(rotation(angle) @ [x, y], [turned.real, turned.imag])

# %% [markdown]
# ## (b) First attempt: a straight line between the numbers
#
# Half way between $e^{i\theta_F}$ and $e^{i\theta_G}$ the straight line is inside the unit circle:
# what is multiplied by it shrinks, by $\cos\frac{\theta_G - \theta_F}{2}$.

# %%
theta_F, theta_G = np.radians(10.0), np.radians(150.0)
t = np.linspace(0.0, 1.0, 101)
line = (1.0 - t) * np.exp(1j * theta_F) + t * np.exp(1j * theta_G)
assert np.isclose(abs(line[50]), np.cos(0.5 * (theta_G - theta_F)))
assert np.isclose(abs((1 + 1j) * line[50]), np.sqrt(2) * np.cos(0.5 * (theta_G - theta_F)))

# %% [markdown]
# ## (c) Second attempt: a straight line between the angles
#
# $e^{i(\theta_F (1 - t) + \theta_G t)}$ is a rotation at every $t$, and it turns at a constant
# rate. The quaternion slerp does the same in three dimensions.

# %%
slerp = np.exp(1j * (theta_F * (1.0 - t) + theta_G * t))
assert np.allclose(abs(slerp), 1.0)
assert np.allclose(np.diff(np.angle(slerp)), (theta_G - theta_F) / 100.0)

figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4.2))
circle = np.exp(1j * np.linspace(0.0, 2.0 * np.pi, 200))
left.plot(circle.real, circle.imag, color="0.85")
for name, path, color in (("line", line, "tab:red"), ("slerp", slerp, "tab:blue")):
    left.plot(path.real, path.imag, color=color, label=name)
    for k in range(0, 101, 20):
        left.annotate(
            "",
            (path[k].real, path[k].imag),
            (0.0, 0.0),
            arrowprops={"arrowstyle": "->", "color": color, "alpha": 0.6},
        )
    right.plot(t, np.degrees(np.angle(path)), color=color, label=f"angle of the {name} (°)")
left.set(aspect="equal", title="where (1, 0) goes")
left.legend()
right.set(xlabel="t", title="the line turns unevenly as well")
right.legend()
save_figure(figure, "slerp_in_the_plane")
