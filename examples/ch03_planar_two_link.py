# %% [markdown]
# # A planar arm of two links
#
# Forward kinematics, translational Jacobian and singularities of the arm that every text begins
# with; the formulas are checked against Drake on the same arm. (Exercise 3.5.)

# %%
import matplotlib.pyplot as plt
import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    JacobianWrtVariable,
    RevoluteJoint,
    SpatialInertia,
)

from prehensile.viz.figures import save_figure

l_1, l_2 = 1.0, 0.7

# %% [markdown]
# ## (a) Forward kinematics
#
# With $c_0 = \cos q_0$ and $c_{01} = \cos(q_0 + q_1)$,
#
# $$p^{AC} = \begin{bmatrix} l_1 c_0 + l_2 c_{01} \\ l_1 s_0 + l_2 s_{01} \end{bmatrix}$$


# %%
def forward(q):
    """p_AC, (2,)."""
    return np.array(
        [
            l_1 * np.cos(q[0]) + l_2 * np.cos(q[0] + q[1]),
            l_1 * np.sin(q[0]) + l_2 * np.sin(q[0] + q[1]),
        ]
    )


# %% [markdown]
# ## (b) The Jacobian
#
# $$J = \begin{bmatrix} -l_1 s_0 - l_2 s_{01} & -l_2 s_{01} \\
# l_1 c_0 + l_2 c_{01} & l_2 c_{01} \end{bmatrix}$$


# %%
def jacobian(q):
    """dp_AC / dq, (2, 2)."""
    s_0, s_01 = np.sin(q[0]), np.sin(q[0] + q[1])
    c_0, c_01 = np.cos(q[0]), np.cos(q[0] + q[1])
    return np.array([[-l_1 * s_0 - l_2 * s_01, -l_2 * s_01], [l_1 * c_0 + l_2 * c_01, l_2 * c_01]])


# %% [markdown]
# Drake agrees, at a hundred random configurations.

# %%
plant = MultibodyPlant(0.0)
end = plant.world_frame()
for k, length in enumerate((l_1, l_2)):
    link = plant.AddRigidBody(f"link{k}", SpatialInertia.SolidSphereWithMass(1.0, 0.1))
    plant.AddJoint(RevoluteJoint(f"joint{k}", end, link.body_frame(), [0.0, 0.0, 1.0]))
    X_LE = RigidTransform([length, 0.0, 0.0])
    end = plant.AddFrame(FixedOffsetFrame(f"end{k}", link.body_frame(), X_LE))
plant.Finalize()
context = plant.CreateDefaultContext()
world = plant.world_frame()
rng = np.random.default_rng(0)
for q in rng.uniform(-np.pi, np.pi, (100, 2)):
    plant.SetPositions(context, q)
    p_AC = plant.CalcPointsPositions(context, end, [0.0, 0.0, 0.0], world).ravel()
    np.testing.assert_allclose(forward(q), p_AC[:2], atol=1e-12)
    J = plant.CalcJacobianTranslationalVelocity(
        context, JacobianWrtVariable.kV, end, [0.0, 0.0, 0.0], world, world
    )
    np.testing.assert_allclose(jacobian(q), J[:2], atol=1e-12)

# %% [markdown]
# ## (c) Singularities
#
# The determinant of the Jacobian is $l_1 l_2 \sin q_1$: whatever the first joint does, the arm is
# singular where the second is straight ($q_1 = 0$) or folded ($q_1 = \pi$), on the border of what
# it reaches. There the hand cannot move along the arm.

# %%
for q in rng.uniform(-np.pi, np.pi, (100, 2)):
    np.testing.assert_allclose(np.linalg.det(jacobian(q)), l_1 * l_2 * np.sin(q[1]), atol=1e-12)
for q_1 in (0.0, np.pi):
    q = np.array([0.4, q_1])
    along = np.array([np.cos(0.4), np.sin(0.4)])
    assert np.linalg.matrix_rank(jacobian(q), tol=1e-9) == 1
    np.testing.assert_allclose(along @ jacobian(q), 0.0, atol=1e-12)

# %%
figure, (left, right) = plt.subplots(1, 2, figsize=(10.5, 4.4))
q_1 = np.linspace(-np.pi, np.pi, 181)
sigma = np.array([np.linalg.svd(jacobian([0.0, one]), compute_uv=False) for one in q_1])
left.plot(np.degrees(q_1), sigma, label=["largest", "smallest"])
left.plot(np.degrees(q_1), l_1 * l_2 * np.abs(np.sin(q_1)), "k:", label="their product")
left.set(xlabel="$q_1$ (°)", ylabel="m, m, m²", title="singular values of J")
left.legend()
reach = np.array([forward(q) for q in rng.uniform(-np.pi, np.pi, (4000, 2))])
right.plot(*reach.T, ".", markersize=1, color="0.7")
for q_1 in np.radians([0.0, 30.0, 90.0, 150.0]):
    q = np.array([0.9 - 0.5 * q_1, q_1])
    elbow, hand = l_1 * np.array([np.cos(q[0]), np.sin(q[0])]), forward(q)
    right.plot(*np.array([[0.0, 0.0], elbow, hand]).T, "o-", markersize=4)
right.set(aspect="equal", xlabel="x (m)", ylabel="y (m)", title="reach, and four postures")
save_figure(figure, "singular_values_and_reach")
