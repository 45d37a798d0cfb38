"""Grasps chosen in synthetic clouds, against the geometry that the clouds were made from."""

from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from scipy.spatial import KDTree
from synthetic_clouds import VOXEL, box_cloud, cylinder_cloud, sphere_cloud

from prehensile.errors import InputError
from prehensile.grasping import (
    WSG50,
    Candidates,
    Grasp,
    GraspConfig,
    GraspResult,
    GraspStatus,
    antipodal_candidates,
    evaluate,
    select_grasps,
)
from prehensile.perception import Box, PointCloud, convex_segments, downsample, inside_box, merge

FLOOR = Box(RigidTransform([0.0, 0.0, -0.05]), np.array([2.0, 2.0, 0.1]))


def select(
    cloud: PointCloud,
    obstacles: Sequence[Box] = (FLOOR,),
    seed: int = 0,
    config: GraspConfig | None = None,
) -> GraspResult:
    return select_grasps(
        cloud, WSG50, obstacles, config or GraspConfig(num_seeds=40), np.random.default_rng(seed)
    )


def axes(grasp: Grasp) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The closing axis and the approach in W, and the point between the pads."""
    R = grasp.X_WG.rotation().matrix()
    return R[:, 0], R[:, 1], grasp.X_WG.multiply(WSG50.p_GPad)


def clutter(seed: int) -> PointCloud:
    """Boxes and cylinders side by side in a small area, with the noise of a camera."""
    rng = np.random.default_rng(seed)
    clouds = []
    for x, y in [(0, 0), (0.1, 0.02), (-0.09, 0.04), (0.03, 0.12), (0.02, -0.11)]:
        height = rng.uniform(0.04, 0.1)
        X = RigidTransform(RollPitchYaw(0, 0, rng.uniform(-3, 3)), [x, y, height / 2])
        if rng.random() < 0.5:
            clouds.append(box_cloud([*rng.uniform(0.03, 0.08, 2), height], X))
        else:
            clouds.append(cylinder_cloud(rng.uniform(0.02, 0.04), height, X))
    cloud = merge(clouds)
    return PointCloud(
        cloud.points + rng.normal(0, 0.0003, cloud.points.shape), cloud.require_normals()
    )


def test_frames_are_rotations_that_start_from_the_seeds_normal() -> None:
    cloud = clutter(0)
    candidates = antipodal_candidates(
        cloud, convex_segments(cloud, VOXEL), np.random.default_rng(0), GraspConfig()
    )
    R = candidates.R_WP
    assert len(R) > 500
    np.testing.assert_allclose(
        np.swapaxes(R, 1, 2) @ R, np.tile(np.eye(3), (len(R), 1, 1)), atol=1e-12
    )
    np.testing.assert_allclose(np.linalg.det(R), 1.0, atol=1e-12)
    # Every closing axis is the normal of a point of the cloud, or the level part of one.
    level = cloud.require_normals()[np.abs(cloud.require_normals()[:, 2]) < 0.99] * [1.0, 1.0, 0.0]
    level /= np.linalg.norm(level, axis=1, keepdims=True)
    distance, _ = KDTree(np.concatenate([cloud.require_normals(), level])).query(R[:, :, 0])
    assert distance.max() < 1e-9
    # No approach is further from straight down than allowed; every seed has its steepest one.
    tilt = np.arccos(np.clip(-R[:, 2, 1], -1, 1))
    assert tilt.max() <= GraspConfig().max_tilt + 1e-9
    for seed in range(candidates.seed.max() + 1):
        mine = candidates.seed == seed
        least = np.arcsin(np.abs(R[mine][0, 2, 0]))
        np.testing.assert_allclose(tilt[mine].min(), least, atol=1e-7)


def test_all_grasps_have_proper_frames() -> None:
    result = select(clutter(1))
    assert result.success
    for grasp in result.grasps:
        R = grasp.X_WG.rotation().matrix()
        np.testing.assert_allclose(R.T @ R, np.eye(3), atol=1e-12)
        assert sum(grasp.breakdown.values()) == pytest.approx(grasp.score)
    scores = [g.score for g in result.grasps]
    assert scores == sorted(scores, reverse=True)


@settings(max_examples=8, deadline=None)
@given(yaw=st.floats(-3.1, 3.1), x=st.floats(0.03, 0.08), z=st.floats(0.03, 0.12))
def test_a_box_is_taken_by_opposite_faces(yaw: float, x: float, z: float) -> None:
    X_WB = RigidTransform(RollPitchYaw(0, 0, yaw), [0.4, -0.2, z / 2])
    result = select(box_cloud([x, 0.16, z], X_WB))
    assert result.success
    closing, approach, p_W = axes(result.grasps[0])
    # Its 0.16 m are too long for the hand: it must close along the box's x.
    cosine = abs(closing @ X_WB.rotation().matrix()[:, 0])
    assert np.degrees(np.arccos(min(cosine, 1.0))) < 3
    assert np.degrees(np.arccos(min(-approach[2], 1.0))) < 21
    p_B = X_WB.inverse().multiply(p_W)
    assert abs(p_B[0]) < 0.003
    assert abs(p_B[1]) < 0.03
    # Open as far as needed and no further.
    assert x < result.grasps[0].width <= x + 2 * GraspConfig().clearance + 0.006
    assert result.grasps[0].span == pytest.approx(x, abs=0.005)


def test_a_standing_cylinder_is_taken_through_its_axis() -> None:
    result = select(cylinder_cloud(0.033, 0.1, RigidTransform([0.1, 0.2, 0.05])))
    closing, approach, p_W = axes(result.grasps[0])
    assert abs(closing[2]) < 0.05
    assert approach[2] < -0.99
    # The line of closing passes the cylinder's axis.
    offset = np.array([0.1, 0.2]) - p_W[:2]
    assert np.linalg.norm(offset) < 0.006


def test_a_lying_cylinder_is_taken_across_and_near_the_middle() -> None:
    X_WB = RigidTransform(RollPitchYaw(0, np.pi / 2, 0.4), [0, 0, 0.033])
    result = select(cylinder_cloud(0.033, 0.2, X_WB))
    closing, _, p_W = axes(result.grasps[0])
    p_B = X_WB.inverse().multiply(p_W)
    assert abs(closing @ X_WB.rotation().matrix()[:, 2]) < np.sin(np.deg2rad(8))
    assert abs(p_B[2]) < 0.03
    assert abs(p_B @ (X_WB.rotation().matrix().T @ closing)) < 0.004


def test_a_sphere_is_taken_through_its_centre() -> None:
    result = select(sphere_cloud(0.04, [0.0, 0.0, 0.04]))
    closing, _, p_W = axes(result.grasps[0])
    v = np.array([0.0, 0.0, 0.04]) - p_W
    # The pads press within the friction cone: the line of closing passes near the centre.
    assert np.linalg.norm(v - closing * (closing @ v)) < 0.04 * np.sin(np.deg2rad(25))
    assert abs(closing @ v) < 0.003


def test_vertical_approaches_are_preferred() -> None:
    cloud = box_cloud([0.05, 0.05, 0.1], RigidTransform([0, 0, 0.05]))
    first = select(cloud).grasps[0]
    assert axes(first)[1][2] < -0.999
    tilted = [g for g in select(cloud).grasps if axes(g)[1][2] > -0.95]
    assert tilted
    assert all(g.score < first.score for g in tilted)


@pytest.mark.parametrize("seed", range(3))
def test_no_grasp_touches_the_cloud_or_an_obstacle(seed: int) -> None:
    cloud = clutter(seed)
    wall = Box(RigidTransform([0.18, 0.0, 0.1]), np.array([0.02, 0.6, 0.2]))
    config = GraspConfig()
    result = select(cloud, [FLOOR, wall], seed)
    assert result.success
    grid = np.stack(np.meshgrid(*[np.linspace(-0.5, 0.5, 9)] * 3), -1).reshape(-1, 3)
    for grasp in result.grasps:
        centres, sizes = WSG50.boxes(np.array([grasp.width]), config.approach)
        for centre, size in zip(centres[0], sizes[0], strict=True):
            X_WBox = grasp.X_WG @ RigidTransform(centre)
            assert not inside_box(cloud.points, Box(X_WBox, size)).any()
            for obstacle in (FLOOR, wall):
                assert not inside_box(X_WBox.multiply((grid * size).T).T, obstacle).any()


def test_a_wall_close_by_leaves_only_the_other_direction() -> None:
    cloud = box_cloud([0.05, 0.06, 0.08], RigidTransform([0, 0, 0.04]))
    closings = np.array([axes(g)[0] for g in select(cloud).grasps])
    assert (np.abs(closings[:, 0]) > 0.9).any()
    walls = [
        FLOOR,
        Box(RigidTransform([0.045, 0.0, 0.1]), np.array([0.02, 0.6, 0.2])),
    ]
    result = select(cloud, walls)
    assert result.success
    closings = np.array([axes(g)[0] for g in result.grasps])
    assert (np.abs(closings[:, 1]) > 0.9).all()
    assert result.counts[GraspStatus.HITS_OBSTACLES] > 0


def test_room_between_neighbours_is_used_and_no_more() -> None:
    boxes = [
        box_cloud([0.05, 0.1, 0.08], RigidTransform([x, 0, 0.04])) for x in (-0.085, 0.0, 0.085)
    ]
    result = select(merge(boxes))  # 3.5 cm between them
    middle = [g for g in result.grasps if abs(axes(g)[2][0]) < 0.02 and abs(axes(g)[0][0]) > 0.9]
    assert middle
    assert all(g.width < 0.066 for g in middle)


def empty() -> PointCloud:
    return PointCloud(np.zeros((0, 3)), np.zeros((0, 3)))


def wedge() -> PointCloud:
    """A ridge of two faces that lean inward by 40 degrees each, down to the floor."""
    lean = np.deg2rad(40)
    u, v = np.meshgrid(np.arange(0, 0.155, 0.001), np.arange(-0.05, 0.05, 0.001))
    u, v = u.ravel(), v.ravel()
    clouds = []
    for s in (-1.0, 1.0):
        p = np.column_stack([s * u * np.sin(lean), v, 0.12 - u * np.cos(lean)])
        normal = [s * np.cos(lean), 0.0, np.sin(lean)]
        clouds.append(PointCloud(p, np.tile(normal, (len(p), 1))))
    return downsample(merge(clouds), VOXEL)


@pytest.mark.parametrize(
    ("cloud", "status"),
    [
        (empty(), GraspStatus.NO_POINTS),
        (box_cloud([0.1, 0.1, 0.02], RigidTransform(), "Z"), GraspStatus.NO_SIDES),
        (box_cloud([0.15, 0.15, 0.1], RigidTransform([0, 0, 0.05])), GraspStatus.TOO_WIDE),
        (wedge(), GraspStatus.NOT_ANTIPODAL),
        (box_cloud([0.05, 0.05, 0.08], RigidTransform([0, 0, 0.04])), GraspStatus.HITS_OBSTACLES),
    ],
)
def test_the_result_says_why_there_is_no_grasp(cloud: PointCloud, status: GraspStatus) -> None:
    # A shaft of 9 cm: room for the narrow box, but not for a hand around it.
    walls = [
        Box(RigidTransform(p), np.array([0.05, 0.05, 0.3]) + 0.1 * np.abs([p[1], p[0], 0]) / 0.07)
        for p in ([0.07, 0, 0.15], [-0.07, 0, 0.15], [0, 0.07, 0.15], [0, -0.07, 0.15])
    ]
    result = select(cloud, [FLOOR, *walls] if status is GraspStatus.HITS_OBSTACLES else [FLOOR])
    assert not result.success
    assert result.status is status
    assert result.grasps == ()


def test_specks_that_belong_to_no_segment_do_no_harm() -> None:
    cloud = box_cloud([0.04, 0.04, 0.05], RigidTransform([0, 0, 0.025]))
    speck = cloud.select(np.arange(8))
    assert (convex_segments(speck, VOXEL) == -1).all()
    select(speck)
    nothing = np.full(len(cloud), -1)
    assert select_grasps(
        cloud, WSG50, [FLOOR], GraspConfig(), np.random.default_rng(0), segments=nothing
    ).success


def test_the_same_seed_gives_the_same_grasps() -> None:
    a, b, c = (select(clutter(2), seed=seed) for seed in (5, 5, 6))
    assert [g.score for g in a.grasps] == [g.score for g in b.grasps]
    for g, h in zip(a.grasps, b.grasps, strict=True):
        np.testing.assert_array_equal(g.X_WG.GetAsMatrix4(), h.X_WG.GetAsMatrix4())
    assert [g.score for g in a.grasps] != [g.score for g in c.grasps]


def test_grasps_differ_from_one_another() -> None:
    config = GraspConfig()
    grasps = select(clutter(3)).grasps
    assert 5 < len(grasps) <= config.max_grasps
    for i, g in enumerate(grasps):
        for h in grasps[:i]:
            apart = np.linalg.norm(axes(g)[2] - axes(h)[2])
            turn = min(
                g.X_WG.rotation().InvertAndCompose(x.X_WG.rotation()).ToAngleAxis().angle()
                for x in (h, h.flipped())
            )
            assert apart >= config.min_distance - 1e-9 or abs(turn) >= config.min_angle - 1e-9


def test_flipping_swaps_the_fingers_only() -> None:
    grasp = select(clutter(4)).grasps[0]
    flipped = grasp.flipped()
    np.testing.assert_allclose(axes(flipped)[0], -axes(grasp)[0], atol=1e-12)
    np.testing.assert_allclose(axes(flipped)[1], axes(grasp)[1], atol=1e-12)
    np.testing.assert_allclose(axes(flipped)[2], axes(grasp)[2], atol=1e-12)
    assert flipped.width == grasp.width


@settings(max_examples=6, deadline=None)
@given(yaw=st.floats(-3.1, 3.1), x=st.floats(-0.5, 0.5), y=st.floats(-0.5, 0.5))
def test_scores_do_not_depend_on_where_the_scene_is(yaw: float, x: float, y: float) -> None:
    cloud = clutter(5)
    segments = convex_segments(cloud, VOXEL)
    wall = Box(RigidTransform([0.16, 0.0, 0.1]), np.array([0.02, 0.6, 0.2]))
    config = GraspConfig(num_seeds=25)
    candidates = antipodal_candidates(cloud, segments, np.random.default_rng(0), config)
    X = RigidTransform(RotationMatrix.MakeZRotation(yaw), [x, y, 0.0])
    R = X.rotation().matrix()
    moved = Candidates(
        R @ candidates.R_WP,
        X.multiply(candidates.p_WP.T).T,
        candidates.segment,
        candidates.seed,
    )
    floor = Box(X @ FLOOR.X_WB, FLOOR.size)
    # What rests on what is told from voxels, which do not turn with the scene.
    config = GraspConfig(num_seeds=25, weight_burden=0.0)
    a = evaluate(candidates, cloud, segments, WSG50, [FLOOR, wall], config)
    b = evaluate(
        moved, cloud.transformed(X), segments, WSG50, [floor, Box(X @ wall.X_WB, wall.size)], config
    )
    assert (a.status == GraspStatus.FOUND).sum() > 20
    # A point on the very border of a region may fall on the other side of it.
    same = a.status == b.status
    assert same.mean() > 0.99
    found = same & (a.status == GraspStatus.FOUND)
    close = np.abs(a.score[found] - b.score[found]) < 1e-5
    assert close.mean() > 0.97


def test_settings_out_of_range_are_named_all_at_once() -> None:
    with pytest.raises(InputError) as info:
        GraspConfig(num_seeds=0, voxel_size=float("nan"), max_tilt=2.0, depths=())
    text = str(info.value)
    for key in ("num_seeds", "voxel_size", "max_tilt", "depths"):
        assert key in text
