"""Joint paths along paths of poses: on the path, within limits, nearest to the nominal posture."""

import numpy as np
import pytest
from arm_scene import make_diagram
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix

from prehensile.kinematics.poses import pose_distance
from prehensile.kinematics.tracing import (
    TracingConfig,
    nearest_configuration,
    posture_near,
    trace_path,
)
from prehensile.kinematics.trajectories import pose_trajectory
from prehensile.kinematics.tree import PlantTree, tree_from_plant

Q_HOME = np.array([0.0, 0.3, 0.0, -1.4, 0.0, 1.4, 0.0])


@pytest.fixture(scope="module")
def tree() -> PlantTree:
    """The iiwa, with the hand's frame as frame 0."""
    plant = make_diagram().plant()
    arm = plant.GetModelInstanceByName("iiwa")
    joints = [plant.get_joint(j) for j in plant.GetJointIndices(arm)]
    joints = [joint for joint in joints if joint.num_positions() == 1]
    return tree_from_plant(plant, [plant.GetFrameByName("body")], joints=joints)


def pose_at(tree, q) -> RigidTransform:
    return RigidTransform(tree.tree.pose(np.asarray(q, float), 0))


def down(x, y, z, yaw=0.0) -> RigidTransform:
    """The hand from above."""
    R = RotationMatrix(RollPitchYaw(0, 0, yaw)) @ RotationMatrix.MakeXRotation(-np.pi / 2)
    return RigidTransform(R, [x, y, z])


def line(X_WA, X_WB):
    return pose_trajectory([0.0, 1.0], [X_WA, X_WB], "linear").value


def test_path_stays_on_the_line_between_its_knots(tree):
    rng = np.random.default_rng(0)
    X_WA = pose_at(tree, Q_HOME)
    for _ in range(5):
        X_WB = down(rng.uniform(0.45, 0.6), rng.uniform(-0.3, 0.3), 0.25, rng.uniform(-0.5, 0.5))
        pose = line(X_WA, X_WB)
        traced = trace_path(tree, 0, pose, 0.0, 1.0, Q_HOME)
        assert traced.found, traced.reason
        for s in rng.uniform(0.0, 1.0, 100):
            q = traced.path(s)
            assert max(pose_distance(pose_at(tree, q), pose(s))) < 1.5e-4
            assert np.all((tree.lower <= q) & (q <= tree.upper))


def test_path_is_that_of_drakes_kinematics(tree):
    # The same arm by Drake, which knows nothing of the tree.
    plant = make_diagram().plant()
    context = plant.CreateDefaultContext()
    traced = trace_path(tree, 0, line(pose_at(tree, Q_HOME), down(0.5, 0.2, 0.3)), 0, 1, Q_HOME)
    plant.SetPositions(context, plant.GetModelInstanceByName("iiwa"), traced.path(1.0))
    X_WG = plant.GetFrameByName("body").CalcPoseInWorld(context)
    assert max(pose_distance(X_WG, down(0.5, 0.2, 0.3))) < 1e-8


def test_closed_paths_of_the_hand_are_closed_for_the_joints(tree):
    # Out over three corners and back; the integral of a pseudo-inverse would drift.
    corners = [pose_at(tree, Q_HOME), down(0.5, 0.3, 0.3), down(0.6, -0.2, 0.2, 0.6)]
    q = Q_HOME
    for X_WA, X_WB in zip(corners, [*corners[1:], corners[0]], strict=True):
        traced = trace_path(tree, 0, line(X_WA, X_WB), 0, 1, q, q_nominal=Q_HOME)
        assert traced.found, traced.reason
        q = traced.path(1.0)
    np.testing.assert_allclose(q, Q_HOME, atol=1e-7)


def test_solution_is_nearest_to_the_nominal_posture(tree):
    # Away from the limits no motion in the null space comes nearer: the difference to the nominal
    # posture is in the row space of the Jacobian.
    X_WG = down(0.5, 0.25, 0.3, 0.3)
    posture = posture_near(tree, Q_HOME)
    q, error = nearest_configuration(tree, 0, X_WG, Q_HOME, posture)
    assert error < 1e-9
    J = tree.tree.jacobian(q, 0)
    null = np.linalg.svd(J)[2][6]
    assert np.abs(null @ (q - Q_HOME)) < 1e-7
    for sign in (-0.2, 0.2):  # and from elsewhere on the same branch it is the same
        guess = np.clip(q + sign * null, tree.lower, tree.upper)
        again, _ = nearest_configuration(tree, 0, X_WG, guess, posture)
        np.testing.assert_allclose(again, q, atol=1e-7)


