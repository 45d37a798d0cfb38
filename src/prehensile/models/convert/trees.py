"""URDF and SDF files: checked, then mended in place as trees of elements, so that nothing that
Drake understands in them is lost.
"""

from pathlib import Path

import numpy as np

from prehensile.models.convert.elements import Source
from prehensile.models.convert.inertias import InertiaMender
from prehensile.models.convert.joints import JointMender
from prehensile.models.convert.loops import open_loops
from prehensile.models.convert.mesh_store import MeshStore
from prehensile.models.convert.options import ConvertOptions
from prehensile.models.convert.report import Report
from prehensile.models.convert.shapes import ShapeConverter
from prehensile.models.convert.tree import read_tree
from prehensile.models.convert.xml_text import remove
from prehensile.models.xml_lines import Element

# What describes other programs' business.
_FOREIGN = (
    *("gazebo", "plugin", "sensor", "ros2_control", "light"),
    *("safety_controller", "calibration"),
)


def check_urdf(robot: Element, source: Source) -> None:
    """Refuses what is not a URDF yet: a macro file."""
    for element in robot.walk():
        text = " ".join([*element.attributes.values(), element.text])
        if element.tag.startswith("xacro:") or "${" in text or "$(" in text:
            source.fault(
                element,
                "this is a xacro file: macros, not yet a robot",
                f"expand it first: xacro {source.file.name} > robot.urdf",
            )
            break
    if robot.tag != "robot":
        source.fault(robot, f"the outermost element is <{robot.tag}>, not <robot>")
    source.raise_findings()


def sdf_model(root: Element, source: Source) -> Element:
    """The one model of an SDF file."""
    if root.tag != "sdf":
        source.fault(root, f"the outermost element is <{root.tag}>, not <sdf>")
        source.raise_findings()
    models = [m for top in (root, *root.all("world")) for m in top.all("model")]
    if len(models) != 1:
        source.fault(root, f"the file holds {len(models)} models", "keep the one to be converted")
    for element in root.walk():
        if element.tag == "include":
            mend = "expand it first: gz sdf -p FILE"
            source.fault(element, "the file includes another", mend, "include")
    source.raise_findings()
    # A link of this name, which Drake refuses, is how Bullet's files name the world.
    models[0].children = [c for c in models[0].children if (c.tag, c.name) != ("link", "world")]
    return models[0]


def mend_tree(
    model: Element, source: Source, meshes: MeshStore, report: Report, options: ConvertOptions
) -> None:
    """Makes a URDF ``<robot>`` or SDF ``<model>`` one that Drake loads, in place.

    Raises:
        InputError: everything in it that cannot be mended.
    """
    urdf = model.tag == "robot"
    if not urdf:
        open_loops(model, source, report)
    tree = read_tree(model, source)
    if not tree.links:
        source.fault(model, "there are no links in it", "add a <link>")
    source.raise_findings()
    joints = JointMender(model, tree, source, report, urdf, options.actuators == "all")
    joints.mend()
    joints.set_base(options.base)
    tree = read_tree(model, source)
    InertiaMender(tree, source, meshes, report, urdf, options.density).mend()
    colors = _colors(model, source) if urdf else {}
    shapes = ShapeConverter(source, meshes, report, urdf, options.skip_missing, colors)
    for link in tree.links.values():
        shapes.convert(link)
    for element in [model, *tree.links.values(), *(j.element for j in tree.joints)]:
        for tag in _FOREIGN:
            if count := remove(element, tag):
                text = f"{count} of <{tag}>, which Drake has no use for"
                report.add("dropped", element.name or element.tag, text, element.line)
    if urdf:
        remove(model, "material")
    source.raise_findings()


def _colors(robot: Element, source: Source) -> dict[str, np.ndarray]:
    """Colours of the named materials, wherever in the file they are defined."""
    colors: dict[str, np.ndarray] = {}
    for element in robot.walk():
        color = element.child("color") if element.tag == "material" else None
        if color is not None and element.name and element.name not in colors:
            rgba = color.attributes.get("rgba")
            grey = (0.7, 0.7, 0.7, 1.0)
            colors[element.name] = source.floats(color, rgba, 4, grey, "material.rgba")
    return colors


def file_stem(path: Path) -> str:
    """A name for a model from that of its file; ``model.urdf`` is named by its folder."""
    stem = path.name.split(".")[0]
    return path.parent.name if stem in ("model", "robot", "urdf", "") else stem
