"""All solutions of inverse kinematics in closed form: a UR5 and an iiwa 14."""

import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.framework import Contender, Results, Samples

TITLE = "Analytic inverse kinematics, all branches, one thread, per pose"
POSES = 1000
UR = "UR5"
LOCKED = "iiwa 14, joint 3 locked at 0"
IIWA = "iiwa 14 (ours: at an arm angle; theirs: joint 3 locked at 0)"

# Axes and the way from each to the next (m), of the makers' drawings; the last to the flange.
X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
_UR5 = {
    "H": [Z, Y, Y, Y, (0.0, 0.0, -1.0), Y],
    "P": [
        (0, 0, 0.089159),
        (0, 0.13585, 0),
        (0.425, -0.1197, 0),
        (0.39225, 0, 0),
        (0, 0.093, 0),
        (0, 0, -0.09465),
        (0, 0.0823, 0),
    ],
}
_IIWA14 = {
    "H": [Z, Y, Z, (0.0, -1.0, 0.0), Z, Y, Z],
    "P": [(0, 0, 0.36), (0,) * 3, (0, 0, 0.42), (0,) * 3, (0, 0, 0.4), (0,) * 3, (0,) * 3]
    + [(0, 0, 0.126)],
}


def prepare(folder: Path) -> None:
    """Writes the arms, and for each random configurations, whose poses are to be reached."""
    rng = np.random.default_rng(0)
    # Joint 3 locked: its axis goes and the way over it stays.
    locked = {"H": [*_IIWA14["H"][:2], *_IIWA14["H"][3:]]}
    ways = np.array(_IIWA14["P"], dtype=float)
    locked["P"] = [*ways[:2], ways[2] + ways[3], *ways[4:]]
    for name, arm in ((UR, _UR5), (LOCKED, locked), (IIWA, _IIWA14)):
        H, P = np.array(arm["H"], dtype=float), np.array(arm["P"], dtype=float)
        q = rng.uniform(-2.5, 2.5, (POSES, len(H)))
        # The poses that the peer's user would reach: with joint 3 locked.
        if name == IIWA:
            q[:, 2] = 0.0
        X_WG = np.stack([_pose(H, P, row) for row in q])
        np.savez(folder / _file(name), H=H, P=P, q=q, X_WG=X_WG)


def _pose(H: np.ndarray, P: np.ndarray, q: np.ndarray) -> np.ndarray:
    X_WG = np.eye(4)
    for axis, way, angle in zip(H, P, q, strict=False):
        K = np.cross(np.eye(3), axis)
        R = np.eye(3) - np.sin(angle) * K + (1 - np.cos(angle)) * K @ K
        X_WG[:3, 3] += X_WG[:3, :3] @ way
        X_WG[:3, :3] = X_WG[:3, :3] @ R
    X_WG[:3, 3] += X_WG[:3, :3] @ P[-1]
    return X_WG


def _file(name: str) -> str:
    return f"{name.split(' (')[0]}.npz"


def _load(folder: Path, name: str) -> dict[str, np.ndarray]:
    with np.load(folder / _file(name)) as arrays:
        return dict(arrays)


def _measure(
    name: str,
    solve: Callable[[], object],
    solve_and_read: Callable[[], object],
    batch: Callable[[], object],
    solutions: float,
) -> dict[str, Samples]:
    """Of three ways to go through all poses, the first two by a loop of calls."""

    def per_pose(call: Callable[[], object]) -> Samples:
        # Of the processor: the calls are so short that any other program would show in wall time.
        microseconds = []
        for _ in range(25):
            start = time.process_time()
            call()
            microseconds.append(1e6 * (time.process_time() - start) / POSES)
        return Samples(microseconds[1:], "µs")

    return {
        f"{name}: a call": per_pose(solve),
        f"{name}: a call, solutions read": per_pose(solve_and_read),
        f"{name}: in a batch": per_pose(batch),
        f"{name}: solutions": Samples([solutions], "a pose", more_is_better=True),
    }


def ours(folder: Path) -> Results:
    """``solve`` and ``solve_batch``; every solution is checked by forward kinematics."""
    from prehensile.native.analytic_ik import PieperArm, SrsArm, UrArm

    def arm_of(kind: Callable[..., Any], data: dict[str, np.ndarray]) -> Any:
        points = np.cumsum(data["P"], axis=0)
        X_WG0 = np.eye(4)
        X_WG0[:3, 3] = points[-1]
        limit = np.full(len(data["H"]), np.pi)
        return kind(data["H"], points[:-1].copy(), X_WG0, -limit, limit)

    def measure(name: str, arm: Any, X_WG: np.ndarray) -> dict[str, Samples]:
        solve, poses = arm.solve, list(X_WG)

        def each() -> None:
            for X in poses:
                solve(X)

        def each_read() -> None:
            for X in poses:
                solve(X).q  # noqa: B018

        return _measure(name, each, each_read, lambda: arm.solve_batch(X_WG), check(arm, X_WG))

    def measure_srs(name: str, arm: SrsArm, X_WG: np.ndarray) -> dict[str, Samples]:
        solve, poses, psi = arm.solve, list(X_WG), np.zeros(POSES)

        def each() -> None:
            for X in poses:
                solve(X, 0.0)

        def each_read() -> None:
            for X in poses:
                solve(X, 0.0).q  # noqa: B018

        count = check(arm, X_WG, 0.0)
        return _measure(name, each, each_read, lambda: arm.solve_batch(X_WG, psi), count)

    def check(arm: Any, poses: np.ndarray, *psi: float) -> float:
        found = [arm.solve(X_WG, *psi).q for X_WG in poses]
        for X_WG, rows in zip(poses, found, strict=True):
            assert all(np.abs(arm.pose(q) - X_WG).max() < 1e-9 for q in rows)
        return float(np.mean([len(rows) for rows in found]))

    results: dict[str, Samples] = {}
    for name, kind in ((UR, UrArm), (LOCKED, PieperArm), (IIWA, SrsArm)):
        data = _load(folder, name)
        arm = arm_of(kind, data)
        results |= (measure_srs if kind is SrsArm else measure)(name, arm, data["X_WG"])
    return results


def eaik(folder: Path) -> Results:
    """``IK`` and ``IK_batched``; approximate solutions are not counted."""
    from eaik.IK_HP import HPRobot  # pyright: ignore[reportMissingImports]

    def measure(name: str, robot: Any, poses: list[np.ndarray]) -> dict[str, Samples]:
        solve = robot.IK

        def each() -> None:
            for X in poses:
                solve(X)

        def each_read() -> None:
            for X in poses:
                solve(X).Q  # noqa: B018

        exact = [len(got.Q) - int(np.sum(got.is_LS)) for got in map(solve, poses)]
        batch = partial(robot.IK_batched, poses, 1)
        return _measure(name, each, each_read, batch, float(np.mean(exact)))

    results: dict[str, Samples] = {}
    for name in (UR, LOCKED, IIWA):
        data = _load(folder, name)
        robot = HPRobot(data["H"], data["P"], fixed_axes=[(2, 0.0)] if name == IIWA else [])
        results |= measure(name, robot, list(data["X_WG"]))
    return results


CONTENDERS = (
    Contender("prehensile", ours),
    Contender("EAIK", eaik, requirements=("EAIK==1.2.2",)),
)
