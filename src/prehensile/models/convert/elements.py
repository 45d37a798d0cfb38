"""Reading numbers, poses and shapes from elements of any of the three formats, with findings."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from prehensile.errors import Finding, InputError
from prehensile.models.convert.mass import Solid, primitive
from prehensile.models.convert.mesh_store import MeshStore
from prehensile.models.convert.xml_text import make, number, numbers
from prehensile.models.xml_lines import Element

LEAST, GREATEST = 1e-7, 1e5  # m, of shapes
PRIMITIVES = {
    "box": ("size",),
    "sphere": ("radius",),
    "cylinder": ("radius", "length"),
    "capsule": ("radius", "length"),
    "ellipsoid": ("radii",),
}


@dataclass
class Source:
    """The file being converted, and what was found wrong in it.

    Attributes:
        file: the file.
        findings: faults that make a conversion impossible.
        files: by ``id`` of an element, the file it is in where that is another (included) one.
    """

    file: Path
    findings: list[Finding] = field(default_factory=list)
    files: dict[int, Path] = field(default_factory=dict)

    def fault(self, element: Element, message: str, mend: str = "", key: str = "") -> None:
        """Notes a fault at an element."""
        file = str(self.files.get(id(element), self.file))
        self.findings.append(Finding(message, mend, file, element.line, key))

    def raise_findings(self) -> None:
        """Raises everything found so far."""
        if self.findings:
            raise InputError(*dict.fromkeys(self.findings))

    def floats(
        self, element: Element, text: str | None, count: int, default: ArrayLike, key: str
    ) -> np.ndarray:
        """Reads finite numbers; a fault and the default if they are none or too few or many."""
        if text is None or not text.strip():
            return np.array(default, float)
        try:
            values = np.array([float(token) for token in text.split()])
        except ValueError:
            values = np.empty(0)
        if len(values) != count or not np.isfinite(values).all():
            wanted = "a number" if count == 1 else f"{count} numbers"
            self.fault(element, f"'{text[:60]}' is not {wanted}", f"write {wanted}", key)
            return np.array(default, float)
        return values

    def pose(self, parent: Element) -> np.ndarray:
        """(4, 4) pose that ``<origin>`` (URDF) or ``<pose>`` (SDF) in an element gives."""
        origin, pose = parent.child("origin"), parent.child("pose")
        if origin is not None:
            xyz = self.floats(origin, origin.attributes.get("xyz"), 3, (0, 0, 0), "origin.xyz")
            rpy = self.floats(origin, origin.attributes.get("rpy"), 3, (0, 0, 0), "origin.rpy")
            return transform(xyz, Rotation.from_euler("xyz", rpy))
        if pose is None:
            return np.eye(4)
        if pose.attributes.get("rotation_format") == "quat_xyzw":
            p = self.floats(pose, pose.text, 7, (0, 0, 0, 0, 0, 0, 1), "pose")
            return transform(p[:3], Rotation.from_quat(p[3:]))
        p = self.floats(pose, pose.text, 6, np.zeros(6), "pose")
        degrees = pose.attributes.get("degrees") in ("true", "1")
        return transform(p[:3], Rotation.from_euler("xyz", p[3:], degrees=degrees))

    def solid(self, geometry: Element, meshes: MeshStore) -> Solid | None:
        """The shape in a ``<geometry>`` filled with matter; None for planes and the like."""
        for shape in geometry.children:
            kind = shape.tag.removeprefix("drake:")
            if kind in PRIMITIVES:
                size = [
                    float(v)
                    for key in PRIMITIVES[kind]
                    for v in self.floats(
                        shape,
                        value(shape, key) or value(shape, "drake:" + key),
                        3 if key in ("size", "radii") else 1,
                        (np.nan,) * (3 if key in ("size", "radii") else 1),
                        f"{kind}.{key}",
                    )
                ]
                if not all(LEAST < s < GREATEST for s in size):
                    message = f"the size of a {kind} is not > 0, or out of all proportion"
                    self.fault(shape, message, "write its size")
                    return None
                return primitive(kind, size)
            if kind == "mesh":
                return meshes.solid(*self.mesh(shape))
        return None

    def mesh(self, mesh: Element) -> tuple[str, np.ndarray]:
        """URI and (3,) scale of a ``<mesh>``."""
        uri = value(mesh, "filename") or value(mesh, "uri") or ""
        text = value(mesh, "scale")
        if text and len(text.split()) == 1:
            text = f"{text} {text} {text}"
        return uri, self.floats(mesh, text, 3, (1, 1, 1), "mesh.scale")


def value(element: Element | None, key: str) -> str | None:
    """What an element says by an attribute (URDF) or by an element in it (SDF)."""
    if element is None:
        return None
    child = element.child(key)
    return element.attributes.get(key) if child is None else child.text


def transform(p: np.ndarray, R: Rotation) -> np.ndarray:
    """(4, 4) of a position and a rotation."""
    X = np.eye(4)
    X[:3, :3], X[:3, 3] = R.as_matrix(), p
    return X


def pose_element(X: np.ndarray, urdf: bool) -> Element:
    """``<origin>`` of URDF or ``<pose>`` of SDF of a (4, 4) pose."""
    rpy = _rpy(X[:3, :3])
    if urdf:
        return make("origin", xyz=numbers(X[:3, 3]), rpy=numbers(rpy))
    return make("pose", numbers([*X[:3, 3], *rpy]))


def _rpy(R: np.ndarray) -> np.ndarray:
    """Roll, pitch, yaw; yaw 0 at the gimbal lock, where SciPy would warn (exact to 1e-7)."""
    cosine = np.hypot(R[2, 1], R[2, 2])
    pitch = np.arctan2(-R[2, 0], cosine)
    if cosine < 1e-7:
        return np.array([np.arctan2(-R[1, 2], R[1, 1]), pitch, 0.0])
    return np.array([np.arctan2(R[2, 1], R[2, 2]), pitch, np.arctan2(R[1, 0], R[0, 0])])


def inertial_element(mass: float, X_LI: np.ndarray, inertia: np.ndarray, urdf: bool) -> Element:
    """``<inertial>``: mass, pose of the inertial frame in the link, (3, 3) inertia in it."""
    moments = dict(
        zip(
            ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"),
            (number(v) for v in inertia[np.triu_indices(3)]),
            strict=True,
        )
    )
    pose = pose_element(X_LI, urdf)
    if urdf:
        body = [make("mass", value=number(mass)), make("inertia", **moments)]
    else:
        rows = [make(key, text) for key, text in moments.items()]
        body = [make("mass", number(mass)), make("inertia", *rows)]
    return make("inertial", pose, *body)
