"""Panda, UR5e, UR10e, Gen3, xArm 7: against the makers' kinematics and what a body can be."""

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pytest
from model_checks import Scene, scene
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import JacobianWrtVariable
from pydrake.planning import RobotDiagramBuilder
from pydrake.systems.analysis import Simulator

from prehensile.models.generate.robots import _arm, _ur, ur5e, ur10e
from prehensile.models.generate.sdf_model import sdf_text
from prehensile.models.registry import load_spheres

DRAKE_MODELS = Path(__file__).parents[1].parent / "shared" / "drake_models"
needs_drake_models = pytest.mark.skipif(
    not DRAKE_MODELS.is_dir(), reason="Drake's models are not beside this repository"
)


@dataclass(frozen=True)
class Facts:
    """What makers publish of an arm.

    Attributes:
        base: first link, which the first row of ``table`` starts from but for ``X_base``.
        tool: frame that the table ends in.
        table: rows a, alpha, d, theta at zero of Denavit and Hartenberg's parameters (m, rad).
        craig: whether the rows are Craig's: Rx(alpha) Tx(a) Rz(theta) Tz(d), the last row without
            a joint. Otherwise they are Rz(theta) Tz(d) Tx(a) Rx(alpha).
        tolerance: of positions, m; angles of the maker's description may be rounded.
        weight: of the arm, kg.
        load: that it holds with the arm stretched out, kg.
        home: configuration, rad.
        free: share of all configurations without self-collision that is expected at least.
        start: pose of the table's first frame in the base.
    """

    base: str
    tool: str
    table: tuple[tuple[float, float, float, float], ...]
    weight: float
    load: float
    home: tuple[float, ...]
    free: float
    craig: bool = False
    tolerance: float = 1e-9
    start: RigidTransform = field(default_factory=RigidTransform)


PI, Q = np.pi, 0.5 * np.pi
BACK = RigidTransform(RotationMatrix.MakeZRotation(PI), np.zeros(3))
DOWN = RigidTransform(RotationMatrix.MakeXRotation(PI), np.zeros(3))
UR_HOME = (0.0, -Q, Q, -Q, -Q, 0.0)
ARMS = {
    # Universal Robots: DH parameters for calculations of kinematics and dynamics.
    "ur5e": Facts(
        base="base_link",
        tool="tool0",
        table=(
            (0.0, Q, 0.1625, 0.0),
            (-0.425, 0.0, 0.0, 0.0),
            (-0.3922, 0.0, 0.0, 0.0),
            (0.0, Q, 0.1333, 0.0),
            (0.0, -Q, 0.0997, 0.0),
            (0.0, 0.0, 0.0996, 0.0),
        ),
        weight=20.6,
        load=5.0,
        home=UR_HOME,
        free=0.75,
        start=BACK,
    ),
    "ur10e": Facts(
        base="base_link",
        tool="tool0",
        table=(
            (0.0, Q, 0.1807, 0.0),
            (-0.6127, 0.0, 0.0, 0.0),
            (-0.57155, 0.0, 0.0, 0.0),
            (0.0, Q, 0.17415, 0.0),
            (0.0, -Q, 0.11985, 0.0),
            (0.0, 0.0, 0.11655, 0.0),
        ),
        weight=33.5,
        load=12.5,
        home=UR_HOME,
        free=0.75,
        start=BACK,
    ),
    # Franka Control Interface: Denavit-Hartenberg parameters.
    "panda": Facts(
        base="panda_link0",
        tool="panda_link8",
        table=(
            (0.0, 0.0, 0.333, 0.0),
            (0.0, -Q, 0.0, 0.0),
            (0.0, Q, 0.316, 0.0),
            (0.0825, Q, 0.0, 0.0),
            (-0.0825, -Q, 0.384, 0.0),
            (0.0, Q, 0.0, 0.0),
            (0.088, Q, 0.0, 0.0),
            (0.0, 0.0, 0.107, 0.0),
        ),
        craig=True,
        weight=18.0,
        load=3.0,
        home=(0.0, -PI / 4, 0.0, -3 * PI / 4, 0.0, Q, PI / 4),
        free=0.9,
    ),
    # Kinova, Gen3 User Guide: classical DH parameters, in tenths of millimetres.
    "gen3": Facts(
        base="base_link",
        tool="end_effector_link",
        table=(
            (0.0, Q, -(0.1564 + 0.1284), 0.0),
            (0.0, Q, -(0.0054 + 0.0064), PI),
            (0.0, Q, -(0.2104 + 0.2104), PI),
            (0.0, Q, -(0.0064 + 0.0064), PI),
            (0.0, Q, -(0.2084 + 0.1059), PI),
            (0.0, Q, -(0.0002 + 0.0002), PI),
            (0.0, PI, -(0.1059 + 0.0615), PI),
        ),
        tolerance=2e-4,
        weight=8.2,
        load=1.1,
        home=(0.0, 0.2618, PI, -2.2689, 0.0, 0.9599, Q),
        free=0.9,
        start=DOWN,
    ),
    # UFACTORY, xArm user manual: DH parameters.
    "xarm7": Facts(
        base="link_base",
        tool="link_eef",
        table=(
            (0.0, -Q, 0.267, 0.0),
            (0.0, Q, 0.0, 0.0),
            (0.0525, Q, 0.293, 0.0),
            (0.0775, Q, 0.0, 0.0),
            (0.0, Q, 0.3425, 0.0),
            (0.076, -Q, 0.0, 0.0),
            (0.0, 0.0, 0.097, 0.0),
        ),
        tolerance=2e-5,
        weight=13.7,
        load=2.0,
        home=(0.0, -0.247, 0.0, 0.909, 0.0, 1.156, 0.0),
        free=0.85,
    ),
}


