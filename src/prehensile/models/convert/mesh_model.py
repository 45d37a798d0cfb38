"""A bare mesh as a model of one link."""

from pathlib import Path

import numpy as np

from prehensile.models.convert.elements import inertial_element
from prehensile.models.convert.mass import combined
from prehensile.models.convert.mesh_store import MeshStore
from prehensile.models.convert.options import ConvertOptions
from prehensile.models.convert.report import Report
from prehensile.models.convert.xml_text import make, number
from prehensile.models.xml_lines import Element


def mesh_model(file: Path, meshes: MeshStore, options: ConvertOptions, report: Report) -> Element:
    """SDF of one link that has the shape of a mesh, and its mass properties.

    Args:
        file: the mesh.
        meshes: reads it.
        options: mass, or density.
        report: what was computed is noted here.

    Raises:
        InputError: it cannot be read, or is flat and so has no volume.
    """
    uri = str(file.absolute())
    solid = meshes.solid(uri, np.ones(3))
    density = options.density if options.mass is None else options.mass / solid.volume
    body = combined([(solid, density)])
    X_LI = np.eye(4)
    X_LI[:3, 3] = body.p_BoBcm_B
    text = f"{solid.volume:.4g} m³ of {density:.4g} kg/m³: {body.mass:.4g} kg"
    report.add("inertia", file.stem, text)
    pieces = meshes.pieces(uri, np.ones(3))
    points = np.concatenate([p.vertices for p in pieces])
    size = " x ".join(number(float(f"{s:.4g}")) for s in np.ptp(points, axis=0))
    report.add("mesh", file.stem, f"{size} m large")

    def geometry() -> Element:
        return make("geometry", make("mesh", make("uri", uri)))

    link = make(
        "link",
        inertial_element(body.mass, X_LI, body.I_BBcm_B, urdf=False),
        make("visual", geometry(), name="visual"),
        make("collision", geometry(), name="collision"),
        name="base_link",
    )
    return make("model", link)
