"""Robust losses: against their definitions' properties and numerical derivatives."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from prehensile.perception.registration import RobustLoss

SCALES = st.floats(1e-3, 10)
RATIOS = st.floats(0, 20)


@pytest.mark.parametrize("kind", RobustLoss)
@given(c=SCALES, ratio=RATIOS)
def test_weight_is_derivative_of_loss_by_square(kind, c, ratio):
    r2, h = (ratio * c) ** 2, 1e-6 * c * c
    if abs(r2 - c * c) < 2 * h:
        return  # Truncation has a corner there.
    low, high = np.sqrt(max(r2 - h, 0)), np.sqrt(r2 + h)
    slope = (kind.loss(high, c) - kind.loss(low, c)) / (high**2 - low**2)
    assert slope == pytest.approx(kind.weight(ratio * c, c), abs=1e-5)


@pytest.mark.parametrize("kind", RobustLoss)
@given(c=SCALES, a=RATIOS, b=RATIOS)
def test_losses_grow_no_faster_than_squares(kind, c, a, b):
    low, high = sorted((a * c, b * c))
    assert kind.loss(low, c) <= kind.loss(high, c) + 1e-12
    assert kind.loss(high, c) <= high**2 * (1 + 1e-12)
    assert 0 <= kind.weight(high, c) <= kind.weight(low, c) + 1e-12 <= 1 + 1e-9
    assert kind.loss(-high, c) == kind.loss(high, c)


def test_limits_far_out():
    far = np.array([1e3, 1e4])
    np.testing.assert_allclose(RobustLoss.TRUNCATED.loss(far, 2.0), 4)
    np.testing.assert_allclose(RobustLoss.TUKEY.loss(far, 2.0), 4 / 3)
    np.testing.assert_allclose(RobustLoss.GEMAN_MCCLURE.loss(far, 2.0), 4, rtol=1e-5)
    np.testing.assert_allclose(np.diff(RobustLoss.HUBER.loss(far, 2.0)), 2 * 2 * 9e3)


@pytest.mark.parametrize("scale", [0.0, -1.0, np.nan, np.inf])
def test_bad_scale_is_named(scale):
    with pytest.raises(ValueError, match="scale"):
        RobustLoss.HUBER.loss(1.0, scale)