def turn(axis: str, angle: float, along: float) -> RigidTransform:
    """A screw about and along x or z."""
    make = {"x": RotationMatrix.MakeXRotation, "z": RotationMatrix.MakeZRotation}[axis]
    return RigidTransform(make(angle), along * np.eye(3)["xyz".index(axis)])


def forward_kinematics(facts: Facts, q: np.ndarray) -> RigidTransform:
    """Pose of the tool in the base by the table."""
    X = facts.start
    for i, (a, alpha, d, zero) in enumerate(facts.table):
        theta = zero + (q[i] if i < len(q) else 0.0)
        aside, along = turn("x", alpha, a), turn("z", theta, d)
        X = X @ aside @ along if facts.craig else X @ along @ aside
    return X


@pytest.fixture(params=list(ARMS))
def arm(request: pytest.FixtureRequest) -> tuple[str, Facts, Scene]:
    name = request.param
    return name, ARMS[name], scene(name, weld=ARMS[name].base, time_step=0.001)


def configurations(plant: MultibodyPlant, count: int) -> np.ndarray:
    rng = np.random.default_rng(8)
    lower, upper = plant.GetPositionLowerLimits(), plant.GetPositionUpperLimits()
    return rng.uniform(lower, upper, size=(count, plant.num_positions()))


def contacts(made: Scene, q: np.ndarray) -> set[tuple[str, ...]]:
    """Pairs of links that touch."""
    made.plant.SetPositions(made.context, q)
    inspector = made.query.inspector()
    return {
        tuple(
            sorted(
                made.plant.GetBodyFromFrameId(inspector.GetFrameId(g)).name()
                for g in (pair.id_A, pair.id_B)
            )
        )
        for pair in made.query.ComputePointPairPenetration()
    }


def test_forward_kinematics_is_that_of_the_makers_table(arm: tuple[str, Facts, Scene]) -> None:
    _, facts, made = arm
    tool = made.plant.GetFrameByName(facts.tool)
    for q in configurations(made.plant, 50):
        made.plant.SetPositions(made.context, q)
        X_BT = tool.CalcPoseInWorld(made.context).GetAsMatrix4()
        np.testing.assert_allclose(
            X_BT, forward_kinematics(facts, q).GetAsMatrix4(), atol=facts.tolerance
        )


