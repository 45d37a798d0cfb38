"""Prints for the embedded objects: labels, boxes, wood grain, drawn with Pillow.

Only the generator of models imports this; using the models needs no Pillow. A `Panel` is a sheet
of paper measured in millimetres from its upper left corner; `atlas` lays six of them out for
`prehensile.models.shapes.rounded_box`. Text is set in the font that Pillow brings along, so no
font has to be installed.

    front = Panel(158, 207, "#c62828")
    front.text("CRACKERS", (79, 60), height=24, color="white")
    png = atlas((0.066, 0.158, 0.207), {"+x": front, "-x": front})
"""

from prehensile.models.textures.panel import Panel, atlas
from prehensile.models.textures.patterns import grain, speckle

__all__ = ["Panel", "atlas", "grain", "speckle"]
