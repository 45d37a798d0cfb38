# %% [markdown]
# # Two objectives that compete through a constraint
#
# Two costs on two different variables seem to have nothing to do with one another. A constraint
# that binds both makes them compete; a small weight on the second keeps it out of the way of the
# first. The joint centering of differential inverse kinematics is such a second cost.
# (Exercise 3.11.)

# %%
import matplotlib.pyplot as plt
import numpy as np
from pydrake.solvers import MathematicalProgram, Solve

from prehensile.viz.figures import save_figure


def minimize(weight, constrained=True):
    """The minimum of (x - 5)² + weight (y + 3)², subject to x - y <= 6 if constrained."""
    program = MathematicalProgram()
    x, y = program.NewContinuousVariables(2, "xy")
    program.AddQuadraticCost((x - 5.0) ** 2 + weight * (y + 3.0) ** 2)
    if constrained:
        program.AddLinearConstraint(x - y <= 6.0)
    result = Solve(program)
    assert result.is_success()
    return result.GetSolution([x, y])


# %% [markdown]
# Without the constraint each objective gets what it wants. With it the objectives meet half way:
# on the line $y = x - 6$ the cost $(x - 5)^2 + w (x - 3)^2$ is least at
# $x = \frac{5 + 3 w}{1 + w}$.

# %%
weights = (1.0, 0.01)
solutions = [minimize(w) for w in weights]
np.testing.assert_allclose(minimize(1.0, constrained=False), [5.0, -3.0], atol=1e-5)
np.testing.assert_allclose(solutions[0], [4.0, -2.0], atol=1e-5)
for w, solution in zip(weights, solutions, strict=True):
    x = (5.0 + 3.0 * w) / (1.0 + w)
    np.testing.assert_allclose(solution, [x, x - 6.0], atol=1e-5)
# With a weight of 1/100 the first objective hardly notices the second.
assert abs(solutions[1][0] - 5.0) < 0.02

# %%
grid_x, grid_y = np.meshgrid(np.linspace(0.0, 8.0, 200), np.linspace(-6.0, 2.0, 200))
figure, panels = plt.subplots(1, 2, figsize=(10, 4.4), sharey=True)
for axes, w, solution in zip(panels, weights, solutions, strict=True):
    cost = (grid_x - 5.0) ** 2 + w * (grid_y + 3.0) ** 2
    axes.contour(grid_x, grid_y, cost, levels=np.geomspace(0.05, 40.0, 12), cmap="viridis")
    axes.fill_between([0.0, 8.0], [-6.0, 2.0], -6.0, color="tab:red", alpha=0.2, lw=0)
    axes.plot(5.0, -3.0, "kx", label="without the constraint")
    axes.plot(*solution, "o", color="tab:red", label="with it")
    axes.set(title=f"weight of the second objective {w:g}", xlabel="x", ylabel="y", aspect="equal")
panels[0].legend()
save_figure(figure, "competing_objectives")
