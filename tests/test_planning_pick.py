"""Plans of whole picks and drops: they reach what they say, as it was asked, and say why not."""

import numpy as np
import pytest
from arm_scene import BIN0, BIN1, make_arm
from pydrake.geometry import Box
from pydrake.math import RigidTransform, RotationMatrix

from prehensile.behavior.trajectory_player import Segment, SegmentPlayer
from prehensile.errors import InputError
from prehensile.kinematics.poses import pose_distance
from prehensile.planning.pick import (
    MoveOptions,
    X_GFlipped,
    drop_poses,
    plan_move,
    plan_pick,
    plan_place,
)

DOWN = RotationMatrix.MakeXRotation(-0.5 * np.pi)
BRICK = (Box(0.05, 0.05, 0.075), RigidTransform([0.0, 0.12, 0.0]))


def grasp(x: float, y: float, z: float = 0.16, yaw: float = 0.0) -> RigidTransform:
    """The hand over a point of bin0, at height z."""
    turn = RotationMatrix.MakeZRotation(yaw)
    return RigidTransform(turn @ DOWN, [BIN0[0] + x, BIN0[1] + y, z])


@pytest.fixture(scope="module")
def arm():
    return make_arm()


@pytest.fixture(scope="module")
def pick(arm):
    grasps = [grasp(3.0, 0.0), grasp(-0.19, 0.0), grasp(0.05, 0.1, yaw=0.7), grasp(0.0, 0.0)]
    return grasps, plan_pick(arm, arm.q_default, grasps)


def test_the_first_feasible_grasp_is_taken(arm, pick):
    grasps, plan = pick
    assert plan.found
    assert plan.index == 2
    assert len(plan.rejected) == 2
    assert "out of reach" in plan.rejected[0]
    assert "bin0" in plan.rejected[1]
    same = min(max(pose_distance(plan.X_WG, grasps[2] @ X)) for X in (RigidTransform(), X_GFlipped))
    assert same < 1e-5
    np.testing.assert_array_equal(plan.approach.path[0], arm.q_default)
    assert max(pose_distance(arm.pose(plan.approach.q_end), plan.X_WG)) < 1e-5


def test_the_hand_comes_in_along_its_axis_and_lifts_straight_up(arm, pick):
    _, plan = pick
    # Motions as they are played, with corners rounded and times.
    in_grasp = [plan.X_WG.inverse() @ arm.pose(q) for q in plan.approach.sample(0.005)]
    near = [X for X in in_grasp if X.translation()[1] > -0.08 and np.ptp(X.translation()) < 0.2]
    assert len(near) > 5
    for X in near:
        assert np.linalg.norm(X.translation()[[0, 2]]) < 2e-3
        assert max(pose_distance(RigidTransform(X.rotation()), RigidTransform())) < 0.02
    lift = np.array([arm.pose(q).translation() for q in plan.lift.sample(0.005)])
    assert np.max(np.linalg.norm(lift[:, :2] - plan.X_WG.translation()[:2], axis=1)) < 1e-3
    assert lift[-1, 2] - lift[0, 2] == pytest.approx(0.25, abs=1e-5)
    assert np.all(np.diff(lift[:, 2]) >= -1e-6)


def test_motions_are_free_and_within_limits(arm, pick):
    _, plan = pick
    place = plan_place(arm, plan.lift.q_end, [grasp(*(np.array(BIN1) - BIN0), z=0.3)], held=BRICK)
    assert place.found, place.reason
    home = plan_move(arm, place.retreat.q_end, arm.q_default)
    assert home.found, home.reason
    for motion in (plan.approach, plan.lift, place.carry, place.retreat, home.motion):
        assert arm.limits.contain(motion.sample(0.002), 1e-9)
        t = np.linspace(0.0, motion.duration, 2000)
        for order, limit in ((1, arm.limits.velocity), (2, arm.limits.acceleration)):
            rate = motion.trajectory.MakeDerivative(order).vector_values(t).T
            assert np.all(np.abs(rate) <= limit * (1.0 + 1e-6))
        arm.set_padding(0.0)
        free = all(arm.is_free(q) for q in motion.sample(0.002))
        arm.set_padding(0.005)
        assert free
    total = sum(
        m.duration for m in (plan.approach, plan.lift, place.carry, place.retreat, home.motion)
    )
    assert total < 7.0


