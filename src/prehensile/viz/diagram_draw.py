"""A laid-out diagram as SVG text, PNG bytes or a page in which blocks open by click."""

import html
import json
from io import BytesIO

from PIL import Image, ImageDraw

from prehensile.viz.diagram_blocks import Block, levels
from prehensile.viz.diagram_layout import Line, Picture, lay_out
from prehensile.viz.images import font

_FONT = "DejaVu Sans, Verdana, sans-serif"


def to_svg(picture: Picture) -> str:
    """The picture as SVG.

    Args:
        picture: from :func:`prehensile.viz.diagram_layout.lay_out`.

    Returns:
        A whole SVG document. Each block is a ``rect`` with its path in ``data-path``.
    """
    w, h = round(picture.width), round(picture.height)
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {w} {h}" width="{w}" height="{h}" '
        f'font-family="{_FONT}">',
        "<style>.signal:hover{stroke-width:4}</style>",
        f'<rect width="{w}" height="{h}" fill="#ffffff"/>',
    ]
    for r in picture.rects:
        kind = ' class="opens"' if r.opens else ""
        parts.append(
            f'<rect x="{r.x:.1f}" y="{r.y:.1f}" width="{r.w:.1f}" height="{r.h:.1f}" rx="5" '
            f'fill="{r.fill}" stroke="{r.stroke}" data-path="{html.escape(r.path)}"{kind}/>'
        )
    for line in picture.lines:
        points = " ".join(f"{x:.1f},{y:.1f}" for x, y in line.points)
        parts.append(
            f'<polyline class="signal" points="{points}" fill="none" stroke="{line.color}" '
            'stroke-width="1.4" stroke-linejoin="round"/>'
        )
        if line.arrow:
            head = " ".join(f"{x:.1f},{y:.1f}" for x, y in _arrow_head(line))
            parts.append(f'<polygon points="{head}" fill="{line.color}"/>')
    for t in picture.texts:
        parts.append(
            f'<text x="{t.x:.1f}" y="{t.y:.1f}" font-size="{t.size:g}" text-anchor="{t.anchor}" '
            f'fill="{t.color}" pointer-events="none">{html.escape(t.text)}</text>'
        )
    parts.append("</svg>\n")
    return "\n".join(parts)


def to_png(picture: Picture, scale: float = 1.5) -> bytes:
    """The picture as PNG.

    Args:
        picture: from :func:`prehensile.viz.diagram_layout.lay_out`.
        scale: pixels of the image per pixel of the picture.

    Returns:
        The bytes of the file.
    """
    # Drawn twice as large and shrunk, because Pillow's lines have hard edges.
    s = 2 * scale
    image = Image.new("RGB", (round(picture.width * s), round(picture.height * s)), "white")
    draw = ImageDraw.Draw(image)
    for r in picture.rects:
        corners = [r.x * s, r.y * s, (r.x + r.w) * s, (r.y + r.h) * s]
        draw.rounded_rectangle(corners, 5 * s, fill=r.fill, outline=r.stroke, width=round(s))
    for line in picture.lines:
        points = [(x * s, y * s) for x, y in line.points]
        draw.line(points, fill=line.color, width=round(1.4 * s), joint="curve")
        if line.arrow:
            draw.polygon([(x * s, y * s) for x, y in _arrow_head(line)], fill=line.color)
    for t in picture.texts:
        anchor = {"start": "ls", "middle": "ms", "end": "rs"}[t.anchor]
        draw.text((t.x * s, t.y * s), t.text, fill=t.color, font=font(t.size * s), anchor=anchor)
    image = image.resize((round(picture.width * scale), round(picture.height * scale)))
    buffer = BytesIO()
    image.save(buffer, format="PNG", optimize=True)
    return buffer.getvalue()


