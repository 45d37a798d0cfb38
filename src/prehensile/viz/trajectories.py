"""Trajectories to look at: lines and triads in Meshcat, animations, and plots over time.

A trajectory is a function of time here: X_WB(t), V_WB(t) (6,), or joint positions (n, 1) as a Drake
trajectory. Those of :mod:`prehensile.kinematics.trajectories` and Drake's ``PiecewisePose``
(``GetPose``) come with such functions.
"""

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MultipleLocator
from numpy.typing import ArrayLike, NDArray
from pydrake.geometry import Cylinder, Meshcat, Rgba
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from pydrake.systems.framework import Context, Diagram
from pydrake.trajectories import Trajectory

from prehensile.viz.replay import FRAMES_PER_SECOND

PoseFunction = Callable[[float], RigidTransform]

AXIS_COLORS = ("#c0392b", "#27913f", "#2458b8")
"""x red, y green, z blue, as everywhere in robotics."""

# The same for Meshcat, whose light takes much of a colour away.
_BRIGHT = ((1.0, 0.1, 0.1), (0.1, 0.85, 0.2), (0.2, 0.35, 1.0))
_BLUE = Rgba(0.14, 0.35, 0.72)
_SAMPLES = 301


def draw_triad(
    meshcat: Meshcat,
    path: str,
    X_WF: RigidTransform,
    *,
    length: float = 0.06,
    radius: float = 0.0025,
    opacity: float = 1.0,
) -> None:
    """Draws the axes of a frame: x red, y green, z blue.

    Args:
        meshcat: where to.
        path: name of the drawing; moving it (``SetTransform``) moves the frame.
        X_WF: pose of the frame.
        length: of an axis, in m.
        radius: of an axis, in m.
        opacity: 0 to 1.

    Raises:
        ValueError: a length or radius that is not positive and finite.
    """
    if not (0.0 < length < np.inf and 0.0 < radius < np.inf):  # Drake would end the process
        raise ValueError(f"length, radius: must be positive and finite, not {length}, {radius}")
    turns = (
        RotationMatrix.MakeYRotation(np.pi / 2),
        RotationMatrix.MakeXRotation(-np.pi / 2),
        RotationMatrix(),
    )
    for name, turn, color in zip("xyz", turns, _BRIGHT, strict=True):
        part = f"{path}/{name}"
        meshcat.SetObject(part, Cylinder(radius, length), Rgba(*color, opacity))
        X_FAxis = RigidTransform(turn) @ RigidTransform([0.0, 0.0, 0.5 * length])
        meshcat.SetTransform(part, X_FAxis)
    meshcat.SetTransform(path, X_WF)


def draw_pose_trajectory(
    meshcat: Meshcat,
    path: str,
    pose: PoseFunction,
    start: float,
    end: float,
    *,
    keyframes: Mapping[str, RigidTransform] | None = None,
    triads: int = 0,
    color: Rgba = _BLUE,
    line_width: float = 3.0,
    length: float = 0.06,
) -> None:
    """Draws the line of a frame's origin, and the frame at keyframes and along the way.

    Args:
        meshcat: where to.
        path: name of the drawing; what was drawn under it before is removed.
        pose: X_WB(t).
        start, end: first and last time, in s.
        keyframes: poses to draw, by name.
        triads: number of further ones, thinner, evenly in time.
        color: of the line.
        line_width: in pixels.
        length: of the axes, in m.
    """
    origins = [pose(t).translation() for t in _times(start, end, _SAMPLES)]
    meshcat.Delete(path)
    meshcat.SetLine(f"{path}/line", np.asfortranarray(np.transpose(origins)), line_width, color)
    for name, X_WB in (keyframes or {}).items():
        draw_triad(meshcat, f"{path}/keyframes/{name}", X_WB, length=length)
    for k, t in enumerate(np.linspace(start, end, triads) if triads else ()):
        draw_triad(
            meshcat, f"{path}/triads/{k}", pose(t),
            length=0.6 * length, radius=0.0012, opacity=0.7,
        )  # fmt: skip


