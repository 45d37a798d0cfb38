"""The box of boards that shelves and the cupboard have in common; open to the front, +x."""

from prehensile.models.generate.furniture import _wood
from prehensile.models.generate.furniture._parts import Block
from prehensile.models.generate.sdf_model import Contact
from prehensile.models.shapes import Part, merge

DEPTH, WIDTH, HEIGHT = 0.3, 0.6, 0.8  # m, along x, y, z
BOARD = 0.018  # m, thickness of all boards
COMPARTMENTS = 3
MASS = 14.0  # kg

LIGHT, DARK = (238, 212, 170), (184, 140, 92)  # of the wood

WOOD = Contact(mu=0.5, hydroelastic="rigid", relaxation_time=0.02)


def floors() -> list[float]:
    """Height of the surface on which things stand in each compartment, lowest first, m."""
    clear = (HEIGHT - BOARD) / COMPARTMENTS
    return [round(BOARD + i * clear, 6) for i in range(COMPARTMENTS)]


def blocks() -> list[Block]:
    """The boards; z = 0 is the underside."""
    x, y = DEPTH / 2, WIDTH / 2
    inner = y - BOARD
    boards = [
        Block("side_left", (-x, y - BOARD, 0.0), (x, y, HEIGHT)),
        Block("side_right", (-x, -y, 0.0), (x, -y + BOARD, HEIGHT)),
        Block("back", (-x, -inner, 0.0), (-x + BOARD, inner, HEIGHT)),
        Block("top", (-x + BOARD, -inner, HEIGHT - BOARD), (x, inner, HEIGHT)),
    ]
    for i, z in enumerate(floors()):
        boards.append(Block(f"shelf_{i}", (-x + BOARD, -inner, z - BOARD), (x, inner, z)))
    return boards


def feet() -> list[tuple[float, float, float]]:
    """Where the sides stand."""
    x, y = DEPTH / 2 - BOARD / 2, WIDTH / 2 - BOARD / 2
    return [(x, y, 0.0), (-x, y, 0.0), (-x, -y, 0.0), (x, -y, 0.0)]


def visual_parts() -> list[Part]:
    """The boards, each along its own grain."""
    boards = []
    for i, block in enumerate(blocks()):
        upright = block.name.startswith(("side", "back"))
        boards.append(_wood.board(block, 2 if upright else 1, place=0.07 * i))
    texture = _wood.grain(LIGHT, DARK, seed=5, pixels=384, staves=24)
    return [Part(merge(boards), _wood.wood("pine", texture))]
