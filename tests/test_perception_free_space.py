"""Free space of depth images, and refinement that keeps out of it and out of tables."""

import numpy as np
import pytest
from depth_scene import boxes_mesh, d415, look_at, render_depth
from pydrake.math import RigidTransform, RotationMatrix

from prehensile.native import _core
from prehensile.perception.body_evidence import Body, BodyEvidence, EvidenceConfig
from prehensile.perception.camera_model import CameraModel, Distortion, PosedCamera
from prehensile.perception.constrained_refinement import refine_constrained
from prehensile.perception.distance_field import DistanceField
from prehensile.perception.free_space import DepthView, free_space_violation
from prehensile.perception.registration import HalfSpaces, RegistrationStatus

CAMERA = d415(look_at((0.6, -0.3, 0.5), (0, 0, 0.1)))
TABLE = HalfSpaces([[0, 0, 1]], [0])


@pytest.fixture(scope="module")
def hammer() -> Body:
    mesh = boxes_mesh([((0, 0, 0), (0.16, 0.03, 0.025)), ((0.07, 0.01, 0), (0.04, 0.09, 0.04))])
    field = DistanceField.from_mesh(mesh, spacing=0.003, margin=0.035)
    return Body.from_mesh(mesh, field)


def error(X_WO: RigidTransform | None, truth: RigidTransform) -> tuple[float, float]:
    """Distance of the origins [m] and angle [rad]."""
    assert X_WO is not None
    E = truth.inverse() @ X_WO
    return float(np.linalg.norm(E.translation())), E.rotation().ToAngleAxis().angle()


def test_violation_is_what_a_loop_over_points_says():
    rng = np.random.default_rng(0)
    model, X_WC = CAMERA
    depth = rng.uniform(0.3, 1.2, (480, 640)).astype(np.float32)
    depth[rng.uniform(size=depth.shape) < 0.2] = 0
    depth[::7, ::5] = np.nan
    depth[::11, ::3] = np.inf
    ignored = rng.uniform(size=depth.shape) < 0.1
    view = DepthView(depth, CAMERA, ignored)
    points = (X_WC @ rng.uniform([-0.4, -0.3, -0.2], [0.4, 0.3, 1.2], (4000, 3)).T).T
    points = points.reshape(4, 1000, 3)
    found = free_space_violation(points, view, margin=0.02)
    expected = np.zeros((4, 1000))
    pixels = model.project((X_WC.inverse() @ points.reshape(-1, 3).T).T)
    z = (X_WC.inverse() @ points.reshape(-1, 3).T)[2]
    for i, ((u, v), own) in enumerate(zip(pixels, z, strict=True)):
        column, row = np.floor(u + 0.5), np.floor(v + 0.5)
        if not (own > 0 and 0 <= column < 640 and 0 <= row < 480):
            continue
        measured = depth[int(row), int(column)]
        if np.isfinite(measured) and measured > 0 and not ignored[int(row), int(column)]:
            expected.reshape(-1)[i] = max(float(measured) - 0.02 - own, 0)
    assert found.shape == (4, 1000)
    assert (expected > 0).sum() > 300
    np.testing.assert_allclose(found, expected, atol=1e-9)


def test_gradient_and_cost_of_the_surface_term_agree():
    """Central differences of the cost, for every loss, away from a cube's edges."""
    rng = np.random.default_rng(1)
    field = DistanceField.from_mesh(boxes_mesh([((0, 0, 0), (0.2, 0.2, 0.2))]), 0.005, 0.03)
    X = RigidTransform(RotationMatrix.MakeXRotation(0.4), [0.1, 0.2, 0.3])
    points_O = rng.uniform(-0.08, 0.08, (300, 3))
    points_O[np.arange(300), np.arange(300) % 3] = 0.1 + rng.normal(0.001, 0.004, 300)
    points = (X @ points_O.T).T

    def terms(motion, loss):
        turned = RotationMatrix.ProjectToRotationMatrix(np.eye(3) + np.cross(np.eye(3), motion[:3]))
        moved = RigidTransform(turned @ X.rotation(), X.translation() + motion[3:])
        return _core.body_terms(
            points, [field.core], moved.GetAsMatrix4()[None], loss, 0.006, [], [], 0, 1, 0, 0
        )

    for loss in ("least_squares", "huber", "tukey", "geman_mcclure"):
        gradient = terms(np.zeros(6), loss)[1][0]
        step = 1e-5
        differences = [
            (terms(d, loss)[2][0, 0] - terms(-d, loss)[2][0, 0]) / (4 * step)
            for d in step * np.eye(6)
        ]
        np.testing.assert_allclose(
            gradient, differences, rtol=1e-3, atol=1e-3 * np.abs(gradient).max()
        )


