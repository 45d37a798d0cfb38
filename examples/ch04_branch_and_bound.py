# %% [markdown]
# # The best pose of all: branch and bound
#
# Iterative closest points ends in the minimum next to its start. Branch and bound starts from all
# poses at once: it cuts the space of poses into boxes, works out for each box a cost that no pose
# in it can undercut, and throws away the boxes that cannot hold anything better than the best pose
# found so far. What is left at the end is proven to be the best. (Section 4.5.6; Yang, Li, Campbell
# and Jia, "Go-ICP", 2016.)

# %%
import matplotlib.pyplot as plt
import numpy as np

from prehensile.perception.registration import RegistrationStatus, branch_and_bound
from prehensile.perception.registration.planar import icp_2d, planar_pose
from prehensile.viz.figures import save_figure

# %% [markdown]
# ## A comb in the plane
#
# A comb whose teeth differ a little: shifted by a tooth, or turned upside down, it nearly fits
# again. The scene shows most of its points, with noise.

# %%
rng = np.random.default_rng(1)
teeth = [
    np.column_stack([np.full(5, 0.2 * k), np.linspace(0.1, height, 5)])
    for k, height in enumerate((0.4, 0.3, 0.45, 0.3, 0.5, 0.35))
]
back = np.column_stack([np.linspace(0.0, 1.0, 16), np.zeros(16)])
model = np.vstack([back, *teeth])
model -= model.mean(axis=0)
X_true = planar_pose(2.5, [0.7, 0.4])


def moved(X, points):
    """Points (N, 2) at a pose (3, 3)."""
    return points @ X[:2, :2].T + X[:2, 2]


kept = rng.permutation(len(model))[:36]
scene = moved(X_true, model[kept]) + rng.normal(0, 0.006, (36, 2))

# %% [markdown]
# ## What the starts do
#
# From 72 angles, in the middle of the scene: iterative closest points finds a dozen poses, of which
# one is right.

# %%
starts = np.linspace(-np.pi, np.pi, 72, endpoint=False)
ends, costs = [], []
for angle in starts:
    result = icp_2d(scene, model, planar_pose(angle, scene.mean(axis=0)))
    assert result.X_WO is not None
    at_model = (scene - result.X_WO[:2, 2]) @ result.X_WO[:2, :2]
    squares = ((at_model[:, None] - model) ** 2).sum(axis=2).min(axis=1)
    costs.append(squares.sum())
    ends.append(result.X_WO)
costs = np.array(costs)
poses = np.unique(np.round([[X[0, 0], X[1, 0], X[0, 2], X[1, 2]] for X in ends], 2), axis=0)
print(f"{len(poses)} different ends; the best one from {np.mean(costs < 1.01 * costs.min()):.0%}")
assert len(poses) >= 5
assert np.mean(costs < 1.01 * costs.min()) < 0.5

# %% [markdown]
# ## What the bounds do
#
# More and more boxes may be looked at. The best pose is found at once, since whatever improves on
# the best so far is handed to iterative closest points; what takes the time is to prove that
# nothing is better. At first the bound is zero, for large boxes hold a pose that might explain
# everything; it climbs as boxes get smaller and go. Cost and bound need not meet: it is enough that
# the gap is less than what matters, here 1 mm for each point.

# %%
limits = range(2, 130, 4)
runs = [branch_and_bound(scene, model, gap_distance=0.001, max_nodes=n) for n in limits]
best = runs[-1]
assert best.status is RegistrationStatus.SUCCESS
assert runs[0].status is RegistrationStatus.NOT_CONVERGED  # The bound is kept, and says so.
assert best.gap <= len(scene) * 0.001**2
assert best.X_WO is not None
X = best.X_WO.GetAsMatrix4()
error = np.arccos(X[:2, :2].ravel() @ X_true[:2, :2].ravel() / 2)
assert np.degrees(error) < 1
assert np.linalg.norm(X[:2, 3] - X_true[:2, 2]) < 0.01
assert (np.diff([run.lower_bound for run in runs]) >= 0).all()
assert (np.diff([run.cost for run in runs]) <= 1e-12).all()
assert best.lower_bound <= costs.min() + 1e-12  # No start of all undercuts the bound,
assert best.cost <= costs.min() * (1 + 1e-6)  # nor what was found.

fig, axes = plt.subplots(1, 3, figsize=(13.5, 4))
worst = ends[int(np.argsort(costs)[len(costs) // 2])]
axes[0].plot(*scene.T, "o", color="tab:red", ms=5, label="scene")
axes[0].plot(*moved(worst, model).T, "x", color="0.6", label="a local minimum")
at_best = model @ X[:2, :2].T + X[:2, 3]
axes[0].plot(*at_best.T, ".", color="black", label="proven best")
axes[0].set(aspect="equal", title="poses")
axes[0].legend(fontsize=8)
axes[1].semilogy(np.degrees(starts), costs, ".", color="0.5")
axes[1].axhline(best.lower_bound, color="tab:red", lw=2, label="no pose is below")
axes[1].set(xlabel="start's angle [deg]", ylabel="cost", title="iterative closest points")
axes[1].legend(fontsize=8)
boxes = [run.nodes for run in runs]
axes[2].plot(boxes, [run.cost for run in runs], ".-", color="black", label="best pose so far")
axes[2].plot(boxes, [run.lower_bound for run in runs], ".-", color="tab:red", label="bound")
axes[2].fill_between(
    boxes, [run.lower_bound for run in runs], [run.cost for run in runs], color="0.9"
)
axes[2].set(xlabel="boxes of rotations", ylabel="cost", title="the gap closes")
axes[2].legend(fontsize=8)
fig.tight_layout()
save_figure(fig, "bounds")

# %% [markdown]
# ## Why only small problems
#
# Half the gap costs about twice the boxes, each of them dearer than the ones before, and in space
# there are six unknowns instead of three. The library bounds translations inside each box of
# rotations; still, some tens of points in space take seconds. For clouds of a camera, votes and
# consistency (see the example of global registration) take their place, and a certificate, where
# one is needed, comes afterwards.

# %%
gaps = (0.004, 0.002, 0.001, 0.0005)
nodes = [branch_and_bound(scene, model, gap_distance=gap).nodes for gap in gaps]
print(dict(zip(gaps, nodes, strict=True)))
assert nodes == sorted(nodes)
assert nodes[-1] > 2 * nodes[0]
