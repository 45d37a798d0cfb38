"""Inertias of a URDF or SDF tree, mended where no body can have them or none is there."""

import math

import numpy as np

from prehensile.errors import InputError
from prehensile.models.convert.elements import Source, inertial_element, value
from prehensile.models.convert.mass import Solid, combined, nearest_possible, primitive
from prehensile.models.convert.mesh_store import MeshStore
from prehensile.models.convert.report import Report
from prehensile.models.convert.tree import Tree
from prehensile.models.convert.xml_text import set_child
from prehensile.models.shapes.mesh import MassProperties
from prehensile.models.xml_lines import Element

_MOMENTS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
_TOKEN = primitive("sphere", (0.01,))
"""A ball of 2 cm stands for a link that has to have mass and shows no shape."""


class InertiaMender:
    """Mends the inertias of one tree, before its meshes are converted.

    Args:
        tree: links and joints.
        source: findings go there.
        meshes: for the volume of meshes.
        report: what was done is noted here.
        urdf: whether the tree is URDF, else SDF.
        density: kg/m³ of what has a shape but no mass.
    """

    def __init__(
        self,
        tree: Tree,
        source: Source,
        meshes: MeshStore,
        report: Report,
        urdf: bool,
        density: float,
    ) -> None:
        self._tree = tree
        self._source = source
        self._meshes = meshes
        self._report = report
        self._urdf = urdf
        self._density = density

    def mend(self) -> None:
        """Mends them in place.

        A link without mass is left so where the links fixed to it have mass, or where it need
        have none: fixed to the world, or between a base and links that have mass.
        """
        masses = {name: self._mend_link(name, link) for name, link in self._tree.links.items()}
        for name in self._needing_mass(masses):
            self._give_mass(name, self._tree.links[name])

    def _mend_link(self, name: str, link: Element) -> float:
        """Mends what a link says, and gives its mass."""
        inertial = link.child("inertial")
        if inertial is None:
            if not self._urdf:
                # SDF means 1 kg and 1 kg m² by saying nothing; nobody does.
                text = "no inertia given, for which SDF takes that of 1 kg and 1 kg m²"
                if self._solids(link):
                    self._give_mass(name, link, text)
                    return 1.0
                link.children.insert(
                    0, inertial_element(0.0, np.eye(4), np.zeros((3, 3)), urdf=False)
                )
                self._report.add("inertia", f"link {name}", text + ": none", link.line)
            return 0.0
        said = value(inertial.child("mass"), "value") or value(inertial, "mass") or ""
        mass, moments = _number(said), inertial.child("inertia")
        given = [_number(value(moments, key) or "0") for key in _MOMENTS]
        if not (math.isfinite(mass) and mass >= 0 and all(map(math.isfinite, given))):
            wrong = f"mass '{said}'" if not mass >= 0 or math.isinf(mass) else "its inertia"
            text = f"{wrong} is no number a body can have: taken as if there were none"
            self._report.add("inertia", f"link {name}", text, inertial.line)
            mass = 0.0
        if mass == 0:
            new = inertial_element(0.0, np.eye(4), np.zeros((3, 3)), self._urdf)
            link.children.remove(inertial)
            if not self._urdf:
                link.children.insert(0, new)
            if any(given):
                text = "an inertia without mass: taken out"
                self._report.add("inertia", f"link {name}", text, inertial.line)
            return 0.0
        inertia = np.zeros((3, 3))
        inertia[np.triu_indices(3)] = given
        inertia = inertia + np.triu(inertia, 1).T
        X_LI = self._source.pose(inertial)
        if not inertia.any():
            known = self._known_shape(link, mass)
            text = f"{mass:g} kg without a rotational inertia: that of its shape"
            if known is None:
                ball = Solid(mass / self._density, np.zeros(3), np.eye(3))
                radius = (3 * ball.volume / (4 * math.pi)) ** (1 / 3)
                inertia = 0.4 * mass * radius * radius * np.eye(3)
                text = text.replace("of its shape", f"of a ball of {self._density:g} kg/m³")
            else:
                R = X_LI[:3, :3]
                inertia = R.T @ known.I_BBcm_B @ R
            self._report.add("inertia", f"link {name}", text, inertial.line)
        possible = nearest_possible(inertia)
        if possible is not inertia:
            a, b = np.linalg.eigvalsh(inertia), np.linalg.eigvalsh(possible)
            text = (
                f"principal moments {_three(a)} kg m² that no body can have became the nearest "
                f"that one can, {_three(b)}"
            )
            self._report.add("inertia", f"link {name}", text, inertial.line)
        if possible is not inertia or not np.array_equal(inertia[np.triu_indices(3)], given):
            set_child(link, inertial_element(mass, X_LI, possible, self._urdf))
        return mass

    def _known_shape(self, link: Element, mass: float) -> MassProperties | None:
        """Mass properties of a link's shapes with a given mass."""
        solids = self._solids(link)
        if not solids:
            return None
        density = mass / sum(s.volume for s in solids)
        return combined([(s, density) for s in solids])

    def _needing_mass(self, masses: dict[str, float]) -> list[str]:
        """Links to be given mass, so that no joint moves nothing and no free base is nothing."""
        group = self._tree.rigid_groups()
        total = dict.fromkeys(group.values(), 0.0)
        for name, mass in masses.items():
            total[group[name]] += mass
        outboard: dict[int, list[int]] = {k: [] for k in total}
        inboard: set[int] = set()
        for joint in self._tree.joints:
            parent, child = group.get(joint.parent), group.get(joint.child)
            if joint.moves and parent is not None and child is not None and parent != child:
                outboard[parent].append(child)
                inboard.add(child)

        def carried(start: int) -> float:
            seen, todo = {start}, [start]
            while todo:
                fresh = set(outboard[todo.pop()]) - seen
                seen |= fresh
                todo += fresh
            return sum(total[k] for k in seen)

        needing = []
        for k in total:
            free = k not in inboard
            mass = total[k] if free else carried(k)
            if k == group["world"] or mass > 0:
                continue
            members = [name for name in masses if group[name] == k]
            shaped = [name for name in members if self._solids(self._tree.links[name])]
            needing += shaped or members[:1]
        return needing

    def _give_mass(self, name: str, link: Element, why: str = "no mass, and it moves") -> None:
        solids = self._solids(link)
        properties = combined([(s, self._density) for s in solids or [_TOKEN]])
        X_LI = np.eye(4)
        X_LI[:3, 3] = properties.p_BoBcm_B
        set_child(link, inertial_element(properties.mass, X_LI, properties.I_BBcm_B, self._urdf))
        what = "its shapes" if solids else "no shape either: a ball of 2 cm"
        text = f"{why}: {properties.mass:.3g} kg, {what} of {self._density:g} kg/m³"
        self._report.add("inertia", f"link {name}", text, link.line)

    def _solids(self, link: Element) -> list[Solid]:
        """A link's collision shapes as solids, those seen if it has none."""
        for tag in ("collision", "visual"):
            found = []
            for element in link.all(tag):
                geometry = element.child("geometry")
                try:
                    solid = self._source.solid(geometry, self._meshes) if geometry else None
                except InputError:
                    continue  # The shape is reported, or left out, where it is converted.
                if solid is not None:
                    found.append(solid.moved(self._source.pose(element)))
            if found:
                return found
        return []


def _number(text: str) -> float:
    """NaN for what is not a number."""
    try:
        return float(text)
    except ValueError:
        return math.nan


def _three(values: np.ndarray) -> str:
    return ", ".join(f"{v:.3g}" for v in values)
