"""Times along a path: limits at every instant, rest at the ends, and Drake's answer."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from iiwa_plant import make_iiwa
from pydrake.multibody.optimization import Toppra
from pydrake.trajectories import PiecewisePolynomial

from prehensile.errors import InputError
from prehensile.kinematics.joint_limits import JointLimits
from prehensile.planning.blend import round_corners
from prehensile.planning.time_optimal import fastest_profile
from prehensile.planning.trajectory import join_paths, time_parameterize

LIMITS = JointLimits(
    np.full(7, -3.0),
    np.full(7, 3.0),
    np.array([1.71, 1.71, 1.75, 2.27, 2.44, 3.14, 3.14]),
    np.array([8.65, 5.44, 5.69, 11.0, 11.8, 13.8, 13.2]),
)


def random_path(seed: int, corners: int, size: float = 0.4) -> np.ndarray:
    return np.cumsum(np.random.default_rng(seed).normal(size=(corners, 7)) * size, axis=0)


def distance_to_polyline(points: np.ndarray, path: np.ndarray) -> np.ndarray:
    """Distance of each point to the nearest leg."""
    a, d = path[:-1], np.diff(path, axis=0)
    u = np.einsum("pkn,kn->pk", points[:, None] - a, d) / np.einsum("kn,kn->k", d, d)
    nearest = a + np.clip(u, 0.0, 1.0)[..., None] * d
    return np.linalg.norm(points[:, None] - nearest, axis=2).min(axis=1)


@settings(max_examples=30, deadline=None)
@given(
    seed=st.integers(0, 10_000),
    corners=st.integers(2, 30),
    size=st.floats(1e-4, 1.0),
    speed=st.floats(0.1, 1.0),
)
def test_limits_hold_at_every_instant(seed, corners, size, speed):
    path = random_path(seed, corners, size)
    timed = time_parameterize(path, LIMITS, speed=speed)
    t = np.linspace(0.0, timed.duration, 4000)
    velocity = timed.trajectory.MakeDerivative(1).vector_values(t).T
    acceleration = timed.trajectory.MakeDerivative(2).vector_values(t).T
    assert np.all(np.abs(velocity) <= speed * LIMITS.velocity * (1.0 + 1e-6))
    assert np.all(np.abs(acceleration) <= LIMITS.acceleration * (1.0 + 1e-6))
    np.testing.assert_allclose(timed.value(0.0), path[0], atol=1e-12)
    np.testing.assert_allclose(timed.value(timed.duration), path[-1], atol=1e-12)
    for rate in (velocity, acceleration):
        np.testing.assert_allclose(rate[[0, -1]], 0.0, atol=1e-9)


@pytest.mark.parametrize("deviation", [0.005, 0.02, 0.1])
def test_the_motion_keeps_to_its_path(deviation):
    path = random_path(4, 8)
    timed = time_parameterize(path, LIMITS, deviation=deviation, smoothing=0.01)
    off = distance_to_polyline(timed.sample(0.002), path)
    assert off.max() <= deviation + 2e-3
    assert off.max() >= 0.2 * deviation  # it does use what it is given


def test_as_quick_as_drake_on_the_same_rounded_path():
    plant = make_iiwa()
    for seed in range(5):
        smooth = round_corners(random_path(seed, 6), 0.02)
        x = fastest_profile(smooth, LIMITS.velocity, LIMITS.acceleration)
        ours = np.sum(2.0 * np.diff(smooth.s) / (np.sqrt(x[:-1]) + np.sqrt(x[1:])))
        slopes = np.vstack([smooth.slope_start, smooth.slope_end[-1:]])
        spline = PiecewisePolynomial.CubicHermite(smooth.s, smooth.q.T, slopes.T)
        toppra = Toppra(spline, plant, smooth.s)
        toppra.AddJointVelocityLimit(-LIMITS.velocity, LIMITS.velocity)
        toppra.AddJointAccelerationLimit(-LIMITS.acceleration, LIMITS.acceleration)
        theirs = toppra.SolvePathParameterization().end_time()
        # Drake holds the limits at grid points alone; ours holds them in between too.
        assert ours == pytest.approx(theirs, rel=0.08)


def test_a_straight_line_has_the_closed_form_of_one_joint():
    v, a, length = 1.5, 6.0, 1.2
    limits = JointLimits(np.array([-9.0]), np.array([9.0]), np.array([v]), np.array([a]))
    smooth = round_corners(np.array([[0.0], [length]]), 0.01)
    x = fastest_profile(smooth, limits.velocity, limits.acceleration)
    time = np.sum(2.0 * np.diff(smooth.s) / (np.sqrt(x[:-1]) + np.sqrt(x[1:])))
    # The switches fall inside an interval of the grid, which costs a little.
    assert length / v + v / a <= time <= (length / v + v / a) * 1.01


def test_speed_of_each_leg():
    path = np.zeros((3, 7))
    path[1:, 5] = [1.0, 2.0]
    timed = time_parameterize(path, LIMITS, speed=[1.0, 0.2], smoothing=0.01)
    t = np.linspace(0.0, timed.duration, 2000)
    q = timed.trajectory.vector_values(t)[5]
    rate = np.abs(timed.trajectory.MakeDerivative(1).vector_values(t)[5])
    assert rate[q > 1.01].max() <= 0.2 * LIMITS.velocity[5] * (1.0 + 1e-6)
    assert rate[q < 0.9].max() >= 0.9 * LIMITS.velocity[5]


def test_same_path_same_bits():
    path = random_path(9, 12)
    a, b = (time_parameterize(path, LIMITS) for _ in range(2))
    np.testing.assert_array_equal(a.sample(0.01), b.sample(0.01))


def test_standing_still_is_a_motion():
    q = np.arange(7.0) / 10
    timed = time_parameterize(np.array([q, q]), LIMITS)
    np.testing.assert_allclose(timed.value(0.5 * timed.duration), q, atol=1e-15)


def test_join_paths_drops_what_is_repeated():
    a, b = random_path(0, 3), random_path(1, 4)
    joined = join_paths(a, np.vstack([a[-1], b]), b[-1:])
    np.testing.assert_array_equal(joined, np.vstack([a, b]))


@pytest.mark.parametrize(
    ("path", "speed"),
    [
        (np.full((3, 7), np.nan), 1.0),
        (np.zeros((3, 6)), 1.0),
        (np.zeros((0, 7)), 1.0),
        (random_path(0, 3), 0.0),
        (random_path(0, 3), [0.5, 1.5]),
    ],
)
def test_bad_input_is_refused(path, speed):
    with pytest.raises(InputError):
        time_parameterize(path, LIMITS, speed=speed)
