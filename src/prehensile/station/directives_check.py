"""Follows a scenario's directives and finds the names they add, and what is wrong with them.

Directives are followed into the directive files they add, and models into their SDF and URDF
files, in order, so that every frame, joint and body that a directive names is held against what
is there at that point. A file that adds itself is caught here: Drake would crash on it.
"""

from collections.abc import Mapping
from pathlib import Path

from pydrake.multibody.parsing import ModelDirective

from prehensile.errors import Finding, InputError
from prehensile.models.model_file import ModelFile, ModelFileReader
from prehensile.models.packages import inside, resolve
from prehensile.station.schema import check
from prehensile.yaml_lines import Node, children, close_to, read_yaml_file

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
        for joint, node in children(joints).items():
            self._check_joint(node, joint, full, model)
        poses = body.get("default_free_body_pose")
        for link, node in children(poses).items():
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


def _empty(node: Node) -> bool:
    return node.value is None or node.value == ""


def _join(namespace: str, name: str) -> str:
    return f"{namespace}::{name}" if namespace and name != "world" else name
