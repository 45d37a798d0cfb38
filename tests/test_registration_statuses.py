"""What a registration says of its own answer: no pose made up from noise or unlike scenes."""

import functools
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from nasty_clouds import (
    CLOUD,
    MODEL,
    POINTS,
    X_GUESS,
    X_NAN,
    box_body,
    box_cloud,
    box_field,
    cloud_of,
    known_box,
    nasty_points,
)
from pydrake.math import RigidTransform, RollPitchYaw

from prehensile.models.shapes import primitives
from prehensile.perception import (
    PointCloud,
    TriangleMesh,
    refine_constrained,
)
from prehensile.perception.distance_field import DistanceField
from prehensile.perception.registration import (
    FilterRegConfig,
    IcpConfig,
    IcpDirection,
    IcpKind,
    IcpModel,
    RefineConfig,
    RegistrationStatus,
    coherent_point_drift,
    estimate_pose_nonlinear,
    filter_registration,
    fit_rigid,
    fit_rotation,
    icp,
    icp_many_starts,
    locate,
    ransac_pose,
    refine_pose,
    refine_poses,
    register_correspondences,
)

SUCCESS = RegistrationStatus.SUCCESS

# Registrations of a scene with the box, each from the same guess.
REGISTRATIONS: dict[str, Callable[[PointCloud], Any]] = {
    **{
        f"icp {kind.value} {direction.value}": functools.partial(
            lambda scene, config: icp(scene, MODEL, X_GUESS, config),
            config=IcpConfig(kind=kind, direction=direction),
        )
        for kind in IcpKind
        for direction in IcpDirection
    },
    "icp_many_starts": lambda s: icp_many_starts(s, MODEL, [X_GUESS, X_GUESS.inverse()]),
    "coherent_point_drift": lambda s: coherent_point_drift(s, MODEL, X_GUESS),
    "filter_registration": lambda s: filter_registration(s, MODEL, X_GUESS),
    "filter to planes": lambda s: filter_registration(
        s, MODEL, X_GUESS, FilterRegConfig(point_to_plane=True)
    ),
    "refine_pose": lambda s: refine_pose(s, box_field(), X_GUESS),
    "refine_poses": lambda s: refine_poses(s, box_field(), [X_GUESS, X_GUESS.inverse()]).best,
    "nonlinear": lambda s: estimate_pose_nonlinear(s, box_field(), X_GUESS),
    "refine_constrained": lambda s: refine_constrained(s.points, box_body(), X_GUESS),
    "locate": lambda s: locate(s, known_box()),
}


def outcome(name: str, scene: PointCloud) -> RegistrationStatus | None:
    """The status, after the checks that every answer must stand; None if the scene is refused."""
    try:
        result = REGISTRATIONS[name](scene)
    except ValueError as error:
        if "scene" not in str(error):
            raise
        return None
    assert result.inliers.shape == (len(scene),)
    assert isinstance(result.message, str)
    if result.X_WO is not None:
        assert not result.X_WO.IsExactlyIdentity()
        assert np.isfinite(result.X_WO.GetAsMatrix4()).all()
    if result.succeeded:
        assert np.isfinite(result.residual)
        assert np.isfinite(result.covariance).all()
        assert np.linalg.eigvalsh(result.covariance).min() >= -1e-12
    else:
        assert result.message
    return result.status


@pytest.mark.parametrize("name", REGISTRATIONS)
def test_scenes_that_tell_no_pose_do_not_succeed(name):
    rng = np.random.default_rng(5)
    noise = rng.normal(size=(200, 3))
    scenes = {kind: cloud_of(points) for kind, points in nasty_points().items() if kind != "flat"}
    del scenes["one far off"], scenes["all far off"]
    scenes["noise"] = PointCloud(noise, noise / np.linalg.norm(noise, axis=1, keepdims=True))
    for kind, scene in scenes.items():
        assert outcome(name, scene) is not SUCCESS, kind


