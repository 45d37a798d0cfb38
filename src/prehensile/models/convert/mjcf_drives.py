"""What drives and couples the joints of an MJCF file: actuators, equalities, tendons, contacts."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from prehensile.models.convert.mjcf_file import DRIVES, MjcfFile
from prehensile.models.convert.report import Report
from prehensile.models.convert.xml_text import make, number, numbers
from prehensile.models.xml_lines import Element


@dataclass(frozen=True)
class Placed:
    """Where the bodies, joints and sites of an MJCF file have got to in the SDF model.

    Attributes:
        links: body name to link name.
        poses: body name to its (4, 4) pose in the model, all joints at rest.
        joints: joint name to joint name.
        refs: joint name to its position (MuJoCo's) at rest.
        sites: site name to its body and its position (3,) in it.
    """

    links: dict[str, str]
    poses: dict[str, np.ndarray]
    joints: dict[str, str]
    refs: dict[str, float]
    sites: dict[str, tuple[str, np.ndarray]]


def efforts(file: MjcfFile, report: Report) -> dict[str, float]:
    """The effort limit of each joint that is driven, infinite where there is none.

    Args:
        file: the MJCF file.
        report: drives that have no counterpart are noted here.

    Returns:
        Joint name to limit in N m or N. A fixed tendon's drive is one for each of its joints.
    """
    tendons = {
        t.name: [(j.attributes.get("joint", ""), j) for j in t.all("joint")]
        for section in file.sections("tendon")
        for t in section.all("fixed")
    }
    result: dict[str, float] = {}
    for section in file.sections("actuator"):
        for drive in section.children:
            if drive.tag not in DRIVES:
                continue
            given = file.attributes(drive, "main")
            label = f"{drive.tag} {drive.name}".strip()
            effort = _effort(file, drive, given)
            joint = given.get("joint", given.get("jointinparent"))
            if drive.tag in ("muscle", "cylinder", "damper", "adhesion", "dcmotor"):
                report.add("dropped", label, f"a {drive.tag} has no counterpart", drive.line)
            elif joint:
                old = result.get(joint, 0.0)
                result[joint] = max(effort, old) if math.isfinite(effort) else max(old, effort)
            elif given.get("tendon") in tendons:
                pulled = tendons[given["tendon"]]
                for name, element in pulled:
                    coef = abs(
                        float(
                            file.source.floats(
                                element, element.attributes.get("coef"), 1, (1.0,), "coef"
                            )[0]
                        )
                    )
                    result[name] = max(result.get(name, 0.0), effort * coef if coef else effort)
                names = ", ".join(name for name, _ in pulled)
                text = f"pulls a tendon: a drive for each of {names}"
                report.add("actuator", label, text, drive.line)
            else:
                text = "drives neither a joint nor a fixed tendon"
                report.add("dropped", label, text, drive.line)
            if drive.tag in ("position", "velocity", "intvelocity") or "biasprm" in given:
                text = "its controller is left to yours: the joint takes force or torque"
                report.add("actuator", f"{drive.tag} drives", text)
    return result


def _effort(file: MjcfFile, drive: Element, given: Mapping[str, str]) -> float:
    """Greatest force or torque at the joint."""

    def read(key: str, default: tuple[float, ...]) -> np.ndarray:
        return file.source.floats(drive, given.get(key), len(default), default, key)

    def limited(key: str) -> bool:
        auto = file.compiler.autolimits and f"{key}range" in given
        return {"true": True, "false": False}.get(given.get(f"{key}limited", ""), auto)

    gear_text = given.get("gear", "1").split()
    gear = abs(float(file.source.floats(drive, " ".join(gear_text[:1]), 1, (1.0,), "gear")[0]))
    if limited("force"):
        return gear * float(np.abs(read("forcerange", (0.0, 0.0))).max())
    plain = given.get("biastype", "none") == "none" and given.get("gaintype", "fixed") == "fixed"
    force = drive.tag == "motor" or (drive.tag == "general" and plain)
    if force and limited("ctrl") and given.get("dyntype", "none") == "none":
        gain = given.get("gainprm", "1").split()[0] if drive.tag == "general" else "1"
        factor = abs(float(file.source.floats(drive, gain, 1, (1.0,), "gainprm")[0]))
        return gear * factor * float(np.abs(read("ctrlrange", (0.0, 0.0))).max())
    return math.inf


def couplings(
    file: MjcfFile, placed: Placed, joints: Mapping[str, Element], report: Report
) -> list[Element]:
    """Equalities and limited tendons as Drake's constraints.

    Args:
        file: the MJCF file.
        placed: where everything is.
        joints: SDF joints by name; those that follow another are told so.
        report: what has no counterpart is noted here.

    Returns:
        Elements for the model.
    """
    result = []
    for section in file.sections("equality"):
        for element in section.children:
            given = file.attributes(element, "main")
            label = f"{element.tag} {element.name}".strip()
            if given.get("active") == "false":
                continue
            if element.tag == "joint" and given.get("joint2") in placed.joints:
                _follow(file, placed, joints, element, given, report)
                continue
            ball = _ball(file, placed, element, given) if element.tag == "connect" else None
            if ball is None:
                text = f"an equality of kind {element.tag} like this has no counterpart"
                report.add("dropped", label, text, element.line)
            else:
                result.append(ball)
                report.add("joint", label, "a loop closed by a ball constraint", element.line)
    for section in file.sections("tendon"):
        for element in section.children:
            result += _tendon(file, placed, element, report)
    return result


def _follow(
    file: MjcfFile,
    placed: Placed,
    joints: Mapping[str, Element],
    element: Element,
    given: Mapping[str, str],
    report: Report,
) -> None:
    name, leader = given.get("joint1", ""), given["joint2"]
    if name not in placed.joints:
        file.source.fault(element, f"unknown joint '{name}'", "name a joint", "joint1")
        return
    text = given.get("polycoef", "0 1")
    poly = file.source.floats(element, text, len(text.split()), (0.0, 1.0), "polycoef")
    poly = np.concatenate([poly, np.zeros(5)])[:5]
    if any(poly[2:]):
        text = "a polynomial of higher order: its linear part"
        report.add("joint", f"joint {name}", text, element.line)
    joints[placed.joints[name]].children.append(
        make(
            "drake:mimic",
            joint=placed.joints[leader],
            multiplier=number(poly[1]),
            offset=number(poly[0]),
        )
    )
    report.add("joint", f"joint {name}", f"follows {leader}", element.line)


def _ball(
    file: MjcfFile, placed: Placed, element: Element, given: Mapping[str, str]
) -> Element | None:
    if "site1" in given:
        ends = [placed.sites.get(given.get(key, "")) for key in ("site1", "site2")]
        if ends[0] is None or ends[1] is None:
            return None
        (a, p_AP), (b, p_BQ) = ends[0], ends[1]
    else:
        a, b = given.get("body1", ""), given.get("body2", "")
        if a not in placed.links or b not in placed.links:
            return None
        p_AP = file.source.floats(element, given.get("anchor"), 3, (0, 0, 0), "anchor")
        X_BA = np.linalg.inv(placed.poses[b]) @ placed.poses[a]
        p_BQ = X_BA[:3, :3] @ p_AP + X_BA[:3, 3]
    if a not in placed.links or b not in placed.links:
        return None
    prefix = "drake:ball_constraint"
    return make(
        prefix,
        make(f"{prefix}_body_A", placed.links[a]),
        make(f"{prefix}_body_B", placed.links[b]),
        make(f"{prefix}_p_AP", numbers(p_AP)),
        make(f"{prefix}_p_BQ", numbers(p_BQ)),
    )


def _tendon(file: MjcfFile, placed: Placed, element: Element, report: Report) -> list[Element]:
    """A fixed tendon with a range is a limit on a sum of joint positions."""
    given = file.attributes(element, "main")
    label = f"tendon {element.name}".strip()
    ranged = "range" in given and given.get("limited", "true") != "false"
    if element.tag != "fixed":
        report.add("dropped", label, f"a {element.tag} tendon has no counterpart", element.line)
        return []
    if not ranged:
        return []
    lower, upper = file.source.floats(element, given["range"], 2, (0, 0), "range")
    prefix, offset, rows = "drake:tendon_constraint", 0.0, []
    for joint in element.all("joint"):
        name = joint.attributes.get("joint", "")
        if name not in placed.joints:
            file.source.fault(joint, f"unknown joint '{name}'", "name a joint", "joint")
            return []
        coef = float(file.source.floats(joint, joint.attributes.get("coef"), 1, (1.0,), "coef")[0])
        offset += coef * placed.refs[name]
        rows.append(make(f"{prefix}_joint", name=placed.joints[name], a=number(coef)))
    report.add("joint", label, "its range limits a sum of joint positions", element.line)
    values = {"offset": offset, "lower_limit": lower, "upper_limit": upper}
    rows += [make(f"{prefix}_{key}", number(v)) for key, v in values.items()]
    # Stiff: MuJoCo's limits are near-rigid springs too.
    rows += [make(f"{prefix}_stiffness", "1000000"), make(f"{prefix}_damping", "100")]
    return [make(prefix, *rows)]


def contact_filters(
    file: MjcfFile, placed: Placed, bits: Mapping[str, set[tuple[int, int]]]
) -> list[Element]:
    """Who never collides with whom: excluded pairs, and what contype and conaffinity say.

    Args:
        file: the MJCF file.
        placed: where the bodies are.
        bits: (contype, conaffinity) of the geoms of each link that touches.
    """
    result = []

    def group(name: str, links: list[str], ignored: list[str]) -> None:
        members = [make("drake:member", link) for link in links]
        members += [make("drake:ignored_collision_filter_group", other) for other in ignored]
        result.append(make("drake:collision_filter_group", *members, name=name))

    kinds: dict[frozenset[tuple[int, int]], list[str]] = {}
    for link, own in bits.items():
        kinds.setdefault(frozenset(own), []).append(link)
    signatures = list(kinds)
    for i, a in enumerate(signatures):
        never = [
            f"kind_{k}"
            for k, b in enumerate(signatures)
            if not any((s[0] & t[1]) or (t[0] & s[1]) for s in a for t in b)
        ]
        group(f"kind_{i}", kinds[a], never)
    if not any(g.all("drake:ignored_collision_filter_group") for g in result):
        result.clear()
    for section in file.sections("contact"):
        for k, exclude in enumerate(section.all("exclude")):
            names = [exclude.attributes.get(key, "") for key in ("body1", "body2")]
            if all(n in placed.links for n in names):
                group(f"exclude_{k}", [placed.links[n] for n in names], [f"exclude_{k}"])
    return result
