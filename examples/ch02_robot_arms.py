# %% [markdown]
# # A gallery of arms
#
# Every arm among the models, side by side: how many joints, how far they reach, how much of their
# motors' torque goes into carrying the arm itself, how much of the inertia at a joint is the
# motor's, and what a seventh joint is good for. (Example 2.1; `prehensile demo arms` moves them.)

# %%
import matplotlib.pyplot as plt
import numpy as np
from pydrake.multibody.tree import JacobianWrtVariable
from scipy.linalg import null_space
from scipy.optimize import minimize

from prehensile.control.inertia import joint_inertia, random_configurations
from prehensile.kinematics.jacobians import rank
from prehensile.kinematics.tree import tree_from_plant
from prehensile.station import build, loads_scenario
from prehensile.tasks.gallery_robots import gallery_robots
from prehensile.tasks.gallery_scenes import scenario_text
from prehensile.viz.figures import save_figure
from prehensile.viz.images import side_by_side
from prehensile.viz.render import look_at, render

# From the makers' data sheets: joints, weight (kg), payload (kg), reach (m); the model's flange.
SHEETS = {
    "gen3": (7, 8.2, 4.0, 0.902, "end_effector_link"),
    "iiwa14": (7, 29.9, 14.0, 0.820, "flange"),
    "iiwa7": (7, 23.9, 7.0, 0.800, "flange"),
    "panda": (7, 18.0, 3.0, 0.855, "panda_link8"),
    "ur10e": (6, 33.5, 12.5, 1.300, "tool0"),
    "ur5e": (6, 20.6, 5.0, 0.850, "tool0"),
    "xarm7": (7, 13.7, 3.5, 0.700, "link_eef"),
}
robots = {robot.info.name: robot for robot in gallery_robots("arm")}
assert set(robots) == set(SHEETS)
flanges = {name: robots[name].plant.GetFrameByName(SHEETS[name][4]) for name in SHEETS}
trees = {
    name: tree_from_plant(robot.plant, [flanges[name]], joints=robot.joints)
    for name, robot in robots.items()
}

# %% [markdown]
# ## All of them
#
# The gallery finds each arm a posture with its flange in front of it, pointing down. In front, from
# the right: Gen3, iiwa 14, iiwa 7, Panda; behind them UR10e, UR5e, xArm 7.

# %%
scenario = loads_scenario(scenario_text(list(robots.values()), "stiffness", "Arms."))
station = build(scenario)
context = station.CreateDefaultContext()
view = look_at([3.0, -0.1, 1.9], [-0.6, 0.0, 0.25])
save_figure(render(station, context, view, width=960, height=400, fov_y=0.55), "the_arms")

# %% [markdown]
# ## Joints and weight, against the data sheets

# %%
weight = {}
for name, (num_joints, sheet_weight, *_) in SHEETS.items():
    plant, instance = robots[name].plant, robots[name].instance
    weight[name] = plant.CalcTotalMass(plant.CreateDefaultContext(), [instance])
    assert plant.num_velocities() == trees[name].tree.num_joints == num_joints
    print(f"{name:7} {num_joints} joints, {weight[name]:5.1f} kg, sheet {sheet_weight} kg")
    if name != "iiwa7":
        assert abs(weight[name] / sheet_weight - 1.0) < 0.03
# The masses that the field gives the links of the iiwa 7 are less than its data sheet's.
assert 0.75 < weight["iiwa7"] / SHEETS["iiwa7"][1] < 0.85

# %% [markdown]
# ## Reach
#
# How far can the flange be from the shoulder, which is on the first axis at the height of the
# second? The farthest of many random configurations, then uphill from there. Kinova and Franka
# measure to the flange. Others measure to the wrist or give a round figure, and their flanges
# reach farther than they say.


# %%
def distance(q, tree, p_WS):
    return -np.linalg.norm(tree.pose(q)[:3, 3] - p_WS)


reach = {}
for name, robot in robots.items():
    plant, compiled = robot.plant, trees[name]
    Q = random_configurations(plant, 5000, seed=1)
    shoulder = robot.joints[1].frame_on_parent().CalcPoseInWorld(plant.CreateDefaultContext())
    p_WS = shoulder.translation() * [0.0, 0.0, 1.0]
    distances = np.linalg.norm(compiled.tree.poses(Q)[:, :3, 3] - p_WS, axis=1)
    best = minimize(
        distance,
        Q[np.argmax(distances)],
        (compiled.tree, p_WS),
        bounds=list(zip(compiled.lower, compiled.upper, strict=True)),
    )
    reach[name] = -best.fun
    print(f"{name:7} {reach[name]:.3f} m, sheet {SHEETS[name][3]:.3f} m")
    assert distances.max() <= reach[name]
    assert SHEETS[name][3] - 1e-3 < reach[name] < SHEETS[name][3] + 0.13
