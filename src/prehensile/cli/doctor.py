"""``prehensile doctor``: what this machine has, what it lacks, and what to do about it."""

import argparse
import importlib.metadata
import os
import platform
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass

from rich.console import Console

import prehensile

BROWSERS = (
    "firefox",
    "chromium",
    "chromium-browser",
    "google-chrome",
    "microsoft-edge",
)


@dataclass(frozen=True)
class Check:
    """What one look at the machine found.

    Attributes:
        subject: what was looked at.
        text: what was found, in words.
        missing: whether something is lacking.
        needed: whether prehensile does not work without it.
        mend: what to do about it, if something is lacking.
    """

    subject: str
    text: str
    missing: bool = False
    needed: bool = False
    mend: str = ""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds nothing: the command has no arguments."""
    parser.description = (
        "Says in words what this machine lacks. The exit status is 1 if something is missing "
        "that prehensile needs; what is merely useful does not count."
    )


def run(args: argparse.Namespace) -> int:
    """Prints one line for each check.

    Returns:
        0, or 1 if something needed is missing.
    """
    del args
    console = Console(highlight=False)
    checks = []
    for look in CHECKS:
        with console.status(look.__doc__ or ""):
            check = look()
        checks.append(check)
        mark = (
            "[green]✓[/]" if not check.missing else "[red]✗[/]" if check.needed else "[yellow]–[/]"
        )
        console.print(f"{mark} [bold]{check.subject}[/]: ", end="")
        console.print(check.text, markup=False)
        if check.mend:
            console.print(f"    {check.mend}", markup=False, style="dim")
    lacking = [c.subject for c in checks if c.missing and c.needed]
    if lacking:
        console.print(f"[red]Missing:[/] {', '.join(lacking)}.")
        return 1
    console.print("Everything that prehensile needs is here.")
    return 0


def check_python() -> Check:
    """Python"""
    text = f"{platform.python_version()} on {platform.system()} {platform.machine()}"
    if (3, 11) <= sys.version_info[:2] <= (3, 13):
        return Check("Python", text)
    return Check("Python", text, True, True, "Use Python 3.11, 3.12 or 3.13.")


def check_packages() -> Check:
    """Packages"""
    versions = [f"prehensile {prehensile.__version__}"]
    lacking = []
    for name in ("drake", "numpy", "scipy", "pyyaml", "rich", "pillow"):
        try:
            versions.append(f"{name} {importlib.metadata.version(name)}")
        except importlib.metadata.PackageNotFoundError:
            lacking.append(name)
    text = ", ".join(versions)
    if lacking:
        mend = f"Install them: pip install {' '.join(lacking)}"
        return Check("Packages", f"{text}; without {', '.join(lacking)}", True, True, mend)
    return Check("Packages", text)


def check_drake() -> Check:
    """Drake"""
    error = _failure_of("import pydrake.systems.framework, pydrake.multibody.plant")
    if error is None:
        return Check("Drake", "can be imported")
    return Check(
        "Drake",
        f"cannot be imported: {error}",
        True,
        True,
        "Drake needs some system libraries; on Debian and Ubuntu: "
        "apt install libx11-6 libsm6 libglib2.0-0 libgl1 libegl1",
    )


def check_native() -> Check:
    """Compiled kernels"""
    error = _failure_of("import prehensile.native")
    if error is not None:
        mend = "Install the package again: pip install . (it needs a C++20 compiler)."
        return Check("Compiled kernels", f"cannot be loaded: {error}", True, True, mend)
    from prehensile.native import simd_levels

    levels = simd_levels()
    text = f"loaded, using SIMD level {levels[-1]} (this processor can do {', '.join(levels)})"
    return Check("Compiled kernels", text)


def check_models() -> Check:
    """Embedded models"""
    mend = "Install the package again; in a clone, `make models` generates them anew."
    try:
        from prehensile.models.registry import list_models

        names = [
            model.name for model in list_models() if model.url.startswith("package://prehensile/")
        ]
    except Exception as error:
        return Check("Embedded models", f"cannot be listed: {error}", True, True, mend)
    if not names:
        return Check("Embedded models", "there are none", True, True, mend)
    error = _failure_of("from prehensile.cli.doctor import parse_models; parse_models()")
    if error is not None:
        return Check("Embedded models", f"one cannot be parsed: {error}", True, True, mend)
    return Check("Embedded models", f"all {len(names)} are present and can be parsed")


def check_rendering() -> Check:
    """Rendering of camera images"""
    subject = "Rendering of camera images"
    error = _failure_of("from prehensile.cli.doctor import render_probe; render_probe()")
    if error is None:
        return Check(subject, "works without a display (VTK)")
    mend = (
        "Simulated cameras need OpenGL through EGL; on Debian and Ubuntu: "
        "apt install libegl1 libgl1 libgl1-mesa-dri"
    )
    return Check(subject, f"fails: {error}", True, True, mend)


def check_compiler() -> Check:
    """C++20 compiler"""
    program = (
        "#include <concepts>\n#include <span>\nint main() { return std::span<int>().size(); }\n"
    )
    found = []
    for name in (os.environ.get("CXX", ""), "c++", "g++", "clang++"):
        path = shutil.which(name) if name else None
        if path is None:
            continue
        command = [path, "-std=c++20", "-fsyntax-only", "-x", "c++", "-"]
        if subprocess.run(command, input=program, capture_output=True, text=True).returncode == 0:
            return Check("C++20 compiler", path)
        found.append(path)
    text = f"{', '.join(found)} cannot compile C++20" if found else "there is none"
    mend = "Only needed to build prehensile from source; on Debian and Ubuntu: apt install g++"
    return Check("C++20 compiler", text, missing=True, mend=mend)


def check_display() -> Check:
    """Display"""
    if platform.system() == "Darwin":
        return Check("Display", "macOS has one of its own")
    for variable in ("WAYLAND_DISPLAY", "DISPLAY"):
        if os.environ.get(variable):
            return Check("Display", f"{variable}={os.environ[variable]}")
    mend = "None is needed: scenes are shown in a web page, which another machine can open too."
    return Check("Display", "there is none", missing=True, mend=mend)


def check_browser() -> Check:
    """Web browser"""
    if platform.system() == "Darwin":
        return Check("Web browser", "macOS has one of its own")
    for name in BROWSERS:
        if shutil.which(name):
            return Check("Web browser", name)
    mend = "To watch, forward the port of the page: ssh -L 7000:localhost:7000 THIS-MACHINE"
    return Check("Web browser", "there is none", missing=True, mend=mend)


def check_cores() -> Check:
    """Processor"""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return Check("Processor", f"{cores} core{'s' if cores != 1 else ''} for this process")


CHECKS: tuple[Callable[[], Check], ...] = (
    check_python,
    check_packages,
    check_drake,
    check_native,
    check_models,
    check_rendering,
    check_compiler,
    check_display,
    check_browser,
    check_cores,
)


def parse_models() -> None:
    """Parses each embedded model with Drake; raises if one cannot be parsed."""
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import MultibodyPlant

    from prehensile.models.registry import list_models, package_map

    for model in list_models():
        plant = MultibodyPlant(time_step=0.0)
        parser = Parser(plant)
        parser.package_map().AddMap(package_map())
        parser.AddModels(url=model.url)
        plant.Finalize()


def render_probe() -> None:
    """Renders a red ball in 32 by 24 pixels with Drake's VTK engine; raises if it is not red."""
    from pydrake.geometry import (
        ClippingRange,
        ColorRenderCamera,
        GeometryInstance,
        MakeRenderEngineVtk,
        PerceptionProperties,
        RenderCameraCore,
        RenderEngineVtkParams,
        Rgba,
        SceneGraph,
        Sphere,
    )
    from pydrake.math import RigidTransform
    from pydrake.systems.sensors import CameraInfo

    scene_graph = SceneGraph()
    scene_graph.AddRenderer("vtk", MakeRenderEngineVtk(RenderEngineVtkParams()))
    ball = GeometryInstance(RigidTransform([0, 0, 1]), Sphere(0.3), "ball")
    properties = PerceptionProperties()
    properties.AddProperty("phong", "diffuse", Rgba(1, 0, 0))
    ball.set_perception_properties(properties)
    scene_graph.RegisterAnchoredGeometry(scene_graph.RegisterSource("doctor"), ball)
    query = scene_graph.get_query_output_port().Eval(scene_graph.CreateDefaultContext())
    core = RenderCameraCore(
        "vtk", CameraInfo(32, 24, 0.8), ClippingRange(0.1, 10), RigidTransform()
    )
    image = query.RenderColorImage(
        ColorRenderCamera(core), scene_graph.world_frame_id(), RigidTransform()
    )
    red, green, _, _ = image.at(16, 12)
    if not (red > 100 and green < 60):
        raise RuntimeError(f"a red ball came out as red {red}, green {green}")


def _failure_of(code: str) -> str | None:
    """Runs Python code in a process of its own, so that a crash is an answer too.

    Returns:
        None if it went well, else what went wrong.
    """
    try:
        done = subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, timeout=120
        )
    except subprocess.TimeoutExpired:
        return "no answer within two minutes"
    if done.returncode == 0:
        return None
    if done.returncode < 0:
        return f"the process was ended by signal {-done.returncode}"
    lines = done.stderr.strip().splitlines()
    return lines[-1] if lines else f"exit status {done.returncode}"
