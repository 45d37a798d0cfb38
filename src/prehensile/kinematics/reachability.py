"""Workspace and reachability maps: where a frame gets to, from which directions, how freely.

A map is made by forward kinematics of random configurations within the joint limits, into voxels of
the world. The reachability index of a voxel is the share of approach directions that have been seen
in it (F. Zacharias, C. Borst, G. Hirzinger, "Capturing robot workspace structure: representing
robot capabilities", IROS 2007). Everything in a map grows with the number of samples toward what
is true of the arm: counts tell how well a voxel has been looked at, and an index or a
manipulability is a lower bound. Collisions are not looked at unless ``keep`` does.
"""

import io
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from prehensile.errors import Finding, InputError
from prehensile.files import write_atomic
from prehensile.kinematics.jacobians import Part
from prehensile.kinematics.tree import PlantTree
from prehensile.native.reachability import ReachVoxels, add_to_reach, sample_configurations

# Configurations between two reports of progress.
_CHUNK = 1 << 16
_MAX_VOXELS = 50_000_000
_MAX_FILE_BYTES = 4_000_000_000


@dataclass(frozen=True)
class ReachabilityConfig:
    """How a map is made.

    Attributes:
        num_samples: configurations to try, at least 1. For an arm of 1 m and voxels of 5 cm the
            default takes a few seconds and settles the index; a tenth shows the workspace.
        voxel_size: edge length of a voxel (m), > 0.
        num_directions: approach directions that are told apart, 1 to 64, spread evenly.
        axis: the frame's approach axis, in the frame; any length but zero.
        part: what of the frame's velocity manipulability is about; see
            :func:`prehensile.kinematics.jacobians.task_rows`.
        length: characteristic length (m, > 0) by which translational rows are divided.
        seed: of the configurations, 0 .. 2⁶⁴ - 1.
    """

    num_samples: int = 10_000_000
    voxel_size: float = 0.05
    num_directions: int = 64
    axis: tuple[float, float, float] = (0.0, 0.0, 1.0)
    part: Part = "both"
    length: float = 0.5
    seed: int = 0

    def __post_init__(self) -> None:
        for name in ("num_samples", "num_directions", "seed"):
            if not isinstance(getattr(self, name), (int, np.integer)):
                raise ValueError(f"{name}: must be a whole number, not {getattr(self, name)!r}")
        if self.num_samples < 1:
            raise ValueError(f"num_samples: must be at least 1, not {self.num_samples}")
        if not (self.voxel_size > 0 and np.isfinite(self.voxel_size)):
            raise ValueError(f"voxel_size: must be positive and finite, not {self.voxel_size}")
        if not 1 <= self.num_directions <= 64:
            raise ValueError(f"num_directions: must be 1 to 64, not {self.num_directions}")
        if np.shape(self.axis) != (3,) or not 0 < np.linalg.norm(self.axis) < np.inf:
            raise ValueError(f"axis: must be three numbers, not all zero, not {self.axis}")
        if self.part not in ("rotational", "translational", "both"):
            raise ValueError(f"part: must be rotational, translational or both, not {self.part}")
        if not (self.length > 0 and np.isfinite(self.length)):
            raise ValueError(f"length: must be positive and finite, not {self.length}")
        if not 0 <= self.seed < 2**64:
            raise ValueError(f"seed: must be 0 .. 2^64 - 1, not {self.seed}")


@dataclass(frozen=True)
class ReachabilityMap:
    """What a frame reaches. Arrays over voxels have the shape (nx, ny, nz).

    Voxel (i, j, k) of the world W holds the points with i = floor(x · (1 / voxel_size)), and so
    on; it is element (i, j, k) - first of the arrays.

    Attributes:
        voxel_size: edge length (m).
        first: indices of the voxel in the arrays' first corner.
        counts: uint32 number of configurations that put the frame's origin there.
        reached: uint64, bit d set if the approach axis has been seen nearest to directions[d].
        manipulability: largest √det(J Jᵀ) seen there, 0 where nothing was.
        singular_value: largest of the smallest singular values seen there, likewise.
        directions: (D, 3) unit vectors in W.
        num_samples: configurations tried, without those that ``keep`` refused.
        frame: name of the frame.
    """

    voxel_size: float
    first: tuple[int, int, int]
    counts: NDArray[np.uint32]
    reached: NDArray[np.uint64]
    manipulability: NDArray[np.float64]
    singular_value: NDArray[np.float64]
    directions: NDArray[np.float64]
    num_samples: int
    frame: str

    def index(self) -> NDArray[np.float64]:
        """Reachability index 0..1 of each voxel: the share of directions seen there."""
        bits = np.zeros(self.reached.shape, dtype=int)
        for d in range(len(self.directions)):
            bits += ((self.reached >> np.uint64(d)) & np.uint64(1)).astype(int)
        return bits / len(self.directions)

    def centers(self) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Coordinates in W of the voxels' centres along x (nx,), y (ny,) and z (nz,), in m."""
        x, y, z = (
            (first + 0.5 + np.arange(n)) * self.voxel_size
            for first, n in zip(self.first, self.counts.shape, strict=True)
        )
        return x, y, z

    def occupied(self) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
        """Centres (V, 3) in W of the voxels that were reached, and their elements (V, 3)."""
        at = np.argwhere(self.counts > 0)
        corners: NDArray[np.float64] = (at + self.first).astype(np.float64)
        return (corners + 0.5) * self.voxel_size, at

    def volume(self) -> float:
        """Volume of the voxels that were reached (m³)."""
        return float(np.count_nonzero(self.counts) * self.voxel_size**3)

    def elements(self, p_WPs: ArrayLike) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
        """Where points are in the arrays.

        Args:
            p_WPs: (N, 3) finite points in W.

        Returns:
            (N, 3) elements, and (N,) whether the point is within the box of voxels (the element
            is zero where it is not).

        Raises:
            ValueError: points of another shape.
        """
        p_WPs = np.asarray(p_WPs, dtype=float)
        if p_WPs.ndim != 2 or p_WPs.shape[1] != 3:
            raise ValueError(f"p_WPs: expected (N, 3), not {p_WPs.shape}")
        at = np.floor(p_WPs * (1.0 / self.voxel_size)) - self.first
        inside: NDArray[np.bool_] = np.all((at >= 0) & (at < self.counts.shape), axis=1)
        return np.where(inside[:, None], at, 0).astype(np.intp), inside


