"""Intel RealSense D415: its body, and the frames in which its pictures are taken.

The frame ``base_link`` lies on the thread for the tripod, in the middle of the underside: x to the
front, y to the left, z up. Optical frames have z to the front, x to the right, y down.
"""

from math import pi
from pathlib import Path

from prehensile.models.generate import solids
from prehensile.models.generate.files import write_description, write_spheres, write_text
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
        visuals=(Visual("body", block, middle, (0.75, 0.76, 0.78, 1.0)),),
        collisions=(Collision("body", block, middle, Contact(mu=0.4, relaxation_time=0.05)),),
    )
    x, z = DEPTH / 2 - BEHIND_GLASS, HEIGHT / 2
    frames = [Frame("camera_link", "base_link", (0.0, LEFT_IMAGER_Y, z, 0.0, 0.0, 0.0))]
    for name, y in (("depth", LEFT_IMAGER_Y), ("color", COLOR_Y)):
        frames.append(Frame(f"{name}_frame", "base_link", (x, y, z, 0.0, 0.0, 0.0)))
        frames.append(Frame(f"{name}_optical_frame", "base_link", (x, y, z, -pi / 2, 0.0, -pi / 2)))
    comment = "Intel RealSense D415. The origin is the thread for the tripod; x to the front, z up."
    return Model("d415", comment, (body,), frames=tuple(frames))


def generate(folder: Path) -> None:
    """Writes the model."""
    made = model()
    write_text(folder / "d415.sdf", sdf_text(made))
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
