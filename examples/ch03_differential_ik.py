# %% [markdown]
# # Differential inverse kinematics: the family
#
# One command, many ways to answer it. The gripper is told to move outwards at 30 cm/s, farther than
# the arm is long. What each formulation makes of that says what it is for. All but the first keep
# the limits of position, velocity and acceleration of every joint. (Sections 3.10.1 to 3.10.5 and
# example 3.15.)

# %%
import matplotlib.pyplot as plt
import numpy as np

from prehensile.kinematics.differential_ik import (
    JointLimits,
    centered,
    direction_preserving,
    limited,
    prioritized,
    pseudo_inverse,
)
from prehensile.kinematics.tree import tree_from_plant
from prehensile.station import build, load_scenario
from prehensile.viz.figures import save_figure

station = build(load_scenario("iiwa_wsg"))
plant = station.GetSubsystemByName("plant")
arm = plant.GetModelInstanceByName("iiwa")
G = plant.GetFrameByName("body", plant.GetModelInstanceByName("wsg"))
joints = [plant.GetJointByName(f"iiwa_joint_{k + 1}", arm) for k in range(7)]
compiled = tree_from_plant(plant, [G], joints=joints)
tree, limits = compiled.tree, JointLimits.of_tree(compiled)
q_start = plant.GetPositions(plant.CreateDefaultContext(), arm)
h, seconds = 0.002, 2.0
V_WG = np.array([0.0, 0.0, 0.0, 0.3, 0.1, 0.0])

# %% [markdown]
# ## Five ways
#
# - The pseudo-inverse does not know of limits.
# - The limited least squares comes as near as it can, and slides along what stops it.
# - With joint centering the freedom that is left goes to a posture.
# - The direction-preserving one slows down rather than leave the direction, down to nothing at the
#   end of the reach. There its joints, which cannot stop at once, take it a little beyond the
#   singularity, and it comes back and tries again.
# - With strict priorities the orientation comes first: it is kept, and the position gets
#   what is left.

# %%
formulations = {
    "pseudo-inverse": lambda J, q, v: pseudo_inverse(J, V_WG),
    "limited": lambda J, q, v: limited(J, V_WG, q, v, limits, period=h).v,
    "centered": lambda J, q, v: (
        centered(J, V_WG, q, v, limits, period=h, nominal_position=q_start).v
    ),
    "direction": lambda J, q, v: (
        direction_preserving(J, V_WG, q, v, limits, period=h, nominal_position=q_start).v
    ),
    "orientation first": lambda J, q, v: (
        prioritized([(J[:3], V_WG[:3]), (J[3:], V_WG[3:])], q, v, limits, period=h).v
    ),
}


def run(step):
    """Joint positions and velocities of the whole motion."""
    q, v, positions, velocities = q_start.copy(), np.zeros(7), [], []
    for _ in range(round(seconds / h)):
        v = step(tree.jacobian(q, 0), q, v)
        q = q + h * v
        positions.append(q)
        velocities.append(v)
    return np.array(positions), np.array(velocities)


motions = {name: run(step) for name, step in formulations.items()}

# %% [markdown]
# ## What they keep, and what they give up


# %%
def breaks_limits(Q, v):
    a = np.diff(np.vstack([np.zeros(7), v]), axis=0) / h
    inside = np.all((limits.lower - 1e-9 <= Q) & (limits.upper + 1e-9 >= Q))  # fmt: skip
    slow = np.all(np.abs(v) <= limits.velocity + 1e-9)
    smooth = np.all(np.abs(a) <= limits.acceleration + 1e-6)
    return not (inside and slow and smooth)


X_start = tree.pose(q_start, 0)
aside, turned = {}, {}
d = V_WG[3:] / np.linalg.norm(V_WG[3:])
for name, (Q, v) in motions.items():
    assert breaks_limits(Q, v) == (name == "pseudo-inverse")
    X = tree.poses(Q, 0)
    moved = X[:, :3, 3] - X_start[:3, 3]
    aside[name] = np.linalg.norm(moved - np.outer(moved @ d, d), axis=1)
    cosine = 0.5 * (np.einsum("ij,kij->k", X_start[:3, :3], X[:, :3, :3]) - 1.0)
    turned[name] = np.arccos(np.clip(cosine, -1.0, 1.0))
    print(f"{name:18s} aside {1e3 * aside[name].max():6.1f} mm, turned "
          f"{np.degrees(turned[name].max()):6.2f}°")  # fmt: skip
assert aside["direction"].max() < 0.1 * aside["limited"].max()
outwards = (tree.poses(motions["direction"][0], 0)[:, :3, 3] - X_start[:3, 3]) @ d
assert np.ptp(outwards[-300:]) < 0.03  # It gets no farther.
assert turned["orientation first"].max() < np.radians(0.1)
assert turned["limited"].max() > np.radians(2.0)

# %%
figure, panels = plt.subplots(1, 3, figsize=(13.5, 4))
t = h * np.arange(1, round(seconds / h) + 1)
for k, (name, (Q, v)) in enumerate(motions.items()):
    p = tree.poses(Q, 0)[:, :3, 3]
    style = {"color": f"C{k}", "label": name}
    panels[0].plot(t, (p - X_start[:3, 3]) @ d, **style)
    panels[1].plot(t, np.degrees(turned[name]), **style)
    panels[2].semilogy(t, np.max(np.abs(v) / limits.velocity, axis=1), **style)
panels[0].set(xlabel="t (s)", ylabel="m", title="how far outwards", ylim=(0.0, 0.5))
panels[1].set(xlabel="t (s)", ylabel="°", title="how far it turned", ylim=(-1.0, 60.0))
panels[2].set(xlabel="t (s)", title="greatest velocity / limit", ylim=(1e-3, 100.0))
panels[2].axhline(1.0, color="k", linestyle=":")
panels[0].legend()
save_figure(figure, "five_formulations")
