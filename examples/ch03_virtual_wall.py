# %% [markdown]
# # A virtual wall
#
# The gripper is told to move 40 cm to the left. Half way there is a plane that it must not pass.
# Linearized, that is one row more in the quadratic program: the nearer the plane, the slower the
# gripper may approach it. It slides along the wall, and the arm keeps all its limits. (Exercise
# 3.10.)

# %%
import matplotlib.pyplot as plt
import numpy as np

from prehensile.kinematics.differential_ik import JointLimits, centered, virtual_walls
from prehensile.kinematics.tree import tree_from_plant
from prehensile.station import build, load_scenario
from prehensile.viz.figures import save_figure
from prehensile.viz.images import side_by_side
from prehensile.viz.render import look_at, render

station = build(load_scenario("iiwa_wsg"))
plant = station.GetSubsystemByName("plant")
arm = plant.GetModelInstanceByName("iiwa")
G = plant.GetFrameByName("body", plant.GetModelInstanceByName("wsg"))
joints = [plant.GetJointByName(f"iiwa_joint_{k + 1}", arm) for k in range(7)]
compiled = tree_from_plant(plant, [G], joints=joints)
limits = JointLimits.of_tree(compiled)
context = station.CreateDefaultContext()
q_start = plant.GetPositions(plant.GetMyContextFromRoot(context), arm)

# %% [markdown]
# ## (a) With the joints' limits alone
#
# The desired velocity goes left and a little forward; at each step the velocities follow from the
# program with the limits of position, velocity and acceleration, and a weak pull to the first
# posture.

# %%
h, seconds = 0.01, 3.0
V_WG = np.array([0.0, 0.0, 0.0, 0.03, 0.15, 0.0])
y_wall = compiled.tree.pose(q_start, 0)[1, 3] + 0.2


def move(walled):
    """Joint positions of the whole motion, (steps, 7)."""
    q, v, positions = q_start.copy(), np.zeros(7), []
    for _ in range(round(seconds / h)):
        J_G, p_WG = compiled.tree.jacobian(q, 0), compiled.tree.pose(q, 0)[:3, 3]
        walls = None
        if walled:
            walls = virtual_walls([[0.0, 1.0, 0.0]], [y_wall], p_WG, J_G[3:], gain=8.0)
        step = centered(
            J_G, V_WG, q, v, limits, period=h, nominal_position=q_start, constraints=walls
        )
        assert step.succeeded
        v = step.v
        q = q + h * v
        positions.append(q)
    return np.array(positions)


free, walled = move(walled=False), move(walled=True)
for Q in (free, walled):
    v = np.diff(Q, axis=0) / h
    assert np.all(limits.lower <= Q)
    assert np.all(limits.upper >= Q)
    assert np.all(np.abs(v) <= limits.velocity + 1e-9)
    assert np.all(np.abs(np.diff(v, axis=0)) / h <= limits.acceleration + 1e-6)

# %% [markdown]
# ## (b) With the wall
#
# Without it the gripper passes the plane; with it, never; and it goes on forward all the while.

# %%
p_free, p_walled = (compiled.tree.poses(Q, 0)[:, :3, 3] for Q in (free, walled))
assert p_free[-1, 1] > y_wall + 0.15
assert np.max(p_walled[:, 1]) <= y_wall + 1e-4
assert y_wall - p_walled[-1, 1] < 0.01
assert abs(p_walled[-1, 0] - p_free[-1, 0]) < 0.02
# It does not turn.
assert np.allclose(compiled.tree.pose(walled[-1], 0)[:3, :3],
                   compiled.tree.pose(q_start, 0)[:3, :3], atol=0.02)  # fmt: skip

t = h * np.arange(1, len(free) + 1)
figure, (left, right) = plt.subplots(1, 2, figsize=(10, 3.8))
left.plot(p_free[:, 0], p_free[:, 1], label="free")
left.plot(p_walled[:, 0], p_walled[:, 1], label="with the wall")
left.axhline(y_wall, color="tab:red", linewidth=3, alpha=0.5)
left.set(xlabel="x (m)", ylabel="y (m)", title="the gripper from above")
left.legend()
right.plot(t, p_free[:, 1], t, p_walled[:, 1])
right.axhline(y_wall, color="tab:red", linewidth=3, alpha=0.5)
right.set(xlabel="t (s)", ylabel="y (m)")
save_figure(figure, "the_wall")

# %%
pictures = []
for q in (q_start, free[-1], walled[-1]):
    plant.SetPositions(plant.GetMyMutableContextFromRoot(context), arm, q)
    view = look_at([2.0, 0.3, 1.1], [0.2, 0.1, 0.4])
    pictures.append(render(station, context, view, width=420, height=400))
save_figure(side_by_side(pictures), "start_free_and_walled")
