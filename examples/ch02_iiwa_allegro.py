# %% [markdown]
# # An arm with a hand of many joints
#
# An iiwa carries an Allegro hand: seven joints and sixteen. It reaches for a can, the fingers wrap
# it and press it into the palm, and the arm lifts it. Each has a controller of its own: the arm's
# is the one of its maker, which is told the hand's weight; a stiffness holds each joint of the
# hand. (Example 2.8; `prehensile demo iiwa-allegro` shows all of it.)

# %%
import matplotlib.pyplot as plt
import numpy as np
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import JacobianWrtVariable
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import TrajectorySource

from prehensile.models.registry import find_model, package_map
from prehensile.station import build
from prehensile.tasks.gallery_pairs import CAN_SIZE, iiwa_allegro
from prehensile.viz.figures import save_figure
from prehensile.viz.images import side_by_side
from prehensile.viz.render import look_at, render

show = iiwa_allegro()
tracks = {track.model: track for track in show.tracks}
builder = DiagramBuilder()
station = builder.AddSystem(build(show.scenario))
for name, track in tracks.items():
    source = builder.AddSystem(TrajectorySource(track.trajectory))
    builder.Connect(source.get_output_port(), station.GetInputPort(f"{name}.position"))
diagram = builder.Build()
simulator = Simulator(diagram)
root = simulator.get_mutable_context()
context = station.GetMyMutableContextFromRoot(root)
plant = station.GetSubsystemByName("plant")
plant_context = plant.GetMyMutableContextFromRoot(root)
inspector = station.GetSubsystemByName("scene_graph").model_inspector()
hand = plant.GetModelInstanceByName("allegro")
can = plant.GetBodyByName("base_link", plant.GetModelInstanceByName("chips_can"))
FINGERS = {"index": 3, "middle": 7, "ring": 11, "thumb": 15}
tips = [plant.GetFrameByName(f"link_{k}_tip", hand) for k in FINGERS.values()]
palm = plant.GetFrameByName("hand_root", hand)

# %% [markdown]
# ## The run
#
# Until the can is up. What touches it is read from the contact results.


# %%
def touches():
    """For each contact of the hand with the can: link, place (m), torque and force on the link."""
    results = plant.get_contact_results_output_port().Eval(plant_context)
    found = []
    for k in range(results.num_hydroelastic_contacts()):
        info = results.hydroelastic_contact_info(k)
        surface = info.contact_surface()
        A, B = (
            plant.GetBodyFromFrameId(inspector.GetFrameId(g))
            for g in (surface.id_M(), surface.id_N())
        )
        wrench = np.r_[info.F_Ac_W().rotational(), info.F_Ac_W().translational()]
        found += [(A, B, surface.centroid(), wrench)]
    for k in range(results.num_point_pair_contacts()):
        info = results.point_pair_contact_info(k)
        A, B = plant.get_body(info.bodyA_index()), plant.get_body(info.bodyB_index())
        found += [(A, B, info.contact_point(), -np.r_[np.zeros(3), info.contact_force()])]
    touching = []
    for A, B, p_WC, wrench in found:
        for link, other, sign in ((A, B, 1.0), (B, A, -1.0)):
            if link.model_instance() == hand and other.index() == can.index():
                touching.append((link, p_WC, sign * wrench))
    return touching


