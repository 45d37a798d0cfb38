# %% [markdown]
# # Depth noise and missed returns
#
# Real depth images are not the ideal ones with a little Gaussian noise on top. An active-stereo
# camera such as the D415 compares two pictures, and goes wrong where comparing goes wrong: it is
# imprecise far away, beside itself at edges, and blind where a surface is grazed, dark or glaring.
# Here ideal images go through a model of that. (Section 4.1.3.)

# %%
import dataclasses as dc

import matplotlib.pyplot as plt
import numpy as np

from prehensile.perception import (
    CameraModel,
    DepthConfig,
    DepthNoiseConfig,
    add_depth_noise,
    normals_from_depth,
)
from prehensile.perception.depth_noise import axial_sigma, incidence
from prehensile.station.build import build
from prehensile.station.cameras import d415_camera_config
from prehensile.station.scenario_file import loads_scenario
from prehensile.viz.figures import save_figure
from prehensile.viz.images import colorize_depth
from prehensile.viz.render import look_at

SCENE = """
directives:
- add_model: {name: table, file: package://prehensile/table/table.sdf}
- add_weld: {parent: world, child: table::base_link}
- add_model:
    name: mustard
    file: package://prehensile/mustard_bottle/mustard_bottle.sdf
    default_free_body_pose:
        base_link: {translation: [-0.06, 0, 0.0955], rotation: !Rpy {deg: [0, 0, 65]}}
- add_model:
    name: mug
    file: package://prehensile/mug/mug.sdf
    default_free_body_pose:
        base_link: {translation: [0.1, -0.08, 0.05], rotation: !Rpy {deg: [0, 0, 0]}}
- add_model:
    name: can
    file: package://prehensile/tomato_soup_can/tomato_soup_can.sdf
    default_free_body_pose:
        base_link: {translation: [0.12, 0.1, 0.051], rotation: !Rpy {deg: [0, 0, 0]}}
"""

# %% [markdown]
# ## A picture of it
#
# Middle: the depth that a perfect sensor would return. Right: what comes out of the model, missed
# returns in red. They line the left sides of things, which only one of the two imagers sees, and
# the rims that turn away.

# %%
camera_config = d415_camera_config("eye", look_at([0.1, -0.6, 0.4], [0.03, 0, 0.06]))
station = build(dc.replace(loads_scenario(SCENE), cameras={"eye": camera_config}))
context = station.CreateDefaultContext()
color = station.GetOutputPort("eye.rgb_image").Eval(context).data[:, :, :3]
ideal = station.GetOutputPort("eye.depth_image").Eval(context).data[:, :, 0]
focal, (cu, cv) = camera_config.focal_x(), camera_config.principal_point()
camera = CameraModel(640, 480, focal, focal, cu, cv)

noise = DepthNoiseConfig()
noisy = add_depth_noise(ideal, camera.K, noise, np.random.default_rng(0), color)
known = (ideal > noise.min_depth) & (ideal < noise.max_depth)
missed = known & (noisy == 0)

picture = colorize_depth(np.where(np.isfinite(noisy), noisy, 0), 0.4, 1.5)
picture[missed] = [220, 30, 30]
fig, axes = plt.subplots(1, 3, figsize=(12, 3.2))
shown = (color, colorize_depth(np.where(np.isfinite(ideal), ideal, 0), 0.4, 1.5), picture)
for ax, image, title in zip(axes, shown, ("colour", "true depth", "returned"), strict=True):
    ax.imshow(image)
    ax.set_title(title)
    ax.set_axis_off()
fig.tight_layout()
save_figure(fig, "missed_returns")

# %% [markdown]
# The model knows why each return is missed; from the outside, it shows in the statistics.

# %%
angle = incidence(np.where(np.isfinite(ideal) & (ideal > 0), 1 / ideal, 0), camera.K)
steep = known & (angle > np.deg2rad(83))
calm = known & (angle < np.deg2rad(60))
calm[:, :120] = False  # The left band, which the right imager does not see.
near = np.minimum(ideal, 5)  # The nothing beyond the table is infinitely far.
jump = np.abs(np.diff(near, axis=1, append=near[:, -1:])) > 0.05
edge = known & (jump | np.roll(jump, 1, axis=1))
rate = {
    "grazed": missed[steep].mean(),
    "beside an edge": missed[edge].mean(),
    "elsewhere": missed[calm & ~edge].mean(),
}
assert rate["grazed"] > 0.5
assert rate["beside an edge"] > 3 * rate["elsewhere"]