def test_gradient_of_the_posture_by_differences(tree):
    posture = posture_near(tree, Q_HOME)
    rng = np.random.default_rng(1)
    h = 1e-6
    for _ in range(20):
        q = rng.uniform(posture.lower, posture.upper)
        q[0] = posture.upper[0] - 0.1  # one of them deep in its margin
        _, curvature = posture.gradient(q)
        for i in range(7):
            dq = h * np.eye(7)[i]
            slope = (posture.gradient(q + dq)[0] - posture.gradient(q - dq)[0])[i] / (2 * h)
            assert slope == pytest.approx(curvature[i], rel=1e-5)


def test_at_rest_the_joints_are_at_rest_at_both_ends(tree):
    motion = pose_trajectory([0.0, 2.0], [pose_at(tree, Q_HOME), down(0.5, 0.2, 0.3)])
    traced = trace_path(tree, 0, motion.value, 0.0, 2.0, Q_HOME, at_rest=True)
    np.testing.assert_allclose(traced.path([0.0, 2.0], 1), np.zeros((2, 7)), atol=1e-12)


def test_out_of_reach_says_where(tree):
    traced = trace_path(tree, 0, line(pose_at(tree, Q_HOME), down(1.5, 0.0, 0.3)), 0, 1, Q_HOME)
    assert not traced.found
    assert traced.status in ("unreachable", "limits")
    assert 0.1 < traced.at < 0.9
    # It is out of reach there: the arm, 1.3 m long, ends before.
    p = line(pose_at(tree, Q_HOME), down(1.5, 0.0, 0.3))(traced.at).translation()
    assert np.linalg.norm(p - [0, 0, 0.34]) > 0.7


def test_limits_are_named(tree):
    # Turning the hand on the spot about its axis uses up joint 7.
    X_WA = pose_at(tree, Q_HOME)
    turn = lambda s: X_WA @ RigidTransform(RotationMatrix.MakeYRotation(5.0 * s), [0, 0, 0])  # noqa: E731
    traced = trace_path(tree, 0, turn, 0.0, 1.0, Q_HOME)
    assert not traced.found
    assert traced.status in ("limits", "jump")
    assert "iiwa_joint" in traced.reason


def test_start_elsewhere_is_refused(tree):
    traced = trace_path(tree, 0, line(down(0.5, 0, 0.3), down(0.5, 0.1, 0.3)), 0, 1, Q_HOME)
    assert traced.status == "start"
    assert "mm" in traced.reason


def test_jumps_of_the_pose_are_refused(tree):
    X_WA, X_WB = pose_at(tree, Q_HOME), down(0.5, 0.2, 0.3)
    config = TracingConfig(max_refinements=1)
    pose = lambda s: X_WA if s < 0.5 else X_WB  # noqa: E731
    traced = trace_path(tree, 0, pose, 0, 1, Q_HOME, config=config)
    assert traced.status == "jump"
    assert traced.at == pytest.approx(0.5, abs=0.1)


def test_tolerance_decides_how_many_poses_are_solved(tree):
    pose = line(pose_at(tree, Q_HOME), down(0.5, 0.3, 0.3, 0.5))
    coarse, fine = (
        trace_path(tree, 0, pose, 0, 1, Q_HOME, config=TracingConfig(tolerance=tolerance))
        for tolerance in (1e-3, 1e-7)
    )
    assert len(coarse.path.x) < len(fine.path.x)
    errors = [max(pose_distance(pose_at(tree, fine.path(s)), pose(s))) for s in (0.11, 0.53, 0.91)]
    assert max(errors) < 2e-7


def test_misuse_is_named(tree):
    with pytest.raises(ValueError, match="q_start must be"):
        trace_path(tree, 0, lambda s: RigidTransform(), 0, 1, np.zeros(6), q_nominal=Q_HOME)
    with pytest.raises(ValueError, match="q_nominal must be"):
        trace_path(tree, 0, lambda s: RigidTransform(), 0, 1, Q_HOME, q_nominal=np.zeros(8))


def test_what_is_out_of_range_is_named(tree):
    X = pose_at(tree, Q_HOME)
    for start, end in ((1.0, 1.0), (1.0, 0.0), (0.0, np.nan)):
        with pytest.raises(ValueError, match="^s_start, s_end"):
            trace_path(tree, 0, lambda s: X, start, end, Q_HOME)
    for q in (Q_HOME[:5], np.full(7, np.nan)):
        with pytest.raises(ValueError, match="^q_start"):
            trace_path(tree, 0, lambda s: X, 0.0, 1.0, q)
    for change in (
        {"tolerance": np.nan},
        {"translation": 0.0},
        {"rotation": -1.0},
        {"max_joint_step": 2.0},
        {"max_refinements": 0},
    ):
        with pytest.raises(ValueError, match=f"^{next(iter(change))}"):
            TracingConfig(**change)
