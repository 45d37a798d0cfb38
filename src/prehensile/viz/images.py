"""Camera pictures for people: colours for depth and labels, and grasps drawn into the image.

An image is ``(H, W, 3)`` uint8, row 0 on top. A camera is its intrinsic matrix ``K`` and the pose
``X_WC`` of its optical frame (x right, y down, z into the scene). Functions return a new image
and leave their arguments as they are.
"""

from collections.abc import Sequence
from io import BytesIO
from pathlib import Path

import matplotlib
import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import Image, ImageDraw, ImageFont
from pydrake.math import RigidTransform

from prehensile.files import write_atomic

Color = tuple[int, int, int]

GREEN: Color = (40, 200, 80)
# The Schunk WSG 50 with finger tips, in its frame G (origin in the body, y toward the finger
# tips, x the closing direction): where the palm ends and the fingers end, and half their width.
PALM_Y, TIP_Y, FINGER_HALF_WIDTH = 0.036, 0.118, 0.010
# Distinct hues for labels, after the "tab20" palette of matplotlib.
_LABEL_COLORS = (matplotlib.colormaps["tab20"](range(20))[:, :3] * 255).astype(np.uint8)
_NEAR_PLANE = 1e-3


def as_rgb(image: ArrayLike) -> NDArray[np.uint8]:
    """Drops the alpha channel.

    Args:
        image: (H, W, 3) or (H, W, 4) uint8, such as ``ImageRgba8U.data``.

    Returns:
        (H, W, 3) uint8, a copy.

    Raises:
        ValueError: another shape or type.
    """
    image = np.asarray(image)
    if image.ndim != 3 or image.shape[2] not in (3, 4) or image.dtype != np.uint8:
        raise ValueError(
            f"image must be (H, W, 3) or (H, W, 4) uint8, got {image.shape} {image.dtype}"
        )
    return image[:, :, :3].copy()


def colorize_depth(
    depth: ArrayLike, near: float | None = None, far: float | None = None
) -> NDArray[np.uint8]:
    """Colours a depth image: near is bright, far is dark, no return is grey.

    Args:
        depth: (H, W) or (H, W, 1) depths in metres; zero, NaN and infinity mean no return.
        near, far: depths at the ends of the colour scale; default: the image's own.

    Returns:
        (H, W, 3) uint8 image.
    """
    depth = np.asarray(depth, dtype=float)
    depth = depth[:, :, 0] if depth.ndim == 3 else depth
    seen = np.isfinite(depth) & (depth > 0)
    colors = np.full((*depth.shape, 3), 96, dtype=np.uint8)
    if not seen.any():
        return colors
    low = float(depth[seen].min()) if near is None else near
    high = float(depth[seen].max()) if far is None else far
    fraction = np.clip((high - depth[seen]) / max(high - low, 1e-9), 0.0, 1.0)
    colors[seen] = (matplotlib.colormaps["viridis"](fraction)[:, :3] * 255).astype(np.uint8)
    return colors


def colorize_labels(labels: ArrayLike) -> NDArray[np.uint8]:
    """Colours a label image: one colour per label, white for what is no object.

    Args:
        labels: (H, W) or (H, W, 1) int16 labels as Drake renders them; its reserved labels
            (32764 and up: empty, do not render, don't care, unspecified) count as no object.

    Returns:
        (H, W, 3) uint8 image. Labels 20 apart share a colour.
    """
    labels = np.asarray(labels)
    labels = labels[:, :, 0] if labels.ndim == 3 else labels
    colors = _LABEL_COLORS[labels.astype(int) % len(_LABEL_COLORS)]
    colors[labels >= 32764] = 255
    return colors


def project(K: ArrayLike, X_WC: RigidTransform, p_WPs: ArrayLike) -> NDArray[np.float64]:
    """Projects points into the image of a pinhole camera.

    Args:
        K: (3, 3) intrinsic matrix.
        X_WC: pose of the camera's optical frame in the world.
        p_WPs: (N, 3) points in the world, in metres.

    Returns:
        (N, 2) pixel coordinates (u to the right, v down); NaN for points behind the camera.
    """
    p_WPs = np.asarray(p_WPs, dtype=float).reshape(-1, 3)
    p_CPs = X_WC.inverse().multiply(p_WPs.T).T
    uvw = p_CPs @ np.asarray(K, dtype=float).T
    with np.errstate(divide="ignore", invalid="ignore"):
        uv = uvw[:, :2] / uvw[:, 2:]
    uv[p_CPs[:, 2] < _NEAR_PLANE] = np.nan
    return uv


