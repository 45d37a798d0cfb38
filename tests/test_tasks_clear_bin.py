"""Clearing a bin: what it decides, and that it clears one in simulation."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from pydrake.math import RigidTransform, RotationMatrix

from prehensile.grasping import WSG50
from prehensile.perception import PointCloud
from prehensile.planning.arm import ArmModel
from prehensile.planning.trajectory import time_parameterize
from prehensile.station import load_scenario
from prehensile.station.robot_plant import make_robot_diagram
from prehensile.tasks.clear_bin import ClearBin, ClearBinConfig, Memory, Pick
from prehensile.tasks.clear_bin_moves import held_box
from prehensile.tasks.clear_bin_run import ClearBinRun, bin_geometry, choose_models
from prehensile.tasks.report import Attempt, ClearBinReport, ObjectResult

# A hand that points straight down at a point half a metre in front of the arm.
X_WG = RigidTransform(RotationMatrix.MakeXRotation(-np.pi / 2), [0.55, 0.0, 0.2])


@pytest.fixture(scope="module")
def task():
    world = make_robot_diagram(load_scenario("two_bins"))
    bins = [bin_geometry(world, name) for name in ("bin0", "bin1")]
    return ClearBin(ArmModel(world), [], *bins, seed=0, config=ClearBinConfig(max_failures=2))


@pytest.fixture(scope="module")
def pick(task):
    q = task.start().memory.q
    motion = time_parameterize(np.array([q, q + 0.1]), task._arm.limits)
    attempt = Attempt(1, 0.0, 0.0, "unfinished", "", X_WG=X_WG, width=0.06)
    return Pick(attempt, lift=motion, carry=motion)


def decide(task, state, memory, *, width, done=True):
    return task.decide(
        state, memory, time=5.0, motion_done=done, senses=SimpleNamespace(width=width)
    )


def test_a_full_hand_lifts_carries_and_releases(task, pick):
    memory = Memory(task.start().memory.q, pick=pick)
    states = []
    for state in ("pick", "lift", "carry", "release"):
        decision = decide(task, state, memory, width=0.05)
        memory = decision.memory
        states.append(decision.state)
    assert states == ["lift", "carry", "release", "look"]
    assert [a.outcome for a in memory.attempts] == ["moved"]
    assert memory.pick is None
    assert memory.failures == 0


def test_the_hand_stays_closed_until_the_second_bin(task, pick):
    memory = Memory(task.start().memory.q, pick=pick)
    for state in ("pick", "lift"):
        motion = decide(task, state, memory, width=0.05).motion
        widths = [motion.command(t)[1] for t in np.linspace(0, motion.duration, 20)]
        assert widths == [0.0] * 20
    assert decide(task, "carry", memory, width=0.05).motion.command(0.0)[1] == WSG50.max_width


@pytest.mark.parametrize(
    ("state", "outcome"), [("pick", "empty"), ("lift", "dropped"), ("carry", "dropped")]
)
def test_an_empty_hand_is_noticed(task, pick, state, outcome):
    memory = Memory(task.start().memory.q, pick=pick)
    # While it carries it watches all the time; else it looks when the motion has ended.
    decision = decide(task, state, memory, width=0.0, done=state != "carry")
    assert decision.memory.attempts[0].outcome == outcome
    assert decision.memory.attempts[0].reason
    assert decision.memory.failures == 1
    assert decision.state == ("carry" if state == "carry" else "retreat")


def test_the_retreat_ends_at_home_with_an_open_hand(task, pick):
    memory = Memory(pick.lift.path[0], pick=pick)
    decision = decide(task, "pick", memory, width=0.0)
    q, width, _ = decision.motion.command(100.0)
    np.testing.assert_allclose(q, task.start().memory.q, atol=1e-9)
    np.testing.assert_allclose(decision.memory.q, q, atol=1e-9)
    assert width == WSG50.max_width


def test_it_gives_up_after_failures_in_a_row_and_says_why(task, pick):
    memory = Memory(task.start().memory.q)
    for _ in range(2):
        memory = decide(
            task, "pick", Memory(memory.q, memory.attempts, pick, memory.failures), width=0.0
        ).memory
    decision = decide(task, "retreat", memory, width=0.1)
    assert decision.finished
    assert "2 failures in a row" in decision.memory.finished
    assert "closed on nothing" in decision.memory.finished


def test_the_held_box_holds_the_piece_and_reaches_the_floor():
    # A column 4 cm wide (x), 20 cm long (z of the hand), of which the hand holds the middle.
    grid = np.stack(np.meshgrid([-0.02, 0.02], np.linspace(-0.1, 0.1, 41)), axis=-1).reshape(-1, 2)
    p_G = np.column_stack([grid[:, 0], np.full(len(grid), WSG50.p_GPad[1]), grid[:, 1]])
    normals = np.tile([0.0, 0.0, 1.0], (len(p_G), 1))
    cloud = PointCloud(X_WG.multiply(p_G.T).T, normals)
    floor = 0.03
    box = held_box(cloud, np.zeros(len(p_G), int), X_WG, 0.04, WSG50, floor)
    low = box.X_WB.translation() - box.size / 2
    high = box.X_WB.translation() + box.size / 2
    assert np.all(p_G >= low - 1e-9)
    assert np.all(p_G <= high + 1e-9)
    lowest = X_WG.multiply(np.array([0.0, high[1], 0.0]))[2]
    assert lowest <= floor + 1e-9
    # It may swing down: as far below the pads as it reaches sideways.
    assert high[1] - WSG50.p_GPad[1] >= 0.1 - 1e-9


def test_a_report_is_plain_json():
    report = ClearBinReport(
        seed=1,
        finished="time is up",
        interrupted=False,
        attempts=[
            Attempt(1, 0.0, 4.0, "moved", "", X_WG=X_WG, width=0.05, score=0.5),
            Attempt(2, 4.0, 5.0, "no grasp", "nothing fits"),
        ],
        objects=[ObjectResult("mug_0", "mug", "bin1"), ObjectResult("mug_1", "mug", "bin0")],
        sim_time=5.0,
        wall_time=2.0,
        cpu_time=2.0,
    )
    plain = json.loads(json.dumps(report.to_json(), allow_nan=False))
    assert plain["summary"]["cleared"] == 1
    assert plain["summary"]["seconds_per_pick"] == 5.0
    assert plain["summary"]["realtime_factor"] == 2.5
    np.testing.assert_array_equal(plain["attempts"][0]["X_WG"], X_WG.GetAsMatrix4())
    assert plain["attempts"][1]["score"] is None


def test_scenes_hold_each_kind_before_any_comes_again():
    models = choose_models(10, seed=4)
    assert len(set(models)) == 10
    assert choose_models(10, seed=4) == models
    assert choose_models(10, seed=5) != models
    many = choose_models(40, seed=0)
    kinds = len(set(many))
    assert sorted(many[:kinds]) == sorted(set(many))


def run_for(seconds, models=("foam_brick", "gelatin_box"), seed=1):
    run = ClearBinRun(models, seed=seed)
    while run.advance() and run.time < seconds:
        pass
    return run


@pytest.mark.slow
def test_two_boxes_are_carried_to_the_second_bin():
    run = run_for(60.0)
    assert run.memory.finished == "the bin is empty"
    plant = run.station.GetSubsystemByName("plant")
    context = plant.GetMyContextFromRoot(run.simulator.get_context())
    bin1 = plant.GetBodyByName("base_link", plant.GetModelInstanceByName("bin1"))
    X_WB = plant.EvalBodyPoseInWorld(context, bin1)
    for placed in run.objects:
        body = plant.GetBodyByName("base_link", plant.GetModelInstanceByName(placed.name))
        p_BO = X_WB.inverse().multiply(plant.EvalBodyPoseInWorld(context, body).translation())
        assert np.all(np.abs(p_BO[:2]) < [0.28, 0.19])
        assert 0.03 < p_BO[2] < 0.25
    assert run.report().successes == run.report().cleared == 2


@pytest.mark.slow
def test_the_same_seed_gives_the_same_run_bit_for_bit():
    first, second = (run_for(6.0) for _ in range(2))
    for name in ("cheat.plant_state", "iiwa.position_commanded"):
        values = [
            run.station.GetOutputPort(name).Eval(run.station_context()) for run in (first, second)
        ]
        np.testing.assert_array_equal(*values)


@pytest.mark.slow
def test_ctrl_c_leaves_a_valid_partial_report(tmp_path: Path):
    command = [sys.executable, "-m", "prehensile", "demo", "clear-bin", "--no-browser"]
    command += ["--objects", "2", "--out", str(tmp_path)]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    deadline = time.monotonic() + 240
    while not list(tmp_path.glob("grasp_*.png")) and time.monotonic() < deadline:
        assert process.poll() is None
        time.sleep(0.2)
    os.kill(process.pid, signal.SIGINT)
    _, errors = process.communicate(timeout=120)
    assert process.returncode == 130, errors.decode()
    assert b"Traceback" not in errors
    report = json.loads((tmp_path / "report.json").read_text())
    assert report["interrupted"]
    assert len(report["objects"]) == 2
    assert (tmp_path / "replay.html").stat().st_size > 100_000
