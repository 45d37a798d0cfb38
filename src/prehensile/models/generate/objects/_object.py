"""What all household objects share: from shapes and collisions to the files of a model."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from prehensile.files import write_atomic
from prehensile.models.generate.files import write_description, write_spheres
from prehensile.models.generate.objects._cover import cover
from prehensile.models.generate.sdf_model import (
    Collision,
    Inertial,
    Link,
    Model,
    Shape,
    Visual,
    sdf_text,
)
from prehensile.models.shapes import Mesh, Part, write_gltf

_TABLE = (
    "B. Calli, A. Walsman, A. Singh, S. Srinivasa, P. Abbeel, A. Dollar: Benchmarking in "
    "Manipulation Research: The YCB Object and Model Set and Benchmarking Protocols, IEEE "
    "Robotics and Automation Magazine 22(3), 2015, table of the objects"
)
_SCANS = (
    "B. Calli et al.: Yale-CMU-Berkeley dataset for robotic manipulation research, "
    "International Journal of Robotics Research 36(3), 2017, three-dimensional scans"
)


@dataclass(frozen=True)
class HouseholdObject:
    """One rigid object; its frame has the origin amid the bounding box and z up as in the shop.

    Attributes:
        title: for people.
        description: one or two sentences.
        number: of the object in the YCB set, such as "003_cracker_box".
        scanned: whether the dimensions are the bounding box of the set's scan, for objects where
            that differs from the printed table by more than a few millimetres.
        mass: kg.
        parts: what is seen.
        body: closed mesh whose even filling gives centre of mass and inertia.
        collisions: what touches.
    """

    title: str
    description: str
    number: str
    mass: float
    parts: Sequence[Part]
    body: Mesh
    collisions: Sequence[Collision]
    scanned: bool = False


def write_object(folder: Path, thing: HouseholdObject) -> None:
    """Writes NAME.sdf, NAME.gltf, model.yaml and spheres.yaml into the folder NAME."""
    name = folder.name
    write_gltf(folder / f"{name}.gltf", thing.parts)
    properties = thing.body.solid_mass_properties(thing.mass)
    inertia = properties.I_BBcm_B
    (ixx, ixy, ixz), (_, iyy, iyz), (_, _, izz) = np.round(inertia, 9)
    x, y, z = np.round(properties.p_BoBcm_B, 6)
    link = Link(
        "base_link",
        inertial=Inertial(thing.mass, (x, y, z), (ixx, iyy, izz, ixy, ixz, iyz)),
        visuals=(Visual("visual", Shape("mesh", uri=f"package://prehensile/{name}/{name}.gltf")),),
        collisions=tuple(thing.collisions),
    )
    comment = f"{thing.title}: written by python -m prehensile.models.generate {name}"
    write_atomic(folder / f"{name}.sdf", sdf_text(Model(name, comment, (link,))))
    write_description(
        folder,
        title=thing.title,
        category="object",
        description=thing.description,
        sources=[
            f"mass: {_TABLE} ({thing.number})",
            f"dimensions: {_SCANS if thing.scanned else _TABLE} ({thing.number})",
            "shape and print: our own",
        ],
    )
    write_spheres(folder, {"base_link": cover(thing.collisions)})