# The lengths of a stretched iiwa: upper arm, forearm, from the wrist to the flange.
np.testing.assert_allclose(reach["iiwa14"], 0.42 + 0.40 + 0.126, atol=2e-3)
np.testing.assert_allclose(reach["gen3"], 0.902, atol=1e-3)
np.testing.assert_allclose(reach["panda"], 0.855, atol=4e-3)

figure, axes = plt.subplots(figsize=(7, 3.8))
for name, (num_joints, _, payload, _, _) in SHEETS.items():
    color = "tab:blue" if num_joints == 7 else "tab:orange"
    axes.scatter(reach[name], payload, 15.0 * weight[name], color=color, alpha=0.7)
    place = (8, -18) if name in ("gen3", "panda") else (10, 8)
    if name == "xarm7":
        place = (-40, 12)
    axes.annotate(f"{name}, {weight[name]:.0f} kg", (reach[name], payload), place,
                  textcoords="offset points", fontsize="small")  # fmt: skip
axes.set(xlabel="reach of the flange (m)", ylabel="payload (kg)", xlim=(0.65, 1.6), ylim=(0, 18))
axes.set_title("area: weight; blue: seven joints, orange: six")
save_figure(figure, "reach_payload_weight")

# %% [markdown]
# ## What gravity takes
#
# The torque of a joint that carries something is the moment of all that is beyond it about its
# axis. Drake's gravity torques are checked against that sum, body by body.

# %%
GRAVITY = 9.81


def carried(plant, context, joint):
    """Torque (N m) of a joint that holds up the bodies beyond it."""
    pivot = joint.frame_on_parent().CalcPoseInWorld(context)
    axis = pivot.rotation() @ joint.revolute_axis()
    total = 0.0
    for index in plant.GetBodiesKinematicallyAffectedBy([joint.index()]):
        body = plant.get_body(index)
        p_WCom = plant.EvalBodyPoseInWorld(context, body).multiply(body.default_com())
        force = [0.0, 0.0, -GRAVITY * body.default_mass()]
        total -= axis @ np.cross(p_WCom - pivot.translation(), force)
    return total


shares, holds = {}, {}
for name, robot in robots.items():
    plant, effort, payload = robot.plant, robot.plant.GetEffortUpperLimits(), SHEETS[name][2]
    root = robot.diagram.CreateDefaultContext()
    context, world = robot.diagram.plant_context(root), plant.world_frame()
    alone = loaded = np.zeros(len(effort))
    hold = np.inf
    for k, q in enumerate(random_configurations(plant, 600, seed=2)):
        plant.SetPositions(context, q)
        torque = -plant.CalcGravityGeneralizedForces(context)
        if k == 0:
            by_hand = [carried(plant, context, joint) for joint in robot.joints]
            np.testing.assert_allclose(torque, by_hand, atol=1e-9)
        J_v_WF = plant.CalcJacobianTranslationalVelocity(
            context, JacobianWrtVariable.kV, flanges[name], np.zeros(3), world, world
        )
        per_kg = GRAVITY * J_v_WF[2]
        alone = np.maximum(alone, np.abs(torque) / effort)
        loaded = np.maximum(loaded, np.abs(torque + payload * per_kg) / effort)
        spare = effort - np.sign(per_kg) * torque
        hold = min(hold, np.min(spare / np.maximum(np.abs(per_kg), 1e-9)))
    shares[name], holds[name] = (alone, loaded), hold
    assert np.all(alone < 0.75)  # Every arm carries itself with ease, in every posture.

# %% [markdown]
# Most motors hold the payload everywhere. Those of the two lightest arms do not hold it with the
# arm stretched out: for them the payload is a figure for the middle of the workspace.

# %%
figure, axes = plt.subplots(figsize=(9, 3.8))
names = list(SHEETS)
for k, name in enumerate(names):
    alone, loaded = (100 * share for share in shares[name])
    at = k + 0.1 * (np.arange(len(alone)) - 3)
    axes.bar(at, loaded, 0.08, color="tab:orange", label="with its payload" if k == 0 else None)
    axes.bar(at, alone, 0.08, color="tab:blue", label="of the arm itself" if k == 0 else None)
    print(f"{name:7} holds {holds[name]:5.1f} kg everywhere, payload {SHEETS[name][2]} kg")
