"""Votes of point pairs: where known shapes are found."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydrake.math import RigidTransform, RotationMatrix
from scipy.spatial.transform import Rotation

from prehensile.errors import InputError
from prehensile.perception.cloud import PointCloud, merge
from prehensile.perception.registration.point_pairs import PointPairModel


def _steps(rng: np.random.Generator, count: int) -> PointCloud:
    """Random points on the outsides of three boxes that share no symmetry; they do not touch."""
    sizes = np.array([[0.10, 0.06, 0.03], [0.03, 0.05, 0.08], [0.05, 0.02, 0.02]])
    centres = np.array([[0.0, 0.0, 0.0], [0.04, 0.0, 0.06], [-0.03, 0.015, 0.03]])
    box = rng.integers(3, size=count)
    axis, side = rng.integers(3, size=count), rng.choice([-1.0, 1.0], count)
    points = rng.uniform(-0.5, 0.5, (count, 3))
    rows = np.arange(count)
    points[rows, axis] = 0.5 * side
    normals = np.zeros((count, 3))
    normals[rows, axis] = side
    return PointCloud(points * sizes[box] + centres[box], normals)


def _clutter(rng: np.random.Generator, count: int) -> PointCloud:
    normals = rng.normal(size=(count, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return PointCloud(rng.uniform(-0.15, 0.15, (count, 3)), normals)


def _errors(X_WO: np.ndarray, X_true: RigidTransform) -> tuple[np.ndarray, np.ndarray]:
    """Angle [rad] and distance of the origins [m] of poses (K, 4, 4) from the true one."""
    R = X_true.rotation().matrix()
    cosine = (np.einsum("kij,ij->k", X_WO[:, :3, :3], R) - 1) / 2
    distance = np.linalg.norm(X_WO[:, :3, 3] - X_true.translation(), axis=1)
    return np.arccos(np.clip(cosine, -1, 1)), distance


def _random_pose(rng: np.random.Generator) -> RigidTransform:
    R = Rotation.from_quat(rng.normal(size=4)).as_matrix()
    return RigidTransform(RotationMatrix(R), rng.uniform(-1, 1, 3))


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_first_pose_is_near_the_true_one_among_other_points(seed: int) -> None:
    rng = np.random.default_rng(seed)
    model = PointPairModel(_steps(np.random.default_rng(0), 250))
    X_WO = _random_pose(rng)
    # Other points of the surface than the model's, and half as many that belong to nothing.
    scene = merge([_steps(rng, 200), _clutter(rng, 100)])
    scene = scene.select(rng.permutation(300)).transformed(X_WO)
    votes = model.vote(scene)
    angle, distance = _errors(votes.X_WO, X_WO)
    assert angle[0] < 0.35
    assert distance[0] < 0.1 * model.diameter
    assert (np.diff(votes.votes) <= 0).all()
    R = votes.X_WO[:, :3, :3]
    np.testing.assert_allclose(
        R @ R.transpose(0, 2, 1), np.broadcast_to(np.eye(3), R.shape), atol=1e-12
    )
    np.testing.assert_allclose(np.linalg.det(R), 1)


def test_poses_move_with_the_scene() -> None:
    rng = np.random.default_rng(1)
    model = PointPairModel(_steps(rng, 200))
    scene = _steps(rng, 150)
    X_WV = _random_pose(rng)
    here = model.vote(scene).X_WO[0]
    there = model.vote(scene.transformed(X_WV)).X_WO
    angle, distance = _errors(there, X_WV @ RigidTransform(here))
    assert angle[0] < 0.2
    assert distance[0] < 0.05 * model.diameter


def test_threads_do_not_change_the_votes() -> None:
    rng = np.random.default_rng(2)
    model = PointPairModel(_steps(rng, 150))
    scene = _steps(rng, 200)
    one, two = model.vote(scene), model.vote(scene, num_threads=3)
    np.testing.assert_array_equal(one.X_WO, two.X_WO)
    np.testing.assert_array_equal(one.votes, two.votes)
    assert len(model.vote(scene, max_poses=3).X_WO) == 3


def test_points_without_normal_take_no_part() -> None:
    rng = np.random.default_rng(3)
    cloud = _steps(rng, 150)
    blank = _clutter(rng, 1000).replace(normals=np.zeros((1000, 3)))
    model, with_blank = PointPairModel(cloud, 0.01), PointPairModel(merge([cloud, blank]), 0.01)
    scene = _steps(rng, 100)
    # The blanks may be anywhere among the references: all of the scene are.
    expected = model.vote(scene, num_references=100)
    got = with_blank.vote(merge([scene, blank]), num_references=1100)
    np.testing.assert_array_equal(got.votes[0], expected.votes[0])
    np.testing.assert_allclose(got.X_WO[0], expected.X_WO[0])


def test_scenes_that_hold_nothing() -> None:
    model = PointPairModel(_steps(np.random.default_rng(4), 100))
    empty = PointCloud(np.zeros((0, 3)), np.zeros((0, 3)))
    one = PointCloud(np.zeros((1, 3)), np.array([[0.0, 0.0, 1.0]]))
    same = PointCloud(np.zeros((5, 3)), np.tile([0.0, 0.0, 1.0], (5, 1)))
    far = PointCloud(np.array([[0.0, 0, 0], [1e9, 0, 0]]), np.array([[0.0, 0, 1], [0, 0, 1]]))
    for scene in (empty, one, same, far):
        assert model.vote(scene).X_WO.shape == (0, 4, 4)


def test_bad_input_is_named() -> None:
    cloud = _steps(np.random.default_rng(5), 100)
    with pytest.raises(InputError, match="normals"):
        PointPairModel(PointCloud(cloud.points))
    with pytest.raises(ValueError, match="cloud: needs at least two"):
        PointPairModel(cloud.select(np.array([0])), 0.01)
    with pytest.raises(ValueError, match="distance_step"):
        PointPairModel(cloud, 0.0)
    with pytest.raises(ValueError, match="64 steps"):
        PointPairModel(cloud, 1e-4)
    model = PointPairModel(cloud)
    with pytest.raises(InputError, match="normals"):
        model.vote(PointCloud(cloud.points))
    for name in ("num_references", "peaks_per_reference", "max_poses", "num_threads"):
        with pytest.raises(ValueError, match=name):
            model.vote(cloud, **{name: 0})
