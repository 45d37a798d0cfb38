"""Drawing ellipsoids, such as those of manipulability: on a Meshcat page and as plots.

An ellipsoid is {c + A u : |u| ≤ 1} with A = axes · diag(radii): orthonormal ``axes`` (d, d) as
columns, half lengths ``radii`` (d,), zero and infinite ones among them.
"""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Ellipse
from numpy.typing import ArrayLike, NDArray
from pydrake.geometry import Ellipsoid, Meshcat, Rgba
from pydrake.math import RigidTransform, RotationMatrix

# Half lengths that are drawn for those that are zero or infinite, as shares of the largest finite.
_THINNEST, _LONGEST = 0.01, 10.0


def draw_ellipsoid(
    meshcat: Meshcat,
    path: str,
    p_WE: ArrayLike,
    axes: ArrayLike,
    radii: ArrayLike,
    *,
    scale: float = 1.0,
    color: Rgba | None = None,
) -> None:
    """Puts an ellipsoid on a page; one that is there under this path is replaced.

    Args:
        meshcat: the page.
        path: where in its tree.
        p_WE: (3,) centre in the world, in metres.
        axes: (3, 3) rotation whose columns are its axes in the world.
        radii: (3,) half lengths in a unit of their own, such as (m/s) / (rad/s).
        scale: metres on the page for one such unit.
        color: default: a transparent orange.

    Raises:
        ValueError: axes are no rotation, a radius is negative or NaN, scale is not positive, the
            centre is not finite.
    """
    lengths = _drawable("radii", radii, 3) * _positive("scale", scale)
    # Drake compares rotations to 1e-13; singular vectors may be a little farther off.
    axes = np.asarray(axes, dtype=float)
    orthonormal = axes.shape == (3, 3) and np.allclose(axes.T @ axes, np.eye(3), atol=1e-6)
    if not orthonormal or np.linalg.det(axes) < 0.0:
        raise ValueError("axes: must be (3, 3), orthonormal and right-handed")
    p_WE = np.asarray(p_WE, dtype=float)
    if p_WE.shape != (3,) or not np.isfinite(p_WE).all():
        raise ValueError(f"p_WE: must be three finite numbers, got {p_WE}")
    R_WE = RotationMatrix.ProjectToRotationMatrix(axes)
    meshcat.SetObject(path, Ellipsoid(*lengths), color or Rgba(1.0, 0.55, 0.1, 0.5))
    meshcat.SetTransform(path, RigidTransform(R_WE, p_WE))


def projected(axes: ArrayLike, radii: ArrayLike, rows: tuple[int, int]) -> Ellipse:
    """The shadow of an ellipsoid on two of its coordinates, as a patch about the origin.

    Args:
        axes: (d, d), d = 2 or more.
        radii: (d,).
        rows: the two coordinates, such as (0, 2) for x across and z up.
    """
    axes = np.asarray(axes, dtype=float)
    lengths = _drawable("radii", radii, len(axes))
    U, sigma, _ = np.linalg.svd((axes * lengths)[list(rows)])
    angle = np.degrees(np.arctan2(U[1, 0], U[0, 0]))
    return Ellipse((0.0, 0.0), 2 * sigma[0], 2 * sigma[1], angle=float(angle))


def plot_ellipse(
    plot: Axes,
    center: ArrayLike,
    axes: ArrayLike,
    radii: ArrayLike,
    *,
    rows: tuple[int, int] = (0, 1),
    scale: float = 1.0,
    color: str = "tab:orange",
    label: str = "",
) -> Ellipse:
    """Plots an ellipse, or the shadow of an ellipsoid on two coordinates.

    Args:
        plot: should have equal aspect.
        center: (2,) in the plot's coordinates.
        axes, radii: (d, d) and (d,), d ≥ 2.
        rows: the coordinates across and up.
        scale: units of the plot for one unit of the radii.
        color: of the rim; the inside is a light shade of it.
        label: for a legend.

    Returns:
        What was added to the plot.
    """
    x, y = np.asarray(center, dtype=float)
    shadow = projected(axes, radii, rows)
    scale = _positive("scale", scale)
    ellipse = Ellipse(
        (float(x), float(y)),
        scale * shadow.width,
        scale * shadow.height,
        angle=shadow.angle,
        facecolor=(color, 0.2),
        edgecolor=color,
        label=label,
    )
    plot.add_patch(ellipse)
    return ellipse


def _drawable(name: str, radii: ArrayLike, size: int) -> NDArray[np.float64]:
    """Half lengths of which none is zero or infinite."""
    array = np.asarray(radii, dtype=float)
    if array.shape != (size,) or not (array >= 0).all():
        raise ValueError(f"{name}: expected {size} numbers, none negative, got {radii}")
    finite = array[np.isfinite(array) & (array > 0)]
    largest = float(finite.max()) if len(finite) else 1.0
    return np.clip(array, _THINNEST * largest, _LONGEST * largest)


def _positive(name: str, value: float) -> float:
    if not (value > 0 and np.isfinite(value)):
        raise ValueError(f"{name}: must be positive and finite, not {value}")
    return value
