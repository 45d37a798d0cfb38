# %% [markdown]
# # Pick and place
#
# The keyframes of the last example, played on a simulated station: the pose trajectory goes into
# differential inverse kinematics, which drives the arm's command port, and the opening into the
# hand's. How near does the gripper come to its goal, and the brick to its own? (Example 3.13;
# `prehensile demo pick-place` plans around obstacles as well.)

# %%
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from PIL import Image
from pydrake.common.value import Value
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder, LeafSystem
from pydrake.systems.primitives import TrajectorySource

from prehensile.kinematics.differential_ik import DifferentialIkConfig, FrameTask
from prehensile.kinematics.keyframe_timing import TimingConfig, time_keyframes
from prehensile.kinematics.keyframes import Keyframe
from prehensile.kinematics.poses import pose_distance
from prehensile.kinematics.systems import DifferentialInverseKinematics
from prehensile.kinematics.tree import tree_from_plant
from prehensile.station import build, load_scenario
from prehensile.viz.diagrams import save_diagram
from prehensile.viz.figures import save_figure
from prehensile.viz.images import side_by_side
from prehensile.viz.render import look_at, render

station = build(load_scenario("pick_brick"))
plant = station.GetSubsystemByName("plant")
arm = plant.GetModelInstanceByName("iiwa")
G = plant.GetFrameByName("body", plant.GetModelInstanceByName("wsg"))
brick = plant.GetBodyByName("base_link", plant.GetModelInstanceByName("foam_brick"))
joints = [plant.GetJointByName(f"iiwa_joint_{k + 1}", arm) for k in range(7)]
compiled = tree_from_plant(plant, [G], joints=joints)
q_start = plant.GetPositions(plant.CreateDefaultContext(), arm)

# %% [markdown]
# ## The motion

# %%
X_OGpick = RigidTransform(RotationMatrix.MakeXRotation(-0.5 * np.pi), [0.0, 0.0, 0.11])
above = RigidTransform([0.0, 0.0, 0.09])
X_WO = RigidTransform(RotationMatrix.MakeZRotation(1.9), [0.5, -0.25, 0.025])
X_WOd = RigidTransform(RotationMatrix.MakeZRotation(1.1), [0.45, 0.3, 0.025])
X_WGinitial = RigidTransform(compiled.tree.pose(q_start, 0))
X_WGpick, X_WGplace = X_WO @ X_OGpick, RigidTransform([0, 0, 0.002]) @ X_WOd @ X_OGpick
middle = 0.5 * (X_WGpick.translation() + X_WGplace.translation()) + [0.0, 0.0, 0.25]
X_WGclearance = RigidTransform(X_WGinitial.rotation(), middle)
motion = time_keyframes(
    compiled,
    0,
    q_start,
    [
        Keyframe("initial", X_WGinitial, width=0.1),
        Keyframe("prepick", above @ X_WGpick, blend=0.03),
        Keyframe("pick", X_WGpick, width=0.0, dwell=0.6),
        Keyframe("lift", above @ X_WGpick, blend=0.03),
        Keyframe("clearance", X_WGclearance, blend=0.1),
        Keyframe("preplace", above @ X_WGplace, blend=0.03),
        Keyframe("place", X_WGplace, width=0.1, dwell=0.6),
        Keyframe("retreat", above @ X_WGplace),
    ],
    config=TimingConfig(speed=0.7, acceleration=0.5),
)
assert motion.found, motion.reason
assert motion.poses is not None

# %% [markdown]
# ## The diagram
#
# The pose is fed in together with its velocity, so that nothing lags behind; the pose alone would
# be followed late, the velocity alone would drift.


# %%
class PoseSource(LeafSystem):
    """Puts out the pose of the gripper."""

    def __init__(self, pose):
        super().__init__()
        self.DeclareAbstractOutputPort(
            "pose",
            lambda: Value(RigidTransform()),
            lambda context, output: output.set_value(pose(context.get_time())),
        )


builder = DiagramBuilder()
builder.AddNamedSystem("station", station)
pose = builder.AddNamedSystem("pose", PoseSource(motion.poses.value))
velocity = builder.AddNamedSystem("velocity", TrajectorySource(motion.poses.drake_velocity()))
widths = builder.AddNamedSystem("opening", TrajectorySource(motion.widths))
ik = builder.AddNamedSystem(
    "differential_ik",
    DifferentialInverseKinematics(
        compiled,
        [FrameTask()],
        DifferentialIkConfig(centering="nullspace", nominal_position=tuple(q_start)),
        default_position=q_start,
        names=["G"],
    ),
)
builder.Connect(pose.get_output_port(), ik.GetInputPort("G.pose"))
builder.Connect(velocity.get_output_port(), ik.GetInputPort("G.velocity"))
builder.Connect(station.GetOutputPort("iiwa.state_estimated"), ik.GetInputPort("estimated_state"))
builder.Connect(ik.GetOutputPort("position"), station.GetInputPort("iiwa.position"))
builder.Connect(widths.get_output_port(), station.GetInputPort("wsg.position"))
diagram = builder.Build()
diagram.set_name("pick and place")

# %% [markdown]
# ## The run

# %%
simulator = Simulator(diagram)
context = simulator.get_mutable_context()
plant_context = plant.GetMyMutableContextFromRoot(context)
plant.SetFreeBodyPose(plant_context, brick, X_WO)
simulator.Initialize()
view = look_at([1.5, -0.9, 0.9], [0.35, 0.0, 0.2])
at = dict(zip(motion.names, motion.times, strict=True))
shots = [at["pick"] + 0.6, at["clearance"], at["place"]]
times, errors, pictures = [], [], []
error_at_place = None
while context.get_time() < motion.duration + 0.5:
    simulator.AdvanceTo(context.get_time() + 0.02)
    t = context.get_time()
    X_WG = G.CalcPoseInWorld(plant_context)
    times.append(t)
    errors.append(pose_distance(X_WG, motion.poses.value(t)))
    if error_at_place is None and t > at["place"] + 0.1:
        error_at_place = pose_distance(X_WG, X_WGplace)
    if shots and t >= shots[0]:
        shots.pop(0)
        pictures.append(render(diagram, context, view, width=460, height=400))
errors = np.array(errors)

# %% [markdown]
# ## How near?

# %%
X_WOend = plant.EvalBodyPoseInWorld(plant_context, brick)
distance, angle = pose_distance(X_WOend, X_WOd)
print(f"gripper {1e3 * error_at_place[0]:.2f} mm, {np.degrees(error_at_place[1]):.2f}°")
print(f"brick {1e3 * distance:.2f} mm, {np.degrees(angle):.2f}°")
assert error_at_place[0] < 0.002
assert error_at_place[1] < np.radians(1.0)
assert distance < 0.01
assert angle < np.radians(3.0)
assert np.max(errors[:, 0]) < 0.03  # It lags a little while it moves fast.

figure, axes = plt.subplots(figsize=(7, 3.2))
axes.plot(times, 1e3 * errors[:, 0], label="mm")
axes.plot(times, np.degrees(errors[:, 1]), label="°")
for name in ("pick", "place"):
    axes.axvline(at[name], color="0.7", linestyle=":")
    axes.text(at[name], axes.get_ylim()[1], name, ha="center", va="bottom")
axes.set(xlabel="t (s)")
axes.set_title("the gripper from where it should be", pad=18)
axes.legend()
save_figure(figure, "tracking_error")
save_figure(side_by_side(pictures), "picked_carried_placed")

# %%
drawn = np.asarray(Image.open(save_diagram(diagram, Path("diagram.png"))).convert("RGB"))
save_figure(drawn, "the_diagram")
