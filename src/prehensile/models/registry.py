"""The registry of models: what there is, and where its files are.

The embedded models live in ``data/NAME/``: ``NAME.sdf``, ``model.yaml`` (title, category,
description, sources) and ``spheres.yaml`` (the sphere model that planners use). A folder of your
own models becomes part of the registry by one line, ``packages={"mine": folder}``, by a
``packages:`` key in a scenario, or by the environment variable ``PREHENSILE_MODEL_PATH``; every
SDF and URDF file in it is a model, and ``model.yaml`` and ``spheres.yaml`` beside it are optional.
Listing imports no Drake.
"""

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import yaml

from prehensile.errors import Finding, InputError
from prehensile.models.packages import (
    DATA,
    MODEL_PATH_VARIABLE,
    find_packages,
    model_files,
    package_map,
    resolve,
)
from prehensile.yaml_lines import close_to, read_yaml_file

__all__ = [
    "CATEGORIES",
    "DATA",
    "MODEL_PATH_VARIABLE",
    "ModelInfo",
    "find_model",
    "list_models",
    "load_spheres",
    "package_map",
]

CATEGORIES = ("arm", "hand", "camera", "furniture", "object", "other")
"""The categories of models, in the order in which they are listed."""

_LIST_MEND = "'prehensile models list' names them all"


@dataclass(frozen=True)
class ModelInfo:
    """What the registry knows of a model.

    Attributes:
        name: the name it is asked for by; the stem of its file.
        title: what it is, in a few words; its URL if nobody says.
        category: one of :data:`CATEGORIES`.
        description: one or two sentences.
        sources: where its facts and figures come from.
        url: ``package://PACKAGE/PATH``, as a scenario names it.
        path: its SDF or URDF file.
    """

    name: str
    title: str
    category: str
    description: str
    sources: tuple[str, ...]
    url: str
    path: Path


def list_models(packages: Mapping[str, str | Path] | None = None) -> list[ModelInfo]:
    """Lists the embedded models and the user's own.

    Args:
        packages: further packages, name to folder. Those in ``PREHENSILE_MODEL_PATH`` are listed
            as well; those that only ROS or Drake's cache holds can be used but are not listed.

    Returns:
        The models, ordered by category, then name.

    Raises:
        InputError: a folder does not exist, or a ``model.yaml`` is broken.
    """
    found = find_packages(packages)
    named = [*(packages or {}), *_named_in_environment(found)]
    infos = [
        _read_info("prehensile", DATA, path)
        for path in sorted(DATA.glob("*/*.sdf"))
        if path.stem == path.parent.name
    ]
    for name in dict.fromkeys(named):
        infos += [_read_info(name, found[name], path) for path in model_files(found[name])]
    return sorted(infos, key=lambda info: (CATEGORIES.index(info.category), info.name))


def find_model(name: str, packages: Mapping[str, str | Path] | None = None) -> ModelInfo:
    """Finds a model by its name or by its URL.

    Args:
        name: such as ``iiwa7``, or ``package://PACKAGE/PATH/FILE``. An embedded model is preferred
            to one of the user's with the same name; that one is reached by its URL.
        packages: further packages, name to folder.

    Returns:
        The model.

    Raises:
        InputError: no such model (close matches are named), or several of that name.
    """
    if name.startswith("package://"):
        found = find_packages(packages)
        path = resolve(name, found)
        package = name.removeprefix("package://").split("/", 1)[0]
        return _read_info(package, found.get(package, path.parent), path, url=name)
    models = list_models(packages)
    hits = [info for info in models if info.name == name]
    embedded = [info for info in hits if info.url.startswith("package://prehensile/")]
    if embedded:
        return embedded[0]
    if len(hits) > 1:
        urls = ", ".join(info.url for info in hits)
        raise InputError(Finding(f"several models are called '{name}'", f"name one by URL: {urls}"))
    if not hits:
        mend = close_to(name, [info.name for info in models], _LIST_MEND)
        raise InputError(Finding(f"unknown model '{name}'", mend))
    return hits[0]


def load_spheres(
    model: str | ModelInfo, packages: Mapping[str, str | Path] | None = None
) -> dict[str, np.ndarray]:
    """Reads the sphere model of a model: spheres that together cover each link.

    Args:
        model: the model or its name.
        packages: further packages, name to folder, if ``model`` is a name.

    Returns:
        Link name to a (K, 4) float array; rows are [x, y, z, radius] in metres, the centre in the
        frame of the link. Links that move nothing may be absent.

    Raises:
        InputError: the model has no ``spheres.yaml``, or it is broken.
    """
    info = find_model(model, packages) if isinstance(model, str) else model
    path = info.path.parent / "spheres.yaml"
    if not path.is_file():
        raise InputError(
            Finding(
                f"the model '{info.name}' has no sphere model",
                f"write {path}: link name -> list of [x, y, z, radius]",
            )
        )
    raw = _read_yaml(path)
    findings: list[Finding] = []
    spheres: dict[str, np.ndarray] = {}
    for link, rows in raw.items():
        try:
            array = np.asarray(rows, dtype=float)
        except (TypeError, ValueError):
            array = np.empty(0)
        if (
            not isinstance(link, str)
            or array.ndim != 2
            or array.shape[-1] != 4
            or not np.isfinite(array).all()
            or not (array[:, 3] > 0).all()
        ):
            findings.append(
                Finding(
                    "not a list of finite [x, y, z, radius] with radius > 0",
                    file=str(path),
                    key=str(link),
                )
            )
        else:
            spheres[link] = array
    if findings:
        raise InputError(*findings)
    return spheres


def _named_in_environment(found: Mapping[str, Path]) -> list[str]:
    """The packages that the environment variable lists."""
    folders = {
        Path(folder).expanduser().absolute()
        for folder in filter(None, os.environ.get(MODEL_PATH_VARIABLE, "").split(os.pathsep))
    }
    return [name for name, root in found.items() if root in folders]


def _read_yaml(path: Path) -> dict:
    """Reads a small YAML file whose top level is a map."""
    if path.is_relative_to(DATA):
        # Our own files: the parser on libyaml is ten times faster, but crashes on hostile ones.
        return yaml.load(path.read_bytes(), Loader=getattr(yaml, "CSafeLoader", yaml.SafeLoader))
    findings: list[Finding] = []
    root = read_yaml_file(path, findings)
    if root is not None and not isinstance(root.value, dict):
        findings.append(root.finding("the top level is not a map of keys"))
    if findings or root is None:
        raise InputError(*findings)
    return root.plain()


def _read_info(package: str, root: Path, path: Path, url: str = "") -> ModelInfo:
    """Reads ``model.yaml`` beside a model's file, where there is one."""
    meta_file = path.parent / "model.yaml"
    meta = _read_yaml(meta_file) if meta_file.is_file() else {}
    category = meta.get("category", "other")
    findings = []
    if category not in CATEGORIES:
        findings.append(
            Finding(
                f"unknown category '{category}'",
                "one of " + ", ".join(CATEGORIES),
                file=str(meta_file),
                key="category",
            )
        )
    sources = meta.get("sources") or []
    if not isinstance(sources, list):
        findings.append(Finding("not a list", file=str(meta_file), key="sources"))
    if findings:
        raise InputError(*findings)
    url = url or f"package://{package}/{path.relative_to(root).as_posix()}"
    return ModelInfo(
        name=path.stem,
        title=str(meta.get("title", url)),
        category=category,
        description=" ".join(str(meta.get("description", "")).split()),
        sources=tuple(str(source) for source in sources),
        url=url,
        path=path,
    )
