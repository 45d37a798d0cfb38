"""Signatures of the compiled module (cpp/bindings/module.cpp)."""

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

def voxel_downsample(
    points: NDArray[np.floating],
    voxel_size: float,
    normals: NDArray[np.floating] | None,
    num_threads: int,
    simd: str | None = None,
) -> tuple[NDArray[np.floating], NDArray[np.floating] | None, NDArray[np.int32]]: ...
def simd_levels() -> list[str]: ...
def inside_box(
    points: NDArray[np.floating], X_BW: ArrayLike, size: ArrayLike
) -> NDArray[np.uint8]: ...
def inside_half_space(
    points: NDArray[np.floating], normal: ArrayLike, offset: float
) -> NDArray[np.uint8]: ...

class KinematicTree:
    """Forward kinematics of a tree of n joints, revolute or prismatic, and of frames fixed to it.

    Poses X_WF are (4, 4). Jacobians J_WF are (6, n), rotational rows first, expressed in the
    world W: V_WF = J q̇ is the spatial velocity of F at its origin. Every method raises ValueError,
    naming the argument, for a wrong shape, a number that is not finite or a frame that is none.

    Args:
        parents: (n,) index of the joint that moves the frame P each joint is mounted on, -1 for W.
        X_PJ: (n, 4, 4) pose of each joint's frame J in P while q is zero.
        axes: (n, 3) axis of each joint in J, of any length but zero.
        prismatic: (n,) whether it slides (m) instead of turning (rad).
        frame_parents: (m,) index of the joint that moves the frame that each F is fixed in, -1
            for W.
        X_PF: (m, 4, 4) pose of F in that frame.
    """

    def __init__(
        self,
        parents: ArrayLike,
        X_PJ: ArrayLike,
        axes: ArrayLike,
        prismatic: ArrayLike,
        frame_parents: ArrayLike,
        X_PF: ArrayLike,
    ) -> None: ...
    @property
    def num_joints(self) -> int: ...
    @property
    def num_frames(self) -> int: ...
    def pose(self, q: ArrayLike, frame: int = 0) -> NDArray[np.float64]: ...
    def jacobian(self, q: ArrayLike, frame: int = 0) -> NDArray[np.float64]: ...
    def pose_and_jacobian(
        self, q: ArrayLike, frame: int = 0
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]: ...
    def relative_jacobian(
        self, q: ArrayLike, frame: int, measured_in: int, expressed_in: int
    ) -> NDArray[np.float64]:
        """(6, n) Jacobian of V_AF_E, A = measured_in, E = expressed_in, -1 for the world."""
    def poses(self, Q: ArrayLike, frame: int = 0, num_threads: int = 1) -> NDArray[np.float64]:
        """(N, 4, 4) poses for the rows of Q (N, n); the GIL is released."""
    def jacobians(self, Q: ArrayLike, frame: int = 0, num_threads: int = 1) -> NDArray[np.float64]:
        """(N, 6, n) Jacobians for the rows of Q (N, n); the GIL is released."""
    def reach(
        self, frame: int, lower: ArrayLike, upper: ArrayLike
    ) -> tuple[tuple[float, float, float], float]:
        """Centre (in W) and radius of a ball that F's origin does not leave within the limits."""

def sample_configurations(
    lower: Sequence[float],
    upper: Sequence[float],
    seed: int,
    first: int,
    count: int,
    num_threads: int,
) -> NDArray[np.float64]: ...
def add_to_reach(
    tree: KinematicTree,
    frame: int,
    Q: ArrayLike,
    axis: Sequence[float],
    directions: ArrayLike,
    part: str,
    length: float,
    voxel_size: float,
    first: Sequence[int],
    counts: NDArray[np.uint32],
    reached: NDArray[np.uint64],
    manipulability: NDArray[np.float64],
    singular_value: NDArray[np.float64],
    num_threads: int,
) -> int: ...

