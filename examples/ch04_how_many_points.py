# %% [markdown]
# # How many points does a pose need?
#
# Each known correspondence in the plane gives two equations, $p^{s_i} = p + R\,p^{m_i}$, and a pose
# of the plane has three unknowns; in space each gives three equations, and a pose has six unknowns.
# Counting says two points are enough in either case. Counting is not enough. (Exercise 4.1.)

# %%
import matplotlib.pyplot as plt
import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw

from prehensile.perception.registration.known import fit_rigid
from prehensile.perception.registration.result import RegistrationStatus
from prehensile.viz.figures import save_figure

rng = np.random.default_rng(4)

# %% [markdown]
# ## (a) In the plane: two distinct points
#
# One point leaves all turns about it free. Two distinct points fix the direction from one to the
# other, and thus the rotation; then either fixes the translation. Of the four equations three are
# independent: the fourth only says that the points are as far apart in the scene as in the model.

# %%
theta, p_WO = 0.7, np.array([0.4, -0.2])
R_WO = np.array([[np.cos(theta), -np.sin(theta)], [np.sin(theta), np.cos(theta)]])
model = rng.normal(size=(2, 2))
scene = model @ R_WO.T + p_WO

assert fit_rigid(model[:1], scene[:1]).status is RegistrationStatus.DEGENERATE
two = fit_rigid(model, scene)
assert two.succeeded
assert np.allclose(two.R_WO, R_WO)
assert np.allclose(two.p_WO, p_WO)
same = fit_rigid(model[[0, 0]], scene[[0, 0]])  # Twice the same point is one point.
assert same.status is RegistrationStatus.DEGENERATE

# %% [markdown]
# ## (b) In space: three points that are not on a line
#
# Two points in space leave the turn about the line through them free: of their six equations one is
# the distance again, so five are left for six unknowns. A third point off the line stops the turn.
# Three points on a line are no better than two.

# %%
X_WO = RigidTransform(RollPitchYaw(0.3, -0.5, 1.1), [0.1, 0.2, 0.3])
model = rng.normal(size=(3, 3))
scene = X_WO.multiply(model.T).T
two = fit_rigid(model[:2], scene[:2])
assert two.status is RegistrationStatus.DEGENERATE

free = two.result().free_directions
assert free is not None
assert free.shape == (1, 6)
axis = scene[1] - scene[0]
axis /= np.linalg.norm(axis)
turn = free[0, :3] / np.linalg.norm(free[0, :3])
assert np.isclose(abs(turn @ axis), 1)  # The free motion is the turn about the line.

three = fit_rigid(model, scene)
assert three.succeeded
assert np.allclose(three.R_WO, X_WO.rotation().matrix())
on_a_line = np.outer([0.0, 1.0, 2.5], rng.normal(size=3))
assert fit_rigid(on_a_line, X_WO.multiply(on_a_line.T).T).status is RegistrationStatus.DEGENERATE

# %% [markdown]
# Why three are enough: the differences $u = p^{m_1} - p^{m_0}$ and $v = p^{m_2} - p^{m_0}$ are not
# parallel, so $u$, $v$, $u \times v$ are a basis. A rotation maps the third to the cross product of
# the images of the first two, so the images of two vectors fix it.
#
# Mirrored points are a trap: three points in space lie in a plane, and a reflection in that plane
# leaves them where they are. Only the demand $\det R = +1$ tells a rotation from the reflection.

# %%
mirrored = model * [1, 1, -1]
answer = fit_rigid(model, mirrored)
assert np.isclose(np.linalg.det(answer.R_WO), 1)

# %% [markdown]
# ## More points, less error
#
# With noise, further points average it out: the error of the pose falls with the square root of
# their number, here over 200 random poses each.

# %%
counts = np.array([3, 5, 10, 30, 100, 300])
errors = []
for count in counts:
    squares = []
    for _ in range(200):
        model = rng.uniform(-0.1, 0.1, (count, 3))
        X = RigidTransform(RollPitchYaw(rng.uniform(-3, 3, 3)), rng.normal(size=3))
        noisy = X.multiply(model.T).T + rng.normal(0, 0.002, (count, 3))
        R_error = fit_rigid(model, noisy).R_WO @ X.rotation().matrix().T
        squares.append(np.arccos(np.clip((np.trace(R_error) - 1) / 2, -1, 1)) ** 2)
    errors.append(np.sqrt(np.median(squares)))
slope = np.polyfit(np.log(counts[2:]), np.log(errors[2:]), 1)[0]
assert -0.6 < slope < -0.4

fig, axes = plt.subplots(1, 2, figsize=(10, 4))
ax = axes[0]
points = np.array([[0.0, 0.0], [1.0, 0.2]])
for angle in np.linspace(0, 2 * np.pi, 9)[:-1]:
    c, s = np.cos(angle), np.sin(angle)
    ax.plot(*(points @ np.array([[c, -s], [s, c]]).T).T, "o-", color="0.8")
ax.plot(*points.T, "o-", color="tab:red")
ax.set(aspect="equal", title="one point in the plane leaves every turn free")
ax = axes[1]
ax.loglog(counts, np.degrees(errors), "o-")
ax.loglog(counts, np.degrees(errors[-1]) * np.sqrt(counts[-1] / counts), "--", color="0.5")
ax.set(
    xlabel="points",
    ylabel="median error of the rotation [deg]",
    title="2 mm of noise on an object of 20 cm",
)
fig.tight_layout()
save_figure(fig, "how_many_points")