@pytest.mark.parametrize("name", REGISTRATIONS)
def test_a_good_scene_succeeds_and_one_stray_point_changes_nothing_unless_it_says_so(name):
    scene = MODEL if name.startswith(("icp", "coh", "fil")) else box_cloud(1500, seed=3)
    scene = scene.transformed(RigidTransform(RollPitchYaw(0.02, 0.01, -0.02), [0.002, 0.001, 0]))
    # Of a box seen from all around every half turn fits; and a start may end at another one.
    fine = {SUCCESS, RegistrationStatus.AMBIGUOUS}
    assert outcome(name, scene) in fine
    stray = scene.points.copy()
    stray[3] = 1e9
    if outcome(name, scene.replace(points=stray)) is SUCCESS:
        X_WO = REGISTRATIONS[name](scene.replace(points=stray)).X_WO
        np.testing.assert_allclose(X_WO.translation(), [0.002, 0.001, 0], atol=0.003)


@pytest.mark.parametrize("name", REGISTRATIONS)
def test_poses_that_are_not_finite_are_refused(name):
    calls: dict[str, Callable[[RigidTransform], Any]] = {
        "icp": lambda X: icp(CLOUD, MODEL, X),
        "icp_many_starts": lambda X: icp_many_starts(CLOUD, MODEL, [X]),
        "coherent_point_drift": lambda X: coherent_point_drift(CLOUD, MODEL, X),
        "filter_registration": lambda X: filter_registration(CLOUD, MODEL, X),
        "refine_pose": lambda X: refine_pose(CLOUD, box_field(), X),
        "refine_poses": lambda X: refine_poses(CLOUD, box_field(), [X]),
        "nonlinear": lambda X: estimate_pose_nonlinear(CLOUD, box_field(), X),
        "refine_constrained": lambda X: refine_constrained(POINTS, box_body(), X),
    }
    if name in calls:
        with pytest.raises(ValueError, match="X_WO_guess"):
            calls[name](X_NAN)


COORDINATE = st.one_of(
    st.floats(-0.1, 0.1),
    st.sampled_from([0.0, 0.05, -0.05, 1e9, -1e9, 1e20, 1e-300, 1e29]),
)


@settings(max_examples=40, deadline=None)
@given(
    st.lists(st.tuples(COORDINATE, COORDINATE, COORDINATE), max_size=12),
    st.sampled_from([name for name in REGISTRATIONS if name != "locate"]),
)
def test_any_few_points_are_answered(rows, name):
    points = np.array(rows, dtype=float).reshape(-1, 3)
    outcome(name, PointCloud(points, np.tile([0, 0, 1.0], (len(points), 1))))


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.tuples(COORDINATE, COORDINATE, COORDINATE), min_size=1, max_size=8),
    st.integers(0, 2**32 - 1),
)
def test_any_correspondences_are_answered(rows, seed):
    model = np.array(rows, dtype=float)
    scene = np.random.default_rng(seed).permutation(model)
    for result in (
        fit_rigid(model, scene).result(),
        fit_rotation(model, scene).result(),
        register_correspondences(model, scene, 0.001),
        ransac_pose(model, scene, 0.001, max_samples=100),
    ):
        assert result.inliers.shape == (len(model),)
        if result.X_WO is not None:
            assert np.isfinite(result.X_WO.GetAsMatrix4()).all()
        if result.succeeded:
            assert np.isfinite(result.covariance).all()


