"""Motions through keyframes: poses, widths and joints agree, and keep every limit."""

import dataclasses as dc

import numpy as np
import pytest
from arm_scene import make_diagram
from pydrake.math import RigidTransform, RotationMatrix

from prehensile.kinematics.joint_limits import JointLimits
from prehensile.kinematics.keyframe_timing import TimingConfig, keyframe_motion, time_keyframes
from prehensile.kinematics.keyframes import Keyframe, pick_and_place_keyframes
from prehensile.kinematics.poses import pose_distance
from prehensile.kinematics.tree import tree_from_plant

Q_HOME = np.array([0.0, 0.3, 0.0, -1.4, 0.0, 1.4, 0.0])
X_OG = RigidTransform(RotationMatrix.MakeXRotation(-np.pi / 2), [0.0, 0.0, 0.11])
UP = RigidTransform([0.0, 0.0, 0.1])


@pytest.fixture(scope="module")
def tree():
    """The iiwa, with the hand's frame as frame 0."""
    plant = make_diagram().plant()
    arm = plant.GetModelInstanceByName("iiwa")
    joints = [plant.get_joint(j) for j in plant.GetJointIndices(arm)]
    joints = [joint for joint in joints if joint.num_positions() == 1]
    return tree_from_plant(plant, [plant.GetFrameByName("body")], joints=joints)


def pick_and_place(tree, blends=True) -> list[Keyframe]:
    """The classic sequence, with the way over the table without stops if ``blends``."""
    X_WGinitial = RigidTransform(tree.tree.pose(Q_HOME, 0))
    X_WO = RigidTransform(RotationMatrix.MakeZRotation(0.5), [0.55, 0.15, 0.03])
    X_WOd = RigidTransform(RotationMatrix.MakeZRotation(-0.7), [0.4, -0.35, 0.03])
    X_WGpick, X_WGplace = X_WO @ X_OG, X_WOd @ X_OG
    clearance = RigidTransform(X_WGpick.rotation(), [0.5, -0.05, 0.45])
    blend = 1.0 if blends else 0.0
    return [
        Keyframe("initial", X_WGinitial, width=0.1),
        Keyframe("prepick", UP @ X_WGpick),
        Keyframe("pick", X_WGpick, width=0.0, dwell=0.5),
        Keyframe("lift", UP @ X_WGpick, blend=0.03 * blend),
        Keyframe("clearance", clearance, blend=0.1 * blend),
        Keyframe("preplace", UP @ X_WGplace, blend=0.03 * blend),
        Keyframe("place", X_WGplace, width=0.1, dwell=0.4),
        Keyframe("retreat", UP @ X_WGplace),
    ]


@pytest.fixture(scope="module")
def motion(tree):
    motion = time_keyframes(tree, 0, Q_HOME, pick_and_place(tree))
    assert motion.found, motion.reason
    return motion


def sampled(trajectory, times, order=0):
    if order == 0:
        return np.array([trajectory.value(t).ravel() for t in times])
    return np.array([trajectory.EvalDerivative(t, order).ravel() for t in times])


def test_limits_hold_at_every_instant_and_are_used(tree, motion):
    times = np.random.default_rng(0).uniform(0.0, motion.duration, 20_000)
    v, a = (np.abs(sampled(motion.joints, times, k)) for k in (1, 2))
    assert (v / tree.velocity).max() <= 1.0 + 1e-9
    assert (a / tree.acceleration).max() <= 1.0 + 1e-9
    assert max((v / tree.velocity).max(), (a / tree.acceleration).max()) > 0.99
    q = sampled(motion.joints, times)
    assert np.all((tree.lower <= q) & (q <= tree.upper))
    # A guess of 10 s/m, and 2 s for each of the two descents, would take three times as long.
    poses = [k.X_WG.translation() for k in pick_and_place(tree)]
    metres = np.linalg.norm(np.diff(poses, axis=0), axis=1).sum()
    assert 3.0 * motion.duration < 10.0 * metres + 4.0


