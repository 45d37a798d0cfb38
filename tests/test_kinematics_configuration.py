"""The rate of q and v: against Drake's own maps and by differentiation."""

import numpy as np
import pytest
from pydrake.autodiffutils import ExtractGradient, InitializeAutoDiff
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    BallRpyJoint,
    JacobianWrtVariable,
    PrismaticJoint,
    RevoluteJoint,
    SpatialInertia,
)

from prehensile.kinematics.configuration import (
    difference,
    integrate,
    jacobian_wrt_qdot,
    jacobian_wrt_v,
    qdot_to_velocity_matrix,
    velocity_to_qdot_matrix,
)
from prehensile.kinematics.rotations import random_rotation

INERTIA = SpatialInertia.SolidBoxWithMass(1.0, 0.1, 0.2, 0.3)


def make_plant() -> MultibodyPlant:
    """A floating body with an arm of two joints, and a brick that floats by itself."""
    plant = MultibodyPlant(0.0)
    base, link, tool, _ = (
        plant.AddRigidBody(n, INERTIA) for n in ("base", "link", "tool", "brick")
    )
    frames = [b.body_frame() for b in (base, link, tool)]
    plant.AddJoint(RevoluteJoint("hinge", frames[0], frames[1], [0.6, 0.0, 0.8]))
    plant.AddJoint(PrismaticJoint("slide", frames[1], frames[2], [0.0, 1.0, 0.0]))
    plant.Finalize()
    return plant


def random_configuration(plant: MultibodyPlant, rng: np.random.Generator) -> np.ndarray:
    q = rng.normal(size=plant.num_positions())
    for body in map(plant.get_body, plant.GetFloatingBaseBodies()):
        start = body.floating_positions_start()
        q[start : start + 4] = random_rotation(rng).ToQuaternion().wxyz()
    return q


@pytest.fixture(scope="module")
def plant():
    return make_plant()


def test_matrices_are_those_of_drakes_maps(plant):
    rng = np.random.default_rng(0)
    context = plant.CreateDefaultContext()
    for _ in range(10):
        plant.SetPositions(context, random_configuration(plant, rng))
        v = rng.normal(size=plant.num_velocities())
        N, N_plus = velocity_to_qdot_matrix(plant, context), qdot_to_velocity_matrix(plant, context)
        qdot = plant.MapVelocityToQDot(context, v)
        np.testing.assert_allclose(N @ v, qdot, atol=1e-14)
        np.testing.assert_allclose(
            N_plus @ qdot, plant.MapQDotToVelocity(context, qdot), atol=1e-14
        )
        np.testing.assert_allclose(N_plus @ N, np.eye(plant.num_velocities()), atol=1e-14)


def test_jacobians_by_either(plant):
    rng = np.random.default_rng(1)
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, random_configuration(plant, rng))
    frame, W = plant.GetFrameByName("tool"), plant.world_frame()
    J = {
        by: plant.CalcJacobianSpatialVelocity(context, by, frame, [0.1, 0.2, 0.3], W, W)
        for by in (JacobianWrtVariable.kQDot, JacobianWrtVariable.kV)
    }
    J_v = J[JacobianWrtVariable.kV]
    np.testing.assert_allclose(
        jacobian_wrt_v(J[JacobianWrtVariable.kQDot], plant, context), J_v, atol=1e-14
    )
    np.testing.assert_allclose(
        jacobian_wrt_v(jacobian_wrt_qdot(J_v, plant, context), plant, context), J_v, atol=1e-14
    )


def test_gradient_of_a_position_by_autodiff(plant):
    # The derivative of a function of q, four numbers for a rotation, becomes the Jacobian by v.
    rng = np.random.default_rng(2)
    context = plant.CreateDefaultContext()
    q = random_configuration(plant, rng)
    plant.SetPositions(context, q)
    plant_ad = plant.ToAutoDiffXd()
    context_ad = plant_ad.CreateDefaultContext()
    plant_ad.SetPositions(context_ad, InitializeAutoDiff(q).ravel())
    X_WT = plant_ad.GetFrameByName("tool").CalcPoseInWorld(context_ad)
    gradient = ExtractGradient(X_WT.translation())
    W, tool = plant.world_frame(), plant.GetFrameByName("tool")
    J_v = plant.CalcJacobianTranslationalVelocity(
        context, JacobianWrtVariable.kV, tool, [0.0, 0.0, 0.0], W, W
    )
    np.testing.assert_allclose(jacobian_wrt_v(gradient, plant, context), J_v, atol=1e-12)


def test_integrating_moves_frames_with_the_velocity_that_the_jacobian_says(plant):
    rng = np.random.default_rng(3)
    context = plant.CreateDefaultContext()
    tool, W = plant.GetFrameByName("tool"), plant.world_frame()
    h = 1e-5
    for _ in range(10):
        q = random_configuration(plant, rng)
        v = rng.normal(size=plant.num_velocities())
        positions = []
        for t in (-h, h):
            plant.SetPositions(context, integrate(plant, q, v, t))
            positions.append(tool.CalcPoseInWorld(context).translation())
        plant.SetPositions(context, q)
        J = plant.CalcJacobianTranslationalVelocity(
            context, JacobianWrtVariable.kV, tool, [0.0, 0.0, 0.0], W, W
        )
        np.testing.assert_allclose((positions[1] - positions[0]) / (2 * h), J @ v, atol=1e-8)


def test_difference_undoes_integration(plant):
    rng = np.random.default_rng(4)
    for _ in range(20):
        q_from, q_to = (random_configuration(plant, rng) for _ in range(2))
        v = difference(plant, q_from, q_to)
        back = difference(plant, integrate(plant, q_from, v), q_to)
        np.testing.assert_allclose(back, np.zeros(plant.num_velocities()), atol=1e-7)
        long = integrate(plant, q_from, 1e3 * v)  # many turns: still unit quaternions
        for body in map(plant.get_body, plant.GetFloatingBaseBodies()):
            start = body.floating_positions_start()
            assert np.linalg.norm(long[start : start + 4]) == pytest.approx(1.0, abs=1e-14)


def test_misuse_is_named(plant):
    nq, nv = plant.num_positions(), plant.num_velocities()
    with pytest.raises(ValueError, match="q must be"):
        integrate(plant, np.zeros(nq + 1), np.zeros(nv))
    with pytest.raises(ValueError, match="v must be"):
        integrate(plant, np.zeros(nq), np.zeros(nv + 1))
    q = plant.GetPositions(plant.CreateDefaultContext())
    with pytest.raises(ValueError, match="v must be finite"):
        integrate(plant, q, np.full(nv, np.nan))
    with pytest.raises(ValueError, match="duration must be finite"):
        integrate(plant, q, np.zeros(nv), np.inf)
    ball = MultibodyPlant(0.0)
    body = ball.AddRigidBody("body", INERTIA)
    ball.AddJoint(BallRpyJoint("ball", ball.world_frame(), body.body_frame()))
    ball.Finalize()
    with pytest.raises(ValueError, match="joint 'ball'"):
        integrate(ball, np.zeros(3), np.zeros(3))
