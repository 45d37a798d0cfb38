# %% [markdown]
# # Outliers found before any pose: cliques of distances
#
# Rigid motions keep distances. So two correspondences can be right together only if their model
# points are as far apart as their scene points, and that can be asked before any pose is known.
# Join every two correspondences that pass: right ones are all joined with each other, they form a
# clique. (Example 4.6; Yang, Shi and Carlone, "TEASER", 2021.)

# %%
import matplotlib.pyplot as plt
import numpy as np

from prehensile.perception.registration.consistency import (
    all_pairs,
    consistency_graph,
    match_by_distances,
    maximum_clique,
)
from prehensile.perception.registration.known import fit_rigid
from prehensile.viz.figures import save_figure

# %% [markdown]
# ## A triangle, and a pyramid that has some of its lengths
#
# The model is the triangle $ABC$ with sides 3, 4 and 5. The scene holds the same triangle $abc$,
# turned and moved, and a pyramid of the points $d, e, f, g$ whose six edges are three of length 3
# and three of length 4: six more pairs whose length occurs in the model.

# %%
model = np.array([[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [0.0, 4.0, 0.0]])
angle = np.radians(35)
R = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
triangle = model @ R.T + [1.0, 6.0, 0.0]
side = 3.0  # The base; its corners lie at distance 4 from the top.
base = (
    side
    / np.sqrt(3)
    * np.column_stack(
        [np.cos(np.arange(3) * 2 * np.pi / 3), np.sin(np.arange(3) * 2 * np.pi / 3), np.zeros(3)]
    )
)
top = [0.0, 0.0, np.sqrt(16 - side**2 / 3)]
pyramid = np.vstack([base, top]) + [9.0, 4.0, 0.0]
edges = np.linalg.norm(pyramid[:, None] - pyramid, axis=-1)[np.triu_indices(4, 1)]
assert np.allclose(np.sort(edges), [3, 3, 3, 4, 4, 4])
scene = np.vstack([triangle, pyramid])

# %% [markdown]
# ## All against all
#
# Every model point with every scene point: 21 possible correspondences, the vertices of the graph.
# The pyramid brings in many edges, but its largest cliques have two vertices: in any three of its
# points two edges have the same length, which no triangle of 3, 4 and 5 has.

# %%
pairs = all_pairs(len(model), len(scene))
graph = consistency_graph(model[pairs[:, 0]], scene[pairs[:, 1]], 1e-6, min_length=1e-9)
joined = np.array([[graph.adjacent(i, j) for j in range(21)] for i in range(21)])
clique = maximum_clique(graph)
assert clique.proven
assert pairs[clique.vertices].tolist() == [[0, 0], [1, 1], [2, 2]]

in_pyramid = pairs[:, 1] >= 3
largest = 0
for i, j in np.argwhere(joined & in_pyramid & in_pyramid[:, None]):
    largest = max(largest, 2 + (joined[i] & joined[j]).sum())
assert largest == 2  # An edge, and nobody joined to both its ends.

names = [f"{'ABC'[m]}-{'abcdefg'[s]}" for m, s in pairs]
turn = np.arange(21) * 2 * np.pi / 21
place = np.column_stack([np.cos(turn), np.sin(turn)])
fig = plt.figure(figsize=(11, 5))
left = fig.add_subplot(1, 2, 1, projection="3d")
for points, labels, colour in ((model, "ABC", "black"), (scene, "abcdefg", "tab:blue")):
    left.scatter(*points.T, color=colour, depthshade=False)
    for p, label in zip(points, labels, strict=True):
        left.text(*(p + 0.2), label)
for group in ([0, 1, 2], [3, 4, 5, 6]):
    for k, i in enumerate(group):
        for j in group[k + 1 :]:
            left.plot(*scene[[i, j]].T, color="tab:blue", lw=1)
for i, j in ((0, 1), (1, 2), (0, 2)):
    left.plot(*model[[i, j]].T, color="black", lw=1)
left.set(title="model and scene")
left.set_box_aspect(np.ptp(np.vstack([model, scene]), axis=0))
right = fig.add_subplot(1, 2, 2)
for i, j in np.argwhere(np.triu(joined)):
    inside = i in clique.vertices and j in clique.vertices
    right.plot(*place[[i, j]].T, color="tab:red" if inside else "0.75", lw=2 if inside else 1)
for name, p in zip(names, place, strict=True):
    right.text(*(1.12 * p), name, ha="center", va="center", fontsize=8)
right.plot(*place.T, "o", color="black", ms=4)
right.set_title("consistent correspondences", pad=18)
right.set_aspect("equal")
right.axis("off")
save_figure(fig, "triangle_and_pyramid")

# %% [markdown]
# ## With a third of the points clutter, and no candidates at all
#
# Twelve model points, eight of them seen, four points of something else. All 144 pairs are
# candidates, of which 8 are right: 94 % outliers. The clique is found and proven to be the largest,
# and a closed form turns it into a pose.

# %%
rng = np.random.default_rng(3)
model = rng.uniform(-0.1, 0.1, (12, 3))
seen = model[:8] @ R.T + [0.4, 0.1, 0.2] + rng.normal(0, 0.0005, (8, 3))
scene = np.vstack([seen, rng.uniform(0.2, 0.6, (4, 3))])
matches, proven = match_by_distances(model, scene, 0.003)
assert proven
right = matches[:, 0] == matches[:, 1]
assert right.sum() == 8
fit = fit_rigid(model[matches[:, 0]], scene[matches[:, 1]])
assert np.allclose(fit.R_WO, R, atol=0.02)
