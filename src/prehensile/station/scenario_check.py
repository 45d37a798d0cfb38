"""Checks what the types of a scenario do not tell: references, and values that must fit together.

Directives are followed into the directive files they add, and models into their SDF and URDF
files, so that every name in a scenario (frame, joint, body, model, bus, camera) is held against
what is there at that point.
"""

import math
from collections.abc import Mapping
from pathlib import Path

from pydrake.multibody.parsing import ModelDirective

from prehensile.errors import Finding, InputError
from prehensile.models.model_file import MAX_RESOLUTION, ModelFile, ModelFileReader
from prehensile.models.packages import inside, resolve
from prehensile.station.schema import check
from prehensile.yaml_lines import Node, close_to, number, read_yaml_file

_MAX_DEPTH = 20  # directive files that add each other
_MAX_FILES = 100  # directive files in all

_REQUIRED = {
    "add_model": ("name", "file"),
    "add_model_instance": ("name",),
    "add_frame": ("name", "X_PF"),
    "add_weld": ("parent", "child"),
    "add_collision_filter_group": ("name", "ignored_collision_filter_groups"),
    "add_directives": ("file",),
}


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
    buses = {"default", *_children(root.get("lcm_buses"))}
    _check_drivers(root, models, buses, findings)
    _check_cameras(root, models, buses, findings)
    visualization = root.get("visualization")
    if visualization is not None:
        _check_bus(visualization, buses, findings)
    _check_default_resolution(root, models, findings)


