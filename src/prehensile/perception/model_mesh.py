"""The visible surface of a model's link, for comparing with what cameras see."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from pydrake.geometry import (
    Box,
    Capsule,
    Convex,
    Cylinder,
    Ellipsoid,
    Mesh,
    Role,
    SceneGraph,
    Sphere,
)
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from prehensile.errors import Finding, InputError
from prehensile.models.packages import package_map
from prehensile.models.registry import find_model
from prehensile.models.shapes import primitives
from prehensile.perception.mesh import TriangleMesh, merge_meshes
from prehensile.perception.mesh_file import read_mesh


def mesh_of_model(
    name: str, *, body: str | None = None, packages: Mapping[str, str | Path] | None = None
) -> TriangleMesh:
    """The surface that cameras see of one body of a model, in the body's frame.

    All visual shapes of the body are put together, each at its pose; where they overlap, the parts
    inside stay. Round shapes become polyhedra with 48 segments around, inside of them by up to
    0.2 % of the radius. Meshes must be of a format that :func:`prehensile.perception.mesh_file.
    read_mesh` knows.

    Args:
        name: of a registered model, such as ``mustard_bottle``, or ``package://PACKAGE/PATH``.
        body: name of the link; may be left out if only one has visual shapes.
        packages: further packages, name to folder, as in
            :func:`prehensile.models.registry.find_model`.

    Raises:
        InputError: there is no such model or body, several bodies have visual shapes and none is
            named, the model cannot be loaded, or a mesh cannot be read.
    """
    info = find_model(name, packages)
    plant, scene_graph = MultibodyPlant(0.0), SceneGraph()
    plant.RegisterAsSourceForSceneGraph(scene_graph)
    parser = Parser(plant)
    parser.package_map().AddMap(package_map(packages))
    try:
        (instance,) = parser.AddModels(str(info.path))
    except (RuntimeError, ValueError) as error:
        raise InputError(Finding(f"Drake cannot load it: {error}", file=str(info.path))) from None

    inspector = scene_graph.model_inspector()
    visuals: dict[str, list[TriangleMesh]] = {}
    bodies = [plant.get_body(index) for index in plant.GetBodyIndices(instance)]
    for candidate in bodies:
        frame = plant.GetBodyFrameIdOrThrow(candidate.index())
        ids = inspector.GetGeometries(frame, Role.kPerception)
        if ids and body in (None, candidate.name()):
            visuals[candidate.name()] = [
                shape_mesh(inspector.GetShape(i)).transformed(inspector.GetPoseInFrame(i))
                for i in ids
            ]
    if body is not None and body not in visuals:
        names = ", ".join(b.name() for b in bodies)
        raise InputError(Finding(f"the model '{name}' has no visible body '{body}'", names))
    if len(visuals) != 1:
        message = f"the model '{name}' has {len(visuals)} visible bodies"
        raise InputError(Finding(message, "name one: " + ", ".join(visuals)))
    return merge_meshes(next(iter(visuals.values())))


def shape_mesh(shape: Any) -> TriangleMesh:
    """The surface of a Drake geometry shape, in the geometry's frame.

    Raises:
        InputError: it has none that can be seen as triangles (a half space), or its mesh cannot be
            read.
    """
    match shape:
        case Box():
            solid = primitives.box(shape.size())
        case Cylinder():
            solid = primitives.cylinder(shape.radius(), shape.length())
        case Sphere():
            solid = primitives.sphere(shape.radius())
        case Capsule():
            solid = primitives.capsule(shape.radius(), shape.length())
        case Ellipsoid():
            solid = primitives.sphere(1.0)
            axes = np.array([shape.a(), shape.b(), shape.c()])
            return TriangleMesh(solid.vertices * axes, solid.faces)
        case Mesh() | Convex():
            source = shape.source()
            if not source.is_path():
                raise InputError("a mesh that is held in memory cannot be read")
            mesh = read_mesh(source.path())
            mirrored = np.prod(shape.scale3()) < 0
            order = -1 if mirrored else 1
            return TriangleMesh(mesh.vertices * shape.scale3(), mesh.triangles[:, ::order])
        case _:
            raise InputError(f"a {type(shape).__name__} has no surface of triangles")
    return TriangleMesh(solid.vertices, solid.faces)
