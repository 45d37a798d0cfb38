"""A suction cup: a tube on a flange, with a bellows of rubber 40 mm wide at its end.

Frame ``suction_base``: at the face of the flange, z to the lip. Frame ``lip``: in the middle of the
lip's face, z away from the cup. The vacuum itself is a matter of the station's driver.
"""

from pathlib import Path

import numpy as np

from prehensile.files import write_atomic
from prehensile.models.generate import solids
from prehensile.models.generate.files import write_description, write_spheres
from prehensile.models.generate.sdf_model import (
    Collision,
    Contact,
    Frame,
    Link,
    Model,
    Pose,
    Shape,
    Visual,
    sdf_text,
)
from prehensile.models.generate.sphere_cover import cover_model
from prehensile.models.shapes import (
    Material,
    Part,
    circle,
    cylinder,
    lathe,
    merge,
    sweep,
    write_gltf,
)

MASS = 0.2  # kg
FLANGE_RADIUS, FLANGE_HEIGHT = 0.0315, 0.01  # m
TUBE_RADIUS = 0.0125  # m
CUP_RADIUS, CUP_HEIGHT = 0.02, 0.024  # m
LIP_Z = 0.115  # m

METAL = Contact(mu=0.4, relaxation_time=0.02)
RUBBER = Contact(
    mu=1.0, hydroelastic="compliant", modulus=1e6, resolution=0.02, relaxation_time=0.01
)

ALUMINIUM = Material("aluminium", (0.62, 0.63, 0.65, 1.0), roughness=0.45)
BLACK = Material("black", (0.03, 0.03, 0.032, 1.0), roughness=0.6)
SILICONE = Material("silicone", (0.10, 0.22, 0.5, 1.0), roughness=0.8)


def model() -> Model:
    """The suction cup."""

    def at(low: float, high: float) -> Pose:
        return (0.0, 0.0, round((low + high) / 2, 9), 0.0, 0.0, 0.0)

    cup_z = LIP_Z - CUP_HEIGHT
    parts = (
        ("flange", FLANGE_RADIUS, 0.0, FLANGE_HEIGHT, METAL),
        ("tube", TUBE_RADIUS, FLANGE_HEIGHT, cup_z, METAL),
        ("cup", CUP_RADIUS, cup_z, LIP_Z, RUBBER),
    )
    shapes = [
        (name, Shape("cylinder", (radius, round(high - low, 9))), at(low, high), contact)
        for name, radius, low, high, contact in parts
    ]
    base = Link(
        "suction_base",
        inertial=solids.body(MASS, [(shape, pose) for _, shape, pose, _ in shapes]),
        visuals=(Visual("cup", Shape("mesh", uri="cup.gltf")),),
        collisions=tuple(Collision(*shape) for shape in shapes),
    )
    return Model(
        "suction_cup",
        "Suction cup. In the frame of suction_base, z points to the lip; frame lip lies in its"
        " face, z outwards.",
        (base,),
        frames=(Frame("lip", "suction_base", (0.0, 0.0, LIP_Z, 0.0, 0.0, 0.0)),),
    )


def cup_parts() -> list[Part]:
    """Flange, tube with the fitting for its hose, and the bellows, hollow at the lip."""
    flange = lathe([(0.0, 0.0), (0.0308, 0.0), (0.0315, 0.0007), (0.0315, 0.0093), (0.0308, 0.01),
                    (0.0, 0.01)], 56)  # fmt: skip
    tube = lathe([(0.0, 0.008), (0.0125, 0.008), (0.0125, 0.060), (0.0118, 0.061), (0.0118, 0.078),
                  (0.0125, 0.079), (0.0125, 0.090), (0.0, 0.091)], 40)  # fmt: skip
    nut = cylinder(0.0148, 0.008, 6).transformed(p_AB=(0, 0, 0.0695))
    turns = np.linspace(0.0, np.pi / 2, 9)
    hose = [(0.010 + 0.014 * np.sin(a), 0.0, 0.040 + 0.014 * (np.cos(a) - 1.0)) for a in turns]
    bent = sweep(hose, circle(0.0038, 20), up=(0, 1, 0))
    cuff = cylinder(0.0055, 0.006, 24, rounding=0.0008).transformed(
        ((0, 0, 1), (0, 1, 0), (-1, 0, 0)), (0.0145, 0.0, 0.040)
    )
    # Outside from the tube over two folds to the lip, inside back to the middle.
    bellows = lathe([(0.0, 0.0885), (0.0105, 0.0885), (0.0128, 0.0900), (0.0172, 0.0950),
                     (0.0178, 0.0962), (0.0172, 0.0974), (0.0138, 0.1000), (0.0135, 0.1010),
                     (0.0138, 0.1020), (0.0192, 0.1115), (0.0200, 0.1146), (0.0196, 0.1150),
                     (0.0188, 0.1148), (0.0150, 0.1095), (0.0100, 0.1040), (0.0, 0.1030)],
                    56)  # fmt: skip
    return [
        Part(flange, ALUMINIUM),
        Part(tube, ALUMINIUM),
        Part(merge([nut, cuff, bent]), BLACK),
        Part(bellows, SILICONE),
    ]


def generate(folder: Path) -> None:
    """Writes the model."""
    made = model()
    write_gltf(folder / "cup.gltf", cup_parts())
    write_atomic(folder / "suction_cup.sdf", sdf_text(made))
    write_spheres(folder, cover_model(made, bulge=0.014))
    write_description(
        folder,
        title="Suction cup of 40 mm",
        category="hand",
        description=(
            "A bellows cup on a tube, without joints; frame suction_base has z to the lip, frame "
            "lip lies in its face. The cup is compliant hydroelastic. A station's SuctionDriver "
            "draws the vacuum."
        ),
        sources=["Dimensions in the common range of bellows cups of 40 mm; no maker's model"],
    )
