"""Intel RealSense D415: its body, and the frames in which its pictures are taken.

The frame ``base_link`` lies on the thread for the tripod, in the middle of the underside: x to the
front, y to the left, z up. Optical frames have z to the front, x to the right, y down.
"""

from math import pi
from pathlib import Path

from prehensile.files import write_atomic
from prehensile.models.generate import solids
from prehensile.models.generate.files import write_description, write_spheres
from prehensile.models.generate.sdf_model import (
    Collision,
    Contact,
    Frame,
    Link,
    Model,
    Shape,
    Visual,
    sdf_text,
)
from prehensile.models.generate.sphere_cover import cover_model
from prehensile.models.shapes import (
    Material,
    Part,
    cylinder,
    extrude,
    merge,
    rounded_rectangle,
    write_gltf,
)

DEPTH, WIDTH, HEIGHT = 0.02, 0.099, 0.023  # m, along x, y, z
MASS = 0.072  # kg
LEFT_IMAGER_Y = 0.02  # m; the origin of the depth image
COLOR_Y = LEFT_IMAGER_Y + 0.015  # m
RIGHT_IMAGER_Y = LEFT_IMAGER_Y - 0.055  # m
BEHIND_GLASS = 0.0011  # m, of the origin of the depth image behind the face of the camera


def model() -> Model:
    """The camera."""
    block = Shape("box", (DEPTH, WIDTH, HEIGHT))
    middle = (0.0, 0.0, HEIGHT / 2, 0.0, 0.0, 0.0)
    body = Link(
        "base_link",
        inertial=solids.body(MASS, [(block, middle)]),
        visuals=(Visual("body", Shape("mesh", uri="body.gltf")),),
        collisions=(Collision("body", block, middle, Contact(mu=0.4, relaxation_time=0.05)),),
    )
    x, z = DEPTH / 2 - BEHIND_GLASS, HEIGHT / 2
    frames = [Frame("camera_link", "base_link", (0.0, LEFT_IMAGER_Y, z, 0.0, 0.0, 0.0))]
    for name, y in (("depth", LEFT_IMAGER_Y), ("color", COLOR_Y)):
        frames.append(Frame(f"{name}_frame", "base_link", (x, y, z, 0.0, 0.0, 0.0)))
        frames.append(Frame(f"{name}_optical_frame", "base_link", (x, y, z, -pi / 2, 0.0, -pi / 2)))
    comment = "Intel RealSense D415. The origin is the thread for the tripod; x to the front, z up."
    return Model("d415", comment, (body,), frames=tuple(frames))


def parts() -> list[Part]:
    """The housing, the glass in its front and the lenses behind the glass."""
    to_x = ((0, 0, 1), (1, 0, 0), (0, 1, 0))  # turns the outline's x, y to y, z
    middle, front = HEIGHT / 2, DEPTH / 2
    shell = extrude(
        rounded_rectangle(WIDTH, HEIGHT, 0.0105, 6), DEPTH - 0.0004, bevel=0.0022
    ).transformed(to_x, (-front, 0, middle))
    glass = extrude(rounded_rectangle(0.091, 0.0165, 0.008, 6), 0.001).transformed(
        to_x, (front - 0.0008, 0, middle)
    )
    lenses, rims = [], []
    for y, radius in (
        (COLOR_Y, 0.0032),
        (LEFT_IMAGER_Y, 0.0042),
        (-0.008, 0.0046),
        (RIGHT_IMAGER_Y, 0.0042),
    ):
        rims.append(cylinder(radius + 0.0009, 0.0003, 24).transformed(to_x, (front, y, middle)))
        lenses.append(cylinder(radius, 0.0005, 24).transformed(to_x, (front, y, middle)))
    thread = cylinder(0.0032, 0.001, 20)
    return [
        Part(shell, Material("aluminium", (0.66, 0.67, 0.69, 1.0), roughness=0.45)),
        Part(glass, Material("glass", (0.012, 0.012, 0.014, 1.0), roughness=0.2)),
        Part(merge(rims), Material("rim", (0.05, 0.05, 0.055, 1.0), roughness=0.5)),
        Part(merge([*lenses, thread]), Material("lens", (0.02, 0.03, 0.07, 1.0), roughness=0.1)),
    ]


def generate(folder: Path) -> None:
    """Writes the model."""
    made = model()
    write_gltf(folder / "body.gltf", parts())
    write_atomic(folder / "d415.sdf", sdf_text(made))
    write_spheres(folder, cover_model(made, bulge=0.01))
    write_description(
        folder,
        title="Intel RealSense D415",
        category="camera",
        description=(
            "99 x 20 x 23 mm, 72 g. base_link on the tripod's thread under the middle of the body, "
            "x to the front, z up. Frames depth_optical_frame (at [0.0089, 0.02, 0.0115] m) and "
            "color_optical_frame (at [0.0089, 0.035, 0.0115] m) look to the front: z forward, "
            "x right, y down."
        ),
        sources=["Intel, RealSense D400 series product family datasheet"],
    )
