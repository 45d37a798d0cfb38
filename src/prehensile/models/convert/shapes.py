"""What is seen and touched on the links of a URDF or SDF tree, in forms that Drake loads."""

from dataclasses import dataclass

import numpy as np

from prehensile.errors import InputError
from prehensile.models.convert.elements import Source, pose_element, value
from prehensile.models.convert.mesh_file import linear
from prehensile.models.convert.mesh_store import MeshStore
from prehensile.models.convert.report import Report
from prehensile.models.convert.xml_text import make, number, numbers, remove, set_child
from prehensile.models.xml_lines import Element


@dataclass(frozen=True)
class ShapeConverter:
    """Converts the visuals and collisions of links.

    Attributes:
        source: of the tree.
        meshes: reads and writes the meshes.
        report: what was done is noted here.
        urdf: whether the tree is URDF, else SDF.
        skip_missing: drop meshes that cannot be found.
        colors: named materials of a URDF, red, green, blue, alpha as screens have them.
    """

    source: Source
    meshes: MeshStore
    report: Report
    urdf: bool
    skip_missing: bool
    colors: dict[str, np.ndarray]

    def convert(self, link: Element) -> None:
        """Converts one link in place."""
        result = []
        for child in link.children:
            if child.tag not in ("visual", "collision"):
                result.append(child)
                continue
            geometry = child.child("geometry")
            mesh = geometry.child("mesh") if geometry else None
            if geometry is None or not geometry.children:
                text = f"a {child.tag} without a shape"
                self.report.add("dropped", f"link {link.name}", text, child.line)
            elif mesh is None:
                result.append(self._colored(child) if child.tag == "visual" else child)
            else:
                result += self._convert_mesh(link, child, mesh)
        link.children = result
        self._unique_names(link)

    def _convert_mesh(self, link: Element, parent: Element, mesh: Element) -> list[Element]:
        uri, scale = self.source.mesh(mesh)
        if not uri:
            self.source.fault(mesh, "<mesh> names no file", "name the mesh file", "mesh")
            return []
        try:
            if parent.tag == "visual":
                return [self._visual(parent, uri, scale)]
            return self._collisions(parent, uri, scale)
        except InputError as error:
            missing = "there is no file" in str(error) or "unknown package" in str(error)
            if missing and self.skip_missing:
                text = f"its mesh '{uri}' was not found"
                self.report.add("dropped", f"{parent.tag} of {link.name}", text, mesh.line)
                return []
            for finding in error.findings:
                mend = finding.mend
                if missing and "--package" not in mend:
                    mend += "; or leave such meshes out: --skip-missing"
                message = finding.message
                if finding.file:
                    message = f"{finding.file}: {message}"
                self.source.fault(mesh, message, mend, f"{link.name}.{parent.tag}")
            return []

    def _visual(self, visual: Element, uri: str, scale: np.ndarray) -> Element:
        color = self._color(visual)
        file = self.meshes.visual(uri, scale, None if color is None else linear(color))
        geometry = make("geometry", self._mesh_element(file))
        keep = [c for c in visual.children if c.tag not in ("geometry", "material")]
        return Element("visual", visual.attributes, visual.line, [*keep, geometry])

    def _collisions(self, collision: Element, uri: str, scale: np.ndarray) -> list[Element]:
        X_LM = self.source.pose(collision)
        pose = collision.child("pose")
        shapes, result = self.meshes.collision(uri, scale), []
        for i, shape in enumerate(shapes):
            if shape.file:
                mesh = self._mesh_element(shape.file)
                if shape.convex:
                    mesh.children.append(make("drake:declare_convex"))
                geometry = make("geometry", mesh)
            else:
                size = numbers(shape.size)
                box = make("box", size=size) if self.urdf else make("box", make("size", size))
                geometry = make("geometry", box)
            keep = [c for c in collision.children if c.tag not in ("geometry",)]
            new = Element("collision", dict(collision.attributes), collision.line, [*keep])
            new.children.append(geometry)
            if any(shape.p_MS):
                X_MS = np.eye(4)
                X_MS[:3, 3] = shape.p_MS
                element = pose_element(X_LM @ X_MS, self.urdf)
                if pose is not None and "relative_to" in pose.attributes:
                    element.attributes["relative_to"] = pose.attributes["relative_to"]
                set_child(new, element)
            if len(shapes) > 1 and collision.name:
                new.attributes["name"] = f"{collision.name}_{i}"
            result.append(new)
        return result

    def _mesh_element(self, file: str) -> Element:
        return make("mesh", filename=file) if self.urdf else make("mesh", make("uri", file))

    def _color(self, visual: Element) -> np.ndarray | None:
        """The colour of a visual, as screens have it."""
        material = visual.child("material")
        if material is None:
            return None
        if self.urdf:
            color = material.child("color")
            if color is None:
                return self.colors.get(material.name)
            text: str | None = color.attributes.get("rgba")
        else:
            text = value(material, "diffuse") or value(material, "ambient")
            color = material
        if text and len(text.split()) == 3:
            text += " 1"
        if not text:
            return None
        return np.clip(self.source.floats(color, text, 4, (0.7, 0.7, 0.7, 1), "material"), 0, 1)

    def _colored(self, visual: Element) -> Element:
        """A primitive's visual with its colour in place: a URDF may define names at odds."""
        color = self._color(visual)
        if self.urdf:
            remove(visual, "material")
            if color is not None:
                # Drake wants every name to mean one colour.
                name = "color_" + "_".join(number(round(c, 4)) for c in color)
                visual.children.append(
                    make("material", make("color", rgba=numbers(color)), name=name)
                )
        return visual

    def _unique_names(self, link: Element) -> None:
        """Names of visuals and collisions: SDF needs them, and each but once in a link."""
        for tag in ("visual", "collision"):
            seen: set[str] = set()
            for i, child in enumerate(link.all(tag)):
                name = child.name or (f"{tag}_{i}" if not self.urdf else "")
                base, k = name, 1
                while name and name in seen:
                    k += 1
                    name = f"{base}_{k}"
                if name:
                    child.attributes["name"] = name
                    seen.add(name)
