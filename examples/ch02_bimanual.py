# %% [markdown]
# # Two arms lift a box
#
# The box is too wide for either hand. Two arms press it between their fingers, lift it, carry it
# forwards while they tip it, and put it back. One arm's motion is planned; the other one's is its
# mirror image. (Example 2.7; `prehensile demo bimanual` shows it.)

# %%
import matplotlib.pyplot as plt
import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import TrajectorySource

from prehensile.station import build
from prehensile.tasks.gallery_pairs import BOX_SIZE, MIRROR, bimanual
from prehensile.viz.figures import save_figure
from prehensile.viz.images import side_by_side
from prehensile.viz.render import look_at, render

show = bimanual()
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
box = plant.GetBodyByName("base_link", plant.GetModelInstanceByName("cracker_box"))
hands = [
    plant.GetBodyByName("body", plant.GetModelInstanceByName(f"wsg_{side}"))
    for side in ("left", "right")
]

# %% [markdown]
# ## Mirrored motions
#
# The plane between the arms is $y = 0$. An iiwa's mirror image is again an iiwa with the odd joints
# turned the other way: their axes lie in the plane that halves the arm, those of the even ones
# are normal to it.

# %%
end = tracks["iiwa_left"].trajectory.end_time()
for t in np.linspace(0.0, end, 7):
    q = tracks["iiwa_left"].value(t)
    np.testing.assert_allclose(tracks["iiwa_right"].value(t), MIRROR * q)
    at = []
    scratch = plant.CreateDefaultContext()
    for side, hand, signs in zip(("left", "right"), hands, (1.0, MIRROR), strict=True):
        plant.SetPositions(scratch, plant.GetModelInstanceByName(f"iiwa_{side}"), signs * q)
        at.append(plant.EvalBodyPoseInWorld(scratch, hand).translation())
    np.testing.assert_allclose(at[0] * [1.0, -1.0, 1.0], at[1], atol=1e-9)


# %% [markdown]
# ## The run
#
# What pushes on the box is read from the contact results.


# %%
def push_on_box():
    """Force (N) on the box by all that touches it, and how hard its sides are pressed."""
    results = plant.get_contact_results_output_port().Eval(plant_context)
    inspector = station.GetSubsystemByName("scene_graph").model_inspector()
    total, pressed = np.zeros(3), 0.0
    for k in range(results.num_hydroelastic_contacts()):
        info = results.hydroelastic_contact_info(k)
        surface = info.contact_surface()
        owners = [
            plant.GetBodyFromFrameId(inspector.GetFrameId(g))
            for g in (surface.id_M(), surface.id_N())
        ]
        if box in owners:
            # The force is given as it acts on the first of the two.
            force = info.F_Ac_W().translational() * (1.0 if owners[0] == box else -1.0)
            total += force
            pressed += abs(force[1])
    for k in range(results.num_point_pair_contacts()):
        info = results.point_pair_contact_info(k)
        if box.index() in (info.bodyA_index(), info.bodyB_index()):
            total += info.contact_force() * (1.0 if info.bodyB_index() == box.index() else -1.0)
            pressed += abs(info.contact_force()[1])
    return total, pressed


arms = ("iiwa_left", "iiwa_right")
view = look_at([1.45, -0.9, 0.95], [-0.1, 0.0, 0.26])
times, errors, boxes, offsets, forces, pictures = [], [], [], [], [], []
shots = [3.3, 4.5, 5.8, 9.0]
for t in np.arange(0.0, 9.0 + 1e-9, 0.05):  # The arms' way home is left out.
    simulator.AdvanceTo(t)
    times.append(t)
    errors.append(
        [
            np.max(np.abs(station.GetOutputPort(f"{a}.position_measured").Eval(context)
                          - tracks[a].value(t)))
            for a in arms
        ]
    )  # fmt: skip
    boxes.append(plant.EvalBodyPoseInWorld(plant_context, box))
    p_left, p_right = (
        plant.EvalBodyPoseInWorld(plant_context, hand).translation() for hand in hands
    )
    offsets.append(np.linalg.norm(p_left * [1.0, -1.0, 1.0] - p_right))
    forces.append(push_on_box())
    if shots and t >= shots[0] - 1e-9:
        shots.pop(0)
        pictures.append(render(diagram, root, view, width=320, height=340))
