# %% [markdown]
# # An arm with a hand of many joints
#
# An iiwa carries an Allegro hand: seven joints and sixteen. The arm traces a square and turns the
# hand on the way, the hand closes and opens twice. Each has a controller of its own: the arm's is
# the one of its maker, which is told the hand's weight; a stiffness holds each joint of the hand.
# (Section 2.3; `prehensile demo iiwa-allegro` shows it.)

# %%
import matplotlib.pyplot as plt
import numpy as np
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import TrajectorySource

from prehensile.models.registry import find_model, package_map
from prehensile.station import build, load_scenario
from prehensile.tasks.gallery_motions import HOLD
from prehensile.tasks.gallery_pairs import CLOSED, OPEN, iiwa_allegro
from prehensile.viz.figures import save_figure
from prehensile.viz.images import side_by_side
from prehensile.viz.render import look_at, render

show = iiwa_allegro()
tracks = {track.model: track for track in show.tracks}
builder = DiagramBuilder()
station = builder.AddSystem(build(load_scenario("iiwa_allegro")))
for name, track in tracks.items():
    source = builder.AddSystem(TrajectorySource(track.trajectory))
    builder.Connect(source.get_output_port(), station.GetInputPort(f"{name}.position"))
diagram = builder.Build()
simulator = Simulator(diagram)
root = simulator.get_mutable_context()
context = station.GetMyMutableContextFromRoot(root)
plant = station.GetSubsystemByName("plant")
plant_context = plant.GetMyMutableContextFromRoot(root)
hand = plant.GetModelInstanceByName("allegro")
FINGERS = {"index": 3, "middle": 7, "ring": 11, "thumb": 15}
tips = [plant.GetFrameByName(f"link_{k}_tip", hand) for k in FINGERS.values()]
palm = plant.GetFrameByName("hand_root", hand)

# %% [markdown]
# ## The run

# %%
end = max(track.trajectory.end_time() for track in tracks.values())
times, errors, p_HTips, p_WTips, pictures = [], {name: [] for name in tracks}, [], [], []
commanded = []
shots = list(HOLD + np.array([0.0, 0.25, 0.5, 0.75]) * (end - HOLD))
view = look_at([1.6, 0.7, 0.9], [0.25, 0.0, 0.4])
for t in np.append(np.arange(0.0, end, 0.05), end + 0.3):
    simulator.AdvanceTo(t)
    times.append(t)
    for name, track in tracks.items():
        q = station.GetOutputPort(f"{name}.position_measured").Eval(context)
        errors[name].append(q - track.value(t))
    commanded.append(tracks["allegro"].value(t))
    X_HW = palm.CalcPoseInWorld(plant_context).inverse()
    at = [tip.CalcPoseInWorld(plant_context).translation() for tip in tips]
    p_WTips.append(at)
    p_HTips.append([X_HW @ p for p in at])
    if shots and t >= shots[0] - 0.02:
        shots.pop(0)
        pictures.append(render(diagram, root, view, width=320, height=340))
save_figure(side_by_side(pictures), "closing_on_the_way")
times, p_HTips, p_WTips = (np.array(rows) for rows in (times, p_HTips, p_WTips))
errors = {name: np.array(rows) for name, rows in errors.items()}

# %% [markdown]
# ## Held, and followed
#
# Both hold still for a second before they move. Then the farthest joint of the arm lags by
# 12 mrad and that of the hand by 24 mrad. What a joint of the hand lags by is what its stiffness
# needs to take the finger along.

# %%
still = times < HOLD
for name, error in errors.items():
    worst = 1e3 * np.abs(error).max(axis=1)
    print(f"{name}: holds within {worst[still].max():.3f}, follows within {worst.max():.1f}, "
          f"ends within {worst[-1]:.3f} mrad")  # fmt: skip
    assert worst[still].max() < 0.5
    assert 1.0 < worst.max() < 40.0
    assert worst[-1] < 1.0

