"""The geoms of an MJCF body: what is seen, touched, and heavy."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from prehensile.errors import InputError
from prehensile.models.convert.elements import GREATEST, LEAST, pose_element, transform
from prehensile.models.convert.mass import Solid, primitive
from prehensile.models.convert.mesh_store import MeshStore
from prehensile.models.convert.mjcf_file import MeshAsset, MjcfFile, z_to
from prehensile.models.convert.report import Report
from prehensile.models.convert.xml_text import make, number, numbers
from prehensile.models.xml_lines import Element

_SHOWN = 3  # MuJoCo shows geoms of groups below this
_SIZES = {"sphere": 1, "capsule": 2, "cylinder": 2, "box": 3, "ellipsoid": 3}


@dataclass
class Geoms:
    """What the geoms of one body come to.

    Attributes:
        visuals: ``<visual>`` of what does not touch, with its group.
        touching: ``<visual>`` of what touches too, with its group.
        collisions: ``<collision>``.
        solids: of each geom that has mass, in the body's frame, with its density.
        bits: (contype, conaffinity) of what touches.
        weigh: whether the body's inertia is to be that of its geoms.
    """

    visuals: list[tuple[int, Element]] = field(default_factory=list)
    touching: list[tuple[int, Element]] = field(default_factory=list)
    collisions: list[Element] = field(default_factory=list)
    solids: list[tuple[Solid, float]] = field(default_factory=list)
    bits: set[tuple[int, int]] = field(default_factory=set)
    weigh: bool = False

    @property
    def elements(self) -> list[Element]:
        """All; what touches is not drawn where another group is there just to be seen."""
        apart = {group for group, _ in self.visuals}
        drawn = [seen for group, seen in self.touching if not apart or group in apart]
        return [*(seen for _, seen in self.visuals), *drawn, *self.collisions]


@dataclass(frozen=True)
class GeomReader:
    """Reads geoms.

    Attributes:
        file: the MJCF file.
        assets: its meshes.
        meshes: reads and writes them.
        report: what was dropped is noted here.
    """

    file: MjcfFile
    assets: dict[str, MeshAsset]
    meshes: MeshStore
    report: Report

    def read(self, geom: Element, inherited: str, X_BF: np.ndarray, geoms: Geoms) -> None:
        """Adds one geom to those of its body.

        Args:
            geom: the element.
            inherited: default class of its body.
            X_BF: (4, 4) pose in the body of the frame that the geom is placed in.
            geoms: added to.
        """
        given = self.file.attributes(geom, inherited)
        kind = given.get("type", "mesh" if "mesh" in given else "sphere")
        label = f"geom {geom.name or given.get('mesh', '')}".strip()
        if kind in ("plane", "hfield", "sdf"):
            self.report.add("dropped", label, f"a {kind}: Drake has none in a model", geom.line)
            return
        if "mesh" in given and kind != "mesh":
            text = f"a {kind} to be fitted to a mesh: the mesh itself"
            self.report.add("mesh", label, text, geom.line)
        if "mesh" in given:
            shape = self._mesh(geom, given, geoms.weigh)
        elif kind in _SIZES:
            shape = self._primitive(geom, given, kind)
        else:
            self.file.source.fault(geom, f"unknown geom type '{kind}'", "", "type")
            return
        if shape is None:
            return
        X_FG, geometry, solid = shape
        X_BG = X_BF @ X_FG
        self._weigh(geom, given, solid, X_BG, geoms)

        def integer(key: str, default: int) -> int:
            return int(self.file.source.floats(geom, given.get(key), 1, (default,), key)[0])

        name = geom.name or f"geom_{len(geoms.visuals) + len(geoms.collisions)}"
        name = name.replace("::", "_")
        pose = pose_element(X_BG, urdf=False)
        bits = (integer("contype", 1), integer("conaffinity", 1))
        rgba = self._rgba(geom, given)
        group = integer("group", 0)
        if group < _SHOWN and rgba[3] > 0:
            material = make("material", make("diffuse", numbers(rgba)))
            seen = make("visual", pose, make("geometry", geometry), material, name=name)
            (geoms.touching if any(bits) else geoms.visuals).append((group, seen))
        if any(bits):
            geoms.bits.add(bits)
            friction = given.get("friction", "1").split()[0]
            mu = number(
                max(0.0, float(self.file.source.floats(geom, friction, 1, (1.0,), "friction")[0]))
            )
            contact = make(
                "drake:proximity_properties",
                make("drake:mu_static", mu),
                make("drake:mu_dynamic", mu),
            )
            geoms.collisions.append(
                make("collision", pose, make("geometry", geometry), contact, name=name)
            )

    def _rgba(self, geom: Element, given: dict[str, str]) -> np.ndarray:
        text = given.get("rgba")
        if text is None:
            text = self.file.materials.get(given.get("material", ""), "0.5 0.5 0.5 1")
        return np.clip(self.file.source.floats(geom, text, 4, (0.5, 0.5, 0.5, 1), "rgba"), 0, 1)

    def _mesh(
        self, geom: Element, given: dict[str, str], weigh: bool
    ) -> tuple[np.ndarray, Element, Solid | None] | None:
        asset = self.assets.get(given["mesh"])
        if asset is None:
            if not self.file.source.findings:
                self.file.source.fault(geom, f"unknown mesh '{given['mesh']}'", "", "mesh")
            return None
        if Path(asset.uri).suffix.lower() == ".msh":
            message = "MuJoCo's own mesh format .msh is not read"
            self.file.source.fault(geom, message, "export it as .obj or .stl", "mesh")
            return None
        geometry = make("mesh", make("uri", asset.uri), make("scale", numbers(asset.scale)))
        solid = None
        if weigh and self._counts(given):
            try:
                solid = self.meshes.solid(asset.uri, asset.scale)
            except InputError as error:
                if "flat" not in str(error) and "there is no file" not in str(error):
                    for finding in error.findings:
                        self.file.source.fault(geom, finding.message, finding.mend, "mesh")
                    return None
        return self.file.pose(geom, given) @ asset.X_GM, geometry, solid

    def _primitive(
        self, geom: Element, given: dict[str, str], kind: str
    ) -> tuple[np.ndarray, Element, Solid] | None:
        source, count = self.file.source, _SIZES[kind]
        size = (given.get("size") or "").split()
        X = self.file.pose(geom, given)
        if "fromto" in given and kind != "sphere":
            ends = source.floats(geom, given["fromto"], 6, (0, 0, 0, 0, 0, 1), "fromto")
            half = (ends[3:] - ends[:3]) / 2
            length = float(np.linalg.norm(half))
            if length == 0:
                source.fault(geom, "'fromto' has no length", "write two points", "fromto")
                return None
            X = transform((ends[:3] + ends[3:]) / 2, z_to(half / length))
            # A box or an ellipsoid takes its width for its depth.
            width = size[:1]
            size = [*(width * (1 if count == 2 else 2)), repr(length)]
        values = source.floats(geom, " ".join(size[:count]), count, np.full(count, np.nan), "size")
        if not ((values > LEAST) & (values < GREATEST)).all():
            if not source.findings:
                message = f"the size of a {kind} is not > 0, or out of all proportion"
                source.fault(geom, message, f"write {count} of them", "size")
            return None
        sizes = [float(v) for v in values]
        if kind == "box":
            sizes = [2 * v for v in sizes]
            geometry = make("box", make("size", numbers(sizes)))
        elif kind == "ellipsoid":
            geometry = make("ellipsoid", make("radii", numbers(sizes)))
        elif kind == "sphere":
            geometry = make("sphere", make("radius", number(sizes[0])))
        else:
            sizes[1] *= 2
            tag = "capsule" if kind == "capsule" else "cylinder"
            geometry = make(tag, make("radius", number(sizes[0])), make("length", number(sizes[1])))
        return X, geometry, primitive(kind, sizes)

    def _counts(self, given: dict[str, str]) -> bool:
        """Whether a geom is of a group whose geoms make up the inertia."""
        low, high = self.file.compiler.groups
        try:
            return low <= int(given.get("group", "0")) <= high
        except ValueError:
            return True

    def _weigh(
        self,
        geom: Element,
        given: dict[str, str],
        solid: Solid | None,
        X_BG: np.ndarray,
        geoms: Geoms,
    ) -> None:
        if solid is None or not geoms.weigh or not self._counts(given):
            return
        read = self.file.source.floats
        if "mass" in given:
            density = float(read(geom, given["mass"], 1, (0.0,), "mass")[0]) / solid.volume
        else:
            density = float(read(geom, given.get("density"), 1, (1000.0,), "density")[0])
        if density > 0:
            geoms.solids.append((solid.moved(X_BG), density))
