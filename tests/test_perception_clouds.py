"""Cropping, fusing and splitting clouds."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix

from prehensile.errors import InputError
from prehensile.perception import (
    Box,
    PointCloud,
    convex_segments,
    crop,
    downsample,
    fuse_depth_images,
    inside_box,
    merge,
    resting_pairs,
)

K = np.array([[300.0, 0.0, 159.5], [0.0, 300.0, 119.5], [0.0, 0.0, 1.0]])


def looking_at(eye: np.ndarray, target: np.ndarray) -> RigidTransform:
    """Pose of an optical frame at ``eye`` whose z axis points to ``target``, x horizontal."""
    z = (target - eye) / np.linalg.norm(target - eye)
    x = np.cross(z, [0.0, 0.0, 1.0])
    x /= np.linalg.norm(x)
    return RigidTransform(RotationMatrix(np.stack([x, np.cross(z, x), z], axis=1)), eye)


def sphere_on_floor(X_WC: RigidTransform, centre: np.ndarray, radius: float) -> np.ndarray:
    """Depth image of a sphere over the floor z = 0."""
    v, u = np.mgrid[0:240, 0:320]
    d_C = np.stack([(u - K[0, 2]) / K[0, 0], (v - K[1, 2]) / K[1, 1], np.ones(u.shape)], axis=-1)
    d, o = d_C @ X_WC.rotation().matrix().T, X_WC.translation()
    floor = np.where(d[..., 2] < 0, -o[2] / np.minimum(d[..., 2], -1e-9), np.inf)
    a, b, c = np.sum(d * d, -1), d @ (o - centre), (o - centre) @ (o - centre) - radius**2
    root = np.sqrt(np.maximum(b * b - a * c, 0))
    ball = np.where(b * b > a * c, (-b - root) / a, np.inf)
    return np.minimum(floor, ball).astype(np.float32)


def test_fused_cloud_of_a_sphere_lies_on_it_with_outward_normals() -> None:
    centre, radius, voxel = np.array([0.5, 0.1, 0.08]), 0.06, 0.005
    eyes = np.array([[1.1, 0.1, 0.6], [0.2, 0.7, 0.6], [0.2, -0.5, 0.6]])
    X_WCs = [looking_at(eye, centre) for eye in eyes]
    depths = [sphere_on_floor(X, centre, radius) for X in X_WCs]
    box = Box(RigidTransform([0.5, 0.1, 0.105]), np.array([0.2, 0.2, 0.2]))
    cloud = fuse_depth_images(depths, [K] * 3, X_WCs, box, voxel)
    assert inside_box(cloud.points, box).all()
    outward = cloud.points - centre
    distance = np.linalg.norm(outward, axis=1)
    assert np.abs(distance - radius).max() < 0.001
    error = np.degrees(
        np.arccos(np.clip(np.sum(outward * cloud.require_normals(), axis=1) / distance, -1, 1))
    )
    assert np.median(error) < 2
    assert error.max() < 15
    # Seen from three sides, the ball is covered down to its equator and below.
    azimuth = np.arctan2(outward[:, 1], outward[:, 0])[np.abs(outward[:, 2]) < 0.02]
    assert np.diff(np.sort(azimuth)).max() < 0.3
    # One point in each voxel.
    cells = np.floor(cloud.points / voxel)
    assert len(np.unique(cells, axis=0)) == len(cloud)


def test_fusing_does_not_depend_on_a_box_behind_the_camera() -> None:
    X_WC = looking_at(np.array([0.5, 0.0, 0.4]), np.array([0.5, 0.1, 0.0]))
    depth = sphere_on_floor(X_WC, np.array([0.5, 0.1, 0.05]), 0.05)
    near = Box(RigidTransform([0.5, 0.1, 0.06]), np.array([0.2, 0.2, 0.11]))
    far = Box(RigidTransform([0.5, 0.1, 0.505]), np.array([5.0, 5.0, 1.0]))
    a = fuse_depth_images([depth], [K], [X_WC], near, 0.004)
    b = crop(fuse_depth_images([depth], [K], [X_WC], far, 0.004), near)
    inner = Box(near.X_WB, near.size - 0.02)  # the rims of the regions differ
    np.testing.assert_allclose(crop(a, inner).points, crop(b, inner).points, atol=1e-9)


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
    with pytest.raises(InputError, match="per camera"):
        fuse_depth_images([], [K], [], Box(RigidTransform(), np.ones(3)), 0.005)
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
