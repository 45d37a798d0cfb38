"""The gallery: every robot holds still, follows, and keeps its limits, in simulation."""

import dataclasses as dc
import json
import math

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator

from prehensile.control.joint_controller import CONTROLLER_KINDS
from prehensile.errors import InputError
from prehensile.models.registry import list_models
from prehensile.station.build import build
from prehensile.station.guard import GuardLimits
from prehensile.station.scenario_file import load_scenario
from prehensile.tasks.gallery import Followed, run, run_demo
from prehensile.tasks.gallery_motions import HOLD, swing, wave
from prehensile.tasks.gallery_pairs import BOX_SIZE, CAN_SIZE, bimanual, iiwa_allegro
from prehensile.tasks.gallery_robots import gallery_robots
from prehensile.tasks.gallery_scenes import arms, hands

ARMS = [info.name for info in list_models() if info.category == "arm"]
HANDS = [info.name for info in list_models() if info.category == "hand"]


@pytest.fixture(scope="module")
def robots():
    return {robot.info.name: robot for kind in ("arm", "hand") for robot in gallery_robots(kind)}


@pytest.mark.parametrize("name", ARMS + HANDS)
def test_motions_begin_at_rest_and_keep_the_limits(robots, name):
    robot = robots[name]
    if not robot.joints:
        pytest.skip("it has no joints to move")
    trajectory = swing(robot) if name in ARMS else wave(robot)
    limits = GuardLimits.of_plant(robot.plant, robot.instance)
    every = robot.plant.GetPositionsFromArray(
        robot.instance, np.arange(robot.plant.num_positions())
    )
    own = [every.tolist().index(i) for i in robot.index]
    t = np.arange(0.0, trajectory.end_time() + 0.5, 0.005)
    q = trajectory.vector_values(np.clip(t, trajectory.start_time(), trajectory.end_time())).T
    assert np.all(q[t < HOLD] == q[0])
    np.testing.assert_allclose(q[0], robot.q[robot.index])
    np.testing.assert_allclose(q[-1], q[0], atol=1e-9)
    lower, upper, speed, acceleration = (
        np.array(values)[own]
        for values in (
            limits.position_lower, limits.position_upper, limits.velocity, limits.acceleration
        )
    )  # fmt: skip
    assert np.all(q >= lower - 1e-9)
    assert np.all(q <= upper + 1e-9)
    v = np.diff(q, axis=0) / 0.005
    assert np.all(np.abs(v) <= speed)
    assert np.all(np.abs(np.diff(v, axis=0)) / 0.005 <= acceleration + 1e-6)
    # It is worth watching: every joint moves.
    assert np.all(np.ptp(q, axis=0) > 0.05 * np.minimum(upper - lower, 1.0))


def test_arms_stand_ready(robots):
    for name in ARMS:
        robot = robots[name]
        context = robot.plant.CreateDefaultContext()
        robot.plant.SetPositions(context, robot.q)
        flange = robot.joints[-1].child_body()
        X_WF = robot.plant.EvalBodyPoseInWorld(context, flange)
        assert X_WF.translation()[0] > 0.25, name
        assert X_WF.translation()[2] > 0.1, name
        # Its axis is upright; which end is up is told by the frame that the model names.
        assert abs(X_WF.rotation().matrix()[2, 2]) > 0.99, name


def test_robots_stand_apart(robots):
    for names in (ARMS, HANDS):
        places = np.array([robots[name].X_WB.translation() for name in names])
        gaps = np.linalg.norm(places[:, None] - places, axis=2)[~np.eye(len(places), dtype=bool)]
        assert gaps.min() > 0.3


