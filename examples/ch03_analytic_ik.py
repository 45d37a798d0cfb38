# %% [markdown]
# # All inverses of a pose
#
# Arms whose axes meet in the right places have inverse kinematics in closed form. The iiwa's
# shoulder and wrist are spherical and its elbow lies between them: for a pose of its gripper the
# elbow is free to move on a circle, by the arm angle, and for each arm angle there are eight
# configurations.

# %%
import matplotlib.pyplot as plt
import numpy as np
from pydrake.math import RigidTransform, RotationMatrix

from prehensile.kinematics.analytic_ik import srs_arm_from_plant
from prehensile.station import build, load_scenario
from prehensile.viz.figures import save_figure
from prehensile.viz.images import side_by_side
from prehensile.viz.render import look_at, render

station = build(load_scenario("iiwa_wsg"))
context = station.CreateDefaultContext()
plant = station.GetSubsystemByName("plant")
plant_context = plant.GetMyMutableContextFromRoot(context)
arm = plant.GetModelInstanceByName("iiwa")
G = plant.GetFrameByName("body", plant.GetModelInstanceByName("wsg"))
solver = srs_arm_from_plant(plant, G)

X_WG = RigidTransform(RotationMatrix.MakeXRotation(-0.5 * np.pi), [0.45, 0.15, 0.4])

# %% [markdown]
# ## Eight branches
#
# Shoulder, elbow and wrist can each be bent in two ways. All eight bring the gripper to the pose,
# as Drake's forward kinematics confirm; not all are within the joints' limits.

# %%
every = solver.solve(X_WG, 0.0, limits=False)
within = solver.solve(X_WG, 0.0)
assert len(every) == 8
for q in every.q:
    plant.SetPositions(plant_context, arm, q)
    assert G.CalcPoseInWorld(plant_context).IsNearlyEqualTo(X_WG, 1e-9)
print(f"{len(within)} of {len(every)} are within the limits")

# %% [markdown]
# ## The arm angle
#
# As the elbow goes round, a joint may reach its limit. For which arm angles a branch stays within
# all limits is known without searching.

# %%
figure, panels = plt.subplots(2, 4, figsize=(13, 5.2), sharex=True, sharey=True)
psi = np.linspace(-np.pi, np.pi, 721)
for branch, axes in enumerate(panels.flat):
    intervals = solver.arm_angle_intervals(X_WG, branch)
    for lower, upper in intervals:
        axes.axvspan(np.degrees(lower), np.degrees(upper), color="tab:green", alpha=0.25)
    share = np.full((len(psi), 7), np.nan)
    for k, angle in enumerate(psi):
        solutions = solver.solve(X_WG, angle, limits=False)
        (row,) = np.flatnonzero(solutions.branch == branch)
        q = solutions.q[row]
        share[k] = 2.0 * (q - solver.lower) / (solver.upper - solver.lower) - 1.0
        inside = np.all(np.abs(share[k]) <= 1.0)
        known = any(lower <= angle <= upper for lower, upper in intervals)
        near_an_end = np.any(np.abs(intervals - angle) < 0.01)
        assert inside == known or near_an_end
    axes.plot(np.degrees(psi), share, linewidth=1)
    axes.set(title=f"branch {branch}", ylim=(-1.3, 1.3))
for axes in panels[1]:
    axes.set(xlabel="arm angle (°)")
panels[0, 0].set(ylabel="joints, ±1 at a limit")
panels[1, 0].set(ylabel="joints, ±1 at a limit")
save_figure(figure, "arm_angles_within_limits")

# %% [markdown]
# ## Which one?
#
# The closest to where the arm is, or the one farthest from all limits.

# %%
q_start = plant.GetPositions(plant.CreateDefaultContext(), arm)
closest, safest = solver.closest(X_WG, q_start), solver.farthest_from_limits(X_WG)
pictures = []
for choice in (closest, safest):
    assert choice.status == "solved"
    plant.SetPositions(plant_context, arm, choice.q)
    assert G.CalcPoseInWorld(plant_context).IsNearlyEqualTo(X_WG, 1e-9)
    view = look_at([1.6, -1.4, 1.0], [0.2, 0.0, 0.4])
    pictures.append(render(station, context, view, width=460, height=420))
save_figure(side_by_side(pictures), "closest_and_safest")


def room(q):
    return np.min(np.minimum(q - solver.lower, solver.upper - q))


assert room(safest.q) >= room(closest.q)
for q in within.q:
    assert np.linalg.norm(closest.q - q_start) <= np.linalg.norm(q - q_start) + 1e-6

# %% [markdown]
# A pose out of reach has no solution, and the answer says why.

# %%
far = RigidTransform(X_WG.rotation(), [1.2, 0.0, 0.4])
assert solver.solve(far, 0.0).status == "too far"
assert len(solver.solve(far, 0.0)) == 0
