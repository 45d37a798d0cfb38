"""Reads scenario files: YAML text to a validated :class:`~prehensile.station.scenario.Scenario`.

Every fault of the file, of the directive files that it adds and of the model files that those name
is found before anything is built, and all of them are reported at once, each with file, line, key
and mend.

A file holds one scenario at its top level, or a map from names to scenarios; keys that begin with
``_`` are ignored, so that anchors have a place. Random poses in the scenario's own directives
(``rotation: !Uniform {}``) are drawn by ``random_seed``. ``scenario_name`` picks one of the named.
``data``, a YAML text with the same keys as a scenario, is laid on top: maps are merged key by key,
lists (``directives`` above all) and scalars are replaced. Both as in Drake's hardware simulation.
"""

import dataclasses as dc
import functools
import operator
import typing
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path
from typing import Any

from pydrake.common.yaml import yaml_dump, yaml_load_typed

from prehensile.errors import Finding, InputError
from prehensile.models.packages import find_packages
from prehensile.station.drivers import driver_types
from prehensile.station.random_poses import draw_poses
from prehensile.station.scenario import Scenario
from prehensile.station.scenario_check import check_scenario
from prehensile.station.schema import check
from prehensile.yaml_lines import Node, close_to, merge, read_yaml, read_yaml_file


def list_scenarios() -> list[str]:
    """Names of the scenario files that come with prehensile."""
    folder = files("prehensile.station") / "scenarios"
    return sorted(p.name.removesuffix(".yaml") for p in folder.iterdir() if p.name[-5:] == ".yaml")


def load_scenario(
    path_or_name: str | Path,
    *,
    data: str | None = None,
    scenario_name: str | None = None,
    packages: Mapping[str, str | Path] | None = None,
) -> Scenario:
    """Reads and validates a scenario file.

    Args:
        path_or_name: a YAML file, or the name of one that comes with prehensile, such as
            ``two_bins`` (see :func:`list_scenarios`).
        data: YAML text laid on top of the file: maps are merged, lists and scalars are replaced.
        scenario_name: which scenario of a file that holds several, by the key it stands under.
        packages: further model packages, name to folder. The key ``packages:`` of the scenario
            does the same; folders there are relative to the file.

    Returns:
        The scenario.

    Raises:
        InputError: with everything that is wrong with the file and the files it names.
    """
    path = _find(path_or_name)
    findings: list[Finding] = []
    root = read_yaml_file(path, findings)
    if root is not None:
        root = _pick(root, scenario_name, findings)
    if root is not None and data is not None:
        over = read_yaml(data, "data", findings)
        root = merge(root, over) if over is not None else root
    return _build(root, path, packages, findings)


def loads_scenario(
    text: str,
    *,
    scenario_name: str | None = None,
    packages: Mapping[str, str | Path] | None = None,
) -> Scenario:
    """Reads and validates a scenario from YAML text.

    Args:
        text: the YAML text.
        scenario_name: which scenario of a text that holds several.
        packages: further model packages, name to folder. Relative folders under ``packages:`` are
            relative to the working directory.

    Returns:
        The scenario; its ``file`` is None.

    Raises:
        InputError: with everything that is wrong with the text and the files it names.
    """
    findings: list[Finding] = []
    root = read_yaml(text, "text", findings)
    if root is not None:
        root = _pick(root, scenario_name, findings)
    return _build(root, None, packages, findings)


def _find(path_or_name: str | Path) -> Path:
    """The file that the caller means."""
    path = Path(path_or_name)
    if path.is_file():
        return path
    shipped = list_scenarios()
    if str(path_or_name) in shipped:
        return Path(str(files("prehensile.station") / "scenarios" / f"{path_or_name}.yaml"))
    if path.suffix in (".yaml", ".yml") or len(path.parts) > 1:
        raise InputError(Finding(f"there is no scenario file '{path}'", "correct the path"))
    raise InputError(
        Finding(
            f"unknown scenario '{path_or_name}'",
            f"{close_to(str(path_or_name), shipped)}; or give the path of a YAML file",
        )
    )


def _pick(root: Node, scenario_name: str | None, findings: list[Finding]) -> Node | None:
    """Picks the scenario out of a file that may hold several."""
    if not isinstance(root.value, dict):
        findings.append(root.finding("the top level is not a map of keys"))
        return None
    children = {k: n for k, n in root.value.items() if not k.startswith("_")}
    if scenario_name is not None:
        if scenario_name not in children:
            findings.append(
                root.finding(
                    f"no scenario '{scenario_name}' in this file", close_to(scenario_name, children)
                )
            )
            return None
        return children[scenario_name]
    known = {field.name for field in dc.fields(Scenario)}
    if children and not known & set(children):
        inner = [
            k for k, n in children.items() if isinstance(n.value, dict) and known & set(n.value)
        ]
        if len(inner) == len(children):
            findings.append(
                root.finding(
                    "this file holds several scenarios by name",
                    f"pick one by scenario_name: {', '.join(inner)}",
                )
            )
            return None
    return dc.replace(root, value=children)


def _build(
    root: Node | None,
    path: Path | None,
    packages: Mapping[str, str | Path] | None,
    findings: list[Finding],
) -> Scenario:
    """Validates the merged YAML and makes the scenario's structs of it."""
    if root is None:
        raise InputError(*findings)
    file = root.file
    schema = _schema()
    if not isinstance(root.value, dict):
        raise InputError(*findings, root.finding("a scenario is a map of keys"))
    folders = dict(packages or {})
    for key, node in root.value.items():
        if key not in schema:
            findings.append(node.finding(f"unknown key '{key}'", close_to(key, schema)))
            continue
        before = len(findings)
        check(node, schema[key], findings, ("Scenario", key))
        if key == "packages" and len(findings) == before:
            base = path.parent if path else Path()
            folders |= {k: (base / Path(n.value).expanduser()) for k, n in node.value.items()}
    try:
        found = find_packages(folders)
    except InputError as error:
        node = root.get("packages")
        place = node.line if node else 0
        findings += [dc.replace(f, file=root.file, line=place) for f in error.findings]
        found = find_packages()
    check_scenario(root, found, findings)
    values: dict[str, Any] = {}
    if not findings:
        for key, node in root.value.items():
            try:
                values[key] = _load(key, node, schema[key])
            except Exception as error:  # whatever Drake refuses is the file's fault
                said = " ".join(str(error).split())
                findings.append(node.finding(f"Drake refuses this section: {said}"))
    if findings:
        # The scenario's own first, in the order of its lines.
        raise InputError(*sorted(findings, key=lambda f: (f.file != file, f.file, f.line)))
    draw_poses(values.get("directives", []), values.get("random_seed", 0))
    values["packages"] = {name: str(Path(p).absolute()) for name, p in folders.items()}
    return Scenario(**values, file=path.absolute() if path else None)


def _schema() -> dict[str, Any]:
    """The types of a scenario's keys, drivers by the tags that the driver registry knows."""
    schema = typing.get_type_hints(Scenario)
    del schema["file"]
    schema["model_drivers"] = dict[str, functools.reduce(operator.or_, driver_types().values())]
    return schema


def _load(key: str, node: Node, schema: Any) -> Any:
    """Makes one section's structs, by Drake's own YAML reader, on top of the defaults."""

    holder = dc.make_dataclass("Section", [(key, schema)], namespace={})
    section = holder(getattr(Scenario(), key))
    text = yaml_dump({key: node.plain()})
    return getattr(yaml_load_typed(schema=holder, data=text, defaults=section), key)
