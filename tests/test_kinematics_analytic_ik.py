"""Analytic inverse kinematics of plants, against Drake's forward kinematics."""

import numpy as np
import pytest
from pydrake.common.eigen_geometry import AngleAxis
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    Frame,
    PrismaticJoint,
    RevoluteJoint,
    SpatialInertia,
)

from prehensile.kinematics.analytic_ik import (
    PieperArm,
    SrsArm,
    UrArm,
    analytic_ik,
    arm_lines,
    equivalents,
    pieper_arm_from_plant,
    srs_arm_from_plant,
    ur_arm_from_plant,
)
from prehensile.models.packages import package_map

X_WB = RigidTransform(RollPitchYaw(0.3, -0.5, 2.0), [0.4, -0.2, 0.7])
X_TG = RigidTransform(RollPitchYaw(-1.0, 0.2, 0.6), [0.02, 0.03, 0.15])


def _arm(name: str, base: str, tip: str) -> tuple[MultibodyPlant, Frame]:
    """An embedded arm on a tilted base, with a tool frame beside its flange."""
    plant = MultibodyPlant(0.0)
    parser = Parser(plant)
    parser.package_map().AddMap(package_map())
    parser.AddModelsFromUrl(f"package://prehensile/{name}/{name}.sdf")
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName(base), X_WB)
    frame_G = plant.AddFrame(FixedOffsetFrame("G", plant.GetFrameByName(tip), X_TG))
    plant.Finalize()
    return plant, frame_G


def _dh_arm(rows: list[tuple[float, float, float]], prismatic: int | None = None):
    """A plant from standard Denavit-Hartenberg rows (d, a, alpha)."""
    plant = MultibodyPlant(0.0)
    parent = plant.world_frame()
    for i, (d, a, alpha) in enumerate(rows):
        link = plant.AddRigidBody(f"link{i}", SpatialInertia.SolidSphereWithMass(1.0, 0.1))
        kind = PrismaticJoint if i == prismatic else RevoluteJoint
        plant.AddJoint(
            kind(f"joint{i}", parent, link.body_frame(), [0, 0, 1], -2 * np.pi, 2 * np.pi)
        )
        offset = RigidTransform(RollPitchYaw(alpha, 0, 0), [a, 0, d])
        parent = plant.AddFrame(FixedOffsetFrame(f"end{i}", link.body_frame(), offset))
    plant.Finalize()
    return plant, parent


# P. Corke, B. Armstrong-Helouvry, "A search for consensus among model parameters reported for the
# PUMA 560 robot", ICRA 1994.
PUMA = [
    (0.6718, 0.0, np.pi / 2),
    (0.0, 0.4318, 0.0),
    (0.15005, 0.0203, -np.pi / 2),
    (0.4318, 0.0, np.pi / 2),
    (0.0, 0.0, -np.pi / 2),
    (0.05625, 0.0, 0.0),
]
# Six joints as of an ABB IRB: shoulder beside the base axis, elbow above the forearm's line.
IRB = [
    (0.486, 0.15, np.pi / 2),
    (0.0, 0.475, 0.0),
    (0.0, 0.105, np.pi / 2),
    (0.6, 0.0, -np.pi / 2),
    (0.0, 0.0, np.pi / 2),
    (0.065, 0.0, 0.0),
]


def _poses(plant: MultibodyPlant, frame_G: Frame, Q: np.ndarray) -> list[RigidTransform]:
    context = plant.CreateDefaultContext()
    poses = []
    for q in Q:
        plant.SetPositions(context, q)
        poses.append(frame_G.CalcPoseInWorld(context))
    return poses


def _samples(arm: SrsArm | UrArm | PieperArm, count: int) -> np.ndarray:
    rng = np.random.default_rng(0)
    return rng.uniform(arm.lower, arm.upper, (count, arm.num_joints))


def _check(plant: MultibodyPlant, frame_G: Frame, q: np.ndarray, X_WG: RigidTransform) -> None:
    for X in _poses(plant, frame_G, q):
        assert np.abs(X.GetAsMatrix4() - X_WG.GetAsMatrix4()).max() < 1e-9


@pytest.mark.parametrize("name", ["iiwa7", "iiwa14"])
def test_iiwa(name: str) -> None:
    plant, frame_G = _arm(name, "iiwa_link_0", "iiwa_link_7")
    arm = srs_arm_from_plant(plant, frame_G)
    goals = _samples(arm, 100)
    for q, X_WG in zip(goals, _poses(plant, frame_G, goals), strict=True):
        psi, branch = arm.arm_angle(q)
        found = arm.solve(X_WG, psi)
        assert np.abs(found.q - q).max(axis=1).min() < 1e-6
        assert branch in found.branch
        _check(plant, frame_G, found.q, X_WG)
        assert (found.q >= arm.lower).all()
        assert (found.q <= arm.upper).all()
        assert np.abs(arm.closest(X_WG, q).q - q).max() < 1e-6
        assert np.array_equal(found.q, arm.solve(X_WG.GetAsMatrix4(), psi).q)