class IkStep:
    """The next joint velocities, and how they came about.

    Attributes:
        v: (n,) the velocities (a new array at every access, as the next two).
        lower, upper: (n,) the interval that limits and state allowed.
        status: 0 optimal, 1 recovering, 2 relaxed, 3 braking.
        alpha: part of V achieved in its direction, where that is the formulation; else 1.
        violation: greatest violation of a linear constraint.
        iterations: of the solver.
    """

    @property
    def v(self) -> NDArray[np.float64]: ...
    @property
    def lower(self) -> NDArray[np.float64]: ...
    @property
    def upper(self) -> NDArray[np.float64]: ...
    @property
    def status(self) -> int: ...
    @property
    def alpha(self) -> float: ...
    @property
    def violation(self) -> float: ...
    @property
    def iterations(self) -> int: ...

class DifferentialIk:
    """From joint state and rows J v ≈ V to the next joint velocities.

    All of its methods raise ValueError, naming the argument, for a wrong shape or a number that is
    not finite (the sides of constraints may be infinite).
    """

    def __init__(
        self,
        position_lower: ArrayLike,
        position_upper: ArrayLike,
        velocity: ArrayLike,
        acceleration: ArrayLike,
        period: float,
        formulation: int,
        damping: float,
        centering: int,
        centering_weight: float,
        centering_gain: ArrayLike | None,
        nominal_position: ArrayLike | None,
        direction_weight: float,
        rank_tolerance: float,
    ) -> None: ...
    @property
    def num_joints(self) -> int: ...
    def step(
        self,
        q: ArrayLike,
        v: ArrayLike,
        J: ArrayLike,
        V: ArrayLike,
        weights: ArrayLike | None = None,
        level_sizes: list[int] | None = None,
        A: ArrayLike | None = None,
        lower: ArrayLike | None = None,
        upper: ArrayLike | None = None,
    ) -> IkStep:
        """One step from q, v (n,) with J (k, n), V (k,), lower <= A v <= upper, A (m, n)."""
    def step_batch(
        self,
        q: ArrayLike,
        v: ArrayLike,
        J: ArrayLike,
        V: ArrayLike,
        weights: ArrayLike | None = None,
        level_sizes: list[int] | None = None,
        A: ArrayLike | None = None,
        lower: ArrayLike | None = None,
        upper: ArrayLike | None = None,
        num_threads: int = 1,
    ) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
        """The same for N states, every array with a first dimension N (but weights, level_sizes).

        Returns (N, n) velocities and (N,) statuses. The GIL is released.
        """
    def velocity_interval(
        self, q: ArrayLike, v: ArrayLike
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], bool]:
        """Least and greatest next velocities (n,), and whether the state was beyond limits."""

class FrameIk:
    """From joint state and desired poses or velocities of a tree's frames to joint velocities.

    Args:
        frames: (m,) number of each task's frame.
        weights: (m, 6) of its rotational and translational velocities; 0 leaves one free.
        in_frame: (m,) whether the weights are along the frame's axes rather than the world's.
        levels: (m,) priorities, the least first.
        gains: (m,) 1/s, from the difference of two poses to a velocity.
        max_angular, max_linear: (m,) greatest desired speeds (rad/s, m/s), may be infinite.
    """

    def __init__(
        self,
        tree: KinematicTree,
        ik: DifferentialIk,
        frames: ArrayLike,
        weights: ArrayLike,
        in_frame: ArrayLike,
        levels: ArrayLike,
        gains: ArrayLike,
        max_angular: ArrayLike,
        max_linear: ArrayLike,
    ) -> None: ...
    @property
    def num_joints(self) -> int: ...
    @property
    def num_tasks(self) -> int: ...
    def step(
        self,
        q: ArrayLike,
        v: ArrayLike,
        X_WD: ArrayLike | None = None,
        V_WD: ArrayLike | None = None,
        A: ArrayLike | None = None,
        lower: ArrayLike | None = None,
        upper: ArrayLike | None = None,
    ) -> IkStep:
        """One step towards poses (m, 4, 4), with velocities (m, 6) added to what they ask for.

        A single task may leave out the first dimension.
        """
    def rollout(
        self,
        q: ArrayLike,
        v: ArrayLike,
        X_WD: ArrayLike,
        steps: int,
        keep_path: bool = False,
        num_threads: int = 1,
    ) -> tuple[
        NDArray[np.float64], NDArray[np.float64], NDArray[np.int32], NDArray[np.float64] | None
    ]:
        """N times `steps` steps from q, v (N, n) towards poses (N, m, 4, 4), the GIL released.

        Returns the last q and v, the gravest status of each (N,), and the path (N, steps, n).
        """

