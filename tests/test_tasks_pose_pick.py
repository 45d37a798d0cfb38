"""Pose-pick: its parts against closed forms, what it decides, and that it works in simulation."""

import json
from types import SimpleNamespace

import numpy as np
import pytest
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix

from prehensile.grasping import WSG50
from prehensile.models.shapes.primitives import box
from prehensile.perception.registration.locate import LocateResult
from prehensile.perception.registration.result import RegistrationStatus
from prehensile.scenes.clutter import BIN_INTERIOR_MAX, BIN_INTERIOR_MIN
from prehensile.station.scenario_file import load_scenario
from prehensile.tasks.clear_bin_moves import BinGeometry
from prehensile.tasks.pose_pick import (
    KnownShape,
    Memory,
    PosePick,
    PosePickConfig,
    Sight,
    placement_error,
)
from prehensile.tasks.pose_pick_finder import believed
from prehensile.tasks.pose_pick_grasps import lying_poses, model_grasps, surface_cloud
from prehensile.tasks.pose_pick_object import MODEL, load_surface
from prehensile.tasks.pose_pick_report import adds
from prehensile.tasks.pose_pick_run import PosePickRun, check_goal, default_goal
from prehensile.tasks.pose_pick_scene import START_KINDS, random_rest_pose

SIZE = np.array([0.04, 0.07, 0.16])
HALF_TURN = RotationMatrix.MakeZRotation(np.pi)


@pytest.fixture(scope="module")
def block():
    mesh = box(SIZE)
    return surface_cloud(mesh.vertices, mesh.faces)


@pytest.fixture(scope="module")
def bottle():
    return load_surface(MODEL)


def test_a_surface_becomes_points_with_outward_normals(block):
    # Means over voxels that hold an edge lie inside it.
    half = SIZE / 2
    faces = np.abs(np.abs(block.points) - half) < 1e-9
    on_face = faces.any(axis=1)
    assert on_face.mean() > 0.7
    axis = np.argmax(faces, axis=1)[on_face]
    rows = np.nonzero(on_face & (faces.sum(axis=1) == 1))[0]
    axis = np.argmax(faces[rows], axis=1)
    wanted = np.zeros((len(rows), 3))
    wanted[np.arange(len(rows)), axis] = np.sign(block.points[rows, axis])
    cosine = np.sum(wanted * block.require_normals()[rows], axis=1)
    assert np.median(cosine) > 0.999
    area = 2 * (SIZE[0] * SIZE[1] + SIZE[1] * SIZE[2] + SIZE[0] * SIZE[2])
    assert 0.7 < len(block) * 0.004**2 / area < 1.6


def test_grasps_of_a_block_close_on_opposite_faces(block):
    grasps = model_grasps(block, np.zeros(3), WSG50, num_seeds=80)
    assert len(grasps) > 20
    for grasp in grasps:
        R = grasp.X_OG.rotation().matrix()
        np.testing.assert_allclose(R.T @ R, np.eye(3), atol=1e-9)
        axis = int(np.argmax(np.abs(R[:, 0])))
        assert axis < 2  # 16 cm do not fit into the hand
        assert abs(R[axis, 0]) > np.cos(np.deg2rad(25))
        assert SIZE[axis] < grasp.width <= WSG50.max_width
        # The pads' middle is in the middle of the block along the closing axis, and within it.
        p = grasp.X_OG.multiply(WSG50.p_GPad)
        assert abs(p[axis]) < 0.006
        assert np.all(np.abs(p) < SIZE / 2 + 0.02)
        # The palm stays outside.
        palm = grasp.X_OG.multiply(np.array([0, WSG50.body[0].y[1], 0]))
        assert np.any(np.abs(palm) > SIZE / 2)
    # It prefers to hold near the centre of mass.
    high = model_grasps(block, np.array([0, 0, 0.07]), WSG50, num_seeds=80)
    z = [np.mean([g.X_OG.multiply(WSG50.p_GPad)[2] for g in some[:10]]) for some in (grasps, high)]
    assert z[1] > z[0] + 0.02


