# %% [markdown]
# # Probing the ports of a station
#
# A station shows the ports that the real robot's drivers show; with `hardware=True` the same ports
# lead to the real one. What only a simulation can know has names that begin with `cheat.`.
# (Exercise 2.2.)

# %%
import matplotlib.pyplot as plt
import numpy as np
from pydrake.systems.analysis import Simulator

from prehensile.station import build, load_scenario
from prehensile.viz.figures import save_figure
from prehensile.viz.images import colorize_depth, side_by_side

station = build(load_scenario("pick_brick"))
inputs = [station.get_input_port(k).get_name() for k in range(station.num_input_ports())]
outputs = [station.get_output_port(k).get_name() for k in range(station.num_output_ports())]
print("inputs: ", *inputs, sep="\n  ")
print("outputs:", *outputs, sep="\n  ")
assert {"iiwa.position", "wsg.position"} <= set(inputs)
assert {"iiwa.position_measured", "iiwa.velocity_estimated", "wsg.state_measured"} <= set(outputs)

# %% [markdown]
# ## (a) Reading a port
#
# A port is evaluated in a context. The arm's positions are where its model puts them.

# %%
simulator = Simulator(station)
context = simulator.get_mutable_context()
plant = station.GetSubsystemByName("plant")
plant_context = plant.GetMyContextFromRoot(context)
arm = plant.GetModelInstanceByName("iiwa")


def read(port):
    return station.GetOutputPort(port).Eval(context)


np.testing.assert_allclose(
    read("iiwa.position_measured"), plant.GetPositions(plant_context, arm), atol=1e-9
)
np.testing.assert_allclose(read("iiwa.velocity_estimated"), 0.0, atol=1e-9)

# %% [markdown]
# ## (b) What the ports mean
#
# Command the arm to go 0.3 rad with its first joint and the hand to close to 4 cm, and watch:
# commanded positions are what the guard passes on; measured ones follow; the external torque is
# what the arm feels beside gravity and its own motion, nothing here.

# %%
q = read("iiwa.position_measured")
station.GetInputPort("iiwa.position").FixValue(context, q)
station.GetInputPort("wsg.position").FixValue(context, [0.1])
simulator.AdvanceTo(0.1)
station.GetInputPort("iiwa.position").FixValue(context, q + [0.3, 0, 0, 0, 0, 0, 0])
station.GetInputPort("wsg.position").FixValue(context, [0.04])
names = ("iiwa.position_commanded", "iiwa.position_measured", "iiwa.velocity_estimated")
times, joint_1, widths = [], [], []
for t in np.arange(0.1, 1.6, 0.02):
    simulator.AdvanceTo(t)
    times.append(t)
    joint_1.append([read(name)[0] for name in names])
    widths.append(read("wsg.state_measured")[0])
joint_1 = np.array(joint_1)
assert np.isclose(joint_1[-1, 1], q[0] + 0.3, atol=1e-3)
assert np.isclose(widths[-1], 0.04, atol=2e-3)
# The velocity is the derivative of the position.
slope = np.gradient(joint_1[:, 1], times)
assert np.max(np.abs(slope - joint_1[:, 2])[2:-2]) < 0.1

figure, (left, right) = plt.subplots(1, 2, figsize=(10, 3.6))
left.plot(times, joint_1, label=["commanded (rad)", "measured (rad)", "velocity (rad/s)"])
left.set(xlabel="t (s)", title="joint 1")
left.legend()
right.plot(times, 1e3 * np.array(widths))
right.set(xlabel="t (s)", ylabel="mm", title="opening of the hand")
save_figure(figure, "commanded_and_measured")

# %% [markdown]
# A camera's ports are images; they are rendered when they are asked for.

# %%
color, depth = read("camera0.rgb_image").data, read("camera0.depth_image").data
assert color.shape[:2] == depth.shape[:2]
save_figure(side_by_side([color[:, :, :3], colorize_depth(depth)]), "what_the_camera_sees")