class IkSolutions:
    @property
    def q(self) -> NDArray[np.float64]: ...
    @property
    def branch(self) -> NDArray[np.uint8]: ...
    @property
    def status(self) -> Literal["solved", "too far", "too near", "limits"]: ...
    def __len__(self) -> int: ...

class ArmAngleChoice:
    @property
    def q(self) -> NDArray[np.float64] | None: ...
    @property
    def psi(self) -> float: ...
    @property
    def branch(self) -> int: ...
    @property
    def status(self) -> Literal["solved", "too far", "too near", "limits"]: ...

class UrArm:
    def __init__(
        self,
        axes: ArrayLike,
        points: ArrayLike,
        X_WG0: object,
        lower: ArrayLike,
        upper: ArrayLike,
        tolerance: float = 1e-6,
    ) -> None: ...
    @property
    def num_joints(self) -> int: ...
    @property
    def lower(self) -> NDArray[np.float64]: ...
    @property
    def upper(self) -> NDArray[np.float64]: ...
    def pose(self, q: ArrayLike) -> NDArray[np.float64]: ...
    def branch(self, q: ArrayLike) -> int: ...
    def solve(
        self, X_WG: object, q_near: ArrayLike | None = None, limits: bool = True
    ) -> IkSolutions: ...
    def solve_batch(
        self,
        X_WG: ArrayLike,
        q_near: ArrayLike | None = None,
        limits: bool = True,
        num_threads: int = 1,
    ) -> tuple[NDArray[np.float64], NDArray[np.uint8]]: ...

class PieperArm:
    def __init__(
        self,
        axes: ArrayLike,
        points: ArrayLike,
        X_WG0: object,
        lower: ArrayLike,
        upper: ArrayLike,
        tolerance: float = 1e-6,
    ) -> None: ...
    @property
    def num_joints(self) -> int: ...
    @property
    def lower(self) -> NDArray[np.float64]: ...
    @property
    def upper(self) -> NDArray[np.float64]: ...
    def pose(self, q: ArrayLike) -> NDArray[np.float64]: ...
    def branch(self, q: ArrayLike) -> int: ...
    def solve(
        self, X_WG: object, q_near: ArrayLike | None = None, limits: bool = True
    ) -> IkSolutions: ...
    def solve_batch(
        self,
        X_WG: ArrayLike,
        q_near: ArrayLike | None = None,
        limits: bool = True,
        num_threads: int = 1,
    ) -> tuple[NDArray[np.float64], NDArray[np.uint8]]: ...

