# %% [markdown]
# # Why one set of gains does for a geared arm
#
# A motor behind a gearbox of ratio $N$ turns $N$ times as fast as its joint. Seen from the joint,
# its rotor's inertia counts $N^2$ times. For common gearboxes that is as much as the link or
# more, so what the joint feels hardly depends on the posture or the load, and gains chosen once
# do everywhere. (Exercise 2.1.)

# %%
import matplotlib.pyplot as plt
import numpy as np

from prehensile.control.gains import JointGains
from prehensile.control.inertia import joint_inertia, random_configurations
from prehensile.control.pendulum import (
    GearedPendulum,
    pendulum_dynamics,
    position_control,
    simulate_pendulum,
)
from prehensile.station import load_scenario
from prehensile.station.robot_plant import make_robot_plant
from prehensile.viz.figures import save_figure

# %% [markdown]
# ## (a) The dynamics
#
# A pendulum of mass $m$ and length $l$, its motor's torque $u$, with $q_m = N q$ and $\tau = N u$:
#
# $$(m l^2 + N^2 I_m) \ddot q + b \dot q + m g l \sin q = N u$$
#
# As first-order dynamics of $x = (q, \dot q)$:


# %%
def dynamics(x, u, p):
    q, v = x
    torque = p.gear_ratio * u - p.mass * p.gravity * p.length * np.sin(q) - p.damping * v
    return np.array([v, torque / (p.mass * p.length**2 + p.gear_ratio**2 * p.rotor_inertia)])


direct = GearedPendulum(gear_ratio=1.0)
geared = GearedPendulum(gear_ratio=160.0)
rng = np.random.default_rng(0)
for p in (direct, geared):
    for q, v, u in rng.normal(size=(20, 3)):
        np.testing.assert_allclose(dynamics((q, v), u, p), pendulum_dynamics(p, [q, v], u))
print(f"link {geared.link_inertia:.3f}, reflected {geared.reflected_inertia:.3f} kg m²")
assert geared.reflected_inertia > 10.0 * geared.link_inertia

# %% [markdown]
# ## (b) The same control law on both
#
# Gains that are right for each are found from the inertia that its joint feels. Then the load is
# made four times as heavy, and the gains are left.

# %%
figure, panels = plt.subplots(1, 2, figsize=(10, 3.6), sharey=True)
overshoot = {}
for axes, name, p in zip(panels, ("direct drive", "gear ratio 160"), (direct, geared), strict=True):
    gains: JointGains = position_control(p, bandwidth=12.0)
    for factor in (1.0, 4.0):
        loaded = GearedPendulum(mass=factor * p.mass, gear_ratio=p.gear_ratio)
        motion = simulate_pendulum(loaded, gains, 1.0, duration=2.0)
        overshoot[name, factor] = motion.q.max() - motion.q[-1]
        axes.plot(motion.t, motion.q, label=f"{factor * p.mass:g} kg")
    axes.axhline(1.0, color="0.6", linestyle=":")
    axes.set(xlabel="t (s)", title=name)
    axes.legend()
panels[0].set(ylabel="q (rad)")
save_figure(figure, "same_gains_heavier_load")

# %% [markdown]
# The geared joint hardly notices. The direct drive sags under the load, and swings.

# %%
assert overshoot["gear ratio 160", 4.0] < 0.03
assert overshoot["direct drive", 4.0] > 0.05

# %% [markdown]
# ## On an arm
#
# The same for the iiwa: the diagonal of the mass matrix at many configurations, of links alone and
# with the rotors. What matters for gains is how far it is from constant.

# %%
plant = make_robot_plant(load_scenario("iiwa_wsg"), ["iiwa"], frozen_children=True)
configurations = random_configurations(plant, 500, seed=0)
inertia = joint_inertia(plant, configurations)
# The sum is what Drake takes for the arm's mass matrix.
context = plant.CreateDefaultContext()
plant.SetPositions(context, configurations[7])
np.testing.assert_allclose(inertia.total[7], np.diag(plant.CalcMassMatrix(context)))

figure, axes = plt.subplots(figsize=(8, 3.8))
joints = np.arange(7)
for values, offset, color, label in (
    (inertia.link, -0.17, "tab:blue", "links alone"),
    (inertia.total, 0.17, "tab:orange", "with the rotors"),
):
    low, high = values.min(axis=0), values.max(axis=0)
    axes.bar(joints + offset, high - low, 0.3, bottom=low, color=color, label=label)
axes.plot(joints, inertia.reflected, "k_", markersize=22, label="reflected inertia")
axes.set(yscale="log", ylabel="kg m²", title="inertia at the joints of an iiwa with its hand")
axes.set_xticks(joints, [f"joint {k + 1}" for k in joints])
axes.legend(fontsize="small")
save_figure(figure, "inertia_at_the_joints")

# %% [markdown]
# From the worst posture to the best one the links' inertia changes many times over at most joints,
# and the sum much less.

# %%
for name, links, total in zip(inertia.names, inertia.link_ratio, inertia.total_ratio, strict=True):
    print(f"{name}: links {links:6.1f}, with rotors {total:5.2f}")
assert np.all(inertia.total_ratio <= inertia.link_ratio)
assert np.median(inertia.total_ratio) < 0.5 * np.median(inertia.link_ratio)
