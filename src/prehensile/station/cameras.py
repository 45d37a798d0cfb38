"""Depth cameras whose images are rendered when they are read, and not before.

Frames: W world, P the frame a camera is attached to, B its body, C its optical frame (z forward,
x right and y down in the image), which is that of its depth sensor.
"""

import os
import warnings
from copy import deepcopy
from functools import partial
from typing import NoReturn

from pydrake.common.schema import Transform
from pydrake.common.value import AbstractValue
from pydrake.geometry import (
    FramePoseVector,
    MakeRenderEngineGl,
    MakeRenderEngineGltfClient,
    MakeRenderEngineVtk,
    RenderEngine,
    RenderEngineGlParams,
    RenderEngineGltfClientParams,
    RenderEngineVtkParams,
    Rgba,
    Role,
    SceneGraph,
)
from pydrake.math import RigidTransform
from pydrake.multibody.parsing import GetScopedFrameByName
from pydrake.multibody.plant import MultibodyPlant
from pydrake.perception import BaseField, DepthImageToPointCloud
from pydrake.systems.framework import (
    Context,
    Diagram,
    DiagramBuilder,
    LeafSystem,
    OutputPort,
)
from pydrake.systems.sensors import CameraConfig, PixelType, RgbdSensor

from prehensile.errors import Finding, InputError
from prehensile.perception.depth_noise import DepthNoiseConfig
from prehensile.perception.depth_noise_system import DepthNoise
from prehensile.station.scenario import Scenario


def d415_camera_config(
    name: str,
    X_PC: RigidTransform,
    *,
    base_frame: str = "",
    width: int = 640,
    height: int = 480,
    renderer_name: str = "default",
) -> CameraConfig:
    """Settings of a camera like Intel's RealSense D415, depth aligned to colour.

    Its colour sensor sees 42.6 degrees from top to bottom with square pixels (a focal length of
    615 pixels at 480 lines); depth begins at 0.3 m (Intel RealSense D400 series data sheet,
    337029, sections 3 and 4).

    Args:
        name: the camera's name, first part of its ports' names.
        X_PC: pose of the optical frame C in the frame P it is attached to.
        base_frame: scoped name of P; the world by default.
        width: columns of the images.
        height: rows of the images.
        renderer_name: the renderer, shared by the cameras that name the same.

    Returns:
        Drake's settings, to be put into ``Scenario.cameras``.
    """
    focal = 615.0 * height / 480.0
    return CameraConfig(
        name=name,
        width=width,
        height=height,
        focal=CameraConfig.FocalLength(x=focal, y=focal),
        z_near=0.3,
        z_far=5.0,
        X_PB=Transform(X_PC) if not base_frame else _transform(base_frame, X_PC),
        rgb=True,
        depth=True,
        label=True,
        renderer_name=renderer_name,
    )


def _transform(base_frame: str, X_PC: RigidTransform) -> Transform:
    transform = Transform(X_PC)
    transform.base_frame = base_frame
    return transform


def add_cameras(
    scenario: Scenario, builder: DiagramBuilder, plant: MultibodyPlant, scene_graph: SceneGraph
) -> None:
    """Adds the scenario's cameras to a simulated station and exports their ports.

    These are, of camera NAME, ``NAME.rgb_image`` (ImageRgba8U), ``NAME.depth_image``
    (ImageDepth32F, metres along the optical axis; 0 too near, infinity too far),
    ``NAME.label_image`` (ImageLabel16I), ``NAME.point_cloud`` (points in W, with colours if the
    camera has ``rgb``) and ``NAME.X_WC`` (RigidTransform). All of them are computed on demand;
    of a camera under the scenario's ``depth_noise``, depth image and point cloud are noisy
    (:mod:`prehensile.perception.depth_noise`), and ``cheat.NAME.depth_image`` is the true one. The
    settings ``fps``, ``capture_offset``, ``output_delay`` and ``lcm_bus`` are those of
    Drake's own cameras and have no use here.

    Args:
        scenario: the scenario.
        builder: the station's diagram.
        plant: the finalized plant.
        scene_graph: the scene graph with all of the geometry.

    Raises:
        InputError: settings that Drake refuses, an unknown frame, or a name used twice.
    """
    if not scenario.cameras:
        return
    inside = DiagramBuilder()
    visible = inside.AddNamedSystem("scene_graph", scene_graph.Clone())
    source = plant.get_source_id()
    for geometry in visible.model_inspector().GetAllGeometryIds(Role.kProximity):
        visible.RemoveRole(source, geometry, Role.kProximity)
    inside.ExportInput(visible.get_source_pose_port(source), "geometry_pose")
    for key, config in scenario.cameras.items():
        if not visible.HasRenderer(config.renderer_name):
            visible.AddRenderer(config.renderer_name, _make_renderer(scenario, key))
        sensor = add_sensor(scenario, key, inside, plant, visible)
        depth = sensor.depth_image_32F_output_port()
        noise = scenario.depth_noise.get(key)
        if noise is not None:
            inside.ExportOutput(depth, f"cheat.{config.name}.depth_image")
            depth = _add_noise(inside, config, noise, sensor)
        add_camera_ports(
            inside,
            config,
            rgb=sensor.color_image_output_port(),
            depth=depth,
            label=sensor.label_image_output_port(),
            pose=sensor.body_pose_in_world_output_port(),
        )
    timed = bool(scenario.depth_noise)
    cameras = builder.AddNamedSystem("cameras", Cameras(inside.Build(), timed=timed))
    builder.Connect(plant.get_geometry_pose_output_port(), cameras.get_input_port())
    for i in range(cameras.num_output_ports()):
        port = cameras.get_output_port(i)
        builder.ExportOutput(port, port.get_name())


