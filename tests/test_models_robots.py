"""The embedded arms, hand and camera, against the field's models and against published facts."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pydrake.geometry import (
    AddContactMaterial,
    AddRigidHydroelasticProperties,
    Box,
    ProximityProperties,
    Role,
)
from pydrake.manipulation import SchunkWsgPositionController
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import (
    AddMultibodyPlant,
    AddMultibodyPlantSceneGraph,
    CoulombFriction,
    MultibodyPlant,
    MultibodyPlantConfig,
)
from pydrake.multibody.tree import RevoluteJoint, SpatialInertia
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource

from prehensile.models.generate.robots import _iiwa, iiwa7, iiwa14
from prehensile.models.generate.sdf_model import Model, sdf_text
from prehensile.models.registry import find_model, package_map

DRAKE_MODELS = Path(__file__).parents[1].parent / "shared" / "drake_models"
needs_drake_models = pytest.mark.skipif(
    not DRAKE_MODELS.is_dir(), reason="Drake's models are not beside this repository"
)

ARMS = ("iiwa7", "iiwa14")
REFERENCES = {
    "iiwa7": ["iiwa_description/sdf/iiwa7_no_collision.sdf"],
    "iiwa14": [
        "iiwa_description/sdf/iiwa14_no_collision.sdf",
        "iiwa_description/urdf/iiwa14_no_collision.urdf",
    ],
}
PAIRS = [(arm, file) for arm in ARMS for file in REFERENCES[arm]]
WSG = "wsg_50_description/sdf/schunk_wsg_50_with_tip.sdf"
X_7G = RigidTransform(RollPitchYaw(np.radians([90.0, 0.0, 90.0])), [0.0, 0.0, 0.09])


def load(url: str, base: str) -> MultibodyPlant:
    """A plant of one model, welded to the world by one of its links."""
    plant = MultibodyPlant(0.0)
    parser = Parser(plant)
    packages = {"drake_models": DRAKE_MODELS} if DRAKE_MODELS.is_dir() else {}
    parser.package_map().Remove("drake_models")  # ours is on this machine, or not needed
    parser.package_map().AddMap(package_map(packages))
    parser.AddModelsFromUrl(url)
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName(base))
    plant.Finalize()
    return plant


def ours(name: str, base: str = "iiwa_link_0") -> MultibodyPlant:
    return load(find_model(name).url, base)


def theirs(file: str, base: str = "iiwa_link_0") -> MultibodyPlant:
    return load(f"package://drake_models/{file}", base)


def inertia_about_com(plant: MultibodyPlant, body: str) -> np.ndarray:
    M = plant.GetBodyByName(body).default_spatial_inertia()
    return M.Shift(M.get_com()).CalcRotationalInertia().CopyToFullMatrix3()


def assert_same_frames(a: MultibodyPlant, b: MultibodyPlant, names: list[str]) -> None:
    """The named frames agree to 1e-9 at random configurations within the limits."""
    rng = np.random.default_rng(7)
    context_a, context_b = a.CreateDefaultContext(), b.CreateDefaultContext()
    for _ in range(50):
        q = rng.uniform(a.GetPositionLowerLimits(), a.GetPositionUpperLimits())
        a.SetPositions(context_a, q)
        b.SetPositions(context_b, q)
        for name in names:
            X_a = a.GetFrameByName(name).CalcPoseInWorld(context_a)
            X_b = b.GetFrameByName(name).CalcPoseInWorld(context_b)
            np.testing.assert_allclose(X_a.GetAsMatrix4(), X_b.GetAsMatrix4(), atol=1e-9)


@needs_drake_models
@pytest.mark.parametrize(("arm", "file"), PAIRS)
class TestArmAgainstDrake:
    def test_link_frames(self, arm: str, file: str) -> None:
        assert_same_frames(ours(arm), theirs(file), [f"iiwa_link_{i}" for i in range(8)])

    def test_limits(self, arm: str, file: str) -> None:
        a, b = ours(arm), theirs(file)
        for get in (
            MultibodyPlant.GetPositionLowerLimits,
            MultibodyPlant.GetPositionUpperLimits,
            MultibodyPlant.GetVelocityUpperLimits,
            MultibodyPlant.GetAccelerationUpperLimits,
            MultibodyPlant.GetEffortUpperLimits,
        ):
            np.testing.assert_allclose(get(a), get(b), rtol=1e-9)

    def test_motors(self, arm: str, file: str) -> None:
        a, b = ours(arm), theirs(file)
        assert a.num_actuators() == 7
        for i in range(1, 8):
            mine = a.GetJointActuatorByName(f"iiwa_joint_{i}")
            other = b.get_joint_actuator(b.GetJointActuatorIndices()[i - 1])
            assert mine.default_gear_ratio() == other.default_gear_ratio()
            assert mine.default_rotor_inertia() == pytest.approx(other.default_rotor_inertia())

    def test_masses_and_inertias(self, arm: str, file: str) -> None:
        # All are sound by the tests of TestArm below. (The centre of mass of the base of the
        # iiwa14 lies 0.1 m behind its axis, at the very edge of the casting, and is surely not
        # measured; it is kept, for the base never moves.)
        a, b = ours(arm), theirs(file)
        for i in range(8):
            name = f"iiwa_link_{i}"
            mine = a.GetBodyByName(name).default_spatial_inertia()
            other = b.GetBodyByName(name).default_spatial_inertia()
            assert mine.get_mass() == pytest.approx(other.get_mass(), abs=1e-12)
            np.testing.assert_allclose(mine.get_com(), other.get_com(), atol=1e-12)
            np.testing.assert_allclose(
                inertia_about_com(a, name), inertia_about_com(b, name), atol=1e-12
            )


@pytest.mark.parametrize("arm", ARMS)
class TestArm:
    def test_home_pose_is_straight_up(self, arm: str) -> None:
        # Distances of the data sheet: base to shoulder, to elbow, to wrist, to flange.
        sheet = {"iiwa7": (0.34, 0.4, 0.4, 0.126), "iiwa14": (0.36, 0.42, 0.4, 0.126)}[arm]
        plant = ours(arm)
        context = plant.CreateDefaultContext()
        frames = ("iiwa_link_2", "iiwa_link_4", "iiwa_link_6", "flange")
        X_W = [plant.GetFrameByName(name).CalcPoseInWorld(context) for name in frames]
        heights = [X.translation()[2] for X in X_W]
        # The field's frames of the iiwa7 are half a millimetre high at shoulder and wrist, and
        # both arms' flanges as much low; see the tests against them.
        np.testing.assert_allclose(heights, np.cumsum(sheet), atol=1.1e-3)
        for X in X_W:
            np.testing.assert_allclose(X.translation()[:2], 0.0, atol=1e-12)
        np.testing.assert_allclose(X_W[-1].rotation().matrix(), np.eye(3), atol=1e-12)

    def test_joint_limits_in_degrees(self, arm: str) -> None:
        upper = np.degrees(ours(arm).GetPositionUpperLimits())
        np.testing.assert_allclose(upper, [170, 120, 170, 120, 170, 120, 175], atol=5e-4)
        np.testing.assert_array_equal(ours(arm).GetPositionLowerLimits(), -np.radians(upper))

    def test_axes_and_signs(self, arm: str) -> None:
        # Each joint turns its link about z of the link; at home 2 and 6 lean the arm to +x, 4
        # to -x.
        plant = ours(arm)
        context = plant.CreateDefaultContext()
        flange = plant.GetFrameByName("flange")
        for i, sign in ((2, 1.0), (4, -1.0), (6, 1.0)):
            q = np.zeros(7)
            q[i - 1] = 0.1
            plant.SetPositions(context, q)
            assert np.sign(flange.CalcPoseInWorld(context).translation()[0]) == sign
        for i in range(1, 8):
            joint = plant.GetJointByName(
                f"iiwa_joint_{i}",
            )
            assert isinstance(joint, RevoluteJoint)
            np.testing.assert_allclose(joint.revolute_axis(), [0.0, 0.0, 1.0], atol=1e-5)

    def test_inertias_are_those_of_a_body_of_that_size(self, arm: str) -> None:
        plant = ours(arm)
        for i in range(8):
            M = plant.GetBodyByName(f"iiwa_link_{i}").default_spatial_inertia()
            inertia = inertia_about_com(plant, f"iiwa_link_{i}")
            moments = np.linalg.eigvalsh(inertia)
            assert moments[0] > 0.0
            assert moments[0] + moments[1] > moments[2]
            gyration = np.sqrt(moments[2] / M.get_mass())
            assert gyration < 0.13  # m; no link reaches farther than 0.2 m from its middle


def _bodies_in_contact(plant: MultibodyPlant, context) -> set[tuple[str, str]]:
    query = plant.get_geometry_query_input_port().Eval(context)
    inspector = query.inspector()
    return {
        tuple(
            sorted(
                plant.GetBodyFromFrameId(inspector.GetFrameId(g)).name()
                for g in (pair.id_A, pair.id_B)
            )
        )
        for pair in query.ComputePointPairPenetration()
    }


def _arm_with_hand(arm: str | Model, tmp_path: Path | None = None):
    """Plant, root context and plant context of an arm on the ground with a gripper."""
    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, 0.002)
    parser = Parser(plant)
    parser.package_map().AddMap(package_map())
    if isinstance(arm, Model):
        parser.AddModelsFromString(sdf_text(arm), "sdf")
    else:
        parser.AddModelsFromUrl(find_model(arm).url)
    parser.AddModelsFromUrl(find_model("wsg50").url)
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("iiwa_link_0"))
    plant.WeldFrames(plant.GetFrameByName("iiwa_link_7"), plant.GetFrameByName("body"), X_7G)
    plant.Finalize()
    diagram = builder.Build()
    root = diagram.CreateDefaultContext()
    return diagram, plant, root, plant.GetMyContextFromRoot(root)


@pytest.mark.parametrize("arm", ARMS)
def test_arm_is_clear_of_itself_in_its_workspace(arm: str) -> None:
    _, plant, _root, context = _arm_with_hand(arm)
    instance = plant.GetModelInstanceByName(arm)
    plant.SetPositions(context, instance, np.zeros(7))
    assert not _bodies_in_contact(plant, context)
    rng = np.random.default_rng(3)
    lower, upper = plant.GetPositionLowerLimits()[:7], plant.GetPositionUpperLimits()[:7]
    wrist, gripper = (plant.GetFrameByName(name) for name in ("iiwa_link_6", "grasp_frame"))
    seen = 0
    for _ in range(1000):
        plant.SetPositions(context, instance, rng.uniform(lower, upper))
        points = [f.CalcPoseInWorld(context).translation() for f in (wrist, gripper)]
        # Neither wrist nor gripper at the robot's own foot, nor in the ground that it stands on.
        if all((np.hypot(p[0], p[1]) > 0.25 or p[2] > 0.5) and p[2] > 0.05 for p in points):
            seen += 1
            assert not _bodies_in_contact(plant, context)
    assert seen > 500


@pytest.mark.parametrize("arm", [iiwa7.ARM, iiwa14.ARM], ids=ARMS)
def test_links_that_are_kept_apart_cannot_meet(arm: _iiwa.Arm) -> None:
    # The filter between links two apart hides no collision, but for links 5 and 7: their shapes
    # are fuller than the links, whose joint 6 turns by 120 degrees either way freely.
    made = _iiwa.model(arm)
    unseen = tuple(replace(link, visuals=()) for link in made.links)
    free = Model(made.name, made.comment, unseen, made.joints, made.frames)
    _, plant, _root, context = _arm_with_hand(free)
    rng = np.random.default_rng(4)
    lower, upper = plant.GetPositionLowerLimits()[:7], plant.GetPositionUpperLimits()[:7]
    met = set()
    for _ in range(500):
        q = rng.uniform(lower, upper)
        plant.SetPositions(context, plant.GetModelInstanceByName(arm.name), q)
        met |= _bodies_in_contact(plant, context)
    filtered = {(f"iiwa_link_{i}", f"iiwa_link_{i + 2}") for i in range(6)}
    assert met & filtered <= {("iiwa_link_5", "iiwa_link_7")}


def test_gripper_opens_and_closes_under_drakes_controller() -> None:
    builder = DiagramBuilder()
    config = MultibodyPlantConfig(time_step=0.002, discrete_contact_approximation="sap")
    plant, _ = AddMultibodyPlant(config, builder)
    parser = Parser(plant)
    parser.package_map().AddMap(package_map())
    parser.AddModelsFromUrl(find_model("wsg50").url)
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("body"))
    plant.Finalize()
    controller = builder.AddSystem(SchunkWsgPositionController())
    width = builder.AddSystem(ConstantVectorSource([0.107]))
    force = builder.AddSystem(ConstantVectorSource([40.0]))
    builder.Connect(width.get_output_port(), controller.get_desired_position_input_port())
    builder.Connect(force.get_output_port(), controller.get_force_limit_input_port())
    builder.Connect(plant.get_state_output_port(), controller.get_state_input_port())
    builder.Connect(
        controller.get_generalized_force_output_port(), plant.get_actuation_input_port()
    )
    simulator = Simulator(builder.Build())
    root = simulator.get_mutable_context()
    context = plant.GetMyContextFromRoot(root)
    np.testing.assert_array_equal(plant.GetPositions(context), [0.0, 0.0])
    simulator.AdvanceTo(1.5)
    q = plant.GetPositions(context)
    assert q[1] - q[0] == pytest.approx(0.107, abs=5e-4)
    assert abs(q[0] + q[1]) < 1e-3  # centred
    width.get_mutable_source_value(width.GetMyContextFromRoot(root)).set_value([0.0])
    simulator.AdvanceTo(3.0)
    q = plant.GetPositions(context)
    assert q[1] - q[0] == pytest.approx(0.0, abs=5e-4)


def test_gripper_opening_is_the_distance_between_the_pads() -> None:
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, 0.0)
    parser = Parser(plant)
    parser.package_map().AddMap(package_map())
    parser.AddModelsFromUrl(find_model("wsg50").url)
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("body"))
    plant.Finalize()
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    plant.SetPositions(plant.GetMyContextFromRoot(context), [-0.02, 0.03])
    query = scene_graph.get_query_output_port().Eval(scene_graph.GetMyContextFromRoot(context))
    pads = [
        g
        for g in query.inspector().GetAllGeometryIds(Role.kProximity)
        if query.inspector().GetName(g).endswith("pad")
    ]
    body = plant.GetFrameByName("body").CalcPoseInWorld(plant.GetMyContextFromRoot(context))
    hits = query.ComputeSignedDistanceToPoint(body @ np.array([0.005, 0.102, 0.0]))
    distances = [hit.distance for hit in hits if hit.id_G in pads]
    np.testing.assert_allclose(distances, 0.025, atol=1e-6)


def test_gripper_holds_a_brick_by_its_rubber_pads() -> None:
    # The brick floats between the pads; they press on it with 15 N; then its weight sets in.
    mass, force = 0.4, 15.0
    builder = DiagramBuilder()
    config = MultibodyPlantConfig(
        time_step=0.004,
        contact_model="hydroelastic_with_fallback",
        discrete_contact_approximation="sap",
    )
    plant, _ = AddMultibodyPlant(config, builder)
    parser = Parser(plant)
    parser.package_map().AddMap(package_map())
    (hand,) = parser.AddModelsFromUrl(find_model("wsg50").url)
    # Fingers down, the middle of the pads at the world's origin.
    X_WPads = RigidTransform(RollPitchYaw(-np.pi / 2, 0.0, 0.0), [0.0, 0.0, 0.0])
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("grasp_frame"), X_WPads)
    instance = plant.AddModelInstance("brick")
    size = (0.05, 0.075, 0.05)
    brick = plant.AddRigidBody("brick", instance, SpatialInertia.SolidBoxWithMass(mass, *size))
    properties = ProximityProperties()
    AddRigidHydroelasticProperties(0.05, properties)
    AddContactMaterial(friction=CoulombFriction(0.6, 0.6), properties=properties)
    plant.RegisterCollisionGeometry(brick, RigidTransform(), Box(*size), "brick", properties)
    plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, 0.0])
    plant.Finalize()
    simulator = Simulator(builder.Build())
    context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    plant.SetPositions(context, hand, [-0.02495, 0.02495])  # in touch, so that nothing is hit
    plant.get_actuation_input_port(hand).FixValue(context, [force, -force])
    weight = np.zeros(plant.num_velocities())
    weights = plant.get_applied_generalized_force_input_port()
    weights.FixValue(context, weight)
    simulator.AdvanceTo(0.4)
    X_WB = plant.EvalBodyPoseInWorld(context, brick)
    weight[-1] = -9.81 * mass
    weights.FixValue(context, weight)
    simulator.AdvanceTo(1.4)
    moved = X_WB.InvertAndCompose(plant.EvalBodyPoseInWorld(context, brick))
    assert np.linalg.norm(moved.translation()) < 5e-4
    assert moved.rotation().ToAngleAxis().angle() < np.radians(0.5)
    results = plant.get_contact_results_output_port().Eval(context)
    assert results.num_hydroelastic_contacts() == 2
    # Each pad presses with what its finger is driven by, over a patch that stays cheap.
    for i in range(2):
        info = results.hydroelastic_contact_info(i)
        normal = abs(info.F_Ac_W().translational()[0])
        assert normal == pytest.approx(force, rel=0.03)
        assert info.contact_surface().num_faces() <= 16
    # The opening is the width of the brick, less what the rubber gives.
    q = plant.GetPositions(context, hand)
    assert q[1] - q[0] == pytest.approx(0.05, abs=6e-4)


@pytest.mark.parametrize("arm", ARMS)
def test_arm_with_hand_rests_on_the_table_under_gravity_compensation(arm: str) -> None:
    builder = DiagramBuilder()
    config = MultibodyPlantConfig(
        time_step=0.002,
        contact_model="hydroelastic_with_fallback",
        discrete_contact_approximation="sap",
    )
    plant, _ = AddMultibodyPlant(config, builder)
    parser = Parser(plant)
    parser.package_map().AddMap(package_map())
    (instance,) = parser.AddModelsFromUrl(find_model(arm).url)
    (hand,) = parser.AddModelsFromUrl(find_model("wsg50").url)
    (table,) = parser.AddModelsFromUrl(find_model("table").url)
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("iiwa_link_0"))
    plant.WeldFrames(plant.GetFrameByName("iiwa_link_7"), plant.GetFrameByName("body"), X_7G)
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("base_link", table))
    plant.Finalize()
    simulator = Simulator(builder.Build())
    context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    q = np.array([0.0, 0.5, 0.0, -1.4, 0.0, 1.2, 0.0])
    plant.SetPositions(context, instance, q)
    assert not _bodies_in_contact(plant, context)
    holding = -plant.CalcGravityGeneralizedForces(context)
    plant.get_actuation_input_port(instance).FixValue(context, holding[:7])
    plant.get_actuation_input_port(hand).FixValue(context, holding[7:])
    simulator.AdvanceTo(1.0)
    np.testing.assert_allclose(plant.GetPositions(context, instance), q, atol=1e-4)
    assert np.abs(plant.GetVelocities(context)).max() < 1e-3


@needs_drake_models
class TestGripperAgainstDrake:
    def test_frames(self) -> None:
        a, b = ours("wsg50", "body"), theirs(WSG, "body")
        assert_same_frames(a, b, ["body", "body_frame", "left_finger", "right_finger"])

    def test_limits_and_masses(self) -> None:
        a, b = ours("wsg50", "body"), theirs(WSG, "body")
        np.testing.assert_array_equal(a.GetPositionLowerLimits(), b.GetPositionLowerLimits())
        np.testing.assert_array_equal(a.GetPositionUpperLimits(), b.GetPositionUpperLimits())
        np.testing.assert_array_equal(a.GetEffortUpperLimits(), b.GetEffortUpperLimits())
        for name in ("body", "left_finger", "right_finger"):
            assert a.GetBodyByName(name).default_mass() == b.GetBodyByName(name).default_mass()

    @pytest.mark.parametrize(("name", "reach"), [("body", 0.085), ("right_finger", 0.045)])
    def test_its_inertias_are_unsound(self, name: str, reach: float) -> None:
        # No body has a radius of gyration beyond its own farthest point. The field's file gives
        # 0.16 kg m² to fingers of 50 g and to the body of 1 kg: radii of 1.8 m and 0.4 m.
        for plant, sound in ((ours("wsg50", "body"), True), (theirs(WSG, "body"), False)):
            moments = np.diag(inertia_about_com(plant, name))
            gyration = np.sqrt(moments.max() / plant.GetBodyByName(name).default_mass())
            assert (gyration < reach) == sound


def test_camera_frames() -> None:
    # Data sheet of the D415: 99 x 20 x 23 mm, 55 mm between the imagers, the left one 20 mm from
    # the middle, the colour imager 15 mm to the left of it.
    plant = ours("d415", "base_link")
    context = plant.CreateDefaultContext()
    X_depth = plant.GetFrameByName("depth_optical_frame").CalcPoseInWorld(context)
    X_color = plant.GetFrameByName("color_optical_frame").CalcPoseInWorld(context)
    np.testing.assert_allclose(X_depth.rotation().col(2), [1, 0, 0], atol=1e-9)
    np.testing.assert_allclose(X_depth.rotation().col(1), [0, 0, -1], atol=1e-9)
    step = X_depth.InvertAndCompose(X_color).translation()
    np.testing.assert_allclose(step, [-0.015, 0.0, 0.0], atol=1e-9)
    assert plant.GetBodyByName("base_link").default_mass() == 0.072