class Directives:
    """The models, frames and joints that a list of directives adds, and the faults in it.

    Args:
        packages: package name to root folder.
        reader: reads the model files.
        findings: what is wrong is appended here.

    Attributes:
        models: model instance name to what its file holds (None if it has no file).
        frames: scoped names of the frames that ``add_frame`` adds.
    """

    def __init__(
        self, packages: Mapping[str, Path], reader: ModelFileReader, findings: list[Finding]
    ) -> None:
        self.models: dict[str, ModelFile | None] = {}
        self.frames: set[str] = set()
        self._packages = packages
        self._reader = reader
        self._findings = findings
        self._files = 0

    def walk(self, directives: Node, namespace: str, stack: tuple[Path, ...]) -> None:
        """Follows a list of directives in order.

        Args:
            directives: the list.
            namespace: model namespace that names in it are relative to ("" for none).
            stack: the directive files that led here.
        """
        for item in directives.value if isinstance(directives.value, list) else ():
            if not isinstance(item.value, dict):
                continue  # reported with the types
            kinds = [k for k in item.value if k in _REQUIRED]
            if len(item.value) != 1 or not kinds:
                if len(item.value) != 1:
                    self._add(
                        item,
                        f"a directive has one key, this one has {len(item.value)}",
                        "begin each directive with its own -",
                    )
                continue
            kind, body = kinds[0], item.value[kinds[0]]
            if not isinstance(body.value, dict):
                if body.value is None:  # which the types allow
                    self._add(body, f"{kind} is empty", f"it needs {' and '.join(_REQUIRED[kind])}")
                continue
            missing = [k for k in _REQUIRED[kind] if not body.value.get(k) or _empty(body.value[k])]
            for key in missing:
                self._add(body, f"{kind} needs '{key}'", f"add the key '{key}'")
            if not missing:
                getattr(self, f"_{kind}")(body, namespace, stack)

    def known(self, frame: Node, namespace: str = "", name: str | None = None) -> None:
        """Reports a frame or body that is not there.

        Args:
            frame: the node that names it.
            namespace: model namespace that the name is relative to.
            name: the name, if it is not the node's value.
        """
        name = frame.text() if name is None else name
        if not name or name in ("world", "world::world", "world_model_instance::world"):
            return
        full = _join(namespace, name)
        if full in self.frames:
            return
        if "::" not in full:
            self._known_anywhere(frame, full)
            return
        parts = full.split("::")
        for i in range(len(parts) - 1, 0, -1):
            model, rest = "::".join(parts[:i]), "::".join(parts[i:])
            if model in self.models:
                held = self.models[model]
                if held is not None and not held.opaque and rest not in held.frames:
                    mend = close_to(rest, (f for f in held.frames if not f.startswith("__")))
                    self._add(frame, f"the model '{model}' has no frame '{rest}'", mend)
                return
        model = "::".join(parts[:-1])
        self._add(
            frame, f"no directive before this adds a model '{model}'", close_to(model, self.models)
        )

    def _known_anywhere(self, frame: Node, name: str) -> None:
        """A name without a scope may be a frame of any model."""
        held = [m for m in self.models.values() if m is not None]
        if any(m.opaque or name in m.frames for m in held):
            return
        if any(known.split("::")[-1] == name for known in self.frames):
            return
        names = {f for m in held for f in m.frames if not f.startswith("__")} | self.frames
        self._add(frame, f"there is no frame '{name}'", close_to(name, names, "write MODEL::FRAME"))

    def _add(self, node: Node, message: str, mend: str = "") -> None:
        self._findings.append(node.finding(message, mend))

    def _new_model(self, node: Node, namespace: str, model: ModelFile | None) -> str:
        name = _join(namespace, node.value)
        if name in self.models:
            self._add(node, f"there is a model '{name}' already", "give each model its own name")
        self.models.setdefault(name, model)
        return name

    def _add_model(self, body: Node, namespace: str, stack: tuple[Path, ...]) -> None:
        name, file = body.value["name"], body.value["file"]
        model = None
        found = self._resolve(file)
        if found is not None:
            path, root = found
            model = self._reader.read(path, root)
        if name.text() is None:
            return
        model = model or ModelFile(Path(), opaque=True)
        full = self._new_model(name, namespace, model)
        joints = body.get("default_joint_positions")
        for joint, node in _children(joints).items():
            self._check_joint(node, joint, full, model)
        poses = body.get("default_free_body_pose")
        for link, node in _children(poses).items():
            if not model.opaque and link not in model.frames:
                mend = close_to(link, (f for f in model.frames if not f.startswith("__")))
                self._add(node, f"the model '{full}' has no body '{link}'", mend)
            base = node.get("base_frame")
            if base is not None:
                self.known(base, namespace)

    def _check_joint(self, node: Node, joint: str, model_name: str, model: ModelFile) -> None:
        if model.opaque:
            return
        if joint not in model.joints:
            mend = close_to(joint, model.joints)
            self._add(node, f"the model '{model_name}' has no joint '{joint}'", mend)
            return
        wanted = model.joints[joint]
        if isinstance(node.value, list) and wanted is not None and len(node.value) != wanted:
            self._add(node, f"{len(node.value)} positions stand where joint '{joint}' has {wanted}")

    def _add_model_instance(self, body: Node, namespace: str, stack: tuple[Path, ...]) -> None:
        if body.value["name"].text() is not None:
            self._new_model(body.value["name"], namespace, None)

    def _add_frame(self, body: Node, namespace: str, stack: tuple[Path, ...]) -> None:
        base = body.get("X_PF", "base_frame")
        if base is None or base.text() is None:
            self._add(body.value["X_PF"], "add_frame needs 'base_frame' in X_PF", "add it")
            return
        self.known(base, namespace)
        name = _join(namespace, str(body.value["name"].value))
        self.frames.add(name)
        base_scope = _join(namespace, base.value).rpartition("::")[0]
        if base_scope and "::" not in str(body.value["name"].value):
            self.frames.add(f"{base_scope}::{body.value['name'].value}")

    def _add_weld(self, body: Node, namespace: str, stack: tuple[Path, ...]) -> None:
        for key in ("parent", "child"):
            self.known(body.value[key], namespace)
        base = body.get("X_PC", "base_frame")
        if base is not None:
            self.known(base, namespace)
        if body.value["parent"].value == body.value["child"].value:
            self._add(body, f"'{body.value['child'].value}' is welded to itself")

    def _add_collision_filter_group(
        self, body: Node, namespace: str, stack: tuple[Path, ...]
    ) -> None:
        own = body.get("model_namespace")
        scope = _join(namespace, own.text() or "") if own else namespace
        members = body.get("members")
        for member in members.value if members and isinstance(members.value, list) else ():
            self.known(member, scope)

    def _add_directives(self, body: Node, namespace: str, stack: tuple[Path, ...]) -> None:
        file = body.value["file"]
        found = self._resolve(file)
        if found is None:
            return
        path = found[0].resolve()
        if path in stack:
            self._add(
                file,
                f"'{file.value}' adds itself"
                + (" through other files" if stack[-1] != path else ""),
                "remove this add_directives",
            )
            return
        self._files += 1
        if len(stack) >= _MAX_DEPTH or self._files > _MAX_FILES:
            if self._files <= _MAX_FILES + 1:
                self._add(
                    file,
                    f"directive files add each other more than {_MAX_DEPTH} deep, "
                    f"or there are more than {_MAX_FILES}",
                    "use fewer files",
                )
            return
        scope = namespace
        own = body.get("model_namespace")
        if own is not None and own.text():
            scope = _join(namespace, own.value)
            if scope not in self.models:
                self._add(
                    own,
                    f"no model instance '{scope}' is there to be the namespace",
                    f"before this, 'add_model_instance: {{name: {own.value}}}'",
                )
                self.models[scope] = None
        root = read_yaml_file(path, self._findings)
        if root is None:
            return
        keys = root.value if isinstance(root.value, dict) else {}
        for key, node in keys.items():
            if key != "directives" and not key.startswith("_"):
                self._add(node, f"unknown key '{key}'", "a directive file has the key 'directives'")
        inner = keys.get("directives")
        if inner is None:
            self._findings.append(
                root.finding("this is no directive file", "it needs the key 'directives'")
            )
            return
        check(inner, list[ModelDirective], self._findings)
        self.walk(inner, scope, (*stack, path))

    def _resolve(self, file: Node) -> tuple[Path, Path] | None:
        """The file that a node names, and the folder that it may not leave."""
        url = file.text()
        if url is None:
            return None
        try:
            if url.startswith("file://"):
                path = Path(url.removeprefix("file://"))
                if not path.is_absolute():
                    raise InputError(Finding(f"'{url}' is not absolute", "write file:///..."))
                return inside(path.parent, path, url), path.parent
            path = resolve(url, self._packages)
            name = url.removeprefix("package://").split("/", 1)[0]
            return path, self._packages.get(name, path.parent)
        except InputError as error:
            for finding in error.findings:
                self._add(file, finding.message, finding.mend)
            return None


def _check_drivers(
    root: Node, models: Directives, buses: set[str], findings: list[Finding]
) -> None:
    for name, driver in _children(root.get("model_drivers")).items():
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
    for camera in _children(root.get("cameras")).values():
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
    for key, node in _children(root.get("camera_ids")).items():
        if key not in _children(root.get("cameras")):
            mend = close_to(key, _children(root.get("cameras")))
            findings.append(node.finding(f"there is no camera '{key}'", mend))


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


def _children(node: Node | None) -> dict[str, Node]:
    return node.value if node is not None and isinstance(node.value, dict) else {}


def _empty(node: Node) -> bool:
    return node.value is None or node.value == ""


def _value(node: Node, key: str, default: float) -> float:
    """A number among a node's children; NaN, which compares as false, if it is not one."""
    child = node.get(key)
    if child is None or child.value is None:
        return default
    found = number(child.value)
    return math.nan if found is None else found


def _join(namespace: str, name: str) -> str:
    return f"{namespace}::{name}" if namespace and name != "world" else name
