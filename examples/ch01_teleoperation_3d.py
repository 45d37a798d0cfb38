# %% [markdown]
# # Teleoperation in space
#
# The hand is driven by six numbers, roll, pitch, yaw, x, y and z, and one for its opening:
# `prehensile teleop iiwa_wsg` is this program for people. Here a script closes the hand around a
# brick, as a person would, without looking at anything but the scene.

# %%
import matplotlib.pyplot as plt
import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from pydrake.systems.analysis import Simulator

from prehensile.station import build, load_scenario
from prehensile.station.teleop import find_arm, teleoperate
from prehensile.viz.figures import save_figure
from prehensile.viz.images import side_by_side
from prehensile.viz.meshcat import start_meshcat
from prehensile.viz.render import look_at, render

scenario = load_scenario("pick_brick")
station = build(scenario)
arm = find_arm(station, scenario)
meshcat = start_meshcat()
diagram = teleoperate(station, scenario, meshcat)
simulator = Simulator(diagram)

# %% [markdown]
# The hand points down and closes along y. The brick stands 10 cm ahead of it, its short side along
# y.

# %%
plant = station.GetSubsystemByName("plant")
plant_context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
brick = plant.GetBodyByName("base_link", plant.GetModelInstanceByName("foam_brick"))
hand = plant.GetBodyByName("body", plant.GetModelInstanceByName("wsg"))
p_WG0 = plant.EvalBodyPoseInWorld(plant_context, hand).translation()
p_WB0 = np.array([p_WG0[0] + 0.1, p_WG0[1], 0.025])
plant.SetFreeBodyPose(
    plant_context, brick, RigidTransform(RotationMatrix.MakeZRotation(0.5 * np.pi), p_WB0)
)
simulator.Initialize()

# %%
sliders = {label.split(" (")[0]: label for label in meshcat.GetSliderNames()}
view = look_at([1.7, -1.2, 0.9], [0.3, 0.0, 0.35])
times, heights, pictures = [], [], []


def move(slider, change):
    meshcat.SetSliderValue(sliders[slider], meshcat.GetSliderValue(sliders[slider]) + change)


def run(seconds):
    end = simulator.get_context().get_time() + seconds
    while simulator.get_context().get_time() < end - 1e-9:
        simulator.AdvanceTo(simulator.get_context().get_time() + 0.05)
        times.append(simulator.get_context().get_time())
        poses = [plant.EvalBodyPoseInWorld(plant_context, body) for body in (hand, brick)]
        heights.append([X.translation()[2] for X in poses])


down = p_WG0[2] - (p_WB0[2] + 0.11)  # until the brick is 11 cm below the hand's frame
for slider, change, seconds in (
    ("x", 0.1, 1.5),
    ("z", -down, 2.5),
    ("opening", -0.1, 1.5),
    ("z", 0.2, 2.0),
    ("yaw", np.radians(60.0), 2.0),
):
    move(slider, change)
    run(seconds)
    pictures.append(render(diagram, simulator.get_context(), view, width=480, height=400))

# %% [markdown]
# The brick hangs in the hand, 20 cm higher, turned by 60°.

# %%
X_WB = plant.EvalBodyPoseInWorld(plant_context, brick)
assert 0.19 < X_WB.translation()[2] - p_WB0[2] < 0.21
turned = RollPitchYaw(X_WB.rotation()).yaw_angle() - 0.5 * np.pi
assert abs(turned - np.radians(60.0)) < np.radians(3.0)

save_figure(side_by_side([pictures[k] for k in (0, 2, 4)]), "the_brick_is_picked")
figure, axes = plt.subplots(figsize=(7, 3.4))
axes.plot(times, heights, label=["hand", "brick"])
axes.set(xlabel="t (s)", ylabel="height (m)")
axes.legend()
save_figure(figure, "heights")