def test_the_held_object_is_kept_clear(arm):
    long_bar = (Box(0.03, 0.3, 0.03), RigidTransform([0.0, 0.2, 0.0]))
    over_bin1 = np.array(BIN1) - BIN0
    X_WDrop = grasp(*over_bin1, z=0.3)
    high = plan_place(arm, arm.q_default, [grasp(*over_bin1, z=0.55)])
    start = high.carry.q_end
    assert plan_place(arm, start, [X_WDrop]).found
    refused = plan_place(arm, start, [X_WDrop], held=long_bar)
    assert not refused.found
    assert "wsg::body" in refused.reason
    assert not arm.checker.GetAllAddedCollisionShapes().get("held")  # put down again


def test_a_held_shape_that_touches_at_the_start_does_not_stop_the_arm(arm):
    deep = plan_pick(arm, arm.q_default, [grasp(0.0, 0.0)]).approach.q_end
    wide = (Box(0.6, 0.1, 0.1), RigidTransform([0.0, 0.12, 0.0]))
    X_WDrop = grasp(*(np.array(BIN1) - BIN0), z=0.35)
    assert plan_place(arm, deep, [X_WDrop]).found
    assert plan_place(arm, deep, [X_WDrop], held=wide).found


def test_same_seed_same_plan(arm):
    drops = drop_poses(np.array([*BIN1, 0.3]), np.full(3, 0.05), np.random.default_rng(1), 4)
    plans = [plan_place(arm, arm.q_default, drops, rng=np.random.default_rng(7)) for _ in range(2)]
    assert plans[0].index == plans[1].index
    np.testing.assert_array_equal(plans[0].carry.sample(), plans[1].carry.sample())


def test_drop_poses_point_down_within_the_box():
    center, half = np.array([0.1, -0.5, 0.3]), np.array([0.1, 0.05, 0.0])
    for X_WG in drop_poses(center, half, np.random.default_rng(0), 50):
        assert np.all(np.abs(X_WG.translation() - center) <= half + 1e-12)
        np.testing.assert_allclose(X_WG.rotation().col(1), [0.0, 0.0, -1.0], atol=1e-12)


def test_nothing_to_grasp_is_said(arm):
    assert plan_pick(arm, arm.q_default, []).reason == "no grasps were given"
    plan = plan_pick(arm, arm.q_default, [grasp(3.0, 0.0), grasp(0.0, 2.0)])
    assert not plan.found
    assert plan.reason.count("out of reach") == 2


def test_no_more_poses_than_allowed_are_tried(arm):
    plan = plan_pick(
        arm, arm.q_default, [grasp(3.0, 0.0)] * 5, options=MoveOptions(max_poses=2, starts=1)
    )
    assert len(plan.rejected) == 2


def test_player_plays_segments_in_order(arm, pick):
    _, plan = pick
    player = SegmentPlayer(
        [
            Segment.move(plan.approach, 0.1, settle=0.2),
            Segment.wait(plan.approach.q_end, 0.0, 0.5),
            Segment.move(plan.lift, 0.0),
        ]
    )
    T = plan.approach.duration
    assert player.duration == pytest.approx(T + 0.7 + plan.lift.duration)
    for t, q, width, done in (
        (0.0, arm.q_default, 0.1, False),
        (0.5 * T, plan.approach.value(0.5 * T), 0.1, False),
        (T + 0.1, plan.approach.q_end, 0.1, False),
        (T + 0.3, plan.approach.q_end, 0.0, False),
        (T + 0.7 + 0.2, plan.lift.value(0.2), 0.0, False),
        (1e3, plan.lift.q_end, 0.0, True),
    ):
        command = player.command(t)
        np.testing.assert_allclose(command[0], q, atol=1e-12)
        assert command[1:] == (width, done)


def test_player_needs_segments():
    with pytest.raises(InputError):
        SegmentPlayer([])
