"""The embedded hands, against the field's models and published facts, and at work."""

from pathlib import Path

import numpy as np
import pytest
from pydrake.geometry import (
    AddContactMaterial,
    AddRigidHydroelasticProperties,
    Cylinder,
    ProximityProperties,
    Role,
)
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import (
    AddMultibodyPlant,
    CoulombFriction,
    MultibodyPlant,
    MultibodyPlantConfig,
)
from pydrake.multibody.tree import PdControllerGains
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, DiagramBuilder

from prehensile.models.registry import find_model, package_map

DRAKE_MODELS = Path(__file__).parents[1].parent / "shared" / "drake_models"
needs_drake_models = pytest.mark.skipif(
    not DRAKE_MODELS.is_dir(), reason="Drake's models are not beside this repository"
)


def load(url: str, base: str) -> MultibodyPlant:
    """A plant of one model, welded to the world by one of its links."""
    plant = MultibodyPlant(0.001)
    parser = Parser(plant)
    packages = {"drake_models": DRAKE_MODELS} if DRAKE_MODELS.is_dir() else {}
    parser.package_map().Remove("drake_models")  # ours is on this machine, or not needed
    parser.package_map().AddMap(package_map(packages))
    parser.AddModelsFromUrl(url)
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName(base))
    plant.Finalize()
    return plant


def ours(name: str, base: str) -> MultibodyPlant:
    return load(find_model(name).url, base)


def theirs(file: str, base: str) -> MultibodyPlant:
    return load(f"package://drake_models/{file}", base)


def assert_same_frames(
    a: MultibodyPlant, b: MultibodyPlant, names: list[str], atol: float = 1e-9
) -> None:
    """The named frames agree at random configurations within the limits, joints named alike."""
    rng = np.random.default_rng(7)
    context_a, context_b = a.CreateDefaultContext(), b.CreateDefaultContext()
    order = [
        b.GetJointByName(a.get_joint(i).name()).position_start()
        for i in a.GetJointIndices()
        if a.get_joint(i).num_positions()
    ]
    for _ in range(50):
        q_a = rng.uniform(a.GetPositionLowerLimits(), a.GetPositionUpperLimits())
        q_b = np.zeros(len(q_a))
        q_b[order] = q_a
        a.SetPositions(context_a, q_a)
        b.SetPositions(context_b, q_b)
        for name in names:
            X_a = a.GetFrameByName(name).CalcPoseInWorld(context_a)
            X_b = b.GetFrameByName(name).CalcPoseInWorld(context_b)
            np.testing.assert_allclose(X_a.GetAsMatrix4(), X_b.GetAsMatrix4(), atol=atol)


