"""The embedded hands, against the field's models and published facts, and at work."""

from pathlib import Path

import numpy as np
import pytest
from pydrake.geometry import Role
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlant, MultibodyPlant, MultibodyPlantConfig
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
    """A hand held by one of its frames, perhaps with a brick, simulated with SAP."""

    def __init__(
        self,
        hand: str,
        held_by: str,
        X_WHeld: RigidTransform | None = None,
        *,
        brick: bool = False,
        time_step: float = 0.004,
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
        frame = self.plant.GetFrameByName(held_by)
        self.plant.WeldFrames(self.plant.world_frame(), frame, X_WHeld or RigidTransform())
        self.brick = None
        if brick:
            (instance,) = parser.AddModelsFromUrl(find_model("foam_brick").url)
            self.brick = self.plant.get_body(self.plant.GetBodyIndices(instance)[0])
        self.plant.Finalize()
        self.simulator = Simulator(builder.Build())
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