class SrsArm:
    def __init__(
        self,
        axes: ArrayLike,
        points: ArrayLike,
        X_WG0: object,
        lower: ArrayLike,
        upper: ArrayLike,
        tolerance: float = 1e-6,
    ) -> None: ...
    @property
    def num_joints(self) -> int: ...
    @property
    def lower(self) -> NDArray[np.float64]: ...
    @property
    def upper(self) -> NDArray[np.float64]: ...
    def pose(self, q: ArrayLike) -> NDArray[np.float64]: ...
    def arm_angle(self, q: ArrayLike) -> tuple[float, int]: ...
    def arm_angle_intervals(self, X_WG: object, branch: int) -> NDArray[np.float64]: ...
    def closest(self, X_WG: object, q: ArrayLike) -> ArmAngleChoice: ...
    def farthest_from_limits(self, X_WG: object) -> ArmAngleChoice: ...
    def widest_interval(self, X_WG: object) -> ArmAngleChoice: ...
    def solve(
        self, X_WG: object, psi: float, q_near: ArrayLike | None = None, limits: bool = True
    ) -> IkSolutions: ...
    def solve_batch(
        self,
        X_WG: ArrayLike,
        psi: ArrayLike,
        q_near: ArrayLike | None = None,
        limits: bool = True,
        num_threads: int = 1,
    ) -> tuple[NDArray[np.float64], NDArray[np.uint8]]: ...

class KdTree:
    def __init__(self, points: ArrayLike) -> None: ...
    def __len__(self) -> int: ...
    def nearest(
        self, queries: ArrayLike, k: int, max_distance: float, num_threads: int
    ) -> tuple[NDArray[np.int32], NDArray[np.float64]]: ...
    def within_radius(
        self, queries: ArrayLike, radius: float, num_threads: int
    ) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.float64]]:
        """Number for each query; indices and distances of all."""

def fpfh(
    points: ArrayLike, normals: ArrayLike, radius: float, num_threads: int = 1
) -> NDArray[np.float64]: ...
def nearest_features(
    a: ArrayLike, b: ArrayLike, num_threads: int = 1
) -> tuple[NDArray[np.int32], NDArray[np.float64], NDArray[np.float64]]:
    """The row of b nearest to each of a, its distance and that of the second nearest."""

class PointPairTable:
    def __init__(self, points: ArrayLike, normals: ArrayLike, distance_step: float) -> None: ...
    @property
    def num_points(self) -> int: ...
    @property
    def num_pairs(self) -> int: ...
    @property
    def diameter(self) -> float: ...
    def vote(
        self,
        points: ArrayLike,
        normals: ArrayLike,
        num_references: int,
        peaks_per_reference: int,
        max_poses: int,
        num_threads: int = 1,
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]: ...

class MeshSurface:
    def __init__(self, vertices: ArrayLike, triangles: ArrayLike) -> None: ...
    @property
    def is_closed(self) -> bool: ...
    @property
    def num_pieces(self) -> int: ...
    def nearest(
        self, queries: ArrayLike, max_distance: float, num_threads: int
    ) -> tuple[
        NDArray[np.float64],
        NDArray[np.float64],
        NDArray[np.int32],
        NDArray[np.float64],
        NDArray[np.float64],
    ]: ...
    def signed_distance(self, queries: ArrayLike, num_threads: int) -> NDArray[np.float64]: ...
    def winding_number(self, queries: ArrayLike) -> NDArray[np.float64]: ...

# Regions of a cloud (prehensile/regions.h); labels are (N,) int64, -1 for none.
def ransac_plane(
    points: ArrayLike, max_distance: float, confidence: float, max_iterations: int, seed: int
) -> tuple[NDArray[np.float64], NDArray[np.uint8], int]: ...
def euclidean_clusters(
    points: ArrayLike, tolerance: float, min_points: int
) -> NDArray[np.int64]: ...
def grow_planes(
    points: ArrayLike,
    normals: ArrayLike,
    radius: float,
    max_angle: float,
    max_distance: float,
    min_points: int,
) -> tuple[NDArray[np.int64], NDArray[np.float64]]: ...
def convex_segments(
    points: ArrayLike,
    normals: ArrayLike,
    voxel_size: float,
    max_concavity: float,
    max_step: float,
    min_points: int,
) -> NDArray[np.int64]: ...
def resting_pairs(
    points: ArrayLike, normals: ArrayLike, labels: ArrayLike, voxel_size: float, num_labels: int
) -> NDArray[np.int64]: ...

# Registration by iterative closest points.