def test_derivatives_are_those_of_the_positions(motion):
    h = 1e-5
    breaks = motion.times
    for t in np.linspace(0.01, motion.duration - 0.01, 60):
        if np.abs(t - breaks).min() < 1e-3:
            continue
        q = sampled(motion.joints, [t - h, t, t + h])
        v, a = (motion.joints.EvalDerivative(t, k).ravel() for k in (1, 2))
        np.testing.assert_allclose((q[2] - q[0]) / (2 * h), v, atol=1e-6)
        before, after = sampled(motion.joints, [t - h, t + h], 1)
        np.testing.assert_allclose((after - before) / (2 * h), a, atol=1e-2)


def test_joints_carry_the_hand_along_its_poses(tree, motion):
    for t in np.linspace(0.0, motion.duration, 200):
        X_WG = RigidTransform(tree.tree.pose(motion.joints.value(t).ravel(), 0))
        assert max(pose_distance(X_WG, motion.poses.value(t))) < 2e-4


def test_keyframes_are_met_at_their_times(tree, motion):
    for k, t in zip(pick_and_place(tree), motion.times, strict=True):
        distance, angle = pose_distance(motion.poses.value(t), k.X_WG)
        assert distance <= k.blend + 1e-12
        if k.blend == 0.0:
            assert angle < 1e-12
            assert np.abs(motion.poses.velocity(t)).max() < 1e-9
            assert np.abs(motion.joints.EvalDerivative(t, 1)).max() < 1e-9
        else:
            assert np.linalg.norm(motion.poses.velocity(t)) > 0.05
    assert np.all(np.diff(motion.times) > 0.0)
    np.testing.assert_allclose(motion.q_end, motion.joints.value(motion.duration).ravel())


def test_the_hand_opens_and_closes_while_the_arm_rests(tree, motion):
    keyframes = pick_and_place(tree)
    times = dict(zip(motion.names, motion.times, strict=True))
    dwell = {k.name: k.dwell for k in keyframes}

    def width(t):
        return float(motion.widths.value(t)[0, 0])

    assert width(0.0) == width(times["pick"]) == 0.1
    assert width(times["pick"] + 0.25) == pytest.approx(0.05)
    assert width(times["pick"] + dwell["pick"]) == width(times["place"]) == pytest.approx(0.0)
    assert width(times["place"] + dwell["place"]) == pytest.approx(0.1)
    assert width(motion.duration) == pytest.approx(0.1)
    for name in ("pick", "place"):
        for t in times[name] + dwell[name] * np.array([0.1, 0.5, 0.9]):
            assert not motion.poses.velocity(t).any()
            assert not motion.joints.EvalDerivative(t, 1).any()


def test_blends_save_time(tree, motion):
    stops = time_keyframes(tree, 0, Q_HOME, pick_and_place(tree, blends=False))
    assert stops.found
    assert motion.duration < 0.95 * stops.duration


def test_half_the_speed_takes_no_less(tree, motion):
    config = TimingConfig(speed=0.5, acceleration=0.25)
    slow = time_keyframes(tree, 0, Q_HOME, pick_and_place(tree), config=config)
    # Half of both rates is twice the time, but for the dwells.
    assert slow.duration - 0.9 == pytest.approx(2.0 * (motion.duration - 0.9), rel=1e-3)


def test_forth_and_back_many_times_without_drift(tree):
    keyframes = pick_and_place(tree)
    back = [dc.replace(k, width=None) for k in keyframes[::-1]]
    there = time_keyframes(tree, 0, Q_HOME, keyframes)
    q = there.q_end
    returned = time_keyframes(tree, 0, q, back, q_nominal=Q_HOME)
    assert returned.found, returned.reason
    np.testing.assert_allclose(returned.q_end, Q_HOME, atol=1e-7)