# %% [markdown]
# ## Noise that grows with the square of the range
#
# What is measured is the disparity $d = f b / z$ between the two pictures, $f$ being the focal
# length and $b$ the distance of the imagers, and its error $\sigma_d$ is some hundredths of a
# pixel at any range. Then $z = f b / d$ is off by
#
# $$ \sigma_z = \left| \frac{\partial z}{\partial d} \right| \sigma_d = \frac{z^2}{f b} \sigma_d $$
#
# which is half a millimetre at half a metre and five of them at one and a half. Walls at various
# distances, looked at squarely:

# %%
rng = np.random.default_rng(1)
far_sighted = dc.replace(noise, max_depth=4.0)
ranges = np.array([0.4, 0.5, 0.65, 0.8, 1.0, 1.25, 1.5, 2.0, 2.5, 3.0])
measured = []
for z in ranges:
    wall = add_depth_noise(np.full((480, 640), z), camera.K, far_sighted, rng)[:, 100:]
    measured.append(wall[np.isfinite(wall) & (wall > 0)].std())
measured = np.array(measured)
stated = axial_sigma(ranges, camera.K, noise)
power, intercept = np.polyfit(np.log(ranges), np.log(measured), 1)
assert abs(power - 2) < 0.1
np.testing.assert_allclose(measured, stated, rtol=0.15)

fig, axes = plt.subplots(1, 2, figsize=(10, 3.4))
z = np.geomspace(0.35, 3.2)
axes[0].loglog(z, 1000 * axial_sigma(z, camera.K, noise), label="stated")
axes[0].loglog(ranges, 1000 * measured, "o", label=f"measured, ~ z^{power:.2f}")
axes[0].set(xlabel="z [m]", ylabel="σ [mm]", title="axial noise")
axes[0].set_xticks([0.5, 1, 2, 3], ["0.5", "1", "2", "3"])
axes[0].set_yticks([1, 3, 10, 30], ["1", "3", "10", "30"])
axes[0].minorticks_off()
axes[0].legend()

# %% [markdown]
# Errors of neighbouring pixels are not independent: their windows overlap. So a mean over a few
# neighbours helps less than $1 / \sqrt{n}$ promises; only one over a larger patch does.

# %%
wall = add_depth_noise(np.full((480, 640), 0.8), camera.K, noise, rng)[:, 100:]
error = np.where(wall > 0, wall - 0.8, 0)
lags = np.arange(9)
correlation = [np.mean(error[:, : 500 - k] * error[:, k:500]) / np.mean(error**2) for k in lags]
assert correlation[1] > 0.5
assert abs(correlation[8]) < 0.05
axes[1].bar(lags, correlation)
axes[1].set(xlabel="pixels apart", ylabel="correlation", title="errors of one row")
fig.tight_layout()
save_figure(fig, "axial_noise")

# %% [markdown]
# ## What it does to normals
#
# A normal is a difference of depths over a window of a few pixels. At 0.7 m five pixels are 6 mm
# wide, and depths are off by more than 1 mm: small windows are hopeless. A larger one averages more
# noise, and rounds off more of what is curved or narrow: the largest here has the best median, but
# not the fewest bad normals. The function is told of the noise
# (`noise_quadratic`), so that it does not take it for roughness and refuse.

# %%
true_normals = normals_from_depth(ideal, camera, DepthConfig(max_depth=1.5))
quadratic = float(axial_sigma(1.0, camera.K, noise))
windows = (5, 7, 9, 11, 15)
errors = {}
for window in windows:
    config = DepthConfig(max_depth=1.5, window=window, noise_quadratic=quadratic)
    normals = normals_from_depth(noisy, camera, config)
    cosine = np.clip((true_normals * normals).sum(axis=-1), -1, 1)
    near = known & (ideal < 0.9) & np.isfinite(cosine)
    errors[window] = np.degrees(np.arccos(cosine[near]))
medians = {window: float(np.median(e)) for window, e in errors.items()}
assert medians[5] > 2 * medians[11]
assert medians[15] < medians[11] < 8
assert (errors[15] > 15).mean() > (errors[11] > 15).mean()

fig, ax = plt.subplots(figsize=(6, 3.2))
for window, e in errors.items():
    ax.plot(np.sort(e), np.linspace(0, 1, len(e)), label=f"window {window}: {medians[window]:.1f}°")
ax.set(xlim=(0, 45), xlabel="error of the normal [deg]", ylabel="share of the pixels")
ax.legend(title="median", fontsize=8)
ax.grid(alpha=0.4)
fig.tight_layout()
save_figure(fig, "normals")

# %% [markdown]
# In a station, a line of the scenario puts this model between a camera and everything that reads
# it: `depth_noise: {camera0: {seed: 1}}`.
