"""MJCF read as an SDF model."""

import math
from collections import Counter

import numpy as np

from prehensile.models.convert.elements import Source, inertial_element, pose_element
from prehensile.models.convert.locate import Locator
from prehensile.models.convert.mass import combined
from prehensile.models.convert.mesh_store import MeshStore
from prehensile.models.convert.mjcf_drives import Placed, contact_filters, couplings, efforts
from prehensile.models.convert.mjcf_file import MjcfFile
from prehensile.models.convert.mjcf_geoms import GeomReader, Geoms
from prehensile.models.convert.report import Report
from prehensile.models.convert.xml_text import make, number, numbers
from prehensile.models.shapes.mesh import MassProperties
from prehensile.models.xml_lines import Element

_REFUSED = ("replicate", "attach", "composite", "flexcomp", "flex", "skin")
_OTHER = ("sensor", "keyframe", "custom", "visual", "extension", "deformable")
_MASSLESS = inertial_element(0.0, np.eye(4), np.zeros((3, 3)), urdf=False)


def mjcf_model(
    root: Element, source: Source, locator: Locator, meshes: MeshStore, report: Report
) -> Element:
    """Reads an MJCF file as an SDF ``<model>`` whose meshes are still to be converted.

    Joints are at zero where MuJoCo has them at ``ref``; several joints of one body are a chain of
    links without mass.

    Args:
        root: ``<mujoco>``.
        source: findings go there.
        locator: finds included files and meshes.
        meshes: for the volume of meshes.
        report: what was dropped or has another form is noted here.

    Raises:
        InputError: what is wrong in it, or has no form in Drake.
    """
    file = MjcfFile(root, source, locator)
    for element in root.walk():
        if element.tag in _REFUSED:
            message = f"<{element.tag}> is not read here"
            mend = "write the expanded model by MuJoCo's mj_saveLastXML, and convert that"
            source.fault(element, message, mend, element.tag)
    dropped = Counter(c.tag for c in root.children if c.tag in _OTHER)
    for tag, count in dropped.items():
        report.add("dropped", tag, f"{count} sections, which Drake has no use for in a model")
    bodies = _Bodies(file, GeomReader(file, file.read_meshes(meshes), meshes, report), report)
    source.raise_findings()
    for world in file.sections("worldbody"):
        bodies.read_world(world)
    source.raise_findings()
    return bodies.model()


