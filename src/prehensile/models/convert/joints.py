"""Limits, actuators and the base of a URDF or SDF tree, as Drake wants them."""

import math
from dataclasses import dataclass

from prehensile.models.convert.elements import Source, value
from prehensile.models.convert.report import Report
from prehensile.models.convert.tree import JointRef, Tree
from prehensile.models.convert.xml_text import make, number, remove
from prehensile.models.xml_lines import Element

_AXIS = ("revolute", "continuous", "prismatic")


@dataclass(frozen=True)
class JointMender:
    """Mends the joints of one tree.

    Attributes:
        model: ``<robot>`` or ``<model>``.
        tree: its links and joints.
        source: findings go there.
        report: what was done is noted here.
        urdf: whether it is URDF, else SDF.
        drive_all: whether every joint that can be is to be driven.
    """

    model: Element
    tree: Tree
    source: Source
    report: Report
    urdf: bool
    drive_all: bool

    def mend(self) -> None:
        """Mends limits, axes and couplings, then gives actuators where nobody did."""
        for joint in self.tree.joints:
            self._check_axis(joint)
            self._drop_friction(joint)
            for limit in self._limits(joint):
                self._mend_limits(joint, limit)
            if not self.urdf:
                self._mend_mimic(joint)
                self._actuate_sdf(joint)
        if self.urdf:
            self._actuate_urdf()

    def set_base(self, base: str) -> None:
        """Welds the root link to the world ("fixed") or frees it ("free")."""
        welds = [j for j in self.tree.joints if j.parent == "world" and not j.moves]
        if base == "free":
            for joint in welds:
                self.model.children = [c for c in self.model.children if c is not joint.element]
                self.report.add("base", joint.name, "taken out: the model is free to be placed")
            if welds and self.urdf:
                self.model.children = [
                    c for c in self.model.children if not (c.tag == "link" and c.name == "world")
                ]
        elif base == "fixed":
            children = {j.child for j in self.tree.joints}
            roots = [n for n in self.tree.links if n not in children and n != "world"]
            for root in roots:
                name = f"{root.replace('::', '_')}_to_world"
                if self.urdf:
                    if "world" not in self.tree.links:
                        self.model.children.append(make("link", name="world"))
                    ends = [make("parent", link="world"), make("child", link=root)]
                else:
                    ends = [make("parent", "world"), make("child", root)]
                self.model.children.append(make("joint", *ends, name=name, type="fixed"))
                self.report.add("base", f"link {root}", "welded to the world")

    def _limits(self, joint: JointRef) -> list[Element]:
        if self.urdf:
            return joint.element.all("limit")
        axes = [c for c in joint.element.children if c.tag in ("axis", "axis2")]
        return [limit for axis in axes for limit in axis.all("limit")]

    def _check_axis(self, joint: JointRef) -> None:
        self.source.pose(joint.element)
        axis = joint.element.child("axis")
        if joint.kind not in _AXIS or axis is None:
            return
        xyz = self.source.floats(axis, value(axis, "xyz"), 3, (1, 0, 0), f"{joint.name}.axis")
        if not xyz.any():
            message = f"the axis of joint '{joint.name}' is zero"
            self.source.fault(axis, message, "write a direction", f"{joint.name}.axis")

    def _mend_limits(self, joint: JointRef, limit: Element) -> None:
        where = f"joint {joint.name}"
        numbers = {}
        for key in ("lower", "upper", "velocity", "effort"):
            text = value(limit, key)
            if text is None:
                continue
            try:
                numbers[key] = float(text)
            except ValueError:
                numbers[key] = math.nan
            if math.isnan(numbers[key]):
                message = f"the {key} limit of joint '{joint.name}' is '{text[:40]}'"
                self.source.fault(limit, message, "write a number", f"{joint.name}.limit.{key}")
                return
        if self.urdf and ("lower" in numbers) != ("upper" in numbers):
            # Of a limit left out URDF makes 0, Drake none.
            for key in {"lower", "upper"} - set(numbers):
                limit.attributes[key], numbers[key] = "0", 0.0
        lower, upper = numbers.get("lower"), numbers.get("upper")
        if lower is not None and upper is not None and lower > upper:
            text = f"limits {lower:g} > {upper:g}, Bullet's way to say that there are none: none"
            self.report.add("joint", where, text, limit.line)
            self._drop(limit, "lower", "upper")
        elif lower == upper == 0.0:
            text = "both limits are 0, so it could not move: no limits"
            self.report.add("joint", where, text, limit.line)
            self._drop(limit, "lower", "upper")
        if numbers.get("velocity", 1.0) == 0.0 or (self.urdf and numbers.get("velocity", 1) < 0):
            self.report.add("joint", where, "a velocity limit of 0: none", limit.line)
            self._drop(limit, "velocity")

    def _drop(self, limit: Element, *keys: str) -> None:
        remove(limit, *keys)
        for key in keys:
            limit.attributes.pop(key, None)

    def _drop_friction(self, joint: JointRef) -> None:
        for element in joint.element.walk():
            if element.tag == "dynamics" and value(element, "friction") is not None:
                if value(element, "friction") not in ("0", "0.0"):
                    text = "dry friction, which Drake's joints do not have"
                    self.report.add("dropped", f"joint {joint.name}", text, element.line)
                self._drop(element, "friction")

    def _mend_mimic(self, joint: JointRef) -> None:
        """SDF 1.11's own ``<mimic>``, which Drake does not read, becomes Drake's."""
        axis = joint.element.child("axis")
        mimic = axis.child("mimic") if axis else None
        if axis is None or mimic is None:
            return
        axis.children.remove(mimic)

        def read(key: str, default: float) -> float:
            text = value(mimic, key)
            return float(self.source.floats(mimic, text, 1, (default,), f"mimic.{key}")[0])

        multiplier = read("multiplier", 1.0)
        offset = read("offset", 0.0) - multiplier * read("reference", 0.0)
        leader = mimic.attributes.get("joint", "")
        joint.element.children.append(
            make(
                "drake:mimic",
                joint=leader,
                multiplier=number(multiplier),
                offset=number(offset),
            )
        )
        self.report.add("joint", joint.name, f"follows {leader}: as drake:mimic", mimic.line)

    def _actuate_sdf(self, joint: JointRef) -> None:
        """In SDF a joint is driven unless its effort limit is zero."""
        follows = joint.element.child("drake:mimic") is not None
        for limit in self._limits(joint):
            if joint.single and value(limit, "effort") in ("0", "0.0") and not follows:
                if self.drive_all:
                    self._drop(limit, "effort")
                    text = "zero effort, which is no drive: driven without a limit, as asked for"
                else:
                    text = "zero effort: not driven (--actuators all drives it)"
                self.report.add("actuator", f"joint {joint.name}", text, limit.line)

    def _actuate_urdf(self) -> None:
        """Transmissions that Drake understands, and for every joint that has a drive.

        Drives are told by ``<transmission>`` or ``<ros2_control>``. Where a file has neither,
        every joint that moves and follows no other is driven, but those of zero effort (unless
        all are of zero effort, which is what exporters write for "not known").
        """
        single = {
            j.name: j
            for j in self.tree.joints
            if j.single and (j.element.child("mimic") is None) and j.kind != "screw"
        }
        old = self.model.all("transmission")
        wanted: dict[str, str] = {}  # joint to actuator
        kept: dict[str, Element] = {}
        for transmission in old:
            for joint in transmission.all("joint"):
                actuator = transmission.child("actuator")
                wanted[joint.name] = actuator.name if actuator else joint.name
                if len(transmission.all("joint")) == 1 and actuator is not None:
                    kept[joint.name] = actuator
        for control in self.model.all("ros2_control"):
            for joint in control.all("joint"):
                if joint.child("command_interface") is not None:
                    wanted.setdefault(joint.name, joint.name)
        if not wanted:
            efforts = {name: self._effort(joint) for name, joint in single.items()}
            nobody = not any(e is None or e > 0 for e in efforts.values())
            wanted = {n: n for n, effort in efforts.items() if nobody or effort != 0.0}
            if wanted:
                text = f"no transmissions: {len(wanted)} joints that move were given one"
                self.report.add("actuator", "joints", text)
        undriven = [name for name in single if name not in wanted]
        if undriven and self.drive_all:
            wanted |= {name: name for name in undriven}
            text = f"{', '.join(undriven)}: driven too, as asked for"
            self.report.add("actuator", "joints", text)
        elif undriven:
            text = f"{', '.join(undriven)}: not driven (--actuators all drives them)"
            self.report.add("actuator", "joints", text)
        remove(self.model, "transmission")
        for name, actuator in wanted.items():
            joint = single.get(name)
            if joint is None:
                text = "driven, but no joint of one degree of freedom that moves by itself: not"
                self.report.add("actuator", f"joint {name}", text)
                continue
            limit = joint.element.child("limit")
            effort = self._effort(joint)
            if effort is not None and effort <= 0:
                text = f"an effort limit of {effort:g}: driven without a limit"
                self.report.add("actuator", f"joint {name}", text, joint.element.line)
                if limit is not None:
                    limit.attributes.pop("effort", None)
            elif effort is None:
                text = "no effort limit: driven without one"
                self.report.add("actuator", f"joint {name}", text, joint.element.line)
            drive = make("actuator", name=actuator)
            if name in kept:
                drive.children = [c for c in kept[name].children if c.tag.startswith("drake:")]
            self.model.children.append(
                make(
                    "transmission",
                    make("type", "transmission_interface/SimpleTransmission"),
                    make("joint", name=name),
                    drive,
                    name=f"{name}_transmission",
                )
            )
        self._unique_actuators()

    def _unique_actuators(self) -> None:
        seen: set[str] = set()
        for transmission in self.model.all("transmission"):
            actuator = transmission.child("actuator")
            if actuator is not None:
                if actuator.name in seen or not actuator.name:
                    joint = transmission.child("joint")
                    actuator.attributes["name"] = joint.name if joint else transmission.name
                seen.add(actuator.name)

    def _effort(self, joint: JointRef) -> float | None:
        limit = joint.element.child("limit")
        text = limit.attributes.get("effort") if limit else None
        try:
            return None if text is None else float(text)
        except ValueError:
            return None
