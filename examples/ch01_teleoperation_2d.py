# %% [markdown]
# # Teleoperation in the plane
#
# An arm is held in the vertical plane and driven by three numbers: x, z and the tilt of its hand.
# In the browser they are sliders, keys or a gamepad; `prehensile teleop planar --mode planar` is
# this program for people. Here the sliders are moved by the script.

# %%
import matplotlib.pyplot as plt
import numpy as np
from pydrake.systems.analysis import Simulator

from prehensile.station import build, load_scenario
from prehensile.station.teleop import find_arm, teleoperate
from prehensile.viz.figures import save_figure
from prehensile.viz.meshcat import start_meshcat
from prehensile.viz.render import look_at, render

scenario = load_scenario("planar")
station = build(scenario)
arm = find_arm(station, scenario)
meshcat = start_meshcat()  # Its page can be opened; nothing here needs it.
diagram = teleoperate(station, scenario, meshcat, mode="planar")
simulator = Simulator(diagram)
simulator.Initialize()

# %% [markdown]
# The labels of the sliders name their keys.

# %%
sliders = {label.split(" (")[0]: label for label in meshcat.GetSliderNames()}
print(list(sliders.values()))


def move(slider, change):
    meshcat.SetSliderValue(sliders[slider], meshcat.GetSliderValue(sliders[slider]) + change)


# %% [markdown]
# Back by 12 cm, then down by 15 cm, then a tilt of 30°. What the arm does is read from its
# measurement port, as on a real one.

# %%
plant_context = arm.plant.CreateDefaultContext()
times, hand, tilt = [], [], []
R_WE0 = arm.start_pose().rotation()


def run(seconds):
    end = simulator.get_context().get_time() + seconds
    while simulator.get_context().get_time() < end - 1e-9:
        simulator.AdvanceTo(simulator.get_context().get_time() + 0.05)
        context = station.GetMyContextFromRoot(simulator.get_context())
        q = station.GetOutputPort(f"{arm.name}.position_measured").Eval(context)
        arm.plant.SetPositions(plant_context, q)
        X_WE = arm.plant.EvalBodyPoseInWorld(plant_context, arm.end)
        turned = (X_WE.rotation() @ R_WE0.inverse()).ToAngleAxis()
        times.append(simulator.get_context().get_time())
        hand.append(X_WE.translation())
        tilt.append(turned.angle() * turned.axis()[1])


p_start = arm.start_pose().translation()
for slider, change in (("x", -0.12), ("z", -0.15), ("tilt", np.radians(30.0))):
    move(slider, change)
    run(2.5)
times, hand, tilt = np.array(times), np.array(hand), np.array(tilt)

# %% [markdown]
# The hand went where it was told, and never left the plane.

# %%
np.testing.assert_allclose(hand[-1] - p_start, [-0.12, 0.0, -0.15], atol=0.008)
assert np.ptp(hand[:, 1]) < 0.002
assert abs(tilt[-1] - np.radians(30.0)) < np.radians(2.0)

figure, axes = plt.subplots(figsize=(7, 3.8))
axes.plot(times, hand[:, [0, 2]] - p_start[[0, 2]], label=["x (m)", "z (m)"])
axes.plot(times, tilt, label="tilt (rad)")
axes.set(xlabel="t (s)", title="the hand, from where it was")
axes.legend()
save_figure(figure, "hand_in_the_plane")

# %%
picture = render(diagram, simulator.get_context(), look_at([1.5, -1.6, 0.8], [0.3, 0.0, 0.35]))
save_figure(picture, "where_it_ended")
