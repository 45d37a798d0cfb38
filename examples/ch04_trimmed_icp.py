# %% [markdown]
# # Trimming, and which way to measure
#
# Two small experiments in the plane with outliers in the scene. First: drop the worst pairs.
# Second: a distance between shapes has a direction, and one of the two ignores outliers of the
# scene. (Exercise 4.8.)

# %%
import matplotlib.pyplot as plt
import numpy as np
from scipy.spatial import KDTree
from scipy.spatial.distance import directed_hausdorff

from prehensile.viz.figures import save_figure

# %% [markdown]
# ## (a) Trimmed ICP: the pairs with the largest distances
#
# Six scene points $r_j$, of which a third are said to be outliers. Each takes its nearest model
# point $b_i$.

# %%
b = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [2.0, 1.0]])
r = np.array([[0.1, 0.1], [1.0, -0.1], [2.1, 0.1], [1.9, 1.1], [0.2, 2.0], [3.6, 1.4]])
distance, nearest = KDTree(b).query(r)
assert nearest.tolist() == [0, 1, 2, 3, 0, 3]

full = distance.sum()
keep = np.argsort(distance)[: len(r) - len(r) // 3]
dropped = sorted(set(range(len(r))) - set(keep.tolist()))
assert dropped == [4, 5]
trimmed = distance[keep].sum()
assert np.isclose(trimmed, 3 * np.sqrt(0.02) + 0.1)
assert trimmed < full / 6

# %% [markdown]
# One step of trimmed ICP uses those four pairs alone. Chetverikov's Trimmed ICP repeats: pair,
# sort, drop the same share, fit. Which pairs are dropped may change from step to step, so nothing
# is lost for good by a bad start; but the share has to be known, at least roughly.
#
# ## (b) The one-way Hausdorff distance
#
# An adversary picks a point of one shape; we go to the nearest point of the other. If the
# adversary picks scene points, one outlier far out sets the distance. If he picks model points,
# the outlier is never anyone's nearest, and the distance is as if it were not there.

# %%
b = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [3.0, 0.0]])
r = np.array([[0.0, 0.3], [1.0, 0.2], [2.0, 0.3], [3.0, 0.2], [5.0, 3.0]])
from_scene, at_scene, _ = directed_hausdorff(r, b)
from_model, at_model, _ = directed_hausdorff(b, r)
assert at_scene == 4  # The outlier.
assert np.isclose(from_scene, np.hypot(2, 3))
assert np.isclose(from_model, 0.3)
without, _, _ = directed_hausdorff(b, r[:4])
assert np.isclose(from_model, without)

fig, axes = plt.subplots(1, 2, figsize=(10, 3.4), sharey=True)
titles = (f"the adversary picks in the scene: {from_scene:.2f}",)
titles += (f"the adversary picks in the model: {from_model:.2f}",)
for ax, title, source, target in zip(axes, titles, (r, b), (b, r), strict=True):
    _, index = KDTree(target).query(source)
    for p, q in zip(source, target[index], strict=True):
        ax.plot(*np.stack([p, q]).T, color="tab:green", lw=1)
    ax.plot(*b.T, "o", color="black", label="model")
    ax.plot(*r.T, "o", color="tab:red", label="scene")
    ax.set(title=title, aspect="equal")
axes[0].legend()
save_figure(fig, "one_way_hausdorff")

# %% [markdown]
# The model → scene direction is robust to clutter in the scene, and fragile to what the scene does
# not show: a partial view lacks partners for most of the model. Trimming helps in both directions.
# Numbers for both, on a ring of which a camera sees 60 %, with clutter:

# %%
rng = np.random.default_rng(2)
angle = np.linspace(0, 2 * np.pi, 200, endpoint=False)
ring = np.column_stack([np.cos(angle), np.sin(angle)])
seen = np.concatenate([ring[:120], rng.uniform(-2, 2, (30, 2))])
outward, _ = KDTree(ring).query(seen)  # Scene to model.
inward, _ = KDTree(seen).query(ring)  # Model to scene.


def trimmed_mean(values, share):
    """Mean of the smallest share of the values."""
    return np.sort(values)[: int(share * len(values))].mean()


assert outward.mean() > 0.05  # Clutter,
assert inward.mean() > 0.05  # and the unseen part.
assert trimmed_mean(outward, 0.75) < 0.005
assert trimmed_mean(inward, 0.55) < 1e-12

fig, ax = plt.subplots(figsize=(6, 3.4))
for values, label in ((outward, "scene → model"), (inward, "model → scene")):
    ax.plot(np.linspace(0, 1, len(values)), np.sort(values), label=label)
ax.set(xlabel="share of the pairs", ylabel="distance", title="sorted distances at the true pose")
ax.legend()
fig.tight_layout()
save_figure(fig, "sorted_distances")
