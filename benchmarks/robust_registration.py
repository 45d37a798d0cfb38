"""Poses from correspondences of which nearly all are wrong, by the solver alone.

As in the experiments of TEASER (Yang, Shi and Carlone, IEEE T-RO 37(2), 2021): points of the
Stanford bunny (found in the peer ``manipulation`` where it is installed, else points of a surface
like it), scaled to a unit cube, turned and moved at random, Gaussian noise of 0.01; the wrong ones
are replaced by points in a ball of radius 5. TEASER++ is not on the package index: it runs where
``teaserpp_python`` can be imported by the Python of its environment.
"""

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.framework import ROOT, Contender, Results, Samples, time_calls

TITLE = "Registration of correspondences, 99 % wrong, solver alone, one thread"
NOISE = 0.01
NOISE_BOUND = 5.54 * NOISE
TRIALS = {1000: 30, 5000: 10}


def prepare(folder: Path) -> None:
    """Writes (trials, N, 3) model and scene points, and the poses (trials, 4, 4)."""
    shape = _shape()
    for count, trials in TRIALS.items():
        models, scenes, poses = [], [], []
        for trial in range(trials):
            rng = np.random.default_rng([trial, count])
            model = shape[rng.choice(len(shape), count, replace=len(shape) < count)]
            q = rng.normal(size=4)
            w, x, y, z = q / np.linalg.norm(q)
            K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
            X = np.eye(4)
            X[:3, :3] += 2 * w * K + 2 * K @ K
            X[:3, 3] = rng.uniform(-1, 1, 3)
            scene = model @ X[:3, :3].T + X[:3, 3] + rng.normal(0, NOISE, model.shape)
            wrong = rng.permutation(count)[: round(0.99 * count)]
            ways = rng.normal(size=(len(wrong), 3))
            ways /= np.linalg.norm(ways, axis=1, keepdims=True)
            scene[wrong] = 5 * ways * rng.uniform(size=(len(wrong), 1)) ** (1 / 3)
            models.append(model)
            scenes.append(scene)
            poses.append(X)
        np.save(folder / f"model_{count}.npy", models)
        np.save(folder / f"scene_{count}.npy", scenes)
        np.save(folder / f"poses_{count}.npy", poses)


def _shape() -> np.ndarray:
    found = sorted(ROOT.glob("build/peers/*/lib/python3*/site-packages/manipulation/models/bunny"))
    if found:
        points = np.load(found[0] / "bunny.npy")
        points = points.T if points.shape[0] == 3 else points
    else:
        rng = np.random.default_rng(0)
        ways = rng.normal(size=(6000, 3))
        ways /= np.linalg.norm(ways, axis=1, keepdims=True)
        bumps = 1 + 0.4 * np.sin(3 * ways[:, :1] + 1) * np.cos(2 * ways[:, 1:2]) + 0.3 * ways[:, 2:]
        points = ways * bumps * [1, 0.8, 0.7]
    points = points - points.mean(axis=0)
    return points / np.ptp(points, axis=0).max()


def _measure(
    folder: Path,
    solve: Callable[[Any, Any], np.ndarray | None],
    repeats: int = 3,
    convert: Callable[[np.ndarray], Any] = np.ascontiguousarray,
) -> Results:
    """Time of each trial, and in how many the pose is right: within 5 degrees and 0.1."""
    results = {}
    for count in TRIALS:
        seconds, right = [], []
        arrays = [np.load(folder / f"{name}_{count}.npy") for name in ("model", "scene", "poses")]
        for model, scene, truth in zip(*arrays, strict=True):
            a, b = convert(model), convert(scene)
            seconds += time_calls(lambda a=a, b=b: solve(a, b), repeats)
            X = solve(a, b)
            right.append(100.0 if X is not None and _is_right(X, truth) else 0.0)
        results[f"{count} correspondences"] = Samples(seconds, "s")
        results[f"{count} correspondences, right"] = Samples(
            [float(np.mean(right))], "%", more_is_better=True
        )
    return results


def _is_right(X: np.ndarray, truth: np.ndarray) -> bool:
    cosine = (np.trace(X[:3, :3].T @ truth[:3, :3]) - 1) / 2
    near = np.linalg.norm(X[:3, 3] - truth[:3, 3]) < 0.1
    return bool(near and cosine > np.cos(np.radians(5)))


def ours(folder: Path) -> Results:
    """``register_correspondences``."""
    from prehensile.perception.registration import register_correspondences

    def solve(model: np.ndarray, scene: np.ndarray) -> np.ndarray | None:
        result = register_correspondences(model, scene, NOISE_BOUND)
        return result.X_WO.GetAsMatrix4() if result.succeeded and result.X_WO else None

    return _measure(folder, solve)


def our_ransac(folder: Path) -> Results:
    """``ransac_pose``, 100 000 samples."""
    from prehensile.perception.registration import ransac_pose

    def solve(model: np.ndarray, scene: np.ndarray) -> np.ndarray | None:
        result = ransac_pose(model, scene, NOISE_BOUND)
        return result.X_WO.GetAsMatrix4() if result.X_WO else None

    return _measure(folder, solve, repeats=1)


def kiss_matcher(folder: Path) -> Results:
    """``KISSMatcher.prune_and_solve`` on matched points; its noise bounds are ours."""
    os.environ["OMP_NUM_THREADS"] = "1"
    import kiss_matcher  # pyright: ignore[reportMissingImports]

    config = kiss_matcher.KISSMatcherConfig(NOISE_BOUND)
    config.robin_noise_bound = NOISE_BOUND
    config.solver_noise_bound = NOISE_BOUND
    config.num_max_corr = 5000

    def solve(model: list[np.ndarray], scene: list[np.ndarray]) -> np.ndarray | None:
        matcher = kiss_matcher.KISSMatcher(config)
        solution = matcher.prune_and_solve(model, scene)
        X = np.eye(4)
        X[:3, :3] = solution.rotation
        X[:3, 3] = np.ravel(solution.translation)
        return X if solution.valid else None

    # It takes lists of points; making them is not its solver's work.
    return _measure(folder, solve, convert=lambda points: list(points.astype(np.float32)))


def teaser(folder: Path) -> Results:
    """TEASER++ with the parameters of its own example."""
    import teaserpp_python  # pyright: ignore[reportMissingImports]

    params = teaserpp_python.RobustRegistrationSolver.Params()
    params.cbar2 = 1
    params.noise_bound = NOISE_BOUND
    params.estimate_scaling = False
    params.rotation_gnc_factor = 1.4
    params.rotation_max_iterations = 100
    params.rotation_cost_threshold = 1e-12

    def solve(model: np.ndarray, scene: np.ndarray) -> np.ndarray | None:
        solver = teaserpp_python.RobustRegistrationSolver(params)
        solver.solve(model.T, scene.T)
        solution = solver.getSolution()
        X = np.eye(4)
        X[:3, :3] = solution.rotation
        X[:3, 3] = np.ravel(solution.translation)
        return X

    return _measure(folder, solve, repeats=1)


CONTENDERS = (
    Contender("prehensile", ours),
    Contender("prehensile RANSAC", our_ransac),
    Contender("KISS-Matcher", kiss_matcher, requirements=("kiss-matcher==1.0.2", "numpy")),
    Contender("TEASER++", teaser),
)
