"""Collision-free paths in joint space: RRT-Connect and shortcutting."""

from typing import Literal

import numpy as np

from prehensile.planning.arm import ArmModel
from prehensile.planning.cartesian import PathResult


def plan_joint_path(
    arm: ArmModel,
    q_start: np.ndarray,
    q_goal: np.ndarray,
    *,
    rng: np.random.Generator | None = None,
    max_iterations: int = 2000,
    shortcuts: int = 60,
) -> PathResult:
    """A collision-free path from q_start to q_goal: the straight line, or a searched one.

    Kuffner and LaValle, "RRT-Connect: an efficient approach to single-query path planning", 2000;
    then random shortcuts (LaValle, Planning Algorithms, 2006, sec. 14.7.1). Bounded by counts and
    not by the clock, so that the same seed gives the same path.

    Args:
        arm: the arm and its surroundings; edges are checked at its ``edge_step``.
        q_start: where to start (n,).
        q_goal: where to end (n,).
        rng: of the samples; seed 0 if it is not given.
        max_iterations: samples drawn before giving up.
        shortcuts: shortcuts tried on a searched path.

    Returns:
        The path (K, n), or why there is none.
    """
    rng = np.random.default_rng(0) if rng is None else rng
    q_start, q_goal = np.array(q_start, dtype=float), np.array(q_goal, dtype=float)
    ends: tuple[tuple[Literal["start", "goal"], np.ndarray], ...]
    ends = (("start", q_start), ("goal", q_goal))
    for name, q in ends:
        if not arm.limits.contain(q, 1e-9):
            return PathResult(name, q_start[None], f"the {name} is beyond the joint limits")
        if not arm.is_free(q):
            reason = f"the {name} collides: {arm.collisions(q)}"
            return PathResult(name, q_start[None], reason)
    if arm.edge_is_free(q_start, q_goal):
        return PathResult("found", np.array([q_start, q_goal]))
    path = _rrt_connect(arm, q_start, q_goal, rng, max_iterations)
    if path is None:
        reason = f"no way was found with {max_iterations} samples"
        return PathResult("budget", q_start[None], reason)
    return PathResult("found", shorten(arm, path, rng, shortcuts))


def shorten(
    arm: ArmModel, path: np.ndarray, rng: np.random.Generator, shortcuts: int
) -> np.ndarray:
    """Cuts corners of a free path (K, n): edges between random points of it, where free."""
    for _ in range(shortcuts):
        if len(path) < 3:
            break
        lengths = np.linalg.norm(np.diff(path, axis=0) * arm.weights, axis=1)
        ends = np.concatenate([[0.0], np.cumsum(lengths)])
        s_A, s_B = np.sort(rng.uniform(0.0, ends[-1], 2))
        i, j = np.searchsorted(ends, [s_A, s_B], side="right") - 1
        if i == j:
            continue
        q_A = path[i] + (s_A - ends[i]) / lengths[i] * (path[i + 1] - path[i])
        q_B = path[j] + (s_B - ends[j]) / lengths[j] * (path[j + 1] - path[j])
        if arm.edge_is_free(q_A, q_B):
            path = np.vstack([path[: i + 1], q_A, q_B, path[j + 1 :]])
    # Drop waypoints that are not needed.
    k = 1
    while k < len(path) - 1:
        if arm.edge_is_free(path[k - 1], path[k + 1]):
            path = np.delete(path, k, axis=0)
        else:
            k += 1
    return path


class _Tree:
    """Configurations grown from one end, each with its parent."""

    def __init__(self, root: np.ndarray, capacity: int) -> None:
        self.q = np.empty((capacity, len(root)))
        self.q[0] = root
        self.parent = [0]

    def nearest(self, q: np.ndarray, weights: np.ndarray) -> int:
        difference = (self.q[: len(self.parent)] - q) * weights
        return int(np.argmin(np.einsum("ij,ij->i", difference, difference)))

    def add(self, q: np.ndarray, parent: int) -> int:
        if len(self.parent) == len(self.q):
            self.q = np.vstack([self.q, np.empty_like(self.q)])
        self.q[len(self.parent)] = q
        self.parent.append(parent)
        return len(self.parent) - 1

    def branch(self, node: int) -> list[np.ndarray]:
        """From the node back to the root."""
        path = [self.q[node]]
        while node:
            node = self.parent[node]
            path.append(self.q[node])
        return path


def _rrt_connect(
    arm: ArmModel,
    q_start: np.ndarray,
    q_goal: np.ndarray,
    rng: np.random.Generator,
    max_iterations: int,
    step: float = 0.3,
) -> np.ndarray | None:
    """A free path (K, n) or None; `step` is the weighted length of an edge (m)."""
    lower, upper = arm.limits.lower, arm.limits.upper
    start_tree, goal_tree = _Tree(q_start, 1024), _Tree(q_goal, 1024)
    a, b = start_tree, goal_tree

    def grow(tree: _Tree, q: np.ndarray, node: int) -> int | None:
        """One step from a node toward q; None if it is blocked."""
        difference = q - tree.q[node]
        length = float(np.linalg.norm(difference * arm.weights))
        target = q if length <= step else tree.q[node] + difference * (step / length)
        return tree.add(target, node) if arm.edge_is_free(tree.q[node], target) else None

    for _ in range(max_iterations):
        sample = rng.uniform(lower, upper)
        new = grow(a, sample, a.nearest(sample, arm.weights))
        if new is not None:
            target = a.q[new].copy()
            node: int | None = b.nearest(target, arm.weights)
            while node is not None and not np.array_equal(b.q[node], target):
                node = grow(b, target, node)
            if node is not None:
                from_start, from_goal = (new, node) if a is start_tree else (node, new)
                there = start_tree.branch(from_start)[::-1]
                return np.array(there + goal_tree.branch(from_goal)[1:])
        a, b = b, a
    return None