class Bench:
    """A hand held by one of its frames or over a floor, perhaps with a brick; SAP."""

    def __init__(
        self,
        hand: str,
        held_by: str | None,
        X_WHeld: RigidTransform | None = None,
        *,
        brick: bool = False,
        time_step: float = 0.004,
        gains: PdControllerGains | None = None,
        post: tuple[float, float] | None = None,
    ) -> None:
        builder = DiagramBuilder()
        config = MultibodyPlantConfig(
            time_step=time_step,
            contact_model="hydroelastic_with_fallback",
            discrete_contact_approximation="sap",
        )
        self.plant, _ = AddMultibodyPlant(config, builder)
        parser = Parser(self.plant)
        parser.package_map().AddMap(package_map())
        (self.hand,) = parser.AddModelsFromUrl(find_model(hand).url)
        world_frame = self.plant.world_frame()
        if held_by:
            frame = self.plant.GetFrameByName(held_by)
            self.plant.WeldFrames(world_frame, frame, X_WHeld or RigidTransform())
        else:
            parser.AddModelsFromUrl(find_model("floor").url)
            self.plant.WeldFrames(world_frame, self.plant.GetFrameByName("base_link"))
        self.brick = None
        if brick:
            (instance,) = parser.AddModelsFromUrl(find_model("foam_brick").url)
            self.brick = self.plant.get_body(self.plant.GetBodyIndices(instance)[0])
        if post:  # a fixed cylinder along y: its radius and height
            X_WP = RigidTransform(RollPitchYaw(np.pi / 2, 0.0, 0.0), [0.0, 0.0, post[1]])
            world, shape = self.plant.world_body(), Cylinder(post[0], 0.1)
            surface = ProximityProperties()
            AddRigidHydroelasticProperties(0.01, surface)
            AddContactMaterial(friction=CoulombFriction(0.3, 0.3), properties=surface)
            self.plant.RegisterCollisionGeometry(world, X_WP, shape, "post", surface)
            self.plant.RegisterVisualGeometry(world, X_WP, shape, "post", [0.2, 0.5, 0.8, 1.0])
        for index in self.plant.GetJointActuatorIndices() if gains else ():
            self.plant.get_joint_actuator(index).set_controller_gains(gains)
        self.plant.Finalize()
        self.diagram = builder.Build()
        self.simulator = Simulator(self.diagram)
        self.root = self.simulator.get_mutable_context()
        self.context: Context = self.plant.GetMyMutableContextFromRoot(self.root)

    def push(self, effort: list[float]) -> None:
        """Sets the efforts of the hand's actuators."""
        self.plant.get_actuation_input_port(self.hand).FixValue(self.context, effort)

    def joint(self, name: str) -> float:
        """Position of a joint."""
        start = self.plant.GetJointByName(name).position_start()
        return float(self.plant.GetPositions(self.context)[start])

    def pose(self, frame: str) -> RigidTransform:
        """X_WF of a frame of the hand."""
        return self.plant.GetFrameByName(frame, self.hand).CalcPoseInWorld(self.context)

    def pose_of_brick(self) -> RigidTransform:
        """X_WB of the brick."""
        assert self.brick is not None
        return self.plant.EvalBodyPoseInWorld(self.context, self.brick)

    def distance(self, p_W: np.ndarray, name: str) -> list[float]:
        """Signed distances of a point from the collision shapes with a name."""
        query = self.plant.get_geometry_query_input_port().Eval(self.context)
        inspector = query.inspector()
        shapes = {
            g
            for g in inspector.GetAllGeometryIds(Role.kProximity)
            if inspector.GetName(g).endswith(name)
        }
        hits = query.ComputeSignedDistanceToPoint(p_W)
        return [hit.distance for hit in hits if hit.id_G in shapes]


FINGERS_DOWN = RigidTransform(RollPitchYaw(np.pi, 0.0, 0.0), [0.0, 0.0, 0.0])


class TestPandaHand:
    def test_opening_is_the_distance_between_the_pads(self) -> None:
        bench = Bench("panda_hand", "panda_hand")
        bench.plant.SetPositions(bench.context, [0.02, 0.03])
        distances = bench.distance(np.array([0.002, -0.005, 0.1045]), "pad")
        np.testing.assert_allclose(sorted(distances), [0.025, 0.025], atol=1e-6)

    def test_one_finger_follows_the_other(self) -> None:
        # The motor of the left finger alone moves both, without either leaving its way.
        bench = Bench("panda_hand", "panda_hand")
        bench.push([10.0, 0.0])
        bench.simulator.AdvanceTo(0.08)
        left, right = bench.plant.GetPositions(bench.context)
        # Half the force for each kilogram: s = 1/2 a t^2 with a = 10 N / 2.03 kg.
        assert left == pytest.approx(0.5 * 10.0 / 2.03 * 0.08**2, rel=0.06)
        assert right == pytest.approx(left, abs=1e-5)
        bench.simulator.AdvanceTo(1.0)
        q = bench.plant.GetPositions(bench.context)
        np.testing.assert_allclose(q, 0.04, atol=2e-4)

    def test_holds_a_brick(self) -> None:
        # Fingers down, the brick's narrow side between the pads; its weight from the start.
        bench = Bench("panda_hand", "panda_hand_tcp", FINGERS_DOWN, brick=True)
        assert bench.brick is not None
        bench.plant.SetPositions(bench.context, bench.hand, [0.0253, 0.0253])
        X_WB = RigidTransform(RollPitchYaw(0.0, 0.0, np.pi / 2), [0.0, 0.0, -0.01])
        bench.plant.SetFreeBodyPose(bench.context, bench.brick, X_WB)
        bench.push([-30.0, -30.0])
        bench.simulator.AdvanceTo(0.1)
        X_WB = bench.pose_of_brick()
        bench.simulator.AdvanceTo(1.1)
        moved = X_WB.InvertAndCompose(bench.pose_of_brick())
        assert np.linalg.norm(moved.translation()) < 1e-3
        assert moved.rotation().ToAngleAxis().angle() < np.radians(1.0)

    @needs_drake_models
    def test_frames_and_limits_are_drakes(self) -> None:
        a = ours("panda_hand", "panda_hand")
        b = theirs("franka_description/urdf/hand.urdf", "panda_hand")
        assert_same_frames(a, b, ["panda_hand", "panda_leftfinger", "panda_rightfinger"])
        for name in ("panda_finger_joint1", "panda_finger_joint2"):
            mine, other = a.GetJointByName(name), b.GetJointByName(name)
            assert mine.position_lower_limits() == other.position_lower_limits()
            assert mine.position_upper_limits() == other.position_upper_limits()
            assert mine.velocity_upper_limits() == other.velocity_upper_limits()
        mine, other = (p.GetBodyByName("panda_hand").default_spatial_inertia() for p in (a, b))
        np.testing.assert_allclose(mine.CopyToFullMatrix6(), other.CopyToFullMatrix6(), atol=1e-9)


