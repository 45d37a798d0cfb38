"""The volume mesh of a rubber pad, for hydroelastic contact."""

import numpy as np
from pydrake.math import RigidTransform


def pad_mesh(X_LP: RigidTransform, length: float, width: float, depth: float, core: float) -> str:
    """A pad as tetrahedra, in VTK's legacy format: a pyramid on the face that grips.

    A patch of contact has as many polygons as tetrahedra are cut. A box has forty; this has eight
    under its face, four to carry the load and four at the rim, whose centres lie about as far
    from the middle as the mean of the face, so that the pad resists turning as a whole one does.
    The apex lies in the finger. Pressure rises from zero at the surface to the hydroelastic
    modulus at the inner point.

    Args:
        X_LP: pose in the link of the pad's frame P: its origin is the middle of the face, x
            points into the finger, y along the length.
        length: of the face along y of P, m.
        width: of the face along z of P, m.
        depth: of the apex below the face, m.
        core: depth of the inner point, m.

    Returns:
        The text of the file, in the frame of the link.
    """
    u, v = length / 2, width / 2
    p_P = [(0, -u, -v), (0, u, -v), (0, u, v), (0, -u, v), (0, 0, 0), (depth, 0, 0), (core, 0, 0)]
    points = X_LP.multiply(np.array(p_P, float).T).T
    cells = []
    for i in range(4):
        j = (i + 1) % 4
        cells += [(i, j, 4, 6), (j, i, 5, 6)]  # under the face, behind the rim
    lines = ["# vtk DataFile Version 3.0", "pad of rubber", "ASCII", "DATASET UNSTRUCTURED_GRID"]
    lines.append(f"POINTS {len(points)} double")
    lines += [" ".join(f"{np.round(v, 9) + 0.0:g}" for v in point) for point in points]
    lines.append(f"CELLS {len(cells)} {5 * len(cells)}")
    lines += ["4 " + " ".join(map(str, cell)) for cell in cells]
    lines += [f"CELL_TYPES {len(cells)}", *(["10"] * len(cells)), ""]
    return "\n".join(lines)