def test_no_step_downhill_raises_the_free_space_term(hammer):
    """Far in front of where it was seen, the object is pushed toward where it may be."""
    truth = RigidTransform([0, 0, 0.1])
    view = DepthView(render_depth(CAMERA, [(hammer.field, truth)]), CAMERA)
    data = BodyEvidence([hammer], [view], (), EvidenceConfig(free_space_weight=1.0))
    none = np.zeros((0, 3))
    assert data.at(none, truth.GetAsMatrix4()[None], 0.01).in_free < 0.02
    aside = RigidTransform([0.03, 0.02, 0.13])
    here = data.at(none, aside.GetAsMatrix4()[None], 0.01)
    assert here.in_free > 0.2
    away = here.gradient[0, 3:] / np.linalg.norm(here.gradient[0, 3:])
    closer = RigidTransform(aside.rotation(), aside.translation() - 0.01 * away)
    assert data.at(none, closer.GetAsMatrix4()[None], 0.01).cost < here.cost


def test_object_pulled_into_the_table_rests_on_it(hammer):
    rng = np.random.default_rng(0)
    truth = RigidTransform(RotationMatrix.MakeZRotation(0.8), [0, 0, 0.02])
    depth = render_depth(CAMERA, [(hammer.field, truth)], noise=0.001, rng=rng)
    view = DepthView(depth, CAMERA)
    data = BodyEvidence([hammer], [view], (), EvidenceConfig())
    points = data.points_near(truth.GetAsMatrix4()[None], 0.02) - [0, 0, 0.004]
    guess = RigidTransform(RotationMatrix.MakeZRotation(0.9), [0.01, -0.01, 0.03])
    free = refine_constrained(points, hammer, guess)
    held = refine_constrained(points, hammer, guess, half_spaces=TABLE, views=view)
    assert free.succeeded
    assert held.succeeded
    assert hammer.corners is not None
    assert free.X_WO is not None
    assert held.X_WO is not None
    assert (free.X_WO @ hammer.corners.T)[2].min() < -0.003
    assert (held.X_WO @ hammer.corners.T)[2].min() > -1e-5
    assert error(held.X_WO, truth)[0] < error(free.X_WO, truth)[0]


def test_free_space_holds_what_the_points_leave_free():
    """Points of the middle of a plate leave it free to slide; rays past its edges do not."""
    mesh = boxes_mesh([((0, 0, 0), (0.15, 0.1, 0.02))])
    field = DistanceField.from_mesh(mesh, spacing=0.004, margin=0.04)
    plate = Body.from_mesh(mesh, field)
    truth = RigidTransform([0, 0, 0.01])
    camera = d415(look_at((0.02, -0.05, 0.8), (0, 0, 0)))
    view = DepthView(render_depth(camera, [(field, truth)], background=1.2), camera)
    grid = np.stack(np.meshgrid(np.linspace(-0.04, 0.04, 20), np.linspace(-0.03, 0.03, 20)), -1)
    points = np.c_[grid.reshape(-1, 2), np.full(400, 0.02)]
    guess = RigidTransform(RotationMatrix.MakeZRotation(0.15), [0.02, -0.008, 0.01])
    free = refine_constrained(points, plate, guess)
    assert free.status is RegistrationStatus.DEGENERATE
    assert free.free_directions is not None
    assert len(free.free_directions) == 3
    assert error(free.X_WO, truth)[0] > 0.02
    held = refine_constrained(points, plate, guess, views=view)
    assert error(held.X_WO, truth)[0] < 0.006
    assert error(held.X_WO, truth)[1] < 0.1


def test_impossible_half_spaces_and_empty_scenes_are_told(hammer):
    guess = RigidTransform([0, 0, 0.02])
    points = hammer.points + [0, 0, 0.02]
    slit = HalfSpaces.box([-np.inf, -np.inf, 0], [np.inf, np.inf, 0.01])
    answer = refine_constrained(points, hammer, guess, half_spaces=slit)
    assert answer.status is RegistrationStatus.INFEASIBLE
    clutter = np.random.default_rng(0).uniform(-0.5, 0.5, (500, 3))
    far = refine_constrained(clutter, hammer, guess)
    assert far.status is RegistrationStatus.LOW_OVERLAP
    with pytest.raises(ValueError, match="scene_points"):
        refine_constrained(np.zeros((0, 3)), hammer, guess)
    with pytest.raises(ValueError, match="scene_points"):
        refine_constrained(np.full((5, 3), np.nan), hammer, guess)


@pytest.mark.parametrize(
    ("view", "name"),
    [
        (DepthView(np.ones((3, 3)), CAMERA), "depth"),
        (DepthView(np.ones((480, 640)), CAMERA, np.zeros((3, 3), bool)), "ignored"),
        (
            DepthView(
                np.ones((2, 2)),
                PosedCamera(
                    CameraModel(2, 2, 1, 1, 0, 0, Distortion.BROWN_CONRADY, (0.1, 0, 0, 0, 0)),
                    RigidTransform(),
                ),
            ),
            "camera",
        ),
    ],
)
def test_bad_views_are_named(view, name):
    with pytest.raises(ValueError, match=name):
        free_space_violation(np.zeros((1, 3)), view)


def test_bad_points_are_named():
    view = DepthView(np.ones((480, 640), np.float32), CAMERA)
    for points in (np.zeros(2), np.full((2, 3), np.nan)):
        with pytest.raises(ValueError, match="points_W"):
            free_space_violation(points, view)
    assert free_space_violation(np.zeros((0, 3)), view).shape == (0,)
