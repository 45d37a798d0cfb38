# %% [markdown]
# # System diagrams
#
# Everything that runs here is a Drake diagram: systems with input and output ports, wired up, and
# perhaps put into a larger diagram. This example wires a proportional-derivative controller to a
# pendulum, runs it, looks into its context, and draws it; then it draws a whole station.
# `prehensile diagram two_bins` draws any scenario, as a page whose blocks open by a click.

# %%
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from PIL import Image
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.multibody.tree import RevoluteJoint, SpatialInertia, UnitInertia
from pydrake.systems.analysis import Simulator
from pydrake.systems.controllers import PidController
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, LogVectorOutput

from prehensile.station import build, load_scenario
from prehensile.viz.diagrams import save_diagram
from prehensile.viz.figures import save_figure

mass, length, kp, kd = 1.0, 0.5, 40.0, 6.0

# %%
builder = DiagramBuilder()
plant, scene_graph = AddMultibodyPlantSceneGraph(builder, time_step=0.0)
bob = plant.AddRigidBody(
    "bob", SpatialInertia(mass, [0.0, 0.0, -length], UnitInertia.PointMass([0.0, 0.0, -length]))
)
joint = plant.AddJoint(RevoluteJoint("pin", plant.world_frame(), bob.body_frame(), [0, 1, 0]))
plant.AddJointActuator("motor", joint)
plant.Finalize()
plant.set_name("pendulum")
controller = builder.AddNamedSystem("controller", PidController([kp], [0.0], [kd]))
target = builder.AddNamedSystem("target", ConstantVectorSource([1.0, 0.0]))
builder.Connect(plant.get_state_output_port(), controller.get_input_port_estimated_state())
builder.Connect(target.get_output_port(), controller.get_input_port_desired_state())
builder.Connect(controller.get_output_port_control(), plant.get_actuation_input_port())
log = LogVectorOutput(plant.get_state_output_port(), builder)
diagram = builder.Build()
diagram.set_name("pendulum under control")

# %% [markdown]
# A diagram holds no state: that is in a context, which it makes. Ports are evaluated in a context.

# %%
simulator = Simulator(diagram)
context = simulator.get_mutable_context()
plant_context = plant.GetMyMutableContextFromRoot(context)
joint.set_angle(plant_context, 0.2)
assert plant.get_state_output_port().Eval(plant_context)[0] == 0.2
torque = controller.get_output_port_control().Eval(controller.GetMyContextFromRoot(context))
np.testing.assert_allclose(torque, kp * (1.0 - 0.2))

simulator.AdvanceTo(4.0)

# %% [markdown]
# Without an integral the pendulum stops short of the target: where gravity and spring balance,
# $k_p (1 - q) = m g l \sin q$.

# %%
q = joint.get_angle(plant_context)
np.testing.assert_allclose(kp * (1.0 - q), mass * 9.81 * length * np.sin(q), atol=1e-3)

data = log.FindLog(context)
figure, axes = plt.subplots(figsize=(7, 3.2))
axes.plot(data.sample_times(), data.data().T, label=["angle (rad)", "velocity (rad/s)"])
axes.axhline(1.0, color="0.6", linestyle=":", label="target")
axes.set(xlabel="t (s)")
axes.legend()
save_figure(figure, "pendulum_under_control")

# %% [markdown]
# ## The pictures


# %%
def picture_of(system, depth=1):
    path = save_diagram(system, Path("diagram.png"), depth=depth)
    return np.asarray(Image.open(path).convert("RGB"))


save_figure(picture_of(diagram), "diagram_of_the_pendulum")

# %%
station = build(load_scenario("iiwa_wsg"))
save_figure(picture_of(station), "diagram_of_a_station")
