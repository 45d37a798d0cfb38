"""Pictures of a scene without a browser: a camera anywhere, rendered by Drake's VTK engine."""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydrake.geometry import (
    ClippingRange,
    ColorRenderCamera,
    DepthRange,
    DepthRenderCamera,
    LightParameter,
    MakeRenderEngineVtk,
    QueryObject,
    RenderCameraCore,
    RenderEngineVtkParams,
    SceneGraph,
)
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.framework import Context, Diagram
from pydrake.systems.sensors import CameraInfo

from prehensile.viz.images import as_rgb

_RENDERER = "prehensile_picture"
_BACKGROUND = (0.93, 0.94, 0.96)


def look_at(eye: ArrayLike, target: ArrayLike, up: ArrayLike = (0.0, 0.0, 1.0)) -> RigidTransform:
    """The pose of a camera that looks from one point at another.

    Args:
        eye: (3,) p_WC, where the camera is, in m.
        target: (3,) p_WT, the point in the middle of its picture, in m.
        up: (3,) direction in W that is up in the picture; not along the line of sight.

    Returns:
        X_WC of the optical frame: x right, y down, z into the scene.

    Raises:
        ValueError: eye and target coincide, or up is along the line of sight.
    """
    p_WC = np.asarray(eye, float)
    z = np.asarray(target, float) - p_WC
    x = np.cross(z, np.asarray(up, float))
    if not 1e-9 < np.linalg.norm(x) < np.inf:
        raise ValueError("eye, target, up: must be finite, and the line of sight differ from up")
    y = np.cross(z, x)
    axes = [axis / np.linalg.norm(axis) for axis in (x, y, z)]
    return RigidTransform(RotationMatrix(np.column_stack(axes)), p_WC)


def render(
    diagram: Diagram,
    context: Context,
    X_WC: RigidTransform,
    *,
    width: int = 640,
    height: int = 480,
    fov_y: float = 0.7,
) -> NDArray[np.uint8]:
    """Takes a picture of a diagram's scene as it is in a context.

    Args:
        diagram: holds a SceneGraph, itself or in a diagram within it: a station, a RobotDiagram.
        context: the diagram's, a root; a renderer is added to it the first time.
        X_WC: pose of the camera's optical frame, see :func:`look_at`.
        width, height: of the picture in pixels.
        fov_y: vertical angle of view in rad.

    Returns:
        (height, width, 3) uint8, row 0 on top.

    Raises:
        ValueError: the diagram has no SceneGraph.
    """
    core = RenderCameraCore(
        _RENDERER, CameraInfo(width, height, fov_y), ClippingRange(0.01, 20.0), RigidTransform()
    )
    query = _query(diagram, context)
    image = query.RenderColorImage(
        ColorRenderCamera(core, False), query.inspector().world_frame_id(), X_WC
    )
    return as_rgb(image.data)


def render_depth(
    diagram: Diagram,
    context: Context,
    X_WC: RigidTransform,
    info: CameraInfo,
    *,
    min_depth: float = 0.05,
    max_depth: float = 10.0,
) -> NDArray[np.float32]:
    """Takes an ideal depth image of a diagram's scene as it is in a context.

    Args:
        diagram: as for :func:`render`.
        context: as for :func:`render`.
        X_WC: pose of the camera's optical frame.
        info: its intrinsics; pixel (u, v) has its centre at whole numbers.
        min_depth, max_depth: range of what is seen [m].

    Returns:
        (height, width) depth along the optical axis [m]; 0 nearer and infinity farther than the
        range.

    Raises:
        ValueError: the diagram has no SceneGraph.
    """
    clipping = ClippingRange(0.5 * min_depth, 2 * max_depth)
    # Drake's renderers see through a pixel's corner what the intrinsics say of its centre.
    rendered = CameraInfo(
        info.width(),
        info.height(),
        info.focal_x(),
        info.focal_y(),
        info.center_x() + 0.5,
        info.center_y() + 0.5,
    )
    core = RenderCameraCore(_RENDERER, rendered, clipping, RigidTransform())
    camera = DepthRenderCamera(core, DepthRange(min_depth, max_depth))
    query = _query(diagram, context)
    image = query.RenderDepthImage(camera, query.inspector().world_frame_id(), X_WC)
    return image.data[:, :, 0].copy()


def _query(diagram: Diagram, context: Context) -> QueryObject:
    """What there is to be seen; a renderer is added to the context the first time."""
    scene_graph = _find_scene_graph(diagram)
    if scene_graph is None:
        raise ValueError("diagram: there is no SceneGraph in it")
    scene_context = scene_graph.GetMyMutableContextFromRoot(context)
    if not scene_graph.HasRenderer(scene_context, _RENDERER):
        # One light where the camera is, and one from above, so that tops and sides differ.
        front = LightParameter(type="directional", intensity=1.5)
        above = LightParameter(
            type="directional", frame="world", direction=[0.3, 0.2, -1.0], intensity=1.0
        )
        params = RenderEngineVtkParams(
            default_clear_color=np.array(_BACKGROUND), lights=[front, above]
        )
        scene_graph.AddRenderer(scene_context, _RENDERER, MakeRenderEngineVtk(params))
        # Poses that were computed before are not sent to a new renderer: have them computed anew.
        context.get_mutable_state()
    return scene_graph.get_query_output_port().Eval(scene_context)


def _find_scene_graph(diagram: Diagram) -> SceneGraph | None:
    for system in diagram.GetSystems():
        found = _find_scene_graph(system) if isinstance(system, Diagram) else system
        if isinstance(found, SceneGraph):
            return found
    return None
