"""Checks what the types of a scenario do not tell: references, and values that must fit together.

Every name in a scenario (frame, joint, body, model, bus, camera) is held against what is there;
what the directives add is found by :mod:`prehensile.station.directives_check`.
"""

import math
from collections.abc import Mapping
from pathlib import Path

from prehensile.errors import Finding
from prehensile.models.model_file import ModelFileReader
from prehensile.models.model_values import MAX_RESOLUTION
from prehensile.station.directives_check import Directives
from prehensile.yaml_lines import Node, children, close_to, number


def check_scenario(root: Node, packages: Mapping[str, Path], findings: list[Finding]) -> None:
    """Checks references and values that must fit together.

    Args:
        root: the scenario, its types checked already; what is of the wrong type is passed over.
        packages: package name to root folder.
        findings: what is wrong is appended here.
    """
    reader = ModelFileReader(packages, findings)
    models = Directives(packages, reader, findings)
    directives = root.get("directives")
    if directives is not None:
        models.walk(directives, "", ())
    buses = {"default", *children(root.get("lcm_buses"))}
    _check_drivers(root, models, buses, findings)
    _check_cameras(root, models, buses, findings)
    visualization = root.get("visualization")
    if visualization is not None:
        _check_bus(visualization, buses, findings)
    _check_default_resolution(root, models, findings)


def _check_drivers(
    root: Node, models: Directives, buses: set[str], findings: list[Finding]
) -> None:
    for name, driver in children(root.get("model_drivers")).items():
        for model in name.split("+"):
            if model not in models.models:
                findings.append(
                    driver.finding(
                        f"no directive adds a model '{model}'", close_to(model, models.models)
                    )
                )
        if not driver.tag:
            findings.append(
                driver.finding("the type of the driver is not named", "write NAME: !IiwaDriver {}")
            )
        _check_gains(name, driver, models, findings)
        hand = driver.get("hand_model_name")
        if hand is not None and hand.text() and hand.value not in models.models:
            findings.append(
                hand.finding(
                    f"no directive adds a model '{hand.value}'",
                    close_to(hand.value, models.models),
                )
            )
        _check_bus(driver, buses, findings)


def _check_gains(name: str, driver: Node, models: Directives, findings: list[Finding]) -> None:
    """An arm's stiffness has one element for each joint."""
    gains, model = driver.get("desired_kp_gains"), models.models.get(name)
    if gains is None or not isinstance(gains.value, list) or model is None or model.opaque:
        return
    positions = [n for n in model.joints.values() if n is None or n > 0]
    if None not in positions and len(gains.value) != len(positions):
        findings.append(
            gains.finding(f"{len(gains.value)} gains stand where {len(positions)} joints move")
        )


def _check_cameras(
    root: Node, models: Directives, buses: set[str], findings: list[Finding]
) -> None:
    names: dict[str, Node] = {}
    for camera in children(root.get("cameras")).values():
        base = camera.get("X_PB", "base_frame")
        if base is not None:
            models.known(base)
        _check_bus(camera, buses, findings)
        name = camera.get("name")
        text = "preview_camera" if name is None else name.text()
        if text is not None:
            if text in names:
                findings.append(
                    (name or camera).finding(
                        f"two cameras are called '{text}'", "give each its own name"
                    )
                )
            names[text] = camera
        for low, high, low_default, high_default in (
            ("z_near", "z_far", 0.1, 5.0),
            ("clipping_near", "clipping_far", 0.01, 500.0),
        ):
            near = _value(camera, low, low_default)
            far = _value(camera, high, high_default)
            if near >= far:
                node = camera.get(low) or camera.get(high) or camera
                findings.append(
                    node.finding(f"{low} {near:g} is not less than {high} {far:g}", "swap them")
                )
        for centre, size, default in (("center_x", "width", 640), ("center_y", "height", 480)):
            node = camera.get(centre)
            extent = _value(camera, size, default)
            if node is not None and _value(camera, centre, 0) >= extent:
                findings.append(
                    node.finding(f"{centre} lies outside of the image", f"{size} is {extent:g}")
                )
        focal = camera.get("focal")
        if focal is not None and isinstance(focal.value, dict) and not focal.value:
            findings.append(focal.finding("the focal length is empty", "give x, y, or both"))
    for section in ("camera_ids", "depth_noise"):
        for key, node in children(root.get(section)).items():
            if key not in children(root.get("cameras")):
                mend = close_to(key, children(root.get("cameras")))
                findings.append(node.finding(f"there is no camera '{key}'", mend))
    for noise in children(root.get("depth_noise")).values():
        near, far = _value(noise, "min_depth", 0.3), _value(noise, "max_depth", 1.5)
        if near >= far:
            node = noise.get("min_depth") or noise.get("max_depth") or noise
            findings.append(
                node.finding(f"min_depth {near:g} is not less than max_depth {far:g}", "swap them")
            )


def _check_bus(node: Node, buses: set[str], findings: list[Finding]) -> None:
    bus = node.get("lcm_bus")
    if bus is not None and bus.text() and bus.value not in buses:
        findings.append(bus.finding(f"unknown LCM bus '{bus.value}'", close_to(bus.value, buses)))


def _check_default_resolution(root: Node, models: Directives, findings: list[Finding]) -> None:
    """The scenario's default resolution hint must suit every shape that has none of its own."""
    hint = root.get("scene_graph_config", "default_proximity_properties", "resolution_hint")
    value = number(hint.value) if hint else None
    if hint is None or value is None or not value > 0:
        return
    for name, model in models.models.items():
        for shape in model.shapes if model else ():
            if shape.hint is None and shape.size / value > MAX_RESOLUTION:
                findings.append(
                    hint.finding(
                        f"a mesh resolution of {value:g} m is absurd for a shape of "
                        f"{shape.size:g} m on {shape.where} of model '{name}'",
                        f"use {shape.size / MAX_RESOLUTION:g} m or more",
                    )
                )
                return


def _value(node: Node, key: str, default: float) -> float:
    """A number among a node's children; NaN, which compares as false, if it is not one."""
    child = node.get(key)
    if child is None or child.value is None:
        return default
    found = number(child.value)
    return math.nan if found is None else found
