"""An open shelf unit; z = 0 of ``base_link`` is its underside, it is open to +x."""

from pathlib import Path

from prehensile.files import write_atomic
from prehensile.models.generate.files import write_description, write_spheres
from prehensile.models.generate.furniture import _carcass
from prehensile.models.generate.furniture._parts import link
from prehensile.models.generate.sdf_model import Model, Shape, Visual, sdf_text
from prehensile.models.generate.sphere_cover import cover_model
from prehensile.models.shapes import write_gltf


def model() -> Model:
    """The shelves."""
    parts = _carcass.blocks()
    visuals = (Visual("shelves", Shape("mesh", uri="shelves.gltf")),)
    comment = "Shelves. The origin is the middle of the underside, z up, open to the front, +x."
    body = link("base_link", _carcass.MASS, parts, _carcass.WOOD, visuals, _carcass.feet())
    return Model("shelves", comment, (body,))


def generate(folder: Path) -> None:
    """Writes the model."""
    made = model()
    write_gltf(folder / "shelves.gltf", _carcass.visual_parts())
    write_atomic(folder / "shelves.sdf", sdf_text(made))
    write_spheres(folder, cover_model(made, bulge=0.035))
    heights = ", ".join(f"{z:g}" for z in _carcass.floors())
    write_description(
        folder,
        title="Shelf unit",
        category="furniture",
        description=(
            f"{_carcass.WIDTH:g} x {_carcass.DEPTH:g} x {_carcass.HEIGHT:g} m, open to +x; "
            f"base_link in the middle of the underside. Things stand at z = {heights} m."
        ),
        sources=["Dimensions of our own, those of a common wall shelf"],
    )
