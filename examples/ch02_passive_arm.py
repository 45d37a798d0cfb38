# %% [markdown]
# # An arm that nobody holds
#
# An iiwa whose motors do nothing falls, here until just before its second joint hits its stop.
# With the joints' friction left out its energy stays what it was. In Drake's discrete mode, which
# is made for contact, a little of it is lost at each step, less with shorter steps.

# %%
import matplotlib.pyplot as plt
import numpy as np
from pydrake.multibody.parsing import Parser
from pydrake.planning import RobotDiagramBuilder
from pydrake.systems.analysis import Simulator

from prehensile.models.registry import find_model, package_map
from prehensile.viz.figures import save_figure
from prehensile.viz.images import side_by_side
from prehensile.viz.render import look_at, render

Q_START = np.array([0.0, 0.6, 0.0, -1.2, 0.0, 0.9, 0.0])


def fall(time_step, seconds=0.6):
    """Lets the arm go; returns the diagram, times, energies and joint positions."""
    builder = RobotDiagramBuilder(time_step=time_step)
    plant = builder.plant()
    parser = Parser(plant)
    parser.package_map().AddMap(package_map())
    (arm,) = parser.AddModels(url=find_model("iiwa7").url)
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("iiwa_link_0", arm))
    for index in plant.GetJointIndices(arm):
        joint = plant.get_joint(index)
        if joint.num_velocities() == 1:
            joint.set_default_damping_vector([0.0])
    plant.Finalize()
    diagram = builder.Build()
    simulator = Simulator(diagram)
    context = simulator.get_mutable_context()
    plant_context = plant.GetMyMutableContextFromRoot(context)
    plant.SetPositions(plant_context, Q_START)
    plant.get_actuation_input_port().FixValue(plant_context, np.zeros(7))
    times, energies, positions, pictures = [], [], [], []
    for t in np.arange(0.0, seconds + 1e-9, 0.025):
        simulator.AdvanceTo(t)
        # The mass matrix counts the rotors of the motors too.
        v, M = plant.GetVelocities(plant_context), plant.CalcMassMatrix(plant_context)
        energies.append(0.5 * v @ M @ v + plant.EvalPotentialEnergy(plant_context))
        times.append(t)
        positions.append(plant.GetPositions(plant_context))
        if len(times) % 8 == 1 and time_step == 0.0:
            view = look_at([1.9, -1.6, 0.9], [0.2, 0.0, 0.4])
            pictures.append(render(diagram, context, view, width=420, height=400))
    return np.array(times), np.array(energies), np.array(positions), pictures


# %% [markdown]
# ## Continuous time
#
# The integrator controls its error, and the energy stays.

# %%
t, energy, q, pictures = fall(0.0)
assert np.ptp(energy) < 1e-2
assert np.max(np.abs(q[-1] - Q_START)) > 0.5  # It did move.
save_figure(side_by_side(pictures), "falling")

# %% [markdown]
# ## Discrete time
#
# The same with steps of 4, 2 and 1 ms: the error is of first order in the step.

# %%
figure, (left, right) = plt.subplots(1, 2, figsize=(10, 3.8))
left.plot(t, np.degrees(q), label=[f"joint {k + 1}" for k in range(7)])
left.set(xlabel="t (s)", ylabel="°", title="joint positions")
left.legend(fontsize="small")
right.plot(t, energy - energy[0], label="continuous")
errors = []
for step in (0.004, 0.002, 0.001):
    _, discrete_energy, _, _ = fall(step)
    errors.append(np.max(np.abs(discrete_energy - energy[0])))
    right.plot(t, discrete_energy - energy[0], label=f"{1e3 * step:g} ms")
right.set(xlabel="t (s)", ylabel="J", title="energy that came or went")
right.legend()
save_figure(figure, "energy")
assert errors[0] > errors[1] > errors[2]
assert 1.5 < errors[1] / errors[2] < 2.5