save_figure(side_by_side(pictures), "lifted_tipped_put_back")
times, errors = np.array(times), np.array(errors)
heights = np.array([X_WBox.translation()[2] for X_WBox in boxes])
tips = np.array([np.arccos(min(1.0, X_WBox.rotation().matrix()[2, 2])) for X_WBox in boxes])

# %% [markdown]
# ## How well?
#
# Both arms follow alike, and the hands stay mirror images of each other although nothing tells one
# arm where the other one is.

# %%
total, pressed = (np.array(values) for values in zip(*forces, strict=True))
lifted = (heights > 0.5 * BOX_SIZE[2] + 0.005) & (pressed > 1.0)
print(f"farthest from the commanded joint angles: {1e3 * errors.max():.1f} mrad")
print(f"farthest from symmetry: {1e3 * max(offsets):.2f} mm")
print(f"lifted by {100 * np.ptp(heights):.1f} cm, tipped by {np.degrees(tips.max()):.1f}°")
assert errors.max() < 0.02
np.testing.assert_allclose(errors[:, 0], errors[:, 1], atol=1e-3)
assert max(offsets) < 1e-3
assert heights.max() - 0.5 * BOX_SIZE[2] > 0.2
assert abs(tips.max() - 0.35) < 0.02  # as planned
# It stands where it stood.
p_WBox = boxes[-1].translation()
np.testing.assert_allclose(p_WBox, [0.2, 0.0, 0.5 * BOX_SIZE[2]], atol=5e-3)
assert tips[-1] < 0.01

figure, (left, right) = plt.subplots(1, 2, figsize=(10, 3.4), layout="constrained")
for name, column, style in zip(arms, errors.T, ("-", ":"), strict=True):
    left.plot(times, 1e3 * column, style, label=name)
left.plot(times, 1e4 * np.array(offsets), color="0.6", label="asymmetry, 0.1 mm")
left.set(xlabel="t (s)", ylabel="mrad", title="farthest joint from its command")
left.legend(fontsize="small")
right.plot(times, 100 * (heights - heights[1]), label="lifted (cm)")
right.plot(times, np.degrees(tips), label="tipped (°)")
right.set(xlabel="t (s)", title="the box")
right.legend(fontsize="small")
save_figure(figure, "errors_and_the_box")

# %% [markdown]
# ## What holds the box
#
# Nothing but friction: each hand is sent 4 mm into the box, which presses the pads on it. While
# the box is in the air, what pushes it up is its weight, $m (g + a)$; friction can do as long as
# the pull along a pad is less than the friction coefficient times the pressure.

# %%
GRAVITY = 9.81
weight = GRAVITY * box.default_mass()
up = total[:, 2]
print(f"weight {weight:.2f} N, pushed up by {up[lifted].mean():.2f} N on average")
print(f"pressed with {0.5 * pressed[lifted].mean():.0f} N on each side")
assert abs(up[lifted].mean() / weight - 1.0) < 0.01
assert np.all(np.abs(up[lifted] - weight) < 0.15 * weight)  # It is moved gently.
needed = np.linalg.norm(total[lifted][:, [0, 2]], axis=1) / pressed[lifted]
print(f"friction coefficient that this takes: {needed.max():.3f}")
assert needed.max() < 0.1

figure, (left, right) = plt.subplots(1, 2, figsize=(10, 3.2), layout="constrained")
left.plot(times, up, label="upwards")
left.axhline(weight, color="0.5", linestyle=":", label="weight")
left.set(xlabel="t (s)", ylabel="N", title="all that touches the box", ylim=(3.0, 5.0))
left.legend(fontsize="small")
right.plot(times, 0.5 * pressed)
right.set(xlabel="t (s)", ylabel="N", title="pressed from each side")
save_figure(figure, "forces_on_the_box")
