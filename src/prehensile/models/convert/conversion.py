"""A whole conversion: read, mend, write, load in Drake, and only then let it appear."""

import tempfile
from dataclasses import dataclass
from pathlib import Path

from prehensile.errors import Finding, InputError
from prehensile.files import write_atomic
from prehensile.models.convert.drake_check import load
from prehensile.models.convert.elements import Source
from prehensile.models.convert.locate import Locator
from prehensile.models.convert.mesh_file import SUFFIXES
from prehensile.models.convert.mesh_model import mesh_model
from prehensile.models.convert.mesh_store import MeshStore, plain_name
from prehensile.models.convert.mjcf import mjcf_model
from prehensile.models.convert.options import ConvertOptions
from prehensile.models.convert.report import Report
from prehensile.models.convert.trees import check_urdf, file_stem, mend_tree, sdf_model
from prehensile.models.convert.xml_text import make, xml_text
from prehensile.models.generate.files import write_description
from prehensile.models.xml_lines import Element, read_xml

_REPORT = "report.json"


@dataclass(frozen=True)
class Conversion:
    """A finished conversion.

    Attributes:
        path: the model's SDF or URDF file.
        report: what was changed.
    """

    path: Path
    report: Report


def convert(
    file: str | Path,
    folder: str | Path | None = None,
    options: ConvertOptions | None = None,
    *,
    replace: bool = False,
) -> Conversion:
    """Converts a URDF, SDF or MJCF file or a mesh into a folder that holds one model.

    Nothing in the file is executed and nothing outside of its folder tree is read; the result is
    loaded by Drake before the folder appears under its name.

    Args:
        file: ``.urdf``, ``.sdf``, ``.xml`` (MJCF, or URDF), or a mesh.
        folder: to be made; None for one named as the model in the current folder.
        options: choices; None for the defaults.
        replace: whether a folder that a conversion has made before may be replaced.

    Returns:
        The new file and the report.

    Raises:
        InputError: everything that is wrong with the input, with file, line and mend; there is no
            folder then, and one that was there is as it was.
    """
    options, file = options or ConvertOptions(), Path(file)
    if not file.is_file():
        raise InputError(Finding("no such file", "", str(file)))
    kind = file.suffix.lower()
    if kind == ".xacro" or file.name.endswith(".urdf.xacro"):
        mend = f"expand it first: xacro {file.name} > robot.urdf"
        raise InputError(Finding("this is a xacro file: macros, not yet a robot", mend, str(file)))
    if kind not in (".urdf", ".sdf", ".xml", ".mjcf", *SUFFIXES):
        formats = ".urdf .sdf .xml " + " ".join(SUFFIXES)
        raise InputError(Finding(f"'{kind}' is no format known here", formats, str(file)))
    name = plain_name(options.name or file_stem(file), "model")
    target = Path(name if folder is None else folder).absolute()
    _check_target(target, replace)
    target.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=f".{target.name}.", dir=target.parent) as temporary:
        made = Path(temporary) / target.name
        made.mkdir()
        path, report = _convert(file, kind, name, made, options)
        if target.exists():
            target.rename(Path(temporary) / "old")
        made.rename(target)
    return Conversion(target / path.name, report)


def _check_target(target: Path, replace: bool) -> None:
    if not target.exists():
        return
    ours = target.is_dir() and (target / _REPORT).is_file()
    if not (target.is_dir() and not any(target.iterdir())) and not (ours and replace):
        mend = "--replace does away with it" if ours else "name another folder by -o"
        raise InputError(Finding("the folder is there already", mend, str(target)))


def _convert(
    file: Path, kind: str, name: str, folder: Path, options: ConvertOptions
) -> tuple[Path, Report]:
    """Writes all of the model into a folder."""
    report = Report(file, "mesh" if kind in SUFFIXES else kind[1:].upper())
    locator = Locator(file, options.packages, options.root)
    meshes = MeshStore(folder, locator, options.scale, options.collision, report)
    source, version = Source(file), "1.9"
    if kind in SUFFIXES:
        model = mesh_model(file, meshes, options, report)
    else:
        if options.mass is not None:
            mend = "leave --mass away; --density fills in what has none"
            raise InputError(Finding("--mass is for a bare mesh", mend, str(file)))
        root = read_xml(file, source.findings)
        source.raise_findings()
        if root is None:
            raise InputError(Finding("the file is empty", "", str(file)))
        if root.tag in ("mujoco", "mujocoinclude"):
            report.format = "MJCF"
            model = mjcf_model(root, source, locator, meshes, report)
        elif root.tag == "sdf":
            report.format = "SDF"
            model = sdf_model(root, source)
            version = root.attributes.get("version", "1.9")
        else:
            report.format = "URDF"
            check_urdf(root, source)
            model = root
    model.attributes["name"] = name
    mend_tree(model, source, meshes, report, options)
    path = folder / f"{name}.{'urdf' if model.tag == 'robot' else 'sdf'}"
    _write_model(path, model, version)
    loaded = load(path)
    if loaded.overlaps:
        _keep_apart(model, loaded.overlaps, report)
        _write_model(path, model, version)
        loaded = load(path)
    for warning in loaded.warnings:
        report.add("note", "Drake", warning)
    for joint in loaded.off_zero:
        text = "its limits exclude zero, where Drake puts it: give default_joint_positions"
        report.add("note", f"joint {joint}", text)
    report.summary = dict(loaded.summary)
    report.write(folder)
    write_description(
        folder,
        title=name.replace("_", " "),
        category="object" if report.format == "mesh" else "other",
        description=f"Converted from {report.format}; report.md says what was changed.",
        sources=[file.name],
    )
    return path, report


def _write_model(path: Path, model: Element, version: str) -> None:
    if model.tag == "robot":
        root = model
        root.attributes.setdefault("xmlns:drake", "http://drake.mit.edu")
    else:
        root = make("sdf", model, version=version)
        root.attributes["xmlns:drake"] = "http://drake.mit.edu"
    write_atomic(path, xml_text(root))


def _keep_apart(model: Element, pairs: list[tuple[str, str]], report: Report) -> None:
    """Links that are in one another at rest never collide: else they would fly apart."""
    urdf = model.tag == "robot"
    prefix = f"{model.name}::"
    for i, pair in enumerate(pairs):
        links = [link.removeprefix(prefix) for link in pair]
        name = f"overlap_{i}"
        ignored = "drake:ignored_collision_filter_group"
        if urdf:
            members = [make("drake:member", link=link) for link in links]
            members.append(make(ignored, name=name))
        else:
            members = [make("drake:member", link) for link in links]
            members.append(make(ignored, name))
        model.children.append(make("drake:collision_filter_group", *members, name=name))
        text = "overlap where the joints rest: they never collide with one another"
        report.add("contact", " and ".join(links), text)