def test_hands_stand_with_their_fingers_up(robots):
    for name in HANDS:
        robot = robots[name]
        context = robot.plant.CreateDefaultContext()
        robot.plant.SetPositions(context, robot.q)

        def height(body, robot=robot, context=context):
            X_WL = robot.X_WB @ robot.plant.EvalBodyPoseInWorld(context, body)
            return X_WL.multiply(body.default_com())[2]

        fingers = [height(joint.child_body()) for joint in robot.joints]
        assert np.mean(fingers or np.inf) > height(robot.base), name


@pytest.mark.parametrize("controller", CONTROLLER_KINDS)
def test_an_arm_holds_and_follows_under_each_controller(controller):
    report = run(arms(controller, ["iiwa7"]), "arms", duration=2.5)
    (arm,) = report.robots
    assert report.controller == controller
    assert arm.hold_error < (0.02 if controller == "pid" else 1e-3)
    assert arm.follow_error < 0.03
    assert arm.limits_kept
    assert arm.guard == "OK"
    json.dumps(report.to_json(), allow_nan=False)


def test_hands_follow():
    names = ["wsg50", "panda_hand", "robotiq_2f85"]
    report = run(hands(names), "hands", duration=2.0)
    assert [robot.model for robot in report.robots] == names
    for robot in report.robots:
        assert robot.limits_kept
        assert robot.hold_error < 1e-3
        assert robot.follow_error < 0.05


def test_a_robot_that_does_not_follow_is_no_success():
    fine = Followed("a", 1, 0.0, 0.01, 0.0, 0.5, 0.5, 0.0, "OK", True)
    assert fine.success
    for wrong in ({"follow_error": 0.2}, {"speed": 1.1}, {"outside": 0.01}, {"finite": False}):
        assert not dc.replace(fine, **wrong).success
    assert not dc.replace(fine, speed=1.1).limits_kept


def test_unknown_models_are_named():
    with pytest.raises(InputError, match=r"no arm 'irb120'.*iiwa7"):
        arms(names=["irb120"])
    with pytest.raises(InputError, match="no hand 'iiwa7'"):
        hands(["iiwa7"])


@pytest.mark.slow
@pytest.mark.parametrize("controller", CONTROLLER_KINDS)
def test_every_arm_follows_under_each_controller(controller):
    report = run(arms(controller), "arms")
    assert [robot.model for robot in report.robots] == ARMS
    assert report.success
    for arm in report.robots:
        assert arm.hold_error < (0.04 if controller == "pid" else 1e-3), arm
        # Friction in the bearings, 2 N m s/rad in a wrist, is a disturbance to gains of 44 N m.
        assert arm.follow_error < (0.04 if controller == "inverse-dynamics" else 0.07), arm
        assert arm.end_error < 0.005, arm
        assert arm.guard == "OK", arm


@pytest.mark.slow
def test_every_hand_follows():
    report = run(hands(), "hands")
    assert sorted([*(robot.model for robot in report.robots), *report.still]) == HANDS
    assert report.success
    for hand in report.robots:
        assert hand.follow_error < 0.05, hand
        assert hand.end_error < 0.005, hand


@pytest.mark.slow
def test_two_arms_lift_a_box_and_put_it_back():
    show = bimanual()
    box_at = []

    def look(plant, context):
        box = plant.GetBodyByName("base_link", plant.GetModelInstanceByName("cracker_box"))
        box_at.append(plant.EvalBodyPoseInWorld(context, box))
        return {}

    report = run(dc.replace(show, measure=look), "bimanual")
    assert report.success
    heights = np.array([X.translation()[2] for X in box_at])
    tips = [math.acos(min(1.0, X.rotation().matrix()[2, 2])) for X in box_at]
    assert heights.max() - 0.5 * BOX_SIZE[2] > 0.2
    assert max(tips) == pytest.approx(0.35, abs=0.05)
    # It is where and as it was, and stands.
    np.testing.assert_allclose(box_at[-1].translation(), [0.2, 0.0, 0.5 * BOX_SIZE[2]], atol=0.01)
    assert tips[-1] < 0.01
    left, right = report.robots[:2]
    assert left.follow_error == pytest.approx(right.follow_error, rel=0.05)


