"""What a model consists of, as Drake sees it: links, joints, mass, size, collision shapes."""

import itertools
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, cast

import numpy as np

from prehensile.errors import Finding, InputError
from prehensile.models.model_file import ModelFileReader
from prehensile.models.packages import find_packages, package_map
from prehensile.models.registry import ModelInfo, load_spheres

if TYPE_CHECKING:
    from pydrake.geometry import GeometryId, SceneGraphInspector
    from pydrake.math import RigidTransform
    from pydrake.multibody.plant import MultibodyPlant
    from pydrake.multibody.tree import ModelInstanceIndex
    from pydrake.planning import RobotDiagram


@dataclass(frozen=True)
class JointSummary:
    """A joint that moves.

    Attributes:
        name: its name.
        type: Drake's name of its type, such as ``revolute``.
        lower: lower position limits, (n,), rad or m.
        upper: upper position limits, (n,).
        velocity: velocity limits, (n,), rad/s or m/s.
        effort: effort limit of its actuator, N m or N; None if it has no actuator.
    """

    name: str
    type: str
    lower: np.ndarray
    upper: np.ndarray
    velocity: np.ndarray
    effort: float | None


@dataclass(frozen=True)
class ModelSummary:
    """What a model consists of.

    Attributes:
        links: names of its links.
        joints: its joints that move.
        mass: mass of the whole in kg.
        lower: (3,) least corner in metres of the box around what is seen and touched, joints at
            their default positions, in the frame of the model's first link.
        upper: (3,) greatest corner.
        collisions: link name to the kinds of its collision shapes, such as ``Box``.
        spheres: link name to the number of its spheres in the sphere model; empty without one.
    """

    links: tuple[str, ...]
    joints: tuple[JointSummary, ...]
    mass: float
    lower: np.ndarray
    upper: np.ndarray
    collisions: dict[str, tuple[str, ...]]
    spheres: dict[str, int]


def summarize(info: ModelInfo, packages: Mapping[str, str | Path] | None = None) -> ModelSummary:
    """Parses a model and says what is in it.

    Args:
        info: the model.
        packages: further packages, name to folder, that its files refer to.

    Returns:
        The summary.

    Raises:
        InputError: what is wrong with the model's files.
    """
    from pydrake.geometry import Role
    from pydrake.multibody.parsing import Parser
    from pydrake.planning import RobotDiagramBuilder

    found = find_packages(packages)
    findings: list[Finding] = []
    package = info.url.removeprefix("package://").split("/", 1)[0]
    ModelFileReader(found, findings).read(info.path, found.get(package, info.path.parent))
    if findings:
        raise InputError(*findings)
    builder = RobotDiagramBuilder()
    parser = Parser(builder.plant())
    for name in parser.package_map().GetPackageNames():
        parser.package_map().Remove(name)
    parser.package_map().AddMap(package_map(packages))
    try:
        instances = parser.AddModels(info.path)
    except (RuntimeError, SystemExit) as error:  # a failed DRAKE_DEMAND is a SystemExit
        raise InputError(Finding(" ".join(str(error).split()), file=str(info.path))) from error
    plant = builder.plant()
    bodies = [
        plant.get_body(index) for instance in instances for index in plant.GetBodyIndices(instance)
    ]
    diagram = cast("RobotDiagram", builder.Build())
    context = diagram.CreateDefaultContext()
    plant_context = diagram.plant().GetMyContextFromRoot(context)
    inspector = diagram.scene_graph().model_inspector()

    corners = [np.zeros((0, 3))]
    collisions: dict[str, tuple[str, ...]] = {}
    for body in bodies:
        frame = plant.GetBodyFrameIdOrThrow(body.index())
        ids = inspector.GetGeometries(frame, Role.kProximity)
        if ids:
            kinds = (type(inspector.GetShape(i)).__name__ for i in ids)
            collisions[body.name()] = tuple(kinds)
        seen = inspector.GetGeometries(frame, Role.kIllustration)
        # O is the first link, the frame that the summary is in.
        X_OB = body.EvalPoseInWorld(plant_context)
        X_OB = bodies[0].EvalPoseInWorld(plant_context).InvertAndCompose(X_OB)
        for geometry in {*ids, *seen}:
            X_OG = X_OB @ inspector.GetPoseInFrame(geometry)
            corners.append(_extreme_points(inspector, geometry, X_OG))
    points = np.concatenate(corners)
    try:
        spheres = {link: len(rows) for link, rows in load_spheres(info).items()}
    except InputError:
        spheres = {}
    return ModelSummary(
        links=tuple(body.name() for body in bodies),
        joints=_joints(plant, instances),
        mass=plant.CalcTotalMass(plant_context, instances),
        lower=points.min(axis=0) if len(points) else np.zeros(3),
        upper=points.max(axis=0) if len(points) else np.zeros(3),
        collisions=collisions,
        spheres=spheres,
    )


def _extreme_points(
    inspector: "SceneGraphInspector", geometry: "GeometryId", X_OG: "RigidTransform"
) -> np.ndarray:
    """Points (N, 3) in frame O whose bounding box is that of a geometry."""
    from pydrake.geometry import Capsule, Sphere

    shape = inspector.GetShape(geometry)
    hull = inspector.GetConvexHull(geometry)
    if hull is not None:
        vertices = [hull.vertex(i) for i in range(hull.num_vertices())]
        return (X_OG @ np.array(vertices).T).T
    if isinstance(shape, Sphere | Capsule):
        half = shape.length() / 2 if isinstance(shape, Capsule) else 0.0
        ends = (X_OG @ np.array([[0, 0, half], [0, 0, -half]]).T).T
        return np.concatenate([ends - shape.radius(), ends + shape.radius()])
    box = inspector.GetObbInGeometryFrame(geometry)
    if box is None:
        return np.zeros((0, 3))  # a half space
    signs = np.array(list(itertools.product((-1, 1), repeat=3)))
    return (X_OG @ box.pose() @ (signs * box.half_width()).T).T


def _joints(
    plant: "MultibodyPlant", instances: "list[ModelInstanceIndex]"
) -> tuple[JointSummary, ...]:
    actuators = (plant.get_joint_actuator(index) for index in plant.GetJointActuatorIndices())
    efforts = {a.joint().index(): a.effort_limit() for a in actuators}
    joints = (plant.get_joint(i) for k in instances for i in plant.GetJointIndices(k))
    return tuple(
        JointSummary(
            name=joint.name(),
            type=joint.type_name(),
            lower=np.array(joint.position_lower_limits(), float),
            upper=np.array(joint.position_upper_limits(), float),
            velocity=np.array(joint.velocity_upper_limits(), float),
            effort=efforts.get(joint.index()),
        )
        for joint in joints
        if joint.num_velocities() > 0 and not joint.type_name().endswith("_floating")
    )
