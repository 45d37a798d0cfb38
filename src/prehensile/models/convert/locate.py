"""Finding the files that a description refers to, and only those it may refer to."""

import os
from collections.abc import Mapping
from pathlib import Path

from prehensile.errors import Finding, InputError
from prehensile.models.packages import find_packages, inside, package_name

_MAX_UP = 8  # folders above a description in which its package is looked for


class Locator:
    """Resolves the references of one description.

    A package is looked for among those named by the user, in ``PREHENSILE_MODEL_PATH``, in the ROS
    environment (``ROS_PACKAGE_PATH``, ``AMENT_PREFIX_PATH``), and upwards from the file.

    Args:
        file: the description.
        packages: further packages, name to root folder.
        root: the folder that relative paths may not leave; None for the file's package, else its
            own folder.
    """

    def __init__(self, file: Path, packages: Mapping[str, str | Path], root: Path | None) -> None:
        self._file = file.absolute()
        self._packages = find_packages(packages)
        self._above = [self._file.parent, *self._file.parent.parents][:_MAX_UP]
        package = next((f for f in self._above if (f / "package.xml").is_file()), None)
        self.root = (root or package or self._file.parent).absolute()
        if not self._file.resolve().is_relative_to(self.root.resolve()):
            raise InputError(
                Finding(f"the file is not in the root folder {self.root}", "", str(file))
            )

    def find(self, uri: str, folder: Path | None = None) -> tuple[Path, Path]:
        """The file that a reference means.

        Args:
            uri: ``package://``, ``model://``, ``file://`` or a path.
            folder: what a relative path is relative to; None for the description's folder.

        Returns:
            The file, and the folder that it and what it refers to may not leave.

        Raises:
            InputError: it does not exist, or lies outside of the folders it may be in.
        """
        if "\0" in uri or not uri.strip():
            raise InputError(Finding(f"'{uri}' cannot be a path", "name a file"))
        scheme, _, rest = uri.rpartition("://")
        if scheme in ("package", "model"):
            name, _, path = rest.partition("/")
            root = self._package(name)
            return inside(root, root / path, uri), root
        if scheme not in ("", "file"):
            raise InputError(Finding(f"'{uri}' is not on this machine", "write package://..."))
        path = Path(rest) if scheme else Path(uri)
        if path.is_absolute():
            for root in (self.root, *self._packages.values()):
                if path.resolve().is_relative_to(root.resolve()):
                    return inside(root, path, uri), root
        else:
            path = (folder or self._file.parent) / path
        try:
            return inside(self.root, path, uri), self.root
        except InputError as error:
            if "leaves" not in str(error):
                raise
            message = f"the path '{uri}' leaves the folder {self.root}"
            mend = "name a folder that holds all files of the model: --root FOLDER"
            raise InputError(Finding(message, mend)) from None

    def _package(self, name: str) -> Path:
        if name in self._packages:
            return self._packages[name]
        for prefix in filter(None, os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)):
            if name and (Path(prefix) / "share" / name / "package.xml").is_file():
                return Path(prefix) / "share" / name
        for folder in self._above:
            if name in (folder.name, package_name(folder)):
                return folder
            if name and "/" not in name and name != ".." and (folder / name).is_dir():
                return folder / name
        raise InputError(Finding(f"unknown package '{name}'", f"say where: --package {name}=PATH"))
