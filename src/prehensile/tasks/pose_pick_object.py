"""What is prepared once of the object that pose-pick looks for: surface, grasps, registration."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RotationMatrix
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from prehensile.grasping import WSG50
from prehensile.models.registry import find_model, package_map
from prehensile.models.shapes.gltf import read_gltf
from prehensile.perception.mesh import TriangleMesh
from prehensile.perception.registration.known_object import KnownObject
from prehensile.tasks.pose_pick import KnownShape
from prehensile.tasks.pose_pick_grasps import ModelGrasp, model_grasps, surface_cloud

MODEL = "mustard_bottle"


@dataclass(frozen=True, eq=False)
class PreparedObject:
    """An object of known shape; nothing in it changes, so many runs may share it.

    Attributes:
        model: name of the embedded model.
        vertices: (V, 3) of its surface in O [m].
        shape: its surface as a cloud, its extent and symmetries.
        grasps: how the hand may hold it, best first.
        known: what registration needs of it.
    """

    model: str
    vertices: NDArray[np.float64]
    shape: KnownShape
    grasps: list[ModelGrasp]
    known: KnownObject


def prepare_object(model: str = MODEL) -> PreparedObject:
    """Prepares an embedded model that half a turn about its upward axis leaves as it is.

    Args:
        model: its name.

    Raises:
        InputError: there is no such model.
    """
    vertices, faces = load_surface(model)
    plant = MultibodyPlant(0.0)
    parser = Parser(plant)
    parser.package_map().AddMap(package_map())
    (instance,) = parser.AddModels(url=find_model(model).url)
    plant.Finalize()
    cloud_O = surface_cloud(vertices, faces)
    p_OCm = plant.GetBodyByName("base_link", instance).default_com()
    symmetries = [RotationMatrix(), RotationMatrix.MakeZRotation(np.pi)]
    return PreparedObject(
        model=model,
        vertices=vertices,
        shape=KnownShape(cloud_O, 0.5 * np.ptp(vertices, axis=0), symmetries),
        grasps=model_grasps(cloud_O, p_OCm, WSG50),
        known=KnownObject.from_mesh(TriangleMesh(vertices, faces)),
    )


def load_surface(model: str) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Vertices (V, 3) in O [m] and faces (F, 3) of an embedded model's surface."""
    path = find_model(model).path.with_suffix(".gltf")
    vertices, faces, count = [], [], 0
    for part in read_gltf(path):
        vertices.append(part.mesh.vertices)
        faces.append(part.mesh.faces + count)
        count += len(part.mesh.vertices)
    return np.concatenate(vertices), np.concatenate(faces)
