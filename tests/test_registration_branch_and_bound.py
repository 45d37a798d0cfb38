"""Branch and bound against dense sampling of all poses."""

import numpy as np
import pytest
from pydrake.math import RollPitchYaw
from scipy.optimize import minimize
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from prehensile.perception.registration import RegistrationStatus, branch_and_bound


def _cost(R, p, scene, tree, max_distance):
    return (np.minimum(tree.query(scene @ R.T + p)[0], max_distance) ** 2).sum()


def _sampled_minimum(scene, model, max_distance, rng):
    """Least cost over many random poses, the best of them followed downhill."""
    tree, dimension = cKDTree(model), model.shape[1]
    center = scene.mean(axis=0)

    def pose(v):
        if dimension == 2:
            c, s = np.cos(v[0]), np.sin(v[0])
            return np.array([[c, -s], [s, c]]), v[1:]
        return Rotation.from_rotvec(v[:3]).as_matrix(), v[3:]

    def cost(v):
        R, p = pose(v)
        return _cost(R, p, scene - center, tree, max_distance)

    count = 300 if dimension == 2 else 1500
    turns = (
        rng.uniform(-np.pi, np.pi, (count, 1))
        if dimension == 2
        else Rotation.random(count, random_state=rng).as_rotvec()
    )
    places = rng.uniform(model.min(axis=0), model.max(axis=0), (count, dimension))
    starts = np.concatenate([turns, places], axis=1)
    starts = starts[np.argsort([cost(v) for v in starts])[:10]]
    options = {"maxfev": 400, "xatol": 1e-6, "fatol": 1e-9}
    return min(minimize(cost, v, method="Nelder-Mead", options=options).fun for v in starts)


@pytest.mark.parametrize("max_distance", [np.inf, 0.2])
@pytest.mark.parametrize("seed", range(3))
def test_plane_no_sampled_pose_is_better_by_more_than_the_gap(seed, max_distance):
    # Clouds that have nothing to do with each other: the optimum is nowhere special.
    rng = np.random.default_rng(seed)
    scene, model = rng.uniform(-1, 1, (8, 2)), rng.uniform(-1, 1, (14, 2))
    result = branch_and_bound(scene, model, gap_distance=0.02, max_distance=max_distance)
    assert result.status is RegistrationStatus.SUCCESS
    assert result.gap <= 8 * 0.02**2 + 1e-12
    assert 0 < result.lower_bound <= result.cost
    sampled = _sampled_minimum(scene, model, max_distance, rng)
    assert result.lower_bound <= sampled + 1e-9
    assert result.cost <= sampled + result.gap
    X_OW = result.X_WO.inverse().GetAsMatrix4()
    again = _cost(X_OW[:2, :2], X_OW[:2, 3], scene, cKDTree(model), max_distance)
    assert again == pytest.approx(result.cost)
    assert np.allclose(X_OW[2], [0, 0, 1, 0])


def test_space_no_sampled_pose_is_better_by_more_than_the_gap():
    rng = np.random.default_rng(5)
    scene, model = rng.uniform(-1, 1, (5, 3)), rng.uniform(-1, 1, (7, 3))
    result = branch_and_bound(scene, model, gap_distance=0.2)
    assert result.succeeded
    assert result.lower_bound > 0
    assert result.cost <= _sampled_minimum(scene, model, np.inf, rng) + result.gap


@pytest.mark.parametrize("outliers", [0, 4])
def test_space_finds_a_pose_far_from_the_first_guess(outliers):
    rng = np.random.default_rng(3)
    model = rng.uniform(-1, 1, (30, 3)) * [1, 0.7, 0.5]
    R = RollPitchYaw(2.5, -1.0, 2.0).ToRotationMatrix().matrix()
    scene = model[:12] @ R.T + [0.3, -2, 5] + rng.normal(0, 0.005, (12, 3))
    if outliers:
        scene[:outliers] += rng.uniform(1.5, 2, (outliers, 3))
    result = branch_and_bound(
        scene,
        model,
        gap_distance=0.05,
        max_distance=0.15 if outliers else np.inf,
        time_limit=20,
    )
    assert result.succeeded
    X = result.X_WO.GetAsMatrix4()
    assert np.linalg.norm(X[:3, :3] - R) < 0.05
    assert np.allclose(X[:3, 3], [0.3, -2, 5], atol=0.03)
    assert result.inliers.sum() == 12 - outliers


def test_limits_leave_a_pose_and_a_bound_that_holds():
    rng = np.random.default_rng(1)
    scene, model = rng.uniform(-1, 1, (10, 3)), rng.uniform(-1, 1, (15, 3))
    few = branch_and_bound(scene, model, gap_distance=1e-3, max_nodes=8)
    assert few.status is RegistrationStatus.NOT_CONVERGED
    assert few.nodes <= 8
    more = branch_and_bound(scene, model, gap_distance=0.1, time_limit=0.5)
    assert few.lower_bound <= more.cost
    assert more.cost <= few.cost
    assert few.gap > 10 * 1e-6
    assert few.message


def test_bad_input_is_named():
    points = np.zeros((3, 3))
    for scene, model, name in [
        (points[:0], points, "scene_points"),
        (points, points[:, :2], "scene_points"),
        (points, points + np.nan, "model_points"),
        (points + np.inf, points, "scene_points"),
    ]:
        with pytest.raises(ValueError, match=name):
            branch_and_bound(scene, model)
    with pytest.raises(ValueError, match="max_distance"):
        branch_and_bound(points, points, max_distance=0)
    with pytest.raises(ValueError, match="gap_distance"):
        branch_and_bound(points, points, gap_distance=-1)
    assert branch_and_bound(points[:1], points[:1]).cost == 0
