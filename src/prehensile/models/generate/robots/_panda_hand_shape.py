"""How the Franka hand looks, and the volume mesh of its pads."""

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix

from prehensile.models.generate.robots._pad import pad_mesh
from prehensile.models.shapes import (
    Material,
    Part,
    cylinder,
    extrude,
    lathe,
    loft,
    merge,
    rounded_box,
    rounded_rectangle,
)

BODY_SIZE = (0.044, 0.2, 0.06)  # m, of the housing above the flange
BODY_Z = 0.036  # m, of its middle
FLANGE_RADIUS = 0.0315  # m
FINGER_TIP = 0.0539  # m, z of the end of a finger in its frame
PAD_LENGTH, PAD_WIDTH = 0.0175, 0.0175  # m, along z and x
PAD_Z = FINGER_TIP - PAD_LENGTH / 2  # m, of the middle of the pad

WHITE = Material("white", (0.86, 0.87, 0.88, 1.0), roughness=0.35)
GREY = Material("grey", (0.52, 0.53, 0.55, 1.0), roughness=0.45)
BLACK = Material("black", (0.025, 0.025, 0.028, 1.0), roughness=0.75)
BLUE = Material("lamp", (0.08, 0.3, 0.85, 1.0), roughness=0.4)

_R_UP = ((0, 0, 1), (1, 0, 0), (0, 1, 0))  # turns the plane x, y to y, z


def pad_volume(side: int) -> str:
    """The pad of the finger on the ``side`` (1 or -1) of y as a volume mesh, in its frame."""
    R_LP = RotationMatrix(np.column_stack([(0, side, 0), (0, 0, 1), (side, 0, 0)]))
    X_LP = RigidTransform(R_LP, [0.0, 0.0, PAD_Z])
    return pad_mesh(X_LP, PAD_LENGTH, PAD_WIDTH, depth=0.0125, core=0.006, count=2)


def hand_parts() -> list[Part]:
    """The housing, its lid with the slot that the fingers run in, and the flange."""
    sections = [(0.0065, 0.0195, 0.086), (0.0095, 0.0225, 0.0925), (0.014, 0.0238, 0.0955),
                (0.022, 0.0232, 0.0975), (0.036, 0.0216, 0.0992), (0.052, 0.0196, 0.1004),
                (0.059, 0.0187, 0.1003), (0.0635, 0.0172, 0.0985),
                (0.0657, 0.0150, 0.096)]  # fmt: skip
    outlines = [rounded_rectangle(2 * x, 2 * y, 0.98 * x, 7) for _, x, y in sections]
    housing = loft(outlines, [z for z, _, _ in sections])
    flange = lathe([(0.0, -0.0015), (0.0305, -0.0015), (0.0315, -0.0005), (0.0315, 0.0085),
                    (0.0285, 0.0115), (0.0, 0.0115)], 56)  # fmt: skip
    slot = rounded_box((0.0145, 0.186, 0.0014), 0.0006, 2).transformed(p_AB=(0, 0, 0.0655))
    rails = merge(
        rounded_box((0.0022, 0.184, 0.0016), 0.0006, 2).transformed(p_AB=(x, 0, 0.0658))
        for x in (-0.0042, 0.0042)
    )
    seam = rounded_rectangle(2 * 0.0233, 2 * 0.0981, 0.98 * 0.0233, 7)
    seam_ring = loft([seam, seam], [0.0262, 0.0270])
    lamp = cylinder(0.0017, 0.0012, 16).transformed(((0, 0, 1), (0, 1, 0), (-1, 0, 0)))
    return [
        Part(housing, WHITE),
        Part(flange, GREY),
        Part(merge([slot, seam_ring]), BLACK),
        Part(rails, GREY),
        Part(lamp.transformed(p_AB=(0.0213, 0.06, 0.042)), BLUE),
    ]


def finger_parts(side: int) -> list[Part]:
    """The finger on the ``side`` (1 or -1) of y: carriage, bent stem, pad of rubber."""
    outline = [(0.0026, 0.0002), (0.0263, 0.0002), (0.0263, 0.0205), (0.0252, 0.0245),
               (0.0148, 0.0385), (0.0143, 0.0405), (0.0143, 0.0512), (0.0122, FINGER_TIP),
               (0.0024, FINGER_TIP), (0.0024, 0.0366), (0.0068, 0.0352), (0.0114, 0.0262),
               (0.0116, 0.0224), (0.0114, 0.0068), (0.0026, 0.0068)]  # fmt: skip
    stem = extrude(outline, 0.0185, bevel=0.0009).transformed(_R_UP, (-0.00925, 0, 0))
    carriage = rounded_box((0.021, 0.0145, 0.0195), 0.0014).transformed(p_AB=(0, 0.019, 0.0102))
    count = 6
    pitch = PAD_LENGTH / count
    rib = rounded_box((PAD_WIDTH, 0.003, 0.78 * pitch), 0.0006, 2)
    ribs = merge(
        rib.transformed(p_AB=(0, 0.0015, FINGER_TIP - (i + 0.5) * pitch)) for i in range(count)
    )
    screw = cylinder(0.0024, 0.001, 20).transformed(((1, 0, 0), (0, 0, 1), (0, -1, 0)))
    screws = merge(screw.transformed(p_AB=(0, 0.0263, z)) for z in (0.006, 0.0145))
    turn = ((side, 0, 0), (0, side, 0), (0, 0, 1))
    return [
        Part(stem.transformed(turn), GREY),
        Part(carriage.transformed(turn), GREY),
        Part(merge([ribs, screws]).transformed(turn), BLACK),
    ]