def fibonacci_directions(count: int) -> NDArray[np.float64]:
    """(count, 3) unit vectors spread evenly over the sphere, on a golden spiral about z; count ≥ 1.

    Source: R. Swinbank, R. J. Purser, "Fibonacci grids", Q. J. R. Meteorol. Soc. 132, 2006.
    """
    if count < 1:
        raise ValueError(f"count: must be at least 1, not {count}")
    k = np.arange(count) + 0.5
    z = 1.0 - 2.0 * k / count
    r = np.sqrt(1.0 - z * z)
    longitude = np.pi * (1.0 + np.sqrt(5.0)) * k
    return np.stack([r * np.cos(longitude), r * np.sin(longitude), z], axis=1)


def reachability_map(
    compiled: PlantTree,
    config: ReachabilityConfig | None = None,
    *,
    frame: int = 0,
    num_threads: int = 1,
    keep: Callable[[NDArray[np.float64]], NDArray[np.bool_]] | None = None,
    on_progress: Callable[[int], None] | None = None,
) -> ReachabilityMap:
    """Makes a map of what a frame reaches within the joint limits.

    Args:
        compiled: joints and frames; a revolute joint without limits turns through -π..π.
        config: how; default: ``ReachabilityConfig()``.
        frame: number of the frame.
        num_threads: at least 1; it does not change the result.
        keep: told configurations (N, n), says which of them count (N,), such as those without
            collision; default: all.
        on_progress: told the number of configurations done so far, now and then.

    Raises:
        ValueError: naming the argument: no such frame; a prismatic joint without limits; voxels so
            small that there would be more than 5e7; ``keep`` answers with something else.
    """
    config = config or ReachabilityConfig()
    tree = compiled.tree
    if not 0 <= frame < tree.num_frames:
        raise ValueError(f"frame: no frame has number {frame}")
    lower, upper = _finite_limits(compiled)
    center, radius = tree.reach(frame, lower, upper)
    # A hair more than the bound, for rounding.
    margin = radius * (1 + 1e-9) + 1e-9
    inverse = 1.0 / config.voxel_size
    first = np.floor((np.array(center) - margin) * inverse)
    shape = np.floor((np.array(center) + margin) * inverse) - first + 1
    if not np.prod(shape) <= _MAX_VOXELS:
        raise ValueError(f"voxel_size: {config.voxel_size} m makes more than {_MAX_VOXELS} voxels")
    shape = shape.astype(int)
    voxels = ReachVoxels(
        config.voxel_size,
        (int(first[0]), int(first[1]), int(first[2])),
        np.zeros(shape, np.uint32),
        np.zeros(shape, np.uint64),
        np.zeros(shape),
        np.zeros(shape),
    )
    directions = fibonacci_directions(config.num_directions)
    axis = np.array(config.axis) / np.linalg.norm(config.axis)
    num_kept = 0
    for start in range(0, config.num_samples, _CHUNK):
        count = min(_CHUNK, config.num_samples - start)
        Q = sample_configurations(
            lower, upper, count, seed=config.seed, first=start, num_threads=num_threads
        )
        if keep is not None:
            kept = np.asarray(keep(Q))
            if kept.shape != (count,) or kept.dtype != bool:
                raise ValueError(f"keep: gave {kept.dtype} {kept.shape} for {count} configurations")
            Q = Q[kept]
        num_kept += len(Q)
        outside = add_to_reach(
            tree,
            Q,
            voxels,
            frame=frame,
            axis=axis.tolist(),
            directions=directions,
            part=config.part,
            length=config.length,
            num_threads=num_threads,
        )
        assert outside == 0
        if on_progress is not None:
            on_progress(start + count)
    return _cropped(voxels, directions, num_kept, compiled.frames[frame])