def draw_grasp(
    image: ArrayLike,
    K: ArrayLike,
    X_WC: RigidTransform,
    X_WG: RigidTransform,
    width: float,
    *,
    label: str = "",
    color: Color = GREEN,
    palm_y: float = PALM_Y,
    tip_y: float = TIP_Y,
    finger_half_width: float = FINGER_HALF_WIDTH,
) -> NDArray[np.uint8]:
    """Draws a parallel-jaw hand into a camera picture: two finger pads, palm and approach.

    Args:
        image: (H, W, 3) or (H, W, 4) uint8 colour image.
        K: (3, 3) intrinsic matrix of the camera.
        X_WC: pose of the camera's optical frame.
        X_WG: pose of the hand: y toward the finger tips, x the closing direction.
        width: opening between the finger pads, in metres.
        label: text beside the hand.
        color: of the lines.
        palm_y, tip_y: where palm and finger tips are on y of G; default: the WSG 50.
        finger_half_width: half the width of a finger along z of G.

    Returns:
        (H, W, 3) uint8, a new image.
    """
    picture = Image.fromarray(as_rgb(image))
    draw = ImageDraw.Draw(picture)
    line = max(2, picture.width // 320)
    x, z = width / 2, finger_half_width

    def stroke(p_GPs: Sequence[Sequence[float]], fill: Color, thickness: int) -> None:
        p_WPs = X_WG.multiply(np.array(p_GPs, dtype=float).T).T
        uv = project(K, X_WC, p_WPs)
        if np.isfinite(uv).all():
            draw.line([(u, v) for u, v in uv], fill=fill, width=thickness, joint="curve")

    def pad(side: float) -> list[list[float]]:
        return [
            [side, tip_y, -z], [side, tip_y, z], [side, palm_y, z], [side, palm_y, -z],
            [side, tip_y, -z],
        ]  # fmt: skip

    contact_y = tip_y - 0.01
    strokes = [
        pad(-x),
        pad(x),
        [[-x, palm_y, 0], [x, palm_y, 0]],
        [[0, palm_y - 0.06, 0], [0, palm_y, 0]],
    ]
    for fill, extra in ((0, 0, 0), 2), (color, 0):  # a dark rim keeps the lines readable
        for points in strokes:
            stroke(points, fill, line + extra)
        # Where the fingers will close.
        stroke([[-x, contact_y, 0], [x, contact_y, 0]], fill, max(1, line - 1) + extra)
    if label:
        anchor = project(K, X_WC, X_WG.multiply(np.array([0, palm_y - 0.06, 0])))[0]
        if np.isfinite(anchor).all():
            _draw_text(draw, picture.size, (float(anchor[0]), float(anchor[1])), label, color)
    return np.asarray(picture)


def draw_points(
    image: ArrayLike,
    K: ArrayLike,
    X_WC: RigidTransform,
    p_WPs: ArrayLike,
    *,
    color: Color = GREEN,
    radius: int = 2,
) -> NDArray[np.uint8]:
    """Draws points of the world into a camera picture, as dots.

    Args:
        image: (H, W, 3) or (H, W, 4) uint8 colour image.
        K: (3, 3) intrinsic matrix of the camera.
        X_WC: pose of the camera's optical frame.
        p_WPs: (N, 3) points in the world.
        color: of the dots.
        radius: of the dots, in pixels.

    Returns:
        (H, W, 3) uint8, a new image. Points behind the camera are left out.
    """
    picture = Image.fromarray(as_rgb(image))
    draw = ImageDraw.Draw(picture)
    for u, v in project(K, X_WC, p_WPs):
        if np.isfinite(u) and np.isfinite(v):
            draw.ellipse([u - radius, v - radius, u + radius, v + radius], fill=color)
    return np.asarray(picture)


def side_by_side(images: Sequence[ArrayLike], gap: int = 4) -> NDArray[np.uint8]:
    """Puts pictures in one row, on white, tops aligned.

    Args:
        images: (H_i, W_i, 3 or 4) uint8 images, at least one.
        gap: pixels between them.

    Returns:
        (max H_i, sum W_i + gaps, 3) uint8 image.
    """
    pictures = [as_rgb(image) for image in images]
    height = max(p.shape[0] for p in pictures)
    total = sum(p.shape[1] for p in pictures) + gap * (len(pictures) - 1)
    row = np.full((height, total, 3), 255, dtype=np.uint8)
    left = 0
    for p in pictures:
        row[: p.shape[0], left : left + p.shape[1]] = p
        left += p.shape[1] + gap
    return row


def save_png(path: Path | str, image: ArrayLike) -> None:
    """Writes a picture as PNG; the file is complete or not there at all.

    Args:
        path: file to write; its folder is made if need be.
        image: (H, W, 3) or (H, W, 4) uint8.
    """
    buffer = BytesIO()
    Image.fromarray(as_rgb(image)).save(buffer, format="PNG")
    write_atomic(Path(path), buffer.getvalue())


def font(size: float) -> ImageFont.FreeTypeFont:
    """The DejaVu Sans font that matplotlib carries, so that every machine draws the same.

    Args:
        size: height in pixels.

    Returns:
        A Pillow font.
    """
    path = Path(matplotlib.get_data_path()) / "fonts" / "ttf" / "DejaVuSans.ttf"
    return ImageFont.truetype(str(path), size)


def _draw_text(
    draw: ImageDraw.ImageDraw,
    size: tuple[int, int],
    at: tuple[float, float],
    text: str,
    color: Color,
) -> None:
    """Writes text on a dark plate at a point, moved inwards where it would leave the image."""
    face = font(max(11, size[0] // 50))
    left, top, right, bottom = draw.textbbox((0, 0), text, font=face)
    w, h = right - left + 8, bottom - top + 6
    u = min(max(at[0] + 6, 0), size[0] - w)
    v = min(max(at[1] - h / 2, 0), size[1] - h)
    draw.rectangle([u, v, u + w, v + h], fill=(20, 20, 20))
    draw.text((u + 4 - left, v + 3 - top), text, font=face, fill=color)