def test_joints_have_limits_and_motors(arm: tuple[str, Facts, Scene]) -> None:
    _, facts, made = arm
    plant = made.plant
    n = len(facts.home)
    assert plant.num_positions() == plant.num_actuators() == n
    home = np.array(facts.home)
    assert (plant.GetPositionLowerLimits() <= home).all()
    assert (home <= plant.GetPositionUpperLimits()).all()
    for upper in (plant.GetVelocityUpperLimits(), plant.GetEffortUpperLimits()):
        assert np.isfinite(upper).all()
        assert (upper > 0.0).all()
    motors = [plant.get_joint_actuator(i) for i in plant.GetJointActuatorIndices()]
    reflected = np.array([m.default_rotor_inertia() * m.default_gear_ratio() ** 2 for m in motors])
    # A motor behind a strain wave gear weighs on its joint as links of the arm do.
    plant.SetPositions(made.context, home)
    M = plant.CalcMassMatrix(made.context)
    links = np.diag(M) - reflected
    assert (links > 0.0).all()
    assert (reflected[:2] < 3.0 * links.max()).all()
    assert (reflected > 0.05).all()
    assert (np.diff(reflected) <= 0.0).all()  # motors get smaller towards the tool


def test_weight_is_that_of_the_data_sheet(arm: tuple[str, Facts, Scene]) -> None:
    _, facts, made = arm
    mass = made.plant.CalcTotalMass(made.context)
    assert mass == pytest.approx(facts.weight, rel=0.005)
    base = made.plant.GetBodyByName(facts.base).default_mass()
    assert 0.1 * mass < base < 0.25 * mass


def test_inertias_are_those_of_bodies_of_that_size(arm: tuple[str, Facts, Scene]) -> None:
    name, _, made = arm
    for link, rows in load_spheres(name).items():
        M = made.plant.GetBodyByName(link).default_spatial_inertia()
        assert M.IsPhysicallyValid()
        com = M.get_com()
        inertia = M.Shift(com).CalcRotationalInertia().CopyToFullMatrix3()
        moments = np.linalg.eigvalsh(inertia)
        # The centre of mass lies in the link, and no axis of gyration beyond its farthest point.
        away = np.linalg.norm(rows[:, :3] - com, axis=1)
        assert (away - rows[:, 3]).min() < 0.0
        assert moments[0] > 0.0
        assert np.sqrt(moments[2] / M.get_mass()) < 0.8 * (away + rows[:, 3]).max()


def test_motors_hold_the_stretched_arm_and_its_load(arm: tuple[str, Facts, Scene]) -> None:
    _, facts, made = arm
    plant, context = made.plant, made.context
    tool, weight = plant.GetFrameByName(facts.tool), np.array([0.0, 0.0, -9.81 * facts.load])
    world = plant.world_frame()
    worst = np.zeros(plant.num_velocities())
    for q in configurations(plant, 1000):
        plant.SetPositions(context, q)
        J = plant.CalcJacobianTranslationalVelocity(
            context, JacobianWrtVariable.kV, tool, np.zeros(3), world, world
        )
        torque = np.abs(plant.CalcGravityGeneralizedForces(context) + J.T @ weight)
        worst = np.maximum(worst, torque)
    effort = plant.GetEffortUpperLimits()
    assert (worst < effort).all()
    assert worst[1] > 0.4 * effort[1]  # nor are they far too strong


def test_arm_is_clear_of_itself_where_it_should_be(arm: tuple[str, Facts, Scene]) -> None:
    _, facts, made = arm
    assert contacts(made, np.array(facts.home)) == set()
    met = [contacts(made, q) for q in configurations(made.plant, 400)]
    free = np.mean([not pairs for pairs in met])
    assert free > facts.free
    # No pair is in touch at large: that would be a fault of its shapes.
    for pair in set().union(*met):
        assert sum(pair in pairs for pairs in met) < 0.12 * len(met)


@pytest.mark.parametrize("member", [ur5e.UR5E, ur10e.UR10E], ids=["ur5e", "ur10e"])
def test_links_that_are_kept_apart_cannot_meet(member: _ur.Member) -> None:
    made = _arm.model(_ur.arm(member), _ur.collisions(member.build))
    unseen = tuple(replace(link, visuals=()) for link in made.links)
    builder = RobotDiagramBuilder(0.0)
    plant = builder.plant()
    builder.parser().AddModelsFromString(sdf_text(replace(made, links=unseen, apart=())), "sdf")
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("base_link"))
    diagram = builder.Build()
    root = diagram.CreateDefaultContext()
    free = Scene(diagram, plant, root, plant.GetMyMutableContextFromRoot(root))
    for q in configurations(plant, 300):
        assert not set(made.apart) & contacts(free, q)


