"""Whatever comes in, perception answers with a named error or a status.

Each function of the room gets what a new user may give it: empty and degenerate clouds, numbers
that are not finite or absurd, wrong shapes.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from nasty_clouds import (
    CAMERA,
    CLOUD,
    DEPTH,
    INF,
    MODEL,
    NAN,
    POINTS,
    POSED,
    REGION,
    SIZE,
    VIEW,
    X_GUESS,
    X_NAN,
    box_body,
    box_field,
    box_mesh,
    cloud_of,
    known_box,
    nasty_points,
    unusable_arrays,
)
from pydrake.math import RigidTransform

from prehensile.native.kd_tree import KdTree
from prehensile.perception import (
    ArmTrackerConfig,
    Body,
    Box,
    CameraModel,
    DepthConfig,
    DepthNoiseConfig,
    DepthView,
    EvidenceConfig,
    PointCloud,
    PosedCamera,
    TrackerConfig,
    TriangleMesh,
    add_depth_noise,
    convex_segments,
    downsample,
    estimate_normals,
    farthest_point_sampling,
    free_space_violation,
    fuse,
    inside_box,
    inside_half_space,
    merge_meshes,
    radius_outliers,
    refine_constrained,
    resting_pairs,
    sample_mesh_poisson_disc,
    sample_mesh_uniform,
    start_arm_tracking,
    start_tracking,
    statistical_outliers,
    surface_variation,
    unproject,
)
from prehensile.perception.conversions import cloud_from_rows
from prehensile.perception.distance_field import DistanceField
from prehensile.perception.planes import plane_regions, ransac_plane
from prehensile.perception.registration import (
    FilterRegConfig,
    HalfSpaces,
    IcpConfig,
    KnownObject,
    LocateConfig,
    PointDriftConfig,
    PointPairModel,
    RefineConfig,
    RobustConfig,
    branch_and_bound,
    certify_rotation,
    coherent_point_drift,
    consistency_graph,
    estimate_pose_nonlinear,
    filter_registration,
    fit_rigid,
    fit_rigid_constrained,
    fit_rigid_convex,
    fit_rotation,
    fit_translation,
    fpfh,
    gnc_rotation,
    icp,
    icp_2d,
    icp_many_starts,
    locate,
    match_by_distances,
    ransac_pose,
    refine_pose,
    register_correspondences,
    vote,
    vote_for_scale,
)
from prehensile.perception.segmentation import euclidean_clusters, nearest_segment, subtract
from prehensile.perception.visibility import visible_points
from prehensile.perception.volume import fuse_volume

# Functions of an array of points, and the name of that argument in their messages.
ARRAY_FUNCTIONS: dict[str, tuple[Callable[[Any], Any], str]] = {
    "KdTree": (KdTree, "points"),
    "nearest": (lambda p: KdTree(POINTS).nearest(p), "queries"),
    "within_radius": (lambda p: KdTree(POINTS).within_radius(p, 0.01), "queries"),
    "farthest_point_sampling": (lambda p: farthest_point_sampling(p, 3), "points"),
    "euclidean_clusters": (lambda p: euclidean_clusters(p, 0.01), "points"),
    "visible_points": (lambda p: visible_points(p, [0, 0, 1.0]), "points"),
    "PointCloud": (PointCloud, "points"),
    "TriangleMesh": (lambda p: TriangleMesh(p, [[0, 1, 2]]), "vertices"),
    "DistanceField.at": (lambda p: box_field().at(p), "points"),
    "DistanceField.closest": (lambda p: box_field().closest(p), "points"),
    "fit_rigid": (lambda p: fit_rigid(p, p), "model_points"),
    "fit_rotation": (lambda p: fit_rotation(p, p), "model_vectors"),
    "fit_translation": (lambda p: fit_translation(p, p, np.eye(3)), "model_points"),
    "constrained": (
        lambda p: fit_rigid_constrained(p, p, HalfSpaces([[0, 0, 1]], [-1])),
        "model_points",
    ),
    "convex": (lambda p: fit_rigid_convex(p, p, HalfSpaces([[0, 0, 1]], [-1])), "model_points"),
    "register": (lambda p: register_correspondences(p, p, 0.002), "model_points"),
    "ransac": (lambda p: ransac_pose(p, p, 0.002), "model_points"),
    "gnc": (lambda p: gnc_rotation(p, p, 0.01), "model_vectors"),
    "certify": (lambda p: certify_rotation(p, p, 0.01), "model_vectors"),
    "consistency_graph": (lambda p: consistency_graph(p, p, 0.01), "model_points"),
    "vote_for_scale": (lambda p: vote_for_scale(p, p, 0.01), "model_points"),
    "branch_and_bound": (lambda p: branch_and_bound(p, p), "scene_points"),
    "refine_constrained": (lambda p: refine_constrained(p, box_body(), X_GUESS), "scene_points"),
    "Body": (lambda p: Body(box_field(), p, p), "points"),
}


@pytest.mark.parametrize("name", ARRAY_FUNCTIONS)
def test_what_is_no_array_of_points_is_refused_by_name(name):
    call, argument = ARRAY_FUNCTIONS[name]
    for kind, points in unusable_arrays().items():
        if kind == "1e300" and name in ("KdTree", "farthest_point_sampling"):
            continue  # They compare lengths, and reach as far as numbers do.
        with pytest.raises(ValueError, match=argument):
            pytest.fail(f"{kind} became {type(call(points))}")


@pytest.mark.parametrize("form", [list, np.asfortranarray, lambda p: np.repeat(p, 2, axis=0)[::2]])
def test_lists_and_other_strides_are_the_same_points(form):
    def read_only(points):
        copy = points.copy()
        copy.setflags(write=False)
        return copy

    for points in (form(POINTS), read_only(POINTS)):
        np.testing.assert_array_equal(
            inside_box(points, Box(X_GUESS, SIZE)), inside_box(POINTS, Box(X_GUESS, SIZE))
        )
        half = [inside_half_space(p, [1, 2, 3], 0.01) for p in (points, POINTS)]
        np.testing.assert_array_equal(*half)
        np.testing.assert_array_equal(
            farthest_point_sampling(points, 9), farthest_point_sampling(POINTS, 9)
        )
        np.testing.assert_allclose(fit_rigid(points, points).R_WO, np.eye(3), atol=1e-12)


@pytest.mark.parametrize("kind", nasty_points())
def test_clouds_of_which_little_can_be_said(kind):
    """Functions of clouds either answer in their documented shapes or name the argument."""
    points = nasty_points()[kind]
    cloud = cloud_of(points)
    lengths = np.linalg.norm(cloud.require_normals(), axis=1)
    assert ((lengths == 0) | (np.abs(lengths - 1) < 1e-6)).all()
    n = len(cloud)
    calls: dict[str, Callable[[], Any]] = {
        "voxel_size": lambda: len(downsample(cloud, 0.01)) <= n,
        "radius": lambda: estimate_normals(cloud, radius=0.02).require_normals().shape == (n, 3),
        "neighbors": lambda: np.isfinite(surface_variation(cloud, neighbors=9)).all(),
        "std_ratio": lambda: statistical_outliers(cloud).shape == (n,),
        "min_neighbors": lambda: radius_outliers(cloud, 0.01, 3).shape == (n,),
        "max_distance": lambda: ransac_plane(cloud, 0.002).inliers.shape == (n,),
        "radius ": lambda: plane_regions(cloud, 0.02)[0].shape == (n,),
        "voxel_size ": lambda: convex_segments(cloud, 0.01).shape == (n,),
        "tolerance": lambda: euclidean_clusters(points, 0.01).shape == (n,),
        "radius  ": lambda: np.isfinite(fpfh(cloud, 0.02)).all(),
    }
    for argument, call in calls.items():
        try:
            assert call()
        except ValueError as error:
            if "far" not in kind or argument.strip() not in str(error):
                raise
    kept = statistical_outliers(cloud)
    if kind == "one far off":
        assert kept.sum() > 0.8 * n
        assert not kept[3]


BAD = {
    "negative": -1.0,
    "not a number": NAN,
}
BAD_SIZES = BAD | {"zero": 0.0}


def parameter_calls() -> dict[str, tuple[Callable[[Any], Any], dict[str, float]]]:
    """Calls with one number of the caller's choice, and what that must not be."""
    segments = np.zeros(len(CLOUD), dtype=int)
    calls: dict[str, tuple[Callable[[Any], Any], dict[str, float]]] = {
        "downsample.voxel_size": (lambda v: downsample(CLOUD, v), BAD_SIZES),
        "estimate_normals.radius": (lambda v: estimate_normals(CLOUD, radius=v), BAD_SIZES),
        "statistical_outliers.std_ratio": (lambda v: statistical_outliers(CLOUD, 9, v), BAD),
        "radius_outliers.radius": (lambda v: radius_outliers(CLOUD, v, 3), BAD_SIZES),
        "ransac_plane.max_distance": (lambda v: ransac_plane(CLOUD, v), BAD_SIZES),
        "ransac_plane.confidence": (
            lambda v: ransac_plane(CLOUD, 0.01, confidence=v),
            BAD_SIZES | {"one": 1.0},
        ),
        "plane_regions.radius": (lambda v: plane_regions(CLOUD, v), BAD_SIZES),
        "convex_segments.voxel_size": (lambda v: convex_segments(CLOUD, v), BAD_SIZES),
        "convex_segments.max_step": (lambda v: convex_segments(CLOUD, 0.01, max_step=v), BAD),
        "convex_segments.max_concavity": (
            lambda v: convex_segments(CLOUD, 0.01, max_concavity=v),
            BAD,
        ),
        "euclidean_clusters.tolerance": (lambda v: euclidean_clusters(POINTS, v), BAD_SIZES),
        "subtract.margin": (lambda v: subtract(CLOUD, [], margin=v), BAD),
        "resting_pairs.labels": (
            lambda v: resting_pairs(CLOUD, segments + (10**6 if v == 1 else v), 0.01),
            {"too many": 1, "no whole numbers": 0.5},
        ),
        "nearest_segment.p_W": (
            lambda v: nearest_segment(CLOUD, segments, [0, v, 0]),
            {"nan": NAN},
        ),
        "visible_points.radius_factor": (
            lambda v: visible_points(POINTS, [0, 0, 1.0], radius_factor=v),
            BAD_SIZES | {"one": 1.0, "huge": 1e300},
        ),
        "inside_box.box": (lambda v: inside_box(POINTS, Box(X_GUESS, np.full(3, v))), BAD),
        "inside_half_space.normal": (
            lambda v: inside_half_space(POINTS, [0, 0, v], 0.0),
            {"zero": 0.0, "nan": NAN},
        ),
        "sample_mesh_uniform.count": (lambda v: sample_mesh_uniform(box_mesh(), v, seed=0), BAD),
        "sample_mesh_poisson_disc.radius": (
            lambda v: sample_mesh_poisson_disc(box_mesh(), radius=v, seed=0),
            BAD_SIZES | {"tiny": 1e-300},
        ),
        "from_mesh.spacing": (
            lambda v: DistanceField.from_mesh(box_mesh(), v),
            BAD_SIZES | {"tiny": 1e-300},
        ),
        "from_mesh.margin": (lambda v: DistanceField.from_mesh(box_mesh(), 0.01, v), BAD),
        "fuse.voxel_size": (lambda v: fuse([DEPTH], [POSED], REGION, v), BAD_SIZES),
        "fuse_volume.voxel_size": (lambda v: fuse_volume(VIEW, REGION, v), BAD_SIZES),
        "fpfh.radius": (lambda v: fpfh(CLOUD, v), BAD_SIZES),
        "PointPairModel.distance_step": (lambda v: PointPairModel(CLOUD, v), BAD_SIZES),
        "register.noise_bound": (lambda v: register_correspondences(POINTS, POINTS, v), BAD_SIZES),
        "ransac.max_distance": (lambda v: ransac_pose(POINTS, POINTS, v), BAD_SIZES),
        "ransac.max_false_alarms": (
            lambda v: ransac_pose(POINTS, POINTS, 0.01, max_false_alarms=v),
            BAD_SIZES,
        ),
        "gnc.max_iterations": (
            lambda v: gnc_rotation(POINTS, POINTS, 0.01, max_iterations=int(v)),
            {"zero": 0, "negative": -1},
        ),
        "certify.R_WO": (
            lambda v: certify_rotation(POINTS[:3], POINTS[:3], 0.01, v * np.eye(3)),
            BAD_SIZES,
        ),
        "vote.bounds": (lambda v: vote([1.0, 2.0], v), BAD_SIZES | {"tiny": 1e-300}),
        "match_by_distances.pairs": (
            lambda v: match_by_distances(POINTS[:3], POINTS[:3], 0.01, pairs=[[0, v]]),
            BAD | {"too many": 3},
        ),
        "branch_and_bound.gap_distance": (
            lambda v: branch_and_bound(POINTS[:3], POINTS[:3], gap_distance=v),
            BAD | {"huge": 1e300},
        ),
        "nonlinear.scale": (
            lambda v: estimate_pose_nonlinear(CLOUD, box_field(), X_GUESS, scale=v),
            BAD_SIZES | {"tiny": 1e-300},
        ),
        "nonlinear.max_iterations": (
            lambda v: estimate_pose_nonlinear(CLOUD, box_field(), X_GUESS, max_iterations=v),
            BAD_SIZES,
        ),
        "icp_many_starts.distinct_distance": (
            lambda v: icp_many_starts(CLOUD, MODEL, [X_GUESS], distinct_distance=v),
            BAD,
        ),
        "icp_2d.kept_fraction": (
            lambda v: icp_2d(POINTS[:, :2], POINTS[:, :2], np.eye(3), kept_fraction=v),
            BAD_SIZES,
        ),
        "start_tracking.X_WO": (lambda v: start_tracking(RigidTransform([v, 0, 0])), {"nan": NAN}),
        "start_arm_tracking.q_measured": (lambda v: start_arm_tracking([v]), {"nan": NAN}),
        "CameraModel.width": (lambda v: CameraModel(v, 3, 1, 1, 1, 1), BAD_SIZES | {"inf": INF}),
        "free_space_violation.depth": (
            lambda v: free_space_violation(POINTS, DepthView(DEPTH.astype(v), POSED)),
            {"millimetres": np.uint16},
        ),
    }
    for kind, call in {
        IcpConfig: lambda c: icp(CLOUD, MODEL, X_GUESS, c),
        PointDriftConfig: lambda c: coherent_point_drift(CLOUD, MODEL, X_GUESS, c),
        FilterRegConfig: lambda c: filter_registration(CLOUD, MODEL, X_GUESS, c),
        RefineConfig: lambda c: refine_pose(CLOUD, box_field(), X_GUESS, c),
        RobustConfig: lambda c: register_correspondences(POINTS, POINTS, 0.01, c),
        LocateConfig: lambda c: locate(CLOUD, known_box(), c),
        TrackerConfig: lambda _: None,
        ArmTrackerConfig: lambda _: None,
        EvidenceConfig: lambda _: None,
        DepthConfig: lambda c: unproject((1000 * DEPTH).astype(np.uint16), CAMERA, c),
        DepthNoiseConfig: lambda c: add_depth_noise(DEPTH, CAMERA.K, c, np.random.default_rng(0)),
    }.items():
        for field in kind.__dataclass_fields__.values():
            default = getattr(kind(), field.name)
            if field.name == "seed" or isinstance(default, bool):
                continue  # Not of the function's, or no number.
            if isinstance(default, int):
                values = {"negative": -1}
            elif default is None or isinstance(default, float):
                values = {"not a number": NAN} if field.name == "min_normal_cosine" else BAD
            else:
                continue

            def given(value, kind=kind, name=field.name, call=call):
                return call(kind(**{name: value}))

            argument = "noise" if field.name.startswith("noise_") else field.name
            calls[f"{kind.__name__}.{argument} {field.name}"] = (given, values)
    return calls