_ARRAYS = {
    "counts": np.uint32,
    "reached": np.uint64,
    "manipulability": np.float64,
    "singular_value": np.float64,
}


def save_map(path: Path, reach: ReachabilityMap) -> None:
    """Writes a map as a compressed ``.npz`` file; it is whole or not there at all."""
    buffer = io.BytesIO()
    np.savez_compressed(
        buffer,
        voxel_size=reach.voxel_size,
        first=np.array(reach.first, dtype=np.int64),
        directions=reach.directions,
        num_samples=np.int64(reach.num_samples),
        frame=np.array(reach.frame),
        **{name: getattr(reach, name) for name in _ARRAYS},
    )
    write_atomic(path, buffer.getvalue())


def load_map(path: Path) -> ReachabilityMap:
    """Reads what :func:`save_map` wrote; the file is not trusted.

    Raises:
        InputError: no such file, or it is not a whole map.
    """

    def bad(message: str) -> InputError:
        mend = "make it with 'prehensile reach'"
        return InputError(Finding(message, mend, file=str(path)))

    try:
        with zipfile.ZipFile(path) as archive:
            if sum(member.file_size for member in archive.infolist()) > _MAX_FILE_BYTES:
                raise bad("holds more than a map can")
        with np.load(path, allow_pickle=False) as file:
            data = {name: file[name] for name in file.files}
    except FileNotFoundError:
        raise bad("no such file") from None
    except InputError:
        raise
    except Exception as error:  # Damaged archives raise nearly everything.
        raise bad(f"not a reachability map: {error}") from error

    def get(name: str, dtype: type, shape: tuple[int | None, ...]) -> NDArray:
        array = data.get(name)
        if array is None:
            raise bad(f"not a reachability map: {name} is missing")
        fits = array.ndim == len(shape) and all(
            want in (None, got) for want, got in zip(shape, array.shape, strict=True)
        )
        kind = np.issubdtype(array.dtype, dtype)
        if not fits or not kind:
            raise bad(f"{name} is {array.dtype} {array.shape}")
        if np.issubdtype(array.dtype, np.floating) and not np.isfinite(array).all():
            raise bad(f"{name} is not finite")
        return array

    voxel_size = float(get("voxel_size", np.float64, ()))
    first = get("first", np.int64, (3,))
    directions = get("directions", np.float64, (None, 3))
    num_samples = int(get("num_samples", np.int64, ()))
    frame = str(get("frame", np.str_, ()))
    counts = get("counts", np.uint32, (None, None, None))
    arrays = {name: get(name, dtype, counts.shape) for name, dtype in _ARRAYS.items()}
    if not voxel_size > 0:
        raise bad(f"voxel_size is {voxel_size}")
    if not 1 <= len(directions) <= 64:
        raise bad(f"{len(directions)} directions")
    if not np.allclose(np.linalg.norm(directions, axis=1), 1.0):
        raise bad("directions are no unit vectors")
    if num_samples < 0 or int(counts.sum(dtype=np.uint64)) != num_samples:
        raise bad("counts and num_samples disagree")
    if np.any(arrays["reached"] >> np.uint64(len(directions) - 1) > 1):
        raise bad("reached names directions that there are not")
    at = (int(first[0]), int(first[1]), int(first[2]))
    return ReachabilityMap(
        voxel_size=voxel_size,
        first=at,
        directions=directions,
        num_samples=num_samples,
        frame=frame,
        **arrays,
    )


def _finite_limits(compiled: PlantTree) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The joint limits; a full turn for revolute joints that have none."""
    lower, upper = compiled.lower.copy(), compiled.upper.copy()
    free = ~np.isfinite(lower) | ~np.isfinite(upper)
    for i in np.flatnonzero(free):
        if compiled.prismatic[i]:
            raise ValueError(f"compiled: the prismatic joint {compiled.joints[i]} has no limits")
    lower[free], upper[free] = -np.pi, np.pi
    return lower, upper


def _cropped(
    voxels: ReachVoxels, directions: NDArray[np.float64], num_samples: int, frame: str
) -> ReachabilityMap:
    """The smallest box with all that was reached."""
    at = np.argwhere(voxels.counts > 0)
    low = at.min(axis=0) if len(at) else np.zeros(3, dtype=int)
    high = at.max(axis=0) + 1 if len(at) else np.ones(3, dtype=int)
    box = tuple(slice(int(a), int(b)) for a, b in zip(low, high, strict=True))
    first = [int(a + b) for a, b in zip(voxels.first, low, strict=True)]
    return ReachabilityMap(
        voxel_size=voxels.voxel_size,
        first=(first[0], first[1], first[2]),
        counts=voxels.counts[box].copy(),
        reached=voxels.directions[box].copy(),
        manipulability=voxels.manipulability[box].copy(),
        singular_value=voxels.singular_value[box].copy(),
        directions=directions,
        num_samples=num_samples,
        frame=frame,
    )