SIDES = ("right", "left")
TIPS = [f"link_{i}_tip" for i in (3, 7, 11, 15)]
OPEN = np.where(np.arange(16) == 12, 0.3, 0.0)
FIST = np.array([0.0, 1.2, 1.2, 0.9] * 3 + [1.3, 0.4, 0.5, 0.8])


class TestAllegro:
    @needs_drake_models
    @pytest.mark.parametrize("side", SIDES)
    def test_frames_and_limits_are_drakes(self, side: str) -> None:
        file = f"allegro_hand_description/sdf/allegro_hand_description_{side}.sdf"
        a, b = ours(f"allegro_{side}", "hand_root"), theirs(file, "hand_root")
        # Theirs gives pi to five and axes to six digits.
        assert_same_frames(a, b, [f"link_{i}" for i in range(16)], atol=1e-5)
        for i in range(16):
            mine, other = a.GetJointByName(f"joint_{i}"), b.GetJointByName(f"joint_{i}")
            assert mine.position_lower_limits() == other.position_lower_limits()
            assert mine.position_upper_limits() == other.position_upper_limits()
            assert mine.default_damping() == other.default_damping()
            assert a.GetJointActuatorByName(f"joint_{i}").effort_limit() == 0.7

    @needs_drake_models
    @pytest.mark.parametrize("side", SIDES)
    def test_masses_are_drakes_and_moments_about_the_same_points(self, side: str) -> None:
        file = f"allegro_hand_description/sdf/allegro_hand_description_{side}.sdf"
        a, b = ours(f"allegro_{side}", "hand_root"), theirs(file, "hand_root")
        for name in ["hand_root", *(f"link_{i}" for i in (0, 1, 2, 3, 14))]:
            mine, other = (p.GetBodyByName(name).default_spatial_inertia() for p in (a, b))
            assert mine.get_mass() == pytest.approx(other.get_mass(), abs=1e-12)
            # Theirs, found from the meshes, is about the frame's origin, though the file says
            # that it is about the centre of mass, which it puts there.
            np.testing.assert_array_equal(other.get_com(), 0.0)
            moments = [
                np.diag(M.CalcRotationalInertia().CopyToFullMatrix3()) for M in (mine, other)
            ]
            np.testing.assert_allclose(*moments, rtol=0.5)

    def test_the_left_hand_is_the_right_one_in_a_mirror(self) -> None:
        right, left = (Bench(f"allegro_{side}", "hand_root") for side in SIDES)
        rng = np.random.default_rng(2)
        for _ in range(20):
            limits = right.plant.GetPositionLowerLimits(), right.plant.GetPositionUpperLimits()
            q = rng.uniform(*limits)
            for bench in (right, left):
                bench.plant.SetPositions(bench.context, q)
            for tip in TIPS:
                p = right.pose(tip).translation() * [1.0, -1.0, 1.0]
                np.testing.assert_allclose(left.pose(tip).translation(), p, atol=1e-9)
            com = [b.plant.CalcCenterOfMassPositionInWorld(b.context) for b in (right, left)]
            np.testing.assert_allclose(com[0] * [1.0, -1.0, 1.0], com[1], atol=1e-8)

    @pytest.mark.parametrize("side", SIDES)
    def test_bends_to_the_palm_and_thumb_meets_fingers(self, side: str) -> None:
        bench = Bench(f"allegro_{side}", "hand_root")
        bench.plant.SetPositions(bench.context, FIST)
        tips = np.array([bench.pose(tip).translation() for tip in TIPS])
        assert (tips[:, 0] > 0.02).all()  # before the palm
        assert (tips[:3, 2] < 0.11).all()  # bent down again
        thumb = tips[3]
        assert np.linalg.norm(tips[:3] - thumb, axis=1).min() < 0.07

    @pytest.mark.parametrize("side", SIDES)
    def test_open_hand_is_clear_of_itself(self, side: str) -> None:
        bench = Bench(f"allegro_{side}", "hand_root")
        for q in (OPEN, 0.5 * (OPEN + FIST)):
            bench.plant.SetPositions(bench.context, q)
            query = bench.plant.get_geometry_query_input_port().Eval(bench.context)
            assert not query.HasCollisions()

    @pytest.mark.parametrize("side", SIDES)
    def test_follows_targets(self, side: str) -> None:
        bench = Bench(f"allegro_{side}", "hand_root", gains=PdControllerGains(p=3.0, d=0.1))
        bench.plant.SetPositions(bench.context, OPEN)
        target = bench.plant.get_desired_state_input_port(bench.hand)
        duration, goal = 0.6, 0.5 * (OPEN + FIST)
        for step in range(31):
            s = min(1.0, step * 0.025 / duration)
            q, v = OPEN + s * (goal - OPEN), (goal - OPEN) / duration * (s < 1.0)
            target.FixValue(bench.context, np.r_[q, v])
            bench.simulator.AdvanceTo(0.025 * (step + 1))
            assert np.abs(bench.plant.GetPositions(bench.context) - q).max() < 0.08
        bench.simulator.AdvanceTo(1.2)
        # What is left is the fingers' weight on springs of 3 N m/rad.
        np.testing.assert_allclose(bench.plant.GetPositions(bench.context), goal, atol=0.03)
        assert np.abs(bench.plant.GetVelocities(bench.context)).max() < 1e-2

    def test_falls_limp_without_flying_off(self) -> None:
        # From the default configuration, where the thumb is outside of its limits.
        fingers_down = RigidTransform(RollPitchYaw(np.pi, 0.0, 0.0), [0.0, 0.0, 0.5])
        bench = Bench("allegro_right", "hand_root", fingers_down)
        bench.push([0.0] * 16)
        for step in range(20):
            bench.simulator.AdvanceTo(0.05 * (step + 1))
            assert np.abs(bench.plant.GetVelocities(bench.context)).max() < 15.0
        q = bench.plant.GetPositions(bench.context)
        assert (q > bench.plant.GetPositionLowerLimits() - 0.02).all()
        assert (q < bench.plant.GetPositionUpperLimits() + 0.02).all()


