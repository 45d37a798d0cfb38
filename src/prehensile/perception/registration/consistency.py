"""Which correspondences can be right together: consistency graphs and their largest cliques.

A rigid motion keeps distances. Two right correspondences (model point a_i, scene point b_i) agree
in | |b_i - b_j| - |a_i - a_j| | <= tolerance before any pose is known, so right ones form a clique
of the graph that joins consistent pairs, and wrong ones rarely join it (Yang, Shi and Carlone,
"TEASER", IEEE T-RO 37(2), 2021, section VII; Shi, Yang and Carlone, "ROBIN", ICRA 2021).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from prehensile.native import _core
from prehensile.native._core import ConsistencyGraph

__all__ = [
    "Clique",
    "ConsistencyGraph",
    "all_pairs",
    "consistency_graph",
    "match_by_distances",
    "maximum_clique",
]


@dataclass(frozen=True, eq=False)
class Clique:
    """Vertices of a graph, each joined to each.

    Attributes:
        vertices: (k,) int32, ascending; none if no clique of the size asked for was found.
        proven: whether no larger one exists (of at least the size asked for).
        nodes: of the search tree that were visited.
    """

    vertices: NDArray[np.int32]
    proven: bool
    nodes: int


def consistency_graph(
    model_points: ArrayLike,
    scene_points: ArrayLike,
    tolerance: float,
    *,
    scale: float = 1.0,
    min_length: float = 0.0,
) -> ConsistencyGraph:
    """Joins the correspondences i and j whose points are equally far apart in model and scene.

    Compared in single precision 16 pairs at a time; what is near the tolerance is decided in
    double precision, so that the graph does not depend on the processor.

    Args:
        model_points: (N, 3) or, in the plane, (N, 2) in O [m], N <= 2^15.
        scene_points: the same shape, the partner of each in W [m].
        tolerance: greatest difference of two lengths [m], at least 0. For points known to within
            e this is 2 e.
        scale: by which model lengths are multiplied first.
        min_length: correspondences nearer to each other than this, in the model or in the scene,
            are not joined [m]; any number above 0 keeps a point from having two partners.

    Returns:
        The graph of N vertices.

    Raises:
        ValueError: if shapes disagree, a number is not finite or out of range, or N is too large.
    """
    model, scene = _spatial(model_points, scene_points)
    return _core.consistency_graph(model, scene, tolerance, scale, min_length)


def maximum_clique(
    graph: ConsistencyGraph,
    *,
    exact: bool = True,
    min_size: int = 1,
    max_nodes: int = 1_000_000,
    time_limit: float = np.inf,
) -> Clique:
    """A largest clique of a graph.

    The heuristic grows cliques from the vertices of the densest core; the exact search goes on with
    branch and bound, with core numbers and a colouring as bounds, on bit sets (San Segundo,
    Rodriguez-Losada and Jimenez 2011; Rossi, Gleich and Gebremedhin 2015). The same graph gets the
    same answer, unless the time limit ends the search.

    Args:
        graph: of any kind; see
            :meth:`ConsistencyGraph.from_edges <prehensile.native._core.ConsistencyGraph>`.
        exact: whether to search on until the clique is proven to be a largest one.
        min_size: smaller cliques are not looked for, which makes the search shorter.
        max_nodes: of the search tree.
        time_limit: of the search tree [s].

    Returns:
        The clique, and whether it is proven.
    """
    return Clique(*_core.maximum_clique(graph, exact, min_size, max_nodes, time_limit))


def all_pairs(num_model_points: int, num_scene_points: int) -> NDArray[np.int64]:
    """Every model point with every scene point: (num_model_points * num_scene_points, 2) rows."""
    model, scene = np.indices((num_model_points, num_scene_points)).reshape(2, -1)
    return np.stack([model, scene], axis=1)


def match_by_distances(
    model_points: ArrayLike,
    scene_points: ArrayLike,
    tolerance: float,
    *,
    pairs: ArrayLike | None = None,
    max_nodes: int = 1_000_000,
) -> tuple[NDArray[np.int64], bool]:
    """The largest set of correspondences between two clouds that distances allow.

    Distances cannot tell a shape from its mirror image: the set may fit a reflection.

    Args:
        model_points: (M, 3) or (M, 2) in O [m].
        scene_points: (S, 3) or (S, 2) in W [m].
        tolerance: greatest difference of two lengths [m].
        pairs: (N, 2) candidates (model point, scene point); all M * S if not given. N <= 2^15.
        max_nodes: of the search tree.

    Returns:
        The matches (k, 2), rows of pairs; no point occurs twice. And whether it is proven that no
        larger set exists.

    Raises:
        ValueError: as :func:`consistency_graph`; or if pairs name points that do not exist.
    """
    model, scene = np.asarray(model_points, float), np.asarray(scene_points, float)
    candidates = np.asarray(all_pairs(len(model), len(scene)) if pairs is None else pairs)
    if candidates.ndim != 2 or candidates.shape[1] != 2:
        raise ValueError(f"pairs: expected shape (N, 2), not {candidates.shape}")
    if candidates.size and not np.issubdtype(candidates.dtype, np.integer):
        raise ValueError(f"pairs: expected whole numbers, not {candidates.dtype}")
    if len(candidates) and not (
        (candidates >= 0).all() and (candidates < [len(model), len(scene)]).all()
    ):
        raise ValueError(f"pairs: name points outside {len(model)} and {len(scene)}")
    graph = consistency_graph(
        model[candidates[:, 0]],
        scene[candidates[:, 1]],
        tolerance,
        min_length=float(np.finfo(float).tiny),
    )
    clique = maximum_clique(graph, max_nodes=max_nodes)
    return candidates[clique.vertices].astype(np.int64), clique.proven


def _spatial(
    model_points: ArrayLike, scene_points: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Both as (N, 3); points of a plane get z = 0."""
    model, scene = np.asarray(model_points, float), np.asarray(scene_points, float)
    if model.shape != scene.shape or model.ndim != 2 or model.shape[1] not in (2, 3):
        raise ValueError(
            f"model_points, scene_points: expected equal shapes (N, 3) or (N, 2), not "
            f"{model.shape} and {scene.shape}"
        )
    if model.shape[1] == 2:
        model, scene = (np.pad(points, ((0, 0), (0, 1))) for points in (model, scene))
    return model, scene