closes = tracks["allegro"].start
grasped, end = closes + 0.8, closes + 1.4
shots = [0.0, closes, grasped, end]
view = look_at([1.6, 0.75, 0.75], [0.45, 0.0, 0.28])
times, commanded, measured, arm_errors, cans, p_HTips, pictures = [], [], [], [], [], [], []
pushes = []
for t in np.append(np.arange(0.0, closes, 0.1), np.arange(closes, end + 1e-9, 0.05)):
    simulator.AdvanceTo(t)
    times.append(t)
    commanded.append(tracks["allegro"].value(t))
    measured.append(station.GetOutputPort("allegro.position_measured").Eval(context))
    q = station.GetOutputPort("iiwa.position_measured").Eval(context)
    arm_errors.append(np.max(np.abs(q - tracks["iiwa"].value(t))))
    X_WH, X_WCan = palm.CalcPoseInWorld(plant_context), can.EvalPoseInWorld(plant_context)
    cans.append(np.r_[X_WCan.translation(), X_WH.InvertAndCompose(X_WCan).translation()])
    at = [X_WH.InvertAndCompose(tip.CalcPoseInWorld(plant_context)).translation() for tip in tips]
    p_HTips.append(at)
    touching = touches()
    push = -sum((wrench[3:] for *_, wrench in touching), np.zeros(3))
    speed = can.EvalSpatialVelocityInWorld(plant_context).translational()[2]
    pushes.append((len(touching), push[2], speed))
    if abs(t - grasped) < 1e-6:  # The arm waits, and nothing moves.
        torque = plant.get_net_actuation_output_port(hand).Eval(plant_context)
        held = plant.CalcGravityGeneralizedForces(plant_context)
        for link, p_WC, wrench in touching:
            p_LC = link.EvalPoseInWorld(plant_context).inverse() @ p_WC
            J_V_WC = plant.CalcJacobianSpatialVelocity(
                plant_context, JacobianWrtVariable.kV, link.body_frame(), p_LC,
                plant.world_frame(), plant.world_frame(),
            )  # fmt: skip
            held = held + J_V_WC.T @ wrench
        held = plant.GetVelocitiesFromArray(hand, held)
    if shots and t >= shots[0] - 1e-6:
        shots.pop(0)
        pictures.append(render(diagram, root, view, width=320, height=340))
save_figure(side_by_side(pictures), "reaching_grasping_lifting")
times, commanded, measured, arm_errors, cans, p_HTips, pushes = (
    np.array(rows) for rows in (times, commanded, measured, arm_errors, cans, p_HTips, pushes)
)

# %% [markdown]
# ## Held, and followed
#
# The arm follows its command. The hand does as well until it meets the can: the fingers are sent
# farther than they get, and what they lack, times their stiffness, is what they press with.

# %%
errors = np.abs(measured - commanded)
wrapped = times > grasped - 1e-6
print(f"arm follows within {1e3 * arm_errors.max():.1f} mrad")
print(f"hand holds within {1e3 * errors[times < closes].max():.1f} mrad while the arm moves")
print(f"fingers lack {1e3 * errors[wrapped].max():.0f} mrad at most")
assert arm_errors.max() < 0.03
assert errors[times < closes].max() < 0.01
assert np.all(errors[wrapped].max(axis=1) > 0.04)
assert errors.max() < 0.1

figure, (left, right) = plt.subplots(1, 2, figsize=(10, 3.6), layout="constrained")
for k, name in ((1, "index, first bend"), (2, "second"), (3, "third"), (12, "thumb, base")):
    (line,) = left.plot(times, np.degrees(measured[:, k]), label=name)
    left.plot(times, np.degrees(commanded[:, k]), ":", color=line.get_color())
left.set(xlabel="t (s)", ylabel="°", title="measured, and commanded (dotted)", xlim=(3.0, end))
left.legend(fontsize="small")
right.plot(times, 1e3 * errors.max(axis=1), label="hand")
right.plot(times, 1e3 * arm_errors, label="arm")
right.set(xlabel="t (s)", ylabel="mrad", title="farthest joint from its command")
right.legend(fontsize="small")
save_figure(figure, "held_and_commanded")

# %% [markdown]
# ## The forces of a grasp
#
# At rest each joint's torque holds up the links beyond it and presses on the can. Principle of
# virtual work: with the gravity torques $\tau_g$ and a wrench $F_c$ at each contact,
#
# $$\tau = -\tau_g - \sum_c J_c^T F_c$$
#
# The right-hand side comes from the contacts alone, the left-hand side from the motors.

# %%
np.testing.assert_allclose(torque, -held, atol=1e-3)
effort = [plant.get_joint_actuator(i).effort_limit() for i in plant.GetJointActuatorIndices(hand)]
print(f"most torque {np.abs(torque).max():.2f} of {effort[0]:.1f} N m")
assert np.all(np.abs(torque) < effort)

