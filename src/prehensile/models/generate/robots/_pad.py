"""The volume mesh of a rubber pad, for hydroelastic contact."""

import numpy as np
from pydrake.math import RigidTransform


def pad_mesh(
    X_LP: RigidTransform, length: float, width: float, depth: float, core: float, count: int = 1
) -> str:
    """A pad as tetrahedra, in VTK's legacy format: a pyramid on the face that grips, or several.

    A patch of contact has as many polygons as tetrahedra are cut. A box has forty; this has eight
    under its face, four to carry the load and four at the rim, whose centres lie about as far
    from the middle as the mean of the face, so that the pad resists turning as a whole one does.
    The apex lies in the finger. Pressure rises from zero at the surface to the hydroelastic
    modulus at the inner point. A pyramid carries little on a part of its face; a long pad that is
    to hold by its end is a row of them.

    Args:
        X_LP: pose in the link of the pad's frame P: its origin is the middle of the face, x
            points into the finger, y along the length.
        length: of the face along y of P, m.
        width: of the face along z of P, m.
        depth: of the apex below the face, m.
        core: depth of the inner point, m.
        count: number of pyramids along the length.

    Returns:
        The text of the file, in the frame of the link.
    """
    u, v = length / (2 * count), width / 2
    points, cells = [], []
    for k in range(count):
        y, n = (2 * k + 1 - count) * u, 7 * k
        p_P = [(0, y - u, -v), (0, y + u, -v), (0, y + u, v), (0, y - u, v),
               (0, y, 0), (depth, y, 0), (core, y, 0)]  # fmt: skip
        points += [X_LP @ np.array(p, float) for p in p_P]
        for i in range(n, n + 4):
            j = n + (i + 1 - n) % 4
            cells += [(i, j, n + 4, n + 6), (j, i, n + 5, n + 6)]  # under the face, behind the rim
    lines = ["# vtk DataFile Version 3.0", "pad of rubber", "ASCII", "DATASET UNSTRUCTURED_GRID"]
    lines.append(f"POINTS {len(points)} double")
    lines += [" ".join(f"{np.round(v, 9) + 0.0:g}" for v in point) for point in points]
    lines.append(f"CELLS {len(cells)} {5 * len(cells)}")
    lines += ["4 " + " ".join(map(str, cell)) for cell in cells]
    lines += [f"CELL_TYPES {len(cells)}", *(["10"] * len(cells)), ""]
    return "\n".join(lines)
