# %% [markdown]
# # The pseudo-inverse as a controller
#
# $v = [J^G(q)]^+ V^{G_d}$ turns a desired spatial velocity of the gripper into joint velocities,
# and an integrator turns these into positions that a station takes. It is simple, and good until
# a singularity is near or a joint should go faster than it can. It also has no memory of where it
# came from: a closed path of the hand need not close for the joints. (Example 3.7.)

# %%
import matplotlib.pyplot as plt
import numpy as np

from prehensile.kinematics.differential_ik import pseudo_inverse
from prehensile.kinematics.jacobians import singular_values
from prehensile.kinematics.tree import tree_from_plant
from prehensile.station import build, load_scenario
from prehensile.viz.figures import save_figure

station = build(load_scenario("iiwa_wsg"))
plant = station.GetSubsystemByName("plant")
arm = plant.GetModelInstanceByName("iiwa")
G = plant.GetFrameByName("body", plant.GetModelInstanceByName("wsg"))
joints = [plant.GetJointByName(f"iiwa_joint_{k + 1}", arm) for k in range(7)]
compiled = tree_from_plant(plant, [G], joints=joints)
tree = compiled.tree
q_start = plant.GetPositions(plant.CreateDefaultContext(), arm)


def follow(V_WG, seconds, h=0.005):
    """Integrates the pseudo-inverse; returns joint positions and velocities at each step."""
    q, positions, velocities = q_start.copy(), [], []
    for k in range(round(seconds / h)):
        v = pseudo_inverse(tree.jacobian(q, 0), V_WG(k * h))
        positions.append(q)
        velocities.append(v)
        q = q + h * v
    return np.array(positions), np.array(velocities)


# %% [markdown]
# ## Where it works
#
# 10 cm/s to the left for two seconds: the gripper moves 20 cm and does not turn.

# %%
left_V = np.array([0.0, 0.0, 0.0, 0.0, 0.1, 0.0])
Q, v = follow(lambda t: left_V, 2.0)
X_start, X_end = tree.pose(Q[0], 0), tree.pose(Q[-1] + 0.005 * v[-1], 0)
np.testing.assert_allclose(X_end[:3, 3] - X_start[:3, 3], [0.0, 0.2, 0.0], atol=2e-3)
np.testing.assert_allclose(X_end[:3, :3], X_start[:3, :3], atol=2e-3)
assert np.all(np.abs(v) < compiled.velocity)

# %% [markdown]
# ## Where it does not
#
# The same outwards. Near the end of the arm's reach the smallest singular value goes to zero and
# the joint velocities beyond what any joint can do.

# %%
out = np.array([0.0, 0.0, 0.0, 0.2, 0.0, 0.0])
Q_out, v_out = follow(lambda t: out, 2.6)
sigma = singular_values(tree.jacobians(Q_out, 0))[:, -1]
share = np.max(np.abs(v_out) / compiled.velocity, axis=1)
assert share[0] < 1.0 < share.max()
assert sigma.min() < 0.2 * sigma[0]

t = 0.005 * np.arange(len(Q_out))
figure, (upper, lower) = plt.subplots(2, 1, figsize=(7, 5.2), sharex=True)
upper.semilogy(t, sigma)
upper.set(ylabel="smallest singular value", title="reaching out too far")
lower.semilogy(t, share)
lower.axhline(1.0, color="tab:red", linestyle=":")
lower.set(xlabel="t (s)", ylabel="greatest velocity / limit")
save_figure(figure, "reaching_too_far")

# %% [markdown]
# ## A closed path that does not close
#
# The gripper goes round a circle without turning, ten times. It comes back each time; the joints do
# not: the pseudo-inverse of a redundant arm is not the derivative of any function of the pose.

# %%
period, radius, turns = 2.0, 0.1, 10


def circle(t):
    angle = 2.0 * np.pi * t / period
    speed = 2.0 * np.pi * radius / period
    return np.array([0.0, 0.0, 0.0, 0.0, -speed * np.sin(angle), speed * np.cos(angle)])


h = 0.0025
Q_round, _ = follow(circle, turns * period + h, h)
each = round(period / h)
rounds = Q_round[::each]
back = [np.linalg.norm(tree.pose(q, 0)[:3, 3] - X_start[:3, 3]) for q in rounds]
drift = np.linalg.norm(rounds - q_start, axis=1)
print("hand, mm:", np.round(1e3 * np.array(back), 2), "joints, °:", np.round(np.degrees(drift), 1))
assert max(back) < 0.01
assert drift[-1] > np.radians(3.0)

# %% [markdown]
# It is not the step size either: half of it gives the same drift.

# %%
Q_fine, _ = follow(circle, turns * period + h / 2, h / 2)
np.testing.assert_allclose(Q_fine[:: 2 * each][-1] - q_start, rounds[-1] - q_start, atol=0.02)

figure, (left, right) = plt.subplots(1, 2, figsize=(10, 3.8))
p_WG = tree.poses(Q_round, 0)[:, :3, 3]
left.plot(p_WG[:, 1], p_WG[:, 2])
left.set(aspect="equal", xlabel="y (m)", ylabel="z (m)", title="the gripper, ten times round")
right.plot(np.degrees(Q_round[:, 0]), np.degrees(Q_round[:, 2]))
right.set(xlabel="joint 1 (°)", ylabel="joint 3 (°)", title="two of the joints meanwhile")
save_figure(figure, "ten_times_round")