axes.axhline(100, color="0.4", linestyle=":")
axes.set_xticks(range(len(names)), names)
axes.set(ylabel="% of the torque limit", title="most torque against gravity, joint by joint")
axes.legend(fontsize="small")
save_figure(figure, "gravity_torques")
too_weak = {name for name in names if holds[name] < SHEETS[name][2]}
assert too_weak == {"gen3", "xarm7"}
assert sorted(names, key=weight.__getitem__)[:2] == ["gen3", "xarm7"]

# %% [markdown]
# ## What a joint feels of its motor
#
# The share of the rotor, seen through its gear, in the inertia at each joint.

# %%
figure, axes = plt.subplots(figsize=(7, 3.6))
table = np.full((len(names), 7), np.nan)
for k, name in enumerate(names):
    plant = robots[name].plant
    Q = random_configurations(plant, 200, seed=3)
    inertia = joint_inertia(plant, Q)
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, Q[0])
    np.testing.assert_allclose(inertia.total[0], np.diag(plant.CalcMassMatrix(context)))
    table[k, : len(inertia.reflected)] = np.median(inertia.reflected / inertia.total, axis=0)
    last = table[k, len(inertia.reflected) - 1]
    assert last > 0.95  # The last one moves next to nothing but itself.
    assert table[k, 1] < 0.7 < last  # The second moves the whole arm.
image = axes.imshow(100 * table, cmap="viridis", vmin=0, vmax=100, aspect="auto")
for (k, j), share in np.ndenumerate(table):
    if np.isfinite(share):
        color = "black" if share > 0.6 else "white"
        axes.text(j, k, f"{100 * share:.0f}", ha="center", va="center", color=color)
axes.set_xticks(range(7), [f"joint {j + 1}" for j in range(7)])
axes.set_yticks(range(len(names)), names)
axes.set_title("reflected inertia, % of the inertia at the joint (median)")
figure.colorbar(image)
save_figure(figure, "reflected_inertia")

# %% [markdown]
# ## What the seventh joint is good for
#
# A pose has six degrees of freedom. Seven joints have one to spare: a direction of joint velocities
# that moves the arm and leaves its flange where it is. Six joints have none.


# %%
def still(name, q):
    """Basis of the joint velocities that leave the flange where it is."""
    J = trees[name].tree.jacobian(q)
    assert rank(J, tolerance=1e-3) == 6
    return null_space(J, rcond=1e-3)


for name, robot in robots.items():
    assert still(name, robot.q).shape[1] == SHEETS[name][0] - 6

# %% [markdown]
# Followed for a while, that direction turns the iiwa's elbow about the line from its shoulder to
# its wrist.

# %%
robot, compiled = robots["iiwa14"], trees["iiwa14"]
root = robot.diagram.CreateDefaultContext()
plant, plant_context = robot.plant, robot.diagram.plant_context(root)
view = look_at([1.9, -1.0, 1.1], [0.25, 0.0, 0.45])
elbow = plant.GetFrameByName("iiwa_link_4")


def slide(q, direction, steps, size=0.01):
    """Follows the self-motion; returns the configurations."""
    rows = [q]
    for _ in range(steps):
        middle = rows[-1]
        for part in (0.5, 1.0):  # the midpoint rule
            v = still("iiwa14", middle)[:, 0]
            v = v * np.sign(v @ direction)
            middle = rows[-1] + part * size * v
        direction = v
        rows.append(middle)
    return np.array(rows)


first = still("iiwa14", robot.q)[:, 0]
left, right = slide(robot.q, first, 180), slide(robot.q, -first, 180)
way = np.vstack([right[::-1], left[1:]])
assert np.all((way >= compiled.lower) & (way <= compiled.upper))
flange_at, elbow_at, pictures = [], [], []
for k, q in enumerate(way):
    plant.SetPositions(plant_context, q)
    flange_at.append(flanges["iiwa14"].CalcPoseInWorld(plant_context).GetAsMatrix4())
    elbow_at.append(elbow.CalcPoseInWorld(plant_context).translation())
    if k in (0, 180, 360):
        pictures.append(render(robot.diagram, root, view, width=320, height=340))
assert np.max(np.ptp(flange_at, axis=0)) < 1e-4
assert np.max(np.ptp(elbow_at, axis=0)) > 0.3
# The shoulder is on the base's axis, the wrist above the flange; the elbow is as far from each.
p_WS, X_WF = np.array([0.0, 0.0, 0.36]), flange_at[0]
p_WWrist = X_WF[:3, 3] - 0.126 * X_WF[:3, 2]
for center, radius in ((p_WS, 0.42), (p_WWrist, 0.40)):
    np.testing.assert_allclose(np.linalg.norm(elbow_at - center, axis=1), radius, atol=1e-3)
save_figure(side_by_side(pictures), "self_motion")
