"""A sheet of paper to print on."""

import io
import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike
from PIL import Image, ImageDraw, ImageFont

from prehensile.errors import Finding, InputError
from prehensile.models.shapes import box_atlas

Color = str | tuple[int, int, int]
Box = tuple[float, float, float, float]

PIXELS_PER_MM = 2.4  # about twice what a 640 x 480 camera resolves at 0.5 m
_OVERSAMPLING = 3  # drawn finer and averaged, so that edges and print are smooth
_MAX_PIXELS = 4096  # of the finished picture along either side


class Panel:
    """A sheet of ``width`` by ``height`` mm; x to the right and y down from its upper left."""

    def __init__(self, width: float, height: float, paper: Color = "white") -> None:
        for name, value in (("width", width), ("height", height)):
            if not (math.isfinite(value) and 0.0 < value <= _MAX_PIXELS / PIXELS_PER_MM):
                raise InputError(
                    Finding(
                        f"panel {name} is {value!r} mm",
                        f"give a number above 0, at most {_MAX_PIXELS / PIXELS_PER_MM:.0f}",
                        key=name,
                    )
                )
        self.width, self.height = float(width), float(height)
        self._scale = PIXELS_PER_MM * _OVERSAMPLING
        size = (max(1, round(width * self._scale)), max(1, round(height * self._scale)))
        self._image = Image.new("RGB", size, paper)
        self._draw = ImageDraw.Draw(self._image)

    def rect(self, box: Box, color: Color, *, radius: float = 0.0) -> None:
        """Fills the rectangle (x0, y0, x1, y1), with rounded corners if asked."""
        self._draw.rounded_rectangle(self._pixels(box), self._scale * radius, fill=color)

    def frame(self, box: Box, color: Color, width: float) -> None:
        """Draws the outline of a rectangle."""
        line = max(1, round(width * self._scale))
        self._draw.rectangle(self._pixels(box), outline=color, width=line)

    def ellipse(self, center: Sequence[float], radii: Sequence[float], color: Color) -> None:
        """Fills an ellipse with the given half axes."""
        (x, y), (a, b) = center, radii
        self._draw.ellipse(self._pixels((x - a, y - b, x + a, y + b)), fill=color)

    def polygon(self, points: ArrayLike, color: Color) -> None:
        """Fills a polygon (n, 2)."""
        self._draw.polygon([tuple(p) for p in np.asarray(points) * self._scale], fill=color)

    def line(self, points: ArrayLike, color: Color, width: float) -> None:
        """Draws a polyline (n, 2)."""
        pixels = [tuple(p) for p in np.asarray(points, dtype=float) * self._scale]
        self._draw.line(pixels, fill=color, width=max(1, round(width * self._scale)), joint="curve")

    def text(
        self,
        words: str,
        center: Sequence[float],
        *,
        height: float,
        color: Color = "black",
        outline: Color | None = None,
        weight: float = 0.06,
        max_width: float = math.inf,
        angle: float = 0.0,
    ) -> None:
        """Sets a line of capital letters ``height`` mm tall, smaller if wider than ``max_width``.

        Args:
            words: one line.
            center: (2,) of the line, mm.
            height: of a capital letter, mm.
            color: of the ink.
            outline: colour of a border round the letters, if any.
            weight: extra thickness of the strokes as a part of the height.
            max_width: mm.
            angle: degrees, counter-clockwise.
        """
        unit = ImageFont.load_default(100.0)
        _, top, _, bottom = unit.getbbox("H")
        cap = (bottom - top) / 100.0 + 2.0 * weight
        gap = 1.3 * weight + 0.02  # bolder letters need more room between them
        wide = sum(unit.getlength(letter) for letter in words) / 100.0 + gap * (len(words) - 1)
        size = self._scale * min(height / cap, max_width / (wide + 2.0 * weight))
        stroke = max(0, round(size * weight))
        edge = round(size * 0.07) if outline is not None else 0
        layers = [(outline, stroke + edge)] if outline is not None else []
        for ink, thickness in [*layers, (color, stroke)]:
            mask = _letters(words, size, wide * size, gap * size, thickness)
            if angle:
                mask = mask.rotate(angle, expand=True, resample=Image.Resampling.BICUBIC)
            corner = (
                round(center[0] * self._scale - mask.width / 2.0),
                round(center[1] * self._scale - mask.height / 2.0),
            )
            self._image.paste(Image.new("RGB", mask.size, ink), corner, mask)

    def barcode(self, box: Box, seed: int = 1) -> None:
        """A white field with black bars (they encode nothing)."""
        x0, y0, x1, y1 = box
        self.rect(box, "white")
        rng = np.random.default_rng(seed)
        x = x0 + 0.08 * (x1 - x0)
        while x < x1 - 0.12 * (x1 - x0):
            bar, gap = (0.5 * (1.0 + np.floor(3.0 * rng.random(2)))) * (x1 - x0) / 26.0
            self.rect((x, y0 + 0.1 * (y1 - y0), x + bar, y1 - 0.25 * (y1 - y0)), "black")
            x += bar + gap

    def facts(self, box: Box, title: str = "NUTRITION") -> None:
        """A white table in the manner of the facts printed on food."""
        x0, y0, x1, y1 = box
        wide, high = x1 - x0, y1 - y0
        self.rect(box, "white")
        self.frame(box, "black", 0.6)
        self.text(title, ((x0 + x1) / 2, y0 + 0.12 * high), height=0.1 * high, max_width=0.9 * wide)
        rows = 7
        for k in range(rows):
            y = y0 + high * (0.24 + 0.74 * k / rows)
            self.rect(
                (x0 + 0.06 * wide, y, x1 - 0.06 * wide, y + (0.9 if k == 0 else 0.3)), "black"
            )
            y += high * 0.42 / rows
            length = (0.52, 0.38, 0.6, 0.45, 0.3, 0.5, 0.42)[k]
            thick = 0.14 * high / rows
            self.rect((x0 + 0.06 * wide, y, x0 + length * wide, y + 2 * thick), "#555555")
            self.rect((x1 - 0.2 * wide, y, x1 - 0.06 * wide, y + 2 * thick), "#555555")

    def paint(self, colors: ArrayLike) -> None:
        """Covers the sheet with a picture (rows, columns, 3) of values 0..255."""
        pixels = np.clip(np.asarray(colors), 0, 255).astype(np.uint8)
        picture = Image.fromarray(pixels)
        self._image.paste(picture.resize(self._image.size, Image.Resampling.BICUBIC))

    def png(self, colors: int = 64) -> bytes:
        """The panel as a PNG file with a palette of at most ``colors`` colours."""
        size = (
            max(1, round(self.width * PIXELS_PER_MM)),
            max(1, round(self.height * PIXELS_PER_MM)),
        )
        small = self._image.resize(size, Image.Resampling.BOX)
        stream = io.BytesIO()
        palette = small.quantize(colors, method=Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)
        palette.save(stream, "PNG", optimize=True)
        return stream.getvalue()

    def _pixels(self, box: Box) -> list[float]:
        return [v * self._scale for v in box]


