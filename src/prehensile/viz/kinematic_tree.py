"""Pictures of a plant's kinematic tree: bodies as boxes, joints as the lines between them.

The world is on top. Each line carries the joint's name, its type, and which positions q and
velocities v are its own. What is welded has none; what is free hangs from the world by a joint of
seven positions and six velocities.
"""

from collections import deque
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from pydrake.multibody.plant import MultibodyPlant

from prehensile.errors import Finding, InputError
from prehensile.files import write_atomic
from prehensile.viz.diagram_draw import to_png, to_svg
from prehensile.viz.diagram_layout import SMALL, TITLE, Line, Picture, Rect, Text, text_width

_GAP, _MARGIN = 18.0, 14.0
_BOX_HEIGHT, _LEVEL = 38.0, 94.0  # of a body, and from one level to the next
_COLORS = {
    "weld": "#8593a1",
    "revolute": "#1f6fb4",
    "prismatic": "#2a8a3c",
    "quaternion_floating": "#c8541a",
    "rpy_floating": "#c8541a",
}
_OTHER_COLOR = "#7a4fb0"


@dataclass(frozen=True)
class TreeBody:
    """A body and the joint that it hangs from.

    Attributes:
        name: of the body.
        model: the model instance it belongs to.
        parent: index of the body that it hangs from, in the same list; -1 for the world.
        joint: name of the joint ("" for the world).
        kind: type of the joint, as Drake names it ("" for the world).
        q: first and one past the last of the joint's positions in the plant's q.
        v: likewise of its velocities.
    """

    name: str
    model: str
    parent: int = -1
    joint: str = ""
    kind: str = ""
    q: tuple[int, int] = (0, 0)
    v: tuple[int, int] = (0, 0)


def read_kinematic_tree(plant: MultibodyPlant) -> list[TreeBody]:
    """The bodies of a plant from the world outward, each after the one it hangs from.

    Args:
        plant: finalized, so that what is free has its floating joint.

    Returns:
        The bodies, the world first.

    Raises:
        ValueError: the plant is not finalized.
    """
    if not plant.is_finalized():
        raise ValueError("plant must be finalized")
    joints_of: dict[int, list] = {}
    for index in plant.GetJointIndices():
        joint = plant.get_joint(index)
        for body in (joint.parent_body(), joint.child_body()):
            joints_of.setdefault(int(body.index()), []).append(joint)
    world = plant.world_body()
    tree = [TreeBody(world.name(), "")]
    number = {int(world.index()): 0}
    waiting = deque([int(world.index())])
    while waiting:
        inboard = waiting.popleft()
        for joint in joints_of.get(inboard, ()):
            ends = (joint.parent_body(), joint.child_body())
            outboard = next((b for b in ends if int(b.index()) not in number), None)
            if outboard is None:
                continue
            number[int(outboard.index())] = len(tree)
            waiting.append(int(outboard.index()))
            q, v = joint.position_start(), joint.velocity_start()
            tree.append(
                TreeBody(
                    outboard.name(),
                    plant.GetModelInstanceName(outboard.model_instance()),
                    number[inboard],
                    joint.name(),
                    joint.type_name(),
                    (q, q + joint.num_positions()),
                    (v, v + joint.num_velocities()),
                )
            )
    return tree


