# %% [markdown]
# # Joint teleoperation
#
# Instead of the pose of the hand, each joint gets a slider: `prehensile teleop iiwa_wsg --mode
# joints` for people. Nothing else of the diagram changes, for the arm's command port takes joint
# positions anyway. (Exercise 2.3.)

# %%
import matplotlib.pyplot as plt
import numpy as np
from pydrake.systems.analysis import Simulator

from prehensile.station import build, load_scenario
from prehensile.station.teleop import find_arm, teleoperate
from prehensile.viz.figures import save_figure
from prehensile.viz.images import side_by_side
from prehensile.viz.meshcat import start_meshcat
from prehensile.viz.render import look_at, render

scenario = load_scenario("iiwa_wsg")
station = build(scenario)
arm = find_arm(station, scenario)
meshcat = start_meshcat()
diagram = teleoperate(station, scenario, meshcat, mode="joints")
simulator = Simulator(diagram)
simulator.Initialize()
labels = [label for label in meshcat.GetSliderNames() if label.startswith("iiwa_joint")]
assert len(labels) == 7
print(labels)

# %% [markdown]
# Turn joint 1 by 40°, and ask joint 4 for far more than its limit: a slider ends where its joint
# does.

# %%
meshcat.SetSliderValue(labels[0], arm.q0[0] + np.radians(40.0))
meshcat.SetSliderValue(labels[3], -10.0)
asked = [meshcat.GetSliderValue(label) for label in labels]
lower = arm.plant.GetPositionLowerLimits()
assert abs(asked[3] - lower[3]) < 0.02  # to a step of the slider

view = look_at([1.9, -1.6, 1.1], [0.2, 0.0, 0.4])
pictures = [render(diagram, simulator.get_context(), view, width=480, height=420)]
times, positions = [], []
station_context = station.GetMyContextFromRoot(simulator.get_context())
measured = station.GetOutputPort("iiwa.position_measured")
for t in np.arange(0.05, 4.0, 0.05):
    simulator.AdvanceTo(t)
    times.append(t)
    positions.append(measured.Eval(station_context))
pictures.append(render(diagram, simulator.get_context(), view, width=480, height=420))

# %%
np.testing.assert_allclose(positions[-1], np.maximum(asked, lower), atol=0.01)
assert np.all(np.array(positions) >= lower - 1e-3)
# The joints that nobody touched stayed where they were.
others = [1, 2, 4, 5, 6]
assert np.max(np.abs(np.array(positions) - arm.q0)[:, others]) < 0.01

figure, axes = plt.subplots(figsize=(7, 3.4))
axes.plot(times, np.degrees(positions), label=[f"joint {k + 1}" for k in range(7)])
axes.axhline(np.degrees(lower[3]), color="0.6", linestyle=":", label="limit of joint 4")
axes.set(xlabel="t (s)", ylabel="°")
axes.legend(fontsize="small", ncols=2, loc="center right")
save_figure(figure, "joints")
save_figure(side_by_side(pictures), "before_and_after")
