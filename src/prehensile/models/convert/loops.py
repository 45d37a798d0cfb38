"""Loops of joints in an SDF model: opened, and closed again by constraints.

Drake's multibody systems are trees. A joint whose child has a parent already becomes ball
constraints between points of the two links: one for a ball joint, two on the axis of a revolute
joint, three for a fixed one.
"""

import numpy as np

from prehensile.models.convert.elements import Source, value
from prehensile.models.convert.report import Report
from prehensile.models.convert.tree import JointRef, read_tree
from prehensile.models.convert.xml_text import make, numbers
from prehensile.models.xml_lines import Element

_ARM = 0.05  # m, from the joint to a point of the constraint


def open_loops(model: Element, source: Source, report: Report) -> None:
    """Replaces the joints that close loops, in place.

    What this cannot tell, poses given in other frames than the usual ones, is left to Drake.

    Args:
        model: ``<model>``.
        source: findings go there.
        report: what was done is noted here.
    """
    tree = read_tree(model, source)
    source.raise_findings()
    held: set[str] = set()
    for joint in tree.joints:
        if joint.child not in held:
            held.add(joint.child)
            continue
        points = _points(joint, source)
        parent, child = tree.links.get(joint.parent), tree.links.get(joint.child)
        if points is None or parent is None or child is None or _posed(parent, child, model):
            continue
        X_CJ = source.pose(joint.element)
        X_PC = np.linalg.inv(source.pose(parent)) @ source.pose(child)
        for p_J in points:
            p_CJ = X_CJ @ [*p_J, 1.0]
            model.children.append(_ball(joint, (X_PC @ p_CJ)[:3], p_CJ[:3]))
        model.children = [c for c in model.children if c is not joint.element]
        text = f"closes a loop: {len(points)} ball constraints in place of a {joint.kind} joint"
        report.add("joint", f"joint {joint.name}", text, joint.element.line)


def _points(joint: JointRef, source: Source) -> list[np.ndarray] | None:
    """Points that stay together, in the joint's frame; None for other kinds of joints."""
    if joint.kind == "ball":
        return [np.zeros(3)]
    if joint.kind == "fixed":
        return [np.zeros(3), _ARM * np.array([1.0, 0, 0]), _ARM * np.array([0, 1.0, 0])]
    axis = joint.element.child("axis")
    xyz = axis.child("xyz") if axis else None
    if joint.kind not in ("revolute", "continuous") or axis is None or xyz is None:
        return None
    if value(axis, "use_parent_model_frame") in ("1", "true") or "expressed_in" in xyz.attributes:
        return None
    direction = source.floats(xyz, xyz.text, 3, (0, 0, 1), "axis.xyz")
    norm = float(np.linalg.norm(direction))
    return [sign * _ARM * direction / norm for sign in (-1, 1)] if norm else None


def _posed(parent: Element, child: Element, model: Element) -> bool:
    """Whether poses are given in frames that are not the model's, or links are of inner models."""
    poses = [pose for link in (parent, child) if (pose := link.child("pose")) is not None]
    if not all(any(link is own for own in model.children) for link in (parent, child)):
        return True
    return any("relative_to" in pose.attributes for pose in poses)


def _ball(joint: JointRef, p_P: np.ndarray, p_C: np.ndarray) -> Element:
    prefix = "drake:ball_constraint"
    return make(
        prefix,
        make(f"{prefix}_body_A", joint.parent),
        make(f"{prefix}_body_B", joint.child),
        make(f"{prefix}_p_AP", numbers(p_P)),
        make(f"{prefix}_p_BQ", numbers(p_C)),
    )
