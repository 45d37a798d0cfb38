"""Least durations: limits hold at every instant, and nothing faster would keep them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline, PPoly

from prehensile.kinematics.timing import LAWS, least_duration

LINE = CubicSpline([0.0, 0.5, 1.0], [[0.0, 0.0], [0.5, 0.1], [1.0, 0.2]])


def rates(path, law, duration, tau):
    """Velocities and accelerations by the chain rule, (N, n) each."""
    s = LAWS[law]
    length = path.x[-1] - path.x[0]
    at = path.x[0] + length * s(tau)
    s1, s2 = s.deriv(1)(tau)[:, None], s.deriv(2)(tau)[:, None]
    v = length * path(at, 1) * s1
    a = length * path(at, 1) * s2 + length**2 * path(at, 2) * s1**2
    return v / duration, a / duration**2


@pytest.mark.parametrize(
    ("law", "peak_velocity", "peak_acceleration"),
    [("linear", 1.0, 0.0), ("cubic", 1.5, 6.0), ("quintic", 1.875, 10.0 / np.sqrt(3.0))],
)
def test_laws_have_the_textbook_peaks(law, peak_velocity, peak_acceleration):
    tau = np.linspace(0.0, 1.0, 100_001)
    s = LAWS[law]
    assert [s(0.0), s(1.0)] == pytest.approx([0.0, 1.0])
    assert np.abs(s.deriv(1)(tau)).max() == pytest.approx(peak_velocity)
    assert np.abs(s.deriv(2)(tau)).max() == pytest.approx(peak_acceleration)
    if law != "linear":
        assert [s.deriv()(0.0), s.deriv()(1.0)] == pytest.approx([0.0, 0.0])


@pytest.mark.parametrize(("law", "peak_velocity"), [("cubic", 1.5), ("quintic", 1.875)])
def test_straight_line_by_its_closed_form(law, peak_velocity):
    # One joint moves by 1: T = peak / v where only velocity binds, sqrt(peak / a) for the other.
    least = least_duration(LINE, [0.5, 100.0], [1e9, 1e9], law)
    assert least.duration == pytest.approx(peak_velocity / 0.5, rel=2e-3)
    assert (least.joint, least.limit) == (0, "velocity")
    assert least.at == pytest.approx(0.5, abs=1e-3)
    peak = np.abs(LAWS[law].deriv(2)(np.linspace(0, 1, 10_001))).max()
    least = least_duration(LINE, [1e9, 1e9], [1e9, 0.02], law)
    assert least.duration == pytest.approx(np.sqrt(0.2 * peak / 0.02), rel=2e-3)
    assert (least.joint, least.limit) == (1, "acceleration")


@settings(max_examples=40)
@given(
    seed=st.integers(0, 2**32 - 1),
    knots=st.integers(4, 40),
    law=st.sampled_from(["linear", "cubic", "quintic"]),
)
def test_limits_hold_densely_and_are_used(seed, knots, law):
    rng = np.random.default_rng(seed)
    path = CubicSpline(np.cumsum(rng.uniform(0.2, 1.0, knots)), rng.normal(size=(knots, 3)))
    v_max, a_max = rng.uniform(0.1, 3.0, 3), rng.uniform(0.1, 10.0, 3)
    least = least_duration(path, v_max, a_max, law)
    # Instants that are no samples of the function's, and more of them.
    tau = np.sort(rng.uniform(0.0, 1.0, 50_000))
    v, a = rates(path, law, least.duration, tau)
    v_used, a_used = (np.abs(v) / v_max).max(), (np.abs(a) / a_max).max()
    assert max(v_used, a_used) <= 1.0 + 1e-9
    # The time is at most a few percent more than the samples alone would ask for.
    assert max(v_used, np.sqrt(a_used)) > 0.95
    used = {"velocity": v_used, "acceleration": np.sqrt(a_used)}
    assert used[least.limit] == pytest.approx(max(used.values()), rel=0.03)


def test_standing_still_takes_no_time():
    still = CubicSpline([0.0, 1.0, 2.0], np.ones((3, 2)))
    assert least_duration(still, [1.0, 1.0], [1.0, 1.0]).duration == 0.0


def test_no_limit_takes_no_time():
    assert least_duration(LINE, [np.inf] * 2, [np.inf] * 2).duration == 0.0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([0.0, 1.0], [1.0, 1.0]), "positive numbers"),
        (([1.0, 1.0], [1.0, np.nan]), "positive numbers"),
        (([1.0, 1.0], [1.0, 1.0], "septic"), "law must be one of"),
    ],
)
def test_misuse_is_named(arguments, message):
    with pytest.raises(ValueError, match=message):
        least_duration(LINE, *arguments)


def test_limits_that_do_not_fit_are_named():
    path = CubicSpline([0.0, 1.0, 2.0], [[0.0, 0.0], [1.0, 0.5], [0.0, 1.0]])
    with pytest.raises(ValueError, match="^velocity"):
        least_duration(path, [1.0, 1.0, 1.0], [1.0, 1.0])
    with pytest.raises(ValueError, match="^acceleration"):
        least_duration(path, [1.0, 1.0], [1.0, -1.0])
    with pytest.raises(ValueError, match="^path"):
        least_duration(PPoly(np.full((4, 1, 2), np.nan), [0.0, 1.0]), 1.0, 1.0)
