"""Links and joints of a URDF or SDF tree, nested models included, by their scoped names."""

from dataclasses import dataclass

from prehensile.models.convert.elements import Source, value
from prehensile.models.xml_lines import Element

MAX_LINKS = 2000


@dataclass(frozen=True)
class JointRef:
    """A joint and what it joins.

    Attributes:
        name: scoped name.
        kind: its type, as written.
        parent: scoped name of the parent link, ``world`` for the world.
        child: scoped name of the child link.
        element: the joint.
    """

    name: str
    kind: str
    parent: str
    child: str
    element: Element

    @property
    def moves(self) -> bool:
        """Whether it is of a type with a degree of freedom."""
        return self.kind != "fixed"

    @property
    def single(self) -> bool:
        """Whether it has exactly one degree of freedom, as actuators need it."""
        return self.kind in ("revolute", "continuous", "prismatic", "screw")


@dataclass(frozen=True)
class Tree:
    """Links by scoped name, and joints."""

    links: dict[str, Element]
    joints: list[JointRef]

    def rigid_groups(self) -> dict[str, int]:
        """Links that cannot move against one another have the same number; ``world`` has one."""
        above: dict[str, str] = {}  # towards the one link that stands for a group

        def first(name: str) -> str:
            while name in above:
                name = above[name]
            return name

        names = {*self.links, "world"}
        for joint in self.joints:
            if not joint.moves and {joint.parent, joint.child} <= names:
                parent, child = first(joint.parent), first(joint.child)
                if parent != child:
                    above[child] = parent
        number = {name: i for i, name in enumerate(sorted(names))}
        group = {name: number[first(name)] for name in names}
        return group


def read_tree(model: Element, source: Source) -> Tree:
    """Collects links and joints; a name that is missing or taken is a fault.

    Args:
        model: ``<robot>`` of URDF or ``<model>`` of SDF.
        source: findings go there.
    """
    links: dict[str, Element] = {}
    joints: dict[str, JointRef] = {}
    attached: dict[str, str] = {}
    _collect(model, "", links, joints, attached, source)
    if len(links) > MAX_LINKS:
        message = f"the model has {len(links)} links, more than {MAX_LINKS}"
        source.fault(model, message, "take it apart")
        source.raise_findings()

    def link_of(name: str) -> str:
        for _ in range(len(attached) + 1):
            if name in links or name == "world" or name not in attached:
                break
            name = attached[name]
        return name

    result = []
    for joint in joints.values():
        ends = []
        for end, name in (("parent", joint.parent), ("child", joint.child)):
            link = link_of(name)
            if link not in links and link != "world" and "__model__" not in link:
                message = f"joint '{joint.name}' has an unknown {end} '{name}'"
                source.fault(joint.element, message, "name one of the links", end)
            ends.append(link)
        result.append(JointRef(joint.name, joint.kind, ends[0], ends[1], joint.element))
    return Tree(links, result)


def _collect(
    model: Element,
    scope: str,
    links: dict[str, Element],
    joints: dict[str, JointRef],
    attached: dict[str, str],
    source: Source,
) -> None:
    for element in model.children:
        name = scope + element.name
        if element.tag == "link":
            if not element.name or name in links:
                what = f"two links are called '{name}'" if element.name else "a link has no name"
                source.fault(element, what, "give each link a name of its own", "link")
            links[name] = element
        elif element.tag in ("joint", "drake:joint") and (
            element.child("parent") or element.child("child")
        ):
            if not element.name or name in joints:
                what = f"two joints are called '{name}'" if element.name else "a joint has no name"
                source.fault(element, what, "give each joint a name of its own", "joint")
            ends = []
            for end in ("parent", "child"):
                text = value(element.child(end), "link") or ""
                child = element.child(end)
                text = text or (child.text if child else "")
                ends.append(text if text == "world" else scope + text)
            kind = element.attributes.get("type", "")
            joints[name] = JointRef(name, kind, ends[0], ends[1], element)
        elif element.tag == "frame":
            attached[name] = scope + element.attributes.get("attached_to", "__model__")
        elif element.tag == "model":
            _collect(element, f"{name}::", links, joints, attached, source)