@pytest.mark.parametrize(
    ("name", "q"),
    [
        ("ur5e", [0.0, -Q, PI, 0.0, 0.0, 0.0]),  # forearm folded onto the upper arm
        ("ur10e", [0.0, -Q, PI, 0.0, 0.0, 0.0]),
        ("panda", [0.0, 1.76, 0.0, -3.0, 0.0, 0.5, 0.0]),  # hand at its own shoulder
        ("gen3", [0.0, -2.2, 0.0, -2.57, 0.0, -2.0, 0.0]),
        ("xarm7", [0.0, 0.0, 0.0, -0.19, 0.0, -1.69, 0.0]),
    ],
)
def test_arm_meets_itself_when_folded(name: str, q: list[float]) -> None:
    made = scene(name, weld=ARMS[name].base)
    assert contacts(made, np.array(q))


def test_arm_falls_without_gaining_energy(arm: tuple[str, Facts, Scene]) -> None:
    _, facts, made = arm
    plant, context = made.plant, made.context
    plant.SetPositions(context, np.array(facts.home) + 0.02)
    # At rest the energy is that of position alone.
    plant.get_actuation_input_port().FixValue(context, np.zeros(plant.num_actuators()))
    start = plant.EvalPotentialEnergy(context)
    simulator = Simulator(made.diagram, made.root)
    highest = -np.inf
    for time in np.linspace(0.1, 1.0, 10):
        simulator.AdvanceTo(time)
        assert np.isfinite(plant.GetPositionsAndVelocities(context)).all()
        highest = max(
            highest, plant.EvalPotentialEnergy(context) + plant.EvalKineticEnergy(context)
        )
    assert highest < start + 0.02 * abs(start)
    assert np.abs(plant.GetPositions(context) - facts.home).max() > 0.1


@needs_drake_models
class TestPandaAgainstDrake:
    def plants(self) -> tuple[MultibodyPlant, MultibodyPlant]:
        plant = MultibodyPlant(0.0)
        parser = Parser(plant)
        parser.package_map().Remove("drake_models")
        parser.package_map().Add("drake_models", str(DRAKE_MODELS))
        parser.AddModelsFromUrl("package://drake_models/franka_description/urdf/panda_arm.urdf")
        plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("panda_link0"))
        plant.Finalize()
        return scene("panda", weld="panda_link0").plant, plant

    def test_frames_and_gravity(self) -> None:
        mine, theirs = self.plants()
        a, b = mine.CreateDefaultContext(), theirs.CreateDefaultContext()
        for q in configurations(mine, 30):
            mine.SetPositions(a, q)
            theirs.SetPositions(b, q)
            for i in range(9):
                X, Y = (
                    plant.GetFrameByName(f"panda_link{i}").CalcPoseInWorld(context)
                    for plant, context in ((mine, a), (theirs, b))
                )
                np.testing.assert_allclose(X.GetAsMatrix4(), Y.GetAsMatrix4(), atol=1e-9)
            np.testing.assert_allclose(
                mine.CalcGravityGeneralizedForces(a),
                theirs.CalcGravityGeneralizedForces(b),
                atol=1e-6,
            )
            np.testing.assert_allclose(mine.CalcMassMatrix(a), theirs.CalcMassMatrix(b), atol=1e-6)

    def test_limits(self) -> None:
        mine, theirs = self.plants()
        for get in (
            MultibodyPlant.GetPositionLowerLimits,
            MultibodyPlant.GetPositionUpperLimits,
            MultibodyPlant.GetVelocityUpperLimits,
            MultibodyPlant.GetAccelerationUpperLimits,
            MultibodyPlant.GetEffortUpperLimits,
        ):
            np.testing.assert_allclose(get(mine), get(theirs), rtol=1e-9)