def _letters(words: str, size: float, wide: float, gap: float, thickness: int) -> Image.Image:
    """A mask, in pixels, with the letters set ``gap`` apart and centred on their capitals."""
    font = ImageFont.load_default(size)
    _, top, _, bottom = font.getbbox("H")
    mask = Image.new("L", (round(wide) + 4 * thickness + 8, round(1.6 * size) + 4 * thickness), 0)
    draw = ImageDraw.Draw(mask)
    x, y = (mask.width - wide) / 2.0, (mask.height - (top + bottom)) / 2.0
    for letter in words:
        draw.text((x, y), letter, fill=255, font=font, stroke_width=thickness)
        x += font.getlength(letter) + gap
    return mask


def atlas(size: ArrayLike, faces: Mapping[str, Panel], paper: Color = "white") -> bytes:
    """PNG with the faces of a box of ``size`` (3,) m, laid out as ``shapes.box_atlas`` says.

    Args:
        size: (3,) of the box, m.
        faces: panels for "+x", "-x", ...; each is stretched over its face.
        paper: colour of the faces without a panel.
    """
    (width, height), rects = box_atlas(size)
    sheet = Panel(1000.0 * width, 1000.0 * height, paper)
    unknown = set(faces) - set(rects)
    if unknown:
        raise InputError(Finding(f"a box has no face {sorted(unknown)}", "use " + ", ".join(rects)))
    pixels_w, pixels_h = sheet._image.size
    for name, panel in faces.items():
        u0, v0, u1, v1 = rects[name]
        x0, x1 = round(u0 * pixels_w), round(u1 * pixels_w)
        y0, y1 = round((1.0 - v1) * pixels_h), round((1.0 - v0) * pixels_h)
        sheet._image.paste(panel._image.resize((x1 - x0, y1 - y0), Image.Resampling.BOX), (x0, y0))
    return sheet.png()
