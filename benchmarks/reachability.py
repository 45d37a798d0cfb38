"""Forward kinematics, Jacobians and reachability maps of the iiwa 7, one thread."""

from pathlib import Path

import numpy as np

from benchmarks.framework import Contender, Results, Samples, time_calls

TITLE = "Kinematics of the iiwa 7: its flange in random configurations, one thread"
POSES = "poses, per second"
JACOBIANS = "Jacobians, per second"
MAP = "reachability map, configurations per second"
CALL = "a pose and Jacobian, per call from Python"
_SAMPLES = 1_000_000
_LOOP = 3_000


def prepare(folder: Path) -> None:
    """Nothing to write: everybody samples for themselves."""
    del folder


def _plant():
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import MultibodyPlant

    from prehensile.models.registry import package_map

    plant = MultibodyPlant(0.0)
    parser = Parser(plant)
    parser.package_map().AddMap(package_map())
    parser.AddModels(url="package://prehensile/iiwa7/iiwa7.sdf")
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("iiwa_link_0"))
    plant.Finalize()
    return plant, plant.GetFrameByName("iiwa_link_7")


def _rate(number: int, seconds: list[float]) -> Samples:
    return Samples([number / s for s in seconds], "/s", more_is_better=True)


def ours(folder: Path) -> Results:
    """The native tree: batches, single calls, and maps at 5 cm."""
    from prehensile.kinematics.reachability import ReachabilityConfig, reachability_map
    from prehensile.kinematics.tree import tree_from_plant

    del folder
    plant, F = _plant()
    compiled = tree_from_plant(plant, [F])
    tree = compiled.tree
    Q = np.random.default_rng(0).uniform(compiled.lower, compiled.upper, (100_000, 7))
    config = ReachabilityConfig(num_samples=_SAMPLES)

    def loop() -> None:
        for q in Q[:_LOOP]:
            tree.pose_and_jacobian(q)

    calls = time_calls(loop, repeats=5)
    return {
        POSES: _rate(len(Q), time_calls(lambda: tree.poses(Q), repeats=5)),
        JACOBIANS: _rate(len(Q), time_calls(lambda: tree.jacobians(Q), repeats=5)),
        CALL: Samples([1e6 * s / _LOOP for s in calls], "µs"),
        MAP: _rate(_SAMPLES, time_calls(lambda: reachability_map(compiled, config), repeats=2)),
    }


def drake(folder: Path) -> Results:
    """``MultibodyPlant`` in a loop of Python, the map with NumPy per configuration."""
    from pydrake.multibody.tree import JacobianWrtVariable

    from prehensile.kinematics.reachability import fibonacci_directions

    del folder
    plant, F = _plant()
    W = plant.world_frame()
    context = plant.CreateDefaultContext()
    lower, upper = plant.GetPositionLowerLimits(), plant.GetPositionUpperLimits()
    Q = np.random.default_rng(0).uniform(lower, upper, (_LOOP, 7))
    directions = fibonacci_directions(64)

    def pose(q: np.ndarray):
        plant.SetPositions(context, q)
        return F.CalcPoseInWorld(context)

    def jacobian(q: np.ndarray) -> np.ndarray:
        plant.SetPositions(context, q)
        return plant.CalcJacobianSpatialVelocity(
            context, JacobianWrtVariable.kV, F, [0, 0, 0], W, W
        )

    def both(q: np.ndarray) -> np.ndarray:
        pose(q)
        return plant.CalcJacobianSpatialVelocity(
            context, JacobianWrtVariable.kV, F, [0, 0, 0], W, W
        )

    def make_map() -> None:
        voxels: dict[tuple[int, ...], list] = {}
        for q in Q:
            X_WF = pose(q)
            J = plant.CalcJacobianSpatialVelocity(
                context, JacobianWrtVariable.kV, F, [0, 0, 0], W, W
            )
            J[3:] /= 0.5
            sigma = np.linalg.svd(J, compute_uv=False)
            voxel = tuple(np.floor(X_WF.translation() / 0.05).astype(int))
            seen = voxels.setdefault(voxel, [0, set(), 0.0, 0.0])
            seen[0] += 1
            seen[1].add(int(np.argmax(directions @ X_WF.rotation().matrix()[:, 2])))
            seen[2] = max(seen[2], float(np.prod(sigma)))
            seen[3] = max(seen[3], float(sigma[-1]))

    def each(one) -> list[float]:
        return time_calls(lambda: [one(q) for q in Q], repeats=5)

    return {
        POSES: _rate(_LOOP, each(pose)),
        JACOBIANS: _rate(_LOOP, each(jacobian)),
        CALL: Samples([1e6 * s / _LOOP for s in each(both)], "µs"),
        MAP: _rate(_LOOP, time_calls(make_map, repeats=5)),
    }


CONTENDERS = (Contender("prehensile", ours), Contender("Drake", drake))
