"""Where model packages are: ours, the user's, ROS's, and what Drake has fetched before.

A *package* is a folder known by a name; ``package://NAME/PATH`` is a file in it. Nothing here
reaches for the network: Drake's own map would download ``drake_models`` on first use, ours offers
that package only where its files are on this machine already.
"""

import os
import re
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from prehensile.errors import Finding, InputError
from prehensile.yaml_lines import close_to

if TYPE_CHECKING:
    from pydrake.multibody.parsing import PackageMap

DATA = Path(__file__).resolve().parent / "data"
"""Root folder of the package ``prehensile``: the embedded models."""

MODEL_PATH_VARIABLE = "PREHENSILE_MODEL_PATH"
"""Environment variable that lists folders of models, separated as in PATH."""

MODEL_SUFFIXES = (".sdf", ".urdf")

_MAX_DEPTH = 4  # folders below a package's root in which models are looked for
_MAX_XML_BYTES = 1 << 20
_URL = re.compile(r"package://([^/]+)/(.+)", re.DOTALL)


def find_packages(packages: Mapping[str, str | Path] | None = None) -> dict[str, Path]:
    """Finds every model package, by name.

    A name is looked for in this order, and the first hit wins: ``packages``; the folders listed in
    the environment variable ``PREHENSILE_MODEL_PATH``; for any other package, ``ROS_PACKAGE_PATH``;
    for ``drake_models`` at last, what Drake has downloaded before. ``prehensile`` and ``drake``
    are always there.

    A folder in ``PREHENSILE_MODEL_PATH`` is one package, named by its ``package.xml`` if it has
    one, else by the folder's own name.

    Args:
        packages: further packages, name to folder. A folder of your own models is one line:
            ``{"mine": "/home/me/models"}``.

    Returns:
        Package name to the absolute path of its root folder (``drake`` is left to Drake).

    Raises:
        InputError: a folder does not exist, or a name is taken or not a name.
    """
    findings: list[Finding] = []
    found: dict[str, Path] = {"prehensile": DATA}

    def add(name: str, folder: str | Path, source: str) -> None:
        root = Path(folder).expanduser().absolute()
        if name in ("prehensile", "drake"):
            findings.append(
                Finding(f"the package name '{name}' is taken", "choose another", key=source)
            )
        elif not re.fullmatch(r"[A-Za-z0-9_.-]+", name):
            findings.append(
                Finding(
                    f"'{name}' cannot be the name of a package",
                    "use letters, digits, _ - and . only",
                    key=source,
                )
            )
        elif not root.is_dir():
            findings.append(
                Finding(
                    f"the folder of package '{name}' does not exist: {root}",
                    "correct the path",
                    key=source,
                )
            )
        else:
            found.setdefault(name, root)

    for name, folder in (packages or {}).items():
        add(name, folder, f"packages.{name}")
    for folder in filter(None, os.environ.get(MODEL_PATH_VARIABLE, "").split(os.pathsep)):
        add(package_name(Path(folder)), folder, MODEL_PATH_VARIABLE)
    if findings:
        raise InputError(*findings)
    for folder in filter(None, os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep)):
        for manifest in sorted(Path(folder).rglob("package.xml")):
            name = package_name(manifest.parent)
            if name != "drake":
                found.setdefault(name, manifest.parent.absolute())
    if "drake_models" not in found:
        cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
        for manifest in sorted(cache.glob("drake/package_map/*/package.xml")):
            if package_name(manifest.parent) == "drake_models":
                found["drake_models"] = manifest.parent
    return found


def package_map(packages: Mapping[str, str | Path] | None = None) -> "PackageMap":
    """Makes the map from package names to folders that Drake's parser asks.

    Args:
        packages: further packages, name to folder; see :func:`find_packages`.

    Returns:
        A map with ``prehensile``, ``drake`` and everything that :func:`find_packages` finds, and
        no package that Drake would have to download.

    Raises:
        InputError: as :func:`find_packages`.
    """
    from pydrake.multibody.parsing import PackageMap

    result = PackageMap()
    if result.Contains("drake_models"):
        result.Remove("drake_models")
    for name, root in find_packages(packages).items():
        result.Add(name, root)
    return result