# The linkage of the 2F-85 as published, at +x of the base: hinges of the outer knuckle on the
# base, of the inner knuckle there, and what leads from the first to the inner finger's.
HINGE_A, HINGE_D = np.array([0.03060114, 0.05490452]), np.array([0.0127, 0.06142])
CRANK = np.array([0.03152616 + 0.00563134, -0.00376347 + 0.04718515])


def parallel(q: float) -> list[float]:
    """Positions of a finger's joints while it is a parallelogram."""
    return [q, 0.0, -q, q]


def inner_finger(q: float) -> np.ndarray:
    """x and z of the inner finger's hinge on the crank."""
    c, s = np.cos(q), np.sin(q)
    return HINGE_A + [c * CRANK[0] - s * CRANK[1], s * CRANK[0] + c * CRANK[1]]


def lean(bench: Bench, side: str) -> float:
    """Angle by which a tip leans inwards, rad."""
    z = bench.pose(f"{side}_inner_finger").rotation().col(2)
    return float(np.arctan2(-z[0] if side == "left" else z[0], z[2]))


class TestRobotiq:
    def test_one_motor_and_three_constraints(self) -> None:
        plant = Bench("robotiq_2f85", "robotiq_base_link").plant
        assert plant.num_actuators() == 1
        assert plant.num_positions() == 8
        assert plant.num_constraints() == 3  # two loops, and one finger follows the other

    @pytest.mark.parametrize("fraction", [0.0, 0.3, 0.7, 1.0])
    def test_opening_of_parallel_pads(self, fraction: float) -> None:
        bench = Bench("robotiq_2f85", "robotiq_base_link")
        joint = bench.plant.GetJointByName("finger_joint")
        q = fraction * float(joint.position_upper_limits()[0])
        bench.plant.SetPositions(bench.context, 2 * parallel(q))
        x, _ = inner_finger(q)
        opening = 0.085 - 2.0 * (inner_finger(0.0)[0] - x)
        assert opening == pytest.approx({0.0: 0.085, 1.0: 0.0}.get(fraction, opening), abs=1e-6)
        middle = bench.pose("left_pad").translation()
        distances = bench.distance(np.array([0.0, 0.002, middle[2] + 0.005]), "pad")
        np.testing.assert_allclose(distances, opening / 2, atol=1e-6)
        # Closed, it is 162.8 mm long from the coupling to the end of the pads.
        if fraction == 1.0:
            assert middle[2] + 0.0375 / 2 == pytest.approx(0.1628, abs=3e-4)

    @pytest.mark.parametrize("time_step", [0.002, 0.005])
    def test_moves_as_a_parallelogram_with_its_loops_closed(self, time_step: float) -> None:
        bench = Bench("robotiq_2f85", "robotiq_base_link", time_step=time_step)
        bench.push([3.0])
        q = 0.0
        for step in range(30):
            bench.simulator.AdvanceTo(0.03 * (step + 1))
            q = bench.joint("finger_joint")
            assert bench.joint("right_outer_knuckle_joint") == pytest.approx(q, abs=1e-5)
            for name, side in (("left", 1.0), ("right", -1.0)):
                X_WT = bench.pose(f"{name}_inner_finger")
                x, z = inner_finger(q)
                np.testing.assert_allclose(X_WT.translation(), [side * x, 0, z], atol=2e-5)
                assert abs(lean(bench, name)) < 5e-4
                # The hinge where the loop is closed, seen from both of its links.
                u, w = HINGE_D - HINGE_A
                on_knuckle = bench.pose(f"{name}_inner_knuckle") @ [side * CRANK[0], 0, CRANK[1]]
                gap = X_WT @ np.array([side * u, 0.0, w]) - on_knuckle
                assert np.linalg.norm(gap) < 1e-6
        assert q == pytest.approx(0.8014, abs=1e-3)  # closed in less than a second

    def test_pinches_and_encompasses(self) -> None:
        # A post between the pads leaves the outer fingers on their stops; one that the inner
        # knuckles meet first is held by bent fingers.
        pinched = Bench("robotiq_2f85", "robotiq_base_link", post=(0.02, 0.152))
        wrapped = Bench("robotiq_2f85", "robotiq_base_link", post=(0.026, 0.105))
        for bench in (pinched, wrapped):
            bench.push([3.0])
            bench.simulator.AdvanceTo(1.2)
            assert np.abs(bench.plant.GetVelocities(bench.context)).max() < 0.05
        for side in ("left", "right"):
            assert abs(pinched.joint(f"{side}_outer_finger_joint")) < 1e-3
            assert abs(lean(pinched, side)) < 3e-3
            assert wrapped.joint(f"{side}_outer_finger_joint") < -0.3
            assert lean(wrapped, side) > 0.5
        # Virtual work: torque times turn is the two fingers' force times the pads' way.
        rate = np.linalg.norm(CRANK) * np.sin(
            np.arctan2(CRANK[1], CRANK[0]) + pinched.joint("finger_joint")
        )
        results = pinched.plant.get_contact_results_output_port().Eval(pinched.context)
        assert results.num_point_pair_contacts() == 0
        assert results.num_hydroelastic_contacts() == 2
        contacts = [results.hydroelastic_contact_info(i) for i in range(2)]
        forces = [abs(contact.F_Ac_W().translational()[0]) for contact in contacts]
        assert sum(forces) == pytest.approx(3.0 / rate, rel=0.06)  # but for friction
        # Round the post there are four contacts: both pads, and the metal of both inner knuckles.
        results = wrapped.plant.get_contact_results_output_port().Eval(wrapped.context)
        assert results.num_hydroelastic_contacts() == 2
        assert results.num_point_pair_contacts() >= 2

    def test_holds_a_brick(self) -> None:
        bench = Bench("robotiq_2f85", "grasp_frame", FINGERS_DOWN, brick=True)
        assert bench.brick is not None
        bench.plant.SetPositions(bench.context, bench.hand, 2 * parallel(0.35))
        X_WB = RigidTransform([0.0, 0.0, -0.013])
        bench.plant.SetFreeBodyPose(bench.context, bench.brick, X_WB)
        bench.push([4.0])
        bench.simulator.AdvanceTo(0.15)
        X_WB = bench.pose_of_brick()
        bench.simulator.AdvanceTo(1.15)
        moved = X_WB.InvertAndCompose(bench.pose_of_brick())
        assert np.linalg.norm(moved.translation()) < 1e-3
        assert moved.rotation().ToAngleAxis().angle() < np.radians(1.0)

    def test_full_force_on_nothing_breaks_nothing(self) -> None:
        sideways = RigidTransform(RollPitchYaw(0.0, np.pi / 2, 0.3), np.zeros(3))
        bench = Bench("robotiq_2f85", "robotiq_base_link", sideways, time_step=0.005)
        for time, effort in ((0.5, 26.0), (1.0, -26.0), (1.5, 26.0)):
            bench.push([effort])
            bench.simulator.AdvanceTo(time)
            q = bench.plant.GetPositions(bench.context)
            end = 0.8014 if effort > 0 else 0.0
            np.testing.assert_allclose(q, 2 * parallel(end), atol=0.01)
            assert np.abs(bench.plant.GetVelocities(bench.context)).max() < 1e-2


