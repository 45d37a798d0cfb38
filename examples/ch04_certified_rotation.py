# %% [markdown]
# # Four of five are wrong: voting, letting go, and a certificate
#
# Truncated least squares lets no measurement cost more than 1,
#
# $$\min_x \sum_i \min\left(\frac{r_i(x)^2}{\beta^2},\, 1\right),$$
#
# so it does not care how wrong an outlier is. But it has a minimum for almost every set of
# measurements that might be the right ones. TEASER takes the pose apart: scale and translation are
# numbers, for which the global minimum is found by sorting; only the rotation needs more, and there
# a relaxation says afterwards whether an answer is the best one. (Section 4.5.6; Yang, Shi and
# Carlone, "TEASER", 2021.)

# %%
import matplotlib.pyplot as plt
import numpy as np
from scipy.spatial.transform import Rotation

from prehensile.perception.registration import certify_rotation, fit_rotation, gnc_rotation, vote
from prehensile.viz.figures import save_figure

# %% [markdown]
# ## One unknown: adaptive voting
#
# Thirty measurements of a number, of which 24 are anywhere. Each has an interval around it in
# which it agrees. Between two neighbouring ends of intervals, the set of those that agree stays the
# same and the cost is a parabola: looking at some 60 parabolas finds the lowest point of all, with
# no start to choose.

# %%
rng = np.random.default_rng(4)
truth, bound = 0.62, 0.05
values = np.concatenate([truth + rng.uniform(-0.6, 0.6, 6) * bound, rng.uniform(-1, 2, 24)])
found = vote(values, bound)
assert abs(found.estimate - truth) < 0.5 * bound
assert found.inliers[:6].all()
assert abs(np.mean(values) - truth) > bound  # Least squares without truncation.

x = np.linspace(-1.1, 2.1, 6401)
cost = np.minimum(((x[:, None] - values) / bound) ** 2, 1).sum(axis=1)
assert np.isclose(cost.min(), found.cost, atol=0.01)
assert np.isclose(x[cost.argmin()], found.estimate, atol=1e-3)
local = (cost < np.roll(cost, 1)) & (cost < np.roll(cost, -1)) & (cost < len(values) - 1e-9)
assert local.sum() > 10

fig, axes = plt.subplots(2, 1, figsize=(8, 4.6), sharex=True, height_ratios=(1, 1.2))
order = np.argsort(values)
for row, i in enumerate(order):
    colour = "tab:green" if found.inliers[i] else "0.6"
    axes[0].plot([values[i] - bound, values[i] + bound], [row, row], color=colour, lw=2)
    axes[0].plot(values[i], row, ".", color="black", ms=4)
axes[0].set(title="measurements and their intervals", yticks=[])
axes[1].plot(x, cost, lw=1)
axes[1].plot(found.estimate, found.cost, "o", color="tab:green", label="the vote")
axes[1].axvline(truth, color="tab:red", ls="--", lw=1, label="truth")
axes[1].axvline(values.mean(), color="0.5", ls=":", label="mean")
axes[1].set(ylabel="cost", xlabel="x")
axes[1].legend()
fig.tight_layout()
save_figure(fig, "vote")

# %% [markdown]
# ## A rotation: graduated non-convexity
#
# Unit vectors with their rotated partners, a hundredth of noise, and a growing part of the partners
# wrong. The loss starts as a convex one, for which all vectors count, and is bent step by step into
# the truncated one, letting go of those that fit badly. It is fast and needs no guess; with a
# hundred vectors it is right while no more than some three quarters are wrong. Beyond, the early
# steps already look the wrong way.


# %%
def problem(count, right, seed):
    """Vectors of the model and the scene, and the rotation; the first so many are right."""
    rng = np.random.default_rng(seed)
    R = Rotation.random(random_state=seed).as_matrix()
    model = rng.normal(size=(count, 3))
    model /= np.linalg.norm(model, axis=1, keepdims=True)
    scene = model @ R.T + rng.normal(0, 0.01, (count, 3))
    wrong = rng.normal(size=(count - right, 3))
    scene[right:] = wrong / np.linalg.norm(wrong, axis=1, keepdims=True)
    return model, scene, R


def angle(R, R_true):
    """Angle between two rotations [deg]."""
    return np.degrees(Rotation.from_matrix(R @ R_true.T).magnitude())