def animate(
    meshcat: Meshcat,
    show: Callable[[float], None],
    start: float,
    end: float,
    *,
    frames_per_second: float = FRAMES_PER_SECOND,
) -> None:
    """Shows a motion frame by frame; a recording that has been started gets every frame.

    With a :class:`~prehensile.viz.replay.Recorder` around it this makes a replay file:

        with Recorder(meshcat, "motion.html"):
            animate(meshcat, lambda t: meshcat.SetTransform("hand", pose(t), t), 0.0, 5.0)

    Args:
        meshcat: where the motion is shown; what is shown is flushed to the browser.
        show: shows the state at a time (s) such as by ``meshcat.SetTransform(path, X, time)``, or
            by :func:`shown_by_diagram`.
        start, end: first and last time, in s.
        frames_per_second: frames per second of the motion (> 0).
    """
    if not (0.0 < frames_per_second < np.inf and 0.0 <= end - start < np.inf):
        raise ValueError("frames_per_second must be positive, and end not before start; all finite")
    # Whole frames, so that a recording at the same rate keeps each of them, and both ends.
    first, last = start * frames_per_second, end * frames_per_second
    for frame in range(math.floor(first), math.ceil(last) + 1):
        show(min(max(frame / frames_per_second, start), end))
    meshcat.Flush()


def shown_by_diagram(
    diagram: Diagram, context: Context, update: Callable[[float, Context], None]
) -> Callable[[float], None]:
    """A way to show a motion for :func:`animate`: the diagram's own visualizer publishes it.

    Args:
        diagram: with a ``MeshcatVisualizer``.
        context: the diagram's; its time and what ``update`` sets are changed.
        update: sets the state of the motion at a time in the context, such as the positions of
            a plant or the pose of a free body.

    Returns:
        The function of time.
    """

    def show(t: float) -> None:
        context.SetTime(t)
        update(t, context)
        diagram.ForcedPublish(context)

    return show


def plot_pose_trajectory(
    pose: PoseFunction,
    velocity: Callable[[float], NDArray[np.float64]],
    start: float,
    end: float,
    keyframes: Mapping[str, float] | None = None,
) -> Figure:
    """Plots position, orientation and spatial velocity of a frame over time.

    Args:
        pose: X_WB(t).
        velocity: V_WB(t), (6,), rotational first.
        start, end: first and last time, in s.
        keyframes: times to mark, by name.

    Returns:
        A figure of four plots: position and orientation (roll, pitch, yaw, without jumps of a whole
        turn), below them their velocities.
    """
    times = _times(start, end, 2 * _SAMPLES)
    poses = [pose(t) for t in times]
    p = np.array([X.translation() for X in poses])
    rpy = np.array([RollPitchYaw(X.rotation()).vector() for X in poses])
    V = np.array([velocity(t) for t in times])
    figure = Figure(figsize=(11.0, 6.0), layout="constrained")
    axes = figure.subplots(2, 2, sharex=True)
    for ax, values, title, names in (
        (axes[0, 0], p, "position (m)", ("x", "y", "z")),
        (axes[0, 1], np.unwrap(rpy, axis=0), "orientation (rad)", ("roll", "pitch", "yaw")),
        (axes[1, 0], V[:, 3:], "translational velocity (m/s)", ("x", "y", "z")),
        (axes[1, 1], V[:, :3], "angular velocity (rad/s)", ("x", "y", "z")),
    ):
        for k in range(3):
            ax.plot(times, values[:, k], color=AXIS_COLORS[k], label=names[k])
        ax.set_title(title, fontsize=10, loc="left")
        _finish(ax, start, end, keyframes)
        ax.legend(fontsize=8, loc="best")
    _name_keyframes(list(axes[0]), keyframes)
    for ax in axes[1]:
        ax.set_xlabel("time (s)")
    return figure


def plot_joint_trajectory(
    trajectory: Trajectory,
    names: Sequence[str],
    *,
    lower: ArrayLike,
    upper: ArrayLike,
    velocity: ArrayLike,
    acceleration: ArrayLike,
    keyframes: Mapping[str, float] | None = None,
) -> Figure:
    """Plots positions, velocities and accelerations of joints as fractions of their limits.

    What lies between the two dashed lines is within the limits. Positions are counted from the
    middle of their range, where it is finite; what has no limit is drawn in rad or m, rad/s ...

    Args:
        trajectory: (n, 1), with derivatives.
        names: of the n joints.
        lower, upper: (n,) limits of the positions.
        velocity, acceleration: (n,) largest absolute values.
        keyframes: times to mark, by name.

    Returns:
        A figure of three plots, one above the other.

    Raises:
        ValueError: names or limits of another number of joints.
    """
    for name, values in (
        ("names", names),
        ("lower", lower),
        ("upper", upper),
        ("velocity", velocity),
        ("acceleration", acceleration),
    ):
        if np.shape(values) != (trajectory.rows(),):
            raise ValueError(f"{name} must be ({trajectory.rows()},), got {np.shape(values)}")
    start, end = trajectory.start_time(), trajectory.end_time()
    times = _times(start, end, 2 * _SAMPLES)
    low, high = np.asarray(lower, float), np.asarray(upper, float)
    bounded = np.isfinite(low) & np.isfinite(high)
    middle = np.where(bounded, 0.5 * (np.where(bounded, low, 0) + np.where(bounded, high, 0)), 0.0)
    half_range = np.where(bounded, high - middle, np.inf)
    rows = [
        (trajectory.value, middle, half_range, "position, of half the range"),
        (lambda t: trajectory.EvalDerivative(t, 1), 0.0, velocity, "velocity, of the limit"),
        (
            lambda t: trajectory.EvalDerivative(t, 2),
            0.0,
            acceleration,
            "acceleration, of the limit",
        ),
    ]
    figure = Figure(figsize=(9.0, 8.0), layout="constrained")
    axes = figure.subplots(3, 1, sharex=True)
    for ax, (evaluate, offset, limit, title) in zip(axes, rows, strict=True):
        limit = np.asarray(limit, float)
        values = np.array([evaluate(t).ravel() for t in times]) - offset
        values = values / np.where(np.isfinite(limit), limit, 1.0)
        for j, name in enumerate(names):
            unit = "" if np.isfinite(limit[j]) else " (no limit)"
            ax.plot(times, values[:, j], label=name + unit, linewidth=1.2)
        for side in (-1.0, 1.0):
            ax.axhline(side, color="0.35", linestyle="--", linewidth=0.9)
        ax.set_title(title, fontsize=10, loc="left")
        _finish(ax, start, end, keyframes)
    _name_keyframes([axes[0]], keyframes)
    axes[-1].set_xlabel("time (s)")
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside right upper", fontsize=8)
    return figure