def to_page(block: Block, depth: int) -> str:
    """The block as a page: click a yellow block to step in, choose the depth above.

    Args:
        block: what to draw.
        depth: levels drawn open at first.

    Returns:
        A self-contained HTML page. It holds one SVG for every block with systems inside and
        every depth at which that block can be drawn.
    """
    pictures: dict[str, list[str]] = {}

    def collect(b: Block, path: str) -> None:
        if b.children:
            pictures[path] = [to_svg(lay_out(b, d)) for d in range(1, levels(b) + 1)]
            for i, child in enumerate(b.children):
                collect(child, f"{path}/{child.name or i}")

    collect(block, block.name)
    if not pictures:
        pictures[block.name] = [to_svg(lay_out(block, 1))]
    # "</" would end the script element that the data stands in.
    data = json.dumps(pictures).replace("</", "<\\/")
    title = html.escape(block.name or "diagram")
    return _PAGE.replace("@TITLE@", title).replace("@DEPTH@", str(depth)).replace("@DATA@", data)


def _arrow_head(line: Line) -> list[tuple[float, float]]:
    """A triangle that points right into the end of a signal."""
    x, y = line.points[-1]
    return [(x, y), (x - 6, y - 3), (x - 6, y + 3)]


_PAGE = """<!DOCTYPE html>
<html>
<head>
<meta charset="utf-8">
<title>@TITLE@</title>
<style>
body { margin: 0; font: 14px DejaVu Sans, Verdana, sans-serif; background: #fff; }
#bar { position: sticky; top: 0; left: 0; background: #22303c; color: #fff; padding: 8px 12px;
  display: flex; gap: 18px; align-items: center; }
#bar button { font: inherit; color: #fff; background: #3d5366; border: 0; border-radius: 4px;
  padding: 3px 10px; cursor: pointer; }
#bar button.on { background: #d9a441; color: #000; }
#bar .hint { color: #a9bac8; margin-left: auto; }
#picture { overflow: auto; height: calc(100vh - 42px); }
rect.opens { cursor: zoom-in; }
rect.opens:hover { stroke-width: 3; }
</style>
</head>
<body>
<div id="bar">
  <span id="trail"></span>
  <span id="depths"></span>
  <span><button id="smaller">&minus;</button> <button id="larger">+</button>
    <button id="fit">fit</button></span>
  <span class="hint">click a yellow block to step in; hover a signal to see it</span>
</div>
<div id="picture"></div>
<script>
const pictures = @DATA@;
const root = Object.keys(pictures)[0];
let path = root, depth = @DEPTH@, zoom = 0;  // 0: as large as fits, at most 1

function button(text, on, action) {
  const b = document.createElement("button");
  b.textContent = text;
  b.className = on ? "on" : "";
  b.onclick = action;
  return b;
}

function show() {
  const shown = Math.min(depth, pictures[path].length);
  const trail = document.getElementById("trail");
  trail.replaceChildren();
  for (const p of Object.keys(pictures)) {
    if (path === p || path.startsWith(p + "/")) {
      const name = p === root ? p : p.slice(p.lastIndexOf("/") + 1);
      trail.append(button(name, p === path, () => { path = p; show(); }), " ");
    }
  }
  const depths = document.getElementById("depths");
  depths.replaceChildren("depth ");
  for (let d = 1; d <= pictures[path].length; ++d) {
    depths.append(button(d, d === shown, () => { depth = d; show(); }), " ");
  }
  const pane = document.getElementById("picture");
  pane.innerHTML = pictures[path][shown - 1];
  const svg = pane.firstElementChild;
  const fit = Math.min(1, pane.clientWidth / svg.viewBox.baseVal.width);
  const scale = zoom || fit;
  document.getElementById("larger").onclick = () => { zoom = scale * 1.25; show(); };
  document.getElementById("smaller").onclick = () => { zoom = scale / 1.25; show(); };
  svg.setAttribute("width", svg.viewBox.baseVal.width * scale);
  svg.setAttribute("height", svg.viewBox.baseVal.height * scale);
  for (const rect of pane.querySelectorAll("rect.opens")) {
    rect.onclick = () => { path = rect.dataset.path; show(); };
  }
}

document.getElementById("fit").onclick = () => { zoom = 0; show(); };
show();
</script>
</body>
</html>
"""