def resolve(url: str, packages: Mapping[str, Path]) -> Path:
    """Finds the file that a ``package://NAME/PATH`` URL means.

    Args:
        url: the URL.
        packages: package name to root folder, as from :func:`find_packages`.

    Returns:
        The absolute path of an existing file inside its package.

    Raises:
        InputError: not such a URL, an unknown package, a path that leaves its package (by ``..``
            or by a symbolic link), or no such file.
    """
    match = _URL.fullmatch(url)
    if match is None:
        raise InputError(
            Finding(f"'{url}' is not a model URL", "write package://PACKAGE/PATH/FILE")
        )
    name, path = match.groups()
    if name == "drake":
        # Drake's own files; found without importing Drake's parser.
        import pydrake

        root = Path(pydrake.getDrakePath())
    elif name in packages:
        root = packages[name]
    elif name == "drake_models":
        raise InputError(
            Finding(
                "Drake's model package 'drake_models' is not on this machine",
                "name its folder: 'packages: {drake_models: PATH}' in the scenario, or "
                f"{MODEL_PATH_VARIABLE}=PATH in the environment",
            )
        )
    else:
        known = ", ".join(sorted({"drake", *packages}))
        raise InputError(
            Finding(
                f"unknown package '{name}'",
                f"known are {known}; name a folder under 'packages:' in the scenario, or in "
                f"{MODEL_PATH_VARIABLE}",
            )
        )
    try:
        return inside(root, root / path, url)
    except InputError:
        files = [f"package://{name}/{f.relative_to(root).as_posix()}" for f in model_files(root)]
        if url.endswith(MODEL_SUFFIXES) and url not in files and ".." not in path:
            mend = close_to(url, files, f"looked for it at {root / path}")
            raise InputError(Finding(f"there is no file '{url}'", mend)) from None
        raise


def model_files(root: Path) -> list[Path]:
    """Lists the SDF and URDF files of a package, a few folders deep.

    Args:
        root: the package's root folder.
    """
    patterns = ("*/" * depth + "*" for depth in range(_MAX_DEPTH))
    return sorted(p for k in patterns for p in root.glob(k) if p.suffix in MODEL_SUFFIXES)


def inside(root: Path, path: Path, said: str) -> Path:
    """Checks that a file exists and lies inside a folder, symbolic links followed.

    Args:
        root: the folder.
        path: the file.
        said: how the user wrote it, for the error's text.

    Returns:
        ``path``, absolute and without ``..``.

    Raises:
        InputError: the file lies outside of the folder or does not exist.
    """
    try:
        real = path.resolve()
        if not real.is_relative_to(root.resolve()):
            raise InputError(
                Finding(
                    f"the path '{said}' leaves its package, {root}",
                    "keep model files inside their package",
                )
            )
        if not real.is_file():
            raise InputError(Finding(f"there is no file '{said}'", f"looked for it at {path}"))
    except (OSError, RuntimeError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(Finding(f"'{said}' cannot be a path: {error}")) from None
    return Path(os.path.normpath(path.absolute()))


def package_name(folder: Path) -> str:
    """The name in a folder's ``package.xml``, else the folder's own name."""
    manifest = folder.expanduser() / "package.xml"
    try:
        if manifest.stat().st_size <= _MAX_XML_BYTES:
            text = manifest.read_text(encoding="utf-8")
            # A manifest has no need of entities, and entities are how XML explodes.
            name = None if "<!ENTITY" in text else ET.fromstring(text).findtext("name")
            if name and name.strip():
                return name.strip()
    except (OSError, ET.ParseError, UnicodeDecodeError):
        pass
    return folder.expanduser().absolute().name