bound = 0.04  # Four standard deviations.
parts = np.array([0.0, 0.2, 0.4, 0.6, 0.7, 0.8, 0.9])
errors = {"least squares": [], "graduated non-convexity": []}
for part in parts:
    trials = [problem(100, round(100 * (1 - part)), seed) for seed in range(40)]
    errors["least squares"].append([angle(fit_rotation(a, b).R_WO, R) for a, b, R in trials])
    errors["graduated non-convexity"].append(
        [angle(gnc_rotation(a, b, bound).R_WO, R) for a, b, R in trials]
    )
rates = {name: (np.array(e) < 2).mean(axis=1) for name, e in errors.items()}
assert rates["graduated non-convexity"][:4].min() == 1
assert rates["least squares"][3] < 0.1
assert rates["graduated non-convexity"][-1] < 0.8

fig, ax = plt.subplots(figsize=(6.4, 3.4))
for name, rate in rates.items():
    ax.plot(100 * parts, 100 * rate, "o-", label=name)
ax.set(xlabel="wrong partners [%]", ylabel="within 2° [%]", title="40 trials, 100 vectors")
ax.legend()
fig.tight_layout()
save_figure(fig, "breakdown")

# %% [markdown]
# ## A certificate
#
# Ten vectors, two of them right. As a quadratic form in the unit quaternion $q$ and a sign for
# each vector, $x = (q, s_1 q, \dots, s_{10} q)$, the problem is to minimize $\operatorname{tr}(C
# x x^T)$. Putting any positive semidefinite $Z$ with the same symmetries in the place of $x x^T$
# makes it convex, and its minimum a lower bound for every rotation. If $Z$ comes out with rank
# one, it *is* an $x x^T$, and the rotation in it is the best one.

# %%
model, scene, R_true = problem(10, 2, seed=0)
guess = gnc_rotation(model, scene, bound)
certificate = certify_rotation(model, scene, bound)
print(f"graduated: cost {guess.cost:.3f}, {angle(guess.R_WO, R_true):.0f}° off")
print(
    f"certified: cost {certificate.cost:.3f}, {angle(certificate.R_WO, R_true):.1f}° off, "
    f"bound {certificate.lower_bound:.3f}, second eigenvalue {certificate.rank_ratio:.0e}"
)
assert angle(guess.R_WO, R_true) > 20  # Lost among the wrong ones: no two of them agree.
assert certificate.tight
assert certificate.rank_ratio < 1e-4
assert angle(certificate.R_WO, R_true) < 3
assert certificate.inliers.tolist() == [True, True] + [False] * 8
assert guess.cost > certificate.cost + 0.5

# %% [markdown]
# By brute force: of 100 000 rotations at random, all but a few agree with nothing at all and cost
# 10; none is below the bound. The best ones with one vector right cost about 9.

# %%
tried = Rotation.random(100_000, random_state=1).as_matrix()
squares = ((np.einsum("kij,nj->kni", tried, model) - scene) ** 2).sum(axis=-1)
costs = np.minimum(squares / bound**2, 1).sum(axis=1)
assert costs.min() > certificate.lower_bound - 1e-6

fig, ax = plt.subplots(figsize=(7, 3.2))
ax.hist(costs, np.linspace(7.9, 10.05, 87), color="0.7", log=True)
ax.axvline(certificate.lower_bound, color="tab:red", lw=3, alpha=0.5, label="lower bound")
ax.axvline(certificate.cost, color="tab:green", ls="--", label="certified rotation")
ax.axvline(guess.cost, color="tab:blue", ls="--", label="graduated non-convexity")
ax.set(xlabel="cost", ylabel="rotations", title="100 000 rotations at random")
ax.legend(loc="upper left")
fig.tight_layout()
save_figure(fig, "certificate")

# %% [markdown]
# A certificate is about the cost, not about the world: if by chance wrong vectors agree better than
# the right ones, their rotation is the best one and is certified. Against that only more
# measurements help. Here is such a case: the best rotation is proven, and 130° off.

# %%
model, scene, R_true = problem(10, 2, seed=1)
by_chance = certify_rotation(model, scene, bound)
right = gnc_rotation(model[:2], scene[:2], bound)
true_cost = np.minimum(((scene - model @ right.R_WO.T) ** 2).sum(axis=1) / bound**2, 1).sum()
assert by_chance.tight
assert angle(by_chance.R_WO, R_true) > 90
assert by_chance.cost < true_cost