def plot_pose_trajectory_3d(
    pose: PoseFunction,
    start: float,
    end: float,
    keyframes: Mapping[str, RigidTransform] | None = None,
    length: float = 0.05,
) -> Figure:
    """Plots the way of a frame's origin in space, with the axes of the frame at keyframes.

    Args:
        pose: X_WB(t).
        start, end: first and last time, in s.
        keyframes: poses to draw, by name.
        length: of the axes, in m.
    """
    p = np.array([pose(t).translation() for t in _times(start, end, _SAMPLES)])
    figure = Figure(figsize=(7.0, 6.0), layout="constrained")
    ax = figure.add_subplot(projection="3d")
    ax.plot(*p.T, color="#55606c", linewidth=1.5)
    corners = [p.min(axis=0), p.max(axis=0)]
    labels: dict[tuple[float, ...], list[str]] = {}
    for name, X_WB in (keyframes or {}).items():
        origin, R = X_WB.translation(), X_WB.rotation().matrix()
        for k in range(3):
            tip = origin + length * R[:, k]
            ax.plot(*np.column_stack([origin, tip]), color=AXIS_COLORS[k], linewidth=2.0)
            corners.append(tip)
        labels.setdefault(tuple(np.round(origin, 3)), []).append(name)
    for (x, y, z), names in labels.items():
        ax.text(x, y, z, "  " + ", ".join(names), fontsize=8)
    lower, upper = np.min(corners, axis=0), np.max(corners, axis=0)
    for set_limits, a, b in zip((ax.set_xlim, ax.set_ylim, ax.set_zlim), lower, upper, strict=True):
        set_limits(a - 0.02, b + 0.02)
    if np.max(upper - lower) < 2.0:
        for axis in (ax.xaxis, ax.yaxis, ax.zaxis):
            axis.set_major_locator(MultipleLocator(0.1))
    ax.set_box_aspect(upper - lower + 0.04)
    for label, name in zip((ax.set_xlabel, ax.set_ylabel, ax.set_zlabel), "xyz", strict=True):
        label(f"{name} (m)")
    return figure


def _times(start: float, end: float, count: int) -> NDArray[np.float64]:
    if not 0.0 <= end - start < np.inf:
        raise ValueError(f"start, end: must be finite, end not before start, got {start}, {end}")
    return np.linspace(start, end, count)


def _finish(ax: Axes, start: float, end: float, keyframes: Mapping[str, float] | None) -> None:
    ax.set_xlim(start, max(end, start + 1e-9))
    ax.grid(color="0.92")
    for t in (keyframes or {}).values():
        ax.axvline(t, color="0.7", linewidth=0.8, zorder=0)


def _name_keyframes(axes: Sequence[Axes], keyframes: Mapping[str, float] | None) -> None:
    """Names above the marks of keyframes."""
    for ax in axes:
        for name, t in (keyframes or {}).items():
            ax.annotate(
                name, (t, 1.0), xytext=(1, 3), textcoords="offset points", fontsize=7,
                xycoords=("data", "axes fraction"), rotation=35, ha="left", va="bottom",
            )  # fmt: skip
        if keyframes:
            ax.set_title(ax.get_title(loc="left"), fontsize=10, loc="left", pad=42)
