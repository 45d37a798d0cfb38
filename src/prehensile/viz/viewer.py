"""Looking at a plant: a slider for each joint, buttons that show and hide kinds of geometry."""

import time
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import Meshcat, Rgba, Sphere
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BodyIndex
from pydrake.systems.framework import Diagram

from prehensile.viz.live import STOP_BUTTON, STOP_KEY
from prehensile.viz.sliders import add_sliders, joint_sliders, read_sliders, remove_sliders

# Seconds between two looks at the sliders.
_PERIOD = 0.04
_SPHERES = "spheres"
_SPHERE_COLOR = Rgba(0.15, 0.5, 0.9, 0.45)
# Button, key, Meshcat path, shown at first.
_LAYERS = (
    ("Visual geometry (V)", "KeyV", "illustration", True),
    ("Collision geometry (C)", "KeyC", "proximity", False),
)


def draw_spheres(
    meshcat: Meshcat, plant: MultibodyPlant, spheres: Mapping[BodyIndex, NDArray[np.float64]]
) -> None:
    """Puts sphere models on the page; :func:`place_spheres` moves them.

    Args:
        meshcat: the page.
        plant: names the bodies.
        spheres: (K, 4) rows of centre and radius in the frame of the body, by body.
    """
    for index, rows in spheres.items():
        path = f"{_SPHERES}/{plant.get_body(index).scoped_name()}"
        for i, (x, y, z, radius) in enumerate(rows):
            meshcat.SetObject(f"{path}/{i}", Sphere(radius), _SPHERE_COLOR)
            meshcat.SetTransform(f"{path}/{i}", RigidTransform(np.array([x, y, z])))


def view(
    diagram: Diagram,
    plant: MultibodyPlant,
    meshcat: Meshcat,
    *,
    spheres: Mapping[BodyIndex, NDArray[np.float64]] | None = None,
    duration: float = np.inf,
) -> NDArray[np.float64]:
    """Shows a diagram with sliders for its joints, until the stop button or Ctrl-C.

    Args:
        diagram: holds ``plant`` and visualizers for the paths "illustration" and "proximity".
        plant: the plant whose joints are moved.
        meshcat: the page.
        spheres: as in :func:`draw_spheres`.
        duration: wall-clock seconds after which it ends by itself.

    Returns:
        (num_positions,) the positions at the end.
    """
    context = diagram.CreateDefaultContext()
    plant_context = plant.GetMyMutableContextFromRoot(context)
    q = plant.GetPositions(plant_context)
    joints = joint_sliders(plant, q)
    sliders = [slider for _, slider in joints]
    layers = [*_LAYERS, *([("Spheres (X)", "KeyX", _SPHERES, True)] if spheres else [])]
    diagram.ExecuteInitializationEvents(context)
    draw_spheres(meshcat, plant, spheres or {})
    add_sliders(meshcat, sliders)
    for button, key, _, _ in layers:
        meshcat.AddButton(button, key)
    meshcat.AddButton(STOP_BUTTON, STOP_KEY)
    shown: list[bool | None] = [None] * len(layers)
    published = False
    end = time.monotonic() + duration
    try:
        while time.monotonic() < end and meshcat.GetButtonClicks(STOP_BUTTON) == 0:
            for i, (button, _, path, at_first) in enumerate(layers):
                wanted = (meshcat.GetButtonClicks(button) % 2 == 0) == at_first
                if wanted != shown[i]:
                    meshcat.SetProperty(path, "visible", wanted)
                    shown[i] = wanted
            values = read_sliders(meshcat, sliders)
            for (joint, _), value in zip(joints, values, strict=True):
                q[joint.position_start()] = value
            if not published or not np.array_equal(q, plant.GetPositions(plant_context)):
                plant.SetPositions(plant_context, q)
                diagram.ForcedPublish(context)
                for index in spheres or {}:
                    body = plant.get_body(index)
                    X_WB = plant.EvalBodyPoseInWorld(plant_context, body)
                    meshcat.SetTransform(f"{_SPHERES}/{body.scoped_name()}", X_WB)
                published = True
            time.sleep(_PERIOD)
    finally:
        remove_sliders(meshcat, sliders)
        for name in (STOP_BUTTON, *(button for button, _, _, _ in layers)):
            meshcat.DeleteButton(name, strict=False)
    return q
