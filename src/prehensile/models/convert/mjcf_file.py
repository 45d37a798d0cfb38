"""An MJCF file as its settings mean it: includes, compiler settings, default classes, assets."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from prehensile.errors import InputError
from prehensile.models.convert.elements import Source, transform
from prehensile.models.convert.locate import Locator
from prehensile.models.convert.mesh_store import MeshStore
from prehensile.models.xml_lines import Element, read_xml

_MAX_INCLUDES = 200
DRIVES = (
    *("general", "motor", "position", "velocity", "intvelocity"),
    *("damper", "cylinder", "muscle", "adhesion", "dcmotor"),
)


@dataclass(frozen=True)
class Compiler:
    """``<compiler>``: how numbers and file names are meant."""

    radians: bool = False
    eulerseq: str = "xyz"
    meshdir: str = ""
    autolimits: bool = True
    inertiafromgeom: str = "auto"
    boundmass: float = 0.0
    boundinertia: float = 0.0
    settotalmass: float = -1.0
    strippath: bool = False
    groups: tuple[int, int] = (0, 5)


@dataclass(frozen=True)
class MeshAsset:
    """A mesh: its URI, scale (3,), and pose X_GM of its file's frame in the geom's frame."""

    uri: str
    scale: np.ndarray
    X_GM: np.ndarray


class MjcfFile:
    """Reads an MJCF file with all it includes.

    Args:
        root: its ``<mujoco>``.
        source: findings go there.
        locator: finds included files and meshes.
    """

    def __init__(self, root: Element, source: Source, locator: Locator) -> None:
        self.root = root
        self.source = source
        self._locator = locator
        self._includes = 0
        self._expand(root)
        source.raise_findings()
        self.compiler = self._read_compiler()
        self._classes: dict[str, dict[str, dict[str, str]]] = {"main": {}}
        for section in self.sections("default"):
            self._read_default(section, section.attributes.get("class", "main"), {})
        self.materials = {
            m.name: self.attributes(m, "main").get("rgba", "1 1 1 1")
            for section in self.sections("asset")
            for m in section.all("material")
        }

    def sections(self, tag: str) -> Iterator[Element]:
        """The sections of that name; there may be several."""
        yield from self.root.all(tag)

    def attributes(self, element: Element, inherited: str) -> dict[str, str]:
        """An element's attributes, completed by those of its default class.

        Args:
            element: a body's part, an actuator or an asset.
            inherited: the class of the body it is in (its ``childclass``).
        """
        name = element.attributes.get("class", inherited)
        if name not in self._classes:
            self.source.fault(element, f"unknown default class '{name}'", "define it", "class")
            name = "main"
        defaults = self._classes[name]
        if element.tag in DRIVES:
            given = {}
            for tag in DRIVES:
                given |= defaults.get(tag, {})
        else:
            given = defaults.get("joint" if element.tag == "freejoint" else element.tag, {})
        return given | element.attributes

    def pose(self, element: Element, attributes: dict[str, str]) -> np.ndarray:
        """(4, 4) pose from ``pos`` and one of MJCF's ways to say an orientation."""
        p = self.source.floats(element, attributes.get("pos"), 3, (0, 0, 0), "pos")
        return transform(p, self.rotation(element, attributes))

    def rotation(self, element: Element, attributes: dict[str, str]) -> Rotation:
        """The orientation that quat, axisangle, euler, xyaxes or zaxis gives."""

        def read(key: str, count: int) -> np.ndarray:
            return self.source.floats(element, attributes[key], count, np.ones(count), key)

        degrees = not self.compiler.radians
        if "quat" in attributes and attributes["quat"].strip():
            w, x, y, z = read("quat", 4)
            if not any((w, x, y, z)):
                self.source.fault(element, "the quaternion is zero", "write 1 0 0 0", "quat")
                return Rotation.identity()
            return Rotation.from_quat([x, y, z, w])
        if "axisangle" in attributes:
            *axis, angle = read("axisangle", 4)
            axis = self._unit(element, np.array(axis), "axisangle")
            return Rotation.from_rotvec(axis * (np.radians(angle) if degrees else angle))
        if "euler" in attributes:
            angles = read("euler", 3)
            # Small letters turn about axes that turn along, capitals about fixed ones; SciPy
            # has it the other way round.
            R = Rotation.identity()
            for letter, angle in zip(self.compiler.eulerseq, angles, strict=True):
                turn = Rotation.from_euler(letter.lower(), angle, degrees=degrees)
                R = R * turn if letter.islower() else turn * R
            return R
        if "xyaxes" in attributes:
            axes = read("xyaxes", 6)
            x = self._unit(element, axes[:3], "xyaxes")
            y = self._unit(element, axes[3:] - x * (x @ axes[3:]), "xyaxes")
            return Rotation.from_matrix(np.column_stack([x, y, np.cross(x, y)]))
        if "zaxis" in attributes:
            return z_to(self._unit(element, read("zaxis", 3), "zaxis"))
        return Rotation.identity()

    def angle(self, value: float) -> float:
        """An angle in rad from one in the file's unit."""
        return value if self.compiler.radians else float(np.radians(value))

    def read_meshes(self, meshes: MeshStore) -> dict[str, MeshAsset]:
        """The mesh assets by name; meshes given by their points are put into the store."""
        assets = {}
        for section in self.sections("asset"):
            for element in section.all("mesh"):
                asset = self._read_mesh(element, meshes)
                if asset is not None:
                    name = element.name or Path(element.attributes.get("file", "")).stem
                    assets[name] = asset
        return assets

    def _read_mesh(self, element: Element, meshes: MeshStore) -> MeshAsset | None:
        given = self.attributes(element, "main")
        floats = self.source.floats
        scale = floats(element, given.get("scale"), 3, (1, 1, 1), "scale")
        p = floats(element, given.get("refpos"), 3, (0, 0, 0), "refpos")
        w, x, y, z = floats(element, given.get("refquat"), 4, (1, 0, 0, 0), "refquat")
        if not any((w, x, y, z)):
            self.source.fault(element, "the quaternion is zero", "write 1 0 0 0", "refquat")
            return None
        X_GM = np.linalg.inv(transform(p, Rotation.from_quat([x, y, z, w])))
        if "vertex" in given:
            text = given["vertex"].split()
            points = floats(element, given["vertex"], len(text), np.zeros(len(text)), "vertex")
            if len(points) % 3 or len(points) < 12:
                self.source.fault(element, "not a list of 4 or more points", "", "vertex")
                return None
            from scipy.spatial import ConvexHull, QhullError

            points = points.reshape(-1, 3)
            try:
                faces = ConvexHull(points).simplices
            except (QhullError, ValueError):
                self.source.fault(element, "the points are in a plane", "", "vertex")
                return None
            return MeshAsset(
                meshes.add_points(element.name or "points", points, faces), scale, X_GM
            )
        file = given.get("file", "")
        if not file:
            self.source.fault(element, "<mesh> names no file", "name the mesh file", "file")
            return None
        try:
            return MeshAsset(str(self._file(file)), scale, X_GM)
        except InputError as error:
            if "there is no file" in str(error):
                # Said, or left out, where a geom uses it.
                return MeshAsset(file, scale, X_GM)
            for finding in error.findings:
                self.source.fault(element, finding.message, finding.mend, f"mesh {file}")
            return None

    def _file(self, name: str) -> Path:
        if self.compiler.strippath:
            name = Path(name.replace("\\", "/")).name
        folder = self.source.file.absolute().parent
        return self._locator.find(name, folder / self.compiler.meshdir)[0]

    def _unit(self, element: Element, axis: np.ndarray, key: str) -> np.ndarray:
        norm = float(np.linalg.norm(axis))
        if norm < 1e-12:
            self.source.fault(element, "an axis of length zero", "write a direction", key)
            return np.array([0.0, 0.0, 1.0])
        return axis / norm

    def _expand(self, element: Element, stack: tuple[Path, ...] = ()) -> None:
        """Puts the contents of included files in place, and notes where they come from."""
        result = []
        for child in element.children:
            if child.tag != "include":
                self._expand(child, stack)
                result.append(child)
                continue
            self._includes += 1
            path = self._include_path(child, stack)
            if path is None:
                continue
            included = read_xml(path, self.source.findings)
            if included is not None:
                for part in included.walk():
                    self.source.files[id(part)] = path
                self._expand(included, (*stack, path))
                result += included.children
        element.children = result

    def _include_path(self, element: Element, stack: tuple[Path, ...]) -> Path | None:
        try:
            path = self._locator.find(element.attributes.get("file", ""))[0]
        except InputError as error:
            for finding in error.findings:
                self.source.fault(element, finding.message, finding.mend, "include")
            return None
        if path in stack or path == self.source.file.absolute() or self._includes > _MAX_INCLUDES:
            self.source.fault(element, "the file includes itself", "break the circle", "include")
            return None
        return path

    def _read_compiler(self) -> Compiler:
        compiler = Compiler()
        for element in self.sections("compiler"):
            given = element.attributes

            def number(key: str, old: float, element: Element = element) -> float:
                return float(
                    self.source.floats(element, element.attributes.get(key), 1, (old,), key)[0]
                )

            eulerseq = given.get("eulerseq", compiler.eulerseq)
            if len(eulerseq) != 3 or set(eulerseq.lower()) - set("xyz"):
                self.source.fault(element, f"'{eulerseq}' is no sequence of axes", "", "eulerseq")
                eulerseq = "xyz"
            groups = given.get("inertiagrouprange")
            low, high = self.source.floats(element, groups, 2, compiler.groups, "inertiagrouprange")
            if given.get("coordinate") == "global":
                self.source.fault(
                    element, "global coordinates, which MuJoCo gave up", "", "coordinate"
                )
            compiler = replace(
                compiler,
                radians=given.get("angle", "radian" if compiler.radians else "degree") == "radian",
                eulerseq=eulerseq,
                meshdir=given.get("meshdir", given.get("assetdir", compiler.meshdir)),
                autolimits=given.get("autolimits", str(compiler.autolimits)).lower() == "true",
                inertiafromgeom=given.get("inertiafromgeom", compiler.inertiafromgeom),
                boundmass=number("boundmass", compiler.boundmass),
                boundinertia=number("boundinertia", compiler.boundinertia),
                settotalmass=number("settotalmass", compiler.settotalmass),
                strippath=given.get("strippath", str(compiler.strippath)).lower() == "true",
                groups=(int(low), int(high)),
            )
        return compiler

    def _read_default(
        self, element: Element, name: str, inherited: dict[str, dict[str, str]]
    ) -> None:
        own = {tag: dict(values) for tag, values in self._classes.get(name, inherited).items()}
        for child in element.children:
            if child.tag != "default":
                own[child.tag] = own.get(child.tag, {}) | child.attributes
        self._classes[name] = own
        for child in element.all("default"):
            self._read_default(child, child.attributes.get("class", ""), own)


def z_to(axis: np.ndarray) -> Rotation:
    """The least rotation that takes z to a unit vector."""
    sine = np.cross([0.0, 0.0, 1.0], axis)
    norm = float(np.linalg.norm(sine))
    if norm < 1e-12:
        return Rotation.from_rotvec([0.0 if axis[2] > 0 else np.pi, 0.0, 0.0])
    return Rotation.from_rotvec(sine / norm * np.arctan2(norm, axis[2]))
