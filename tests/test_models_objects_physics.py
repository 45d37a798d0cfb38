"""The household objects in simulation: at rest, in a heap, in the hand."""

from typing import Any

import numpy as np
import pytest
from object_scene import GripScene, bin_scene, floor_scene, vector
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix

from prehensile.models.generate import DATA, generators
from prehensile.models.shapes import read_gltf

OBJECTS = sorted(name for name, module in generators().items() if ".objects." in module)
FAST = ("foam_brick", "tomato_soup_can", "mustard_bottle")
QUARTER = np.pi / 2.0
POSES = {
    "upright": (0, 0, 0),
    "on its front": (0, QUARTER, 0),
    "on its back": (0, -QUARTER, 0),
    "on its left": (QUARTER, 0, 0),
    "on its right": (-QUARTER, 0, 0),
    "head down": (np.pi, 0, 0),
    "tilted": (0.5, 0.35, 0.2),
    "tumbling": (1.3, 0.4, 0.0),
}
STILL = 1e-6  # J


def _vertices(name: str) -> np.ndarray:
    parts = read_gltf(DATA / name / f"{name}.gltf")
    return np.concatenate([part.mesh.vertices for part in parts])


def _rotation(rpy: tuple[float, ...]) -> RotationMatrix:
    return RotationMatrix(RollPitchYaw(vector(*rpy)))


def _cases(*, fast_poses: tuple[str, ...]) -> list[Any]:
    cases = []
    for name in OBJECTS:
        for pose in POSES:
            if (name, pose) == ("mustard_bottle", "head down"):
                continue  # on the tip of its nozzle it balances for a while, then falls
            fast = name in FAST and pose in fast_poses
            marks = [] if fast else [pytest.mark.slow]
            cases.append(pytest.param(name, pose, marks=marks, id=f"{name} {pose}"))
    return cases


@pytest.mark.parametrize("time_step", [0.005, pytest.param(0.002, marks=pytest.mark.slow)])
@pytest.mark.parametrize(("name", "pose"), _cases(fast_poses=("upright", "on its front", "tilted")))
def test_object_comes_to_rest_on_the_floor(name, pose, time_step):
    """Dropped by 2 cm it lies still for a second within 5 s, its surface within 1 mm of the floor.

    Round objects lie like the prism they collide as: what is seen sinks or floats by up to
    0.75 mm (cans) or 1.05 mm (mug).
    """
    R_WO = _rotation(POSES[pose])
    vertices = _vertices(name)
    lowest = (vertices @ R_WO.matrix().T)[:, 2].min()
    scene = floor_scene(time_step, {"object": name})
    simulator = scene.simulator({"object": RigidTransform(R_WO, vector(0, 0, 0.02 - lowest))})
    still = 0.0
    while still < 1.0 and simulator.get_context().get_time() < 5.0:
        simulator.AdvanceTo(simulator.get_context().get_time() + 0.02)
        still = still + 0.02 if scene.energy(simulator) < STILL else 0.0
    assert still >= 1.0
    X_WO = scene.pose(simulator, "object")
    height = (vertices @ X_WO.rotation().matrix().T + X_WO.translation())[:, 2].min()
    assert -0.00105 < height < 0.001


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 6])
def test_ten_objects_in_a_bin_settle_inside(seed):
    rng = np.random.default_rng(seed)
    names = {f"object{k}": str(name) for k, name in enumerate(rng.choice(OBJECTS, 10))}
    scene = bin_scene(0.005, names)
    poses = {}
    for k, key in enumerate(names):
        rotation = _rotation(tuple(rng.uniform(-np.pi, np.pi, 3)))
        x, y = rng.uniform(-0.14, 0.14), rng.uniform(-0.08, 0.08)
        poses[key] = RigidTransform(rotation, vector(x, y, 0.15 + 0.15 * k))
    simulator = scene.simulator(poses)
    simulator.AdvanceTo(4.0)
    energies = []
    for _ in range(50):
        simulator.AdvanceTo(simulator.get_context().get_time() + 0.02)
        energies.append(scene.energy(simulator))
    assert np.median(energies) < 1e-4
    for key in names:
        x, y, z = scene.pose(simulator, key).translation()
        assert abs(x) < 0.28, names[key]
        assert abs(y) < 0.19, names[key]
        assert 0.0 < z < 0.6, names[key]
    query = scene.plant.get_geometry_query_input_port().Eval(
        scene.plant.GetMyContextFromRoot(simulator.get_context())
    )
    assert max(pair.depth for pair in query.ComputePointPairPenetration()) < 0.001


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[] if name in FAST else [pytest.mark.slow], id=name)
        for name in OBJECTS
    ],
)
def test_the_hand_holds_the_object(name):
    """The embedded hand lifts it by 0.12 m with 30 N without letting it slip by 2 mm."""
    lying = name in ("mustard_bottle", "bleach_cleanser")
    R_WO = _rotation((QUARTER, 0, 0) if lying else (0, 0, 0))
    heights = (_vertices(name) @ R_WO.matrix().T)[:, 2]
    tall = float(np.ptp(heights))
    # Where the fingers close: amid the banana's bow, on the mug's cup, below the bottle's grip.
    x, y = {"banana": (-0.03, 0.0), "mug": (0.0, 0.0155), "bleach_cleanser": (0.0, -0.035)}.get(
        name, (0.0, 0.0)
    )
    X_WO = RigidTransform(R_WO, vector(x, y, -heights.min()))
    pad_height = max(0.0175, 0.5 * tall, tall - 0.035)
    rise, slip = GripScene(0.005, name).run(X_WO, pad_height, 30.0)
    assert rise == pytest.approx(0.12, abs=0.003)
    assert slip < 0.002