class _Bodies:
    """Walks the bodies and builds the SDF."""

    def __init__(self, file: MjcfFile, geoms: GeomReader, report: Report) -> None:
        self._file = file
        self._geoms = geoms
        self._report = report
        self._efforts = efforts(file, report)
        self._names: set[str] = {"world"}
        self._links: list[Element] = []
        self._joints: dict[str, Element] = {}
        self._frames: list[Element] = []
        self._apart: list[tuple[str, str]] = []
        self._bits: dict[str, set[tuple[int, int]]] = {}
        self._placed = Placed({}, {}, {}, {}, {})

    def model(self) -> Element:
        """The finished model."""
        for name in self._efforts:
            if name not in self._placed.joints:
                text = "driven, but there is no such joint of one degree of freedom"
                self._report.add("dropped", f"joint {name}", text)
        extra = couplings(self._file, self._placed, self._joints, self._report)
        extra += contact_filters(self._file, self._placed, self._bits)
        for k, pair in enumerate(self._apart):
            name = f"neighbours_{k}"
            members = [make("drake:member", link) for link in pair]
            ignored = make("drake:ignored_collision_filter_group", name)
            extra.append(make("drake:collision_filter_group", *members, ignored, name=name))
        self._file.source.raise_findings()
        self._settle_mass()
        return make("model", *self._links, *self._frames, *self._joints.values(), *extra)

    def read_world(self, world: Element) -> None:
        """All bodies, and the geoms of the world itself as one link welded to it."""
        geoms = Geoms()
        childclass = world.attributes.get("childclass", "main")
        self._children(world, "", "world", np.eye(4), np.eye(4), childclass, geoms)
        if geoms.elements:
            name = self._unique("world_geometry", "link")
            self._links.append(make("link", _MASSLESS, *geoms.elements, name=name))
            self._weld("world", name)
            self._bits[name] = geoms.bits
            text = "geoms of the world: a link that is welded to it"
            self._report.add("base", f"link {name}", text, world.line)

    def _children(
        self,
        parent: Element,
        body: str,
        link: str,
        X_WB: np.ndarray,
        X_BF: np.ndarray,
        inherited: str,
        geoms: Geoms,
    ) -> None:
        """The parts of a body, or of a <frame> in it; X_BF is the frame's pose in the body."""
        for child in parent.children:
            given = child.attributes
            if child.tag == "geom":
                self._geoms.read(child, inherited, X_BF, geoms)
            elif child.tag == "site":
                self._site(child, body, link, inherited, X_BF)
            elif child.tag == "frame":
                X = X_BF @ self._file.pose(child, given)
                inner = given.get("childclass", inherited)
                self._children(child, body, link, X_WB, X, inner, geoms)
            elif child.tag == "body":
                self._body(child, link, X_WB @ X_BF, inherited)

    def _body(self, body: Element, parent: str, X_WF: np.ndarray, inherited: str) -> None:
        inherited = body.attributes.get("childclass", inherited)
        X_WB = X_WF @ self._file.pose(body, body.attributes)
        name = body.name or f"body_{len(self._placed.links)}"
        link = self._unique(name, "link")
        self._placed.links[name], self._placed.poses[name] = link, X_WB
        joints = [c for c in body.children if c.tag in ("joint", "freejoint")]
        kinds = [self._file.attributes(j, inherited).get("type", "hinge") for j in joints]
        free = any(j.tag == "freejoint" or k == "free" for j, k in zip(joints, kinds, strict=True))
        if free and (parent != "world" or len(joints) > 1):
            self._file.source.fault(joints[0], "a free joint that is not alone", "", "freejoint")
        if not joints:
            self._weld(parent, link)
        elif not free:
            above = parent
            for k, joint in enumerate(joints):
                child = link
                if k < len(joints) - 1:
                    child = self._unique(f"{name}_{k}", "link")
                    pose = pose_element(X_WB, urdf=False)
                    self._links.append(make("link", pose, _MASSLESS, name=child))
                self._joint(joint, above, child, name, inherited)
                above = child
            if len(joints) > 1 and parent != "world":
                self._apart.append((parent, link))
        weigh = body.child("inertial") is None or self._file.compiler.inertiafromgeom == "true"
        geoms = Geoms(weigh=weigh)
        element = make("link", pose_element(X_WB, urdf=False), name=link)
        self._links.append(element)
        self._children(body, name, link, X_WB, np.eye(4), inherited, geoms)
        element.children += [self._inertial(body, geoms), *geoms.elements]
        if geoms.bits:
            self._bits[link] = geoms.bits
        if body.attributes.get("gravcomp", "0") not in ("0", "0.0"):
            text = "its gravity is not taken away: compensate it in the controller"
            self._report.add("note", f"link {link}", text, body.line)

    def _joint(self, joint: Element, parent: str, child: str, body: str, inherited: str) -> None:
        source = self._file.source
        given = self._file.attributes(joint, inherited)
        kind = given.get("type", "hinge")
        own = joint.name or f"{body}_joint"
        name = self._unique(own, "joint")
        turns = kind == "hinge"

        def read(key: str, count: int, default: tuple[float, ...]) -> np.ndarray:
            return source.floats(joint, given.get(key), count, default, key)

        if kind not in ("hinge", "slide", "ball"):
            source.fault(joint, f"unknown joint type '{kind}'", "", "type")
            return
        p = read("pos", 3, (0, 0, 0))
        ends = [make("parent", parent), make("child", child)]
        place = [make("pose", numbers([*p, 0, 0, 0]))] if p.any() and kind != "slide" else []
        damping = float(read("damping", 1, (0,))[0])
        dynamics = [make("damping", number(max(damping, 0.0)))]
        if float(read("frictionloss", 1, (0,))[0]) > 0:
            text = "dry friction, which Drake's joints do not have"
            self._report.add("dropped", f"joint {own}", text, joint.line)
        if kind == "ball":
            # Drake takes the damping of a ball joint from an axis that means nothing else.
            axis = make("axis", make("xyz", "0 0 1"), make("dynamics", *dynamics))
            axis.children.append(make("limit", make("effort", "0")))
            self._joints[name] = make("joint", *place, *ends, axis, name=name, type="ball")
            if "range" in given:
                text = "the range of a ball joint"
                self._report.add("dropped", f"joint {own}", text, joint.line)
            return
        direction = read("axis", 3, (0, 0, 1))
        if not direction.any():
            source.fault(joint, "the axis is zero", "write a direction", "axis")
            return
        ref, spring = float(read("ref", 1, (0,))[0]), float(read("springref", 1, (0,))[0])
        stiffness = float(read("stiffness", 1, (0,))[0])
        lower, upper = read("range", 2, (0, 0))
        if turns:
            ref, spring = self._file.angle(ref), self._file.angle(spring)
            lower, upper = self._file.angle(lower), self._file.angle(upper)
        auto = self._file.compiler.autolimits and "range" in given
        limited = {"true": True, "false": False}.get(given.get("limited", ""), auto)
        if ref:
            text = f"zero is where MuJoCo has {ref:g}"
            self._report.add("joint", f"joint {own}", text, joint.line)
        limits = {"effort": self._effort(joint, own, given)}
        if limited and lower < upper:
            limits |= {"lower": lower - ref, "upper": upper - ref}
        if stiffness > 0:
            dynamics += [
                make("spring_stiffness", number(stiffness)),
                make("spring_reference", number(spring - ref)),
            ]
        # No effort means no limit; zero means no actuator.
        rows = [make(k, number(v)) for k, v in limits.items() if math.isfinite(v)]
        axis = make("axis", make("xyz", numbers(direction / np.linalg.norm(direction))))
        axis.children += [make("limit", *rows), make("dynamics", *dynamics)]
        element = make(
            "joint", *place, *ends, axis, name=name, type="revolute" if turns else "prismatic"
        )
        armature = float(read("armature", 1, (0,))[0])
        if armature > 0 and limits["effort"] > 0:
            element.children += [
                make("drake:rotor_inertia", number(armature)),
                make("drake:gear_ratio", "1"),
            ]
        elif armature > 0:
            text = f"an armature of {armature:g}: only driven joints have one in Drake"
            self._report.add("dropped", f"joint {own}", text, joint.line)
        self._joints[name] = element
        self._placed.joints[own], self._placed.refs[own] = name, ref

    def _effort(self, joint: Element, name: str, given: dict[str, str]) -> float:
        """Effort limit: 0 without a drive, infinite without a limit."""
        effort = self._efforts.get(name, 0.0)
        auto = self._file.compiler.autolimits and "actuatorfrcrange" in given
        limited = {"true": True, "false": False}.get(given.get("actuatorfrclimited", ""), auto)
        if effort > 0 and limited:
            text = given.get("actuatorfrcrange")
            bounds = self._file.source.floats(joint, text, 2, (0, 0), "actuatorfrcrange")
            effort = min(effort, float(np.abs(bounds).max()))
        return effort

    def _weld(self, parent: str, child: str) -> None:
        name = self._unique(f"{child}_weld", "joint")
        ends = [make("parent", parent), make("child", child)]
        self._joints[name] = make("joint", *ends, name=name, type="fixed")

    def _site(self, site: Element, body: str, link: str, inherited: str, X_BF: np.ndarray) -> None:
        if not site.name or link == "world":
            return
        X_BS = X_BF @ self._file.pose(site, self._file.attributes(site, inherited))
        self._placed.sites[site.name] = (body, X_BS[:3, 3])
        name = self._unique(site.name, "site")
        pose = pose_element(X_BS, urdf=False)
        self._frames.append(make("frame", pose, name=name, attached_to=link))

    def _inertial(self, body: Element, geoms: Geoms) -> Element:
        compiler, source = self._file.compiler, self._file.source
        inertial = body.child("inertial")
        from_geoms = compiler.inertiafromgeom
        if inertial is not None and from_geoms != "true":
            given = inertial.attributes
            mass = float(source.floats(inertial, given.get("mass"), 1, (0,), "mass")[0])
            X_BI = self._file.pose(inertial, given)
            if "fullinertia" in given:
                xx, yy, zz, xy, xz, yz = source.floats(
                    inertial, given["fullinertia"], 6, np.zeros(6), "fullinertia"
                )
                inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
            else:
                text = given.get("diaginertia")
                inertia = np.diag(source.floats(inertial, text, 3, (0, 0, 0), "diaginertia"))
        elif geoms.solids and from_geoms != "false":
            properties: MassProperties = combined(geoms.solids)
            mass, inertia, X_BI = properties.mass, properties.I_BBcm_B, np.eye(4)
            X_BI[:3, 3] = properties.p_BoBcm_B
        else:
            return _MASSLESS
        if mass < compiler.boundmass:
            mass = compiler.boundmass
        if compiler.boundinertia:
            values, axes = np.linalg.eigh(inertia)
            inertia = (axes * np.maximum(values, compiler.boundinertia)) @ axes.T
        return inertial_element(mass, X_BI, inertia, urdf=False)

    def _settle_mass(self) -> None:
        """Scales all masses to the total that the compiler settings ask for."""
        wanted = self._file.compiler.settotalmass
        found = [i for link in self._links if (i := link.child("inertial")) is not None]
        total = sum(float(m.text) for i in found if (m := i.child("mass")))
        if wanted <= 0 or total <= 0:
            return
        for inertial in found:
            for element in inertial.walk():
                if element.tag in ("mass", "ixx", "ixy", "ixz", "iyy", "iyz", "izz"):
                    element.text = number(float(element.text) * wanted / total)

    def _unique(self, name: str, kind: str) -> str:
        """SDF wants one name for one thing; MJCF has names for each kind of thing."""
        name = name.replace("::", "_")
        if name.startswith("__"):
            name = f"_{name.strip('_')}"
        plain, k = name, 1
        while name in self._names:
            name = f"{plain}_{kind}" + (f"_{k}" if k > 1 else "")
            k += 1
        if name != plain:
            self._report.add("frame", f"{kind} {plain}", f"called {name}: the name was taken")
        self._names.add(name)
        return name
