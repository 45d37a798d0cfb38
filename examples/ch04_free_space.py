# %% [markdown]
# # Where a ray went, nothing is
#
# A cloud keeps the ends of a camera's rays and forgets the rest. But all the way to its end each
# ray went through nothing: together they are an obstacle, made of free space, that no object may
# enter. It decides between poses that fit the points alike. (Section 4.6.1.)

# %%
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import ListedColormap
from pydrake.geometry import Box as Solid
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.planning import RobotDiagramBuilder
from pydrake.systems.sensors import CameraInfo

from prehensile.perception import (
    Body,
    Box,
    CameraModel,
    DepthView,
    EvidenceConfig,
    PosedCamera,
    free_space_violation,
    refine_constrained,
    unproject,
)
from prehensile.perception.model_mesh import shape_mesh
from prehensile.perception.registration import HalfSpaces
from prehensile.perception.volume import Occupancy, fuse_volume
from prehensile.viz.figures import save_figure
from prehensile.viz.render import look_at, render, render_depth

# %% [markdown]
# ## A box on a table
#
# 20 cm long, 8 cm high and wide, seen from the front and above by one camera with a millimetre of
# noise.

# %%
size = np.array([0.2, 0.08, 0.08])
X_WO = RigidTransform(RollPitchYaw(0, 0, 0.0), [0, 0, 0.04])
builder = RobotDiagramBuilder(time_step=0.0)
plant = builder.plant()
world = plant.world_body()
grey, orange = np.array([0.4, 0.4, 0.42, 1.0]), np.array([0.6, 0.28, 0.05, 1.0])
plant.RegisterVisualGeometry(world, RigidTransform([0, 0, -0.01]), Solid(2, 2, 0.02), "table", grey)
plant.RegisterVisualGeometry(world, X_WO, Solid(*size), "box", orange)
plant.Finalize()
diagram = builder.Build()
context = diagram.CreateDefaultContext()
info = CameraInfo(320, 240, 300.0, 300.0, 159.5, 119.5)
X_WC = look_at([0.0, -0.55, 0.35], [0.0, 0.0, 0.04])
rng = np.random.default_rng(0)
depth = render_depth(diagram, context, X_WC, info)
seen = np.isfinite(depth)
depth[seen] += 0.001 * rng.standard_normal(seen.sum(), dtype=np.float32) * depth[seen] ** 2
view = DepthView(depth, PosedCamera(CameraModel.from_drake(info), X_WC))

# %% [markdown]
# ## Free, occupied, unknown
#
# A volume of voxels takes the image in: what lies before the measured surface is free; around it
# the signed distance along the ray is kept, up to a truncation; behind it nothing is known. The
# slice through the middle shows the camera's cone of free space and the shadow behind the box.

# %%
region = Box(RigidTransform([0.0, -0.1, 0.17]), np.array([0.5, 0.9, 0.4]))
volume = fuse_volume(view, region, 0.005)
y, z = np.meshgrid(np.linspace(-0.54, 0.34, 221), np.linspace(-0.02, 0.36, 96))
slab = np.column_stack([np.zeros(y.size), y.ravel(), z.ravel()])
state = volume.occupancy_at(slab)
distance = volume.distance_at(slab)
assert volume.occupancy_at([[0, -0.3, 0.2]])[0] == Occupancy.FREE
assert volume.occupancy_at([[0, -0.04, 0.04]])[0] == Occupancy.OCCUPIED
assert volume.occupancy_at([[0, 0.1, 0.02]])[0] == Occupancy.UNKNOWN  # In the shadow.
assert abs(volume.distance_at([[0, -0.045, 0.05]])[0] - 0.005) < 0.004  # 5 mm before the front.

fig, axes = plt.subplots(1, 3, figsize=(14, 3.4), width_ratios=(1, 1.3, 1.3))
axes[0].imshow(render(diagram, context, X_WC, fov_y=0.76))
axes[0].axis("off")
shades = ListedColormap(["0.8", "white", "tab:orange"])
axes[1].pcolormesh(y, z, state.reshape(y.shape), cmap=shades, vmin=-1.5, vmax=1.5)
axes[1].set(title="grey: unknown, white: free", aspect="equal", xlabel="y [m]", ylabel="z [m]")
shown = axes[2].pcolormesh(y, z, distance.reshape(y.shape), cmap="RdBu", vmin=-0.02, vmax=0.02)
axes[2].contour(y, z, distance.reshape(y.shape), [0.0], colors="black", linewidths=1)
axes[2].set(title="signed distance [m]", aspect="equal", xlabel="y [m]")
fig.colorbar(shown, ax=axes[2], shrink=0.7)
for ax in axes[1:]:
    outline = np.array([[-0.04, 0], [-0.04, 0.08], [0.04, 0.08], [0.04, 0], [-0.04, 0]])
    ax.plot(*outline.T, "--", color="tab:green", lw=1)
