"""Checks of the values in SDF and URDF files: masses, sizes, limits, resolutions, meshes.

Both formats say the same with elements (SDF) or attributes (URDF); these checks read either.
"""

import json
import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

from prehensile.errors import InputError
from prehensile.models.packages import inside
from prehensile.models.xml_lines import Element

MAX_RESOLUTION = 100
"""Greatest ratio of a shape's size to its ``mesh_resolution_hint``: finer meshes take gigabytes."""

_POSITIVE = ("drake:hydroelastic_modulus", "drake:point_contact_stiffness")
_NOT_NEGATIVE = ("drake:mu_static", "drake:mu_dynamic", "mu", "mu2", "drake:relaxation_time")
_SIZES = ("size", "radius", "length", "radii", "drake:radius", "drake:length")
_MESHED = ("sphere", "cylinder", "capsule", "ellipsoid")  # by the resolution hint


class Fault(NamedTuple):
    """A fault, the element that it is in, and how to mend it."""

    element: Element
    message: str
    mend: str = ""


def number_faults(element: Element) -> Iterator[Fault]:
    """NaN is wrong wherever it stands.

    Args:
        element: any element.
    """
    texts = [*element.attributes.items(), ("", "" if element.children else element.text)]
    for key, text in texts:
        if key in ("name", "filename", "link", "file"):
            continue
        numbers = [_number(token) for token in text.split()]
        if None not in numbers and any(n is not None and math.isnan(n) for n in numbers):
            where = f"{element.tag}.{key}" if key else element.tag
            yield Fault(element, f"<{where}> is NaN (not a number)", "write a number")


def inertial_faults(inertial: Element, link: str) -> Iterator[Fault]:
    """A mass is finite and at least 0, and so is a moment of inertia.

    Args:
        inertial: the element ``<inertial>``.
        link: name of its link.
    """
    mass, inertia = inertial.child("mass"), inertial.child("inertia")
    if mass is not None:
        text = mass.attributes.get("value", mass.text)
        value = _number(text)
        if value is None:
            yield Fault(mass, f"the mass of link '{link}' is not a number: '{text}'")
        elif value < 0 or math.isinf(value):
            yield Fault(mass, f"the mass of link '{link}' is {value:g} kg", "a mass is at least 0")
    for axis in ("ixx", "iyy", "izz"):
        value = _number(_values(inertia).get(axis, "")) if inertia else None
        if inertia and value is not None and (value < 0 or math.isinf(value)):
            message = f"{axis} of link '{link}' is {value:g}"
            yield Fault(inertia, message, "a moment of inertia is at least 0")


def collision_faults(collision: Element, link: str) -> Iterator[Fault]:
    """Sizes, mesh resolution and contact properties of a collision element.

    Args:
        collision: the element ``<collision>``.
        link: name of its link.
    """
    geometry = collision.child("geometry")
    size = greatest_extent(geometry) if geometry else None
    for shape in geometry.children if geometry else ():
        for key in _SIZES:
            for value in (_number(token) for token in _values(shape).get(key, "").split()):
                if value is not None and (value <= 0 or math.isinf(value)):
                    message = f"the {key} of a {shape.tag} on link '{link}' is {value:g}"
                    yield Fault(shape, message, "sizes are finite and > 0")
    for element in collision.walk():
        value = _number(element.attributes.get("value", element.text))
        if value is None:
            continue
        if element.tag == "drake:mesh_resolution_hint":
            if value <= 0 or math.isinf(value):
                yield Fault(element, f"the mesh resolution is {value:g} m", "it must be > 0")
            elif size is not None and size / value > MAX_RESOLUTION:
                yield Fault(
                    element,
                    f"a mesh resolution of {value:g} m is absurd for a shape of {size:g} m "
                    f"on link '{link}'",
                    f"use {size / MAX_RESOLUTION:g} m or more",
                )
        elif element.tag in _POSITIVE and value <= 0:
            yield Fault(element, f"<{element.tag}> is {value:g}", "it must be > 0")
        elif element.tag in _NOT_NEGATIVE and value < 0:
            yield Fault(element, f"<{element.tag}> is {value:g}", "it must be at least 0")


def limit_faults(limit: Element, joint: str, values: Mapping[str, str]) -> Iterator[Fault]:
    """The lower position limit of a joint lies below the upper one.

    Args:
        limit: the element ``<limit>``.
        joint: name of the joint.
        values: the texts of ``lower`` and ``upper``.
    """
    lower, upper = _number(values.get("lower", "")), _number(values.get("upper", ""))
    if lower is not None and upper is not None and lower > upper:
        yield Fault(
            limit,
            f"the limits of joint '{joint}' are the wrong way round: {lower:g} > {upper:g}",
            "write the lower one first",
        )


def resolution_hint(collision: Element) -> float | None:
    """The mesh resolution hint of a collision element in metres, None if it has none."""
    for element in collision.walk():
        if element.tag == "drake:mesh_resolution_hint":
            return _number(element.attributes.get("value", element.text))
    return None


def greatest_extent(geometry: Element) -> float | None:
    """Greatest extent in metres of a shape that Drake meshes by the resolution hint.

    Args:
        geometry: the element ``<geometry>``.

    Returns:
        The extent of a sphere, cylinder, capsule or ellipsoid; None for any other shape.
    """
    for shape in geometry.children:
        if shape.tag.removeprefix("drake:") not in _MESHED:
            continue
        values = _values(shape)
        numbers = [
            _number(token)
            for key in ("radius", "length", "radii", "a", "b", "c")
            for token in values.get(key, "").split()
        ]
        found = [n for n in numbers if n is not None and math.isfinite(n)]
        if found:
            return 2 * max(found)
    return None


def gltf_faults(path: Path, root: Path) -> list[str]:
    """Files that a .gltf refers to and that are not there.

    Args:
        path: the .gltf file.
        root: the folder that it may not leave.
    """
    try:
        gltf = json.loads(path.read_bytes())
        uris = [
            item.get("uri", "data:") for key in ("buffers", "images") for item in gltf.get(key, [])
        ]
    except (ValueError, AttributeError, TypeError, RecursionError) as error:
        return [f"not valid glTF: {error}"]
    faults = []
    for uri in uris:
        if not str(uri).startswith("data:"):
            try:
                inside(root, path.parent / str(uri), str(uri))
            except InputError as error:
                faults.append(error.findings[0].message)
    return faults


def _values(element: Element) -> dict[str, str]:
    """What an element says, by attributes or by elements in it."""
    return element.attributes | {child.tag: child.text for child in element.children}


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None
