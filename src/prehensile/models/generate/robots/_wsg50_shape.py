"""How the gripper looks, and the volume mesh of its pads."""

from pydrake.math import RigidTransform

from prehensile.models.generate.robots._pad import pad_mesh
from prehensile.models.shapes import (
    Material,
    Mesh,
    Part,
    cylinder,
    extrude,
    lathe,
    merge,
    rounded_box,
)

BODY_SIZE = (0.146, 0.0725, 0.05)  # m
FINGER_X = 0.0115  # m, of the fingers from the middle when closed
FINGER_TIP = 0.041  # m, y of the end of the finger in its frame
PAD_LENGTH, PAD_WIDTH = 0.032, 0.022  # m, along y and z
PAD_DEPTH = 0.0075  # m, along x; its face is in the plane where the two fingers meet

ANTHRACITE = Material("anthracite", (0.075, 0.08, 0.088, 1.0), roughness=0.5)
ALUMINIUM = Material("aluminium", (0.62, 0.63, 0.65, 1.0), roughness=0.45)
STEEL_BRIGHT = Material("steel", (0.42, 0.43, 0.45, 1.0), roughness=0.35)
BLACK = Material("black", (0.02, 0.02, 0.022, 1.0), roughness=0.8)
GREEN = Material("lamp", (0.1, 0.8, 0.2, 1.0), roughness=0.4)


def pad_volume() -> str:
    """The pad of a finger, in its frame, as a volume mesh."""
    X_LP = RigidTransform([-FINGER_X, FINGER_TIP - PAD_LENGTH / 2, 0.0])
    return pad_mesh(X_LP, PAD_LENGTH, PAD_WIDTH, depth=FINGER_X, core=0.004)


def body_parts() -> list[Part]:
    """The housing, the guides of the fingers in its front, and the flange behind."""
    x, y, z = BODY_SIZE
    core = rounded_box((x, y - 0.012, z), 0.005).transformed(p_AB=(0, -0.006, 0))
    front = rounded_box((x - 0.004, 0.013, z - 0.004), 0.002).transformed(
        p_AB=(0, y / 2 - 0.0065, 0)
    )
    slot = rounded_box((x - 0.012, 0.002, 0.030), 0.0008).transformed(p_AB=(0, y / 2 - 0.0009, 0))
    rails = merge(
        rounded_box((x - 0.014, 0.003, 0.004), 0.001).transformed(p_AB=(0, y / 2 - 0.0012, side))
        for side in (-0.0095, 0.0095)
    )
    to_y = ((1, 0, 0), (0, 0, 1), (0, -1, 0))  # turns z to y
    # From the face of the arm's flange to the housing: 90 mm less the flange's 45 mm.
    neck = lathe([(0.0, -0.045), (0.036, -0.045), (0.0375, -0.0435), (0.0375, -0.0395),
                  (0.031, -0.0385), (0.031, -0.030), (0.0, -0.030)], 56)  # fmt: skip
    neck = neck.transformed(to_y)
    plug = cylinder(0.007, 0.014, 24, rounding=0.001).transformed(
        ((0, 0, 1), (0, 1, 0), (-1, 0, 0)), (x / 2 + 0.004, -0.018, 0.0)
    )
    label = rounded_box((0.05, 0.014, 0.0006), 0.0002, 2)
    labels = merge(label.transformed(p_AB=(-0.032, -0.012, side * z / 2)) for side in (-1, 1))
    lamp = cylinder(0.0022, 0.0012, 16).transformed(p_AB=(0.058, -0.018, z / 2))
    return [
        Part(core, ANTHRACITE),
        Part(merge([front, neck]), ALUMINIUM),
        Part(merge([slot, plug]), BLACK),
        Part(rails, STEEL_BRIGHT),
        Part(labels, ALUMINIUM),
        Part(lamp, GREEN),
    ]


def finger_parts() -> list[Part]:
    """A finger: the jaw on its guide, the stem, and the ribbed pad of rubber."""
    inner, tip = -0.004, FINGER_TIP
    outline = [(-0.006, -0.041), (0.014, -0.041), (0.014, -0.0135), (0.0135, -0.0115),
               (0.0085, 0.001), (0.0075, 0.004), (0.0066, tip - 0.006), (0.0056, tip - 0.0025),
               (0.0035, tip - 0.0005), (0.0015, tip), (inner, tip), (inner, -0.008),
               (-0.0045, -0.0105), (-0.006, -0.012)]  # fmt: skip
    stem = extrude(outline, 0.019, bevel=0.0012).transformed(p_AB=(0, 0, -0.0095))
    jaw = rounded_box((0.021, 0.029, 0.026), 0.002).transformed(p_AB=(0.004, -0.0262, 0))
    back = rounded_box((0.005, PAD_LENGTH, PAD_WIDTH), 0.0015).transformed(
        p_AB=(inner - 0.0025, tip - PAD_LENGTH / 2, 0)
    )
    count, face = 8, -FINGER_X
    pitch = PAD_LENGTH / count
    rib = rounded_box((0.004, 0.72 * pitch, PAD_WIDTH), 0.0007)
    ribs: list[Mesh] = [
        rib.transformed(p_AB=(face + 0.002, tip - (i + 0.5) * pitch, 0)) for i in range(count)
    ]
    screw = cylinder(0.0028, 0.001, 20).transformed(((0, 0, 1), (0, 1, 0), (-1, 0, 0)))
    screws = merge(screw.transformed(p_AB=(0.0145, y, 0)) for y in (-0.034, -0.0195))
    return [
        Part(jaw, ALUMINIUM),
        Part(stem, STEEL_BRIGHT),
        Part(merge([back, *ribs]), BLACK),
        Part(screws, ANTHRACITE),
    ]
