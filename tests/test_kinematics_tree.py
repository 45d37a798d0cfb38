"""Trees compiled from plants answer as Drake does."""

from pathlib import Path

import numpy as np
import pytest
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame, FrameIndex, JacobianWrtVariable

from prehensile.kinematics.tree import joints_that_move, tree_from_plant
from prehensile.models.registry import list_models, package_map

SHARED = Path(__file__).parents[1].parent / "shared"
ALLEGRO = SHARED / "drake_models/allegro_hand_description/urdf/allegro_hand_description_right.urdf"


def arm_with_hand():
    """iiwa7 on a turned base, wsg50 on its flange, a free brick; and a frame beside the hand."""
    plant = MultibodyPlant(0.0)
    parser = Parser(plant)
    parser.package_map().AddMap(package_map())
    for model in ("iiwa7", "wsg50", "foam_brick"):
        parser.AddModels(url=f"package://prehensile/{model}/{model}.sdf")
    X_WB = RigidTransform(RollPitchYaw(0.1, 0.2, 0.3), [0.4, 0.5, 0.6])
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("iiwa_link_0"), X_WB)
    hand = plant.GetFrameByName("body")
    plant.WeldFrames(plant.GetFrameByName("iiwa_link_7"), hand, RigidTransform([0, 0, 0.09]))
    X_GT = RigidTransform(RollPitchYaw(0.3, -0.4, 1.0), [0.01, 0.1, 0.02])
    plant.AddFrame(FixedOffsetFrame("tool", hand, X_GT))
    plant.Finalize()
    return plant


def agrees(plant, compiled, frames, q, context):
    """Compares with Drake at plant positions q.

    To 1e-12 and no closer: Drake takes an axis for z that rounding in a model's file has put 1e-13
    beside it.
    """
    plant.SetPositions(context, q)
    W = plant.world_frame()
    for k, frame in enumerate(frames):
        X, J = compiled.tree.pose_and_jacobian(q[compiled.position_indices], k)
        np.testing.assert_allclose(X, frame.CalcPoseInWorld(context).GetAsMatrix4(), atol=1e-12)
        J_plant = plant.CalcJacobianSpatialVelocity(
            context, JacobianWrtVariable.kV, frame, [0, 0, 0], W, W
        )
        np.testing.assert_allclose(J, J_plant[:, compiled.velocity_indices], atol=1e-12)


def test_arm_and_hand_with_all_else_locked():
    plant = arm_with_hand()
    names = [f"iiwa_joint_{i}" for i in (3, 1, 2, 7, 4, 5, 6)]  # in an order of our own
    slides = [
        plant.get_joint(i).name()
        for i in plant.GetJointIndices()
        if plant.get_joint(i).type_name() == "prismatic"
    ]
    assert slides
    joints = [plant.GetJointByName(name) for name in names + slides]
    bodies = ("tool", "iiwa_link_3", "left_finger", "base_link")
    frames = [plant.GetFrameByName(n) for n in bodies if plant.HasFrameNamed(n)]
    frames.append(plant.world_frame())
    rng = np.random.default_rng(0)
    context = plant.CreateDefaultContext()
    q = plant.GetPositions(context)
    brick = rng.normal(size=4)
    start = plant.GetBodyIndices(plant.GetModelInstanceByName("foam_brick"))[0]
    at = plant.get_body(start).floating_positions_start()
    q[at : at + 7] = [*(brick / np.linalg.norm(brick)), 1, 2, 3]
    compiled = tree_from_plant(plant, frames, joints=joints, q_locked=q)
    assert compiled.joints == tuple(names + slides)
    for _ in range(50):
        q[compiled.position_indices] = rng.uniform(-3, 3, len(joints))
        agrees(plant, compiled, frames, q, context)


def test_relative_jacobians_are_drakes():
    plant = arm_with_hand()
    joints = [plant.GetJointByName(f"iiwa_joint_{i}") for i in range(1, 8)]
    frames = [plant.GetFrameByName(n) for n in ("tool", "iiwa_link_2", "iiwa_link_5")]
    compiled = tree_from_plant(plant, frames, joints=joints)
    context = plant.CreateDefaultContext()
    rng = np.random.default_rng(2)
    for _ in range(20):
        q = rng.uniform(-3, 3, 7)
        for joint, angle in zip(joints, q, strict=True):
            joint.set_angle(context, angle)
        expected = plant.CalcJacobianSpatialVelocity(
            context, JacobianWrtVariable.kV, frames[0], [0, 0, 0], frames[1], frames[2]
        )
        J = compiled.tree.relative_jacobian(q, 0, measured_in=1, expressed_in=2)
        np.testing.assert_allclose(J, expected[:, compiled.velocity_indices], atol=1e-13)