class IcpCloud:
    def __init__(
        self,
        points: ArrayLike,
        normals: ArrayLike | None,
        intensities: ArrayLike | None,
        tree: bool,
        estimate_normals: bool,
    ) -> None: ...
    def __len__(self) -> int: ...

def icp(
    scene: IcpCloud,
    model: IcpCloud,
    guesses: ArrayLike,
    *,
    kind: str,
    direction: str,
    max_distance: float,
    min_normal_cosine: float,
    kept_fraction: float,
    loss: str,
    loss_scale: float,
    graduated: bool,
    color_weight: float,
    coarse_points: int,
    max_iterations: int,
    tolerance: float,
    keep_history: bool,
    num_threads: int,
) -> list[dict[str, Any]]: ...

# Tracking: a view is (depth (H, W) float32, K (3, 3), X_WC (4, 4), ignored (H, W) uint8 or None);
# X_WB (L, 4, 4) are the poses of the bodies whose fields are given.

def points_near_bodies(
    views: list[tuple[NDArray[np.float32], ArrayLike, ArrayLike, NDArray[np.uint8] | None]],
    fields: list[DistanceField],
    X_WB: ArrayLike,
    boxes: ArrayLike,
    other_fields: list[DistanceField],
    X_WK: ArrayLike,
    max_distance: float,
    other_margin: float,
    max_pixels: int,
    max_normal_angle: float = ...,
) -> NDArray[np.float64]:
    """(M, 3) measured points near the bodies' surfaces and not nearer to the others, on surfaces
    turned no further from the bodies' than max_normal_angle; boxes (L, 2, 3) are the least and
    greatest coordinates of each in B."""