@pytest.mark.parametrize("name", ["ur5e", "ur10e"])
def test_ur(name: str) -> None:
    plant, frame_G = _arm(name, "base_link", "tool0")
    arm = ur_arm_from_plant(plant, frame_G)
    goals = _samples(arm, 100)
    for q, X_WG in zip(goals, _poses(plant, frame_G, goals), strict=True):
        found = arm.solve(X_WG, q_near=q)
        assert np.abs(found.q - q).max(axis=1).min() < 1e-6
        _check(plant, frame_G, found.q, X_WG)


@pytest.mark.parametrize("rows", [PUMA, IRB], ids=["puma", "irb"])
def test_denavit_hartenberg(rows: list) -> None:
    plant, frame_G = _dh_arm(rows)
    arm = pieper_arm_from_plant(plant, frame_G)
    goals = _samples(arm, 100)
    for q, X_WG in zip(goals, _poses(plant, frame_G, goals), strict=True):
        found = arm.solve(X_WG, q_near=q)
        assert np.abs(found.q - q).max(axis=1).min() < 1e-6
        _check(plant, frame_G, found.q, X_WG)


def test_type_is_found() -> None:
    for name, base, tip, kind in (
        ("iiwa14", "iiwa_link_0", "iiwa_link_7", SrsArm),
        ("ur10e", "base_link", "tool0", UrArm),
    ):
        assert type(analytic_ik(*_arm(name, base, tip))) is kind
    assert type(analytic_ik(*_dh_arm(PUMA))) is PieperArm


def test_other_arms_are_refused() -> None:
    with pytest.raises(ValueError, match=r"frame_G: .*axis 7 does not pass"):
        analytic_ik(*_arm("panda", "panda_link0", "panda_link8"))
    skewed = [*PUMA[:4], (0.0, 0.02, -np.pi / 2), PUMA[5]]
    with pytest.raises(ValueError, match=r"UrArm: .*; PieperArm: .*axes 5 and 6"):
        analytic_ik(*_dh_arm(skewed))
    with pytest.raises(ValueError, match="5 joints carry it"):
        analytic_ik(*_dh_arm(PUMA[:5]))
    with pytest.raises(ValueError, match="joint 'joint2' that carries it is prismatic"):
        analytic_ik(*_dh_arm(PUMA, prismatic=2))


def test_lines_of_a_chain() -> None:
    plant, frame_G = _arm("iiwa14", "iiwa_link_0", "iiwa_link_7")
    lines = arm_lines(plant, frame_G)
    assert lines.joints == tuple(f"iiwa_joint_{i}" for i in range(1, 8))
    up = X_WB.rotation().col(2)
    assert lines.axes[0] == pytest.approx(up)
    assert lines.axes[6] == pytest.approx(up)
    (X_WG0,) = _poses(plant, frame_G, np.zeros((1, 7)))
    assert pytest.approx(X_WG0.GetAsMatrix4()) == lines.X_WG0


def test_lines_of_a_joint_that_carries_its_parent() -> None:
    """Each joint's axis and point are those of the motion that Drake computes."""
    plant = MultibodyPlant(0.0)
    ball = SpatialInertia.SolidSphereWithMass(1.0, 0.1)
    first, second = (plant.AddRigidBody(name, ball).body_frame() for name in ("first", "second"))
    mount = plant.AddFrame(FixedOffsetFrame("mount", first, X_TG))
    base = plant.AddFrame(FixedOffsetFrame("base", plant.world_frame(), X_WB))
    plant.AddJoint(RevoluteJoint("inverse", first, base, [0.6, 0.0, 0.8]))
    plant.AddJoint(RevoluteJoint("forward", mount, second, [0.0, 1.0, 0.0]))
    plant.Finalize()
    lines = arm_lines(plant, second)
    assert lines.joints == ("inverse", "forward")
    X_WG0 = RigidTransform(lines.X_WG0)
    for joint in range(2):
        q = np.zeros(2)
        q[plant.GetJointByName(lines.joints[joint]).position_start()] = 0.4
        (X_WG,) = _poses(plant, second, q[None])
        R = RotationMatrix(AngleAxis(0.4, lines.axes[joint]))
        X = RigidTransform(R, lines.points[joint] - R @ lines.points[joint]) @ X_WG0
        assert X.IsNearlyEqualTo(X_WG, 1e-12)


def test_equivalents() -> None:
    plant, frame_G = _arm("ur5e", "base_link", "tool0")
    arm = ur_arm_from_plant(plant, frame_G)
    q = np.array([0.5, -1.0, 1.2, 0.3, 2.0, -0.4])
    found = equivalents(arm, q)
    # Joint 3 turns by half a turn each way, the others by a whole one.
    limits = zip(q, arm.lower, arm.upper, strict=True)
    counts = [sum(a <= v + 2 * np.pi * k <= b for k in (-2, -1, 0, 1, 2)) for v, a, b in limits]
    assert len(found) == np.prod(counts) >= 32
    assert len(np.unique(found.round(9), axis=0)) == len(found)
    assert (found >= arm.lower).all()
    assert (found <= arm.upper).all()
    (X_WG,) = _poses(plant, frame_G, q[None])
    _check(plant, frame_G, found, X_WG)
    for bad in (np.zeros(7), np.full(6, np.nan)):
        with pytest.raises(ValueError, match="^q: "):
            equivalents(arm, bad)
    with pytest.raises(ValueError, match="^tolerance: "):
        ur_arm_from_plant(plant, frame_G, tolerance=float("nan"))
