"""Parametric meshes on NumPy, and the glTF files that carry them into Drake.

Every generator returns a `Mesh` (z up, metres, faces counter-clockwise seen from outside, normals
smooth up to a crease angle, texture coordinates with v upwards):

    box, rounded_box         size (3,); texture laid out as `box_atlas` says
    cylinder, sphere, capsule
    lathe                    profile (r, z) revolved about z; walk it bottom to top outside
    loft                     outlines (n, 2) one above the other: bottles, housings
    sweep                    an outline along a curve, tapered: hoses, handles, bananas
    extrude                  a plane outline with thickness and a bevel: brackets, fingers
    skin                     any stack of closed rings (m, n, 3)
    circle, superellipse, rounded_rectangle, offset      outlines

`Mesh` methods: `transformed(R_AB, p_AB)`, `scaled`, `mirrored`, `bounds`, `volume`, `area`,
`solid_mass_properties(mass)`, `shell_mass_properties(mass)`; `merge([...])` joins meshes.

A file for Drake (VTK cameras, Meshcat, `Meshcat.StaticHtml`) is a list of parts:

    housing = lathe([(0, 0), (0.05, 0), (0.05, 0.1), (0.03, 0.12), (0, 0.12)])
    steel = Material("steel", (0.6, 0.6, 0.62, 1), metallic=0.9, roughness=0.35)
    write_gltf(folder / "link.gltf", [Part(housing, steel)])

and in the SDF `<mesh><uri>link.gltf</uri></mesh>` shows it with x, y, z as in the mesh: the
writer already turns for glTF's y-up convention. Without an environment map, which the camera
engine has no need of, a metallic surface has nothing to reflect and looks black: keep `metallic`
at 0.3 or below and make the colour as light as the metal. Arguments out of range raise InputError.
"""

from prehensile.models.shapes.gltf import Material, Part, read_gltf, write_gltf
from prehensile.models.shapes.mesh import MassProperties, Mesh, merge, shade
from prehensile.models.shapes.outlines import (
    circle,
    offset,
    rounded_rectangle,
    superellipse,
    triangulate,
)
from prehensile.models.shapes.primitives import (
    box,
    box_atlas,
    box_corners,
    capsule,
    cylinder,
    rounded_box,
    sphere,
)
from prehensile.models.shapes.surfaces import extrude, lathe, loft, skin, sweep

__all__ = [
    "MassProperties",
    "Material",
    "Mesh",
    "Part",
    "box",
    "box_atlas",
    "box_corners",
    "capsule",
    "circle",
    "cylinder",
    "extrude",
    "lathe",
    "loft",
    "merge",
    "offset",
    "read_gltf",
    "rounded_box",
    "rounded_rectangle",
    "shade",
    "skin",
    "sphere",
    "superellipse",
    "sweep",
    "triangulate",
    "write_gltf",
]