@pytest.mark.parametrize("yaw", [-2.8, -2.0, -0.7, 0.4, 1.5])
def test_pick_and_place_at_any_yaw(tree, yaw):
    X_WGinitial = RigidTransform(tree.tree.pose(Q_HOME, 0))
    X_WO = RigidTransform(RotationMatrix.MakeZRotation(yaw), [0.5, 0.2, 0.03])
    X_WOd = RigidTransform(RotationMatrix.MakeZRotation(0.0), [0.5, -0.25, 0.03])
    # A brick can be taken either way round, and joint 7 has not room for both.
    motions = []
    for flip in (0.0, np.pi):
        X_OGrasp = X_OG @ RigidTransform(RotationMatrix.MakeYRotation(flip))
        keyframes = pick_and_place_keyframes(
            X_WGinitial, X_WO @ X_OGrasp, X_WOd @ X_OGrasp, clearance=0.45
        )
        poses = {k.name: k.X_WG for k in keyframes}
        # Before the grasp the hand is 10 cm above it, and over the table it is high enough.
        up = poses["prepick"].translation() - poses["pick"].translation()
        np.testing.assert_allclose(up, [0, 0, 0.1], atol=1e-12)
        assert poses["clearance"].translation()[2] == pytest.approx(0.45)
        turn = pose_distance(poses["prepick"], poses["clearance"])[1]
        assert turn == pytest.approx(pose_distance(poses["clearance"], poses["preplace"])[1])
        motion = time_keyframes(tree, 0, Q_HOME, keyframes)
        if motion.found:
            motions.append(motion)
            for name in ("pick", "place"):
                q = motion.joints.value(motion.arrivals[name]).ravel()
                X_WG = RigidTransform(tree.tree.pose(q, 0))
                assert max(pose_distance(X_WG, poses[name])) < 1e-6
        else:
            assert "iiwa_joint_7" in motion.reason
    assert min(motion.duration for motion in motions) < 6.0
    assert list(motions[0].arrivals)[:3] == ["initial", "prepick", "pick"]


def test_unreachable_keyframes_are_named(tree):
    keyframes = pick_and_place(tree)
    keyframes[1] = Keyframe("prepick", RigidTransform(keyframes[1].X_WG.rotation(), [1.3, 0, 0.2]))
    motion = time_keyframes(tree, 0, Q_HOME, keyframes)
    assert not motion.found
    assert motion.status in ("unreachable", "limits")
    assert motion.reason.startswith("from initial to prepick, after ")
    assert motion.poses is None
    assert motion.duration == 0.0


def test_given_durations_without_an_arm(tree):
    keyframes = pick_and_place(tree, blends=False)
    motion = keyframe_motion(keyframes, np.full(7, 2.0), law="linear")
    np.testing.assert_allclose(motion.times, [0, 2, 4, 6.5, 8.5, 10.5, 12.5, 14.9])
    assert motion.duration == pytest.approx(14.9)
    assert motion.joints is None
    X = motion.poses.value(1.0)
    middle = 0.5 * (keyframes[0].X_WG.translation() + keyframes[1].X_WG.translation())
    np.testing.assert_allclose(X.translation(), middle)


def test_width_without_a_dwell_changes_on_the_way():
    X = [RigidTransform([0.1 * k, 0, 0]) for k in range(3)]
    frames = [Keyframe("a", X[0]), Keyframe("b", X[1], width=0.02), Keyframe("c", X[2], width=0.04)]
    widths = keyframe_motion(frames, [1.0, 1.0]).widths
    np.testing.assert_allclose(
        widths.vector_values([0.5, 1.0, 1.5, 2.0]), [[0.02, 0.02, 0.03, 0.04]]
    )
    assert keyframe_motion([Keyframe("a", X[0]), Keyframe("b", X[1])], [1.0]).widths is None