def kinematic_tree_picture(tree: list[TreeBody]) -> Picture:
    """Lays a kinematic tree out for drawing.

    Args:
        tree: from :func:`read_kinematic_tree`.

    Returns:
        The picture, for :func:`~prehensile.viz.diagram_draw.to_svg` and its like.
    """
    children: list[list[int]] = [[] for _ in tree]
    level = [0] * len(tree)
    for i, body in enumerate(tree[1:], 1):
        children[body.parent].append(i)
        level[i] = level[body.parent] + 1
    labels = [_label(body) for body in tree]
    own = [max(map(text_width, label), default=0.0) + 10 for label in labels]
    box = [max(text_width(b.name, TITLE), text_width(b.model)) + 2 * _MARGIN for b in tree]
    width = [0.0] * len(tree)
    for i in reversed(range(len(tree))):
        inside = sum(width[c] for c in children[i]) + _GAP * max(len(children[i]) - 1, 0)
        width[i] = max(box[i], own[i], inside)
    # Places from the world down: each subtree has its own strip.
    middle = [0.0] * len(tree)
    left = [0.0] * len(tree)
    left[0] = _MARGIN
    for i in range(len(tree)):
        inside = sum(width[c] for c in children[i]) + _GAP * max(len(children[i]) - 1, 0)
        x = left[i] + 0.5 * (width[i] - inside)
        for c in children[i]:
            left[c] = x
            x += width[c] + _GAP
        middle[i] = left[i] + 0.5 * width[i]
    picture = Picture(width[0] + 2 * _MARGIN, _LEVEL * max(level) + _BOX_HEIGHT + 2 * _MARGIN)
    for i, body in enumerate(tree):
        top = _MARGIN + _LEVEL * level[i]
        if i > 0:
            _draw_joint(picture, body, labels[i], middle[body.parent], middle[i], top, own[i])
        fill = "#e9eef3" if i == 0 else "#ffffff"
        x = middle[i] - 0.5 * box[i]
        path = f"{body.model}/{body.name}" if body.model else body.name
        picture.rects.append(Rect(x, top, box[i], _BOX_HEIGHT, fill, "#5f6f7e", path))
        y = top + (17 if body.model else 24)
        picture.texts.append(Text(middle[i], y, body.name, TITLE, "middle"))
        picture.texts.append(Text(middle[i], top + 31, body.model, SMALL, "middle", "#6b7782"))
    return picture


def kinematic_tree_image(plant: MultibodyPlant, scale: float = 1.5) -> NDArray[np.uint8]:
    """The kinematic tree of a plant as an image.

    Args:
        plant: finalized.
        scale: pixels of the image per pixel of the layout, in which text is 11 to 13 high.

    Returns:
        (H, W, 3) uint8, for :func:`~prehensile.viz.figures.save_figure`.
    """
    png = to_png(kinematic_tree_picture(read_kinematic_tree(plant)), scale)
    return np.asarray(Image.open(BytesIO(png)).convert("RGB"))


def save_kinematic_tree(plant: MultibodyPlant, path: Path | str) -> Path:
    """Draws the kinematic tree of a plant and writes the picture.

    Args:
        plant: finalized.
        path: file to write, ``.svg`` or ``.png``.

    Returns:
        The absolute path of the file.

    Raises:
        InputError: another suffix.
    """
    path = Path(path).resolve()
    check_suffix(path)
    picture = kinematic_tree_picture(read_kinematic_tree(plant))
    write_atomic(path, to_svg(picture) if path.suffix == ".svg" else to_png(picture))
    return path


def check_suffix(path: Path) -> None:
    """Raises InputError for a file that :func:`save_kinematic_tree` does not write."""
    if path.suffix not in (".svg", ".png"):
        message = f"no kinematic tree is written as '{path.suffix}'"
        raise InputError(Finding(message, "use .svg or .png", str(path)))


def _label(body: TreeBody) -> tuple[str, ...]:
    """What stands beside the line of a joint."""
    if not body.joint:
        return ()
    kind = {"quaternion_floating": "floating, quaternion", "rpy_floating": "floating, rpy"}
    parts = [kind.get(body.kind, body.kind), _range("q", *body.q), _range("v", *body.v)]
    second = "  ".join(part for part in parts if part)
    # Drake names welds and floating joints after their bodies, which are drawn anyway.
    made_up = body.kind == "weld" or "floating" in body.kind
    return (second,) if made_up else (body.joint, second)


def _range(letter: str, first: int, end: int) -> str:
    if end == first:
        return ""
    return f"{letter}[{first}]" if end == first + 1 else f"{letter}[{first}:{end}]"


def _draw_joint(
    picture: Picture,
    body: TreeBody,
    label: tuple[str, ...],
    x_parent: float,
    x: float,
    top: float,
    label_width: float,
) -> None:
    color = _COLORS.get(body.kind, _OTHER_COLOR)
    bottom, turn = top - _LEVEL + _BOX_HEIGHT, top - _LEVEL + _BOX_HEIGHT + 10
    height = 14.0 * len(label) + 4
    y = top - 8 - height
    picture.lines.append(Line(((x_parent, bottom), (x_parent, turn), (x, turn), (x, y)), color))
    picture.lines.append(Line(((x, y + height), (x, top)), color))
    picture.rects.append(Rect(x - 0.5 * label_width, y, label_width, height, "#ffffff", color))
    for k, text in enumerate(label):
        picture.texts.append(Text(x, y + 13 + 14 * k, text, SMALL, "middle", color))
