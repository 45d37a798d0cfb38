"""Motions of the gallery: arms that swing every joint, hands that close, open and wave."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from pydrake.math import BsplineBasis
from pydrake.multibody.tree import Joint
from pydrake.trajectories import BsplineTrajectory

from prehensile.kinematics.joint_limits import JointLimits
from prehensile.planning.trajectory import time_parameterize
from prehensile.station.guard import GuardLimits
from prehensile.tasks.gallery_robots import Robot, is_free

HOLD = 1.0
"""Seconds that every robot holds still before it moves."""

_SPEED = 1.0  # rad/s, the fastest that an arm's joint is moved in the gallery
_FINGER_SPEED = 2.0  # rad/s or m/s, the same of fingers
_FRACTION = 0.6  # of what velocity and acceleration limits allow
_SWING = 0.5  # rad, to either side of the ready posture
_CLOSED = 0.9  # of the way to the end of a finger's range
_SPREAD = 0.3  # of the same, for joints that go both ways


def swing(robot: Robot) -> BsplineTrajectory:
    """Every joint of an arm swings to one side and to the other, and all come back.

    The way is cut until it leads through no collision of the arm with itself or the floor.
    """
    limits = _joint_limits(robot)
    q = robot.q[robot.index]
    sides = np.where(np.arange(len(q)) % 2 == 0, 1.0, -1.0)  # neighbours go opposite ways
    room = 0.8 * np.minimum(limits.upper - q, q - limits.lower)

    def path(scale: float) -> NDArray[np.float64]:
        reach = sides * np.minimum(scale * _SWING, room)
        return np.array([q, q + reach, q - reach, q + 0.5 * np.roll(reach, 1), q])

    return _follow(robot, path, limits)


def wave(robot: Robot) -> BsplineTrajectory:
    """The fingers of a hand close and open, all at once and one after the other.

    The way is cut until the fingers do not meet.
    """
    limits = _joint_limits(robot)
    q = robot.q[robot.index]
    above, below = limits.upper - q, q - limits.lower
    far = np.where(above > below, limits.upper, limits.lower)
    # What can go both ways from here spreads the fingers: a little of that is enough.
    spreads = np.minimum(above, below) > 0.5 * np.maximum(above, below)
    far = np.where(spreads, q + _SPREAD * (far - q), far)
    fingers = _fingers(robot)
    if len(fingers) == len(q):  # a gripper's jaws move together
        fingers = []

    def path(scale: float) -> NDArray[np.float64]:
        there = q + scale * _CLOSED * (far - q)
        ways = [there, *(np.where(finger, there, q) for finger in fingers)]
        return np.array([q, *(row for way in ways for row in (way, q))])

    return _follow(robot, path, limits)


def _follow(
    robot: Robot, path: Callable[[float], NDArray[np.float64]], limits: JointLimits
) -> BsplineTrajectory:
    """The motion along the greatest of the scaled paths that is free of collisions."""
    scale = next((s for s in 0.85 ** np.arange(16) if is_free(robot, path(s))), 0.0)
    made = path(scale)
    trajectory = time_parameterize(np.clip(made, limits.lower, limits.upper), limits).trajectory
    # The same motion after the time of holding still, during which its start is held.
    basis = trajectory.basis()
    knots = np.array(basis.knots()) + HOLD
    return BsplineTrajectory(BsplineBasis(basis.order(), knots), trajectory.control_points())


def _joint_limits(robot: Robot) -> JointLimits:
    """Limits of the joints of a robot, as far as the gallery uses them."""
    limits = GuardLimits.of_plant(robot.plant, robot.instance)
    every = robot.plant.GetPositionsFromArray(
        robot.instance, np.arange(robot.plant.num_positions())
    ).astype(int)
    own = [every.tolist().index(i) for i in robot.index]
    lower, upper, velocity, acceleration = (
        np.array(values)[own]
        for values in (
            limits.position_lower,
            limits.position_upper,
            limits.velocity,
            limits.acceleration,
        )
    )
    speed = _SPEED if robot.info.category == "arm" else _FINGER_SPEED
    velocity = np.minimum(_FRACTION * velocity, speed)
    return JointLimits(lower, upper, velocity, np.minimum(_FRACTION * acceleration, 4.0 * speed))


def _fingers(robot: Robot) -> list[NDArray[np.bool_]]:
    """For each finger which driven joints are its own: those behind one joint of the palm."""
    plant = robot.plant
    by_child = {
        plant.get_joint(i).child_body().index(): plant.get_joint(i)
        for i in plant.GetJointIndices(robot.instance)
    }
    palm = {body.index() for body in plant.GetBodiesWeldedTo(robot.base)}

    def root(joint: Joint) -> int:
        while joint.parent_body().index() not in palm:
            joint = by_child[joint.parent_body().index()]
        return int(joint.index())

    roots = [root(joint) for joint in robot.joints]
    return [np.array([r == own for r in roots]) for own in dict.fromkeys(roots)]
