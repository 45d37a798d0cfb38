"""Heights of what was seen: nothing below them, and plans that keep above them."""

import numpy as np
import pytest
from arm_scene import BIN0, make_arm
from pydrake.geometry import Box
from pydrake.math import RigidTransform, RotationMatrix

from prehensile.planning.obstacles import HeightMap, shape_points
from prehensile.planning.pick import plan_pick

DOWN = RotationMatrix.MakeXRotation(-0.5 * np.pi)


def tower(x: float, y: float, height: float, half: float = 0.03) -> np.ndarray:
    """Points on the top and sides of a column with a square base."""
    grid = np.linspace(-half, half, 2 * int(half / 0.005) + 1)
    gx, gy = np.meshgrid(grid, grid)
    top = np.column_stack([gx.ravel(), gy.ravel(), np.full(gx.size, height)])
    side = np.column_stack([np.full(200, half), np.zeros(200), np.linspace(0.0, height, 200)])
    return np.vstack([top, side]) + [x, y, 0.0]


def test_points_near_or_under_what_was_seen_are_low():
    seen = np.random.default_rng(0).uniform([-0.2, -0.3, 0.0], [0.4, 0.1, 0.2], (200, 3))
    heights = HeightMap(seen, cell=0.01, clearance=0.015)
    for point in seen:
        assert heights.lowers(point[None])
        assert heights.lowers(point[None] - [[0.0, 0.0, 1.0]])
        assert heights.lowers(point[None] + [[0.014, -0.014, 0.014]])
    high = seen + [0.0, 0.0, 0.25]
    assert not heights.lowers(high)
    # Two cells more than the clearance away from everything.
    away = np.random.default_rng(1).uniform(-1.0, 1.0, (2000, 3))
    gap = np.abs(away[:, None, :2] - seen[None, :, :2]).max(axis=2).min(axis=1)
    far = away[gap > 0.035]
    assert len(far) > 100
    assert not heights.lowers(far)


def test_empty_map_and_cut():
    assert not HeightMap(np.empty((0, 3))).lowers(np.zeros((1, 3)))
    heights = HeightMap(np.vstack([tower(0.0, 0.0, 0.2), tower(0.3, 0.0, 0.2)]))
    cut = heights.cut(np.array([0.3, 0.0, 9.0]), 0.08)
    assert cut.lowers(np.array([[0.0, 0.0, 0.1]]))
    assert not cut.lowers(np.array([[0.3, 0.0, 0.1]]))
    assert heights.lowers(np.array([[0.3, 0.0, 0.1]]))


def test_shape_points_cover_the_surface():
    X_FS = RigidTransform(RotationMatrix.MakeZRotation(0.4), [0.1, 0.2, 0.3])
    points = X_FS.inverse().multiply(shape_points(Box(0.1, 0.05, 0.2), X_FS).T).T
    np.testing.assert_allclose(np.abs(points).max(axis=0), [0.05, 0.025, 0.1], atol=1e-9)
    corner = np.array([0.05, 0.025, 0.1])
    assert np.linalg.norm(points - corner, axis=1).min() < 1e-9
    assert np.linalg.norm(points - [0.05, 0.013, 0.04], axis=1).min() < 0.0142


@pytest.fixture(scope="module")
def arm():
    return make_arm()


def test_the_hand_passes_over_what_stands_in_its_way(arm):
    grasp = RigidTransform(DOWN, [BIN0[0], BIN0[1] + 0.12, 0.16])
    arm.set_heights(None)
    free = plan_pick(arm, arm.q_default, [grasp])
    # A tower where the hand would pass: the tip is 0.12 m below the gripper's frame.
    on_the_way = arm.pose(free.approach.value(0.4 * free.approach.duration)).translation()
    points = tower(on_the_way[0], on_the_way[1], on_the_way[2] - 0.05, half=0.06)
    heights = HeightMap(points)
    arm.set_heights(heights)
    plan = plan_pick(arm, arm.q_default, [grasp])
    arm.set_heights(None)
    assert plan.found, plan.reason
    fingers = [arm.plant.GetBodyByName(name) for name in ("left_finger", "right_finger")]
    context = arm.plant.CreateDefaultContext()

    def clears(motion) -> bool:
        for q in motion.sample(0.005):
            if np.linalg.norm(arm.pose(q).translation() - plan.X_WG.translation()) < 0.09:
                break  # on the straight line in
            arm.plant.SetPositions(context, arm.full(q))
            for finger in fingers:
                tip = finger.EvalPoseInWorld(context).multiply([0.0, 0.04, 0.0])
                inside = np.all(np.abs(tip[:2] - on_the_way[:2]) < 0.06)
                if inside and tip[2] < on_the_way[2] - 0.05:
                    return False
        return True

    assert not clears(free.approach)
    assert clears(plan.approach)


def test_the_hand_backs_off_farther_from_among_tall_things(arm):
    x, y = BIN0
    grasp = RigidTransform(DOWN, [x, y, 0.16])
    walls = np.vstack([tower(x - 0.1, y, 0.2), tower(x + 0.1, y, 0.2)])
    arm.set_heights(HeightMap(walls))
    plan = plan_pick(arm, arm.q_default, [grasp])
    assert arm.heights is not None  # as before
    arm.set_heights(None)
    assert plan.found, plan.reason
    near = plan_pick(arm, arm.q_default, [grasp])
    straight = [arm.pose(q).translation() for q in plan.approach.path]
    above = [p[2] for p in straight if np.linalg.norm(p[:2] - [x, y]) < 1e-4]
    straight = [arm.pose(q).translation() for q in near.approach.path]
    above_near = [p[2] for p in straight if np.linalg.norm(p[:2] - [x, y]) < 1e-4]
    assert max(above_near) == pytest.approx(0.26, abs=1e-3)
    assert max(above) >= 0.36 - 1e-3