PARAMETER_CALLS = parameter_calls()


@pytest.mark.parametrize("name", PARAMETER_CALLS)
def test_numbers_out_of_range_are_refused_by_name(name):
    call, values = PARAMETER_CALLS[name]
    argument = name.split(" ")[0].split(".")[1]
    for kind, value in values.items():
        with pytest.raises(ValueError, match=argument):
            pytest.fail(f"{kind} gave {call(value)}")


def test_meshes_without_a_surface_or_an_inside():
    whole = box_mesh()
    hole = TriangleMesh(whole.vertices, whole.triangles[1:])
    inside_out = TriangleMesh(whole.vertices, whole.triangles[:, ::-1])
    line = TriangleMesh(whole.vertices * [1, 0, 0], whole.triangles)
    assert not hole.is_watertight()
    for mesh in (hole, inside_out, line):
        with pytest.raises(ValueError, match="triangles"):
            DistanceField.from_mesh(mesh, 0.01)
    for call in (
        lambda: sample_mesh_uniform(line, 9, seed=0),
        lambda: Body.from_mesh(line, box_field()),
        lambda: KnownObject.from_mesh(line),
    ):
        with pytest.raises(ValueError, match="mesh"):
            call()
    with pytest.raises(ValueError, match="meshes"):
        merge_meshes([])
    with pytest.raises(ValueError, match="triangles"):
        TriangleMesh(whole.vertices, [[0, 1, 99]])


def test_images_without_measurements_give_nothing():
    for depth in (np.full_like(DEPTH, NAN), np.zeros_like(DEPTH), np.full_like(DEPTH, INF), -DEPTH):
        assert np.isnan(unproject(depth, CAMERA)).all()
        assert len(fuse([depth], [POSED], REGION, 0.01)) == 0
        assert len(cloud_from_rows(unproject(depth, CAMERA))) == 0
        view = DepthView(depth, POSED)
        assert len(fuse_volume(view, REGION, 0.05).surface()) == 0
        assert not free_space_violation(POINTS + [0, 0, 0.3], view).any()
    with pytest.raises(ValueError, match="X_WC"):
        fuse([DEPTH], [PosedCamera(CAMERA, X_NAN)], REGION, 0.01)