def sphere(count: int, seed: int) -> PointCloud:
    normals = np.random.default_rng(seed).normal(size=(count, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return PointCloud(0.05 * normals, normals)


def cylinder(count: int, seed: int) -> PointCloud:
    rng = np.random.default_rng(seed)
    angle, z = rng.uniform(0, 2 * np.pi, count), rng.uniform(-0.08, 0.08, count)
    normals = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    return PointCloud(0.03 * normals + [0, 0, 1] * z[:, None], normals)


def plane(count: int, seed: int) -> PointCloud:
    points = np.random.default_rng(seed).uniform(-0.1, 0.1, (count, 3)) * [1, 1, 0]
    return PointCloud(points, np.tile([0, 0, 1.0], (count, 1)))


# Of each surface, a solid that it belongs to, where its top is at z = 0; and which motions
# [rotation; translation] it has on itself.
SLIDING = {
    "sphere": (sphere, lambda: primitives.sphere(0.05), 0.0, [1, 1, 1, 0, 0, 0]),
    "cylinder": (cylinder, lambda: primitives.cylinder(0.03, 0.3), 0.0, [0, 0, 1, 0, 0, 1]),
    "plane": (plane, lambda: primitives.box([0.6, 0.6, 0.1]), -0.05, [0, 0, 1, 1, 1, 0]),
}


@pytest.mark.parametrize("name", SLIDING)
def test_surfaces_that_slide_on_themselves_leave_those_motions_free(name):
    surface, solid, z, motions = SLIDING[name]
    mesh = TriangleMesh(solid().vertices + [0, 0, z], solid().faces)
    field = DistanceField.from_mesh(mesh, 0.006, margin=0.03)
    scene, model = surface(2500, 0), surface(2500, 1)
    noise = np.random.default_rng(2).normal(scale=0.0005, size=scene.points.shape)
    scene = scene.replace(points=scene.points + noise)
    X_start = RigidTransform(RollPitchYaw(0.01, 0, 0), [0.001, 0, 0.001])
    for result in (
        refine_pose(scene, field, X_start),
        estimate_pose_nonlinear(scene, field, X_start),
        icp(scene, model, X_start),
        icp(scene, model, X_start, IcpConfig(kind=IcpKind.GENERALIZED)),
    ):
        assert result.status is RegistrationStatus.DEGENERATE
        fixed = result.free_directions[:, np.array(motions) == 0]
        assert np.abs(fixed).max() < 0.2
    assert len(refine_pose(scene, field, X_start).free_directions) == sum(motions)


def test_unlike_and_symmetric_objects_are_named_as_such():
    unlike = sphere(1500, 0)
    assert locate(unlike, known_box()).status in (
        RegistrationStatus.NO_CONSENSUS,
        RegistrationStatus.LOW_OVERLAP,
    )
    # Half turns of a box do not change it.
    half_turns = [RigidTransform(RollPitchYaw(*rpy), [0, 0, 0.001]) for rpy in np.pi * np.eye(3)]
    scene = box_cloud(800, seed=4)
    refined = refine_poses(scene, box_field(), half_turns, RefineConfig(num_finalists=3)).best
    assert refined.status is RegistrationStatus.AMBIGUOUS
    assert icp_many_starts(scene, MODEL, half_turns).status is RegistrationStatus.AMBIGUOUS


@pytest.mark.parametrize(
    ("estimate", "trials"),
    [
        (lambda scene, model: fit_rigid(model.points, scene.points).result(), 100),
        (lambda scene, model: refine_pose(scene, box_field(), X_GUESS), 80),
        (lambda scene, model: icp(scene, dense_box(), X_GUESS), 40),
        (lambda scene, model: register_correspondences(model.points, scene.points, 0.004), 80),
    ],
    ids=["fit_rigid", "refine_pose", "icp", "register_correspondences"],
)
def test_poses_err_as_their_covariance_says(estimate, trials):
    rng = np.random.default_rng(3)
    model = box_cloud(300, seed=7)
    X_WO = RigidTransform(RollPitchYaw(0.03, -0.02, 0.05), [0.002, 0.001, 0.003])
    surprise = []
    for _ in range(trials):
        scene = model.transformed(X_WO)
        scene = scene.replace(points=scene.points + rng.normal(scale=0.001, size=(300, 3)))
        result = estimate(scene, model)
        assert result.succeeded
        X_error = result.X_WO @ X_WO.inverse()
        angle_axis = X_error.rotation().ToAngleAxis()
        shift = result.X_WO.translation() - X_WO.translation()
        error = np.concatenate([angle_axis.angle() * angle_axis.axis(), shift])
        surprise.append(error @ np.linalg.solve(result.covariance, error))
    # Of mean 6 if the covariance is right.
    assert 0.6 < np.mean(surprise) / 6 < 1.8


@functools.cache
def dense_box() -> IcpModel:
    return IcpModel(box_cloud(6000, seed=9))
