"""Checks SDF and URDF files before Drake parses them.

Drake reports the first fault it meets, and some it does not survive (a file that includes itself,
a mesh resolution that takes all memory). This finds all faults at once, with their lines, and
tells the names of links, frames and joints, so that a scenario's references can be checked.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from prehensile.errors import Finding, InputError
from prehensile.models.model_values import (
    Fault,
    collision_faults,
    gltf_faults,
    greatest_extent,
    inertial_faults,
    limit_faults,
    number_faults,
    resolution_hint,
)
from prehensile.models.packages import inside, resolve
from prehensile.models.xml_lines import Element, read_xml

MAX_MESH_BYTES = 512 << 20
_MAX_INCLUDES = 20  # nested SDF files
_SDF_DOF = {
    "revolute": 1,
    "continuous": 1,
    "prismatic": 1,
    "fixed": 0,
    "ball": 3,
    "universal": 2,
    "planar": 3,
    "floating": 7,
}


@dataclass(frozen=True)
class Shape:
    """A collision shape whose hydroelastic mesh depends on a resolution hint.

    Attributes:
        where: its link, for messages.
        size: its greatest extent in metres.
        hint: its own resolution hint in metres, None if the scenario's default applies.
    """

    where: str
    size: float
    hint: float | None


@dataclass
class ModelFile:
    """What a model file holds, as far as references to it go.

    Attributes:
        path: the file.
        frames: names of links and frames; those of nested models as ``model::link``.
        joints: joint name to number of positions (None if this does not tell).
        shapes: collision shapes with a choice of resolution.
        opaque: True if the names could not be read; then any name may be right.
    """

    path: Path
    frames: set[str] = field(default_factory=set)
    joints: dict[str, int | None] = field(default_factory=dict)
    shapes: list[Shape] = field(default_factory=list)
    opaque: bool = False


class ModelFileReader:
    """Reads and checks model files, each once.

    Args:
        packages: package name to root folder.
        findings: what is wrong with the files is appended here.
    """

    def __init__(self, packages: Mapping[str, Path], findings: list[Finding]) -> None:
        self._packages = packages
        self._findings = findings
        self._known: dict[Path, ModelFile] = {}

    def read(self, path: Path, root: Path) -> ModelFile:
        """Reads one file.

        Args:
            path: the file.
            root: the folder that relative paths in it may not leave.

        Returns:
            What it holds; ``opaque`` if it is faulty, or neither SDF nor URDF.
        """
        return self._read(path, root, ())

    def _read(self, path: Path, root: Path, stack: tuple[Path, ...]) -> ModelFile:
        real = path.resolve()
        if real in self._known:
            return self._known[real]
        model = ModelFile(path)
        if path.suffix not in (".sdf", ".urdf", ".xml"):
            model.opaque = True
        else:
            before = len(self._findings)
            element = read_xml(path, self._findings)
            if element is not None:
                _FileChecker(self, model, root, (*stack, real), self._findings).check(element)
            model.opaque |= len(self._findings) > before
        self._known[real] = model
        return model


class _FileChecker:
    """The checks of one file."""

    def __init__(
        self,
        reader: ModelFileReader,
        model: ModelFile,
        root: Path,
        stack: tuple[Path, ...],
        findings: list[Finding],
    ) -> None:
        self._reader = reader
        self._model = model
        self._root = root
        self._stack = stack
        self._findings = findings
        self._said: set[str] = set()

    def check(self, root: Element) -> None:
        if self._model.path.suffix == ".xml":
            self._check_mjcf(root)
            return
        sdf = self._model.path.suffix == ".sdf"
        wanted = "sdf" if sdf else "robot"
        if root.tag != wanted:
            self._add(root, f"the outermost element is <{root.tag}>, not <{wanted}>")
            return
        for element in root.walk():
            self._report(number_faults(element))
        if sdf:
            models = root.all("model")
            if len(models) != 1 or root.child("world"):
                self._model.opaque = True  # a world: several models, named by the file
            for element in (c for top in (root, *root.all("world")) for c in top.children):
                if element.tag == "model":
                    self._check_sdf_model(element, "")
                elif element.tag == "include":
                    self._check_include(element, "")
        else:
            self._check_urdf(root)

    # SDF

    def _check_sdf_model(self, model: Element, scope: str) -> None:
        frames = self._model.frames
        if scope:
            frames.add(scope.removesuffix("::"))
        frames.add(f"{scope}__model__")
        for link in model.all("link"):
            self._check_link(link, scope + link.name)
        frames |= {scope + frame.name for frame in model.all("frame")}
        for joint in model.all("joint"):
            kind = joint.attributes.get("type", "")
            self._model.joints[scope + joint.name] = _SDF_DOF.get(kind)
            # Drake makes frames of a joint's name.
            frames |= {f"{scope}{joint.name}{end}" for end in ("", "_parent", "_child")}
            for axis in (c for c in joint.children if c.tag in ("axis", "axis2")):
                limit = axis.child("limit")
                if limit is not None:
                    values = {c.tag: c.text for c in limit.children}
                    self._report(limit_faults(limit, joint.name, values))
        for joint in model.children:
            if joint.tag == "drake:joint":
                self._model.joints[scope + joint.name] = None
        for nested in model.all("model"):
            self._check_sdf_model(nested, f"{scope}{nested.name}::")
        for include in model.all("include"):
            self._check_include(include, scope)

    def _check_include(self, include: Element, scope: str) -> None:
        uri = include.child("uri")
        merged = include.attributes.get("merge", "false") in ("true", "1")
        if uri is None:
            self._add(include, "<include> has no <uri>", "name the file to include")
            return
        path, root = self._resolve(uri, uri.text, folder=True)
        if path is None or root is None:
            self._model.opaque = True
            return
        if not self._may_include(uri, path):
            self._model.opaque = True
            return
        inner = self._reader._read(path, root, self._stack)
        name = include.child("name")
        if merged or name is None:
            self._model.opaque = True  # the name is the included file's own
            return
        prefix = f"{scope}{name.text}::"
        self._model.frames |= {prefix + frame for frame in inner.frames}
        self._model.joints |= {prefix + joint: n for joint, n in inner.joints.items()}
        self._model.shapes += inner.shapes
        self._model.opaque |= inner.opaque

    def _may_include(self, element: Element, path: Path) -> bool:
        """Reports a file that includes itself: Drake would follow it until it crashes."""
        if path.resolve() in self._stack:
            self._add(element, "the file includes itself", "break the circle of <include> elements")
        elif len(self._stack) >= _MAX_INCLUDES:
            self._add(element, f"files include each other more than {_MAX_INCLUDES} deep")
        else:
            return True
        return False

    # MJCF

    def _check_mjcf(self, root: Element) -> None:
        """Numbers and included files; the names in it are left to Drake."""
        self._model.opaque = True
        if root.tag not in ("mujoco", "mujocoinclude"):
            self._add(root, f"the outermost element is <{root.tag}>, not <mujoco>")
            return
        for element in root.walk():
            self._report(number_faults(element))
            if element.tag == "include":
                path, folder = self._resolve(element, element.attributes.get("file", ""))
                if path and folder and self._may_include(element, path):
                    self._reader._read(path, folder, self._stack)

    # URDF

    def _check_urdf(self, robot: Element) -> None:
        for link in robot.all("link"):
            self._check_link(link, link.name)
        for frame in robot.children:
            if frame.tag in ("frame", "drake:frame"):
                self._model.frames.add(frame.name)
        for joint in robot.children:
            if joint.tag not in ("joint", "drake:joint"):
                continue
            kind = joint.attributes.get("type", "")
            self._model.joints[joint.name] = _SDF_DOF.get(kind)
            self._model.frames |= {joint.name + end for end in ("_parent", "_child")}
            limit = joint.child("limit")
            if limit is not None:
                self._report(limit_faults(limit, joint.name, limit.attributes))

    # Both

    def _check_link(self, link: Element, name: str) -> None:
        self._model.frames.add(name)
        inertial = link.child("inertial")
        if inertial is not None:
            self._report(inertial_faults(inertial, name))
        for geometry in (*link.all("visual"), *link.all("collision")):
            shape = geometry.child("geometry")
            for mesh in shape.walk() if shape else ():
                if mesh.tag == "mesh":
                    self._check_mesh(mesh)
            if shape is not None and geometry.tag == "collision":
                self._report(collision_faults(geometry, name))
                size = greatest_extent(shape)
                if size is not None:
                    hint = resolution_hint(geometry)
                    self._model.shapes.append(Shape(f"link '{name}'", size, hint))

    def _check_mesh(self, mesh: Element) -> None:
        uri = mesh.child("uri")
        text = mesh.attributes.get("filename") if uri is None else uri.text
        element = mesh if uri is None else uri
        if not text:
            self._add(mesh, "<mesh> names no file", "name the mesh file")
            return
        path, root = self._resolve(element, text)
        if path is None or root is None:
            return
        size = path.stat().st_size
        if size > MAX_MESH_BYTES:
            self._add(element, f"the mesh '{text}' has {size >> 20} MiB", "simplify it")
        elif path.suffix == ".gltf":
            for fault in gltf_faults(path, root):
                self._add(element, f"the mesh '{text}': {fault}")

    def _resolve(
        self, element: Element, text: str, folder: bool = False
    ) -> tuple[Path | None, Path | None]:
        """The file that a URI or relative path means, and the folder it may not leave."""
        try:
            if text.startswith(("package://", "model://")):
                url = "package://" + text.split("://", 1)[1]
                if folder:
                    url = self._with_config(url)
                path = resolve(url, self._reader._packages)
                name = url.removeprefix("package://").split("/", 1)[0]
                return path, self._reader._packages.get(name, path.parent)
            if text.startswith("file://"):
                path = Path(text.removeprefix("file://"))
                return inside(path.parent, path, text), path.parent
            if "://" in text:
                raise InputError(Finding(f"'{text}' is not a model URL", "write package://..."))
            return inside(self._root, self._model.path.parent / text, text), self._root
        except InputError as error:
            for finding in error.findings:
                self._add(element, finding.message, finding.mend)
            return None, None

    def _with_config(self, url: str) -> str:
        """The file in a folder that ``<include>`` names the old way, by its ``model.config``."""
        if Path(url).suffix in (".sdf", ".urdf"):
            return url
        config = read_xml(resolve(f"{url}/model.config", self._reader._packages), self._findings)
        files = config.all("sdf") if config else []
        return f"{url}/{files[-1].text}" if files else url

    def _report(self, faults: Iterable[Fault]) -> None:
        for fault in faults:
            self._add(fault.element, fault.message, fault.mend)

    def _add(self, element: Element, message: str, mend: str = "") -> None:
        if message in self._said and "package" in message:
            return  # once a file is enough
        self._said.add(message)
        self._findings.append(Finding(message, mend, str(self._model.path), element.line))
