"""Drawing a number for each voxel of a box: coloured cubes on a Meshcat page, slices as plots."""

from collections.abc import Sequence

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray
from pydrake.geometry import Meshcat, Rgba, SurfaceTriangle, TriangleSurfaceMesh

_COLORS = "viridis"
_STEPS = 16


def draw_voxels(
    meshcat: Meshcat,
    path: str,
    values: ArrayLike,
    first: Sequence[int],
    voxel_size: float,
    *,
    limits: tuple[float, float] | None = None,
) -> None:
    """Puts voxels on a page as cubes coloured by their values, in sixteen steps.

    Args:
        meshcat: the page.
        path: where in its tree; what is there is replaced.
        values: (nx, ny, nz); where it is NaN there is no cube.
        first: indices in the world of the first voxel: it begins at first · voxel_size.
        voxel_size: edge length (m).
        limits: values at the ends of the colour scale; default: the least and the largest.

    Raises:
        ValueError: values is not three-dimensional, or voxel_size is not positive.
    """
    values = _box(values, voxel_size)
    low, high = limits or _limits(values)
    shade = np.clip((values - low) / max(high - low, 1e-300) * _STEPS, 0, _STEPS - 1)
    at, quads = _faces(np.isfinite(values))
    corners = (quads + np.asarray(first)) * voxel_size
    step_of_face = shade[tuple(at.T)].astype(int)
    colors = matplotlib.colormaps[_COLORS](np.linspace(0, 1, _STEPS))
    meshcat.Delete(path)
    for step in np.unique(step_of_face):
        points = corners[step_of_face == step].reshape(-1, 3)
        triangles = [
            SurfaceTriangle(k, k + i, k + i + 1) for k in range(0, len(points), 4) for i in (1, 2)
        ]
        mesh = TriangleSurfaceMesh(triangles, list(points))
        meshcat.SetObject(f"{path}/{step}", mesh, Rgba(*colors[step]))


def _faces(present: NDArray[np.bool_]) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """The faces that voxels do not share: (F, 3) whose, and (F, 4, 3) corners in voxels.

    Corners go counter-clockwise, seen from outside.
    """
    padded = np.pad(present, 1)
    whose, corners = [], []
    for axis in range(3):
        across, up = np.eye(3)[(axis + 1) % 3], np.eye(3)[(axis + 2) % 3]
        square = np.array([np.zeros(3), across, across + up, up])
        for side in (0, 1):
            neighbour = np.roll(padded, 1 - 2 * side, axis)[1:-1, 1:-1, 1:-1]
            at = np.argwhere(present & ~neighbour)
            face = (square if side else square[::-1]) + side * np.eye(3)[axis]
            whose.append(at)
            corners.append(at[:, None] + face)
    return np.concatenate(whose), np.concatenate(corners)


def plot_slices(
    values: ArrayLike,
    first: Sequence[int],
    voxel_size: float,
    *,
    label: str,
    at: tuple[float, float] = (0.0, 0.4),
    limits: tuple[float, float] | None = None,
) -> Figure:
    """Pictures of a box of voxels cut upright, at one y, and level, at one z.

    Args:
        values: (nx, ny, nz); NaN is left white.
        first: indices in the world of the first voxel: it begins at first · voxel_size.
        voxel_size: edge length (m).
        label: what the values are, for the colour bar.
        at: y of the upright cut and z of the level one (m), moved into the box if outside.
        limits: values at the ends of the colour scale; default: the least and the largest.

    Raises:
        ValueError: values is not three-dimensional or empty, voxel_size is not positive, or a cut
            is not finite.
    """
    values = _box(values, voxel_size)
    if values.size == 0:
        raise ValueError(f"values: there are none, {values.shape}")
    if not np.isfinite(at).all():
        raise ValueError(f"at: must be finite, not {at}")
    low = np.array(first) * voxel_size
    high = low + np.array(values.shape) * voxel_size
    cut = [
        int(np.clip(np.floor(x / voxel_size) - first[axis], 0, values.shape[axis] - 1))
        for axis, x in zip((1, 2), at, strict=True)
    ]
    limits = limits or _limits(values)
    panels = (
        (values[:, cut[0], :], 0, 2, "x", "z", "y", first[1] + cut[0]),
        (values[:, :, cut[1]], 0, 1, "x", "y", "z", first[2] + cut[1]),
    )
    figure = Figure(figsize=(11, 4.6), layout="constrained")
    plots = figure.subplots(1, 2)
    images = []
    for plot, (picture, across, up, name_across, name_up, normal, k) in zip(
        plots, panels, strict=True
    ):
        image = plot.imshow(
            picture.T,
            origin="lower",
            extent=(low[across], high[across], low[up], high[up]),
            cmap=_COLORS,
            vmin=limits[0],
            vmax=limits[1],
            interpolation="nearest",
        )
        images.append(image)
        plot.set_xlabel(f"{name_across} (m)")
        plot.set_ylabel(f"{name_up} (m)")
        plot.set_title(f"{normal} = {k * voxel_size:.3g} .. {(k + 1) * voxel_size:.3g} m")
        plot.plot(0, 0, "+", color="black")
    figure.colorbar(images[0], ax=list(plots), label=label, shrink=0.9)
    return figure


def _box(values: ArrayLike, voxel_size: float) -> NDArray[np.float64]:
    array = np.asarray(values, dtype=float)
    if array.ndim != 3:
        raise ValueError(f"values: expected (nx, ny, nz), not {array.shape}")
    if not 0.0 < voxel_size < np.inf:
        raise ValueError(f"voxel_size: must be positive and finite, not {voxel_size}")
    return array


def _limits(values: NDArray[np.float64]) -> tuple[float, float]:
    finite = values[np.isfinite(values)]
    return (float(finite.min()), float(finite.max())) if len(finite) else (0.0, 1.0)