def test_allegro_hand_with_all_fingertips():
    if not ALLEGRO.exists():
        pytest.skip(f"needs {ALLEGRO}")
    plant = MultibodyPlant(0.0)
    parser = Parser(plant)
    parser.package_map().PopulateFromFolder(str(ALLEGRO.parents[2]))
    parser.AddModels(str(ALLEGRO))
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("hand_root"))
    plant.Finalize()
    frames = [plant.GetFrameByName(f"link_{i}") for i in (3, 7, 11, 15)]
    compiled = tree_from_plant(plant, frames)
    assert compiled.tree.num_joints == 16
    context = plant.CreateDefaultContext()
    rng = np.random.default_rng(3)
    for _ in range(20):
        agrees(plant, compiled, frames, rng.uniform(-2, 2, plant.num_positions()), context)


ROBOTS = [info for info in list_models() if info.category in ("arm", "hand")]


@pytest.mark.parametrize("info", ROBOTS, ids=lambda info: info.name)
def test_every_frame_of_every_robot(info):
    plant = MultibodyPlant(0.0)
    parser = Parser(plant)
    parser.package_map().AddMap(package_map())
    parser.AddModels(url=info.url)
    plant.Finalize()
    frames = [plant.get_frame(FrameIndex(i)) for i in range(plant.num_frames())]
    joints = [plant.get_joint(index) for index in plant.GetJointIndices()]
    joints = [j for j in joints if j.type_name() in ("revolute", "prismatic")]
    compiled = tree_from_plant(plant, frames, joints=joints)
    context = plant.CreateDefaultContext()
    q = plant.GetPositions(context)
    rng = np.random.default_rng(6)
    for _ in range(5):
        q[compiled.position_indices] = rng.uniform(-3, 3, len(joints))
        agrees(plant, compiled, frames, q, context)


def test_a_joint_on_the_wrong_side_of_the_world():
    """A robot held by its last link: its joints move what they are mounted on."""
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModelsFromString(
        """<robot name="r"><link name="a"/><link name="b"/><link name="c"/>
        <joint name="j" type="revolute"><parent link="a"/><child link="b"/>
          <origin xyz="0.1 0.2 0.3" rpy="0.1 0.2 0.3"/><axis xyz="1 2 3"/>
          <limit lower="-1" upper="2" velocity="3" effort="1"/></joint>
        <joint name="k" type="prismatic"><parent link="b"/><child link="c"/>
          <origin xyz="0.3 0.1 0.2" rpy="-0.4 0.2 0.3"/><axis xyz="0 1 0"/>
          <limit lower="0" upper="0.5" velocity="0.2" effort="1"/></joint></robot>""",
        "urdf",
    )
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("c"))
    plant.Finalize()
    frames = [plant.GetFrameByName(name) for name in "abc"]
    compiled = tree_from_plant(plant, frames)
    np.testing.assert_array_equal(compiled.lower, [-1, 0])
    np.testing.assert_array_equal(compiled.upper, [2, 0.5])
    np.testing.assert_array_equal(compiled.velocity, [3, 0.2])
    np.testing.assert_array_equal(compiled.acceleration, [np.inf, np.inf])
    context = plant.CreateDefaultContext()
    for q in np.random.default_rng(4).uniform(-1, 1, (10, 2)):
        agrees(plant, compiled, frames, q, context)


def test_bad_arguments_are_named():
    plant = arm_with_hand()
    joint = plant.GetJointByName("iiwa_joint_1")
    with pytest.raises(ValueError, match="^joints: .*name the joints"):
        tree_from_plant(plant, [])  # the brick floats
    with pytest.raises(ValueError, match="^joints: .*twice"):
        tree_from_plant(plant, [], joints=[joint, joint])
    with pytest.raises(ValueError, match="^joints: .*another plant"):
        tree_from_plant(arm_with_hand(), [], joints=[joint])
    with pytest.raises(ValueError, match="^q_locked: "):
        tree_from_plant(plant, [], joints=[joint], q_locked=np.zeros(3))
    with pytest.raises(ValueError, match="^plant: "):
        tree_from_plant(MultibodyPlant(0.0), [])
    elsewhere = arm_with_hand().GetFrameByName("iiwa_link_7")
    with pytest.raises(ValueError, match="^frames: .*another plant"):
        tree_from_plant(plant, [elsewhere], joints=[joint])
    with pytest.raises(ValueError, match="^frames: .*another plant"):
        joints_that_move(plant, elsewhere)
