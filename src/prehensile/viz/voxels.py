"""Drawing a number for each voxel of a box: coloured points on a Meshcat page, slices as plots."""

from collections.abc import Sequence

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray
from pydrake.geometry import Meshcat
from pydrake.perception import BaseField, Fields, PointCloud

_COLORS = "viridis"


def draw_voxels(
    meshcat: Meshcat,
    path: str,
    centers: ArrayLike,
    values: ArrayLike,
    voxel_size: float,
    *,
    limits: tuple[float, float] | None = None,
) -> None:
    """Puts voxels on a page as points as large as they are, coloured by their values.

    Args:
        meshcat: the page.
        path: where in its tree; what is there is replaced.
        centers: (V, 3) in the world, in metres.
        values: (V,) finite.
        voxel_size: edge length (m).
        limits: values at the ends of the colour scale; default: the least and the largest.
    """
    centers = np.asarray(centers, dtype=float).reshape(-1, 3)
    fields = Fields(int(BaseField.kXYZs) | int(BaseField.kRGBs))
    cloud = PointCloud(len(centers), fields)
    cloud.mutable_xyzs()[:] = centers.T
    cloud.mutable_rgbs()[:] = (255 * _colors(values, limits)).astype(np.uint8).T
    meshcat.SetObject(path, cloud, point_size=0.8 * voxel_size)


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
        ValueError: values is not three-dimensional.
    """
    values = np.asarray(values, dtype=float)
    if values.ndim != 3:
        raise ValueError(f"values: expected (nx, ny, nz), not {values.shape}")
    low = np.array(first) * voxel_size
    high = low + np.array(values.shape) * voxel_size
    cut = [
        int(np.clip(np.floor(x / voxel_size) - first[axis], 0, values.shape[axis] - 1))
        for axis, x in zip((1, 2), at, strict=True)
    ]
    if limits is None:
        limits = (float(np.nanmin(values, initial=np.inf)), float(np.nanmax(values, initial=0.0)))
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


def _colors(values: ArrayLike, limits: tuple[float, float] | None) -> NDArray[np.float64]:
    """(V, 3) colours 0..1."""
    values = np.asarray(values, dtype=float)
    if limits is None:
        limits = (float(values.min(initial=0.0)), float(values.max(initial=0.0)))
    span = max(limits[1] - limits[0], 1e-300)
    return matplotlib.colormaps[_COLORS](np.clip((values - limits[0]) / span, 0, 1))[:, :3]