fig.tight_layout()
save_figure(fig, "volume")

# %% [markdown]
# ## Points fit, rays object
#
# Say that only the middle of the box was segmented, its ends cut off. Then the box can slide along
# itself, and the points lie on its front and top all the same. But slid by 6 cm, one of its ends
# would be where the camera saw the table behind it.

# %%
p_C = unproject(depth, view.camera.model).reshape(-1, 3)
p_W = (X_WC @ p_C[np.isfinite(p_C).all(axis=1)].T).T
segment = p_W[(p_W[:, 2] > 0.012) & (np.abs(p_W[:, 0]) < 0.04)]
body = Body.from_mesh(shape_mesh(Solid(*size)))
assert body.corners is not None


def misfit(X):
    """Mean distance of the segment's points from the surface [m]."""
    return np.abs(body.field.at((X.inverse() @ segment.T).T).distances).mean()


slides = np.linspace(-0.1, 0.1, 41)
poses = [RigidTransform(X_WO.rotation(), X_WO.translation() + [s, 0, 0]) for s in slides]
surfaces = np.array([(X @ body.points.T).T for X in poses])
violation = free_space_violation(surfaces, view, margin=0.01)
in_free = (violation > 0).mean(axis=1)
misfits = np.array([misfit(X) for X in poses])
within = np.abs(slides) < 0.055
assert np.ptp(misfits[within]) < 0.0003  # The points have no preference;
assert in_free[np.abs(slides) < 0.004].max() < 0.02  # the rays do.
assert in_free[np.abs(slides) > 0.045].min() > 0.1

fig, axes = plt.subplots(1, 3, figsize=(14, 3.6), width_ratios=(1, 1, 1.3))
K = CameraInfo(640, 480, 0.76).intrinsic_matrix()
for ax, k in zip(axes, (20, 32), strict=False):
    p = np.asarray(X_WC.inverse() @ surfaces[k].T).T
    at = (p[:, :2] / p[:, 2:]) @ K[:2, :2].T + K[:2, 2]
    ax.imshow(render(diagram, context, X_WC, fov_y=0.76))
    ax.scatter(*at.T, s=6, c=np.where(violation[k] > 0, "red", "lime"))
    ax.set(title=f"slid by {1e3 * slides[k]:.0f} mm", xlim=(120, 520), ylim=(380, 120))
    ax.axis("off")
axes[2].plot(1e3 * slides, 1e3 * misfits, label="distance of the points [mm]")
axes[2].plot(1e3 * slides, 100 * in_free, label="of the surface in free space [%]")
axes[2].set(xlabel="slid by [mm]", ylim=(-1, 45))
axes[2].legend()
fig.tight_layout()
save_figure(fig, "slide")

# %% [markdown]
# ## In the optimization
#
# The refinement takes both kinds of knowledge as they are: free space as a price, since single rays
# err; the table as a constraint, since nothing is inside it. From a start that is slid by 5 cm and
# sunk into the table, with points alone the box slides until its end reaches those points, and
# stays sunk. With rays it comes back, and it rests on the table. (The covariance is still that of
# the points: at the end no ray objects any more, so the status says that they leave a motion free.)

# %%
guess = RigidTransform(RollPitchYaw(0.05, 0.0, 0.1), [0.05, 0.005, 0.03])
table = HalfSpaces(np.array([[0.0, 0.0, 1.0]]), np.zeros(1))
config = EvidenceConfig(noise=0.001)
sunk = segment - [0, 0, 0.004]  # A camera calibrated 4 mm too low.
alone = refine_constrained(sunk, body, guess, config=config)
both = refine_constrained(sunk, body, guess, half_spaces=table, views=view, config=config)
for name, result in (("points alone", alone), ("with rays and table", both)):
    assert result.X_WO is not None
    slid, lowest = result.X_WO.translation()[0], (result.X_WO @ body.corners.T)[2].min()
    print(f"{name}: slid by {1e3 * slid:.1f} mm, lowest corner at {1e3 * lowest:.1f} mm")
assert alone.X_WO is not None
assert both.X_WO is not None
assert abs(alone.X_WO.translation()[0]) > 0.03
assert (alone.X_WO @ body.corners.T)[2].min() < -0.002
assert abs(both.X_WO.translation()[0]) < 0.01
assert (both.X_WO @ body.corners.T)[2].min() > -1e-4
