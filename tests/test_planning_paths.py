"""Paths: straight where they should be, free of collisions by an independent check, repeatable."""

from itertools import pairwise

import numpy as np
import pytest
from arm_scene import BIN0, BIN1, make_arm, make_diagram
from pydrake.geometry import Box
from pydrake.math import RigidTransform, RotationMatrix

from prehensile.kinematics.poses import pose_distance
from prehensile.planning.cartesian import plan_cartesian
from prehensile.planning.inverse_kinematics import solve_ik
from prehensile.planning.joint_path import plan_joint_path

DOWN = RotationMatrix.MakeXRotation(-0.5 * np.pi)


@pytest.fixture
def arm():
    return make_arm()


class Recheck:
    """Drake's own answer on another copy of the station."""

    def __init__(self) -> None:
        self.diagram = make_diagram()
        self.context = self.diagram.CreateDefaultContext()
        self.plant = self.diagram.plant()
        self.plant_context = self.plant.GetMyMutableContextFromRoot(self.context)
        self.query = self.diagram.scene_graph().get_query_output_port()
        self.query_context = self.diagram.scene_graph().GetMyContextFromRoot(self.context)

    def collides(self, q: np.ndarray) -> bool:
        self.plant.SetPositions(self.plant_context, q)
        return self.query.Eval(self.query_context).HasCollisions()


def over_bin(arm, center, height=0.35):
    result = solve_ik(arm, RigidTransform(DOWN, [*center, height]), arm.q_default)
    assert result.solved
    return result.q


def in_bin(arm, center):
    """The hand inside the bin, the arm clear of the walls."""
    return over_bin(arm, center, 0.18)


def test_cartesian_path_is_straight(arm):
    q_start = over_bin(arm, BIN0)
    turn = RotationMatrix.MakeZRotation(0.4)
    X_WG_goal = RigidTransform(turn @ DOWN, [BIN0[0] + 0.1, BIN0[1] - 0.1, 0.2])
    result = plan_cartesian(arm, q_start, X_WG_goal)
    assert result.found, result.reason
    X_WG_start = arm.pose(q_start)
    assert max(pose_distance(arm.pose(result.path[-1]), X_WG_goal)) < 1e-5
    start, line = X_WG_start.translation(), X_WG_goal.translation() - X_WG_start.translation()
    direction = line / np.linalg.norm(line)
    for a, b in pairwise(result.path):
        for u in np.linspace(0.0, 1.0, 6):
            p = arm.pose((1.0 - u) * a + u * b).translation() - start
            assert np.linalg.norm(p - (p @ direction) * direction) < 5e-4
        assert np.max(np.abs(b - a)) <= 0.15


def test_cartesian_path_stops_at_the_wall_and_names_it(arm):
    q_start = in_bin(arm, BIN0)
    p = arm.pose(q_start).translation()
    result = plan_cartesian(arm, q_start, RigidTransform(DOWN, p + np.array([0.0, 0.4, 0.0])))
    assert result.status == "collision"
    assert "bin0" in result.reason
    assert arm.path_is_free(result.path)


def test_cartesian_path_out_of_the_workspace(arm):
    q_start = over_bin(arm, BIN0)
    result = plan_cartesian(arm, q_start, RigidTransform(DOWN, [1.6, -0.3, 0.4]))
    assert result.status in ("limits", "jump")
    assert result.reason


def test_joint_path_around_a_wall_is_free_between_samples(arm):
    # From inside one bin into the other the straight line crosses the walls.
    q_start, q_goal = in_bin(arm, BIN0), in_bin(arm, BIN1)
    assert not arm.edge_is_free(q_start, q_goal)
    result = plan_joint_path(arm, q_start, q_goal, rng=np.random.default_rng(2))
    assert result.found, result.reason
    np.testing.assert_array_equal(result.path[[0, -1]], [q_start, q_goal])
    recheck = Recheck()
    step = arm.checker.edge_step_size() / 5.0
    for a, b in pairwise(result.path):
        count = int(np.ceil(np.linalg.norm((b - a) * arm.weights) / step)) + 1
        for u in np.linspace(0.0, 1.0, count):
            assert not recheck.collides(arm.full((1.0 - u) * a + u * b))
            assert arm.limits.contain((1.0 - u) * a + u * b)
    again = plan_joint_path(arm, q_start, q_goal, rng=np.random.default_rng(2))
    np.testing.assert_array_equal(result.path, again.path)


def test_joint_path_takes_the_straight_line_where_it_is_free(arm):
    q_start = over_bin(arm, BIN0)
    result = plan_joint_path(arm, q_start, arm.q_default)
    np.testing.assert_array_equal(result.path, [q_start, arm.q_default])


def test_joint_path_refuses_bad_ends_in_words(arm):
    beyond = arm.q_default
    beyond[3] = arm.limits.upper[3] + 0.1
    assert plan_joint_path(arm, arm.q_default, beyond).status == "goal"
    inside = arm.q_default
    inside[1] = arm.limits.upper[1]
    result = plan_joint_path(arm, inside, arm.q_default)
    assert result.status == "start"
    assert "collides" in result.reason
    assert "iiwa" in result.reason


def test_joint_path_gives_up_after_its_budget(arm):
    q_start, q_goal = in_bin(arm, BIN0), in_bin(arm, BIN1)
    result = plan_joint_path(arm, q_start, q_goal, max_iterations=1)
    assert result.status == "budget"
    assert "1 samples" in result.reason


def test_obstacles_and_held_objects_are_seen(arm):
    q = arm.q_default
    assert arm.is_free(q)
    p_WG = arm.pose(q).translation()
    arm.set_obstacles([(Box(0.1, 0.1, 0.02), RigidTransform(p_WG + np.array([0.0, 0.0, -0.3])))])
    assert arm.is_free(q)
    arm.attach(Box(0.05, 0.35, 0.05), RigidTransform([0.0, 0.2, 0.0]))
    assert not arm.is_free(q)
    assert "obstacle" in arm.collisions(q)
    arm.detach()
    assert arm.is_free(q)
    arm.set_obstacles([(Box(0.1, 0.1, 0.1), RigidTransform(p_WG))])
    assert not arm.is_free(q)
    arm.set_obstacles([])
    assert arm.is_free(q)


def test_padding_and_hand_width_matter(arm):
    q = in_bin(arm, BIN0)
    p = arm.pose(q).translation()
    arm.set_hand_width(0.02)
    arm.set_padding(0.0)
    finger = arm.plant.GetBodyByName("left_finger")
    context = arm.plant.CreateDefaultContext()
    arm.plant.SetPositions(context, arm.full(q))
    narrow = finger.EvalPoseInWorld(context).translation()
    # Just outside the closed finger: free closed, not free open or padded.
    outward = (narrow - p) * [1.0, 1.0, 0.0]
    outward /= np.linalg.norm(outward)
    arm.set_obstacles([(Box(0.01, 0.01, 0.01), RigidTransform(narrow + 0.035 * outward))])
    assert arm.is_free(q)
    arm.set_padding(0.05)
    assert not arm.is_free(q)
    arm.set_padding(0.0)
    arm.set_hand_width(0.1)
    assert not arm.is_free(q)
