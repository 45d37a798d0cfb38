# %% [markdown]
# # The arm under its controller
#
# A station puts the robot's own controller between its command ports and its motors: gravity is
# compensated and joint positions are held with a given stiffness. Sent to another configuration,
# the arm follows what its guard lets pass: no faster than its joints may.

# %%
import matplotlib.pyplot as plt
import numpy as np
from pydrake.systems.analysis import Simulator

from prehensile.station import build, load_scenario
from prehensile.viz.figures import save_figure
from prehensile.viz.images import side_by_side
from prehensile.viz.render import look_at, render

station = build(load_scenario("iiwa_wsg"))
simulator = Simulator(station)
context = simulator.get_mutable_context()
q_start = station.GetOutputPort("iiwa.position_measured").Eval(context)
view = look_at([1.9, -1.6, 1.1], [0.2, 0.0, 0.4])

# %% [markdown]
# ## Nothing is commanded: it holds

# %%
simulator.AdvanceTo(1.0)
q_held = station.GetOutputPort("iiwa.position_measured").Eval(context)
assert np.max(np.abs(q_held - q_start)) < 1e-3
# The torque that holds it is what gravity takes.
plant = station.GetSubsystemByName("plant")
gravity = -plant.CalcGravityGeneralizedForces(plant.GetMyContextFromRoot(context))
arm = plant.GetModelInstanceByName("iiwa")
torque = station.GetOutputPort("iiwa.torque_measured").Eval(context)
np.testing.assert_allclose(torque, plant.GetVelocitiesFromArray(arm, gravity), atol=0.05)
before = render(station, context, view, width=480, height=420)

# %% [markdown]
# ## A jump of the command
#
# The guard refuses a first command that is far from where the arm is: something has gone wrong
# upstream. So the arm is told where it is, and then to go elsewhere.

# %%
q_goal = q_start + np.array([0.6, 0.3, -0.2, -0.4, 0.3, 0.4, 0.5])
station.GetInputPort("iiwa.position").FixValue(context, q_start)
simulator.AdvanceTo(1.1)
station.GetInputPort("iiwa.position").FixValue(context, q_goal)
times, measured, commanded, speeds = [], [], [], []
for t in np.arange(1.1, 3.1, 0.02):
    simulator.AdvanceTo(t)
    times.append(t)
    measured.append(station.GetOutputPort("iiwa.position_measured").Eval(context))
    commanded.append(station.GetOutputPort("iiwa.position_commanded").Eval(context))
    speeds.append(station.GetOutputPort("iiwa.velocity_estimated").Eval(context))
after = render(station, context, view, width=480, height=420)

# %%
limits = plant.GetVelocityUpperLimits()[:7]
assert np.all(np.abs(np.diff(commanded, axis=0)) <= 0.02 * limits + 1e-9)
print("greatest share of a limit:", np.max(np.abs(speeds) / limits))
assert np.all(np.abs(speeds) <= 1.15 * limits)  # The arm overshoots its command a little.
np.testing.assert_allclose(measured[-1], q_goal, atol=2e-3)

figure, (left, right) = plt.subplots(1, 2, figsize=(10, 3.8))
for k in range(7):
    (line,) = left.plot(times, np.array(measured)[:, k], label=f"joint {k + 1}")
    left.plot(times, np.array(commanded)[:, k], ":", color=line.get_color())
left.set(xlabel="t (s)", ylabel="rad", title="measured, and what the guard let pass (dotted)")
left.legend(fontsize="small")
right.plot(times, np.array(speeds) / limits)
right.set(xlabel="t (s)", title="velocities, as a share of their limits")
save_figure(figure, "following_a_jump")
save_figure(side_by_side([before, after]), "before_and_after")
