# %% [markdown]
# # What an arm can reach
#
# A million random configurations within the joint limits, sorted into voxels of 5 cm by where they
# put the gripper: how many directions it can approach from there, and how far from singular it is.
# `prehensile reach iiwa7` does the same from the command line and shows the map in the browser.

# %%
import time

import numpy as np

from prehensile.kinematics.reachability import ReachabilityConfig, reachability_map
from prehensile.kinematics.tree import tree_from_plant
from prehensile.station import build, load_scenario
from prehensile.viz.figures import save_figure
from prehensile.viz.voxels import plot_slices

station = build(load_scenario("iiwa_wsg"))
plant = station.GetSubsystemByName("plant")
arm = plant.GetModelInstanceByName("iiwa")
G = plant.GetFrameByName("body", plant.GetModelInstanceByName("wsg"))
joints = [plant.GetJointByName(f"iiwa_joint_{k + 1}", arm) for k in range(7)]
compiled = tree_from_plant(plant, [G], joints=joints)

# %% [markdown]
# The approach axis is y of the gripper, the direction of its fingers.

# %%
start = time.perf_counter()
config = ReachabilityConfig(num_samples=1_000_000, axis=(0.0, 1.0, 0.0))
reach = reachability_map(compiled, config, num_threads=2)
print(
    f"{time.perf_counter() - start:.1f} s, {reach.volume():.2f} m³ of {reach.counts.shape} voxels"
)

# %% [markdown]
# ## The workspace
#
# It lies within a sphere about the shoulder whose radius is the length of the stretched arm, and
# fills most of it.

# %%
p_WShoulder = np.array([0.0, 0.0, 0.34])
length = 0.4 + 0.4 + 0.126 + 0.09
p_WVoxels, _ = reach.occupied()
half_diagonal = 0.5 * np.sqrt(3.0) * reach.voxel_size
assert np.max(np.linalg.norm(p_WVoxels - p_WShoulder, axis=1)) < length + half_diagonal
assert 0.6 < reach.volume() / (4.0 / 3.0 * np.pi * length**3) < 1.1
assert reach.counts.sum() == 1_000_000

# %% [markdown]
# ## Where it is dexterous
#
# The index is the share of 64 directions from which the gripper has been seen to come. It is
# highest in a shell around the shoulder and falls to nothing at the border, and so does the
# distance to the nearest singularity.

# %%
index = reach.index()
at = reach.counts > 0
value = np.where(at, index, np.nan)
save_figure(
    plot_slices(value, reach.first, reach.voxel_size, label="reachability index", at=(0.0, 0.3)),
    "reachability_index",
)
sigma = np.where(at, reach.singular_value, np.nan)
save_figure(
    plot_slices(
        sigma, reach.first, reach.voxel_size, label="smallest singular value", at=(0.0, 0.3)
    ),
    "distance_to_singularity",
)

# %%
distance = np.linalg.norm(p_WVoxels - p_WShoulder, axis=1)
of_voxel = index[at]
shell, border = (distance > 0.45) & (distance < 0.75), distance > 0.97
assert np.median(of_voxel[shell]) > 4.0 * np.median(of_voxel[border])
assert np.median(sigma[at][shell]) > 2.0 * np.median(sigma[at][border])