def test_lying_poses_have_a_broad_side_on_the_floor():
    poses = list(lying_poses(np.array([0.5, 0.1, 0.03]), 0.02, np.random.default_rng(0), count=4))
    assert len(poses) == 8
    for X_WO in poses:
        R = X_WO.rotation().matrix()
        assert abs(abs(R[2, 0]) - 1) < 1e-9  # x vertical
        np.testing.assert_allclose(X_WO.translation(), [0.5, 0.1, 0.05])
    headings = {tuple(np.round(X.rotation().matrix()[:2, 2], 6)) for X in poses}
    assert len(headings) >= 4


def test_placement_error():
    X_WGoal = RigidTransform(RotationMatrix.MakeZRotation(1.0), [0.1, 0.2, 0.3])
    # A turn about the vertical is no error of being upright.
    moved = RigidTransform(RotationMatrix.MakeZRotation(2.0), [0.13, 0.24, 0.3])
    np.testing.assert_allclose(placement_error(moved, X_WGoal), [0.05, 0.0], atol=1e-7)
    tilted = RigidTransform(RollPitchYaw(0.0, 0.3, 1.0), [0.1, 0.2, 0.3])
    np.testing.assert_allclose(placement_error(tilted, X_WGoal), [0.0, 0.3], atol=1e-7)


def test_adds_knows_symmetry_and_distance(bottle):
    points = surface_cloud(*bottle).points
    X_WO = RigidTransform(RollPitchYaw(0.3, 0.4, 0.5), [0.5, 0.1, 0.2])
    assert adds(points, X_WO, X_WO) == 0.0
    turned = X_WO @ RigidTransform(HALF_TURN)
    assert adds(points, X_WO, turned) < 0.0015
    quarter = X_WO @ RigidTransform(RotationMatrix.MakeZRotation(np.pi / 2))
    assert adds(points, X_WO, quarter) > 0.005
    far = RigidTransform([0.0, 0.0, 1.0]) @ X_WO
    assert 0.8 < adds(points, X_WO, far) < 1.0  # nearly all of a metre: the bottle has extent


def test_the_bottle_rests_in_the_bin(bottle):
    scenario = load_scenario("two_bins")
    vertices, _ = bottle
    X_WB = RigidTransform(RotationMatrix.MakeZRotation(0.5 * np.pi), [0.57, 0.0, 0.0])
    kinds = set()
    for seed in range(6):
        rest = random_rest_pose(MODEL, vertices, X_WB, scenario, seed=seed)
        kinds.add(rest.start)
        p_B = (X_WB.inverse() @ rest.X_WO).multiply(vertices.T).T
        assert p_B[:, 2].min() == pytest.approx(0.03, abs=0.003)
        assert np.all(np.abs(p_B[:, 0]) < 0.285)
        assert np.all(np.abs(p_B[:, 1]) < 0.195)
    assert kinds <= set(START_KINDS)
    assert len(kinds) > 1
    again = random_rest_pose(MODEL, vertices, X_WB, scenario, seed=5)
    assert again.X_WO.IsExactlyEqualTo(rest.X_WO)


def located(status, *alternatives):
    X_WO = RigidTransform(RollPitchYaw(0.1, 0.2, 0.3), [1, 2, 3])
    poses = tuple(X_WO @ X for X in alternatives)
    return LocateResult(status, X_WO, 0.001, np.ones(3, bool), 1, alternatives=poses)


def test_only_the_shapes_own_symmetries_are_no_doubt():
    symmetries = [RotationMatrix(), HALF_TURN]
    ambiguous = RegistrationStatus.AMBIGUOUS
    assert believed(located(RegistrationStatus.SUCCESS), symmetries)
    assert believed(located(ambiguous, RigidTransform(HALF_TURN)), symmetries)
    assert not believed(located(ambiguous, RigidTransform(HALF_TURN)), symmetries[:1])
    upside_down = RigidTransform(RotationMatrix.MakeXRotation(np.pi))
    assert not believed(located(ambiguous, RigidTransform(HALF_TURN), upside_down), symmetries)
    assert not believed(located(RegistrationStatus.LOW_OVERLAP), symmetries)


class Eyes:
    """A finder that says what it is told to."""

    def __init__(self, *sights):
        self.sights = list(sights)

    def find(self, senses):
        return self.sights.pop(0)

    def check(self, senses, X_WGuess):
        return self.sights.pop(0)


