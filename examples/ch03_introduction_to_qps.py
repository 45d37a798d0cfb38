# %% [markdown]
# # Quadratic programs
#
# A quadratic program minimizes a convex quadratic cost under linear constraints:
#
# $$\min_x \; \frac{1}{2} x^T Q x + b^T x \quad \text{subject to} \quad A x \le c$$
#
# Drake's `MathematicalProgram` takes it in symbols or in matrices, and picks a solver.
# (Exercise 3.9.)

# %%
import matplotlib.pyplot as plt
import numpy as np
from pydrake.solvers import MathematicalProgram, Solve

from prehensile.viz.figures import save_figure

# %% [markdown]
# ## In symbols
#
# The point of the half-plane $x + y \le 2$ that is nearest to $(3, 2)$.

# %%
program = MathematicalProgram()
x = program.NewContinuousVariables(2, "x")
program.AddQuadraticCost((x[0] - 3.0) ** 2 + (x[1] - 2.0) ** 2)
program.AddLinearConstraint(x[0] + x[1] <= 2.0)
result = Solve(program)
assert result.is_success()
nearest = result.GetSolution(x)
# It is the foot of the perpendicular on the line.
np.testing.assert_allclose(nearest, [1.5, 0.5], atol=1e-6)

# %% [markdown]
# ## In matrices
#
# The same with $Q = 2I$ and $b = -2 (3, 2)$, which is what a controller would write.

# %%
target = np.array([3.0, 2.0])
program = MathematicalProgram()
x = program.NewContinuousVariables(2, "x")
program.AddQuadraticCost(2.0 * np.eye(2), -2.0 * target, x)
halfplane = program.AddLinearConstraint(np.ones((1, 2)), [-np.inf], [2.0], x)
result = Solve(program)
np.testing.assert_allclose(result.GetSolution(x), nearest, atol=1e-6)

# %% [markdown]
# ## What the multiplier says
#
# At the optimum the cost can only fall by leaving the half-plane: its gradient is a multiple of
# the constraint's normal, $\nabla f + \lambda a = 0$ with $\lambda \ge 0$, and $\lambda$ is how
# fast the cost would fall if the constraint were moved.

# %%
gradient = 2.0 * (nearest - target)
multiplier = -result.GetDualSolution(halfplane)[0]
assert multiplier > 0.0
np.testing.assert_allclose(gradient + multiplier * np.ones(2), 0.0, atol=1e-5)


def least_cost(bound):
    """The least squared distance from the target to x + y <= bound."""
    return (target.sum() - bound) ** 2 / 2.0


change = (least_cost(2.0 + 1e-6) - least_cost(2.0)) / 1e-6
np.testing.assert_allclose(change, -multiplier, atol=1e-4)

# %%
figure, axes = plt.subplots(figsize=(5.6, 5))
u, w = np.meshgrid(np.linspace(-1.0, 4.5, 200), np.linspace(-1.5, 4.0, 200))
axes.contour(u, w, (u - 3.0) ** 2 + (w - 2.0) ** 2, levels=np.arange(0.5, 20.0, 1.5))
axes.fill_between([-1.0, 4.5], [3.0, -2.5], 4.0, color="tab:red", alpha=0.2, lw=0)
axes.plot(*target, "kx", label="target")
axes.plot(*nearest, "o", color="tab:red", label="optimum")
axes.quiver(*nearest, *(-gradient), angles="xy", scale_units="xy", scale=3, label="-gradient")
axes.set(xlim=(-1, 4.5), ylim=(-1.5, 4), aspect="equal", xlabel="$x_0$", ylabel="$x_1$")
axes.legend(loc="lower left")
save_figure(figure, "nearest_point_of_a_half_plane")
