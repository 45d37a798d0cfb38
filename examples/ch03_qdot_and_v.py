# %% [markdown]
# # The rate of q is not v
#
# A free body has seven positions and six velocities: its orientation is a unit quaternion, its
# angular velocity a vector. So $\dot q \ne v$; the two are related by $\dot q = N(q) v$ and $v =
# N^+(q) \dot q$, and a Jacobian belongs to one of the two. (Example 3.5.)

# %%
import matplotlib.pyplot as plt
import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import JacobianWrtVariable, SpatialInertia

from prehensile.kinematics.configuration import (
    integrate,
    jacobian_wrt_qdot,
    qdot_to_velocity_matrix,
    velocity_to_qdot_matrix,
)
from prehensile.viz.figures import save_figure

plant = MultibodyPlant(0.0)
body = plant.AddRigidBody("body", SpatialInertia.SolidBoxWithMass(1.0, 0.1, 0.1, 0.1))
plant.Finalize()
context = plant.CreateDefaultContext()
assert (plant.num_positions(), plant.num_velocities()) == (7, 6)

# %%
rng = np.random.default_rng(0)
q = rng.normal(size=7)
q[:4] /= np.linalg.norm(q[:4])
v = rng.normal(size=6)
plant.SetPositions(context, q)
N, N_plus = velocity_to_qdot_matrix(plant, context), qdot_to_velocity_matrix(plant, context)
print(np.round(N, 2))
assert N.shape == (7, 6)
qdot = N @ v
np.testing.assert_allclose(N_plus @ qdot, v, atol=1e-12)
np.testing.assert_allclose(N_plus @ N, np.eye(6), atol=1e-12)
# The quaternion keeps its length: its rate is perpendicular to it.
assert abs(q[:4] @ qdot[:4]) < 1e-12

# %% [markdown]
# ## Two Jacobians
#
# Drake gives the Jacobian of a frame's spatial velocity by $v$ or by $\dot q$. Both give the same
# velocity, from another vector.

# %%
world, B = plant.world_frame(), body.body_frame()
J_v, J_qdot = (
    plant.CalcJacobianSpatialVelocity(context, variable, B, [0.1, 0.0, 0.2], world, world)
    for variable in (JacobianWrtVariable.kV, JacobianWrtVariable.kQDot)
)
assert J_v.shape == (6, 6)
assert J_qdot.shape == (6, 7)
np.testing.assert_allclose(J_qdot @ qdot, J_v @ v, atol=1e-12)
np.testing.assert_allclose(jacobian_wrt_qdot(J_v, plant, context), J_qdot, atol=1e-12)

# %% [markdown]
# ## What goes wrong when they are confused
#
# Taking Euler steps $q + h \dot q$ the quaternion grows longer than one, the more the longer the
# steps. Moving along $v$ instead, on the group of rotations, it cannot.

# %%
spin = np.array([0.0, 0.0, 2.0, 0.0, 0.0, 0.0])
figure, (left, right) = plt.subplots(1, 2, figsize=(10, 3.6))
for h in (0.05, 0.02):
    q_euler = q_group = np.array([1.0, 0, 0, 0, 0, 0, 0])
    lengths, angles = [], []
    for _ in range(round(3.0 / h)):
        plant.SetPositions(context, q_euler)
        q_euler = q_euler + h * velocity_to_qdot_matrix(plant, context) @ spin
        q_group = integrate(plant, q_group, spin, h)
        lengths.append([np.linalg.norm(q_euler[:4]), np.linalg.norm(q_group[:4])])
        angles.append(2.0 * np.unwrap([np.arctan2(q_group[3], q_group[0])])[0])
    t = h * np.arange(1, len(lengths) + 1)
    left.plot(t, np.array(lengths)[:, 0], label=f"Euler, {1e3 * h:g} ms")
    np.testing.assert_allclose(np.array(lengths)[:, 1], 1.0, atol=1e-12)
    assert lengths[-1][0] > 1.02
    # Three seconds at 2 rad/s.
    turned = np.angle(np.exp(1j * (np.array(angles) - 2.0 * t)))
    np.testing.assert_allclose(turned, 0.0, atol=1e-9)
left.axhline(1.0, color="k", linestyle=":", label="along v")
left.set(xlabel="t (s)", title="length of the quaternion")
left.legend()
image = right.matshow(np.abs(N), cmap="Blues")
right.set(title="|N(q)|: 7 rates from 6 velocities", xlabel="v", ylabel="rate of q")
figure.colorbar(image)
save_figure(figure, "quaternion_length")