class Cameras(LeafSystem):
    """All cameras of a station, shut off from the simulation until one is read.

    A scene graph moves the geometry of its renderers whenever anything asks it anything, and each
    system adds to the cost of every step. So the cameras have a scene graph of their own, and all
    of it is in a diagram that the simulator does not see.

    Its input port is ``geometry_pose``, the plant's; its output ports are those of the diagram.

    Args:
        inside: scene graph, sensors and converters; one input port, for the poses.
        timed: whether the outputs depend on the time too, as noise does.
    """

    def __init__(self, inside: Diagram, *, timed: bool = False) -> None:
        super().__init__()
        self._timed = timed
        self._inside, self._context = inside, inside.CreateDefaultContext()
        scene_graph = inside.GetSubsystemByName("scene_graph")
        assert isinstance(scene_graph, SceneGraph)
        frames = scene_graph.model_inspector().GetAllFrameIds()
        self._frames = [frame for frame in frames if frame != scene_graph.world_frame_id()]
        self._key = b""
        self._poses = self.DeclareAbstractInputPort(
            "geometry_pose", inside.get_input_port().Allocate()
        )
        needed = {self._poses.ticket()} | ({self.time_ticket()} if timed else set())
        for i in range(inside.num_output_ports()):
            port = inside.get_output_port(i)
            self.DeclareAbstractOutputPort(
                port.get_name(),
                port.Allocate,
                partial(self._calc, port),
                prerequisites_of_calc=needed,
            )

    def _calc(self, port: OutputPort, context: Context, value: AbstractValue) -> None:
        poses: FramePoseVector = self._poses.Eval(context)
        matrices = (poses.value(frame).GetAsMatrix34() for frame in self._frames)
        key = b"".join(matrix.tobytes() for matrix in matrices)
        if key != self._key:
            self._inside.get_input_port().FixValue(self._context, AbstractValue.Make(poses))
            self._key = key
        if self._timed:
            self._context.SetTime(context.get_time())
        value.set_value(port.Eval(self._context))


def add_sensor(
    scenario: Scenario,
    key: str,
    builder: DiagramBuilder,
    plant: MultibodyPlant,
    scene_graph: SceneGraph,
) -> RgbdSensor:
    """Adds Drake's sensor for one camera, with its body frame at the optical frame C.

    Its port ``body_pose_in_world`` is therefore X_WC.

    Args:
        scenario: the scenario.
        key: the camera's key in ``scenario.cameras``.
        builder: the diagram.
        plant: the finalized plant.
        scene_graph: the scene graph.
    """
    config = deepcopy(scenario.cameras[key])
    if builder.HasSubsystemNamed(f"{config.name}.sensor"):
        _fail(scenario, key, "name", f"two cameras are called '{config.name}'", "rename one")
    frame_name = config.X_PB.base_frame
    try:
        P = GetScopedFrameByName(plant, frame_name) if frame_name else plant.world_frame()
    except RuntimeError:
        _fail(
            scenario,
            key,
            "X_PB.base_frame",
            f"there is no frame '{frame_name}'",
            "name a frame as MODEL::FRAME, or one that a directive adds",
        )
    try:
        X_BC = config.X_BD.GetDeterministicValue()
        X_PC = config.X_PB.GetDeterministicValue() @ X_BC
        config.X_BC = Transform(X_BC.inverse() @ config.X_BC.GetDeterministicValue())
        config.X_BD = Transform()
        # Drake's renderers (VTK and GL, measured with 1.51 and 1.58) see through a pixel's corner
        # what the intrinsics say of its centre; clouds would be half a pixel off, 0.8 mm at 1 m.
        config.center_x, config.center_y = (c + 0.5 for c in config.principal_point())
        color, depth = config.MakeCameras()
    except RuntimeError as error:
        _fail(scenario, key, "", " ".join(str(error).split()), "")
    sensor = builder.AddNamedSystem(
        f"{config.name}.sensor",
        RgbdSensor(
            parent_id=plant.GetBodyFrameIdOrThrow(P.body().index()),
            X_PB=P.GetFixedPoseInBodyFrame() @ X_PC,
            color_camera=color,
            depth_camera=depth,
        ),
    )
    builder.Connect(scene_graph.get_query_output_port(), sensor.query_object_input_port())
    return sensor