def test_the_right_arm_is_the_mirror_image_of_the_left_one():
    show = bimanual()
    tracks = {track.model: track for track in show.tracks}
    station = build(show.scenario)
    context = station.CreateDefaultContext()
    plant = station.plant()
    plant_context = plant.GetMyContextFromRoot(context)
    for t in np.linspace(0.0, tracks["iiwa_left"].trajectory.end_time(), 15):
        poses = []
        for side in ("left", "right"):
            arm = plant.GetModelInstanceByName(f"iiwa_{side}")
            plant.SetPositions(plant_context, arm, tracks[f"iiwa_{side}"].value(t))
            hand = plant.GetBodyByName("body", plant.GetModelInstanceByName(f"wsg_{side}"))
            poses.append(plant.EvalBodyPoseInWorld(plant_context, hand))
        left, right = poses
        mirrored = right.translation() * [1.0, -1.0, 1.0]
        np.testing.assert_allclose(left.translation(), mirrored, atol=1e-9)
        fingers = right.rotation().col(1) * [1.0, -1.0, 1.0]
        np.testing.assert_allclose(left.rotation().col(1), fingers, atol=1e-9)


@pytest.mark.slow
def test_the_hand_of_many_joints_lifts_a_can_and_puts_it_back():
    show = iiwa_allegro()
    can_at, offsets = [], []

    def look(plant, context):
        can = plant.GetBodyByName("base_link", plant.GetModelInstanceByName("chips_can"))
        hand = plant.GetBodyByName("hand_root", plant.GetModelInstanceByName("allegro"))
        can_at.append(plant.EvalBodyPoseInWorld(context, can))
        X_WH = plant.EvalBodyPoseInWorld(context, hand)
        offsets.append(X_WH.InvertAndCompose(can_at[-1]).translation())
        return {}

    report = run(dc.replace(show, measure=look), "iiwa-allegro")
    assert report.success
    arm, hand = report.robots
    assert arm.follow_error < 0.03
    assert hand.joints == 16
    assert hand.end_error < 1e-3  # nothing is left in its way
    p_WCans = np.array([X.translation() for X in can_at])
    lifted = p_WCans[:, 2] > 0.5 * CAN_SIZE[1] + 0.05
    assert np.count_nonzero(lifted) > 150  # of 10 ms each
    # It stays where it is in the hand, is carried well aside, and stands where it stood.
    slip = np.array(offsets)[lifted]
    assert np.max(np.ptp(slip, axis=0)) < 0.005
    assert p_WCans[:, 1].max() > 0.2
    np.testing.assert_allclose(p_WCans[-1], [0.65, 0.0, 0.5 * CAN_SIZE[1]], atol=0.015)
    assert can_at[-1].rotation().matrix()[2, 2] > math.cos(0.01)


def test_the_hand_of_many_joints_holds_on_its_arm():
    simulator = Simulator(build(load_scenario("iiwa_allegro")))
    context = simulator.get_mutable_context()
    station = simulator.get_system()
    ports = [station.GetOutputPort(f"{m}.position_measured") for m in ("iiwa", "allegro")]
    before = [port.Eval(context) for port in ports]
    simulator.AdvanceTo(0.4)
    after = [port.Eval(context) for port in ports]
    for a, b in zip(before, after, strict=True):
        np.testing.assert_allclose(a, b, atol=2e-3)


@pytest.mark.slow
def test_demo_leaves_a_report_and_a_replay(tmp_path):
    report = run_demo(hands(["wsg50"]), "hands", browser=False, out=tmp_path / "out")
    assert report.success
    written = json.loads((tmp_path / "out" / "report.json").read_text())
    assert written["success"] is True
    assert written["robots"][0]["model"] == "wsg50"
    assert (tmp_path / "out" / "replay.html").stat().st_size > 100_000