commanded = np.array(commanded)
measured = commanded + errors["allegro"]
lower, upper = (
    plant.GetPositionsFromArray(hand, limits)
    for limits in (plant.GetPositionLowerLimits(), plant.GetPositionUpperLimits())
)
assert np.all((measured > lower) & (measured < upper))
# It did close, twice, and open again.
share = (measured - OPEN) @ (CLOSED - OPEN) / np.sum((CLOSED - OPEN) ** 2)
closed = share > 0.97
assert np.sum(np.diff(closed.astype(int)) == 1) == 2
assert share[0] < 1e-3
assert share[-1] < 1e-3

figure, (left, right) = plt.subplots(1, 2, figsize=(10, 3.6), layout="constrained")
for k, name in ((1, "index, first bend"), (2, "second"), (3, "third"), (12, "thumb, base")):
    (line,) = left.plot(times, np.degrees(measured[:, k]), label=name)
    left.plot(times, np.degrees(commanded[:, k]), "k:", linewidth=1)
left.set(xlabel="t (s)", ylabel="°", title="measured, and commanded (dotted)")
left.legend(fontsize="small")
for name, error in errors.items():
    right.plot(times, 1e3 * np.abs(error).max(axis=1), label=name)
right.set(xlabel="t (s)", ylabel="mrad", title="farthest joint from its command")
right.legend(fontsize="small")
save_figure(figure, "held_and_commanded")

# %% [markdown]
# ## Where the tips go
#
# Seen from the palm the motion of the arm drops out. What is left is the forward kinematics of the
# hand alone, at the measured angles to rounding, and at the commanded ones to the millimetres that
# the lag makes.

# %%
alone = MultibodyPlant(0.0)
parser = Parser(alone)
parser.package_map().AddMap(package_map())
parser.AddModels(url=find_model("allegro_right").url)
alone.WeldFrames(alone.world_frame(), alone.GetFrameByName("hand_root"))
alone.Finalize()
alone_context = alone.CreateDefaultContext()


def tips_at(q):
    """(4, 3) places of the tips in the palm's frame by the kinematics of the hand alone."""
    alone.SetPositions(alone_context, q)
    frames = [alone.GetFrameByName(tip.name()) for tip in tips]
    return [frame.CalcPoseInWorld(alone_context).translation() for frame in frames]


np.testing.assert_allclose(p_HTips, [tips_at(q) for q in measured], atol=1e-9)
lag = np.linalg.norm(p_HTips - [tips_at(q) for q in commanded], axis=2)
print("tips behind their commands, at most, in mm:", np.round(1e3 * lag.max(axis=0), 1))
# A tip is no farther from the joints that bend it than a finger is long, and three of them bend it.
assert lag.max() < 3 * 0.2 * np.abs(errors["allegro"]).max()

figure = plt.figure(figsize=(10, 4))
side, space = figure.add_subplot(1, 2, 1), figure.add_subplot(1, 2, 2, projection="3d")
for k, name in enumerate(FINGERS):
    (line,) = side.plot(100 * p_HTips[:, k, 0], 100 * p_HTips[:, k, 2], label=name)
    space.plot(*(p_WTips[:, k].T), color=line.get_color(), label=name)
side.plot(0.0, 0.0, "ks")
side.annotate("root", (0.0, 0.0), (6, -2), textcoords="offset points")
side.set(xlabel="x out of the palm (cm)", ylabel="z along it (cm)", title="seen from the palm")
side.set_aspect("equal")
space.set(xlabel="x (m)", ylabel="y (m)", zlabel="z (m)", title="in the world")
space.xaxis.set_major_locator(plt.MaxNLocator(3))
space.legend(fontsize="small")
save_figure(figure, "paths_of_the_tips")
# Fingers bend in their own planes: the middle one's tip stays in that of x and z.
assert np.max(np.abs(p_HTips[:, 1, 1])) < 2e-3
assert np.all(p_HTips[share > 0.9][:, :3, 0] > 0.03)  # Closed, the tips are before the palm.
assert np.max(np.ptp(p_WTips, axis=0)[:, 1]) > 0.4  # And the arm took them along.