HANDS = ("panda_hand", "allegro_right", "robotiq_2f85", "suction_cup")


@pytest.mark.parametrize("hand", HANDS)
def test_dropped_on_the_floor_it_comes_to_lie(hand: str) -> None:
    # Limp, from 30 cm, at the longest step; nothing adds energy to what the fall gives.
    bench = Bench(hand, None, time_step=0.005)
    plant, context = bench.plant, bench.context
    base = plant.get_body(plant.GetBodyIndices(bench.hand)[0])
    X_WB = RigidTransform(RollPitchYaw(2.0, 0.4, 0.0), [0.0, 0.0, 0.4])
    plant.SetFreeBodyPose(context, base, X_WB)
    if plant.num_actuators():
        bench.push([0.0] * plant.num_actuators())
    start = plant.CalcPotentialEnergy(context)
    for step in range(12):
        bench.simulator.AdvanceTo(0.1 * (step + 1))
        V_WB = plant.EvalBodySpatialVelocityInWorld(context, base)
        assert np.linalg.norm(V_WB.translational()) < 3.0
        energy = plant.CalcKineticEnergy(context) + plant.CalcPotentialEnergy(context)
        assert energy < start + 0.05 * abs(start)
    assert np.linalg.norm(plant.EvalBodyPoseInWorld(context, base).translation()) < 0.5
    assert plant.CalcKineticEnergy(context) < 0.1