def body_terms(
    points: ArrayLike,
    fields: list[DistanceField],
    X_WB: ArrayLike,
    loss: str,
    loss_scale: float,
    views: list[tuple[NDArray[np.float32], ArrayLike, ArrayLike, NDArray[np.uint8] | None]],
    samples: list[tuple[NDArray[np.float64], NDArray[np.float64]]],
    margin: float,
    max_violation: float,
    search_radius: int,
    free_space_weight: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Gauss-Newton terms of each body: information (L, 6, 6), gradient (L, 6), then the cost, the
    sum of weights and of weighted squares (L, 3), then how many samples (L, 5) face a camera, are
    seen, lie in free space, are occluded, unknown."""

def free_space_violation(
    points_W: ArrayLike,
    view: list[tuple[NDArray[np.float32], ArrayLike, ArrayLike, NDArray[np.uint8] | None]],
    margin: float,
) -> NDArray[np.float64]:
    """(N,) how far points lie in space that the camera saw through [m]."""

# Volumes (prehensile/volumes.h): adds an image to distances and weights (nx, ny, nz) in place.
def integrate_depth(
    distances: NDArray[np.float32],
    weights: NDArray[np.float32],
    voxel_size: float,
    X_WB: ArrayLike,
    depth: NDArray[np.float32],
    intrinsics: ArrayLike,
    X_WC: ArrayLike,
    truncation: float,
    min_depth: float,
    max_depth: float,
    num_threads: int,
) -> None: ...

MOST_FIELD_NODES: int

class DistanceField:
    def __init__(
        self,
        origin: tuple[float, float, float],
        spacing: float,
        sizes: tuple[int, ...],
        nodes: NDArray[np.float32],
        is_signed: bool,
    ) -> None: ...
    @staticmethod
    def from_mesh(
        vertices: ArrayLike,
        triangles: NDArray[np.int32],
        origin: tuple[float, float, float],
        spacing: float,
        sizes: tuple[int, int, int],
        is_signed: bool,
        num_threads: int,
    ) -> DistanceField: ...
    @staticmethod
    def from_cloud(
        points: ArrayLike,
        normals: ArrayLike,
        radius: float,
        origin: tuple[float, float, float],
        spacing: float,
        sizes: tuple[int, int, int],
        num_threads: int,
    ) -> DistanceField: ...
    @property
    def origin(self) -> list[float]: ...
    @property
    def spacing(self) -> float: ...
    @property
    def sizes(self) -> list[int]: ...
    @property
    def is_signed(self) -> bool: ...
    @property
    def nodes(self) -> NDArray[np.float32]: ...
    def at(
        self, points: ArrayLike, num_threads: int
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]: ...
    def closest(self, points: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]: ...

def nearest_body(
    fields: Sequence[DistanceField], X_WL: ArrayLike, points: ArrayLike, num_threads: int
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int32]]: ...

RefinedPose = tuple[
    NDArray[np.float64],
    float,
    int,
    int,
    bool,
    bool,
    NDArray[np.float64],
    float,
    float,
    NDArray[np.float64],
    float,
    NDArray[np.uint8],
    int,
    float,
]

def refine_poses(
    field: DistanceField,
    points: ArrayLike,
    normals: ArrayLike | None,
    X_WO: ArrayLike,
    loss: str,
    scale: float,
    initial_scale: float,
    cooling: float,
    max_distance: float,
    kept_fraction: float,
    min_normal_cosine: float,
    num_coarse_points: int,
    num_finalists: int,
    max_coarse_iterations: int,
    max_iterations: int,
    tolerance: float,
    inlier_distance: float,
    num_threads: int,
) -> list[RefinedPose]:
    """One for each start: X_WO, cost, iterations on few points, on all, converged, finalist,
    information, sum of squares, sum of weights; of a finalist mean and size of the scene, inliers,
    their number and root mean square distance."""

# Depth images (prehensile/depth_fusion.h). A view is (depth (H, W) float32 or uint16, its unit [m],
# (fx, fy, cx, cy), rays (2, H, W) float32 or None, X_WC, colors (H, W, 3) uint8 or None); limits
# are those of prehensile.perception.depth.DepthConfig.limits().
def fuse_depth(
    views: list[tuple[NDArray, float, ArrayLike, NDArray | None, ArrayLike, NDArray | None]],
    X_WB: ArrayLike,
    size: ArrayLike,
    voxel_size: float,
    limits: tuple[float, float, int, float, float, float, float],
    num_threads: int,
    simd: str | None = None,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.uint8] | None]:
    """Points, normals, sensor origins (V, 3) in W, and colors or None."""

def unproject_depth(
    view: tuple[NDArray, float, ArrayLike, NDArray | None, ArrayLike, NDArray | None],
    limits: tuple[float, float, int, float, float, float, float],
    num_threads: int,
    simd: str | None = None,
) -> NDArray[np.float64]: ...
def depth_normals(
    view: tuple[NDArray, float, ArrayLike, NDArray | None, ArrayLike, NDArray | None],
    limits: tuple[float, float, int, float, float, float, float],
    num_threads: int,
    simd: str | None = None,
) -> NDArray[np.float64]: ...
def normals_within_radius(
    points: ArrayLike, radius: float, num_threads: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Normals (N, 3) and surface variations (N,)."""

def normals_of_nearest(
    points: ArrayLike, neighbors: int | None, num_threads: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Normals (N, 3) and surface variations (N,)."""

def normals_of_voxels(
    points: ArrayLike, voxel_size: float, num_threads: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Normals (N, 3) and surface variations (N,)."""

# Consensus among correspondences (prehensile/consensus.h).
class ConsistencyGraph:
    """An undirected graph without loops, its adjacency matrix one bit per pair."""

    @staticmethod
    def from_edges(num_vertices: int, edges: ArrayLike) -> ConsistencyGraph:
        """Of pairs of vertices (E, 2); at most 2^15 vertices."""
    @property
    def num_vertices(self) -> int: ...
    @property
    def num_edges(self) -> int: ...
    def adjacent(self, i: int, j: int) -> bool: ...
    def degrees(self) -> NDArray[np.int32]: ...
    def edges(self) -> NDArray[np.int32]:
        """(E, 2), each once, its smaller vertex first."""

def consistency_graph(
    model_points: ArrayLike,
    scene_points: ArrayLike,
    tolerance: float,
    scale: float,
    min_length: float,
    simd: str | None = None,
) -> ConsistencyGraph: ...
def maximum_clique(
    graph: ConsistencyGraph, exact: bool, min_size: int, max_nodes: int, time_limit: float
) -> tuple[NDArray[np.int32], bool, int]:
    """Vertices, proven, nodes."""

def vote(
    values: ArrayLike, bounds: ArrayLike, most_inliers: bool
) -> tuple[float, NDArray[np.uint8], float]:
    """Estimate, inliers, cost."""

def vote_for_scale(
    model_points: ArrayLike, scene_points: ArrayLike, noise_bound: float
) -> tuple[float, NDArray[np.uint8], float]: ...
def gnc_rotation(
    model_vectors: ArrayLike, scene_vectors: ArrayLike, bound: float, max_iterations: int
) -> tuple[NDArray[np.float64], NDArray[np.uint8], float, int, bool]:
    """R_WO, inliers, cost, iterations, converged."""

def log_false_alarms(num_tests: float, n: int, k: int, chance: float) -> float: ...
def robust_registration(
    model_points: ArrayLike,
    scene_points: ArrayLike,
    noise_bound: float,
    max_nodes: int,
    ambiguity_ratio: float,
    max_false_alarms: float,
    min_inliers: int,
) -> tuple[int, NDArray[np.float64], NDArray[np.uint8], int, int, int, bool, int, float]:
    """Status (found, no consensus, ambiguous), X_WO, inliers, their number, that of a second pose,
    size of the clique, whether it is proven, iterations, log10 of the false alarms."""

def ransac_pose(
    model_points: ArrayLike,
    scene_points: ArrayLike,
    max_distance: float,
    seed: int,
    max_samples: int,
    confidence: float,
) -> tuple[NDArray[np.float64], NDArray[np.uint8], int, int, int, bool, float]:
    """X_WO, inliers, their number, samples, poses, confident, log10 of the false alarms."""

# Coherent point drift.

class GaussianSums:
    def __init__(self, points: ArrayLike) -> None: ...
    def __len__(self) -> int: ...
    def at(
        self, queries: ArrayLike, sigma: float, floor: float, reach: float, num_threads: int
    ) -> NDArray[np.float64]: ...

def spatial_order(points: ArrayLike) -> NDArray[np.int32]: ...
def coherent_point_drift(
    scene: ArrayLike,
    model: ArrayLike,
    X_WO_guess: object,
    *,
    dimension: int,
    outlier_weight: float,
    outlier_volume: float,
    sigma: float,
    max_iterations: int,
    tolerance: float,
    keep_history: bool,
    num_threads: int,
) -> dict[str, Any]: ...

# Branch and bound over poses (prehensile/branch_and_bound.h).
def branch_and_bound(
    scene_points: ArrayLike,
    model_points: ArrayLike,
    max_distance: float,
    max_gap: float,
    planar: bool,
    max_nodes: int,
    time_limit: float,
) -> tuple[NDArray[np.float64], float, float, bool, int]:
    """X_OW, cost, lower bound, whether the gap was reached, nodes."""

def farthest_points(
    points: ArrayLike, count: int, start: int
) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """Indices of the chosen, and how far each was from those before it."""

def eliminate_samples(points: ArrayLike, count: int, radius: float) -> NDArray[np.int32]: ...
def keep_apart(points: ArrayLike, radius: float) -> NDArray[np.int32]: ...

class VoxelHash:
    def __init__(self, max_distance: float) -> None: ...
    def __len__(self) -> int: ...
    def insert(self, points: ArrayLike) -> None: ...
    def nearest(
        self, queries: ArrayLike, num_threads: int
    ) -> tuple[NDArray[np.int32], NDArray[np.float64]]: ...
