"""Differential inverse kinematics as a Drake System: it arrives, within limits, whatever comes."""

import functools

import numpy as np
import pytest
from iiwa_plant import make_iiwa
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.systems.analysis import Simulator

from prehensile.kinematics.differential_ik import (
    DifferentialIkConfig,
    DifferentialIkStatus,
    FrameTask,
    JointLimits,
    virtual_walls,
)
from prehensile.kinematics.poses import pose_distance
from prehensile.kinematics.systems import DifferentialInverseKinematics
from prehensile.kinematics.tree import PlantTree, tree_from_plant

Q0 = np.array([0.2, 0.6, 0.1, -1.7, 0.1, 0.9, 0.3])
HAND, ELBOW = "iiwa_link_7", "iiwa_link_4"


@functools.cache
def iiwa() -> PlantTree:
    plant = make_iiwa()
    return tree_from_plant(plant, [plant.GetFrameByName(HAND), plant.GetFrameByName(ELBOW)])


def pose(q, frame=0) -> RigidTransform:
    return RigidTransform(iiwa().tree.pose(q, frame))


class Rig:
    """The System in a simulator, its positions recorded."""

    def __init__(self, tasks=None, config=None, q0=Q0, **options) -> None:
        tasks = tasks or [FrameTask(gain=20.0)]
        config = config or DifferentialIkConfig(damping=0.02)
        self.system = DifferentialInverseKinematics(iiwa(), tasks, config, **options)
        self.context = self.system.CreateDefaultContext()
        self.fix("estimated_state", np.append(q0, np.zeros(7)))
        self.simulator = Simulator(self.system, self.context)
        self.period = config.period
        self.path = [np.array(q0)]

    def fix(self, port, value) -> None:
        self.system.GetInputPort(port).FixValue(self.context, value)

    def get(self, port):
        return self.system.GetOutputPort(port).Eval(self.context).copy()

    def run(self, steps) -> None:
        for _ in range(steps):
            # Half a period after the update.
            self.simulator.AdvanceTo((len(self.path) - 0.5) * self.period)
            self.path.append(self.get("position"))

    def assert_limits(self) -> None:
        limits = JointLimits.of_tree(iiwa())
        q = np.array(self.path)
        v = np.diff(q, axis=0) / self.period
        assert (q <= limits.upper + 1e-9).all()
        assert (q >= limits.lower - 1e-9).all()
        assert (np.abs(v) <= limits.velocity + 1e-9).all()
        change = np.diff(v, axis=0) / self.period
        assert (np.abs(change) <= limits.acceleration + 1e-8).all()


def test_it_arrives_within_limits():
    rig = Rig()
    goal = pose(Q0 + [0.5, -0.3, 0.4, 0.5, -0.6, 0.3, 0.9])
    rig.fix(f"{HAND}.pose", goal)
    rig.run(600)
    distance, angle = pose_distance(pose(rig.get("position")), goal)
    assert distance < 1e-4
    assert angle < 1e-3
    assert rig.get("status")[0] == DifferentialIkStatus.OPTIMAL
    rig.assert_limits()


@pytest.mark.parametrize("formulation", ["least_squares", "direction", "pseudo_inverse"])
def test_limits_hold_on_the_way_to_what_is_out_of_reach(formulation):
    rig = Rig(config=DifferentialIkConfig(formulation=formulation, period=0.01))
    for k, p in enumerate(([2.0, 0, 0.3], [0, 0, 0.05], [-1.0, -1.0, 1.0])):
        rig.fix(f"{HAND}.pose", RigidTransform(RollPitchYaw(0.1, 0.5 * k, k), p))
        rig.run(150)
    rig.assert_limits()


def test_velocities_are_followed():
    rig = Rig()
    V = np.array([0.0, 0, 0.2, 0.05, 0, -0.05])
    rig.fix(f"{HAND}.velocity", V)
    rig.run(100)
    before = pose(rig.get("position"))
    rig.run(100)
    after = pose(rig.get("position"))
    moved = after.translation() - before.translation()
    np.testing.assert_allclose(moved / 0.5, V[3:], atol=1e-3)
    turned = (after.rotation() @ before.rotation().inverse()).ToAngleAxis()
    np.testing.assert_allclose(turned.angle() * turned.axis() / 0.5, V[:3], atol=5e-3)


def test_it_slows_down_and_holds_without_a_valid_input():
    rig = Rig()
    rig.run(3)
    assert rig.get("status")[0] == DifferentialIkStatus.INVALID
    np.testing.assert_array_equal(rig.get("position"), Q0)
    rig.fix(f"{HAND}.velocity", np.array([0, 0, 0.5, 0, 0, 0.1]))
    rig.run(60)
    assert rig.get("status")[0] == DifferentialIkStatus.OPTIMAL
    rig.fix(f"{HAND}.velocity", np.full(6, np.nan))
    rig.run(60)
    assert rig.get("status")[0] == DifferentialIkStatus.INVALID
    np.testing.assert_array_equal(rig.get("velocity"), 0)
    rig.assert_limits()
    rig.fix(f"{HAND}.velocity", np.zeros(6))
    rig.run(1)
    assert rig.get("status")[0] == DifferentialIkStatus.OPTIMAL


def test_measured_positions_count_if_it_is_no_integrator():
    rig = Rig(integrator=False)
    rig.fix(f"{HAND}.velocity", np.array([0, 0, 0, 0, 0, 0.2]))
    rig.run(50)
    # The joints are said not to move: each command is one step ahead of where they are.
    np.testing.assert_allclose(rig.get("position"), Q0 + 0.005 * rig.get("velocity"), atol=1e-15)
    assert np.linalg.norm(rig.get("velocity")) > 0.05
    rig.fix("estimated_state", np.full(14, np.nan))
    rig.run(1)
    assert rig.get("status")[0] == DifferentialIkStatus.INVALID


def test_the_elbow_moves_below_a_hand_that_stays():
    """Strict priorities: the hand first, the elbow as far as that permits."""
    tasks = (
        FrameTask(frame=1, weights=(0, 0, 0, 0, 1, 0), priority=1),
        FrameTask(frame=0, priority=0),
    )
    rig = Rig(tasks, DifferentialIkConfig(formulation="priorities"))
    hand, elbow = pose(Q0), pose(Q0, 1)
    rig.fix(f"{HAND}.pose", hand)
    rig.fix(f"{ELBOW}.pose", RigidTransform(elbow.translation() + [0, 0.1, 0]))
    rig.run(400)
    assert pose_distance(pose(rig.get("position")), hand)[0] < 1e-4
    moved = pose(rig.get("position"), 1).translation() - elbow.translation()
    assert moved[1] == pytest.approx(0.1, abs=2e-3)
    rig.assert_limits()


def test_a_wall_of_the_user():
    top = pose(Q0).translation()[2] + 0.05

    def wall(q):
        X, J = iiwa().tree.pose_and_jacobian(q, 0)
        return virtual_walls([[0, 0, 1.0]], [top], X[:3, 3], J[3:], gain=10.0)

    rig = Rig(constraints=wall)
    goal = RigidTransform(pose(Q0).rotation(), pose(Q0).translation() + [0.0, 0.1, 0.15])
    rig.fix(f"{HAND}.pose", goal)
    rig.run(500)
    heights = [pose(q).translation()[2] for q in rig.path]
    assert max(heights) < top + 1e-4
    end = pose(rig.get("position")).translation()
    np.testing.assert_allclose(end, [*goal.translation()[:2], top], atol=1e-3)
