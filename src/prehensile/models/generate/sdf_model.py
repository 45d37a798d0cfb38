"""Models as plain values, and their SDF text.

Only the part of SDF that our models use: links with visuals and collisions, joints with limits and
rotors and springs, frames, groups of links that cannot touch one another, and what closes a
loop: points of two links that stay together, and joints that follow one another.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from xml.sax.saxutils import quoteattr

Pose = tuple[float, float, float, float, float, float]
"""x, y, z in metres, then roll, pitch, yaw in radians (about fixed axes, in this order)."""

IDENTITY: Pose = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def number(value: float) -> str:
    """The shortest decimal text that reads back as the same number; whole numbers without .0."""
    text = repr(round(float(value), 12) + 0.0)
    return text.removesuffix(".0")


def numbers(values: Sequence[float]) -> str:
    """Numbers with blanks between them."""
    return " ".join(number(v) for v in values)


@dataclass(frozen=True)
class Shape:
    """A primitive or a mesh file.

    Attributes:
        kind: "box", "sphere", "cylinder", "capsule" or "mesh".
        size: box: edge lengths; sphere: radius; cylinder and capsule: radius, then length along z
            (a capsule's without its caps), all in metres; mesh: nothing.
        uri: of a mesh.
    """

    kind: str
    size: tuple[float, ...] = ()
    uri: str = ""

    def text(self) -> str:
        """The <geometry> element."""
        if self.kind == "box":
            inner = f"<size>{numbers(self.size)}</size>"
        elif self.kind == "mesh":
            inner = f"<uri>{self.uri}</uri>"
        else:
            inner = f"<radius>{number(self.size[0])}</radius>"
            if self.kind != "sphere":
                inner += f"<length>{number(self.size[1])}</length>"
        tag = f"drake:{self.kind}" if self.kind == "capsule" else self.kind
        return f"<geometry><{tag}>{inner}</{tag}></geometry>"


@dataclass(frozen=True)
class Contact:
    """How a surface touches.

    Attributes:
        mu: coefficient of friction, static and dynamic alike (SAP knows but one).
        hydroelastic: "rigid", "compliant" or "" for point contact alone.
        modulus: hydroelastic modulus of a compliant body in Pa.
        resolution: edge length in metres of the hydroelastic mesh of a curved shape (0: Drake's).
        relaxation_time: of the linear dissipation of SAP in seconds.
        stiffness: of point contact in N/m (0: Drake's).
    """

    mu: float = 0.5
    hydroelastic: str = ""
    modulus: float = 0.0
    resolution: float = 0.0
    relaxation_time: float = 0.02
    stiffness: float = 0.0

    def text(self) -> str:
        """The <drake:proximity_properties> element."""
        parts = [("mu_static", self.mu), ("mu_dynamic", self.mu)]
        parts += [("relaxation_time", self.relaxation_time)]
        if self.stiffness:
            parts.append(("point_contact_stiffness", self.stiffness))
        if self.resolution:
            parts.append(("mesh_resolution_hint", self.resolution))
        if self.modulus:
            parts.append(("hydroelastic_modulus", self.modulus))
        inner = f"<drake:{self.hydroelastic}_hydroelastic/>" if self.hydroelastic else ""
        inner += "".join(f"<drake:{k}>{number(v)}</drake:{k}>" for k, v in parts)
        return f"<drake:proximity_properties>{inner}</drake:proximity_properties>"


@dataclass(frozen=True)
class Collision:
    """A shape that touches, posed in its link."""

    name: str
    shape: Shape
    pose: Pose = IDENTITY
    contact: Contact = Contact()


@dataclass(frozen=True)
class Visual:
    """A shape that is seen, posed in its link; the colour is of primitives only."""

    name: str
    shape: Shape
    pose: Pose = IDENTITY
    rgba: tuple[float, float, float, float] | None = None


@dataclass(frozen=True)
class Inertial:
    """Mass in kg, centre of mass in m, and inertia about it (ixx iyy izz ixy ixz iyz) in kg m²."""

    mass: float
    com: tuple[float, float, float]
    inertia: tuple[float, float, float, float, float, float]


@dataclass(frozen=True)
class Link:
    """A rigid body; ``pose`` is in the frame of the model, all joints at zero."""

    name: str
    pose: Pose = IDENTITY
    inertial: Inertial | None = None
    visuals: tuple[Visual, ...] = ()
    collisions: tuple[Collision, ...] = ()


@dataclass(frozen=True)
class Joint:
    """A joint; its frame is the child's at zero, or ``pose`` in the child's frame.

    Attributes:
        axis: unit vector, in the frame ``expressed_in`` ("" for the joint's own).
        effort: limit in N m or N; 0 for a joint without an actuator.
        acceleration: limit in rad/s² or m/s² (None: not known), as ``velocity``.
        spring: stiffness in N m/rad or N/m, and the position where it is at rest.
        mimic: name of a joint that this one follows, multiplier and offset of its position; kept
            by a constraint in discrete plants with a SAP solver, ignored in others.
    """

    name: str
    kind: str
    parent: str
    child: str
    axis: tuple[float, float, float]
    lower: float
    upper: float
    effort: float = 0.0
    velocity: float | None = None
    acceleration: float | None = None
    damping: float = 0.0
    gear_ratio: float | None = None
    rotor_inertia: float | None = None
    pose: Pose = IDENTITY
    expressed_in: str = ""
    spring: tuple[float, float] | None = None
    mimic: tuple[str, float, float] | None = None


@dataclass(frozen=True)
class Pin:
    """A point of link A that stays at a point of link B, each given in its link's frame, m.

    Drake keeps it by a constraint in discrete plants with a SAP solver.
    """

    link_a: str
    p_AP: tuple[float, float, float]
    link_b: str
    p_BQ: tuple[float, float, float]


@dataclass(frozen=True)
class Frame:
    """A named frame fixed to a link."""

    name: str
    attached_to: str
    pose: Pose = IDENTITY


@dataclass(frozen=True)
class Model:
    """A model: what one SDF file holds.

    Attributes:
        name: of the model and of its file.
        comment: goes to the head of the file.
        apart: groups of links whose members never collide with one another.
        pins: what closes the loops of a linkage.
    """

    name: str
    comment: str
    links: tuple[Link, ...]
    joints: tuple[Joint, ...] = ()
    frames: tuple[Frame, ...] = ()
    apart: tuple[tuple[str, ...], ...] = field(default=())
    pins: tuple[Pin, ...] = ()


def sdf_text(model: Model) -> str:
    """Writes a model as SDF 1.9 with Drake's extensions.

    Args:
        model: the model.

    Returns:
        The text of the file.
    """
    out = [
        '<?xml version="1.0"?>',
        f"<!-- {model.comment} -->",
        '<sdf version="1.9" xmlns:drake="http://drake.mit.edu">',
        f"  <model name={quoteattr(model.name)}>",
    ]
    for link in model.links:
        out += [f"    {line}" for line in _link_lines(link)]
    for frame in model.frames:
        out += [
            f"    <frame name={quoteattr(frame.name)} attached_to={quoteattr(frame.attached_to)}>",
            f"      <pose>{numbers(frame.pose)}</pose>",
            "    </frame>",
        ]
    for joint in model.joints:
        out += [f"    {line}" for line in _joint_lines(joint)]
    for pin in model.pins:
        out.append("    <drake:ball_constraint>")
        values = (("body_A", pin.link_a), ("p_AP", numbers(pin.p_AP)))
        values += (("body_B", pin.link_b), ("p_BQ", numbers(pin.p_BQ)))
        for key, value in values:
            tag = f"drake:ball_constraint_{key}"
            out.append(f"      <{tag}>{value}</{tag}>")
        out.append("    </drake:ball_constraint>")
    for i, group in enumerate(model.apart):
        name = f"apart_{i}"
        out.append(f"    <drake:collision_filter_group name={quoteattr(name)}>")
        out += [f"      <drake:member>{link}</drake:member>" for link in group]
        out.append(
            f"      <drake:ignored_collision_filter_group>{name}"
            "</drake:ignored_collision_filter_group>"
        )
        out.append("    </drake:collision_filter_group>")
    return "\n".join([*out, "  </model>", "</sdf>", ""])


def _link_lines(link: Link) -> list[str]:
    out = [f"<link name={quoteattr(link.name)}>"]
    if link.pose != IDENTITY:
        out.append(f"  <pose>{numbers(link.pose)}</pose>")
    if link.inertial:
        tags = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
        moments = "".join(
            f"<{t}>{number(v)}</{t}>" for t, v in zip(tags, link.inertial.inertia, strict=True)
        )
        out += [
            "  <inertial>",
            f"    <pose>{numbers(link.inertial.com)} 0 0 0</pose>",
            f"    <mass>{number(link.inertial.mass)}</mass>",
            f"    <inertia>{moments}</inertia>",
            "  </inertial>",
        ]
    for visual in link.visuals:
        out.append(f"  <visual name={quoteattr(visual.name)}>")
        if visual.pose != IDENTITY:
            out.append(f"    <pose>{numbers(visual.pose)}</pose>")
        out.append(f"    {visual.shape.text()}")
        if visual.rgba:
            out.append(f"    <material><diffuse>{numbers(visual.rgba)}</diffuse></material>")
        out.append("  </visual>")
    for collision in link.collisions:
        out.append(f"  <collision name={quoteattr(collision.name)}>")
        if collision.pose != IDENTITY:
            out.append(f"    <pose>{numbers(collision.pose)}</pose>")
        out += [f"    {collision.shape.text()}", f"    {collision.contact.text()}"]
        out.append("  </collision>")
    return [*out, "</link>"]


def _joint_lines(joint: Joint) -> list[str]:
    limits = {
        "lower": joint.lower,
        "upper": joint.upper,
        "effort": joint.effort,
        "velocity": joint.velocity,
        "drake:acceleration": joint.acceleration,
    }
    limit = "".join(f"<{k}>{number(v)}</{k}>" for k, v in limits.items() if v is not None)
    frame = f" expressed_in={quoteattr(joint.expressed_in)}" if joint.expressed_in else ""
    dynamics = f"<damping>{number(joint.damping)}</damping>"
    if joint.spring:
        stiffness, rest = joint.spring
        dynamics += f"<spring_reference>{number(rest)}</spring_reference>"
        dynamics += f"<spring_stiffness>{number(stiffness)}</spring_stiffness>"
    out = [f"<joint name={quoteattr(joint.name)} type={quoteattr(joint.kind)}>"]
    if joint.pose != IDENTITY:
        out.append(f"  <pose>{numbers(joint.pose)}</pose>")
    out += [
        f"  <parent>{joint.parent}</parent>",
        f"  <child>{joint.child}</child>",
        "  <axis>",
        f"    <xyz{frame}>{numbers(joint.axis)}</xyz>",
        f"    <limit>{limit}</limit>",
        f"    <dynamics>{dynamics}</dynamics>",
        "  </axis>",
    ]
    if joint.gear_ratio is not None:
        out.append(f"  <drake:gear_ratio>{number(joint.gear_ratio)}</drake:gear_ratio>")
    if joint.rotor_inertia is not None:
        out.append(f"  <drake:rotor_inertia>{number(joint.rotor_inertia)}</drake:rotor_inertia>")
    if joint.mimic:
        other, multiplier, offset = joint.mimic
        factors = f'multiplier="{number(multiplier)}" offset="{number(offset)}"'
        out.append(f"  <drake:mimic joint={quoteattr(other)} {factors}/>")
    return [*out, "</joint>"]