figure, axes = plt.subplots(figsize=(9, 3.2))
axes.bar(np.arange(16) - 0.2, 1e3 * torque, 0.4, label="motors")
axes.bar(np.arange(16) + 0.2, -1e3 * held, 0.4, label="gravity and contacts")
names = [f"{name} {k + 1}" for name in FINGERS for k in range(4)]
axes.set_xticks(range(16), names, rotation=60, ha="right", fontsize="small")
axes.set(ylabel="mN m", title="torques of the hand's joints in the grasp")
axes.legend(fontsize="small")
save_figure(figure, "torques_of_the_grasp")

# %% [markdown]
# ## Does it hold?
#
# Lifted, the can is touched by nothing but the hand, whose friction carries its weight: over time
# the upward push adds up to the weight times that time and the momentum that the can has gained.
# It does not slip.

# %%
weight = 9.81 * can.default_mass()
height = cans[:, 2] - 0.5 * CAN_SIZE[1]
up = height > 0.01
count, push, speed = pushes[up].T
impulse = np.sum(0.5 * (push[1:] + push[:-1]) * np.diff(times[up]))
duration = times[up][-1] - times[up][0]
needed = weight * duration + can.default_mass() * (speed[-1] - speed[0])
print(f"lifted by {100 * height.max():.1f} cm, slipped by "
      f"{1e3 * np.ptp(cans[up, 3:], axis=0).max():.2f} mm")  # fmt: skip
print(f"pushed up by {push.mean():.2f} N, weight {weight:.2f} N")
print(f"impulse {impulse:.3f} N s, weight and momentum take {needed:.3f} N s")
assert height.max() > 0.08
assert np.all(pushes[times < closes, 0] == 0)
assert np.all(count >= 4)
np.testing.assert_allclose(impulse, needed, rtol=0.01)
assert np.all(np.ptp(cans[up, 3:], axis=0) < 1e-3)

# %% [markdown]
# ## Where the tips go
#
# Seen from the palm the arm's motion drops out, and what is left is the forward kinematics of the
# hand alone.

# %%
alone = MultibodyPlant(0.0)
parser = Parser(alone)
parser.package_map().AddMap(package_map())
parser.AddModels(url=find_model("allegro_right").url)
alone.WeldFrames(alone.world_frame(), alone.GetFrameByName("hand_root"))
alone.Finalize()
scratch = alone.CreateDefaultContext()
for q, p in zip(measured, p_HTips, strict=True):
    alone.SetPositions(scratch, q)
    frames = [alone.GetFrameByName(tip.name()) for tip in tips]
    p_alone = [frame.CalcPoseInWorld(scratch).translation() for frame in frames]
    np.testing.assert_allclose(p, p_alone, atol=1e-9)

figure, axes = plt.subplots(figsize=(4.5, 5))
for k, name in enumerate(FINGERS):
    (line,) = axes.plot(100 * p_HTips[:, k, 0], 100 * p_HTips[:, k, 2], label=name)
    axes.plot(100 * p_HTips[-1, k, 0], 100 * p_HTips[-1, k, 2], "o", color=line.get_color())
p_HCan = cans[-1, 3:]
axes.add_patch(plt.Circle(100 * p_HCan[[0, 2]], 100 * CAN_SIZE[0], color="0.85", label="can"))
axes.set(xlabel="x out of the palm (cm)", ylabel="z along it (cm)", aspect="equal")
axes.legend(fontsize="small", loc=(1.05, 0.6))
save_figure(figure, "paths_of_the_tips")
# The tips of the fingers end on the far side of the can, the palm is on the near one.
assert np.all(p_HTips[-1, :3, 0] > p_HCan[0])
assert p_HCan[0] > CAN_SIZE[0]
# The tips are round with a radius of 12 mm, and their rubber gives a little.
gaps = np.linalg.norm((p_HTips[-1] - p_HCan)[:3, [0, 2]], axis=1) - CAN_SIZE[0]
print("middles of the tips from the can, in mm:", np.round(1e3 * gaps, 1))
assert np.all((gaps > 0.009) & (gaps < 0.012))