def _add_noise(
    builder: DiagramBuilder, config: CameraConfig, noise: DepthNoiseConfig, sensor: RgbdSensor
) -> OutputPort:
    """The port of the noisy depth image of a camera."""
    _, depth_camera = config.MakeCameras()
    system = builder.AddNamedSystem(
        f"{config.name}.depth_noise",
        DepthNoise(depth_camera.core().intrinsics().intrinsic_matrix(), noise),
    )
    depth_input, color_input = system.get_input_port(0), system.get_input_port(1)
    builder.Connect(sensor.depth_image_32F_output_port(), depth_input)
    if _aligned(config) and config.rgb:
        builder.Connect(sensor.color_image_output_port(), color_input)
    return system.get_output_port()


def _aligned(config: CameraConfig) -> bool:
    """Whether depth and colour share their frame, and so their pixels."""
    X_BC, X_BD = config.X_BC, config.X_BD
    return X_BC.GetDeterministicValue().IsExactlyEqualTo(X_BD.GetDeterministicValue())


def add_camera_ports(
    builder: DiagramBuilder,
    config: CameraConfig,
    *,
    rgb: OutputPort,
    depth: OutputPort,
    label: OutputPort,
    pose: OutputPort,
) -> None:
    """Exports a camera's images and pose, and adds the point cloud made of them.

    Args:
        builder: the station's diagram.
        config: the camera's settings.
        rgb: port of the colour image.
        depth: port of the depth image in metres.
        label: port of the label image.
        pose: port of X_WC.
    """
    _, depth_camera = config.MakeCameras()
    colored = config.rgb and _aligned(config)
    cloud = builder.AddNamedSystem(
        f"{config.name}.to_point_cloud",
        DepthImageToPointCloud(
            camera_info=depth_camera.core().intrinsics(),
            pixel_type=PixelType.kDepth32F,
            fields=BaseField.kXYZs | BaseField.kRGBs if colored else BaseField.kXYZs,
        ),
    )
    builder.Connect(depth, cloud.depth_image_input_port())
    if colored:
        builder.Connect(rgb, cloud.color_image_input_port())
    builder.Connect(pose, cloud.camera_pose_input_port())
    for name, port in (
        ("rgb_image", rgb),
        ("depth_image", depth),
        ("label_image", label),
        ("point_cloud", cloud.point_cloud_output_port()),
        ("X_WC", pose),
    ):
        builder.ExportOutput(port, f"{config.name}.{name}")


def _make_renderer(scenario: Scenario, key: str) -> RenderEngine:
    """Makes the renderer that a camera asks for; VTK, which needs no display, by default."""
    config = scenario.cameras[key]
    wanted = config.renderer_class
    background = config.background
    if isinstance(wanted, str):
        named = {
            "": RenderEngineVtkParams,
            "RenderEngineVtk": RenderEngineVtkParams,
            "RenderEngineGl": RenderEngineGlParams,
            "RenderEngineGltfClient": RenderEngineGltfClientParams,
        }
        if wanted not in named:
            known = ", ".join(name for name in named if name)
            _fail(scenario, key, "renderer_class", f"unknown renderer '{wanted}'", f"use {known}")
        wanted = named[wanted]()
        if isinstance(wanted, RenderEngineVtkParams):
            wanted.default_clear_color = _rgb(background)
        else:
            wanted.default_clear_color = background
    if isinstance(wanted, RenderEngineGlParams) and not os.environ.get("DISPLAY"):
        warnings.warn(
            f"camera '{config.name}' asks for RenderEngineGl, which needs a display, and there is "
            "none; it is rendered by RenderEngineVtk",
            stacklevel=2,
        )
        wanted = RenderEngineVtkParams(default_clear_color=_rgb(background))
    if isinstance(wanted, RenderEngineGlParams):
        return MakeRenderEngineGl(wanted)
    if isinstance(wanted, RenderEngineGltfClientParams):
        return MakeRenderEngineGltfClient(wanted)
    return MakeRenderEngineVtk(wanted)


def _rgb(color: Rgba) -> list[float]:
    return [color.r(), color.g(), color.b()]


def _fail(scenario: Scenario, key: str, field: str, message: str, mend: str) -> NoReturn:
    path = f"cameras.{key}" + (f".{field}" if field else "")
    raise InputError(Finding(message, mend, file=str(scenario.file or ""), key=path))