def test_dwells_at_both_ends_and_repeated_poses(tree):
    X_WG = RigidTransform(tree.tree.pose(Q_HOME, 0))
    frames = [
        Keyframe("wait", X_WG, width=0.1, dwell=0.3),
        Keyframe("same", X_WG),
        Keyframe("up", UP @ X_WG, width=0.0, dwell=0.2),
    ]
    motion = time_keyframes(tree, 0, Q_HOME, frames)
    assert motion.found, motion.reason
    assert motion.times[1] == pytest.approx(0.3, abs=1e-3)
    assert motion.duration == pytest.approx(motion.times[2] + 0.2)
    for t in (0.0, 0.15, 0.3):
        np.testing.assert_allclose(motion.joints.value(t).ravel(), Q_HOME, atol=1e-7)
        assert motion.poses.value(t).IsNearlyEqualTo(X_WG, 1e-12)
    assert motion.joints.end_time() == pytest.approx(motion.duration)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"dwell": -1.0}, "dwell and blend"),
        ({"dwell": np.inf}, "dwell and blend"),
        ({"blend": np.nan}, "dwell and blend"),
        ({"width": np.nan}, "width"),
        ({"blend": 0.1, "dwell": 0.1}, "has to rest"),
    ],
)
def test_misuse_is_named(change, message):
    frames = [Keyframe(str(k), RigidTransform([k, 0, 0])) for k in range(3)]
    frames[1] = dc.replace(frames[1], **change)
    with pytest.raises(ValueError, match=f"1: .*{message}"):
        keyframe_motion(frames, [1.0, 1.0])
    with pytest.raises(ValueError, match="at least two"):
        keyframe_motion(frames[:1], [])
    frames[1] = Keyframe("1", RigidTransform())
    frames[0] = dc.replace(frames[0], blend=0.1)
    with pytest.raises(ValueError, match="0: blends"):
        keyframe_motion(frames, [1.0, 1.0])
    with pytest.raises(ValueError, match="durations must be 1"):
        keyframe_motion(frames[1:], [1.0, 1.0])


def test_misuse_of_an_arm_is_named(tree):
    X_WG = RigidTransform(tree.tree.pose(Q_HOME, 0))
    there = RigidTransform(X_WG.rotation(), X_WG.translation() + [0.0, 0.05, 0.0])
    frames = [Keyframe("here", X_WG), Keyframe("there", there)]
    for change, message in (
        ({"limits": JointLimits.unlimited(7)}, "^limits: joint iiwa_joint_1 has none"),
        ({"limits": JointLimits.unlimited(2)}, "^limits: expected those of 7 joints"),
        ({"q_nominal": np.full(7, np.nan)}, "^q_nominal"),
    ):
        with pytest.raises(ValueError, match=message):
            time_keyframes(tree, 0, Q_HOME, frames, **change)
    for change in ({"speed": 1.5}, {"acceleration": np.nan}, {"law": "sudden"}):
        with pytest.raises(ValueError, match=f"^{next(iter(change))}"):
            TimingConfig(**change)


def test_arm_that_has_nowhere_to_go_stays(tree):
    X_WG = RigidTransform(tree.tree.pose(Q_HOME, 0))
    motion = time_keyframes(tree, 0, Q_HOME, [Keyframe("a", X_WG), Keyframe("b", X_WG)])
    assert motion.found
    assert motion.duration == 0.0
    np.testing.assert_allclose(motion.joints.value(0.0).ravel(), Q_HOME, atol=1e-12)


@pytest.mark.parametrize("change", [{"p_GPre": [0.0, 1.0]}, {"clearance": np.nan}])
def test_misuse_of_the_usual_keyframes_is_named(change):
    X_WG = RigidTransform([0.5, 0.0, 0.3])
    with pytest.raises(ValueError, match=f"^{next(iter(change))} must"):
        pick_and_place_keyframes(X_WG, X_WG, X_WG, **change)