def task(eyes, **config):
    arm = SimpleNamespace(q_default=np.zeros(7))
    shape = KnownShape(None, np.full(3, 0.05), [RotationMatrix(), HALF_TURN])
    X_WGoal = RigidTransform([0.0, 0.5, 0.1])
    return PosePick(
        arm, None, eyes, shape, None, X_WGoal, WSG50, seed=0, config=PosePickConfig(**config)
    )


def decide(machine, state, memory, width=0.05):
    senses = SimpleNamespace(q=np.zeros(7), width=width)
    return machine.decide(state, memory, time=1.0, motion_done=True, senses=senses)


def test_it_looks_again_and_gives_up_when_it_finds_nothing():
    nothing = Sight(None, "12 points are in the bin")
    doubtful = Sight(RigidTransform(), "low_overlap: little is seen")
    machine = task(Eyes(nothing, doubtful, nothing), max_looks=3)
    decision = machine.start()
    for _ in range(2):
        decision = decide(machine, "look", decision.memory)
        assert decision.state == "look"
        assert not decision.finished
    decision = decide(machine, "look", decision.memory)
    assert decision.finished
    assert "12 points" in decision.memory.finished
    assert not decision.memory.placed
    assert len(decision.memory.looks) == 3


def test_the_check_accepts_only_what_stands_at_the_goal():
    goal = [0.0, 0.5, 0.1]
    cases = (
        (RigidTransform(RotationMatrix.MakeZRotation(2.0), [0.01, 0.5, 0.1]), True),
        (RigidTransform([0.03, 0.5, 0.1]), False),
        (RigidTransform(RotationMatrix.MakeXRotation(0.2), goal), False),
    )
    for X_WO, accepted in cases:
        machine = task(Eyes(Sight(X_WO)))
        transfer = SimpleNamespace()
        decision = decide(machine, "release", Memory(np.zeros(7), transfer=transfer, to_goal=True))
        assert decision.finished
        assert decision.memory.placed is accepted


def test_it_looks_once_more_if_the_object_is_not_at_its_goal():
    machine = task(Eyes(Sight(None, "0 points are in the second bin")))
    memory = Memory(np.zeros(7), transfer=SimpleNamespace(), to_goal=True)
    decision = decide(machine, "release", memory)
    assert decision.state == "look"
    assert "0 points" in decision.memory.failures[-1]


def test_goals_in_the_air_in_a_wall_or_tilted_are_refused(bottle):
    X_WB = RigidTransform([0.0, 0.57, 0.0])
    place_bin = BinGeometry(X_WB, BIN_INTERIOR_MIN, BIN_INTERIOR_MAX, [])
    vertices, _ = bottle
    check_goal(default_goal(place_bin, vertices), place_bin, vertices)
    on_floor = [0.0, 0.57, 0.03 + 0.0955]
    for X_WGoal in (
        RigidTransform([0.0, 0.57, 0.2]),
        RigidTransform([0.0, 0.57 + 0.18, 0.03 + 0.0955]),
        RigidTransform(RotationMatrix.MakeXRotation(0.3), on_floor),
        RigidTransform(RotationMatrix.MakeXRotation(np.pi), on_floor),
    ):
        with pytest.raises(ValueError, match="X_WGoal"):
            check_goal(X_WGoal, place_bin, vertices)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 5, 7])  # lying, leaning, upright
def test_the_bottle_is_found_and_stands_where_it_should(seed):
    run = PosePickRun(seed=seed)
    while run.advance() and run.time < 90:
        pass
    run.advance()
    report = run.report()
    assert report.pose_right, report.looks
    assert report.placed, (report.distance, report.tilt, report.failures)
    assert report.accepted
    plain = json.loads(json.dumps(report.to_json(), allow_nan=False))
    assert plain["placed"] is True
    assert plain["phases"][0] == [0.0, "look"]


@pytest.mark.slow
def test_the_same_seed_gives_the_same_run_bit_for_bit():
    states = []
    for _ in range(2):
        run = PosePickRun(seed=3)
        while run.time < 5.0:
            run.advance()
        port = run.station.GetOutputPort("cheat.plant_state")
        states.append(port.Eval(run.station_context()).copy())
    np.testing.assert_array_equal(*states)
