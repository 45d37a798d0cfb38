"""Cropping, fusing and splitting clouds."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydrake.math import RigidTransform, RollPitchYaw

from prehensile.errors import InputError
from prehensile.perception import (
    Box,
    PointCloud,
    convex_segments,
    crop,
    downsample,
    inside_box,
    merge,
    resting_pairs,
)


@settings(max_examples=25, deadline=None)
@given(
    rpy=st.tuples(*[st.floats(-3, 3)] * 3),
    p=st.tuples(*[st.floats(-1, 1)] * 3),
    seed=st.integers(0, 1000),
)
def test_cropping_moves_with_the_box(rpy: tuple, p: tuple, seed: int) -> None:
    rng = np.random.default_rng(seed)
    points_B = rng.uniform(-1, 1, (200, 3))
    size = np.array([1.0, 0.6, 1.4])
    points_B = points_B[np.abs(np.abs(points_B) - size / 2).min(axis=1) > 1e-6]
    normals = np.tile([0.0, 0.0, 1.0], (len(points_B), 1))
    X_WB = RigidTransform(RollPitchYaw(*rpy), p)
    cloud = PointCloud(points_B, normals).transformed(X_WB)
    kept = crop(cloud, Box(X_WB, size))
    expected = points_B[(np.abs(points_B) <= size / 2).all(axis=1)]
    np.testing.assert_allclose(X_WB.inverse().multiply(kept.points.T).T, expected, atol=1e-9)


def test_points_that_are_not_finite_are_in_no_box() -> None:
    box = Box(RigidTransform(), np.ones(3))
    assert not inside_box(np.array([[np.nan, 0, 0], [0, np.inf, 0]]), box).any()


def test_downsampling_drops_the_two_faces_of_a_thin_sheet() -> None:
    top, bottom = np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.0, -1.0])
    points = np.array([[0.001, 0.001, 0.001], [0.001, 0.001, 0.002], [0.021, 0.001, 0.001]])
    cloud = downsample(PointCloud(points, np.stack([top, bottom, top])), 0.005)
    np.testing.assert_array_equal(cloud.points, points[2:])
    np.testing.assert_array_equal(cloud.require_normals(), [top])


def box_faces(size: np.ndarray, X: RigidTransform, voxel: float) -> PointCloud:
    """The top and the four sides of a box, sampled densely, in voxels."""
    points, normals = [], []
    for axis in range(3):
        for sign in (-1, 1) if axis < 2 else (1,):
            others = [k for k in range(3) if k != axis]
            steps = [np.linspace(-size[k] / 2, size[k] / 2, int(size[k] / 0.001)) for k in others]
            face = np.zeros((len(steps[0]) * len(steps[1]), 3))
            face[:, others] = np.stack(np.meshgrid(*steps), axis=-1).reshape(-1, 2)
            face[:, axis] = sign * size[axis] / 2
            points.append(face)
            normals.append(np.zeros_like(face))
            normals[-1][:, axis] = sign
    cloud = PointCloud(np.concatenate(points), np.concatenate(normals)).transformed(X)
    return downsample(cloud, voxel)


def test_boxes_that_touch_become_one_segment_each() -> None:
    # A box on the floor, one leaning on nothing beside it, one lying on top of the first.
    voxel = 0.004
    parts = [
        (np.array([0.2, 0.1, 0.06]), RigidTransform(RollPitchYaw(0, 0, 0.3), [0, 0, 0.03])),
        (np.array([0.06, 0.08, 0.05]), RigidTransform(RollPitchYaw(0, 0, 0.9), [0.02, 0, 0.085])),
        (np.array([0.05, 0.05, 0.12]), RigidTransform(RollPitchYaw(0, 0, 0.0), [0.2, 0.1, 0.06])),
    ]
    clouds = [box_faces(size, X, voxel) for size, X in parts]
    truth = np.repeat(np.arange(3), [len(c) for c in clouds])
    points = np.concatenate([c.points for c in clouds])
    # The camera does not see the part of the lower box's top that the upper one covers.
    X = parts[1][1]
    covered = (truth == 0) & inside_box(points, Box(X, parts[1][0] + [0, 0, 0.02]))
    cloud = PointCloud(
        points[~covered], np.concatenate([c.require_normals() for c in clouds])[~covered]
    )
    labels = convex_segments(cloud, voxel)
    truth = truth[~covered]
    for k in range(3):
        values, counts = np.unique(labels[truth == k], return_counts=True)
        best = values[np.argmax(counts)]
        assert best >= 0
        assert counts.max() / counts.sum() > 0.95
        assert (truth[labels == best] == k).mean() > 0.98
    assert labels.max() == 2


def test_labels_are_ordered_by_size() -> None:
    voxel = 0.004
    big = box_faces(np.array([0.1, 0.1, 0.1]), RigidTransform([0.5, 0, 0]), voxel)
    small = box_faces(np.array([0.04, 0.04, 0.04]), RigidTransform(), voxel)
    cloud = merge([small, big])
    labels = convex_segments(cloud, voxel)
    assert (labels[: len(small)] == 1).all()
    assert (labels[len(small) :] == 0).all()


def test_wrong_input_is_refused() -> None:
    points = np.zeros((2, 3))
    with pytest.raises(InputError, match="finite"):
        PointCloud(points, np.full((2, 3), np.nan))
    with pytest.raises(InputError, match="shape"):
        PointCloud(points, np.zeros((3, 3)))
    with pytest.raises(InputError, match="voxel_size"):
        downsample(PointCloud(points, np.tile([0.0, 0.0, 1.0], (2, 1))), 0.0)


def test_what_stands_on_a_box_is_told_from_what_stands_beside_it() -> None:
    voxel = 0.004
    base = box_faces(np.array([0.12, 0.12, 0.06]), RigidTransform([0, 0, 0.03]), voxel)
    above = box_faces(np.array([0.05, 0.05, 0.06]), RigidTransform([0, 0, 0.09]), voxel)
    beside = box_faces(np.array([0.06, 0.06, 0.1]), RigidTransform([0.09, 0, 0.05]), voxel)
    clouds = [base, above, beside]
    cloud = merge(clouds)
    labels = np.repeat(np.arange(3), [len(c) for c in clouds])
    resting = resting_pairs(cloud, labels, voxel)
    assert resting[0, 1] > 50  # 0.2 m of seam
    assert resting[1, 0] == 0
    assert resting[2].sum() == resting[1].sum() == 0
    # The box beside touches the upper edge of the base, but along 6 cm alone.
    assert resting[0, 2] < 0.5 * resting[0, 1]
